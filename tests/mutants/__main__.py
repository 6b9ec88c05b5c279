"""Do the tests see a mistake? ``python -m tests.mutants csrc --count 50 --seed 1``.

Mutants are drawn from all of a folder and made one at a time in a copy of the checkout; the quick
tests of its file and folder run until one fails. Of ``csrc`` the 128-bit core alone is compiled,
without optimisation; mutants that do not compile do not count, of a room of the package those that
Python cannot read. Those of ``derive`` that leave the generated code as it is do not count either.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from .changes import Change, changes

ROOT = Path(__file__).resolve().parents[2]
LEFT_OUT = shutil.ignore_patterns(
    *(".git", ".venv*", ".*_cache", ".benchmarks", ".hypothesis", "__pycache__", "build", "*.so")
)
TESTS = {
    "csrc": (
        "tests/kinematics/test_twin.py",
        "tests/core",
        "tests/kinematics/test_machines_twin.py",
    ),
    "derive": ("tests/derive/test_derive.py",),
    "pkmcal/planning": ("tests/planning",),
    "pkmcal/statistics": ("tests/statistics",),
    "pkmcal/estimation": ("tests/estimation", "tests/calibration/test_identify.py"),
    "pkmcal/calibration": ("tests/calibration/test_identify.py", "tests/calibration"),
}
OF_FILE = {  # before those
    "abi.c": "tests/error_model/test_tolerance.py",
    "alignment.py": "tests/estimation/test_alignment.py",
    "datum.py": "tests/calibration/test_datum.py",
    "drift.py": "tests/calibration/test_drift.py",
    "dropped.py": "tests/calibration/test_dropped.py",
    "elimination.py": "tests/calibration/test_row_poses.py",
    "expansion.py": "tests/calibration/test_expansion.py",
    "identifiability.py": "tests/estimation/test_identifiability.py",
    "loss.py": "tests/estimation/test_loss.py",
    "mode_slips.py": "tests/estimation/test_mode_slips.py",
    "optimal_design.py": "tests/planning/test_optimal_design.py",
    "plausibility.py": "tests/calibration/test_plausibility.py",
    "prior_functions.py": "tests/calibration/test_prior_functions.py",
    "sessions.py": "tests/calibration/test_sessions.py",
    "slack.py": "tests/calibration/test_slack.py",
    "tour.py": "tests/planning/test_tour.py",
    "travel_weight.py": "tests/planning/test_travel_weight.py",
    "verdict.py": "tests/calibration/test_verdict.py",
    "forward.h": "tests/kinematics/test_forward.py",
    "measured.py": "tests/derive/test_measured.py",
    "limbs.py": "tests/derive/test_limbs.py",
    "limb_functions.py": "tests/derive/test_limbs.py",
    "motion.h": "tests/moves/test_trajectory.py",
    "newton.h": "tests/kinematics/test_forward.py",
    "paths.c": "tests/modes/test_find.py",
    "posemaps.py": "tests/derive/test_posemaps.py",
    "pso.h": "tests/compensation/test_pso.py",
    "quick.h": "tests/kinematics/test_forward.py",
    "rates.py": "tests/derive/test_limbs.py",
    "screws.py": "tests/derive/test_screws.py",
    "serial.h": "tests/arms/test_arm.py",
    "solve.h": "tests/kinematics/test_forward.py",
    "tpr2tps.py": "tests/published/test_kinematics_2tpr2tps.py",
}
NOT_MEANT = {"csrc": ("core_v3.c", "core_v4.c", "build.py"), "derive": ("modes.py", "__init__.py")}
LIMIT = 3600  # s; a mutant that takes longer is seen


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("folder", choices=TESTS)
    parser.add_argument("--count", type=int, default=50, help="how many mutants that count")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=1e9, help="begin no other after this time")
    parser.add_argument("--trusted", action="store_true", help="the tests are known to pass")
    chosen = parser.parse_args()
    began, ends = time.monotonic(), Counter[str]()
    with tempfile.TemporaryDirectory() as temporary:
        copy = Path(temporary) / "checkout"
        shutil.copytree(ROOT, copy, ignore=LEFT_OUT)
        folder = Folder(chosen.folder, copy)
        folder.matters()  # compiles the core
        if not chosen.trusted and not folder.passes():
            raise SystemExit("the tests fail without a mutant")
        for change in folder.drawn(chosen.seed):
            if sum(ends.values()) - ends["not counted"] >= chosen.count:
                break
            if time.monotonic() - began > chosen.seconds:
                break
            end = folder.end(change)
            ends[end] += 1
            print(f"{end}: {change.named(folder.text(change))}", flush=True)
    counted = sum(ends.values()) - ends["not counted"]
    print(
        f"{chosen.folder}, seed {chosen.seed}: {ends['killed']} of {counted} killed"
        f" ({ends['killed'] / max(counted, 1):.0%}), {ends['not counted']} not counted"
    )
    return 0


class Folder:
    """A folder whose mutants are made in a copy of the checkout."""

    def __init__(self, name: str, copy: Path) -> None:
        self.name, self.copy = name, copy
        if name == "derive":  # its tests import the installed name
            (copy / "pkmcal" / "derive").symlink_to(copy / "derive")
            (copy / "pkmcal" / "generated").symlink_to(copy / "generated")
        if name == "csrc":
            self._narrow()
            return
        for core in (ROOT / "pkmcal").glob("_core*.so"):
            shutil.copy2(core, copy / "pkmcal")

    def _narrow(self) -> None:
        """Compile the 128-bit core alone: a fifth of the time."""
        for path in (self.copy / "csrc").iterdir():
            if path.suffix in (".c", ".h", ".py") and path.name != "lanes.h":
                text = path.read_text(encoding="utf-8").replace("__x86_64__", "PKMCAL_ALL_ISAS")
                if path.name == "build.py":
                    text = text.replace('"-O3"', '"-O0"')
                path.write_text(text, encoding="utf-8")

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

    def end(self, change: Change) -> str:
        """What becomes of a mutant: killed, survived, or not counted."""
        path, text = self.copy / change.file, self.text(change)
        path.write_text(change.applied(text), encoding="utf-8")
        try:
            if not self.matters(path):
                return "not counted"
            own = OF_FILE.get(path.name)
            return "survived" if self.passes(*([own] if own else [])) else "killed"
        finally:
            path.write_text(text, encoding="utf-8")

    def matters(self, changed: Path | None = None) -> bool:
        """Whether it compiles; of the derivation, whether it derives something else."""
        if self.name == "csrc":
            return self._runs("setup.py", "-q", "build_ext", "--inplace")
        if self.name == "derive":
            return not self._runs("-m", "derive", "--check")
        try:
            return changed is None or bool(ast.parse(changed.read_text(encoding="utf-8")))
        except SyntaxError:
            return False

    def passes(self, *first: str) -> bool:
        """Whether these tests and those of the folder pass, the quick ones."""
        options = ("-x", "-q", "-m", "not slow", "-p", "no:cacheprovider")
        return self._runs("-m", "pytest", *options, *first, *TESTS[self.name])

    def _runs(self, *arguments: str) -> bool:
        environment = os.environ | {"PYTHONPATH": str(self.copy), "CFLAGS": "-w -g0"}
        environment |= {"OPENBLAS_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}
        try:
            done = subprocess.run(
                [sys.executable, *arguments],
                cwd=self.copy,
                env=environment,
                capture_output=True,
                timeout=LIMIT,
            )
        except subprocess.TimeoutExpired:
            return False
        return done.returncode == 0


if __name__ == "__main__":
    sys.exit(main())
