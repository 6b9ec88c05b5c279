"""What the core finds out about the machine that it runs on."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from pkmcal.core import library
from pkmcal.core.library import ISAS, lib, pointer, processors

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = (
    '#include <stdio.h>\n#include "pkmcal.h"\nint main(void) { printf("%d", pkm_best_isa()); }\n'
)
V3 = {"avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "movbe", "abm"}
V4 = V3 | {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"}


def test_the_best_isa_is_what_the_system_says_of_the_processor() -> None:
    listed = Path("/proc/cpuinfo")
    lines = listed.read_text().splitlines() if listed.exists() else []
    flags = next((set(line.split()) for line in lines if line.startswith("flags")), set[str]())
    if not flags:
        pytest.skip("the system lists no flags of an x86-64 processor")
    assert lib.pkm_best_isa() == int(flags >= V3) + int(flags >= V4)


@pytest.mark.parametrize(
    ("model", "isa"),
    [("qemu64", 0), ("Nehalem", 0), ("IvyBridge", 0), ("Haswell-noTSX", 1), ("EPYC", 1)],
)
def test_an_emulated_processor_is_known_for_what_it_is(
    model: str, isa: int, tmp_path: Path
) -> None:
    """QEMU emulates nothing of AVX-512."""
    for each in ("gcc", "qemu-x86_64"):
        if not shutil.which(each):
            pytest.skip(f"needs {each}")
    (tmp_path / "best.c").write_text(PROGRAM)
    build = ["gcc", "-static", "-Icsrc", "-Igenerated", tmp_path / "best.c", "csrc/abi.c"]
    subprocess.run([*build, "-o", tmp_path / "best"], cwd=ROOT, check=True)
    started = ["qemu-x86_64", "-cpu", model, tmp_path / "best"]
    said = subprocess.run(started, capture_output=True, text=True, check=True).stdout
    assert ISAS[int(said)] == ISAS[isa]


def test_where_the_system_does_not_say_which_processors_are_ours_all_are(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As on macOS and Windows."""
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    assert processors() == os.cpu_count()
    parts: list[tuple[int, int]] = []
    rows = 3 * library.ROWS_PER_THREAD
    library.in_threads(lambda start, stop: parts.append((start, stop)), rows, None)
    assert sum(stop - start for start, stop in parts) == rows


@pytest.mark.parametrize("kind", ["i", "l", "q", "L", "Q", "d", "D"])
def test_an_array_is_pointed_at_by_the_size_of_its_numbers(kind: str) -> None:
    """Windows has 32 bits in NumPy's "l", and 64 in "q" alone."""
    array = np.zeros(3, kind)
    size = library.ffi.sizeof(library.ffi.typeof(pointer(array)).item)
    assert size * (1 + (kind == "D")) == array.itemsize
