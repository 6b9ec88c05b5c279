"""The core compiled for another processor by another compiler, on inputs of chance.

Numbers, machines, chains, swarms and arms of `abi.c`; every call of the interface.
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from .doors import ROOT

# each function once, as `make fuzz-abi` has it; gcc 12 does not compile that for SSE2
FLAGS = (
    *("-std=c11", "-O1", "-fno-math-errno", "-fno-trapping-math", "-ffp-contract=off", "-w"),
    *("-Dalways_inline=unused", "-DONE_ISA", "-Icsrc", "-Igenerated"),
)
SOURCES = ("tests/fuzz/digest.c", "csrc/abi.c", "csrc/paths.c", "csrc/core_base.c")


def digest(program: Path, compiler: tuple[str, ...], runner: tuple[str, ...] = ()) -> str:
    subprocess.run([*compiler, *FLAGS, *SOURCES, "-lm", "-o", program], cwd=ROOT, check=True)
    given = [*runner, str(program), "2000"]
    return subprocess.run(given, capture_output=True, text=True, check=True).stdout


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
