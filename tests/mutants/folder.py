"""A folder whose mutants are made in a copy of the checkout, and what becomes of them."""

from __future__ import annotations

import ast
import contextlib
import json
import os
import random
import resource
import shutil
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path

import pytest

from . import calls, collected
from .changes import Change, changes
from .core import Core

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
        *("tests/test_never_silently_wrong.py", "tests/test_never_silently_wrong_arms.py"),
        "tests/test_generated_machines.py",
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
    "csrc": ("--ignore=tests/core/test_bits.py",),
    "derive": ("-k", "not test_regenerating_changes_nothing"),
}
NO_TESTS, OWN_ERROR = int(pytest.ExitCode.NO_TESTS_COLLECTED), 99
AT_IMPORT = ("abi.c", "pkmcal.h", "calls.h")  # what is called when Python imports the core
MEMORY = 6 << 30  # bytes that a process with a mutant may have


class Folder:
    """A folder whose mutants are made in a copy of the checkout."""

    def __init__(self, name: str, copy: Path, tests: tuple[str, ...], most: float) -> None:
        self.name, self.copy, self.tests, self.most = name, copy, tests, most
        self.known: dict[str, dict] = {}
        self.killers = Counter[str]()
        self.sharing = set[str]()  # files whose tests share what one of them computes
        self.below: Folder | None = None
        self.requests: Connection | None = None
        self.functions: list[tuple[str, int]] = []
        (copy / "pkmcal" / "derive").symlink_to(copy / "derive")
        (copy / "pkmcal" / "generated").symlink_to(copy / "generated")
        (copy.parent / "shared").symlink_to(ROOT.parent / "shared")  # data of real machines, if any
        if name == "csrc":
            self.core = Core(copy)
        else:
            for core in (ROOT / "pkmcal").glob("_core*.so"):
                shutil.copy2(core, copy / "pkmcal")

    def record(self, path: Path | None) -> None:
        """Note what each test calls, and leave out those that fail without a mutant."""
        if path and path.exists():
            stored = json.loads(path.read_text(encoding="utf-8"))
            self.known, self.functions = stored["tests"], stored["functions"]
        else:
            if self.name == "csrc":
                self.functions = self.core.instrumented()
            self.known = self._recorded()
            if self.name == "csrc":
                self.core.plain()
        for test, known in self.known.items():
            if known["failed"]:
                print(f"fails without a mutant, left out: {test}", flush=True)
        if path and not path.exists():
            stored = {"tests": self.known, "functions": self.functions}
            path.write_text(json.dumps(stored), encoding="utf-8")
        self.known = {
            k: test for k, test in self.known.items() if test["ran"] and not test["failed"]
        }
        for file in {k.split("::")[0] for k in self.known}:
            text = (self.copy / file).read_text(encoding="utf-8")
            if "functools.cache" in text or 'scope="module"' in text:
                self.sharing.add(file)
        seconds = sum(test["seconds"] for test in self.known.values())
        print(f"{len(self.known)} tests, {seconds:.0f} s", flush=True)

    def _recorded(self) -> dict[str, dict]:
        found = self.copy / "recorded.json"

        def run() -> int:
            if self.name == "csrc":
                drain = calls.c_calls(self.copy, self.core.units)
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

    def collect(self) -> None:
        """Collect all tests once, in a process that is asked for each mutant.

        Not those of ``derive``, most of whose functions are called as they are collected.
        """
        if self.name == "derive":
            return

        def fork(run: Callable[[], int]) -> int:
            return self._started(run, 36000)

        options = [*self._options(), f"--basetemp={self.copy.parent / 'pytest'}", *self.tests]
        self.requests, self.apart, self.called = collected.begin(
            self.copy, self.name.split("/")[0], fork, options
        )

    def control(self) -> None:
        """Do the tests that failed with mutants pass without one? And end the collecting."""
        if not self.requests:
            return
        here = [k for k in self.killers if k.split("::")[0] not in self.apart]
        file = next(path for path in sorted((self.copy / self.name).glob("*.[chp]*")))
        if self.name == "csrc":
            shutil.copy2(self.core.units, self.core.mutant)
        while here:
            code, test = self._asked(here, str(file.relative_to(self.copy)), "", "")
            if not code:
                break
            print(f"fails without a mutant, too: {test}", flush=True)
            here = here[here.index(test) + 1 :]
        self.requests.send(None)

    def _asked(self, tests: list[str], file: str, before: str, after: str) -> tuple[int, str]:
        """How these end in a process forked from where they are collected, and the last of them."""
        seconds = {k: self.known[k]["seconds"] for k in tests}
        request = {"tests": tests, "file": file, "seconds": seconds}
        assert self.requests
        self.requests.send(request | {"before": before, "after": after})
        return self.requests.recv()

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
        mutant = change.applied(text)
        path.write_text(mutant, encoding="utf-8")
        try:
            if not self.compiles(path):
                return "not counted", ""
            function = self.function(change, text)
            tests = self.shown(change, function)
            began = time.monotonic()
            if test := self.failing(change, text, function, tests):
                self.killers[test] += 1
                return "killed", f" in {time.monotonic() - began:.1f} s by {test}"
            if self.name == "derive":
                return self._derived(len(tests))
            spent = sum(self.known[test]["seconds"] for test in tests)
            return "survived", f" {len(tests)} tests of {spent:.0f} s"
        finally:
            path.write_text(text, encoding="utf-8")
            os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))  # its bytecode holds again

    def function(self, change: Change, text: str) -> int | None:
        """First line of the function of a change."""
        if self.name != "csrc":
            return calls.python_function(text, change.line(text))
        starts = [line for file, line in self.functions if file == change.file]
        return calls.c_function(text, change.at, starts)

    def shown(self, change: Change, function: int | None) -> list[str]:
        """The tests that see it, up to the time there is: first of files named as its own.

        Where none calls anything of its file, some that import it. What tests of a file share, one
        of them computes: where one sees it, all of that file do.
        """
        inside = [k for k, test in self.known.items() if [change.file, function] in test["calls"]]
        files = {k: {file for file, _ in test["calls"]} for k, test in self.known.items()}
        inside = inside or [k for k in self.known if change.file in files[k]]
        of_files = {k.split("::")[0] for k in inside} & self.sharing
        inside += [k for k in self.known if k.split("::")[0] in of_files and k not in inside]
        stem = Path(change.file).stem.split("_")[0]
        if not inside:
            return sorted(self.known, key=lambda k: self.known[k]["seconds"])[:5]

        return self._within(inside, stem)

    def _within(self, tests: list[str], stem: str = "::") -> list[str]:
        """Of these tests those that there is time for, the most promising first."""
        seconds = 0.0

        def promise(k: str) -> float:
            likely = self.killers[k] + 0.1 + (stem in k.split("::")[0])
            return likely / (self.known[k]["seconds"] + 0.02)

        tests = sorted(tests, key=promise, reverse=True)
        for k, test in enumerate(tests):
            seconds += self.known[test]["seconds"]
            if seconds > self.most:
                return tests[: k + 1]
        return tests

    def failing(
        self, change: Change, text: str, function: int | None, tests: list[str]
    ) -> str | None:
        """The test that fails, or None."""
        lines = change.old.count("\n") - change.new.count("\n")
        after = Change(change.file, change.at, change.old, change.new + "\n" * lines)
        if self.name == "csrc":
            here = [k for k in tests if k.split("::")[0] not in self.apart]
            here = [] if Path(change.file).name in AT_IMPORT else here
        elif not self.requests:
            here = []
        else:
            here = [] if function is None or (change.file, function) in self.called else tests
        if here:
            code, test = self._asked(here, change.file, text, after.applied(text))
            if code and code != OWN_ERROR:
                return test
            here = [] if code else here
        rest = [k for k in tests if k not in here]
        for some in (rest[:12], rest[12:60], rest[60:]):  # collecting takes time
            if some and not self.passes(some):
                failed = self.copy / "failed.txt"
                return failed.read_text(encoding="utf-8") if failed.exists() else some[0]
        return None

    def compiles(self, changed: Path) -> bool:
        """Whether it compiles, and to something else."""
        if self.name != "csrc":
            try:
                return bool(ast.parse(changed.read_text(encoding="utf-8")))
            except SyntaxError:
                return False
        return self.core.mutated(changed.name) == "made"

    def passes(self, tests: list[str]) -> bool:
        """Whether these tests pass."""
        files = list(dict.fromkeys(test.split("::")[0] for test in tests))
        limit = 60 + 10 * sum(self.known[test]["seconds"] for test in tests)

        failed = self.copy / "failed.txt"
        failed.unlink(missing_ok=True)

        def run() -> int:
            if self.name == "csrc":
                os.environ["PKMCAL_UNITS"] = str(self.core.mutant)
            chosen = calls.Chosen(tests, failed)
            return int(pytest.main([*self._options(), "-x", *files], plugins=[chosen]))

        code = self._forked(run, limit)
        if code in (NO_TESTS, OWN_ERROR):
            raise SystemExit((self.copy / "output.txt").read_text(encoding="utf-8"))
        return code == 0

    def _derived(self, shown: int) -> tuple[str, str]:
        """What becomes of a mutant of the derivation that none of its own tests saw."""
        found = self.copy / "headers.json"

        def run() -> int:
            from pkmcal.derive.__main__ import headers  # type: ignore[import-not-found]

            found.write_text(json.dumps(headers()), encoding="utf-8")
            return 0

        if self._forked(run, 1200):
            return "killed", " where all is derived"
        fresh = json.loads(found.read_text(encoding="utf-8"))
        changed = {}
        for name, text in fresh.items():
            old = (self.copy / "generated" / name).read_text(encoding="utf-8").splitlines()
            lines = calls.changed_lines(old, text.splitlines())
            if any("* derivation" not in old[k] for k in lines if k < len(old)):
                changed[name] = lines
        if not changed:
            return "not counted", ""
        if not self.below:
            return "survived", f" {shown} tests"
        return self.below.generated(changed, fresh)

    def generated(self, changed: dict[str, set[int]], fresh: dict[str, str]) -> tuple[str, str]:
        """What becomes of other headers, of which these lines differ."""
        folder = self.copy / "generated"
        before = {name: (folder / name).read_text(encoding="utf-8") for name in changed}
        functions = set()
        for name, lines in changed.items():
            (folder / name).write_text(fresh[name], encoding="utf-8")
            starts = [at for file, at in self.functions if file == f"generated/{name}"]
            for line in lines:
                first = max((at for at in starts if at <= line + 1), default=None)
                functions.add((f"generated/{name}", first))
        try:
            made = self.core.mutated(*changed)
            if made != "made":
                return ("killed", " by the compiler") if made == "fails" else ("not counted", "")
            tests = self._within(
                [k for k, test in self.known.items() if functions & set(map(tuple, test["calls"]))]
            )
            here = [k for k in tests if k.split("::")[0] not in self.apart]
            code, test = self._asked(here, "", "", "") if here else (0, "")
            if code:
                self.killers[test] += 1
            end = f" by {test}" if code else f" {len(here)} tests below"
            return ("killed" if code else "survived"), end
        finally:
            for name, text in before.items():
                (folder / name).write_text(text, encoding="utf-8")

    def _options(self) -> list[str]:
        options = [
            *("-q", "-m", "not slow", "-p", "no:cacheprovider", "-p", "no:xdist"),
            f"--rootdir={self.copy}",
        ]
        return [*options, *LEFT_OUT_OF.get(self.name, ())]

    def _forked(self, run: Callable[[], int], limit: float, bytecode: bool = False) -> int:
        """What this ends with in a process of its own, in the copy: below 0 if it is stopped."""
        child = self._started(run, limit, bytecode)
        _, status = os.waitpid(child, 0)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)  # what it left behind
        return os.waitstatus_to_exitcode(status)

    def _started(self, run: Callable[[], int], limit: float, bytecode: bool = False) -> int:
        """A process of its own that does this, in the copy.

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
        return child
