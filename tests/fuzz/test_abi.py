"""The C interface, fed by libFuzzer under the sanitizers: a short run of ``make fuzz-abi``."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from .doors import ROOT


def has_libfuzzer(folder: Path) -> bool:
    """Whether clang is there with its runtime."""
    if not (shutil.which("clang") and shutil.which("make")):
        return False
    (folder / "empty.c").write_text("int LLVMFuzzerTestOneInput(void) { return 0; }")
    command = ["clang", "-fsanitize=fuzzer,address,undefined", "empty.c", "-o", "empty"]
    return not subprocess.run(command, cwd=folder, capture_output=True).returncode


def test_every_call_is_fed() -> None:
    """And an input may be for each call of its group."""
    headers = (ROOT / "csrc" / "calls.h", ROOT / "generated" / "row_calls.h")
    declared = {name for each in headers for name in re.findall(r"CALL\((\w+)\)", each.read_text())}
    fed = set[str]()
    for source in (ROOT / "tests" / "fuzz").glob("abi*.[ch]"):
        _, *groups = re.split(r"\bone_of\((\d+)\);", source.read_text())
        for count, group in zip(groups[::2], groups[1::2], strict=True):
            calls = re.findall(r"EACH_ISA\((\w+), *[^.]", group)
            assert len(calls) == int(count), calls
            fed |= set(calls)
    assert fed == declared


@pytest.mark.slow
def test_no_call_writes_beyond_its_arrays_or_gives_other_bits_on_another_isa(
    tmp_path: Path,
) -> None:
    if not has_libfuzzer(tmp_path):
        pytest.skip("needs clang with libFuzzer (on Debian: clang libclang-rt-14-dev)")
    options = ("FUZZ_LEVEL=-O0", "COUNT=10000", f"FUZZED={tmp_path}/fuzzed")
    done = subprocess.run(
        ["make", "--no-print-directory", "fuzz-abi", *options],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, (done.stdout + done.stderr)[-5000:]
    assert "number_of_executed_units: 10000" in done.stderr
