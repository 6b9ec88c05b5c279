"""Forward kinematics gives the pose, or another that is as good, or says that it does not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pkmcal as pk
from pkmcal.core.library import POSE, STATUS

from . import robots, twin, twin_rows
from .round_trips import CLOSED, round_trips
from .workspaces import WORKSPACE, poses

ENOUGH = 0.999  # of the rows have to be solved
CODE = {words: code for code, words in STATUS.items()}
every = pytest.mark.parametrize("name", WORKSPACE)


# round trips --------------------------------------------------------------------------------------


@every
def test_every_round_trip_returns_or_says_why(name: str) -> None:
    counts = round_trips(name, rows=40_000, chunk=1_000)
    print(name, counts)
    assert counts.wrong == 0
    assert counts.ok >= ENOUGH * counts.rows == ENOUGH * 40_000


@pytest.mark.slow
@every
def test_every_one_of_ten_million_round_trips_returns_or_says_why(name: str) -> None:
    counts = round_trips(name, rows=10_000_000, chunk=20_000, seed=1000)
    print(name, counts)
    assert counts.wrong == 0
    assert counts.ok >= ENOUGH * counts.rows == ENOUGH * 10_000_000


@every
def test_the_judge_of_round_trips_agrees_with_the_twin(name: str) -> None:
    robot, at = pk.load(name), poses(name, 3)
    q = robot.inverse(at)
    slots = robot.geometry.slots + np.random.default_rng(0).normal(0.0, 0.1, (3, 1, 1))
    rows = twin_rows.closures(robot.model, at + 0.1, q, slots)
    for i in range(3):
        expected = twin.closures(robot.model, at[i] + 0.1, q[i], slots[i])
        np.testing.assert_allclose(rows[i], expected, rtol=0, atol=1e-11)


# anything that may come in ------------------------------------------------------------------------

AWAY = np.array([100.0, 100.0, 100.0, 1.0, 1.0, 1.0])  # mm and rad
SMALL = (0.0, -0.0, 5e-324, -1e-320, 1e-300, 1e-30, 1e-8, -1.0)
LARGE = (1e3, 1e5, 1e6, -1e8, 1e15, 1e20, 1e30, 1e100, 1.4e154, 1e300, -1e300, 1.7e308)
STRANGE = np.array([*SMALL, *LARGE, np.inf, -np.inf, np.nan])


def salted(numbers: np.ndarray, share: float, rng: np.random.Generator) -> np.ndarray:
    """The numbers with strange ones among them."""
    there = rng.random(numbers.shape) < share
    return np.where(there, rng.choice(STRANGE, numbers.shape), numbers)


@every
@pytest.mark.parametrize("guessed", [False, True], ids=["from home", "from guesses"])
def test_a_pose_that_comes_out_meets_the_closures_whatever_went_in(
    name: str, guessed: bool
) -> None:
    robot, rng = pk.load(name), np.random.default_rng(1)
    at = poses(name, 20_000, seed=1)
    q = robot.inverse(at)
    q = q + rng.normal(0.0, 0.03, q.shape) * np.abs(q).mean() * rng.integers(0, 2, (len(q), 1))
    q = salted(q, 0.05, rng)
    guess = salted(at + rng.uniform(-1, 1, at.shape) * AWAY, 0.02, rng) if guessed else None
    found = robot.forward(q, guess=guess)
    ok = found.ok
    assert np.isfinite(found.pose[ok]).all() and np.isfinite(found.residual[ok]).all()
    assert np.isnan(found.pose[~ok]).all() and np.isnan(found.residual[~ok]).all()
    missed = np.abs(twin_rows.closures(robot.model, found.pose[ok], q[ok])).max(axis=1)
    assert 0.1 < ok.mean() < 1.0 and missed.max() < CLOSED
    np.testing.assert_allclose(found.residual[ok], missed, rtol=0, atol=1e-10)
    assert (found.status[~np.isfinite(q).all(axis=1)] == CODE["invalid input"]).all()


BAD = [np.nan, np.inf, -np.inf, 1e300, -1e300, 1e20, 5e-324, 0.0]


@every
def test_a_bad_row_leaves_its_neighbours_as_they_are(name: str) -> None:
    robot, rng = pk.load(name), np.random.default_rng(2)
    at = poses(name, 60, seed=2)
    q = robot.inverse(at)
    bad = rng.permutation(len(at))[:24]
    good = np.setdiff1d(np.arange(len(at)), bad)
    bad_at, bad_q = at.copy(), q.copy()
    for k, row in enumerate(bad):
        bad_at[row, k % 6] = BAD[k % len(BAD)]
        bad_q[row, k % q.shape[1]] = BAD[k % len(BAD)]
    calls: list[Any] = [robot.inverse, robot.jacobian, robot.forward_jacobian]
    calls += [robot.error_jacobian, robot.violation, lambda rows: robot.feasible(rows).ok]
    for call in calls:
        assert np.array_equal(call(bad_at)[good], call(at[good]))
    completed = robot.complete(bad_at)[good]
    np.testing.assert_allclose(completed, robot.complete(at[good]), rtol=0, atol=1e-10)
    near = at + rng.uniform(-0.01, 0.01, at.shape)
    for some, alone in ((None, None), (near, near[good])):
        among, by_themselves = robot.forward(bad_q, some), robot.forward(q[good], alone)
        for field in ("pose", "status", "iterations", "residual"):
            assert np.array_equal(getattr(among, field)[good], getattr(by_themselves, field))
    bad_guess = near.copy()
    bad_guess[bad] = np.nan
    among = robot.forward(q, bad_guess)
    assert np.array_equal(among.pose[good], robot.forward(q[good], near[good]).pose)


@every
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_pose_that_is_no_number_has_no_coordinates_and_no_derivatives(
    name: str, bad: float
) -> None:
    robot = pk.load(name)
    for place in map(POSE.index, robot.coordinates):
        pose = robot.home
        pose[place] = bad
        assert np.isnan(robot.inverse(pose)).all()
        assert np.isnan(robot.jacobian(pose)).all()
        assert np.isnan(robot.forward_jacobian(pose)).all()
        assert np.isnan(robot.error_jacobian(pose)).all()
        assert np.isnan(robot.violation(pose)) and np.isnan(robot.complete(pose)).all()
        assert not robot.feasible(pose).ok


@every
def test_a_row_is_known_as_a_whole_or_not_at_all(name: str) -> None:
    robot, numbers = pk.load(name), np.random.default_rng(6)
    at = salted(poses(name, 3_000, seed=6), 0.1, numbers)
    q = salted(robot.inverse(poses(name, 3_000, seed=6)), 0.1, numbers)
    found = [
        *(robot.inverse(at), robot.inverse(at, match=True), robot.complete(at)),
        *(robot.jacobian(at), robot.forward_jacobian(at), robot.error_jacobian(at)),
        *(robot.error_jacobian(at, actuators=q), robot.violation(at)),
    ]
    for rows in found:
        finite = np.isfinite(rows.reshape(len(at), -1))
        known = finite.all(axis=1)
        assert np.isnan(rows[~known]).all() and 0.02 < known.mean() < 1.0
    limits = robot.feasible(at)
    assert not (limits.ok & ~np.isfinite(at[:, :3]).all(axis=1)).any()
    assert not (limits.ok & ~np.isfinite(limits.drive).all(axis=1)).any()


def test_a_rod_at_right_angles_to_its_slider_has_no_jacobian() -> None:
    robot = robots.linear_delta(rod=100.0, radius=160.0)
    pose = robot.home
    pose[:2] = robot.geometry["base1.x"] - 100.0, robot.geometry["base1.y"]
    assert np.isnan(robot.jacobian(pose)).all()


@every
def test_a_pose_too_far_for_squares_has_no_derivatives(name: str) -> None:
    robot, pose = pk.load(name), pk.load(name).home
    pose[1] = 1e300
    for numbers in (robot.inverse(pose), robot.jacobian(pose), robot.error_jacobian(pose)):
        assert np.isnan(numbers).all()


@pytest.mark.parametrize("length", [-800.0, 0.0, -0.0, -5e-324, -1e300, 1e300])
def test_a_length_that_no_leg_can_have_is_infeasible(length: float) -> None:
    robot = pk.load("hexapod")
    q = robot.inverse(robot.home)
    for leg in range(6):
        changed = q.copy()
        changed[leg] = length
        assert robot.forward(changed).status == CODE["infeasible"]
    assert robot.forward(-q).status == CODE["infeasible"]  # the squares alone would be right


def test_what_is_not_finite_is_invalid_input_also_in_the_guess() -> None:
    robot = pk.load("hexapod")
    q = robot.inverse(robot.home)
    for bad in (np.nan, np.inf, -np.inf):
        for place in range(6):
            changed, guess = q.copy(), robot.home
            changed[place] = guess[place] = bad
            assert robot.forward(changed).status == CODE["invalid input"]
            assert robot.forward(q, guess).status == CODE["invalid input"]
            assert robot.forward([q, q], [guess, robot.home]).status.tolist() == [4, 0]


def test_carriages_too_far_apart_for_their_rods_do_not_converge() -> None:
    robot = robots.linear_delta()
    found = robot.forward([300.0, 300.0, 1500.0])
    assert found.status == CODE["not converged"] and np.isnan(found.pose).all()


# large turns --------------------------------------------------------------------------------------


def turned(pose: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A pose 10 mm and 0.1 rad away in a random direction."""
    step = rng.standard_normal((2, 3))
    step /= np.linalg.norm(step, axis=1, keepdims=True)
    matrix = Rotation.from_rotvec(0.1 * step[1]).as_matrix() @ twin.rotation(pose)
    gamma, beta, alpha = Rotation.from_matrix(matrix).as_euler("ZYX")
    return np.concatenate([pose[:3] + 10.0 * step[0], [alpha, beta, gamma]])


@pytest.mark.parametrize("degrees", [30, -45, 52, -60, 70, 80, 85, -85])
def test_a_yawed_hexapod_takes_at_most_twice_the_iterations(degrees: float) -> None:
    robot, rng = pk.load("hexapod"), np.random.default_rng(3)
    upright, yawed = robot.home, robot.home
    yawed[5] = np.radians(degrees)
    q = robot.inverse(yawed)
    guesses = np.array([turned(yawed, rng) for _ in range(1000)])
    # 0.1 rad from 85 degrees reach the singularity at 90: what starts there, or beyond, may end
    # beyond, and at the singularity itself no step is known
    known = np.linalg.det(robot.jacobian(guesses)) / np.linalg.det(robot.jacobian(yawed)) > 0.02
    rows = np.broadcast_to(q, (1000, 6))
    found = robot.forward(rows, guesses)
    assert found.ok.all() and np.abs(found.pose[known] - yawed).max() < 1e-8
    assert known.mean() > 0.9 and (known.all() or abs(degrees) == 85)
    easy = robot.forward(
        np.broadcast_to(robot.inverse(upright), (1000, 6)),
        [turned(upright, rng) for _ in range(1000)],
    )
    assert found.iterations[known].max() <= 2 * easy.iterations.max()
    missed = twin_rows.closures(robot.model, found.pose, rows)
    assert np.abs(missed).max() < CLOSED


# singular machines --------------------------------------------------------------------------------


def test_a_griffis_duffy_hexapod_moves_by_itself_and_is_called_singular() -> None:
    robot, rng = robots.griffis_duffy(), np.random.default_rng(4)
    at = robot.home + rng.uniform(-1, 1, (50, 6)) * [60, 60, 60, 0.3, 0.3, 0.3]
    q = robot.inverse(at)
    # a second pose of the same legs, 20 steps of 1 mm along the motion that the closures leave
    moved = at[0].copy()
    for _ in range(20):
        along = np.linalg.svd(twin.complex_step(lambda u: legs(robot, u, q[0]), moved))[2][-1]
        moved = moved + along / np.linalg.norm(along[:3] + 100.0 * along[3:]) * np.sign(along[0])
        for _ in range(5):
            slope = twin.complex_step(lambda u: legs(robot, u, q[0]), moved)
            moved -= np.linalg.pinv(slope, rcond=1e-6) @ legs(robot, moved, q[0])
    assert np.linalg.norm(moved[:3] - at[0, :3]) + 100.0 * np.abs(moved[3:] - at[0, 3:]).max() > 5.0
    assert np.abs(legs(robot, moved, q[0])).max() < 1e-9
    # so the legs say nothing of where the platform is
    for guess in (
        None,
        at,
        at + 1e-9,
        at + rng.uniform(-1, 1, at.shape) * [5, 5, 5, 0.1, 0.1, 0.1],
    ):
        found = robot.forward(q, guess)
        assert (found.status == CODE["singular"]).all() and np.isnan(found.pose).all()


def legs(robot: pk.Robot, pose: np.ndarray, q: np.ndarray) -> np.ndarray:
    return twin.closures(robot.model, pose, q)


@pytest.mark.parametrize("height", [0.0, 25.0])
def test_a_flat_delta_is_singular(height: float) -> None:
    robot = robots.linear_delta(rod=160.0, radius=160.0)
    guesses = [[0, 0, height + z, 0, 0, 0] for z in (0.0, 1e-6, 0.5, -20.0)]
    found = robot.forward(np.full((4, 3), height), guesses)
    assert (found.status == CODE["singular"]).all() and np.isnan(found.pose).all()


def test_a_delta_that_is_almost_flat_is_right_or_singular() -> None:
    """Carriages level at 0: the platform hangs at z = -sqrt(rod^2 - radius^2)."""
    for over in 10.0 ** np.arange(-13.0, 2.0):
        robot = robots.linear_delta(rod=160.0 + over, radius=160.0)
        found = robot.forward([0.0, 0.0, 0.0], [0, 0, -30, 0, 0, 0])
        rods = [robot.geometry[f"rod{i}"] for i in (1, 2, 3)]
        height = np.sqrt((rods[0] - 160.0) * (rods[0] + 160.0))
        assert found.status in (CODE["ok"], CODE["singular"])
        if found.ok:
            assert abs(found.pose[2] + height) < 1e-8
        assert bool(found.ok) or over < 1e-7


def test_the_rbt_6t03p_as_printed_is_singular() -> None:
    robot = pk.load("rbt-6t03p-printed")
    at = np.random.default_rng(5).uniform(-1, 1, (200, 6)) * [20, 20, 20, 0.15, 0.15, 0.15]
    for guess in (None, at):
        found = robot.forward(robot.inverse(at), guess)
        assert (found.status == CODE["singular"]).all() and np.isnan(found.pose).all()


def test_failures_are_told_in_one_line() -> None:
    robot = pk.load("hexapod")
    q = np.tile(robot.inverse(robot.home), (8, 1))
    q[2], q[5, 3] = -q[2], np.nan
    told = robot.forward(q).failures()
    assert told == "1 of 8 rows infeasible (rows 2); 1 of 8 rows invalid input (rows 5)"
    assert robot.forward(q[:2]).failures() == ""
