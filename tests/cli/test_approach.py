"""`pkmcal calibrate --approach order`: from where actuators came, by the order of the rows."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk

from ..calibration.test_drive_laws import machines, rows


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path, pk.Robot]:
    """A robot with backlash in its drives, its file, and what was measured row after row."""
    robot, true, _ = machines("backlash")
    robot.save(tmp_path / "robot.toml")
    instrument = pk.VirtualMachine(true, noise=0.02, seed=1)
    measured = instrument.measure(rows(true), kind="pose", approach="order")
    measured.write(tmp_path / "stated.csv")
    head, *lines = (tmp_path / "stated.csv").read_text().splitlines()
    names = head.split(",")
    kept = [i for i, name in enumerate(names) if not name.startswith("approach")]
    text = "\n".join(",".join(line.split(",")[i] for i in kept) for line in [head, *lines])
    (tmp_path / "plain.csv").write_text(text + "\n")
    return tmp_path / "robot.toml", tmp_path / "plain.csv", true


def test_the_order_of_rows_says_what_columns_would(
    run: Callable[..., Any], files: tuple[Path, Path, pk.Robot]
) -> None:
    robot, plain, true = files
    options = ("--free", "drive*,offset*", "--json")
    found = json.loads(run("calibrate", robot, plain, "--approach", "order", *options).stdout)
    stated = json.loads(run("calibrate", robot, plain.with_name("stated.csv"), *options).stdout)
    for i in range(1, 7):
        name = f"drive{i}.backlash"
        own = found["parameters"][name]
        assert own["value"] == pytest.approx(stated["parameters"][name]["value"], abs=1e-9)
        assert abs(own["value"] - true.geometry[name]) < 4.5 * own["stderr"]
    assert np.isfinite(found["rms"])


def test_it_is_not_said_twice_nor_by_another_word(
    run: Callable[..., Any], files: tuple[Path, Path, pk.Robot]
) -> None:
    robot, plain, _ = files
    twice = run("calibrate", robot, plain.with_name("stated.csv"), "--approach", "order")
    assert twice.exit_code == 2 and "has columns approach" in twice.output
    other = run("calibrate", robot, plain, "--approach", "sideways")
    assert other.exit_code == 2 and "--approach" in other.output
