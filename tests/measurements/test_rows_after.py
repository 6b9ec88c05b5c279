"""A file whose own actuators are a row late, read as they belong, and the hint that says so."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk


def late(path: Path, by: int) -> pk.Measurements:
    """A hexapod's file whose struts 2 and 3 are exchanged and stand `by` rows late."""
    robot = pk.load("hexapod")
    q = robot.inverse(pk.sample_poses(robot, 30, 2, share=0.4))
    true = robot.replace({f"offset{i + 1}": 0.2 * (-1) ** i for i in range(6)})
    rows = pk.VirtualMachine(true, noise=0.01, seed=1).measure(q)
    legs = np.roll(rows.actuators, by, axis=0)[:, [0, 2, 1, 3, 4, 5]]
    heads = [*(f"Strut {i} [mm]" for i in range(1, 7)), "x [mm]", "y [mm]", "z [mm]"]
    table = np.column_stack([legs, rows.values])[max(by, 0) : len(q) + min(by, 0)]
    lines = [",".join(heads), *(",".join(f"{x:.4f}" for x in row) for row in table)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return rows


@pytest.mark.parametrize("by", [1, -1, 2])
def test_actuators_of_other_rows_are_taken(tmp_path: Path, by: int) -> None:
    """Row k of what is read is row k of the true ones; rows at the end have none."""
    true = late(tmp_path / "late.csv", by)
    exchanged = {"Strut 2": "q3", "Strut 3": "q2"}
    read = pk.read_measurements(tmp_path / "late.csv", join=f"row{by:+d}", rename=exchanged)
    kept = slice(by, -by) if by > 0 else slice(-by, by)
    np.testing.assert_allclose(read.actuators, true.actuators[kept], atol=5.1e-5)
    np.testing.assert_allclose(read.values, true.values[kept], atol=5.1e-5)
    assert any(f"row {abs(by)} {'after' if by > 0 else 'before'}" in note for note in read.notes)


def test_the_hint_ends_with_what_mends_it(run: Any, refused: Any, tmp_path: Path) -> None:
    late(tmp_path / "late.csv", 1)
    asked = ("calibrate", "hexapod", tmp_path / "late.csv", "--free", "offset*")
    options = ("--rename", "Strut 2=q3", "--rename", "Strut 3=q2", "--join", "row+1")
    assert "--rename 'Strut 2=q3' --rename 'Strut 3=q2' --join row+1" in refused(*asked)
    done = run(*asked, *options)
    assert done.exit_code == 0 and done.stdout.startswith("Calibrated")
