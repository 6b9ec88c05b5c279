"""Do the tests see a mistake? ``python -m tests.mutants csrc --count 50 --seed 1``.

Mutants are drawn by chance from all of a folder and made one at a time in a copy of the checkout.
First its tests run without a mutant, and what each of them calls is noted (`calls.py`); then each
mutant is shown to those that call its function, first to those of files named as its own, then to
the quickest, until one fails or `--most` seconds of processor time are spent: in a process forked
from this one, which has imported the libraries. Of ``csrc`` the 128-bit core alone is compiled,
with little optimisation and no inlining, in seconds.

Mutants that do not compile do not count, nor those of C that compile to the same; those of
``derive`` that no test saw are derived, and do not count where that gives what is checked in. The
test that derives all again sees every other one, and is left out.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import importlib
import json
import os
import random
import resource
import shlex
import shutil
import signal
import subprocess
import sys
import sysconfig
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest

from . import calls
from .changes import Change, changes

ROOT = Path(__file__).resolve().parents[2]
LEFT_OUT = shutil.ignore_patterns(
    *(".git", ".venv*", ".*_cache", ".benchmarks", ".hypothesis", "__pycache__", "build", "*.so")
)
TESTS = {  # of a room the examples in its docstrings, too
    "csrc": (
        *("tests/core", "tests/kinematics", "tests/arms", "tests/test_screw.py", "tests/published"),
        *("tests/moves/test_trajectory.py", "tests/modes/test_find.py"),
        *("tests/compensation/test_pso.py", "tests/measurements/test_observation.py"),
        *("tests/error_model/test_tolerance.py", "tests/error_model/test_sensitivity.py"),
    ),
    "derive": ("tests/derive", "tests/published"),
    "pkmcal/planning": ("tests/planning", "pkmcal/planning"),
    "pkmcal/statistics": ("tests/statistics", "pkmcal/statistics"),
    "pkmcal/estimation": ("tests/estimation", "tests/calibration", "pkmcal/estimation"),
    "pkmcal/calibration": ("tests/calibration", "tests/real", "pkmcal/calibration"),
}
NOT_MEANT = {
    "csrc": ("core_v3.c", "core_v4.c", "build.py"),
    "derive": ("modes.py", "__init__.py", "__main__.py"),
}
LEFT_OUT_OF = {  # what compares instruction sets, and is slow; what derives again and compares
    "csrc": ("--ignore=tests/core/test_bits.py", "--ignore=tests/core/test_chain_structs.py"),
    "derive": ("-k", "not test_regenerating_changes_nothing"),
}
LIBRARIES = (
    *("numpy", "scipy.optimize", "scipy.stats", "scipy.spatial", "scipy.sparse.linalg", "sympy"),
    *("mpmath", "matplotlib.pyplot", "jinja2", "typer.testing", "rich.console"),
    *("tomli_w", "tomlkit", "openpyxl", "cffi"),
)
NO_TESTS, OWN_ERROR = int(pytest.ExitCode.NO_TESTS_COLLECTED), 99
MEMORY = 6 << 30  # bytes that a process with a mutant may have
C_FLAGS = (
    "-std=c11 -Og -w -fPIC -shared -fvisibility=hidden -fno-math-errno -fno-trapping-math"
    " -ffp-contract=off -fcx-limited-range -Dalways_inline=unused"
    " -Werror=implicit-function-declaration"
)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("folder", choices=TESTS)
    parser.add_argument("--count", type=int, default=50, help="how many mutants that count")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=1e9, help="begin no other after this time")
    parser.add_argument("--most", type=float, default=60.0, help="seconds of tests for a mutant")
    parser.add_argument("--only", help="these of the draw, by their numbers: 3,17")
    parser.add_argument("--tests", nargs="+", help="in place of those of the folder")
    parser.add_argument("--recorded", type=Path, help="what tests call: read, or else written")
    chosen = parser.parse_args()
    began, ends = time.monotonic(), Counter[str]()
    for library in LIBRARIES:
        importlib.import_module(library)
    with tempfile.TemporaryDirectory() as temporary:
        copy = Path(temporary).resolve() / "checkout"
        shutil.copytree(ROOT, copy, ignore=LEFT_OUT)
        folder = Folder(chosen.folder, copy, chosen.tests or TESTS[chosen.folder], chosen.most)
        folder.record(chosen.recorded)
        for k, change in enumerate(folder.drawn(chosen.seed)):
            if sum(ends.values()) - ends["not counted"] >= chosen.count:
                break
            if time.monotonic() - began > chosen.seconds:
                break
            if chosen.only and str(k) not in chosen.only.split(","):
                continue
            end, by = folder.end(change)
            ends[end] += 1
            if end != "not counted":
                print(f"{k} {end}{by}: {change.named(folder.text(change))}", flush=True)
    counted = sum(ends.values()) - ends["not counted"]
    print(
        f"{chosen.folder}, seed {chosen.seed}: {ends['killed']} of {counted} killed"
        f" ({ends['killed'] / max(counted, 1):.0%}), {ends['not counted']} not counted"
    )
    return 0


class Folder:
    """A folder whose mutants are made in a copy of the checkout."""

    def __init__(self, name: str, copy: Path, tests: tuple[str, ...], most: float) -> None:
        self.name, self.copy, self.tests, self.most = name, copy, tests, most
        self.core = copy / "pkmcal" / "_core.abi3.so"
        self.known: dict[str, dict] = {}
        self.functions: list[tuple[str, int]] = []
        (copy / "pkmcal" / "derive").symlink_to(copy / "derive")
        (copy / "pkmcal" / "generated").symlink_to(copy / "generated")
        (copy.parent / "shared").symlink_to(ROOT.parent / "shared")  # data of real machines, if any
        if name == "csrc":
            self._narrow()
        else:
            for core in (ROOT / "pkmcal").glob("_core*.so"):
                shutil.copy2(core, copy / "pkmcal")

    def _narrow(self) -> None:
        """Leave the 128-bit core alone, and write what cffi makes of it."""
        for path in (self.copy / "csrc").iterdir():
            if path.suffix in (".c", ".h", ".py") and path.name != "lanes.h":
                text = path.read_text(encoding="utf-8").replace("__x86_64__", "PKMCAL_ALL_ISAS")
                path.write_text(text, encoding="utf-8")
        source = "import csrc.build as b; b.ffibuilder().emit_c_code('_core.c')"
        subprocess.run([sys.executable, "-c", source], cwd=self.copy, check=True)
        self._compile("_core.c", "-DPy_LIMITED_API=0x030a0000")
        for unit in ("core_base.c", "paths.c", "abi.c"):
            self._compile(f"csrc/{unit}")
        self._link()
        self.whole = {path: path.read_bytes() for path in self.copy.glob("*.o")}

    def _compile(self, unit: str, *more: str) -> bool:
        command = [*shlex.split(os.environ.get("CC", "gcc") + " " + C_FLAGS), *more]
        command += ["-Icsrc", "-Igenerated", "-I" + sysconfig.get_path("include")]
        command += ["-c", unit, "-o", Path(unit).stem + ".o"]
        return subprocess.run(command, cwd=self.copy, capture_output=True).returncode == 0

    def _link(self, name: str = "pkmcal/_core.abi3.so", *more: str) -> None:
        objects = sorted(str(path) for path in self.copy.glob("*.o"))
        command = ["gcc", "-shared", "-Wl,-Bsymbolic", *objects, *more, "-lm", "-o", name]
        subprocess.run(command, cwd=self.copy, check=True)

    def record(self, path: Path | None) -> None:
        """Note what each test calls, and leave out those that fail without a mutant."""
        if path and path.exists():
            stored = json.loads(path.read_text(encoding="utf-8"))
            self.known, self.functions = stored["tests"], stored["functions"]
        else:
            if self.name == "csrc":
                self._instrument()
            self.known = self._recorded()
            if self.name == "csrc":
                self._link()
        for test, known in self.known.items():
            if known["failed"]:
                print(f"fails without a mutant, left out: {test}", flush=True)
        if path and not path.exists():
            stored = {"tests": self.known, "functions": self.functions}
            path.write_text(json.dumps(stored), encoding="utf-8")
        self.known = {
            k: test for k, test in self.known.items() if test["ran"] and not test["failed"]
        }
        seconds = sum(test["seconds"] for test in self.known.values())
        print(f"{len(self.known)} tests, {seconds:.0f} s", flush=True)

    def _instrument(self) -> None:
        (self.copy / "hook.c").write_text(calls.HOOK, encoding="utf-8")
        more = ["-g", "-finstrument-functions"]
        self._compile("hook.c", "-O2", "-g")
        for unit in ("core_base.c", "paths.c", "abi.c"):
            self._compile(f"csrc/{unit}", *more)
        self._link()
        self.functions = sorted(
            {place for place, _ in calls.c_functions(self.copy, self.core).values()}
        )
        (self.copy / "hook.o").unlink()
        for path, content in self.whole.items():  # the core itself stays instrumented
            path.write_bytes(content)

    def _recorded(self) -> dict[str, dict]:
        found = self.copy / "recorded.json"

        def run() -> int:
            if self.name == "csrc":
                drain = calls.c_calls(self.copy, self.core)
            else:
                drain = calls.python_calls(self.copy, self.name.split("/")[0])
            recorder = calls.Recorder(drain)
            code = pytest.main([*self._options(), *self.tests], plugins=[recorder])
            sys.settrace(None)
            recorder.write(found)
            return int(code)

        if self._forked(run, 36000, bytecode=True) not in (0, 1):
            raise SystemExit((self.copy / "output.txt").read_text(encoding="utf-8"))
        return json.loads(found.read_text(encoding="utf-8"))

    def drawn(self, seed: int) -> list[Change]:
        """All mutants in an order of chance."""
        files = sorted((self.copy / self.name).glob("*.[chp]*"))
        found = [
            change
            for path in files
            if path.name not in NOT_MEANT.get(self.name, ()) and path.suffix in (".c", ".h", ".py")
            for change in changes(self.copy, str(path.relative_to(self.copy)))
        ]
        print(f"{len(found)} mutants of {self.name}", flush=True)
        random.Random(seed).shuffle(found)
        return found

    def text(self, change: Change) -> str:
        """The file without the change."""
        return (self.copy / change.file).read_text(encoding="utf-8")

    def end(self, change: Change) -> tuple[str, str]:
        """What becomes of a mutant: killed, survived, or not counted; and by how many tests."""
        path, text = self.copy / change.file, self.text(change)
        times = path.stat()
        path.write_text(change.applied(text), encoding="utf-8")
        try:
            if not self.compiles(path):
                return "not counted", ""
            tests = self.shown(change, text)
            began = time.monotonic()
            for some in (tests[:12], tests[12:60], tests[60:]):  # collecting takes time
                if some and not self.passes(some):
                    return "killed", f" in {time.monotonic() - began:.1f} s"
            if self.name == "derive" and self._derives_the_same():
                return "not counted", ""
            return "survived", f" {len(tests)} tests"
        finally:
            path.write_text(text, encoding="utf-8")
            os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))  # its bytecode holds again

    def shown(self, change: Change, text: str) -> list[str]:
        """The tests that see it, up to the time there is: first of files named as its own.

        Where none calls anything of its file, some that import it.
        """
        if self.name == "csrc":
            starts = [line for file, line in self.functions if file == change.file]
            first = calls.c_function(text, change.at, starts)
        else:
            first = calls.python_function(text, change.line(text))
        inside = [k for k, test in self.known.items() if [change.file, first] in test["calls"]]
        files = {k: {file for file, _ in test["calls"]} for k, test in self.known.items()}
        inside = inside or [k for k in self.known if change.file in files[k]]
        stem, seconds = Path(change.file).stem, 0.0
        if not inside:
            return sorted(self.known, key=lambda k: self.known[k]["seconds"])[:5]
        tests = sorted(
            inside, key=lambda k: (stem not in k.split("::")[0], self.known[k]["seconds"])
        )
        for k, test in enumerate(tests):
            seconds += self.known[test]["seconds"]
            if seconds > self.most:
                return tests[: k + 1]
        return tests

    def compiles(self, changed: Path) -> bool:
        """Whether it compiles, and to something else."""
        if self.name != "csrc":
            try:
                return bool(ast.parse(changed.read_text(encoding="utf-8")))
            except SyntaxError:
                return False
        units = [changed.name] if changed.suffix == ".c" else ["core_base.c", "paths.c", "abi.c"]
        for path, content in self.whole.items():
            path.write_bytes(content)
        if not all(self._compile(f"csrc/{unit}") for unit in units):
            return False
        if all(path.read_bytes() == content for path, content in self.whole.items()):
            return False
        self.core.unlink(missing_ok=True)
        self._link()
        return True

    def passes(self, tests: list[str]) -> bool:
        """Whether these tests pass."""
        files = list(dict.fromkeys(test.split("::")[0] for test in tests))
        limit = 60 + 10 * sum(self.known[test]["seconds"] for test in tests)

        def run() -> int:
            return int(pytest.main([*self._options(), "-x", *files], plugins=[calls.Chosen(tests)]))

        code = self._forked(run, limit)
        if code in (NO_TESTS, OWN_ERROR):
            raise SystemExit((self.copy / "output.txt").read_text(encoding="utf-8"))
        return code == 0

    def _derives_the_same(self) -> bool:
        """Whether a mutant of the derivation gives the same headers but for hashes."""

        def run() -> int:
            from pkmcal.derive.__main__ import differences  # type: ignore[import-not-found]

            lines = [line for line in differences().splitlines() if line[:1] in "+-"]
            return int(
                any(line[:3] not in ("+++", "---") and "derivation" not in line for line in lines)
            )

        return self._forked(run, 1200) == 0

    def _options(self) -> list[str]:
        options = [
            *("-q", "-m", "not slow", "-p", "no:cacheprovider", "-p", "no:xdist"),
            f"--rootdir={self.copy}",
        ]
        return [*options, *LEFT_OUT_OF.get(self.name, ())]

    def _forked(self, run: Callable[[], int], limit: float, bytecode: bool = False) -> int:
        """What this ends with in a process of its own, in the copy: below 0 if it is stopped.

        The limit is of processor time: other work may take all cores.
        """
        sys.stdout.flush()
        child = os.fork()
        if not child:
            try:
                os.setsid()
                resource.setrlimit(resource.RLIMIT_CPU, (int(limit), int(limit)))
                resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
                out = os.open(self.copy / "output.txt", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
                os.dup2(out, 1), os.dup2(out, 2)
                os.chdir(self.copy)
                os.environ |= {"PYTHONPATH": str(self.copy), "PYTHONDONTWRITEBYTECODE": "1"}
                sys.path[:] = [str(self.copy), *(p for p in sys.path if p not in ("", str(ROOT)))]
                sys.dont_write_bytecode = not bytecode
                for name in [name for name in sys.modules if name.split(".")[0] == "tests"]:
                    del sys.modules[name]
                code = run()
                sys.stdout.flush()
                os._exit(code)
            except BaseException as error:
                os.write(2, repr(error).encode())
                os._exit(OWN_ERROR)
        _, status = os.waitpid(child, 0)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)  # what it left behind
        return os.waitstatus_to_exitcode(status)


if __name__ == "__main__":
    sys.exit(main())
