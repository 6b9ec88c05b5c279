"""Plans beside rows that are there: as if these were candidates that have to be taken."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.kinematics.robot import Robot

NOISE = 0.02
KINDS: list[dict[str, Any]] = [
    {"kind": "pose"},
    {"kind": "position", "prior": 0.5},
    {"kind": "position", "prior": 0.5, "unknown": "frame"},
    {"kind": "height", "prior": 0.5},
]


def rows(robot: Robot, poses: np.ndarray, kind: Any) -> pk.Measurements:
    """Measured by a machine that is another one, in noise."""
    other = robot.replace({"offset1": robot.geometry["offset1"] + 0.2})
    return pk.VirtualMachine(other, NOISE, seed=3).measure(robot.inverse(poses), kind)


@pytest.mark.parametrize("options", KINDS)
def test_a_plan_beside_rows_is_that_over_all_with_the_rows_taken(
    hexapod: Robot, options: dict[str, Any]
) -> None:
    """Of all pairs of five candidates the one that a plan of all rows together says is best."""
    options = {**options, "noise": NOISE}
    poses = pk.plan_poses(hexapod, pk.sample_poses(hexapod, 50), 35, **options).poses
    done, candidates = poses[:30], poses[30:]  # all can be measured
    options["targets"] = poses
    measured = rows(hexapod, done, options["kind"])
    predicted = {}
    for pair in combinations(range(len(candidates)), 2):
        every = np.vstack([done, candidates[list(pair)]])
        predicted[pair] = pk.plan_poses(hexapod, every, len(every), **options).predicted
    plan = pk.plan_poses(hexapod, candidates, 2, measured=measured, **options)
    chosen = tuple(sorted(plan.indices.tolist()))
    assert plan.predicted == pytest.approx(predicted[chosen], rel=1e-6)
    assert plan.predicted <= min(predicted.values()) * (1 + 1e-5)


def test_poses_are_added_until_the_accuracy_is_there(hexapod: Robot) -> None:
    poses = pk.sample_poses(hexapod, 50)
    options: dict[str, Any] = {"kind": "pose", "noise": NOISE, "targets": poses}
    measured = rows(hexapod, poses[:20], "pose")
    wanted = pk.plan_poses(hexapod, poses[20:], 5, measured=measured, **options).predicted
    plan = pk.plan_poses(hexapod, poses[20:], accuracy=wanted, measured=measured, **options)
    assert 1 <= len(plan) <= 5
    assert plan.predicted <= wanted * (1 + 1e-6)
    enough = rows(hexapod, np.vstack([poses[:20], plan.poses]), "pose")
    again = pk.plan_poses(hexapod, poses[20:], accuracy=1.01 * wanted, measured=enough, **options)
    assert len(again) == 0
    assert again.predicted == pytest.approx(plan.predicted, rel=1e-5)
    assert "measure 0 poses" in str(again)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"sigma": None}, "measured: state sigma"),
        ({"values": np.array([np.nan, 1.0, 2.0])}, "measured: row 0 is not read whole"),
        ({"temperature": 20.0}, "measured: rows state temperature"),
    ],
)
def test_rows_that_a_plan_cannot_follow_are_refused(
    hexapod: Robot, change: dict[str, Any], said: str
) -> None:
    poses = pk.sample_poses(hexapod, 20)
    seen = rows(hexapod, poses[:1], "position")
    given: dict[str, Any] = {"values": seen.values[0], "sigma": NOISE, **change}
    values = given.pop("values")
    measured = pk.Measurements(seen.actuators, values[None], **given)
    with pytest.raises(ValueError, match=said):
        pk.plan_poses(hexapod, poses, 3, prior=0.5, measured=measured)


def test_a_target_that_is_sought_goes_not_with_rows_that_are_there(hexapod: Robot) -> None:
    poses = pk.sample_poses(hexapod, 20)
    measured = rows(hexapod, poses, "position")
    with pytest.raises(ValueError, match="measured, unknown"):
        pk.plan_poses(hexapod, poses, 3, prior=0.5, unknown="target", measured=measured)
