"""Joints of an arm that follow others: mimic joints of URDF files, linked axes, telescopes.

Checked against the product of the transforms that the URDF file itself states, by NumPy alone.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arms.joint_laws import Term

# A lifting column of three stages that slide together, and an arm on it whose elbow is linked to
# its shoulder and whose wrist leans by what the column has risen.
STAGES = (
    # name, type, parent, child, xyz [m], rpy, axis, mimic
    ("turn", "revolute", "base", "table", "0 0 0.1", "0 0 0.2", "0 0 1", ""),
    ("lift", "prismatic", "table", "stage1", "0.05 0 0.4", "0 0.02 0", "0 0 2", ""),
    ("stage2", "prismatic", "stage1", "stage2", "0 0 0.5", "0 0 0", "0 0 1",
     '<mimic joint="lift"/>'),
    ("stage3", "prismatic", "stage2", "stage3", "0 0.02 0.5", "0 0 0.1", "0 0 1",
     '<mimic joint="stage2" multiplier="0.5" offset="0.03"/>'),
    ("shoulder", "revolute", "stage3", "upper", "0.1 0 0.2", "0 0 0", "0 1 0", ""),
    ("elbow", "continuous", "upper", "fore", "0.6 0 0.05", "0.3 0 0", "0 1 0",
     '<mimic joint="shoulder" multiplier="-1.5" offset="0.4"/>'),
    ("wrist", "revolute", "fore", "hand", "0.5 0 0", "0 0 0", "1 0 0",
     '<mimic joint="lift" multiplier="0.7"/>'),
    ("flange", "fixed", "hand", "tool", "0.1 0.02 0", "0 0 0.5", "", ""),
)  # fmt: skip
DRIVEN = ("turn", "lift", "shoulder")
UNITS = np.array([1.0, 1e3, 1.0])  # mm or rad of the file's unit


def urdf_text(stages: tuple[tuple[str, ...], ...] = STAGES) -> str:
    links = dict.fromkeys(link for stage in stages for link in stage[2:4])
    text = "".join(f'<link name="{link}"/>\n' for link in links)
    for name, kind, parent, child, xyz, rpy, axis, mimic in stages:
        turns = f'<axis xyz="{axis}"/>' if axis else ""
        ends = '<limit lower="-0.4" upper="0.8" effort="1" velocity="1"/>'
        text += (
            f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{xyz}" rpy="{rpy}"/>{turns}{mimic}{ends}</joint>\n'
        )
    return f'<?xml version="1.0"?>\n<robot name="column">\n{text}</robot>\n'


def turned(axis: np.ndarray, by: float) -> np.ndarray:
    """Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(by) * cross + (1 - np.cos(by)) * cross @ cross


def by_the_file(path: Path, q: dict[str, float]) -> np.ndarray:
    """The tool (4, 4), m, at commands by the product of the transforms of a file of one chain."""
    joints = ElementTree.parse(path).getroot().findall("joint")
    mimics = {joint.get("name"): joint.find("mimic") for joint in joints}

    def value(name: str) -> float:
        mimic = mimics[name]
        if mimic is None:
            return q[name]
        by, offset = (float(mimic.get(key, d)) for key, d in (("multiplier", "1"), ("offset", "0")))
        return by * value(mimic.get("joint")) + offset

    place = np.eye(4)
    for joint in joints:
        x, y, z = map(float, joint.find("origin").get("xyz").split())
        roll, pitch, yaw = map(float, joint.find("origin").get("rpy").split())
        origin, moved = np.eye(4), np.eye(4)
        ez, ey, ex = np.eye(3)[::-1]
        origin[:3, :3] = turned(ez, yaw) @ turned(ey, pitch) @ turned(ex, roll)
        origin[:3, 3] = x, y, z
        if joint.get("type") != "fixed":
            axis = np.array([float(n) for n in joint.find("axis").get("xyz").split()])
            axis /= np.linalg.norm(axis)
            by = value(joint.get("name"))
            if joint.get("type") == "prismatic":
                moved[:3, 3] = by * axis
            else:
                moved[:3, :3] = turned(axis, by)
        place = place @ origin @ moved
    return place


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "column.urdf"
    path.write_text(urdf_text(), encoding="utf-8")
    return path


def commands(count: int, seed: int = 0) -> np.ndarray:
    drawn = np.random.default_rng(seed).uniform(-1, 1, (count, 3)) * [1.5, 0.3, 0.8]
    return drawn * UNITS


def off(arm: pk.SerialArm, path: Path, theta: np.ndarray) -> float:
    """How far an arm is from a file, mm and 1e-3 rad."""
    want = [by_the_file(path, dict(zip(DRIVEN, row / UNITS, strict=True))) for row in theta]
    metres = np.array(arm.forward(theta))
    metres[:, :3, 3] /= 1e3
    return 1e3 * float(np.abs(metres - want).max())


def errors(seed: int = 1) -> np.ndarray:
    scale = [0.5, 0.5, 0.5, 1e-3, 1e-3, 1e-3]
    return np.random.default_rng(seed).normal(size=(7, 6)) * scale


def test_mimic_joints_stand_where_the_file_says(source: Path) -> None:
    """Also a follower of a follower, an offset, and one that turns as another slides."""
    arm = pk.SerialArm.from_urdf(source)
    assert (arm.n_joints, arm.n_actuators) == (7, 3)
    assert arm.actuator_names == DRIVEN
    assert arm.actuator_units == ("rad", "mm", "rad")
    assert off(arm, source, commands(40)) < 1e-10


def test_joint_errors_of_followers_go_back_into_the_file(source: Path, tmp_path: Path) -> None:
    """The corrected file, by its own transforms, is the arm with errors."""
    arm = pk.SerialArm.from_urdf(source).replace(errors())
    assert off(arm, source, commands(5)) > 0.5
    arm.save_urdf(tmp_path / "new.urdf")
    assert off(arm, tmp_path / "new.urdf", commands(40)) < 1e-10
    assert off(arm.corrected(), tmp_path / "new.urdf", commands(40)) < 1e-10


def test_a_urdf_that_is_written_follows_too(source: Path, tmp_path: Path) -> None:
    arm = pk.SerialArm.from_urdf(source).replace(errors())
    pk.export.urdf(arm, tmp_path / "written.urdf")
    assert off(arm, tmp_path / "written.urdf", commands(40)) < 1e-9


def test_an_arms_file_holds_what_follows(source: Path, tmp_path: Path) -> None:
    arm = pk.SerialArm.from_urdf(source).replace(errors())
    arm.save(tmp_path / "arm.toml")
    again = pk.load(tmp_path / "arm.toml")
    np.testing.assert_array_equal(again.forward(commands(9)), arm.forward(commands(9)))
    again.save(tmp_path / "again.toml")
    assert (tmp_path / "again.toml").read_text() == (tmp_path / "arm.toml").read_text()


def test_ratios_of_a_file_are_in_its_units(tmp_path: Path) -> None:
    """0.01 deg/mm by hand: 300 mm of the slide turn the second joint by 3 deg."""
    (tmp_path / "arm.toml").write_text(
        'name = "leans"\nunits = { length = "m", angle = "deg" }\n'
        "[tool]\nhome = { x = 1.0 }\n"
        '[[joint]]\nkind = "prismatic"\naxis = [1, 0, 0]\npoint = [0, 0, 0]\n'
        '[[joint]]\nkind = "revolute"\naxis = [0, 0, 1]\npoint = [0, 0, 0]\n'
        "follows = [{ joint = 1, by = 10.0 }]\n",
        encoding="utf-8",
    )
    tool = pk.load(tmp_path / "arm.toml").forward([300.0])
    lean = np.radians(3.0)
    expected = [300 + 1000 * np.cos(lean), 1000 * np.sin(lean), 0]
    np.testing.assert_allclose(tool[:3, 3], expected, atol=1e-9)


def test_a_joint_follows_the_sum_of_two(tmp_path: Path) -> None:
    """The last of three parallel axes keeps the tool level, as rods of a palletizer do."""
    axes, points = [[0, 1, 0]] * 3, [[0, 0, 0], [0, 0, 500], [400, 0, 500]]
    level = pk.SerialArm(axes, points, [450, 0, 500, 0, 0, 0], follows={3: {1: -1.0, 2: -1.0}})
    theta = np.random.default_rng(0).uniform(-1, 1, (20, 2))
    tools = level.forward(theta)
    np.testing.assert_allclose(tools[:, :3, :3], np.tile(np.eye(3), (20, 1, 1)), atol=1e-15)
    reach = level.inverse(tools, guess=theta + 0.05)
    np.testing.assert_allclose(reach.theta, theta, atol=1e-9)
    with pytest.raises(ValueError, match=r"joint 3 .* follows several joints"):
        pk.export.urdf(level, tmp_path / "level.urdf")


def test_jacobians_are_differences(source: Path) -> None:
    """Laws of followers included: gears, and a slide that is coupled with another."""
    arm = pk.SerialArm.from_urdf(source).replace(errors())
    arm = arm.with_terms([Term(5, "cos", 2.0), Term(3, "coupling", 1), Term(0, "sin", 1.0)])
    arm = arm.with_laws(arm.joint_laws.with_values(np.array([2e-3, 1e-3, 5e-3])))
    theta = commands(6)
    for frame in ("space", "body"):
        jacobian = arm.jacobian(theta, frame=frame)
        for k in range(3):
            step = np.eye(3)[k] * 1e-4 * UNITS[k]
            ahead, behind = arm.forward(theta + step), arm.forward(theta - step)
            back = np.linalg.inv(behind)
            way = ahead @ back if frame == "space" else back @ ahead
            slope = pk.screw.log(way) / (2e-4 * UNITS[k])
            np.testing.assert_allclose(jacobian[:, :, k], slope, rtol=2e-6, atol=2e-5)


def test_ratio_and_offset_are_found(source: Path) -> None:
    """A file says 1, -1.5 and 0.4 rad; the machine has 1.0004, -1.497 and 0.402 rad.

    True poses are those of a file with these numbers, by its own transforms.
    """
    other = [list(stage) for stage in STAGES]
    other[2][7] = '<mimic joint="lift" multiplier="1.0004"/>'
    other[3][7] = '<mimic joint="lift" multiplier="0.5" offset="0.03"/>'
    other[5][7] = '<mimic joint="shoulder" multiplier="-1.497" offset="0.402"/>'
    true = source.with_name("true.urdf")
    true.write_text(urdf_text(tuple(map(tuple, other))), encoding="utf-8")
    theta = commands(60, seed=3)
    places = np.array(
        [by_the_file(true, dict(zip(DRIVEN, row / UNITS, strict=True)))[:3] for row in theta]
    )
    targets = np.array([[0, 0, 0], [80, 0, 0], [0, 60, 40]])
    rng = np.random.default_rng(5)
    sets = [
        pk.Measurements(
            theta,
            places[:, :, 3] * 1e3 + places[:, :, :3] @ target + rng.normal(0, 0.01, (60, 3)),
            target=target,
            sigma=0.01,
        )
        for target in targets
    ]
    arm = pk.SerialArm.from_urdf(source)
    found = pk.identify(
        arm, sets, effects=pk.Coupling([(3, 2), (6, 5)]), free=["joint6.d[pt]*", "coupling*"]
    )
    for name, value in {"coupling3.2": 4e-4, "coupling6.5": 3e-3}.items():
        entry = found.parameters[name]
        assert 0 < entry["stderr"] < 1e-4
        assert abs(entry["value"] - value) < 4 * entry["stderr"], name
    # another offset is a turn about the axis of the elbow, in axes of the base at zero
    turn = found.robot.joint_errors[5, 3:]
    np.testing.assert_allclose(turn, 2e-3 * found.robot.axes[5], atol=1e-4)
    assert found.success


def test_logs_name_the_joints_that_have_actuators(source: Path, tmp_path: Path) -> None:
    arm = pk.SerialArm.from_urdf(source)
    made = pk.VirtualMachine(arm, noise=0.0).measure(commands(4))
    names = "turn [rad],lift [mm],shoulder [rad],x [mm],y [mm],z [mm]\n"
    rows = np.column_stack([made.actuators, made.values])
    (tmp_path / "log.csv").write_text(
        names + "".join(",".join(map(repr, row)) + "\n" for row in rows.tolist()), encoding="utf-8"
    )
    read = pk.read_measurements(tmp_path / "log.csv", robot=arm)
    np.testing.assert_array_equal(read.actuators, made.actuators)


def test_followers_bound_what_they_follow(source: Path) -> None:
    """-400 to 800 mm of stage 3, at half the speed and 30 mm up, are beyond those of the lift."""
    limits = pk.SerialArm.from_urdf(source).limits()
    np.testing.assert_allclose(limits[1], [-400, 800])
    np.testing.assert_allclose(limits[2], [-0.4, 0.8])  # the elbow is continuous
    tight = source.with_name("tight.urdf")
    tight.write_text(urdf_text().replace('multiplier="0.5"', 'multiplier="-2"'), encoding="utf-8")
    np.testing.assert_allclose(pk.SerialArm.from_urdf(tight).limits()[1], [-385, 215])


@pytest.mark.parametrize(
    "old, new, tip, message",
    [
        ('<mimic joint="lift"/>', '<mimic joint="stage3"/>', None, r"'stage2' follows itself"),
        ('<mimic joint="lift"/>', '<mimic joint="lifts"/>', None, "'lifts' .* is not in the file"),
        ('<mimic joint="lift"/>', '<mimic joint="shoulder"/>', "stage3",
         "'shoulder' .*, which does not move the tool here"),
        ('multiplier="0.5"', 'multiplier="half"', None, "'stage3': <mimic> multiplier"),
    ],
)  # fmt: skip
def test_what_cannot_follow_is_said(
    source: Path, old: str, new: str, tip: str | None, message: str
) -> None:
    source.write_text(urdf_text().replace(old, new), encoding="utf-8")
    with pytest.raises(ValueError, match=message):
        pk.SerialArm.from_urdf(source, tip=tip)


@pytest.mark.parametrize(
    "follows, message",
    [
        ({3: {3: 1.0}}, "must follow another one"),
        ({3: {2: 1.0}, 2: {1: 1.0}}, "joint 2, which follows others"),
        ({4: {1: 1.0}}, "joints are 1 to 3, found 4"),
        ({1: {2: 1.0}, 2: {}}, "joint 2 follows none|which follows others"),
        ({3: {1: np.nan}}, "joint 3 by joint 1"),
    ],
)
def test_ratios_that_do_not_fit_are_said(
    follows: dict[int, dict[int, float]], message: str
) -> None:
    arm = pk.load("3r")
    with pytest.raises(ValueError, match=message):
        pk.SerialArm(arm.axes, arm.points, arm.home, follows=follows)


def test_formats_without_followers_refuse_them(source: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="joint 3 of column follows others, which SDFormat"):
        pk.export.sdf(pk.SerialArm.from_urdf(source), tmp_path / "arm.sdf")
