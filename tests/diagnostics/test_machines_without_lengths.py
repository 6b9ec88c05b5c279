"""Statements on machines without lengths, and on the same machine in another unit of length."""

from __future__ import annotations

import warnings
from itertools import product

import numpy as np
import pytest

import pkmcal as pk

from ..sweeps import sweep

SCREWS = {
    "pan and tilt": [[0, 0, 1], [0, 1, 0]],
    "wrist": [[0, 0, 1], [0, 1, 0], [1, 0, 0]],
}


def quietly(*given: object, **asked: object) -> pk.Identification:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pk.CalibrationWarning)
        return pk.identify(*given, **asked)


def seen(true: pk.SerialArm, count: int, size: float, seed: int = 0) -> tuple[np.ndarray, ...]:
    """Joint coordinates, and poses of a tool in the frame of an instrument; noise 1e-5 of size."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-1.2, 1.2, (count, true.n_joints))
    frame = pk.screw.from_pose([0.3 * size, -0.2 * size, 1.5 * size, 0.3, 0.1, -2.0])
    tool = pk.screw.from_pose([0.2 * size, 0.1 * size, size, 0.2, -0.4, 0.1])
    pose = pk.screw.to_pose(frame @ true.forward(q) @ tool)
    noise = rng.normal(0.0, 1e-5, pose.shape) * [size, size, size, 1, 1, 1]
    return q, pose + noise


@sweep(
    "name, kind",
    product(SCREWS, ["pose", "position"]),
    quick=[("pan and tilt", "pose"), ("wrist", "position")],
)
def test_of_an_arm_whose_axes_meet_in_its_tool_nothing_false_is_said(name: str, kind: str) -> None:
    """Errors of its joints are 0.1 to 1 mm, its target is a metre away: no size says 1 mm."""
    axes = SCREWS[name]
    n = len(axes)
    arm = pk.SerialArm(axes, np.zeros((n, 3)), np.eye(4), name=name)
    assert arm.without_lengths
    rng = np.random.default_rng(3)
    true = arm.replace(rng.normal(size=(n, 6)) * ([0.6] * 3 + [2e-3] * 3))
    q, pose = seen(true, 60, 1000.0)
    rows = pk.Measurements(q, pose if kind == "pose" else pose[:, :3], kind)
    found = quietly(arm, rows, unknown=("frame", "target"), fix="datum")
    assert found.verdict.state == "calibrated", str(found.verdict)
    assert found.fit.estimator.size == pytest.approx(1024.7, rel=0.01)  # of the target, by hand


@sweep("gross", [0.0, 0.02], quick=[0.02])
def test_the_same_is_said_in_another_unit_of_length(gross: float) -> None:
    """Of an arm of six joints, and of one that is a thousandth of it."""
    axes = [[0, 0, 1], [0, 1, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0]]
    points = [[0, 0, 0], [0, 0, 290], [0, 0, 560], [0, 0, 630], [302, 0, 630], [374, 0, 630]]
    errors = np.random.default_rng(1).normal(size=(6, 6))
    said = []
    for unit in (1.0, 1e-3):
        home = np.array([450.0, 0, 630, 0, 0, 0]) * [unit, unit, unit, 1, 1, 1]
        arm = pk.SerialArm(axes, np.array(points) * unit, home)
        assert not arm.without_lengths
        true = arm.replace(errors * ([0.3 * unit] * 3 + [1e-3] * 3))
        q, pose = seen(true, 60, 500.0 * unit)
        pose[17, 0] += gross * 500.0 * unit
        rows = pk.Measurements(q, pose[:, :3])
        found = quietly(arm, rows, unknown=("frame", "target"))
        said.append((found.verdict.state, found.rank, tuple(found.outliers)))
    assert said[0] == said[1]
    assert (17 in said[0][2]) == bool(gross)


@pytest.mark.parametrize("seed", range(4))
def test_lengths_that_an_arm_without_any_turns_out_to_have_are_its_errors(seed: int) -> None:
    """Axes in any directions through one point, poses of the tool there: nothing says its size."""
    rng = np.random.default_rng([34, seed])
    axes = rng.normal(size=(int(rng.integers(2, 5)), 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    arm = pk.SerialArm(axes, np.zeros(axes.shape), np.eye(4))
    size = 10.0 ** rng.uniform(-1.0, 0.5)
    true = arm.replace(rng.normal(size=(len(axes), 6)) * ([size] * 3 + [2e-3] * 3))
    q = rng.uniform(-1.2, 1.2, (40, len(axes)))
    pose = pk.screw.to_pose(true.forward(q))
    pose += rng.normal(size=pose.shape) * ([0.02] * 3 + [5e-5] * 3)
    found = quietly(arm, pk.Measurements(q, pose, "pose"), holdout=0.25)
    assert found.verdict.state == "calibrated", str(found.verdict)


def test_a_stated_target_tells_which_lengths_are_too_large_for_an_arm_without_any() -> None:
    axes, target = SCREWS["wrist"], np.array([80.0, 0.0, 60.0])
    arm = pk.SerialArm(axes, np.zeros((3, 3)), np.eye(4))
    said = []
    for size in (0.5, 60.0):
        errors = np.zeros((3, 6))
        errors[2, 1] = size
        true, q = arm.replace(errors), np.random.default_rng(2).uniform(-1.2, 1.2, (40, 3))
        at = true.forward(q)
        place = at[:, :3, 3] + at[:, :3, :3] @ target
        place += np.random.default_rng(3).normal(0.0, 0.02, place.shape)
        found = quietly(arm, pk.Measurements(q, place, target=target))
        said.append("implausible-changes" in [each.check for each in found.verdict.said])
    assert said == [False, True]
