"""What `forward` says of its poses beside the numbers: conditioning, same side, status, text."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import pkmcal as pk

from .. import robots, twin
from ..core.test_core import hard_rows
from ..workspaces import WORKSPACE, poses

SQUARE = [name for name in WORKSPACE if name != "linear-delta-6"]
every = pytest.mark.parametrize("name", WORKSPACE)


def stepped(robot: pk.Robot, pose: np.ndarray) -> tuple[Callable[[np.ndarray], np.ndarray], int]:
    """The pose after a step of the machine's free motion in mm, and how many steps it has.

    A turn counts as its arc at the characteristic length. Spatial: a twist at the platform's
    origin. 2tpr2tps: y, the distance w = z / cos(beta), alpha and beta, as in eq. 7.
    """
    R, length, map = twin.rotation(pose), robot.length, robot.model.map

    def spatial(step: np.ndarray) -> np.ndarray:
        x, y, z = step[3:] / length
        turned = (np.eye(3) + np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])) @ R
        return np.concatenate([pose[:3] + step[:3], angles(turned)])

    def planar(step: np.ndarray) -> np.ndarray:
        return pose + np.array([step[0], step[1], 0, 0, 0, step[2] / length])

    def tpr(step: np.ndarray) -> np.ndarray:
        alpha, beta = pose[3] + step[2] / length, pose[4] + step[3] / length
        w = pose[2] / np.cos(pose[4]) + step[1]
        return np.array([w * np.sin(beta), pose[1] + step[0], w * np.cos(beta), alpha, beta, 0.0])

    ways = {"spatial": (spatial, 6), "planar": (planar, 3), "2tpr2tps": (tpr, 4)}
    ways["translation"] = (lambda step: pose + np.concatenate([step, np.zeros(3)]), 3)
    return ways[map]


def angles(R: np.ndarray) -> np.ndarray:
    """Alpha, beta and gamma of R = Rz(gamma) Ry(beta) Rx(alpha), also a complex step away."""

    def arc(y: complex, x: complex) -> complex:
        turn = (x.real * y.imag - y.real * x.imag) / (x.real**2 + y.real**2)
        return complex(np.arctan2(y.real, x.real), turn)

    level = np.sqrt(R[0, 0] ** 2 + R[1, 0] ** 2)
    return np.array([arc(R[2, 1], R[2, 2]), arc(-R[2, 0], level), arc(R[1, 0], R[0, 0])])


def derivative(robot: pk.Robot, pose: np.ndarray, q: np.ndarray) -> np.ndarray:
    """The twin's d closures / d step, (rows, m)."""
    step, count = stepped(robot, pose)
    return twin.complex_step(
        lambda some: twin.closures(robot.model, step(some.astype(complex)), q), np.zeros(count)
    )


@every
def test_conditioning_is_the_ratio_of_the_twins_singular_values(name: str) -> None:
    robot, at = pk.load(name), poses(name, 5, seed=20)
    q = robot.inverse(at)
    found = robot.forward(q)
    for i, pose in enumerate(found.pose):
        sigma = np.linalg.svd(derivative(robot, pose, q[i]), compute_uv=False)
        # the core divides each sphere row by its length, rounded to a float
        assert found.conditioning[i] == pytest.approx(sigma[-1] / sigma[0], rel=2e-7)


def test_conditioning_does_not_depend_on_the_angles_that_describe_a_pose() -> None:
    """At beta near 90 degrees Euler rates are singular; the machine need not be."""
    robot, ratio = pk.load("hexapod"), {}
    for beta in (0.0, 1.2, 1.5706):
        pose = robot.home
        pose[4] = beta
        found = robot.forward(robot.inverse(pose), guess=pose)
        sigma = np.linalg.svd(derivative(robot, pose, robot.inverse(pose)), compute_uv=False)
        ratio[beta] = found.conditioning
        assert found.conditioning == pytest.approx(sigma[-1] / sigma[0], rel=1e-6)
    assert 1e-3 < ratio[1.5706] < ratio[0.0]


def test_conditioning_falls_to_zero_towards_a_singularity() -> None:
    robot, ratios = pk.load("hexapod"), []
    for degrees in (0, 45, 80, 89, 89.9):
        pose = robot.home
        pose[5] = np.radians(degrees)
        ratios.append(float(robot.forward(robot.inverse(pose), guess=pose).conditioning))
    assert np.all(np.diff(ratios) < 0) and ratios[-1] < 1e-2 * ratios[0]


def test_conditioning_and_sides_are_those_of_single_rows_in_any_shape() -> None:
    robot = pk.load("hexapod")
    q = robot.inverse(poses("hexapod", 6, seed=21))
    q[4] = np.nan
    found, shaped = robot.forward(q), robot.forward(q.reshape(2, 3, 6))
    assert np.array_equal(shaped.conditioning.ravel(), found.conditioning, equal_nan=True)
    assert np.flatnonzero(np.isnan(found.conditioning)).tolist() == [4]
    assert found.same_side.tolist() == shaped.same_side.ravel().tolist()
    assert found.same_side.tolist() == [True, True, True, True, False, True]
    one = robot.forward(q[2])
    assert one.conditioning.shape == one.same_side.shape == ()
    assert float(one.conditioning) == pytest.approx(found.conditioning[2], rel=1e-12)


@pytest.mark.parametrize("name", SQUARE)
def test_same_side_is_whether_the_twins_determinants_and_branches_agree(name: str) -> None:
    robot, rng = pk.load(name), np.random.default_rng(22)
    at = poses(name, 300, seed=22)
    q, guess = robot.inverse(at), at + 5.0 * rng.uniform(-1, 1, at.shape) * WORKSPACE[name]
    found = robot.forward(q, guess)
    signs = []
    for i in np.flatnonzero(found.ok):
        there, start = found.pose[i], on_the_map(robot, guess[i])
        own = twin.inverse(robot.model, start)
        if not np.isfinite(own).all():
            signs.append(True)  # out of reach: unknown
            continue
        sides = derivative(robot, there, q[i]), derivative(robot, start, own)
        way = robot.nearest_turns(twin.inverse(robot.model, there), near=q[i]) - q[i]
        on_branch = bool((np.abs(way) < 1e-6).all())  # not so of a limb that has folded over
        signs.append(np.prod(np.sign(np.linalg.det(sides))) > 0 and on_branch)
    assert found.same_side[found.ok].tolist() == signs
    assert not found.same_side[~found.ok].any() and len(signs) > 30


@pytest.mark.parametrize("name", ["3rrr-planar", "rotary-delta", "five-bar", "6-rus"])
def test_a_pose_from_home_in_another_mode_is_on_another_side(name: str) -> None:
    """Also where a crank has folded over and the determinant has changed its sign twice."""
    robot = pk.load(name)
    at = pk.sample_poses(robot, 400, seed=3, share=0.9)
    found = robot.forward(robot.inverse(at, match=True))
    other = found.ok & (np.abs(found.pose - at).max(axis=1) > 1e-6)
    assert not found.same_side[other].any() and found.same_side[found.ok & ~other].all()
    assert other.sum() > 30 or name != "3rrr-planar"


def on_the_map(robot: pk.Robot, pose: np.ndarray) -> np.ndarray:
    """The pose that the map makes of a pose's free coordinates."""
    free = pose[twin.free_columns(robot.model)]
    return twin.pose_of_free(robot.model, free)


def test_another_assembly_mode_is_a_solution_and_said_to_be_on_the_other_side() -> None:
    robot, rng = pk.load("hexapod"), np.random.default_rng(23)
    q = np.broadcast_to(robot.inverse(robot.home), (400, 6))
    guess = robot.home + rng.uniform(-1, 1, (400, 6)) * [200, 200, 200, 1.0, 1.0, 2.0]
    found = robot.forward(q, guess)
    other = found.ok & (np.abs(found.pose - robot.home).max(axis=1) > 1.0)
    assert other.sum() > 10 and (found.ok & ~other).sum() > 10
    for pose in found.pose[other]:
        assert np.abs(twin.closures(robot.model, pose, q[0])).max() < 1e-9
    assert (~found.same_side[found.ok]).sum() > 10


def test_forward_is_a_table_that_ends() -> None:
    robot = pk.load("hexapod")
    q = robot.inverse(poses("hexapod", 30))
    q[1] = np.nan
    found = robot.forward(q)
    title, header, *rows, more = str(found).splitlines()
    assert title == "30 rows: 29 ok, 1 invalid input" and repr(found) == f"<Forward: {title}>"
    assert header.split()[::2] == ["x", "y", "z", "α", "β", "γ", "status"]
    assert len(rows) == 20 and more == "... 10 more rows"
    assert [row.split()[-1] for row in rows[:2]] == ["ok", "input"]
    assert float(rows[0].split()[2]) == pytest.approx(found.pose[0, 2], abs=1e-4)
    assert found._repr_html_().count("<tr>") == 21


def test_rows_that_failed_are_named() -> None:
    robot = pk.load("hexapod")
    q = np.tile(robot.inverse(robot.home), (3, 4, 1))
    q[1, :3] = np.nan
    found = robot.forward(q)
    assert np.argwhere(found.failed).tolist() == [[1, 0], [1, 1], [1, 2]]
    assert (found.ok == ~found.failed).all() and (found.success == found.ok).all()
    assert found.failures() == "3 of 12 rows invalid input (rows 4, 5, 6)"
    assert robot.forward(q[0]).failures() == ""


def test_a_batch_without_rows_or_without_solved_ones_has_certificates() -> None:
    robot = pk.load("hexapod")
    assert robot.forward(np.empty((0, 6))).certificate.ok.shape == (0,)
    unreached = robot.forward(np.full((3, 6), 1e6))
    assert unreached.failed.all() and not unreached.certificate.ok.any()


@every
def test_nearly_all_of_a_workspace_settles_in_the_quick_steps(name: str) -> None:
    """Two steps in floats from the prediction at home, or three from a guess, and two in doubles:
    a mistake there costs time and no digit, for the rows that do not settle are solved anew.
    """
    robot = pk.load(name)
    pose = poses(name, 200)
    q = robot.inverse(pose)
    home = robot.forward(q)
    assert home.ok.all() and np.mean(home.iterations == 2 + 2) >= 0.9
    guessed = robot.forward(q, guess=np.tile(robot.home, (len(q), 1)))
    assert guessed.ok.all() and np.mean(guessed.iterations == 3 + 2) >= 0.8
    at, coordinates = pose[0], q[0]  # one guess for all, which is not home
    turned = coordinates + 0.03 * np.ptp(q, axis=0) * np.random.default_rng(4).normal(size=q.shape)
    beside = robot.forward(turned, guess=at)
    assert beside.ok.all() and np.mean(beside.iterations == 2 + 2) >= 0.9


def two_poses(robot: pk.Robot, q: np.ndarray) -> np.ndarray:
    """Where a linear delta is at coordinates (3,), above and below its carriages: (2, 3)."""
    limbs = twin.numbers(robot.model, None)
    names = ("x", "y", "z")
    base, joint = (
        np.array([[limb[f"{point}.{name}"] for name in names] for limb in limbs])
        for point in ("base", "platform")
    )
    centres = base - joint + q[:, None] * [0.0, 0.0, 1.0]
    rods = np.array([limb["rod"] for limb in limbs])
    sides = 2.0 * (centres[1:] - centres[0])
    squares = (centres**2).sum(axis=1) - rods**2
    foot = np.linalg.lstsq(sides, squares[1:] - squares[0], rcond=None)[0]
    along = np.cross(*sides) / np.linalg.norm(np.cross(*sides))
    foot += along * (along @ (centres[0] - foot))
    height = np.sqrt(rods[0] ** 2 - ((foot - centres[0]) ** 2).sum())
    return np.array([foot + height * along, foot - height * along])


def test_a_delta_goes_to_one_of_its_two_poses_from_guesses_far_away() -> None:
    """Three spheres meet in two points; many guesses need a step halved more than once."""
    robot = pk.load("linear-delta")
    at = poses("linear-delta", 300, seed=8)
    q = robot.inverse(at)
    away = np.random.default_rng(8).uniform(-200.0, 200.0, (300, 3))
    found = robot.forward(q, at + np.pad(away, ((0, 0), (0, 3))))
    assert found.ok.all() and found.iterations.max() > 10
    both = np.array([two_poses(robot, row) for row in q])
    apart = np.linalg.norm(found.pose[:, None, :3] - both, axis=2)
    np.testing.assert_allclose(apart.min(axis=1), 0.0, atol=1e-8)
    assert set(apart.argmin(axis=1)) == {0, 1}


def leaning() -> pk.Robot:
    """Moved by a leg that keeps to an oblique plane, and by another one."""
    limbs = [
        {"kind": "RPS", "base": [0.0, 0.0, 0.0], "platform": [0.0, 0.0, 0.0]}
        | {"normal": [3.0, 4.0, 1.0]},
        {"kind": "UPS", "base": [400.0, -50.0, 20.0], "platform": [0.0, 20.0, 5.0]},
    ]
    return robots.made("translation", {"x": 160.0, "y": -205.0, "z": 340.0}, limbs)


@pytest.mark.parametrize("robot", [pk.load("linear-delta"), pk.load("rotary-delta"), leaning()])
def test_the_residual_is_the_largest_of_what_closures_miss(robot: pk.Robot) -> None:
    """Of rounding, in which the poses of these machines, which do not turn, have no part."""
    reach = [20.0 if unit == "mm" else 0.1 for unit in robot.actuator_units]
    draw = np.random.default_rng(4).uniform(-1.0, 1.0, (400, len(reach)))
    q = robot.inverse(robot.home) + draw * reach
    found = robot.forward(q)
    assert found.ok.all() and np.median(found.iterations) == 4  # mixed precision, and not Newton
    missed = np.abs(robot.machine.closure(robot.slots, found.pose, q).residual)
    assert set(missed.argmax(axis=1)) == set(range(missed.shape[1]))
    np.testing.assert_allclose(found.residual, missed.max(axis=1), rtol=1e-5)


@pytest.mark.parametrize("factor", [2.0**-10, 2.0**10])
@pytest.mark.parametrize("name", WORKSPACE)
def test_a_machine_of_another_size_takes_the_same_steps(name: str, factor: float) -> None:
    """All lengths by a power of two: no rounding differs, where they are asked for one's own."""
    robot = pk.load(name)
    assert isinstance(robot, pk.Robot)
    machine, slots = robot.machine, robot.slots.copy()
    q, guess = hard_rows(name, 203)
    expected = machine.forward(slots, q, guess, threads=1)
    near = machine.forward(slots, q, robot.own_home, threads=1)
    lengths = [*range(6), *(twin.SLOTS.index(each) for each in ("rod", "crank"))]
    slots[:, lengths] *= factor
    slots[~machine.turning, twin.SLOTS.index("offset")] *= factor
    by_unit = np.array([1.0 if unit == "rad" else factor for unit in robot.actuator_units])
    in_pose = np.repeat([factor, 1.0], 3)
    struct = machine.struct
    for field in ("size", "length", "closure_tolerance"):
        setattr(struct, field, factor * getattr(struct, field))
    for i in range(struct.limbs):
        struct.lever[i] *= factor
    for start, known in ((guess, expected), (robot.own_home, near)):
        pose, status, iterations, residual = machine.forward(
            slots, q * by_unit, start * in_pose, threads=1
        )
        np.testing.assert_array_equal(pose, known[0] * in_pose)
        np.testing.assert_array_equal(status, known[1])
        np.testing.assert_array_equal(iterations, known[2])
        np.testing.assert_array_equal(residual, known[3] * factor)


def test_the_tolerance_of_closures_is_for_more_of_them_than_coordinates() -> None:
    """Others hold to rounding, and what is allowed beyond that says nothing of them."""
    strict, plain = robots.hexapod(closure_tolerance=1e-300), robots.hexapod()
    q, guess = hard_rows("hexapod", 203)
    found, expected = strict.forward(q, guess), plain.forward(q, guess)
    assert expected.ok.sum() > 60 and expected.iterations[expected.ok].max() > 5
    np.testing.assert_array_equal(found.status, expected.status)
    np.testing.assert_array_equal(found.pose, expected.pose)
