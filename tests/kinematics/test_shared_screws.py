"""One screw under two rods: a parameter that both offsets follow, and its one compliance.

What the model says is compared with the statics of carriages on springs and rods on springs, solved
as equations of forces and moments, which know of no twists and no geometry that yields.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import root

import pkmcal as pk
from pkmcal.arrays import FloatArray

SCREWS, ROD, CARRIAGE, PLATFORM = np.array([300.0, 400.0, 350.0]), 500.0, 0.2, 0.5  # N/mm, kg
LOAD = pk.Load(2.0, (20.0, 5.0, -10.0))
G = 9.80665


def on_screws(folder: Path, signs: str = "++++++") -> pk.Robot:
    """The linear delta of six rods, its carriages on three screws; some offsets counted down."""
    built_in = Path(pk.__file__).parent / "builtin" / "machines" / "linear-delta-6.toml"
    head, *limbs = built_in.read_text(encoding="utf-8").split("[[limb]]\n")
    keys = f"rod_stiffness = {ROD}\nanchor_mass = {CARRIAGE / 2}\n"
    limbs = [
        f'offset = "{signs[i].replace("+", "")}screw{i // 2 + 1}"\n{keys}{limb}'
        for i, limb in enumerate(limbs)
    ]
    numbers = range(1, 4)
    tables = {
        "parameters": "".join(f"screw{j} = 0.0\n" for j in numbers),
        "compliance": "".join(
            f"screw{j} = {1 / k}\n" for j, k in zip(numbers, SCREWS, strict=True)
        ),
        "platform": f"mass = {PLATFORM}\n",
    }
    head = head.replace('"offset*"', '"screw*"')
    head += "".join(f"[{name}]\n{lines}\n" for name, lines in tables.items())
    path = folder / "screws.toml"
    path.write_text("[[limb]]\n".join([head, *limbs]), encoding="utf-8")
    return pk.load(path)


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> pk.Robot:
    return on_screws(tmp_path_factory.mktemp("screws"))


def commands(robot: pk.Robot, count: int) -> tuple[FloatArray, FloatArray]:
    """Actuators, and poses that the rigid machine has there."""
    places = np.random.default_rng(5).uniform(-1.0, 1.0, (count, 6)) * [50, 50, 50, 0, 0, 0]
    q = robot.rigid.inverse(robot.home + places, match=True)
    return q, robot.rigid.forward(q).pose


def at_rest(robot: pk.Robot, q: FloatArray, pose: FloatArray) -> FloatArray:
    """The platform's pose where forces and moments on it, and forces on all screws, are none."""
    number = robot.geometry
    base, end = (
        np.array([[number[f"{of}{i}.{axis}"] for axis in "xyz"] for i in range(1, 7)])
        for of in ("base", "platform")
    )
    down = np.array([0.0, 0.0, -G])

    def left(x: FloatArray) -> FloatArray:
        frame = pk.screw.from_pose(pose + x[:6] * [1, 1, 1, 1e-3, 1e-3, 1e-3])
        way = q + x[6:]
        anchors = base + np.repeat(way, 2)[:, None] * [0.0, 0.0, 1.0]
        arms = end @ frame[:3, :3].T
        rods = frame[:3, 3] + arms - anchors
        length = np.linalg.norm(rods, axis=1)
        pull = -(ROD * (length - 215.0) / length)[:, None] * rods
        weight, at = LOAD.mass * down, frame[:3, :3] @ LOAD.centre
        force = pull.sum(axis=0) + weight + PLATFORM * down
        moment = np.cross(arms, pull).sum(axis=0) + np.cross(at, weight)
        screws = -pull[:, 2].reshape(3, 2).sum(axis=1) - CARRIAGE * G - SCREWS * x[6:]
        return np.concatenate([force, moment / 100.0, screws])

    found = root(left, np.zeros(9), tol=1e-13)
    assert np.abs(found.fun).max() < 1e-8
    return np.asarray(pose + found.x[:6] * [1, 1, 1, 1e-3, 1e-3, 1e-3])


def test_screws_that_rods_share_yield_as_one_spring_does(robot: pk.Robot) -> None:
    q, poses = commands(robot, 6)
    found = robot.forward(q, guess=poses, load=LOAD)
    assert found.ok.all()
    there = np.array([at_rest(robot, q[i], poses[i]) for i in range(len(q))])
    assert np.linalg.norm((there - poses)[:, :3], axis=1).min() > 0.05  # it sags
    np.testing.assert_allclose(found.pose[:, :3], there[:, :3], atol=1e-9)
    np.testing.assert_allclose(found.pose[:, 3:], there[:, 3:], atol=1e-11)


def test_a_spring_in_the_drive_of_each_rod_is_another_machine(robot: pk.Robot) -> None:
    """So `check` says what it takes for one screw."""
    apart = pk.load("linear-delta-6").yielding({"offset*": 1.0 / 300.0})
    findings = [each for each in pk.check_geometry(apart).findings if "share" in each.what]
    assert [each.limbs for each in findings] == [(1, 2), (3, 4), (5, 6)]
    finding = findings[0]
    assert "limbs 1 and 2" in finding.what and "[parameters]" in finding.suggestion
    assert not [each for each in pk.check_geometry(robot).findings if "share" in each.what]


def test_the_inverse_leads_where_the_forward_kinematics_are(robot: pk.Robot) -> None:
    q, poses = commands(robot, 6)
    there = robot.forward(q, guess=poses, load=LOAD).pose
    np.testing.assert_allclose(robot.inverse(there, load=LOAD), q, atol=1e-9)


@pytest.mark.parametrize("signs", ["++++++", "+-++-+"])
def test_derivatives_by_compliances_and_loads_are_those_of_differences(
    tmp_path: Path, signs: str
) -> None:
    """Whether an offset follows the screw or its opposite."""
    robot = on_screws(tmp_path, signs).carrying(LOAD)
    q, poses = commands(robot, 3)
    poses = robot.forward(q, guess=poses).pose
    assert np.isfinite(poses).all()
    by_number = robot.error_twists(poses, q)
    for name, step in (
        ("compliance.screw2", 1e-6),
        ("payload.mass", 1e-3),
        ("compliance.rod3", 1e-6),
    ):
        ends = [
            robot.replace({name: robot.geometry[name] + sign * step}).forward(q, guess=poses).pose
            for sign in (1.0, -1.0)
        ]
        slope = (ends[0] - ends[1])[:, :3] / (2.0 * step)
        column = by_number[:, 3:, robot.geometry.names.index(name)]
        np.testing.assert_allclose(column, slope, atol=0.01 * np.abs(slope).max())


def test_stiffness_is_that_of_small_forces(robot: pk.Robot) -> None:
    q, poses = commands(robot, 1)
    found = pk.stiffness(robot, robot.forward(q, guess=poses).pose[0])
    ends = [
        robot.forward(q, guess=poses, load=pk.Load(force=[0.0, 0.0, sign])).pose[0, 2]
        for sign in (1.0, -1.0)
    ]
    assert found.along([0, 0, 1]) == pytest.approx((ends[0] - ends[1]) / 2.0, rel=0.01)


def test_files_and_calibrations_keep_the_screws(robot: pk.Robot, tmp_path: Path) -> None:
    robot.save(tmp_path / "again.toml")
    again, (q, poses) = pk.load(tmp_path / "again.toml"), commands(robot, 20)
    one, other = (each.forward(q, guess=poses, load=LOAD).pose for each in (robot, again))
    np.testing.assert_array_equal(one, other)
    rigid = robot.yielding({"screw*": 0.0, "rod*": 0.0})
    rows = [
        pk.VirtualMachine(robot, 1e-3, seed=seed).measure(q, "pose", load=pk.Load(mass=kg))
        for seed, kg in enumerate((0.0, 3.0))
    ]
    effects = [pk.Elasticity(("screw*", "rod*"))]
    found = pk.identify(rigid, rows, free="screw*", effects=effects)
    truth = np.array([robot.geometry[name] for name in found.free])
    assert sum(name.startswith("compliance.screw") for name in found.free) == 3
    assert (np.abs(found.values - truth) < 4.5 * found.stderr).all()
    assert (found.stderr[3:6] < 0.05 * truth[3:6]).all()


def test_what_is_no_length_of_limbs_is_refused(tmp_path: Path) -> None:
    robot = on_screws(tmp_path)
    text = (tmp_path / "screws.toml").read_text(encoding="utf-8")
    (tmp_path / "wrong.toml").write_text(text.replace("screw1 = 0.00", "screws1 = 0.00"), "utf-8")
    with pytest.raises(pk.Error, match=r"no number 'screws1'.*screw1"):
        pk.load(tmp_path / "wrong.toml")
    with pytest.raises(ValueError, match="screw1 has no way to grow by"):
        robot.yielding({"screw1": 1e-4}, per_length=True)
