"""Rows are fitted in the assembly mode in which they were measured, or named."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.free_parameters import parameters
from pkmcal.estimation.misfits import worst_readings
from pkmcal.estimation.mode_slips import in_other_modes, in_their_modes
from pkmcal.estimation.parameters import Asked

from ..workspaces import WORKSPACE

NOISE, TARGET = 0.02, np.array([30.0, 10.0, 0.0])


def measured(name: str, share: float, seed: int) -> tuple[pk.Robot, pk.Robot, pk.Measurements]:
    """A machine, with other offsets, and what an instrument reads of it in the mode of home."""
    robot, rng = pk.load(name), np.random.default_rng(seed)
    poses = pk.sample_poses(robot, 40, seed=seed, share=share)
    q = robot.inverse(poses)
    units = dict(zip(robot.geometry.names, robot.geometry.units, strict=True))
    offsets = robot.geometry.match("offset*")
    true = robot.replace({
        k: robot.geometry[k] + rng.normal() * (2e-3 if units[k] == "rad" else 0.2) for k in offsets
    })  # fmt: skip
    solved = true.forward(q, guess=poses)
    near = solved.ok & (np.abs(solved.pose - poses)[:, :3].max(axis=1) < 10.0)
    points = (pk.screw.from_pose(solved.pose[near]) @ np.r_[TARGET, 1.0])[:, :3]
    points += NOISE * rng.normal(size=points.shape)
    return robot, true, pk.Measurements(q[near], points, target=TARGET, sigma=NOISE)


@pytest.mark.parametrize(("name", "share"), [("3rrr-planar", 0.5), ("hexapod", 1.0)])
def test_no_row_is_fitted_in_another_mode_than_it_was_measured_in(name: str, share: float) -> None:
    moved = 0
    for seed in range(6):
        robot, true, readings = measured(name, share, seed)
        data = FitData(readings, np.arange(len(readings)), False, False)
        equations = Equations.of([data], parameters(robot, [data], Asked("offset*")))
        start = equations.start()
        moved += in_their_modes(equations, start) is not start
        found = pk.identify(robot, readings, "offset*")
        assert found.warnings == ()
        assert found.chi2_per_dof == pytest.approx(1.0, abs=5 * np.sqrt(2 / found.dof))
        off = found.values - [true.geometry[k] for k in found.free]
        assert np.abs(off / found.stderr).max() < 5.0
    assert moved  # else the test shows nothing


@pytest.mark.parametrize("wrong", [0.0, 1.0, 30.0])
@pytest.mark.parametrize("name", WORKSPACE)
def test_wrong_readings_are_not_taken_for_other_modes(name: str, wrong: float) -> None:
    robot, _, readings = measured(name, 0.5, 1)
    values = readings.values.copy()
    flat = [1.0, 1.0, 0.0] if name == "3rrr-planar" else 1.0
    values[[3, 11, 20]] += wrong * np.random.default_rng(2).normal(size=(3, 3)) * flat
    readings = pk.Measurements(readings.actuators, values, target=TARGET, sigma=NOISE)
    data = FitData(readings, np.arange(len(readings)), False, False)
    equations = Equations.of([data], parameters(robot, [data], Asked("offset*")))
    start = in_their_modes(equations, equations.start())
    again = in_their_modes(equations, start)
    assert again is start
    assert in_other_modes(equations, start) == []


def test_rows_that_stay_in_another_mode_are_named() -> None:
    robot, _, readings = measured("hexapod", 0.5, 3)
    data = FitData(readings, np.arange(len(readings)), False, False)
    equations = Equations.of([data], parameters(robot, [data], Asked("offset*")))
    start = equations.start()
    assert in_other_modes(equations, start) == []
    others = robot.forward_all(equations.table.actuators[5]).poses
    states = start.states.at_poses(np.array([5]), others[-1:])
    (text,) = in_other_modes(equations, equations.at(start.theta, near=states))
    row = int(np.flatnonzero(equations.table.pose_of[0] == 5)[0])
    assert text.startswith("1 row fits another assembly mode") and f"rows {row}" in text


def test_held_out_rows_are_solved_in_their_modes_too() -> None:
    robot, _, readings = measured("3rrr-planar", 0.5, 1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = pk.identify(robot, readings, "offset*", holdout=0.4)
    assert found.holdout_rms < 3 * found.holdout_expected


@pytest.mark.filterwarnings("ignore::pkmcal.exceptions.CalibrationWarning")
def test_how_far_off_a_pose_is_counts_angles_as_their_arc(hexapod: pk.Robot) -> None:
    """In mm, the worst of what was read there; inf where there is no pose."""
    at = hexapod.home + np.random.default_rng(3).uniform(-1, 1, (6, 6)) * [
        50,
        50,
        50,
        0.2,
        0.2,
        0.2,
    ]
    q = hexapod.inverse(at)
    values = at.copy()
    values[4, 3:] = np.nan
    sets = [
        pk.Measurements(q, values, "pose", sigma=0.01),
        pk.Measurements(q[2:3], at[2:3, :3] + [0.0, 0.0, 7.0], "position", sigma=0.01),
    ]
    fit = pk.identify(hexapod, sets, "offset*").fit
    order = [int(np.argmin(np.abs(fit.equations.table.actuators - row).sum(axis=1))) for row in q]
    pose = np.empty((6, 6))
    pose[order] = at + np.array([
        [0, 0, 0, 1e-3, 0, 0], [3, 4, 0, 0, 0, 0], [0, 0, 0, 0, 0, 2e-3], [0, 0, 0, 0, 0, 0],
        [0, 2, 0, 0.1, 0, 0], [0, 0, 0, 0, 0, 0],
    ])  # fmt: skip
    pose[order[3]] = np.nan
    residuals = fit.equations.prediction.seen(pose, fit.start.theta)[1]
    off = worst_readings(fit.equations, residuals)[order]
    arc = 1e-3 * hexapod.length
    np.testing.assert_allclose(off, [arc, 5.0, 7.0, np.inf, 2.0, 0.0], atol=1e-6)


def test_of_many_rows_in_another_mode_each_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whether all modes are found for each of them, or followed from a few."""
    robot, _, readings = measured("hexapod", 0.5, 3)
    data = FitData(readings, np.arange(len(readings)), False, False)
    equations = Equations.of([data], parameters(robot, [data], Asked("offset*")))
    start = equations.start()
    wrong = np.arange(2, 20)
    others = [robot.forward_all(equations.table.actuators[k]).poses for k in wrong]
    far = [
        poses[np.argmax(np.linalg.norm((poses - start.pose[k])[:, :3], axis=1))]
        for k, poses in zip(wrong, others, strict=True)
    ]
    states = start.states.at_poses(wrong, np.array(far))
    slipped = equations.at(start.theta, near=states)
    missed = worst_readings(equations, slipped.residuals)
    assert np.median(missed[wrong]) > 1.0  # mm: they are in other modes
    for each in (1000, 4):
        monkeypatch.setattr("pkmcal.estimation.mode_slips._EACH", each)
        mended = in_their_modes(equations, slipped)
        np.testing.assert_allclose(mended.pose, start.pose, atol=1e-6)
