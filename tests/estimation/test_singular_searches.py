"""A search that runs into a singular machine begins again with fewer combinations."""

from __future__ import annotations

import numpy as np
import pytest

import pkmcal as pk

from ..sweeps import sweep

pytestmark = pytest.mark.filterwarnings("ignore::pkmcal.CalibrationWarning")


@sweep(
    "name, share, seed",
    [("five-bar", 0.1, 0), ("3rps", 0.9, 14), ("3rps", 0.9, 3)],
    quick=[("3rps", 0.9, 14)],
)
def test_a_robust_loss_ends_where_the_linear_one_does(name: str, share: float, seed: int) -> None:
    """Few poses and much noise: the misfit falls towards a machine that its actuators let go."""
    robot, rng = pk.load(name), np.random.default_rng(seed)
    poses = pk.sample_poses(robot, int(rng.integers(5, 20)), seed=seed, share=share)
    moved = [n for n in robot.geometry.names if n.startswith(("base", "offset", "platform"))]
    shifts = {n: robot.geometry[n] + rng.normal(0.0, 0.04 * robot.length) for n in moved}
    noise = 0.003 * robot.length
    machine = pk.VirtualMachine(robot.replace(shifts), noise, seed)
    measured = machine.measure(robot.inverse(poses))
    linear, robust = (pk.identify(robot, measured, loss=loss) for loss in ("linear", "cauchy"))
    assert robust.converged and robust.rank <= linear.rank
    # little freedom is left to tell two losses apart: both are as near as the noise lets them
    for found in (linear, robust):
        assert found.distances.median < 2.0 * noise < 0.5 * found.distances_before.median
