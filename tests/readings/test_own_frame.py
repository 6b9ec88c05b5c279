"""An instrument of one's own, in a frame of its own that is not known, says where that begins."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.core.poses import compose, invert
from pkmcal.readings import Position, Predicted, Reading, Sighting, frame_of_points

from ..simulated import hexapod_poses

SCALE = 1.0 / 25.4


@dataclass(frozen=True, eq=False)
class Inches(Reading):
    """A tracker that gives places in inches."""

    name = "inches"
    components = (("east", "in"), ("north", "in"), ("up", "in"))
    framed = True

    def predict(self, at: Any, **numbers: Any) -> Predicted:
        """As `Position`, in inches."""
        seen = Position().predict(at)
        by_frame = None if seen.by_frame is None else SCALE * seen.by_frame
        return Predicted(SCALE * seen.values, SCALE * seen.by_twist, by_frame=by_frame)

    def mm(self, m: Any, length: float) -> np.ndarray:
        """An inch is one anywhere."""
        return np.full(3, 25.4)


@dataclass(frozen=True, eq=False)
class Placed(Inches):
    """The same, which says where its frame begins."""

    name = "placed inches"

    def frame(self, seen: Sighting) -> tuple[np.ndarray, Mapping[int, np.ndarray]]:
        """By the points, in mm."""
        known = -np.ones(len(seen.values), dtype=np.intp)
        mm = seen.values / SCALE
        return frame_of_points(Sighting(mm, seen.predicted / SCALE, seen.point, seen.turn, known))


@pytest.mark.parametrize("turned", [0.1, 1.5, 3.0])
@pytest.mark.parametrize("name", ["hexapod", "2tpr2tps"])
def test_its_frame_is_found_wherever_it_stands(name: str, turned: float) -> None:
    robot = pk.load(name)
    poses = pk.sample_poses(robot, 40, seed=1)
    if name == "hexapod":
        poses = hexapod_poses(robot, 40, np.random.default_rng(2))
    q = robot.inverse(poses)
    base = np.array([3000.0, -1200.0, 400.0, 0.3, -0.2, turned])
    seen = compose(base, robot.forward(q).pose)[:, :3] * SCALE
    seen += np.random.default_rng(3).normal(0, 0.01 * SCALE, seen.shape)
    measured = pk.Measurements(q, seen, Placed(), sigma=0.01 * SCALE)
    found = pk.identify(robot, measured, "offset1", unknown="frame")
    assert found.converged and found.rms < 0.03
    stands = np.array([found.parameters[f"frame.{each}"]["value"] for each in FRAME])
    np.testing.assert_allclose(compose(invert(base), stands[None])[0], 0.0, atol=0.1)


FRAME = ("x", "y", "z", "alpha", "beta", "gamma")


def test_one_that_says_nothing_begins_at_the_base(hexapod: pk.Robot) -> None:
    """And is found from there where it is turned by little."""
    q = hexapod.inverse(hexapod_poses(hexapod, 40, np.random.default_rng(2)))
    base = np.array([30.0, -12.0, 40.0, 0.01, -0.02, 0.03])
    seen = compose(base, hexapod.forward(q).pose)[:, :3] * SCALE
    seen += np.random.default_rng(3).normal(0, 0.01 * SCALE, seen.shape)
    measured = pk.Measurements(q, seen, Inches(), sigma=0.01 * SCALE)
    found = pk.identify(hexapod, measured, "offset1", unknown="frame")
    np.testing.assert_array_equal(found.fit.aligned.theta[-6:], 0.0)
    assert found.converged and found.rms < 0.03
