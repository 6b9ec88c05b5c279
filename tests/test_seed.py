"""Seeds of random draws."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arguments import checked_seed


@pytest.mark.parametrize("seed", [0, 7, 2**64 - 1, np.int64(3)])
def test_whole_numbers_are_seeds(seed: int) -> None:
    assert checked_seed(seed) == int(seed)


@pytest.mark.parametrize("seed", [-1, 2**64, 1.5, None, "a", True])
def test_whatever_else_is_refused_by_all_that_draws(seed: Any) -> None:
    robot = pk.load("2tpr2tps")
    for draws in (
        lambda: pk.tolerance(robot, robot.home, 0.1, samples=10, seed=seed),
        lambda: pk.sample_poses(robot, 3, seed=seed),
        lambda: pk.VirtualMachine(robot, seed=seed),
    ):
        with pytest.raises(ValueError, match="seed must be a whole number from 0"):
            draws()
