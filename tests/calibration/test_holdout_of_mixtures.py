"""Rows that are held out of machines whose actuators are more than their ways to move."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk

from ..sweeps import sweep

CABLES = Path(__file__).parents[2] / "examples" / "cable-robot" / "robot.toml"
OFFSETS = [f"offset{i}" for i in range(1, 9)]
DRAWS = 8
FITTED, HELD = slice(0, 30), slice(30, 40)


def held_out(seed: int, noise: list[float], winches: float, off: float = 0.0) -> pk.Identification:
    """Eight cables, a quarter of the rows held out, these turned by `off` about x, rad."""
    rng, robot = np.random.default_rng(seed), pk.load(CABLES)
    true = robot.replace({name: robot.geometry[name] + 2.0 * rng.normal() for name in OFFSETS})
    poses = robot.home + rng.uniform(-1, 1, (40, 6)) * [900, 600, 500, 0.1, 0.1, 0.1]
    q = true.inverse(poses) + rng.normal(0.0, winches, (40, 8))
    read = poses + rng.normal(size=(40, 6)) * noise
    read[30:, 3] += off
    fitted, held = (
        pk.Measurements(q[rows], read[rows], "pose") for rows in (slice(30), slice(30, 40))
    )
    return pk.identify(robot, fitted, OFFSETS, holdout=held)


@sweep("length, angle", [(0.5, 1e-5), (0.1, 1e-4), (0.02, 2e-3)], quick=[(0.5, 1e-5)])
def test_held_out_rows_agree_whatever_is_the_ratio_of_lengths_and_angles(
    length: float, angle: float
) -> None:
    """Each has a noise of its own, which residuals show though the cables' errors are in them."""
    noise = [length] * 3 + [angle] * 3
    found = [held_out(seed, noise, 0.1).holdout_contradicts for seed in range(DRAWS)]
    assert sum(found) <= 1


@sweep("winches, length, angle", [(0.3, 0.1, 1e-4), (0.1, 0.3, 1e-3)], [(0.1, 0.3, 1e-3)])
def test_lengths_angles_and_cables_each_have_the_noise_that_was_drawn(
    winches: float, length: float, angle: float
) -> None:
    found = [held_out(seed, [length] * 3 + [angle] * 3, winches) for seed in range(20, 25)]
    noise = [[*np.array(each.component_noise[0])[[0, 5]], each.actuator_noise] for each in found]
    assert np.median(noise, axis=0) == pytest.approx([length, angle, winches], rel=0.25)


def test_cables_without_noise_leave_lengths_and_angles_their_own() -> None:
    """Lengths that are met exactly show nothing of the noise of the readings beside them."""
    found = [held_out(seed, [0.1] * 3 + [1e-4] * 3, 0.0) for seed in range(40, 44)]
    noise = [np.array(each.component_noise[0])[[0, 5]] for each in found]
    ratio = [each.holdout_rms / each.holdout_expected for each in found]
    assert np.median(noise, axis=0) == pytest.approx([0.1, 1e-4], rel=0.15)
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.12)
    assert all(each.verdict.state == "calibrated" for each in found)
    assert not any(said.check == "holdout-nearer" for each in found for said in each.verdict.said)


@sweep("seed", [0, 1, 2], quick=[0])
def test_angles_that_are_off_contradict_as_well(seed: int) -> None:
    assert held_out(seed, [0.1] * 3 + [1e-4] * 3, 0.1, 0.01).holdout_contradicts
