"""Columns whose heading states another unit than their numbers have."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk


def table(file: Path, stated: str, share: float) -> pk.Measurements:
    """Points of a hexapod; the numbers of its legs are mm times `share`, whatever is stated."""
    robot = pk.load("hexapod")
    poses = pk.sample_poses(robot, 12, seed=1)
    rows = np.hstack([share * robot.inverse(poses), poses[:, :3]])
    names = [f"q{i + 1} [{stated}]" for i in range(6)] + ["x [mm]", "y [mm]", "z [mm]"]
    lines = [",".join(names), *(",".join(f"{x:.6f}" for x in row) for row in rows.tolist())]
    file.write_text("\n".join(lines), encoding="utf-8")
    return pk.read_measurements(file)


@pytest.mark.parametrize(
    ("stated", "share", "words", "unit"),
    [
        ("m", 1.0, "millimetres", "mm"),
        ("um", 1.0, "millimetres", "mm"),
        ("m", 1e-1, "centimetres", "cm"),
        ("mm", 1e-3, "metres", "m"),
    ],
)
def test_the_unit_that_numbers_have_is_named_whatever_unit_is_stated(
    tmp_path: Path, stated: str, share: float, words: str, unit: str
) -> None:
    measured = table(tmp_path / "log.csv", stated, share)
    with pytest.raises(pk.ArgumentError) as error:
        pk.identify(pk.load("hexapod"), measured, ["offset*"])
    assert f"if the actuators are in {words}: --rename 'q1=q1 [{unit}]'" in str(error.value)
