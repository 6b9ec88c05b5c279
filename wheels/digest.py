"""A digest of all that the core of a wheel gives: the same for every system and processor.

    python -m wheels.digest 1000           # inputs of chance, each for one call of the interface
    python -m wheels.digest 1000 windows-x86_64

The program of `tests/fuzz/digest.c` is linked with the very objects of a wheel and run here: as it
is, under QEMU, under Wine. On x86-64 it runs each call with every instruction set and compares
them. What runs nowhere here is named. `make wheels` runs it.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

from wheels.build import BUILT, ROOT, ZIG, objects
from wheels.targets import TARGETS, Target

WINE = ("wine64", "/usr/lib/wine/wine64")  # Debian has it off the path


def main(inputs: int, names: list[str]) -> str | None:
    """Print the digest of each target; what is wrong."""
    os.chdir(ROOT)
    said: dict[str, str] = {}
    for name in names or TARGETS:
        target = TARGETS[name]
        runner = started(target)
        if runner is None:
            print(f"{name}: nothing here runs its programs")
            continue
        begun = time.monotonic()
        said[name] = digest(program(name, target), runner, inputs)
        print(f"{name}: {said[name]} ({time.monotonic() - begun:.0f} s)", flush=True)
    return "the digests differ" if len(set(said.values())) > 1 else None


def started(target: Target) -> tuple[str, ...] | None:
    """What runs a program of a target; None where nothing here does."""
    if target.runner is None or not target.runner:
        return target.runner
    candidates = WINE if target.system == "windows" else target.runner
    found = next(filter(None, map(shutil.which, candidates)), None)
    return None if found is None else (found,)


def program(name: str, target: Target) -> Path:
    """The digest's program of a target, linked with the objects of its wheel."""
    made = BUILT / name / "digest.exe"
    static = ["-static"] if target.system == "linux" else []
    triple = target.triple.replace("-gnu.2.17", "-musl") if static else target.triple
    flags = ["-std=c11", "-O1", "-ffp-contract=off", "-w", "-fno-sanitize=all", *static]
    inputs = ["-Icsrc", "-Igenerated", "tests/fuzz/digest.c", *map(str, objects(name, target))]
    subprocess.run([*ZIG, "cc", "-target", triple, *flags, *inputs, "-o", str(made)], check=True)
    return made


def digest(made: Path, runner: tuple[str, ...], inputs: int) -> str:
    """What the program prints."""
    environment = {**os.environ, "WINEDEBUG": "-all", "WINEPREFIX": str(BUILT / "wine")}
    done = subprocess.run(
        [*runner, str(made), str(inputs)],
        env=environment, capture_output=True, text=True, check=True,
    )  # fmt: skip
    return done.stdout.strip()


if __name__ == "__main__":
    count, *rest = sys.argv[1:] or ["1000"]
    sys.exit(main(int(count), rest))
