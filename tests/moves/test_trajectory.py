"""Trajectories: laws in time, exact accelerations, fastest moves, limits and their times."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from scipy.optimize import brentq

import pkmcal as pk
from pkmcal.core.library import POSE
from pkmcal.moves import derivatives
from pkmcal.moves.peaks import peaks
from pkmcal.report import move_figures

from .. import twin
from ..robots import made, ring

STRAIGHT = ("rbt-6t03p", "hexapod", "6-rus", "linear-delta", "rotary-delta", "3rrr-planar")
CONSTRAINED = ("2tpr2tps", "2tpr2tps-spatial", "3rps", "3prs")
SHARED = ("linear-delta-6",)  # keeps its orientation, so that a straight path can be followed
EIGHT_ROWS = Path(__file__).parents[2] / "examples" / "2tpr2tps-eight-rows.toml"
EVERY = (*STRAIGHT, *CONSTRAINED, *SHARED)
MOVED = [(name, space) for name in EVERY for space in ("pose", "coordinates", "joint")
         if space != "pose" or name not in CONSTRAINED]  # fmt: skip


def ends(robot: pk.Robot) -> np.ndarray:
    return pk.sample_poses(robot, 2, seed=1, share=0.4)


def slope(values: Any, t: np.ndarray, h: float = 4e-3) -> np.ndarray:
    """Derivative of `values(t)` by central differences of sixth order."""
    f = {k: values(t + k * h) for k in (-3, -2, -1, 1, 2, 3)}
    return np.asarray((f[3] - f[-3] - 9 * (f[2] - f[-2]) + 45 * (f[1] - f[-1])) / (60 * h))


# --- laws ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", [pk.trajectory.cubic, pk.trajectory.quintic])
def test_laws_run_from_rest_to_rest(law: Any) -> None:
    made = law([1.0, -2.0], [4.0, 7.0], 1.7)
    position, velocity, _ = made.sample(np.array([0.0, 1.7]))
    np.testing.assert_allclose(position, [[1, -2], [4, 7]], atol=1e-14)
    np.testing.assert_allclose(velocity, 0.0, atol=1e-14)
    t = np.linspace(0.1, 1.6, 9)
    np.testing.assert_allclose(slope(lambda s: made.sample(s)[0], t), made.sample(t)[1], atol=1e-10)
    np.testing.assert_allclose(slope(lambda s: made.sample(s)[1], t), made.sample(t)[2], atol=1e-10)


def test_the_cubic_jumps_in_acceleration_and_the_quintic_does_not() -> None:
    """From rest before to the move: 6 Δ/T² at both ends with the cubic, 0 with the quintic."""
    near = np.array([-1e-9, 0.0, 2.0, 2.0 + 1e-9])
    jumps = {}
    for name in ("cubic", "quintic"):
        before, start, end, after = getattr(pk.trajectory, name)(0.0, 10.0, 2.0).sample(near)[2]
        jumps[name] = float(start - before), float(after - end)
    assert jumps["cubic"] == pytest.approx((15.0, 15.0))
    assert jumps["quintic"] == pytest.approx((0.0, 0.0), abs=1e-12)


def test_time_is_the_first_axis_and_scalars_are_allowed() -> None:
    law = pk.trajectory.quintic(np.zeros((2, 3)), np.ones((2, 3)), 1.0)
    assert [each.shape for each in law.sample(np.zeros((5, 4)))] == [(5, 4, 2, 3)] * 3
    assert [np.shape(each) for each in pk.trajectory.cubic(0, 1, 1.0).sample(0.5)] == [()] * 3


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (([0, 1], [0], 1.0), "start and end must have one shape"),
        ((0.0, np.nan, 1.0), "end must be finite"),
        ((0.0, 1.0, 0.0), "duration must be above 0"),
    ],
)
def test_wrong_laws_are_refused(arguments: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        pk.trajectory.cubic(*arguments)


# --- platform and actuators along a move ---------------------------------------------------------


@pytest.mark.parametrize(("name", "space"), MOVED)
def test_velocities_and_accelerations_are_those_of_the_positions(name: str, space: Any) -> None:
    robot = pk.load(name)
    move = pk.trajectory.move(robot, *ends(robot), duration=2.0, space=space)
    t = np.linspace(0.1, 1.9, 13)
    at = move.sample(t)
    pairs = (
        (lambda s: move.sample(s).actuators, at.velocities),
        (lambda s: move.sample(s).velocities, at.accelerations),
        (lambda s: move.sample(s).pose[:, :3], at.twist[:, 3:]),
        (lambda s: move.sample(s).twist, at.twist_rate),
    )
    for values, expected in pairs:
        np.testing.assert_allclose(slope(values, t), expected, atol=2e-8)
    np.testing.assert_allclose(robot.inverse(at.pose), at.actuators, atol=1e-9)
    assert robot.violation(at.pose).max() < 1e-8


@pytest.mark.parametrize("name", STRAIGHT)
def test_velocities_are_the_jacobian_times_the_rates_of_the_pose(name: str) -> None:
    robot = pk.load(name)
    move = pk.trajectory.move(robot, *ends(robot), duration=2.0)
    at = move.sample(np.linspace(0.2, 1.8, 5))
    rates = slope(lambda s: move.sample(s).pose, at.time)
    free = [POSE.index(each) for each in robot.coordinates]
    found = np.einsum("nij,nj->ni", robot.jacobian(at.pose), rates[:, free])
    np.testing.assert_allclose(found, at.velocities, atol=1e-8)


@pytest.mark.parametrize("name", CONSTRAINED)
def test_machines_whose_limbs_constrain_the_pose_go_straight_in_their_own_coordinates(
    name: str,
) -> None:
    """The matched coordinates are those of the law, and the first and last pose the ends."""
    robot = pk.load(name)
    start, end = ends(robot)
    with pytest.raises(ValueError, match="cannot follow the straight path"):
        pk.trajectory.move(robot, start, end, duration=2.0)
    move = pk.trajectory.move(robot, start, end, duration=2.0, space="coordinates")
    at = move.sample(np.linspace(0.0, 2.0, 9))
    matched = [POSE.index(each) for each in robot.model.match or robot.coordinates]
    expected = pk.trajectory.quintic(start[matched], end[matched], 2.0).sample(at.time)[0]
    np.testing.assert_allclose(at.pose[:, matched], expected, atol=1e-10)
    np.testing.assert_allclose(at.pose[[0, -1]], [start, end], atol=1e-8)
    assert f"straight in {' '.join(robot.model.match or robot.coordinates)}," in repr(move)


@pytest.mark.parametrize("name", [*CONSTRAINED, "hexapod", "3rrr-planar"])
def test_straight_is_what_is_straight_in_the_users_frames(name: str) -> None:
    base, tool = [120.0, -45.0, 300.0, 0.4, -0.7, 2.1], [10.0, 25.0, -80.0, -0.3, 0.5, 1.1]
    model = replace(pk.load(name).model, base_frame=np.array(base), tool_frame=np.array(tool))
    robot = pk.Robot(model)
    start = robot.home
    end = robot.complete(start + np.array([8.0, -6.0, 5.0, 0.03, -0.02, 0.04]))
    move = pk.trajectory.move(robot, start, end, duration=2.0, space="coordinates")
    times = np.linspace(0.2, 1.8, 7)
    at = move.sample(times)
    matched = [POSE.index(each) for each in robot.moved]
    share = pk.trajectory.quintic([0.0], [1.0], 2.0).sample(times)[0]
    way = (end - start)[matched]
    np.testing.assert_allclose((at.pose - start)[:, matched], share * way, rtol=0, atol=1e-8)
    for values, rates in (("actuators", "velocities"), ("velocities", "accelerations")):
        found = slope(lambda t, values=values: getattr(move.sample(t), values), times)
        np.testing.assert_allclose(getattr(at, rates), found, rtol=0, atol=1e-6)


def test_coordinates_turn_the_short_way_round() -> None:
    robot = pk.load("hexapod")
    cos, sin = np.cos(np.radians(177.0)), np.sin(np.radians(177.0))
    turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    limbs = robot.geometry.slots
    drawn = [{"kind": "UPS", "base": turn @ row[:3], "platform": row[3:6]} for row in limbs]
    turned = made("spatial", {"z": float(robot.home[2]), "gamma": np.radians(177.0)}, drawn)
    start, end = turned.home, turned.home
    end[5] = np.radians(-177.0)
    move = pk.trajectory.move(turned, start, end, duration=1.0, space="coordinates")
    gamma = np.degrees(move.sample(np.linspace(0.0, 1.0, 11)).pose[:, 5])
    assert (np.abs(gamma) > 176.99).all()


def test_coordinates_that_no_pose_has_on_the_way_are_refused() -> None:
    robot = pk.load("2tpr2tps")
    start, end = robot.complete([[0, 0, 400, 0, 0.2, 0], [0, 0, -400, 0, 0.2, 0]])
    with pytest.raises(ValueError, match="cannot follow the path: no pose has its y z alpha beta"):
        pk.trajectory.move(robot, start, end, duration=1.0, space="coordinates")


def rotation_in_50_digits(a: Any, b: Any, g: Any) -> Any:
    Rx = mp.matrix([[1, 0, 0], [0, mp.cos(a), -mp.sin(a)], [0, mp.sin(a), mp.cos(a)]])
    Ry = mp.matrix([[mp.cos(b), 0, mp.sin(b)], [0, 1, 0], [-mp.sin(b), 0, mp.cos(b)]])
    Rz = mp.matrix([[mp.cos(g), -mp.sin(g), 0], [mp.sin(g), mp.cos(g), 0], [0, 0, 1]])
    return Rz * Ry * Rx


def closures_in_50_digits(robot: pk.Robot, u: Any, q: Any) -> list[Any]:
    """Spheres, constraints and pose map from their definitions, at x y z α β γ and actuators."""
    R, rows = rotation_in_50_digits(*u[3:]), []
    for limb, n in zip(robot.model.limbs, twin.numbers(robot.model, None), strict=True):
        drive, base = q[limb.actuator] * n["gain"] + n["offset"], twin.base_point(n).tolist()
        d = mp.matrix(u[:3]) + R * mp.matrix(twin.platform_point(n).tolist()) - mp.matrix(base)
        axis = mp.matrix(limb.frame[:, 2].tolist())
        turned = R * mp.matrix(limb.platform_frame[:, 2].tolist())
        if limb.kind in twin.SLIDER_KINDS:
            d, drive = d - drive * axis, mp.mpf(n["rod"])
        rows.append((mp.fdot(d, d) - drive**2) / (2 * drive))
        if limb.kind == "RPS":
            rows.append(mp.fdot(axis, d))
        if limb.kind == "PRS":
            rows.append(mp.fdot(mp.matrix(limb.frames["hinge"][:, 2].tolist()), d))
        if limb.kind == "UPR":
            rows.append(mp.fdot(turned, d))
            rows += [limb.couple * mp.fdot(turned, axis)] if limb.couple else []
    if robot.model.map == "2tpr2tps":  # A eq. 7
        rows += [u[0] - u[2] * mp.tan(u[4]), u[5]]
    return rows


@pytest.mark.parametrize("name", [*CONSTRAINED, *SHARED, EIGHT_ROWS])
def test_platforms_held_by_constraints_accelerate_as_derivatives_in_50_digits_say(
    name: Any,
) -> None:
    """Forward kinematics in 50 digits at three times 1e-12 s apart, and their second difference."""
    robot = pk.load(name)
    start, end = ends(robot)
    move = pk.trajectory.move(robot, start, end, duration=2.0, space="joint")
    at = move.sample(0.7)
    first, last = (robot.inverse(pose).tolist() for pose in (start, end))
    frames = []
    with mp.workdps(50):
        h = mp.mpf("1e-12")
        for step in (-1, 0, 1):
            x = (mp.mpf(0.7) + step * h) / 2
            share = 10 * x**3 - 15 * x**4 + 6 * x**5
            q = [a + share * (mp.mpf(b) - a) for a, b in zip(first, last, strict=True)]
            u = mp.findroot(lambda *u, q=q: closures_in_50_digits(robot, u, q), at.pose.tolist())
            frames.append([*rotation_in_50_digits(*u[3:]).tolist(), list(u[:3])])
        before, now, after = (mp.matrix(frame) for frame in frames)
        velocity = np.array(((after - before) / (2 * h)).tolist(), dtype=float)
        acceleration = np.array(((after - 2 * now + before) / h**2).tolist(), dtype=float)
    R = twin.rotation(at.pose)
    spin, spin_rate = (derivatives.cross_matrix(each[:3]) for each in (at.twist, at.twist_rate))
    np.testing.assert_allclose(spin @ R, velocity[:3], atol=1e-12)
    np.testing.assert_allclose((spin_rate + spin @ spin) @ R, acceleration[:3], atol=1e-11)
    np.testing.assert_allclose(at.twist[3:], velocity[3], rtol=1e-11, atol=1e-10)
    np.testing.assert_allclose(at.twist_rate[3:], acceleration[3], rtol=1e-11, atol=1e-10)


def inverse_in_50_digits(robot: pk.Robot, start: np.ndarray, end: np.ndarray, limb: int) -> Any:
    """q of one limb at s on the straight path: SLERP by Rodrigues, the closure by a root."""
    R0, R1 = (mp.matrix(twin.rotation(pose).tolist()) for pose in (start, end))
    between = R0.T * R1
    angle = mp.acos((between[0, 0] + between[1, 1] + between[2, 2] - 1) / 2)
    axis = mp.matrix([between[2, 1] - between[1, 2], between[0, 2] - between[2, 0],
                      between[1, 0] - between[0, 1]]) / (2 * mp.sin(angle))  # fmt: skip
    K = mp.matrix([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    model = robot.model.limbs[limb]
    n = twin.numbers(robot.model, None)[limb]
    platform, base = mp.matrix(twin.platform_point(n)), mp.matrix(twin.base_point(n))
    frame = mp.matrix(twin.tilted(model, n).tolist())
    p0, p1 = mp.matrix(start[:3].tolist()), mp.matrix(end[:3].tolist())

    def q(s: Any) -> Any:
        turn = mp.eye(3) + mp.sin(s * angle) * K + (1 - mp.cos(s * angle)) * K * K
        h = p0 + s * (p1 - p0) + R0 * (turn * platform) - base
        square = sum(each**2 for each in h)
        if model.kind == "UPS":
            return mp.sqrt(square)
        along = frame.T * h
        if model.kind == "PUS":
            root = mp.sqrt(mp.mpf(n["rod"]) ** 2 - along[0] ** 2 - along[1] ** 2)
            return along[2] - model.branch * root
        kappa = (square + mp.mpf(n["crank"]) ** 2 - mp.mpf(n["rod"]) ** 2) / (2 * n["crank"])
        far = mp.sqrt(along[0] ** 2 + along[1] ** 2)
        return mp.atan2(along[1], along[0]) - model.branch * mp.acos(kappa / far)

    return q


@pytest.mark.parametrize("name", ["rbt-6t03p", "hexapod", "6-rus"])
def test_accelerations_agree_with_derivatives_in_50_digits(name: str) -> None:
    robot = pk.load(name)
    start, end = ends(robot)
    with mp.workdps(50):
        t = 0.7
        law = lambda x: 10 * x**3 - 15 * x**4 + 6 * x**5  # noqa: E731
        at = pk.trajectory.move(robot, start, end, duration=2.0).sample(t)
        for limb in range(6):
            q = inverse_in_50_digits(robot, start, end, limb)
            along = [float(mp.diff(lambda x, q=q: q(law(x / 2)), mp.mpf(t), k)) for k in range(3)]
            found = [at.actuators[limb], at.velocities[limb], at.accelerations[limb]]
            np.testing.assert_allclose(found, along, rtol=1e-10, atol=1e-11)


def test_frames_of_base_and_tool_carry_the_motion_along() -> None:
    from dataclasses import replace

    robot = pk.load("hexapod")
    base, tool = np.array([100.0, 20, 5, 0.1, -0.2, 0.6]), np.array([3.0, -8, 60, 0.2, 0.1, -0.3])
    framed = pk.Robot(replace(robot.model, base_frame=base, tool_frame=tool))
    first = framed.home
    end = np.add(first, [30, -20, 25, 0.1, 0.05, -0.1])
    for space in ("pose", "coordinates", "joint"):
        move = pk.trajectory.move(framed, first, end, duration=1.5, space=space)  # type: ignore[arg-type]
        t = np.linspace(0.1, 1.4, 6)
        at = move.sample(t)
        for values, expected in (
            (lambda s, m=move: m.sample(s).velocities, at.accelerations),
            (lambda s, m=move: m.sample(s).pose[:, :3], at.twist[:, 3:]),
            (lambda s, m=move: m.sample(s).twist, at.twist_rate),
        ):
            np.testing.assert_allclose(slope(values, t), expected, atol=2e-8)


def test_rates_out_of_reach_are_nan_as_a_row_and_wrong_shapes_are_refused() -> None:
    robot = pk.load("rbt-6t03p")
    near, far = robot.home, np.add(robot.home, [150.0, 0, 0, 0, 0, 0])  # some rods reach there
    resting = np.zeros((2, 3, 4, 4))
    resting[:, 0] = pk.screw.from_pose(np.stack([near, far]))
    velocity, acceleration = robot.rates(resting)
    np.testing.assert_array_equal(velocity[0], 0.0)
    assert np.isnan(velocity[1]).all() and np.isnan(acceleration[1]).all()
    assert np.isnan(robot.inverse(far)).all()
    with pytest.raises(ValueError, match="motion must have shape"):
        robot.rates(np.eye(4))


def test_orientation_turns_about_one_axis() -> None:
    """SLERP, against SciPy's, and an angular velocity of constant direction."""
    from scipy.spatial.transform import Rotation, Slerp

    robot = pk.load("hexapod")
    start = np.add(robot.home, [0, 0, 0, 0.2, -0.1, 0.3])
    end = np.add(robot.home, [10, 0, 0, -0.1, 0.15, -0.2])
    at = pk.trajectory.move(robot, start, end, duration=1.0).sample(np.linspace(0, 1, 11))
    share = pk.trajectory.quintic(0, 1, 1.0).sample(at.time)[0]
    turned = Rotation.from_euler("xyz", [start[3:], end[3:]])
    expected = Slerp([0, 1], turned)(share).as_euler("xyz")
    np.testing.assert_allclose(at.pose[:, 3:], expected, atol=1e-12)
    inside = at.twist[1:-1, :3]
    unit = inside / np.linalg.norm(inside, axis=1, keepdims=True)
    np.testing.assert_allclose(unit, np.broadcast_to(unit[0], unit.shape), atol=1e-12)


# --- the fastest move ----------------------------------------------------------------------------


@pytest.mark.parametrize("space", ["pose", "joint"])
def test_the_fastest_move_touches_a_limit_and_breaks_none(space: Any) -> None:
    robot = pk.load("rbt-6t03p")
    most = np.array([40.0, 50, 60, 60, 60, 60])
    for limits in (
        {"velocity": most},
        {"acceleration": 200.0},
        {"velocity": most, "acceleration": 90.0},
    ):
        move = pk.trajectory.move(robot, *ends(robot), space=space, **limits)
        at = move.sample(np.linspace(0, move.duration, 20001))
        used = []
        for values, name in ((at.velocities, "velocity"), (at.accelerations, "acceleration")):
            if name in limits:
                used.append(float((np.abs(values) / limits[name]).max()))
        assert max(used) == pytest.approx(1.0, abs=1e-6)
        assert max(used) <= 1.0 + 1e-9


def test_the_fastest_quintic_in_joint_space_is_known() -> None:
    """Peak speed 15/8 Δ/T, peak acceleration 10/√3 Δ/T²."""
    robot = pk.load("rbt-6t03p")
    way = np.abs(np.subtract(*robot.inverse(ends(robot)))).max()
    by_speed = pk.trajectory.move(robot, *ends(robot), space="joint", velocity=30.0)
    assert by_speed.duration == pytest.approx(15 / 8 * way / 30, rel=1e-10)
    by_force = pk.trajectory.move(robot, *ends(robot), space="joint", acceleration=500.0)
    assert by_force.duration == pytest.approx(np.sqrt(10 / np.sqrt(3) * way / 500), rel=1e-10)


def grazing(eps: float) -> pk.Robot:
    """Six vertical sliders; turned by π + 0.5 rad the rod of the first just reaches its slider."""
    turns = 2 * np.pi * (np.arange(6) // 2) / 3
    sides = np.where(np.arange(6) % 2, 1, -1)
    limbs = [
        {"kind": "PUS", "base": ring(130.0, np.degrees(a)), "platform": ring(65.0, np.degrees(b))}
        | {"slider": [0, 0, 1], "rod": 223.0 if i else 195.0 * (1 + eps), "branch": -1}
        for i, (a, b) in enumerate(zip(turns + 0.3 * sides, turns + 0.8 * sides, strict=True))
    ]
    return made("spatial", {"z": 0.0}, limbs)


@pytest.mark.parametrize("eps", [1e-6, 1e-9, 1e-10, 1e-11, 1e-12])
@pytest.mark.parametrize("before", [0.7, 0.61])
def test_limits_hold_between_samples_where_a_rod_grazes_its_reach(
    eps: float, before: float
) -> None:
    """The peak is a millionth of the path wide; when it comes is known from the turn."""
    robot, nearest = grazing(eps), np.pi + 0.5
    start, end = [0, 0, 0, 0, 0, nearest - before], [0, 0, 0, 0, 0, nearest + 0.513]
    share = before / (before + 0.513)
    roots = np.roots([6, -15, 10, 0, 0, -share])
    tau = next(r.real for r in roots if abs(r.imag) < 1e-9 and 0 < r.real < 1)
    for limits in ({"velocity": 100.0}, {"acceleration": 1000.0}):
        move = pk.trajectory.move(robot, start, end, **limits)
        times = [np.linspace(0, 1, 20_001)]
        times += [tau + way * np.geomspace(1e-12, 1e-3, 4001) for way in (-1, 1)]
        at = move.sample(move.duration * np.sort(np.concatenate(times)))
        for values, name in ((at.velocities, "velocity"), (at.accelerations, "acceleration")):
            if name in limits:
                used = np.abs(values).max() / limits[name]
                assert used == pytest.approx(1.0, abs=1e-3)
                # the peak goes with 1/√eps, and lengths are rounded: 2^-52 of them is some of eps
                assert used <= 1.0 + 1e-6 + 4 * 2**-52 / eps


@pytest.mark.parametrize(("name", "space"), MOVED)
def test_printed_peaks_are_not_exceeded_anywhere(name: str, space: Any) -> None:
    robot = pk.load(name)
    move = pk.trajectory.move(robot, *ends(robot), duration=1.7, space=space)
    at = move.sample(np.linspace(0, move.duration, 4999))
    seen = np.abs(at.velocities).max(axis=0), np.abs(at.accelerations).max(axis=0)
    for found, most in zip(peaks(move.sample, move.duration), seen, strict=True):
        assert (most <= found * (1 + 1e-9) + 1e-9).all()
        np.testing.assert_allclose(found, most, rtol=1e-4, atol=1e-9)


@pytest.mark.parametrize("space", ["pose", "coordinates", "joint"])
@pytest.mark.parametrize("noise", [1e-13, 1e-9, 1e-5])
def test_the_search_for_peaks_ends_whatever_rounding_does(space: str, noise: float) -> None:
    """A line at 1 mm/s whose positions are rounded: no step is short enough to be free of that."""
    robot = pk.load("hexapod")
    move = pk.trajectory.move(robot, robot.home, robot.home, duration=1.0, space=space)
    asked = 0

    def sample(t: np.ndarray) -> Any:
        nonlocal asked
        asked += t.size
        rounded = 800.0 + t[:, None] + noise * np.sin(1e9 * t[:, None])
        at = move.sample(np.zeros(1))
        return replace(at, actuators=rounded, velocities=0 * rounded + 1, accelerations=0 * rounded)

    speed, _ = peaks(sample, 1.0)
    assert speed == pytest.approx([1.0]) and asked < 1_000_000


@pytest.mark.slow
def test_a_redundant_machine_moves_straight_in_its_coordinates() -> None:
    limbs = [
        {"kind": "UPS", "base": ring(325.0, a), "platform": ring(125.0, a + 35 * (-1) ** i, -10.0)}
        for i, a in enumerate((10, 60, 100, 140, 190, 230, 280))
    ]
    robot = made("spatial", {"z": 800.0}, limbs)
    end = robot.home + np.array([40, -30, 50, 0.1, -0.05, 0.08])
    durations = [
        pk.trajectory.move(robot, robot.home, end, velocity=20.0, space=space).duration
        for space in ("joint", "coordinates")
    ]
    assert durations[1] == pytest.approx(durations[0], rel=0.1)


# --- limits and singularities on the way ---------------------------------------------------------


def test_a_broken_stroke_is_reported_with_its_times() -> None:
    """Straight up by 80 mm: the sliders pass 258.8966 at a rise of 50 mm, known from the law."""
    robot = pk.load("rbt-6t03p")
    move = pk.trajectory.move(robot, robot.home, [0, 0, 80, 0, 0, 0], duration=2.0)
    events = move.events()
    assert [(event.what, event.limb) for event in events] == [("stroke", i) for i in range(1, 7)]
    roots = np.roots([6, -15, 10, 0, 0, -(258.8966 - 208.8966245) / 80])
    (root,) = [each.real for each in roots if abs(each.imag) < 1e-9 and 0 < each.real < 1]
    for event in events:
        assert event.time == pytest.approx(2 * root, abs=1e-6)
        assert event.until == 2.0
    assert "limb 3: stroke broken" in str(move)


def test_a_singularity_on_the_way_is_reported_where_the_determinant_changes_sign() -> None:
    from dataclasses import replace

    robot = pk.load("hexapod")
    free = pk.Robot(replace(robot.model, limbs=tuple(
        replace(limb, stroke=None) for limb in robot.model.limbs
    )))  # fmt: skip
    end = np.add(free.home, [0, 0, 0, 0, 0, np.radians(120)])
    move = pk.trajectory.move(free, free.home, end, duration=2.0)
    (event,) = move.events()
    assert event.what == "singularity"
    assert np.degrees(move.sample(event.time).pose[5]) == pytest.approx(90.0, abs=1e-6)
    assert move.conditioning(event.time) < 1e-9


def test_a_stroke_broken_between_two_looks_is_found() -> None:
    """A slider turns back a little beyond its stroke, for √(8 · that / acceleration) in all.

    Counted from where the tolerance of limits ends, 1e-10 of the machine's size.
    """
    from dataclasses import replace

    robot = pk.load("rbt-6t03p")
    start, end = (np.add(robot.home, [x, 0, 0, 0, 0, 0]) for x in (-25.0, 30.0))
    move = pk.trajectory.move(robot, start, end, duration=2.0)
    assert move.events() == []
    rounding = 1e-10 * robot.limb_machine.struct.size
    looks = np.linspace(0, 2, 2001)
    for i in range(6):
        speed = lambda t, i=i: move.sample(t).velocities[i]  # noqa: E731
        turns = np.flatnonzero(np.diff(np.sign(move.sample(looks[1:-1]).velocities[:, i])))
        if turns.size == 0:
            continue
        (k,) = turns
        turn = brentq(speed, looks[k + 1], looks[k + 2], xtol=1e-14)
        at = move.sample(turn)
        far, bend = at.actuators[i], at.accelerations[i]
        stroke = (far + 1e-7, far + 200) if bend > 0 else (far - 200, far - 1e-7)
        limbs = list(robot.model.limbs)
        limbs[i] = replace(limbs[i], stroke=stroke)
        tight = pk.Robot(replace(robot.model, limbs=tuple(limbs)))
        assert tight.feasible(move.sample(looks).pose).ok.all()
        (event,) = pk.trajectory.move(tight, start, end, duration=2.0).events()
        assert (event.what, event.limb) == ("stroke", i + 1)
        assert (event.time + event.until) / 2 == pytest.approx(turn, abs=1e-7)
        assert event.until - event.time == pytest.approx(
            np.sqrt(8 * (1e-7 - rounding) / abs(bend)), rel=0.01
        )
        break
    else:
        pytest.fail("no slider turns back on this path")


def test_a_move_within_limits_has_no_events() -> None:
    robot = pk.load("rbt-6t03p")
    assert pk.trajectory.move(robot, *ends(robot), duration=1.0).events() == []


def test_wrong_moves_are_refused() -> None:
    robot = pk.load("rbt-6t03p")
    move, home = pk.trajectory.move, robot.home
    up = np.add(home, [0, 0, 10, 0, 0, 0])
    for words, arguments in (
        ("give a duration, or limits", {}),
        ("duration must be above 0", {"duration": -1.0}),
        ("velocity must be positive", {"velocity": -3.0}),
        ("velocity must be one limit or 6", {"velocity": [1.0, 2.0]}),
        ("space must be", {"duration": 1.0, "space": "poses"}),
        ("law must be", {"duration": 1.0, "law": "linear"}),
        ("straight in joint space", {"law": "jerk-limited", "velocity": 1.0}),
    ):
        with pytest.raises(ValueError, match=words):
            move(robot, home, up, **arguments)
    with pytest.raises(ValueError, match="end: RBT-6T03P cannot take this pose, out of reach"):
        move(robot, home, [900, 0, 0, 0, 0, 0], duration=1.0)
    with pytest.raises(ValueError, match="the same pose"):
        move(robot, home, home, velocity=1.0)


# --- limited jerk --------------------------------------------------------------------------------


def test_jerk_limited_moves_keep_every_limit() -> None:
    pytest.importorskip("ruckig", reason="the extra pkmcal[ruckig] is not installed")
    robot = pk.load("rbt-6t03p")
    limits = {"velocity": 60.0, "acceleration": 300.0, "jerk": [2000.0] * 6}
    start, end = ends(robot)
    move = pk.trajectory.move(robot, start, end, law="jerk-limited", space="joint", **limits)
    t = np.linspace(0, move.duration, 4001)
    at = move.sample(t)
    np.testing.assert_allclose(at.pose[[0, -1]], [start, end], atol=1e-8)
    assert np.abs(at.velocities).max() <= 60.0 + 1e-6
    assert np.abs(at.accelerations).max() <= 300.0 + 1e-6
    jerk = np.abs(np.diff(at.accelerations, axis=0)).max() / (t[1] - t[0])
    assert 0.9 * 2000 <= jerk <= 2000.0 + 1e-3
    np.testing.assert_allclose(at.accelerations[[0, -1]], 0.0, atol=1e-9)  # no jump


# --- pictures ------------------------------------------------------------------------------------


def test_limbs_drawn_have_their_lengths() -> None:
    for name in ("rbt-6t03p", "hexapod", "6-rus"):
        robot = pk.load(name)
        poses = ends(robot)
        _, anchors, joints = move_figures.places(robot, np.ascontiguousarray(poses))
        lengths = np.linalg.norm(joints - anchors, axis=2)
        expected = {"rbt-6t03p": 223.0, "hexapod": robot.inverse(poses), "6-rus": 230.0}[name]
        np.testing.assert_allclose(lengths, np.broadcast_to(expected, lengths.shape), atol=1e-9)


def test_curves_are_those_of_the_move() -> None:
    robot = pk.load("rbt-6t03p")
    move = pk.trajectory.move(robot, *ends(robot), duration=2.0)
    figure = move_figures.curves([move], ["quintic"], "title")
    line = figure.axes[0].lines[2]
    t = np.asarray(line.get_xdata())[2:-2]
    np.testing.assert_allclose(line.get_ydata()[2:-2], move.sample(t).actuators[:, 2])
    assert len(move_figures.in_space(robot, move.sample([0.0, 1.0]).pose, "ab", "t").axes) == 2


@pytest.mark.parametrize("other", ["the same actuators", "a gap that none crosses"])
def test_a_move_of_actuators_stays_in_one_assembly_mode(other: str) -> None:
    """No platform goes from one to another while its actuators go straight."""
    robot = pk.load("2tpr2tps")
    start = pk.sample_poses(robot, 1, seed=4)[0]
    modes = robot.forward_all(robot.inverse(start)).poses
    if other == "the same actuators":
        ends_there = [pose for pose in modes if np.abs(pose - start).max() > 1.0]
    else:
        elsewhere = pk.sample_poses(robot, 1, seed=5)[0]
        modes = robot.forward_all(robot.inverse(elsewhere)).poses
        ends_there = [pose for pose in modes if np.abs(pose - elsewhere).max() > 1.0]
    assert len(ends_there) == 7
    for end in ends_there:
        with pytest.raises(pk.ArgumentError, match="assembly mode"):
            pk.trajectory.move(robot, start, end, duration=1.0, space="joint")
