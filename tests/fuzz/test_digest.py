"""The core compiled for another processor by another compiler, on inputs of chance.

Numbers, machines, chains, swarms and arms of `abi.c`; every call of the interface.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from .doors import ROOT

# each function once, as `make fuzz-abi` has it; gcc 12 does not compile that for SSE2
FLAGS = (
    *("-std=c11", "-O1", "-fno-math-errno", "-fno-trapping-math", "-ffp-contract=off", "-w"),
    *("-Dalways_inline=unused", "-Icsrc", "-Igenerated"),
)
ONE = ("tests/fuzz/digest.c", "csrc/abi.c", "csrc/paths.c", "csrc/core_base.c")
ALL = (*ONE, "csrc/core_v3.c", "csrc/core_v4.c")
ZIG = (sys.executable, "-m", "ziglang", "cc", "-fno-sanitize=all")
WINE = shutil.which("wine64") or shutil.which("/usr/lib/wine/wine64")  # Debian: off the path


def digest(
    program: Path,
    compiler: tuple[str, ...],
    runner: tuple[str, ...] = (),
    sources: tuple[str, ...] = ("-DONE_ISA", *ONE),
) -> str:
    subprocess.run([*compiler, *FLAGS, *sources, "-lm", "-o", program], cwd=ROOT, check=True)
    given = [*runner, str(program), "2000"]
    quiet = {"WINEDEBUG": "-all", "WINEPREFIX": str(program.parent / "wine")}
    done = subprocess.run(
        given, capture_output=True, text=True, check=True, env={**os.environ, **quiet}
    )
    return done.stdout


@pytest.mark.slow
def test_on_aarch64_every_call_gives_the_same_bits(tmp_path: Path) -> None:
    cross, emulator = "aarch64-linux-gnu-gcc", "qemu-aarch64"
    for each in ("clang", cross, emulator):
        if not shutil.which(each):
            pytest.skip(f"needs {each} (on Debian: clang gcc-aarch64-linux-gnu qemu-user)")
    here = digest(tmp_path / "here", ("clang",))
    there = digest(tmp_path / "there", (cross, "-static"), (emulator,))
    assert here == there
    assert here.startswith("2000 inputs, ")


@pytest.mark.slow
def test_on_windows_every_call_gives_the_same_bits_with_every_isa(tmp_path: Path) -> None:
    """The program itself compares the instruction sets of this processor."""
    if WINE is None or find_spec("ziglang") is None or not shutil.which("clang"):
        pytest.skip("needs Wine, clang and the PyPI package ziglang (Debian: clang wine64)")
    here = digest(tmp_path / "here", ("clang",))
    windows = (*ZIG, "-target", "x86_64-windows-gnu")
    assert digest(tmp_path / "there.exe", windows, (WINE,), ALL) == here
