"""What no reading ends is named as what it is: motions of all anchors apart from their growth."""

from __future__ import annotations

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.estimation.gauges import _motions
from tests.robots import made

CORNERS = np.array([[0.0, 0, 0], [2400, 1800, 0], [-300, 2300, 0], [2500, -400, 0]])
SCALE = "the common scale: all lengths and gains may grow by the same factor"


@pytest.mark.parametrize(
    ("read", "rank", "motions"),
    [
        ([], 8, ["along x and y and turned about z"]),
        ([(0, 0)], 9, ["moved along y:", "moved as one body in 1 more way"]),
        ([(0, 0), (0, 1)], 10, ["moved as one body in 1 way"]),
    ],
)
def test_anchors_that_grow_about_a_place_that_was_read_are_not_moved_as_one_body(
    read: list[tuple[int, int]], rank: int, motions: list[str]
) -> None:
    limbs = [{"kind": "cable", "base": a, "platform": [0.0, 0.0, 0.0]} for a in CORNERS]
    sled = made("xy", {"x": 1100.0, "y": 900.0}, limbs)
    rng = np.random.default_rng(0)
    free = [n for n in sled.geometry.match(["base*", "gain*"]) if not n.endswith("z")]
    true = sled.replace({n: sled.geometry[n] + rng.normal(0, 3) for n in free if "base" in n})
    at = sled.home + rng.uniform(-1, 1, (40, 6)) * [600, 500, 0, 0, 0, 0]
    q = true.inverse(at) + rng.normal(0, 0.2, (40, 4))
    seen = np.full((40, 3), np.nan)
    for row, axis in read:
        seen[row, axis] = at[row, axis]
    found = pk.identify(sled, pk.Measurements(q, seen, sigma=0.3, actuator_sigma=0.2), free)
    named = [text for text in found.gauges if "mirror" not in text]
    assert found.rank == rank and found.unidentifiable == ()
    assert SCALE in named and len(named) == len(motions) + 1
    assert all(words in text for words, text in zip(motions, named, strict=False))


MACHINES = [robot for robot in map(pk.load, pk.machines()) if isinstance(robot, pk.Robot)]
SPATIAL = [robot for robot in MACHINES if robot.model.map == "spatial" and not robot.model.chains]


@pytest.mark.parametrize("robot", SPATIAL, ids=lambda robot: str(robot.name))
def test_the_base_turned_by_its_numbers_carries_the_platform_along(robot: pk.Robot) -> None:
    shifted = np.random.default_rng(1).normal(0, 0.05, len(robot.geometry.names))
    lengths = zip(robot.geometry.numbers, shifted, strict=True)
    robot = robot.replace(
        {n.name: robot.geometry[n.name] + d for n, d in lengths if n.unit == "mm"}
    )
    poses = pk.sample_poses(robot, 8, seed=1)
    motions = _motions(robot).reshape(-1, 14)[robot.geometry.slot_index]
    moved = robot.error_jacobian(poses)[:, :3] @ motions
    out = poses[:, :3] - robot.slots[:, :3].mean(axis=0)
    for k, axis in enumerate(np.eye(3)):
        assert np.abs(moved[:, :, k] - axis).max() < 1e-9
        assert np.abs(moved[:, :, 3 + k] - np.cross(axis, out)).max() < 1e-9 * robot.length
