"""Cables over several points, against sums of distances in NumPy with complex steps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.exceptions import FileError
from pkmcal.kinematics import pose_steps
from tests.kinematics.paths import on_a_path
from tests.robots import made

# A point in the plane on three cables over four anchors; numbers of parts as a real one has.
FOUR = np.array([[0.0, 0, 0], [4000, 0, 0], [0, 3000, 0], [4000, 3000, 0]])
OVER = [(0, 1), (0, 2), (1, 3)]
PARTS = [(1, 1), (1, 2), (1, 2)]
CORNERS = np.array([
    [sx * 2000.0, sy * 1500.0, 2500.0 if up else 0.0]
    for up in (1, 0)
    for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1))
])  # fmt: skip
POSES = np.array([
    [0.0, 0, 1200, 0, 0, 0],
    [300, -200, 1000, 0.1, -0.05, 0.2],
    [-500, 350, 1500, -0.08, 0.12, -0.15],
])  # fmt: skip


def tackle(points: Any, parts: Any, platform: Any, **more: Any) -> dict[str, Any]:
    first, *others = np.asarray(points).tolist()
    over = {"base": first, "over": others, "parts": list(parts)}
    return {"kind": "tackle", "platform": list(platform)} | over | more


@pytest.fixture(scope="module")
def plane() -> pk.Robot:
    limbs = [tackle(FOUR[list(o)], p, [0, 0, 0]) for o, p in zip(OVER, PARTS, strict=True)]
    return made("xy", {"x": 1900.0, "y": 1300.0}, limbs)


@pytest.fixture(scope="module")
def three() -> pk.Robot:
    """A point on as many cables as it has coordinates: of two, three and one points."""
    ends = np.array([[1500.0, 0, 2000], [-800, 1200, 2100], [-700, -1300, 1900]])
    beside = np.array([60.0, 150, -20])
    limbs = [
        tackle([ends[0], ends[0] + beside], (1, 1), [0, 0, 0], offset=-20.0, gain=1.5),
        tackle([ends[1], ends[1] - beside, ends[1] + [0, 300, 0]], (2, 1, 3), [0, 0, 0]),
        {"kind": "cable", "base": ends[2], "platform": [0, 0, 0]},
    ]
    return made("translation", {"z": 500.0}, limbs)


@pytest.fixture(scope="module")
def eight() -> pk.Robot:
    """A body on four tackles, two pulleys and two cables; a spool winds up the first."""
    body = np.sign(CORNERS - [0, 0, 1000.0]) * [150.0, 120.0, 80.0]
    limbs: list[dict[str, Any]] = []
    for i, (b, p) in enumerate(zip(CORNERS, body, strict=True)):
        if i < 4:
            more = {"drive": {"spool": 60.0, "buildup": 0.03}, "gain": 0.9} if i == 0 else {}
            beside = np.add(b, [0, 90.0 + i, 10])
            limbs.append(tackle([b, beside], (1, 1 + i % 2), p, **more))
        elif i < 6:
            wheel = {"radius": 40.0, "swivel": [0.0, 0, -1.0]}
            limbs.append({"kind": "pulley", "base": b, "platform": p} | wheel)
        else:
            limbs.append({"kind": "cable", "base": b, "platform": p})
    return made("spatial", {"z": 1200.0}, limbs)


def rotated(pose: Any) -> Any:
    (sa, sb, sg), (ca, cb, cg) = np.sin(pose[3:]), np.cos(pose[3:])
    rx = np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]])
    ry = np.array([[cb, 0, sb], [0, 1, 0], [-sb, 0, cb]])
    return np.array([[cg, -sg, 0], [sg, cg, 0], [0, 0, 1]]) @ ry @ rx


def length(robot: pk.Robot, i: int, pose: Any, values: Any = None) -> Any:
    """Σ parts ‖D - P‖ of limb i, counted from 1; complex numbers allowed."""
    given = robot.geometry.values if values is None else values
    g = dict(zip(robot.geometry.names, given, strict=True))
    points = [f"base{i}", *(f"over{i}.{j}" for j in range(1, len(robot.model.limbs[i - 1].parts)))]
    end = pose[:3] + rotated(pose) @ [g[f"platform{i}.{c}"] for c in "xyz"]
    total = 0.0
    for point, parts in zip(points, robot.model.limbs[i - 1].parts or (1,), strict=True):
        off = end - np.array([g[f"{point}.{c}"] for c in "xyz"])
        total = total + parts * np.sqrt((off**2).sum())
    return total


def read(robot: pk.Robot, i: int, pose: Any, values: Any = None) -> Any:
    given = robot.geometry.values if values is None else values
    g = dict(zip(robot.geometry.names, given, strict=True))
    return (length(robot, i, pose, values) - g[f"offset{i}"]) / g[f"gain{i}"]


def by_complex_steps(function: Any, at: np.ndarray) -> np.ndarray:
    """Derivative, exact to rounding, of a function of an array that squares and roots make."""
    return np.array([function(at + 1e-30j * row).imag / 1e-30 for row in np.eye(len(at))])


def test_the_inverse_is_the_sum_of_distances(plane: pk.Robot, three: pk.Robot) -> None:
    flat = np.array([[1500.0, 900, 0, 0, 0, 0], [3600, 200, 0, 0, 0, 0]])
    for robot, poses in ((three, POSES * [1, 1, 1, 0, 0, 0]), (plane, flat)):
        for pose in poses:
            wanted = [read(robot, i, pose) for i in (1, 2, 3)]
            np.testing.assert_allclose(robot.inverse(pose), wanted, rtol=0, atol=1e-10)


def test_spools_pulleys_and_tackles_in_one_machine(eight: pk.Robot) -> None:
    for pose in POSES:
        q = eight.inverse(pose)
        wanted = [read(eight, i, pose) for i in (2, 3, 4, 7, 8)]
        np.testing.assert_allclose(q[[1, 2, 3, 6, 7]], wanted, rtol=0, atol=1e-10)
        u = 0.03 * 0.9 * q[0] / 2
        wound = ((60.0 + u) ** 2 - 60.0**2) / 0.03
        np.testing.assert_allclose(wound, length(eight, 1, pose), rtol=1e-13)
    found = eight.forward(eight.inverse(POSES))
    assert found.ok.all()
    np.testing.assert_allclose(found.pose, POSES, atol=1e-9)


def test_the_forward_kinematics_invert_it(plane: pk.Robot, three: pk.Robot) -> None:
    flat = np.array([[1500.0, 900, 0, 0, 0, 0], [2600, 1700, 0, 0, 0, 0]])
    for robot, poses in ((three, POSES * [1, 1, 1, 0, 0, 0]), (plane, flat)):
        found = robot.forward(robot.inverse(poses))
        assert found.ok.all() and (found.residual < 1e-9).all()
        np.testing.assert_allclose(found.pose, poses, atol=1e-9)


@pytest.mark.filterwarnings("error")
def test_between_points_that_pull_against_each_other_is_out_of_reach(plane: pk.Robot) -> None:
    between = np.array([[1900.0, 0, 0, 0, 0, 0], [1900, 1300, 0, 0, 0, 0]])
    q = plane.inverse(between)
    assert np.isnan(q[0]).all() and np.isfinite(q[1]).all()
    assert pk.tensions(plane, between, (0, -100, 0)).status[0] != 0
    assert plane.forward(plane.inverse(between[1]), guess=between[0]).status != 0


def test_equal_points_are_a_gain_of_the_cable(three: pk.Robot) -> None:
    """Three parts to one place let in a third of what the winch takes up."""
    anchors = three.slots[:, :3]
    tackled = made(
        "translation", {"z": 500.0}, [tackle([a, a], (1, 2), [0, 0, 0]) for a in anchors]
    )
    geared = made(
        "translation",
        {"z": 500.0},
        [{"kind": "cable", "base": a, "platform": [0, 0, 0], "gain": 1 / 3} for a in anchors],
    )
    pose = POSES * [1, 1, 1, 0, 0, 0]
    np.testing.assert_allclose(tackled.inverse(pose), geared.inverse(pose), rtol=1e-14)
    np.testing.assert_allclose(tackled.jacobian(pose), geared.jacobian(pose), rtol=1e-12)
    q = np.add(geared.inverse(pose)[:1], [[0, 0, 0], [30, -10, 5]])
    np.testing.assert_allclose(tackled.forward(q).pose, geared.forward(q).pose, atol=1e-9)


@pytest.mark.parametrize("name", ["three", "plane"])
def test_what_cables_would_read_and_its_derivatives(
    name: str, request: pytest.FixtureRequest
) -> None:
    """Off the closures as well as on them: readings of no pose are an estimator's equations."""
    robot: pk.Robot = request.getfixturevalue(name)
    pose = np.array([200.0, -150, 700, 0, 0, 0] if name == "three" else [1500.0, 900, 0, 0, 0, 0])
    m, values = robot.machine.m, robot.geometry.values
    q = np.add(robot.inverse(pose), [5.0, -8, 3])
    residual, by_step = pose_steps.readings(robot, pose[None], q[None])
    by_number = pose_steps.readings_by_numbers(robot, pose[None], q[None], np.arange(len(values)))
    for i in (1, 2, 3):
        off = read(robot, i, pose) - q[i - 1]
        np.testing.assert_allclose(residual[0, i - 1], off, atol=1e-10)
        wanted = by_complex_steps(lambda x, i=i: read(robot, i, np.r_[x, 0, 0, 0]), pose[:3])
        np.testing.assert_allclose(by_step[0, i - 1], wanted[:m], atol=1e-13)
        wanted = by_complex_steps(lambda v, i=i: read(robot, i, pose, v), values)
        np.testing.assert_allclose(by_number[0, i - 1], wanted, rtol=1e-12, atol=1e-12)


def test_errors_of_every_number_move_the_pose(three: pk.Robot) -> None:
    """By the theorem of implicit functions, on derivatives that complex steps have."""
    pose = np.array([200.0, -150, 700, 0, 0, 0])
    values = three.geometry.values
    by_pose = np.array([
        by_complex_steps(lambda x, i=i: read(three, i, np.r_[x, 0, 0, 0]), pose[:3])
        for i in (1, 2, 3)
    ])  # fmt: skip
    by_value = np.array(
        [by_complex_steps(lambda v, i=i: read(three, i, pose, v), values) for i in (1, 2, 3)]
    )
    wanted = -np.linalg.solve(by_pose, by_value)
    np.testing.assert_allclose(three.error_jacobian(pose)[:3], wanted, rtol=1e-10, atol=1e-11)
    np.testing.assert_allclose(three.jacobian(pose), by_pose, atol=1e-13)
    np.testing.assert_allclose(
        three.forward_jacobian(pose), np.linalg.inv(by_pose), rtol=1e-11, atol=1e-12
    )


def test_rates_and_accelerations_by_differences(eight: pk.Robot, three: pk.Robot) -> None:
    for robot in (eight, three):
        at, q, speed, bend, motion = on_a_path(robot, POSES[1])
        velocity, acceleration = robot.rates(motion)
        np.testing.assert_allclose(velocity, speed, rtol=1e-6, atol=1e-4)
        np.testing.assert_allclose(acceleration, bend, rtol=2e-5, atol=1e-3)
        back, _, _ = robot.machine.motion(
            robot.slots, at[None], q[None], velocity[None], acceleration[None]
        )
        np.testing.assert_allclose(back[0, :, :3], motion[:, :3], rtol=1e-6, atol=1e-4)


def test_a_tension_pulls_with_every_part(plane: pk.Robot) -> None:
    pose = np.array([1900.0, 1300, 0, 0, 0, 0])
    held = pk.tensions(plane, pose, (0, -30.0, 0), least=10.0)
    assert held.ok
    pull = np.zeros(3)
    for tension, over, parts in zip(held.tension, OVER, PARTS, strict=True):
        for anchor, count in zip(over, parts, strict=True):
            way = FOUR[anchor] - pose[:3]
            pull += tension * count * way / np.linalg.norm(way)
    np.testing.assert_allclose(pull, [0, 30.0, 0], atol=1e-9)


def test_strokes_are_of_the_whole_cable(three: pk.Robot) -> None:
    pose = np.array([200.0, -150, 700, 0, 0, 0])
    np.testing.assert_allclose(
        three.feasible(pose).drive, [length(three, i, pose) for i in (1, 2, 3)], rtol=1e-13
    )


def test_a_written_file_reads_back_to_the_bit(eight: pk.Robot, tmp_path: Path) -> None:
    eight.save(tmp_path / "again.toml")
    again = pk.load(tmp_path / "again.toml")
    assert again.geometry.names == eight.geometry.names and "over1.1.y" in again.geometry
    np.testing.assert_array_equal(again.geometry.values, eight.geometry.values)
    np.testing.assert_array_equal(again.inverse(POSES), eight.inverse(POSES))
    changed = again.replace({"over2.1.y": 1600.5, "drive1.buildup": 0.031})
    changed.save(tmp_path / "like.toml", like=tmp_path / "again.toml")
    kept = pk.load(tmp_path / "like.toml")
    np.testing.assert_array_equal(kept.geometry.values, changed.geometry.values)


GOOD = tackle(FOUR[:2], (1, 2), [0, 0, 0])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"over": [1.0, 2.0, 3.0]}, r"over.* must be points \[\[x, y, z\], …\]"),
        ({"over": []}, "one or more"),
        ({"over": [[1.0, 2.0]]}, "must be points"),
        ({"parts": [1]}, "whole numbers, of base and of each point under over"),
        ({"parts": [1, 0]}, r"1 or more, found \[1, 0\]"),
        ({"parts": [1, 1.5]}, "whole numbers"),
        ({"parts": [1, True]}, "whole numbers"),
        ({"swivel": [0, 0, 1]}, "swivel"),
        ({"over": [["nowhere", 0, 0]]}, "defines no 'nowhere'"),
    ],
)
def test_what_is_no_cable_over_points_is_refused(change: dict[str, Any], said: str) -> None:
    with pytest.raises(FileError, match=said):
        made("xy", {"x": 1900.0, "y": 1300.0}, [GOOD | change])


def test_points_may_share_named_numbers() -> None:
    limbs = [tackle(FOUR[list(o)], p, [0, 0, 0]) for o, p in zip(OVER, PARTS, strict=True)]
    limbs[0]["over"] = [["span", 0.0, 0.0]]
    robot = made("xy", {"x": 1900.0, "y": 1300.0}, limbs, parameters={"span": 4000.0})
    assert robot.replace({"span": 4100.0}).geometry["over1.1.x"] == 4100.0


@pytest.mark.parametrize("export", [pk.export.c_header, pk.export.mjcf, pk.export.linuxcnc])
def test_what_knows_no_tackles_says_so(three: pk.Robot, tmp_path: Path, export: Any) -> None:
    with pytest.raises(pk.ArgumentError, match=r"limb 1.* (over several points|a tackle)"):
        export(three, tmp_path / "out")
    with pytest.raises(pk.ArgumentError, match="has tackles, which the page cannot draw"):
        pk.show(three, tmp_path / "page.html")


def test_no_poses_are_no_rows(eight: pk.Robot) -> None:
    none = np.zeros((0, 6))
    assert eight.inverse(none).shape == (0, 8) and eight.jacobian(none).shape == (0, 8, 6)
    assert eight.forward(np.zeros((0, 8))).pose.shape == (0, 6)


def test_cables_that_disagree_move_to_the_pose_of_least_squares(eight: pk.Robot) -> None:
    """Also with what they read a little off: the motion is that of the poses that are solved."""
    rng = np.random.default_rng(3)
    q = eight.inverse(POSES[1]) + rng.normal(0, 0.5, 8)
    pose = eight.forward(q).pose
    q1, h = rng.normal(0, 30, 8), 1e-3
    ends = eight.forward(q + np.outer([-h, h], q1), pose).pose
    found = eight.machine.motion(eight.slots, pose[None], q[None], q1[None], np.zeros((1, 8)))
    np.testing.assert_allclose(found[1][0], (ends[1] - ends[0]) / (2 * h), rtol=1e-4, atol=1e-4)
