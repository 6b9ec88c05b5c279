"""Every row of a calibration is listed, whatever became of it, with how far off it is."""

from __future__ import annotations

import numpy as np

import pkmcal as pk
from pkmcal.fitted.row_names import name_of, row_names
from pkmcal.report.rows import rows

GROSS = 7


def measured(robot: pk.Robot) -> pk.Measurements:
    free = robot.model.free
    drawn = dict(zip(free, np.random.default_rng(2).normal(0.0, 0.3, len(free)), strict=True))
    true = robot.replace({name: robot.geometry[name] + error for name, error in drawn.items()})
    machine = pk.VirtualMachine(true, noise=0.01, seed=1)
    return machine.measure(robot.inverse(pk.sample_poses(robot, 80, seed=5)), kind="pose")


def spoilt(robot: pk.Robot) -> pk.Measurements:
    seen = measured(robot)
    values = seen.values.copy()
    values[GROSS, 0] += 5.0  # mm, in x
    return pk.Measurements(seen.actuators, values, "pose")


def test_a_row_that_is_left_out_keeps_its_residual(hexapod: pk.Robot) -> None:
    found = pk.identify(hexapod, spoilt(hexapod), drop=[GROSS], prior=0.5)
    listed = rows(found)
    assert sorted(listed.row) == list(range(80))
    (k,) = np.flatnonzero(listed.row == GROSS)
    assert listed.use[k] == "left out" and listed.name[k] == f"row {GROSS}"
    np.testing.assert_allclose(listed.after[k], [5.0, 0.0, 0.0], atol=0.1)
    np.testing.assert_allclose(listed.off[k], 5.0, atol=0.1)
    others = np.delete(listed.off, k)
    assert np.nanmax(others) < 0.1


def test_the_residual_of_a_row_left_out_is_what_the_identified_machine_predicts(
    hexapod: pk.Robot,
) -> None:
    seen = spoilt(hexapod)
    found = pk.identify(hexapod, seen, drop=[3, GROSS], prior=0.5)
    listed = rows(found)
    for row in (3, GROSS):
        (k,) = np.flatnonzero(listed.row == row)
        there = found.robot.forward(seen.actuators[row]).pose[:3]
        np.testing.assert_allclose(listed.at[k], there, atol=1e-8)
        np.testing.assert_allclose(listed.after[k], seen.values[row, :3] - there, atol=1e-8)


def test_rows_held_out_and_left_out_are_told_apart(hexapod: pk.Robot) -> None:
    found = pk.identify(hexapod, spoilt(hexapod), drop=[GROSS], holdout=0.25, prior=0.5)
    listed = rows(found)
    assert sorted(listed.row) == list(range(80))
    assert listed.use.count("held out") == len(found.holdout_rows) > 10
    assert listed.use.count("left out") == 1
    held = np.array([use == "held out" for use in listed.use])
    np.testing.assert_allclose(listed.off[held], found.holdout_off, rtol=1e-9)
    np.testing.assert_allclose(listed.off_before[held], found.holdout_off_before, rtol=1e-9)


def test_a_row_has_the_name_that_the_summary_gives_it(hexapod: pk.Robot) -> None:
    data = pk.identify(hexapod, measured(hexapod), prior=0.5).fit.equations.prediction.datasets[0]
    names = [name_of(data, i) for i in range(3)]
    assert names == [row_names([data], [row]) for row in data.rows[:3]]
