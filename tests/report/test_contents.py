"""What a report expects of the calibrated machine, against other ways to the same numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pkmcal as pk
from pkmcal.report.axes import axes
from pkmcal.report.contents import (
    as_seen,
    directions,
    expected,
    instrument_identified,
    over_the_workspace,
    worst,
)
from pkmcal.report.places import in_the_workspace

from ..simulated import hexapod_poses


def euler(angles: np.ndarray) -> Rotation:
    return Rotation.from_euler("xyz", angles)


def test_accuracy_as_seen_is_that_of_the_point_where_all_of_the_instrument_is_known() -> None:
    robot, point = pk.load("hexapod"), np.array([30.0, -20.0, 50.0])
    q = robot.inverse(hexapod_poses(robot, 30, np.random.default_rng(0)))
    measured = pk.VirtualMachine(robot, noise=0.02).measure(q, target=point)
    found = pk.identify(robot, measured, free=["offset*", "base*.z"], prior=0.5)
    places = hexapod_poses(robot, 10, np.random.default_rng(1))
    assert not instrument_identified(found)
    np.testing.assert_allclose(
        as_seen(found, places), found.accuracy(places, target=point), rtol=1e-9
    )


def test_machine_is_as_far_off_as_expected_where_the_instrument_stands_anywhere() -> None:
    robot, random = pk.load("hexapod"), np.random.default_rng(4)
    free = ["base*", "platform*", "offset*"]
    true = robot.replace(
        {n: robot.geometry[n] + random.normal(0, 0.3) for n in robot.geometry.match(free)}
    )
    frame, shift = euler(np.array([0.1, -0.2, 1.0])), np.array([2000.0, -500.0, 300.0])
    targets = np.array([[80.0, 0, -20], [-60, 70, 0], [-40, -90, 10]])

    def seen(q: np.ndarray, target: np.ndarray) -> np.ndarray:
        at = true.forward(q).pose
        return frame.apply(at[:, :3] + euler(at[:, 3:]).apply(target)) + shift

    q = np.repeat(robot.inverse(hexapod_poses(robot, 40, random)), 3, axis=0)
    index = np.tile(np.arange(3), 40)
    values = np.concatenate([seen(q[i : i + 1], targets[i % 3]) for i in range(len(q))])
    values += random.normal(0, 0.02, values.shape)
    found = pk.identify(
        robot,
        pk.Measurements(q, values, sigma=0.02, target_index=index),
        free=free, unknown=["frame", "target"],
    )  # fmt: skip
    assert instrument_identified(found)

    places = hexapod_poses(robot, 60, np.random.default_rng(9))
    commands = found.robot.inverse(places)
    value = {name: p["value"] for name, p in found.parameters.items()}
    placed = np.array([value[f"frame.{k}"] for k in ("x", "y", "z", "alpha", "beta", "gamma")])
    target = np.array([value[f"target1.{k}"] for k in "xyz"])
    points = places[:, :3] + euler(places[:, 3:]).apply(target)
    off = seen(commands, targets[0]) - (euler(placed[3:]).apply(points) + placed[:3])
    ratio = np.linalg.norm(off, axis=1) / expected(found, places)
    assert np.sqrt(np.mean(ratio**2)) == pytest.approx(1.0, abs=0.45)


def test_where_no_stroke_ends_the_workspace_it_is_what_was_measured() -> None:
    belts = pk.load(Path(__file__).parents[2] / "examples" / "belts" / "robot.toml")
    low, high = np.array([800.0, 500.0]), np.array([2200.0, 1500.0])
    places = np.random.default_rng(0).uniform(low, high, (30, 2))
    measured = pk.VirtualMachine(belts, noise=0.1).measure(
        belts.inverse(np.pad(places, ((0, 0), (0, 4)))), "position"
    )
    found = pk.identify(belts, measured, free=["base1.x", "base1.y"])
    drawn = in_the_workspace(found)
    assert not isinstance(drawn, str)
    sampled, area = over_the_workspace(found, drawn)
    assert area is not None and "between those that were measured" in sampled.where
    margin = 2.0  # mm: poses are where the noise says
    for seen in (sampled.tools[:, :2], np.transpose([ends[[0, -1]] for ends in area.values])):
        assert (seen > low - margin).all() and (seen < high + margin).all()
    drives = pk.load("hexapod")
    q = drives.inverse(hexapod_poses(drives, 20, np.random.default_rng(0)))
    bounded = in_the_workspace(
        pk.identify(drives, pk.VirtualMachine(drives).measure(q), free="offset*")
    )
    assert not isinstance(bounded, str) and "way to its ends" in bounded.where


def test_rows_that_were_not_read_are_not_among_the_worst() -> None:
    rows = [{"row": k, "after": after} for k, after in enumerate([np.nan, 0.2, 0.5, np.nan])]
    assert [row["row"] for row in worst(rows)] == [2, 1]


def test_what_was_never_read_is_not_scored(tmp_path: Path) -> None:
    """The height of a planar machine is an empty column, beside rows of nothing."""
    sled, random = pk.load("examples/belts/robot.toml"), np.random.default_rng(0)
    at = np.zeros((12, 6))
    at[:, :2] = random.uniform([600, 400], [2400, 1600], (12, 2))
    seen = at[:, :3] + random.normal(0.0, 0.3, (12, 3))
    seen[:, 2], seen[::3] = np.nan, np.nan
    q = sled.inverse(at) + random.normal(0.0, 0.3, (12, 4))
    found = pk.identify(sled, pk.Measurements(q, seen, "position", sigma=0.3, actuator_sigma=0.3))
    scored = directions(found)
    assert [row["name"] for row in scored] == ["x", "y"]
    read = np.isfinite(seen[:, 0])
    for k, row in enumerate(scored):
        off = found.residuals[0][read, k]
        assert row["mean_after"] == pytest.approx(off.mean(), rel=1e-12)
        assert row["largest_after"] == pytest.approx(np.abs(off).max(), rel=1e-12)
    assert axes(found) == []
    assert all(Path(file).is_file() for file in found.report(tmp_path))
