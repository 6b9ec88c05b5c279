"""What a fit says of the nominal machine is of the machine, not of where frames and tools were."""

from __future__ import annotations

import warnings
from itertools import product

import numpy as np

import pkmcal as pk
from pkmcal.core.poses import compose

from ..simulated import said_by
from ..sweeps import sweep

NOISE = np.array([0.02, 0.02, 0.02, 5e-5, 5e-5, 5e-5])
FRAME = np.array([300.0, -200.0, 100.0, 0.4, -0.9, 2.1])
TOOL = np.array([30.0, 20.0, -60.0, 1.0, 0.3, -2.0])


def seen(robot: pk.Robot, poses: np.ndarray, rng: np.random.Generator) -> pk.Measurements:
    """Poses of a tool in a frame elsewhere, of the exact machine."""
    q = robot.inverse(poses)
    base = np.tile(FRAME, (len(poses), 1))
    values = compose(compose(base, robot.forward(q).pose), np.tile(TOOL, (len(poses), 1)))
    return pk.Measurements(q, values + rng.normal(size=values.shape) * NOISE, "pose")


@sweep(
    "spread, turns",
    product([(80, 80, 50), (80, 80, 0), (120, 0, 0)], [0.0, 1e-4, 0.3]),
    quick=[((80, 80, 50), 0.0), ((120, 0, 0), 0.3), ((80, 80, 0), 1e-4)],
)
def test_poses_that_hardly_turn_begin_at_their_places(
    hexapod: pk.Robot, spread: tuple[float, ...], turns: float
) -> None:
    """An exact machine is off by the noise before it is calibrated, however it moves."""
    rng = np.random.default_rng(5)
    poses = hexapod.home + rng.uniform(-1, 1, (40, 6)) * [*spread, turns, turns, turns]
    given = seen(hexapod, poses, rng)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what poses on a line leave open
        found = pk.identify(hexapod, given, "offset1", unknown=["frame", "target"])
    assert found.rms_before < 3.0 * found.rms
    assert not said_by(found, "unit-errors")


def test_a_machine_without_lengths_fits_any_unit_of_length() -> None:
    """Its poses in micrometres misfit by a thousandth, which says nothing of their unit."""
    arm = pk.SerialArm.from_dh(
        a=[0, 0, 0], d=[0, 0, 0], alpha=np.radians([-90, 90, 0]), theta=[0, 0, 0]
    )
    rng = np.random.default_rng(6)
    true = arm.replace(rng.normal(size=(3, 6)) * [0, 0, 0, 3e-3, 3e-3, 3e-3])
    q = rng.uniform(-1, 1, (40, 3))
    values = pk.screw.to_pose(true.forward(q)) + rng.normal(size=(40, 6)) * NOISE * 20
    found = pk.identify(
        arm, pk.Measurements(q, values, "pose"), "*.d*", unknown=["frame", "target"]
    )
    assert not any("micrometres" in each.text for each in found.verdict.said)
