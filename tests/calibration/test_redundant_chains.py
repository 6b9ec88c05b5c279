"""Chains with more actuators than ways to move: they calibrate themselves as other limbs do."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.geometry import robot_file
from pkmcal.kinematics import pose_steps
from tests.chain_files import as_chains
from tests.kinematics.test_chains import loaded
from tests.robots import made, ring


def eight_legs() -> pk.Robot:
    base, platform = (20, 70, 100, 140, 200, 240, 280, 340), (42, 60, 92, 162, 190, 247, 300, 317)
    limbs = [
        {"kind": "UPS", "base": ring(325.0, a), "platform": ring(125.0, b, -10.0)}
        for a, b in zip(base, platform, strict=True)
    ]
    return made("spatial", {"z": 800.0}, limbs)


def four_planes() -> pk.Robot:
    limbs = [
        {
            "kind": "RPS",
            "base": ring(300.0, a),
            "platform": ring(200.0, a),
            "normal": ring(1.0, a + 90.0),
        }
        for a in (0.0, 80.0, 170.0, 260.0)
    ]
    return made("spatial", {"z": 500.0}, limbs, match=["z", "alpha"])


def four_cranks() -> pk.Robot:
    limbs = [
        {
            "kind": "RUS", "base": ring(300.0, a), "platform": ring(60.0, a + 10.0),
            "axis": [0, 0, 1], "zero": [1, 0, 0], "crank": 150.0, "rod": 200.0, "branch": 1,
        }
        for a in (0.0, 85.0, 180.0, 265.0)
    ]  # fmt: skip
    return made("planar", {"x": 5.0, "y": -8.0}, limbs)


each = pytest.mark.parametrize("made_of", [eight_legs, four_planes, four_cranks])


def near_home(robot: pk.Robot, count: int, seed: int = 0) -> np.ndarray:
    """Poses that all limbs nearly reach."""
    random = np.random.default_rng(seed)
    way = np.array([20.0, 20.0, 20.0, 0.1, 0.1, 0.1])
    free = [c in robot.coordinates for c in ("x", "y", "z", "alpha", "beta", "gamma")]
    pose = robot.home + random.uniform(-1, 1, (count, 6)) * way * free
    return robot.complete(pose) if robot.model.match else pose


@each
def test_readings_are_those_of_limbs_in_closed_form(
    made_of: Callable[[], pk.Robot], tmp_path: Path
) -> None:
    """What each actuator should read, and what passive joints hold, with all derivatives."""
    robot = made_of()
    chained = loaded(as_chains(robot), tmp_path)
    assert pose_steps.surplus(chained) == pose_steps.surplus(robot) > 0
    pose = near_home(robot, 20)
    scale = np.where(np.array(robot.actuator_units) == "mm", 1.0, 5e-3)
    q = robot.inverse(pose) + scale * np.random.default_rng(1).normal(
        0, 0.5, (20, robot.n_actuators)
    )
    of_rows = np.array(pose_steps.sphere_actuators(robot))
    n = robot.n_actuators
    off, by_step = pose_steps.readings(robot, pose, q)
    same, by_same_step = pose_steps.readings(chained, pose, q)
    assert same.shape[1] == len(of_rows)
    assert np.abs(same[:, :n] - off[:, of_rows >= 0]).max() < 1e-9
    mine = by_step[:, of_rows >= 0]
    assert np.abs(by_same_step[:, :n] - mine).max() < 1e-8 * np.abs(mine).max()
    if n < len(of_rows):  # the same motions are held
        for a, b in zip(by_step[:, of_rows < 0], by_same_step[:, n:], strict=True):
            sizes = np.linalg.svd(np.vstack([a, b]) / np.array([1, 1, 1, 200, 200, 200]))[1]
            assert sizes[len(a)] < 1e-8 * sizes[0]
    names = [f"offset{i}" for i in range(1, n + 1)] + ["base1.x", "platform2.y", "base3.y"]
    others = [*names[:n], "limb1.joint1.dx", "limb2.platform.dy", "limb3.joint1.dy"]
    places = np.array([robot.geometry.names.index(name) for name in names])
    there = np.array([chained.geometry.names.index(name) for name in others])
    exact = pose_steps.readings_by_numbers(robot, pose, q, places)[:, of_rows >= 0]
    found = pose_steps.readings_by_numbers(chained, pose, q, there)[:, :n]
    assert np.abs(found - exact).max() < 1e-6 * np.abs(exact).max()


@pytest.mark.parametrize("made_of", [eight_legs, four_cranks])
def test_a_calibration_by_actuators_alone_is_that_of_limbs_in_closed_form(
    made_of: Callable[[], pk.Robot], tmp_path: Path
) -> None:
    robot = made_of()
    chained = loaded(as_chains(robot), tmp_path)
    random = np.random.default_rng(2)
    scale = np.where(np.array(robot.actuator_units) == "mm", 1.0, 5e-3)
    names = [f"offset{i}" for i in range(2, robot.n_actuators)]
    wrong = scale[1:-1] * random.normal(0, 1, len(names))
    true = robot.replace(dict(zip(names, wrong, strict=True)))
    read = true.inverse(near_home(robot, 60, seed=3))
    read += 0.01 * scale * random.normal(size=read.shape)
    sigma = np.tile(0.01 * scale, (60, 1))
    measured = pk.Measurements(read, None, "closure", actuator_sigma=sigma)
    one, other = (pk.identify(each, measured, names) for each in (robot, chained))
    assert np.abs(other.values - one.values).max() < 1e-6
    assert np.abs(other.stderr / one.stderr - 1.0).max() < 1e-5
    assert np.abs((other.values - wrong) / other.stderr).max() < 4.0
    assert other.redundancy == pytest.approx(one.redundancy)


def test_what_readings_of_actuators_leave_open_is_said(tmp_path: Path) -> None:
    """Where the machine stands and where the platform's frame is: three and three, in the plane."""
    ends = [(-600, -500, -80, 60), (620, -480, 90, 70), (580, 510, 80, -70), (-610, 530, -90, -60)]
    limbs = "".join(
        f'[[limb]]\nkind = "chain"\njoints = [{{ kind = "R", at = [{x}, {y}] }}, {{ kind = "P",'
        f' actuator = {k} }}, {{ kind = "R", at = [{u}, {v}] }}]\n'
        for k, (x, y, u, v) in enumerate(ends, 1)
    )
    head = 'name = "four legs"\nunits = { length = "mm", angle = "deg" }\n[pose]\n'
    head += 'map = "planar"\nhome = {}\n'
    robot = loaded(head + limbs, tmp_path)
    random = np.random.default_rng(5)
    way = np.array([250.0, 250.0, 0.0, 0.0, 0.0, 0.4])
    read = robot.inverse(random.uniform(-1, 1, (60, 6)) * way)
    read += random.normal(0, 0.01, read.shape)
    measured = pk.Measurements(read, None, "closure", actuator_sigma=0.01)
    found = pk.identify(robot, measured, ["limb*.joint1.d[xy]", "limb*.platform.d[xy]"])
    assert len(found.free) == 16 and found.rank == 10
    three = "moved along x and y and turned about z: nothing that was measured says where"
    assert [three in text for text in found.gauges] == [True, True]
    assert found.gauges[0].startswith("the base frame") and "platform" in found.gauges[1]
    own = pk.identify(robot, measured)  # of other numbers, which do the same
    assert own.gauges == found.gauges
    assert np.isinf(found.stderr).all()


def test_a_tricept_with_a_fourth_leg_calibrates_itself(tmp_path: Path) -> None:
    """Its column holds, four legs read: one equation a row, and no instrument."""
    text = robot_file.located("tricept")[0].decode()
    robot = loaded(text.replace("copies = 3", "copies = 4"), tmp_path)
    assert pose_steps.surplus(robot) == 1
    names = ["offset2", "offset3", "limb4.joint1.dx", "limb4.joint1.dz"]
    wrong = {"offset2": 0.4, "offset3": -0.3, "limb4.joint1.dx": 0.5, "limb4.joint1.dz": -0.6}
    true = robot.replace(wrong)
    random = np.random.default_rng(4)
    centre = random.uniform([-150, -150, -100], [150, 150, 150], (120, 3))
    pose = robot.complete(robot.home + np.hstack([centre, np.zeros((120, 3))]))
    read = true.inverse(pose) + random.normal(0, 0.002, (120, 4))
    measured = pk.Measurements(read, None, "closure", actuator_sigma=0.002)
    found = pk.identify(robot, measured, names)
    assert np.abs((found.values - list(wrong.values())) / found.stderr).max() < 4.0
    assert (found.stderr < 0.1).all()


def test_check_tells_spare_actuators_from_spare_closures(tmp_path: Path) -> None:
    said = {made_of: str(pk.check_geometry(loaded(as_chains(made_of()), tmp_path)))
            for made_of in (eight_legs, four_planes, four_cranks)}  # fmt: skip
    assert "8 actuators, 2 more than needed: 8 closures for 6 coordinates" in said[eight_legs]
    assert "4 actuators, 1 more than needed: 4 closures for 3 coordinates" in said[four_cranks]
    assert "over-constrained by 1; 4 actuators, 1 more than needed" in said[four_planes]
    assert "more than needed" not in str(pk.check_geometry(pk.load("exechon")))
