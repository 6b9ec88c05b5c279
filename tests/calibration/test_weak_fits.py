"""Fits of more numbers than poses determine well: they end, and not far from any machine."""

from __future__ import annotations

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arrays import FloatArray


def _commands(robot: pk.Robot, count: int, seed: int) -> FloatArray:
    """In a box of 80 mm around home."""
    pose = np.tile(robot.home, (count, 1))
    pose[:, :3] += np.random.default_rng(seed).uniform(-40, 40, (count, 3))
    return np.asarray(robot.inverse(robot.complete(pose)))


@pytest.mark.filterwarnings("ignore::pkmcal.CalibrationWarning")
@pytest.mark.parametrize(
    ("name", "seed"), [("tricept", 0), ("tricept", 1), ("tricept", 2), ("delta-parallelograms", 0)]
)
def test_a_fit_of_positions_in_a_small_box_ends_nearer_to_the_truth(name: str, seed: int) -> None:
    """All joints in error, and combinations of them that a tenth of the machine would not show."""
    robot = pk.load(name)
    sigma = np.array([{"mm": 0.1, "rad": 5e-4, "1": 0.0}[u] for u in robot.geometry.units])
    wrong = sigma * np.random.default_rng(seed).normal(size=len(sigma))
    true = robot.replace(robot.geometry.values + wrong)
    q = _commands(robot, 40, seed + 100)
    measured = pk.VirtualMachine(true, noise=0.01, seed=seed).measure(q, kind="position")
    found = pk.identify(robot, measured)
    assert found.converged and found.rms < 0.02
    other = _commands(robot, 200, 999)
    at = true.forward(other).pose[:, :3]
    before, after = (
        np.linalg.norm(each.forward(other).pose[:, :3] - at, axis=1)
        for each in (robot, found.robot)
    )
    assert np.sqrt((after**2).mean()) < 0.03 < 0.1 < np.sqrt((before**2).mean())
    assert found.verdict.state == "doubtful"  # what it cannot know is said
