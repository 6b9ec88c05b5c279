"""Cables over swivelling pulleys, against a construction with circle and tangent in NumPy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pkmcal as pk
from pkmcal.core.library import rows

from .paths import on_a_path

CORNERS = np.array([
    [sx * 2000.0, sy * 1500.0, 2500.0 if up else 0.0]
    for up in (1, 0)
    for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1))
])  # fmt: skip
BLOCK = np.array([[sx * 150.0, sy * 120.0, sz * 80.0] for sx, sy, sz in np.sign(
    CORNERS - [0, 0, 1000.0])])  # fmt: skip
ENDS = list(zip(CORNERS.tolist(), BLOCK.tolist(), strict=True))
RADIUS = 40.0
POSES = np.array([
    [0.0, 0, 1200, 0, 0, 0],
    [300, -200, 1000, 0.1, -0.05, 0.2],
    [-500, 350, 1500, -0.08, 0.12, -0.15],
])  # fmt: skip


def limb(kind: str, base: Any, platform: Any, **more: Any) -> str:
    table = {"kind": kind, "base": list(base), "platform": list(platform)} | more
    entries = (
        f'{key} = "{value}"' if isinstance(value, str) else f"{key} = {value}"
        for key, value in table.items()
    )
    return "[[limb]]\n" + "\n".join(entries) + "\n"


def robot_of(path: Path, limbs: str, pose: str, more: str = "") -> pk.Robot:
    path.write_text(
        'name = "cables"\nunits = { length = "mm", angle = "deg" }\n'
        f"[pose]\n{pose}\n{more}{limbs}"
    )
    return pk.load(path)


@pytest.fixture(scope="module")
def eight(tmp_path_factory: pytest.TempPathFactory) -> pk.Robot:
    """A body on eight cables: four pulleys above and four below, their cables from the floor."""
    limbs = "".join(
        limb(
            "pulley", b, p, radius=RADIUS + i, swivel=[0.0, 0.0, 1.0 if b[2] else -1.0],
            swivel_tilt=[0.4 * i, -0.3 * i], zero=[1.0, 0.0, 0.0],
            offset=10.0 * i, gain=1.0 + 0.01 * i,
        )
        for i, (b, p) in enumerate(ENDS)
    )  # fmt: skip
    folder = tmp_path_factory.mktemp("eight")
    return robot_of(folder / "eight.toml", limbs, 'map = "spatial"\nhome = { z = 1200 }')


@pytest.fixture(scope="module")
def three(tmp_path_factory: pytest.TempPathFactory) -> pk.Robot:
    """A point on three cables that run over pulleys: as many as it has coordinates."""
    anchors = [[1500.0, 0, 2000], [-800, 1200, 2100], [-700, -1300, 1900]]
    limbs = "".join(
        limb("pulley", a, [0.0, 0.0, 0.0], radius=60.0, swivel=[0.0, 0.0, 1.0]) for a in anchors
    )
    folder = tmp_path_factory.mktemp("three")
    pose = 'map = "translation"\nhome = { z = 500 }'
    return robot_of(
        folder / "three.toml", limbs, pose, '[calibration]\nfree = ["base*", "radius*"]\n'
    )


def rotated(pose: np.ndarray) -> np.ndarray:
    sa, sb, sg = np.sin(pose[3:])
    ca, cb, cg = np.cos(pose[3:])
    rx = np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]])
    ry = np.array([[cb, 0, sb], [0, 1, 0], [-sb, 0, cb]])
    rz = np.array([[cg, -sg, 0], [sg, cg, 0], [0, 0, 1]])
    return np.asarray(rz @ ry @ rx)


def cable(
    entry: np.ndarray, frame: np.ndarray, radius: float, tilts: np.ndarray, end: np.ndarray
) -> tuple[float, float]:
    """Length from the entry point to the end and swivel angle, by the tangent to a circle."""
    (s1, s2), (c1, c2) = np.sin(tilts), np.cos(tilts)
    axes = frame @ np.array([[1, 0, 0], [0, c1, -s1], [0, s1, c1]])
    axes = axes @ np.array([[c2, 0, s2], [0, 1, 0], [-s2, 0, c2]])
    first, second, along = axes.T @ (end - entry)
    swivel = np.arctan2(second, first)
    # in the plane of the groove: the circle about (r, 0), entered at its angle π, clockwise
    away = np.array([np.hypot(first, second) - radius, along])
    far = np.linalg.norm(away)
    leaves = np.arctan2(away[1], away[0]) + np.arccos(radius / far)
    return float(radius * (np.pi - leaves) + np.sqrt(far**2 - radius**2)), float(swivel)


def constructed(robot: pk.Robot, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Actuator coordinates and swivels of all limbs at a pose."""
    found = []
    for i, each in enumerate(robot.model.limbs, 1):
        g = robot.geometry
        entry, body = (np.array([g[f"{p}{i}.{c}"] for c in "xyz"]) for p in ("base", "platform"))
        tilts = np.array([g[f"swivel{i}.tilt1"], g[f"swivel{i}.tilt2"]])
        end = pose[:3] + rotated(pose) @ body
        length, swivel = cable(entry, each.frames["base"], g[f"radius{i}"], tilts, end)
        found.append(((length - g[f"offset{i}"]) / g[f"gain{i}"], swivel))
    q, swivels = np.array(found).T
    return q, swivels


def differences(function: Any, at: np.ndarray, step: float) -> np.ndarray:
    """Central differences, one column for each number."""
    columns = []
    for k in range(len(at)):
        up, down = at.copy(), at.copy()
        up[k] += step
        down[k] -= step
        columns.append((function(up) - function(down)) / (2 * step))
    return np.stack(columns, axis=-1)


def test_the_inverse_is_the_tangent_to_the_circle(eight: pk.Robot) -> None:
    for pose in POSES:
        np.testing.assert_allclose(eight.inverse(pose), constructed(eight, pose)[0], rtol=1e-13)


def test_the_forward_kinematics_invert_it(eight: pk.Robot, three: pk.Robot) -> None:
    for robot in (eight, three):
        poses = POSES.copy() if robot is eight else POSES * [1, 1, 1, 0, 0, 0]
        found = robot.forward(robot.inverse(poses))
        assert found.ok.all() and (found.residual < 1e-9).all()
        np.testing.assert_allclose(found.pose, poses, atol=1e-9)


def test_redundant_cables_that_disagree_have_the_pose_of_least_squares(eight: pk.Robot) -> None:
    from scipy.optimize import least_squares

    q = eight.inverse(POSES[1]) + np.random.default_rng(0).normal(0, 1.0, 8)
    found = eight.forward(q)
    gain = np.array([eight.geometry[f"gain{i}"] for i in range(1, 9)])
    best = least_squares(
        lambda pose: gain * (constructed(eight, pose)[0] - q), POSES[1],
        x_scale=[1, 1, 1, *[1e-3] * 3], xtol=1e-15, ftol=1e-15, gtol=1e-15,
    )  # fmt: skip
    assert found.ok
    np.testing.assert_allclose(found.pose, best.x, atol=2e-5)


@settings(max_examples=60, deadline=None)
@given(
    st.floats(1.0, 200.0), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5),
    st.floats(0.0, 6.28), st.floats(450.0, 3000.0), st.floats(-3000.0, 3000.0),
)  # fmt: skip
def test_derivatives_of_length_and_swivel(
    radius: float, tilt1: float, tilt2: float, turn: float, away: float, along: float
) -> None:
    frame = np.array([[1.0, 0, 0], [0, 0.6, -0.8], [0, 0.8, 0.6]])
    own = np.array([radius, tilt1, tilt2])
    end = frame @ np.array([away * np.cos(turn), away * np.sin(turn), along])

    def reference(x: np.ndarray) -> np.ndarray:
        return np.array(cable(np.zeros(3), frame, x[0], x[1:3], x[3:]))

    x = np.concatenate([own, end])
    exact = reference(x)
    names = ("l", "by_end", "by_own", "bend", "swivel", "swivel_by_end", "swivel_by_own")
    found = dict(zip(names, rows("pulley", own, frame.ravel(), end[None]), strict=True))
    assert abs(found["l"][0] - exact[0]) < 1e-11 * exact[0]
    assert abs(found["swivel"][0] - exact[1]) < 1e-12
    steps = np.array([1e-3, 1e-6, 1e-6, 1e-3, 1e-3, 1e-3])
    by = differences(lambda u: reference(u * steps), x / steps, 1.0) / steps
    if abs(abs(exact[1]) - np.pi) > 1e-2:  # the swivel counts from -π to π
        np.testing.assert_allclose(found["swivel_by_own"][0], by[1, :3], atol=2e-6)
        np.testing.assert_allclose(found["swivel_by_end"][0], by[1, 3:], atol=1e-8)
    np.testing.assert_allclose(found["by_own"][0], by[0, :3], rtol=1e-5, atol=1e-4)
    np.testing.assert_allclose(found["by_end"][0], by[0, 3:], atol=1e-7)
    assert abs(np.linalg.norm(found["by_end"][0]) - 1.0) < 1e-13  # along the straight part

    def slope(x: np.ndarray) -> np.ndarray:
        return np.asarray(rows("pulley", own, frame.ravel(), x[None])[1][0])

    np.testing.assert_allclose(found["bend"][0], differences(slope, end, 1e-3), atol=1e-8)


def test_a_small_pulley_is_a_cable_from_point_to_point(tmp_path: Path) -> None:
    limbs = "".join(limb("pulley", b, p, radius=1e-9, swivel=[0.0, 0.0, 1.0]) for b, p in ENDS)
    plain = "".join(limb("cable", b, p) for b, p in ENDS)
    pose = 'map = "spatial"\nhome = { z = 1200 }'
    small, point = (
        robot_of(tmp_path / "a.toml", limbs, pose),
        robot_of(tmp_path / "b.toml", plain, pose),
    )
    np.testing.assert_allclose(small.inverse(POSES), point.inverse(POSES), atol=1e-8)


def test_the_jacobian_and_its_errors_by_differences(three: pk.Robot) -> None:
    pose = np.array([200.0, -150, 700, 0, 0, 0])
    q = three.inverse(pose)
    by_free = differences(lambda xyz: three.inverse(np.r_[xyz, 0, 0, 0]), pose[:3], 1e-2)
    np.testing.assert_allclose(three.jacobian(pose), by_free, atol=1e-9)
    by_q = differences(lambda x: three.forward(x).pose[:3], q, 1e-2)
    np.testing.assert_allclose(three.forward_jacobian(pose), by_q, atol=1e-7)
    found = three.error_jacobian(pose)
    for name in three.geometry.names:
        step = 1e-5 if "tilt" in name or "gain" in name else 1e-2
        ends = [
            three.replace({name: three.geometry[name] + side * step}).forward(q, pose).pose[:3]
            for side in (1, -1)
        ]
        column = found[:3, three.geometry.names.index(name)]
        np.testing.assert_allclose(column, (ends[0] - ends[1]) / (2 * step), rtol=1e-6, atol=2e-6)


def test_rates_and_accelerations_by_differences(eight: pk.Robot, three: pk.Robot) -> None:
    """Of the actuators along a path of the platform, and of the platform along one of these."""
    for robot in (eight, three):
        at, q, speed, bend, motion = on_a_path(robot, POSES[1])
        velocity, acceleration = robot.rates(motion)
        np.testing.assert_allclose(velocity, speed, atol=1e-4)
        np.testing.assert_allclose(acceleration, bend, atol=1e-3)
    back, _, _ = robot.machine.motion(
        robot.slots, at[None], q[None], velocity[None], acceleration[None]
    )
    np.testing.assert_allclose(back[0, :, :3], motion[:, :3], atol=1e-6)


def test_swivels_are_passive_joints(eight: pk.Robot) -> None:
    assert eight.passive_names == tuple(f"swivel{i}" for i in range(1, 9))
    found = eight.forward(eight.inverse(POSES)).passive
    wanted = np.array([constructed(eight, pose)[1] for pose in POSES])
    np.testing.assert_allclose(found, wanted, atol=1e-12)


def test_an_end_within_the_groove_is_out_of_reach(three: pk.Robot) -> None:
    inside = np.array([1500.0 - 60.0, 0.0, 2000.0, 0, 0, 0])  # at the pulley's middle
    assert np.isnan(three.inverse(inside)).all()
    assert not three.feasible(inside).ok


def test_no_poses_are_no_rows(eight: pk.Robot) -> None:
    none = np.zeros((0, 6))
    assert eight.inverse(none).shape == (0, 8) and eight.forward(np.zeros((0, 8))).pose.shape == (
        0,
        6,
    )
    assert eight.jacobian(none).shape == (0, 8, 6) and len(eight.error_jacobian(none)) == 0
    assert pk.tensions(eight, none, least=1.0).tension.shape == (0, 8)


def test_a_written_file_reads_back_to_the_bit(eight: pk.Robot, tmp_path: Path) -> None:
    eight.save(tmp_path / "again.toml")
    again = pk.load(tmp_path / "again.toml")
    assert again.geometry.names == eight.geometry.names
    np.testing.assert_array_equal(again.geometry.values, eight.geometry.values)
    np.testing.assert_array_equal(again.inverse(POSES), eight.inverse(POSES))


def test_a_calibrated_file_keeps_its_words_and_has_the_new_radii(tmp_path: Path) -> None:
    example = Path(__file__).parents[2] / "examples" / "cable-robot" / "robot.toml"
    robot = pk.load(example)
    found = robot.replace({"wheel": 41.5, "swivel3.tilt2": 0.01, "base2.z": 2501.25})
    found.save(tmp_path / "calibrated.toml", like=example)
    again = pk.load(tmp_path / "calibrated.toml")
    np.testing.assert_allclose(again.geometry.values, found.geometry.values, rtol=1e-15)
    assert again.geometry["radius8"] == 41.5
    assert "the pulley\n# turns about that axis" in (tmp_path / "calibrated.toml").read_text(
        "utf-8"
    )


def test_modes_are_sought_and_not_certified(three: pk.Robot) -> None:
    modes = three.forward_all(three.inverse([100.0, 50, 600, 0, 0, 0]), starts=40)
    assert not modes.complete and not modes.certified.any() and "pulleys" in modes.reason
    np.testing.assert_allclose(modes.poses[0, :3], [100.0, 50, 600], atol=1e-8)


def test_what_knows_no_pulleys_says_so(three: pk.Robot, tmp_path: Path) -> None:
    with pytest.raises(pk.ArgumentError, match=r"pulley"):
        pk.export.mjcf(three, tmp_path / "out")


def test_pages_refuse_pulleys_and_reports_do_without(three: pk.Robot, tmp_path: Path) -> None:
    with pytest.raises(pk.ArgumentError, match="has pulleys, which the page cannot draw"):
        pk.show(three, tmp_path / "page.html")
