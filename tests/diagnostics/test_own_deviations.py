"""Components of which some have the sigma that is stated of them and others have not."""

from __future__ import annotations

import numpy as np
import pytest

import pkmcal as pk

from ..simulated import said_by
from ..sweeps import sweep

DRAWS = 3
SIGMA = [0.02] * 3 + [5e-5] * 3


def drawn(
    seed: int, larger: list[float], second: float = 0.0
) -> tuple[pk.Identification, pk.Robot]:
    """A hexapod by poses with noise `larger` times what is stated of each component.

    Rows in turn are of a second machine of which offsets are others by `second` mm.
    """
    rng, robot = np.random.default_rng(seed), pk.load("hexapod")
    names = robot.geometry.match(["base*", "platform*", "offset*"])
    true = robot.replace({name: robot.geometry[name] + 0.3 * rng.normal() for name in names})
    offsets = [f"offset{i}" for i in range(1, 7)]
    other = true.replace({name: true.geometry[name] + second * rng.normal() for name in offsets})
    q = robot.inverse(pk.sample_poses(robot, 40, seed=seed, share=0.5))
    there = np.where(np.arange(40)[:, None] % 2, other.forward(q).pose, true.forward(q).pose)
    read = there + rng.normal(size=there.shape) * SIGMA * np.array(larger)
    data = pk.Measurements(q, read, "pose", sigma=SIGMA)
    return pk.identify(robot, data, list(names)), true


def named(found: pk.Identification) -> bool:
    return bool(said_by(found, "two-machines"))


pytestmark = pytest.mark.filterwarnings("ignore:residuals are")


@sweep("larger", [[1, 1, 5, 1, 1, 1], [3.5, 3.5, 3.5, 1, 1, 1]], quick=[[1, 1, 5, 1, 1, 1]])
def test_noise_of_some_components_is_no_second_machine(larger: list[float]) -> None:
    assert not any(named(drawn(seed, larger)[0]) for seed in range(DRAWS))


@sweep("seed", range(3), quick=[0])
def test_a_second_machine_is_seen_beside_angles_whose_sigma_is_too_small(seed: int) -> None:
    assert named(drawn(seed, [1, 1, 1, 2, 2, 2], 0.15)[0])
