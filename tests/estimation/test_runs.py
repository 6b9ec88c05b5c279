"""Runs of relative distances of two files, or of two sessions, have a zero each."""

from __future__ import annotations

import numpy as np
import pytest

import pkmcal as pk

ANCHOR = np.array([1500.0, 200.0, 300.0])
ZEROS = {"monday": 100.0, "tuesday": 100.3}


def days(name: str) -> tuple[pk.Robot, pk.Robot, np.ndarray, np.ndarray]:
    """The machine as described, the true one, actuators and exact distances of 60 poses."""
    robot, rng = pk.load(name), np.random.default_rng(3)
    names = robot.geometry.match("offset*")
    true = robot.replace({each: robot.geometry[each] + 0.4 * rng.normal() for each in names})
    poses = pk.sample_poses(robot, 60, seed=3)
    q = robot.inverse(poses)
    exact = np.linalg.norm(true.forward(q, guess=poses).pose[:, :3] - ANCHOR, axis=1)
    return robot, true, q, exact + 0.02 * rng.normal(size=60)


def of_day(q: np.ndarray, read: np.ndarray, rows: slice, day: str, how: str) -> pk.Measurements:
    reading = pk.readings.RelativeDistance(run=["1"] * len(q[rows]))
    session = {"session": day} if how == "session" else {}
    return pk.Measurements(
        q[rows], read[rows] - ZEROS[day], reading, target=ANCHOR, sigma=0.02,
        file="" if how == "session" else f"{day}.csv", **session,
    )  # fmt: skip


@pytest.mark.parametrize("how", ["file", "session"])
@pytest.mark.parametrize("name", ["hexapod", "linear-delta"])
def test_runs_of_one_name_in_two_files_have_two_zeros(name: str, how: str) -> None:
    robot, true, q, read = days(name)
    sets = [
        of_day(q, read, rows, day, how)
        for rows, day in ((slice(0, 30), "monday"), (slice(30, 60), "tuesday"))
    ]
    found = pk.identify(robot, sets, "offset*")
    assert found.chi2_per_dof == pytest.approx(1.0, abs=5 * np.sqrt(2 / found.dof))
    for day, zero in ZEROS.items():
        k = found.free.index(f"run.{day}.1.zero")
        assert abs(found.values[k] - zero) < 5 * found.stderr[k]
    offsets = [k for k, each in enumerate(found.free) if each.startswith("offset")]
    off = [found.values[k] - true.geometry[found.free[k]] for k in offsets]
    assert np.abs(np.array(off) / found.stderr[offsets]).max() < 5.0


def test_sessions_of_one_file_have_a_zero_each() -> None:
    robot, _, q, read = days("hexapod")
    session = np.repeat(["monday", "tuesday"], 30)
    zeros = np.array([ZEROS[day] for day in session.tolist()])
    reading = pk.readings.RelativeDistance(run=["1"] * 60)
    log = pk.Measurements(q, read - zeros, reading, target=ANCHOR, sigma=0.02, session=session)
    found = pk.identify(robot, log, "offset*")
    assert {"run.monday.1.zero", "run.tuesday.1.zero"} < {*found.free}
    one = pk.Measurements(q, read - 100.0, reading, target=ANCHOR, sigma=0.02)
    assert "run.1.zero" in pk.identify(robot, one, "offset*").free


def test_a_file_that_is_held_out_finds_its_own_zero() -> None:
    robot, _, q, read = days("hexapod")
    fitted = of_day(q, read, slice(0, 40), "monday", "file")
    held = of_day(q, read, slice(40, 60), "tuesday", "file")
    found = pk.identify(robot, fitted, "offset*", holdout=held)
    assert found.holdout_rms < 2 * found.holdout_expected and not found.holdout_contradicts
