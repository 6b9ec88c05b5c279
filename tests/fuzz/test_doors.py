"""Damaged inputs at every door: refused in the package's words, or taken and usable.

A short run; ``python -m tests.fuzz`` makes long ones, and benchmarks/recorded/ has their figures.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from random import Random

import pytest

from .__main__ import emptied, run
from .damage import Door
from .doors import DOORS, ROOT

INPUTS = {  # some five minutes of processor time together
    "toml": 50_000,
    "csv": 50_000,
    "xlsx": 20_000,
    "sheet": 6_000,
    "urdf": 20_000,
    "printer": 20_000,
    "line": 3_000,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", DOORS)
def test_a_damaged_input_is_refused_by_name_or_can_be_used(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)  # what fails is left there
    failed = run(name, seed=0, first=0, count=INPUTS[name], seconds=1e9)
    assert not failed, capsys.readouterr().out


@pytest.mark.parametrize("name", DOORS)
def test_seeds_are_taken(name: str, tmp_path: Path) -> None:
    """A run whose seeds are refused would test next to nothing."""
    if name in ("xlsx", "sheet"):
        pytest.importorskip("openpyxl")
    door, taken = DOORS[name], 0
    seeds = door.seeds[:1] if name == "line" else door.seeds
    for seed in seeds:
        emptied(str(tmp_path))
        taken += door.enter(tmp_path, seed, Random(0))
    assert taken >= 0.5 * len(seeds)


def test_a_number_gives_its_input_again(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "tests.fuzz", "toml", "--seed", "7", "--from", "3"]
    told = []
    for _ in range(2):
        done = subprocess.run(
            [*command, "--count", "20"], cwd=ROOT, capture_output=True, text=True, check=True
        )
        told.append(done.stdout.split(";")[0])
    assert told[0] == told[1]
    assert "numbers 3 to 22: 20 inputs" in told[0]


def test_an_input_that_does_not_end_is_recorded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def endless(folder: Path, content: bytes, chance: Random) -> bool:
        while True:
            pass

    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(DOORS, "csv", Door((b"x",), (b"y",), endless))
    monkeypatch.setattr("tests.fuzz.__main__.SLOW", 0.1)
    assert run("csv", seed=0, first=5, count=2, seconds=1e9) == 1
    assert "2 failed in 1 ways" in (said := capsys.readouterr().out), said
    assert "first input 5: TooLong test_doors.py" in said
    assert (tmp_path / "fuzz-csv-0-5.bin").exists()
