"""Joints behind the platform: the tool is where the platform carries a serial arm."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.core.library import ISA, call
from pkmcal.exceptions import FileError
from pkmcal.geometry import robot_file
from pkmcal.screw import from_pose
from pkmcal.view.words import of_robot
from tests.chain_twin import Twin, about, rotation
from tests.kinematics.test_chain_ranks import strengths
from tests.kinematics.test_chains import commands, disturbed, loaded

TOOL = 1200.0
WRIST = [  # point and axis, one after the other crossing
    ([0.0, 0.0, 1100.0], [0.0, 0.0, 1.0]),
    ([0.0, 0.0, 1100.0], [0.6, 0.8, 0.0]),
    ([0.0, 10.0, 1150.0], [0.0, 0.0, 1.0]),
]


def wrist(first: int, joints: int = 3) -> str:
    return "".join(
        f'[[tail]]\nkind = "R"\nat = {at}\naxis = {axis}\nactuator = {first + k}\n'
        for k, (at, axis) in enumerate(WRIST[:joints])
    )


def tricept(joints: int = 3) -> str:
    text = robot_file.located("tricept")[0].decode()
    text = text.replace("home = { z = 1000.0 }", f"home = {{ z = {TOOL} }}")
    return text.replace('match = ["x", "y", "z"]\n', "") + wrist(4, joints)


@pytest.mark.parametrize("joints", (1, 2, 3))
def test_the_tool_goes_with_the_platform_and_the_wrist(joints: int, tmp_path: Path) -> None:
    """By a Tricept without one, and a product of exponentials."""
    robot, plain = loaded(tricept(joints), tmp_path), pk.load("tricept")
    assert robot.n_actuators == 3 + joints
    q = commands(plain, 20)
    turned = np.random.default_rng(1).uniform(-0.8, 0.8, (20, joints))
    found = robot.forward(np.hstack([q, turned]))
    assert found.ok.all()
    for pose, carried, angles in zip(found.pose, plain.forward(q).pose, turned, strict=True):
        T = from_pose(carried) @ np.linalg.inv(from_pose(plain.home))
        for (at, axis), angle in zip(WRIST, angles, strict=False):
            T = T @ about(rotation(angle * np.array(axis)), np.array(at))
        assert np.abs(from_pose(pose) - T @ from_pose(robot.home)).max() < 1e-9


def test_errors_of_the_wrist_are_those_of_products_of_exponentials(tmp_path: Path) -> None:
    robot = disturbed(loaded(tricept(), tmp_path))
    names = robot.geometry.names
    assert {"limb1.tail.dx", "limb4.tail.dpsi", "tail2.dx", "tail3.dpsi", "tool.dx"} <= set(names)
    assert not any(name.startswith(("tail1", "limb1.platform")) for name in names)
    q = commands(robot, 3)
    found = robot.forward(q)
    for row, pose in zip(q, found.pose, strict=True):
        T, _, missed = Twin(robot).forward(row)
        assert missed < 1e-9 and np.abs(from_pose(pose) - T).max() < 1e-9
    columns = [names.index(n) for n in ("limb2.tail.dphi", "tail2.dx", "tool.dtheta", "offset5")]
    exact = robot.error_twists(found.pose, q)
    for column in columns:
        step = 1e-5 * np.eye(len(names))[column]
        sides = [robot.replace(robot.geometry.values + s * step) for s in (1, -1)]
        ends = [from_pose(side.forward(q, guess=found.pose).pose) for side in sides]
        turn = ends[0][:, :3, :3] @ ends[1][:, :3, :3].swapaxes(1, 2)
        turn = (turn - turn.swapaxes(1, 2))[:, [2, 0, 1], [1, 2, 0]] / 2
        twist = np.hstack([turn, (ends[0] - ends[1])[:, :3, 3]]) / 2e-5
        scale = np.array([robot.length] * 3 + [1.0] * 3)
        assert np.abs((exact[..., column] - twist) * scale).max() < 1e-6


def test_actuators_of_a_tool_are_found_from_its_pose(tmp_path: Path) -> None:
    robot = loaded(tricept(), tmp_path)
    q = commands(robot, 40)
    q[:, 3:] += np.random.default_rng(2).uniform([-0.5, 0.1, -0.5], [0.5, 1.1, 0.5], (40, 3))
    pose = robot.forward(q).pose
    back = robot.inverse(pose)
    assert np.isfinite(back).mean() > 0.95
    known = np.isfinite(back).all(axis=1)
    again = robot.forward(back[known])
    assert np.abs(from_pose(again.pose) - from_pose(pose[known])).max() < 1e-8
    assert np.isnan(robot.inverse([np.nan, 0.0, 1200.0, 0.0, 0.0, 0.0])).all()


def test_a_wrist_adds_four_numbers_a_joint(tmp_path: Path) -> None:
    """As in a serial arm, beside what poses tell of the Tricept."""
    robot = loaded(tricept(), tmp_path)
    q = commands(robot, 80, share=3.0)
    values = strengths(robot, q)
    count = len(pk.load("tricept").model.free) + 4 * 3
    assert values[count - 1] > 1e-8 and (values[count:] < 1e-12).all()
    assert len(robot.model.free) == count


@pytest.mark.parametrize("name", ("exechon", "tripteron", "2tpr2tps-chains"))
def test_limbs_that_yield_do_not_feel_what_the_platform_carries(name: str, tmp_path: Path) -> None:
    """Over-constrained, with errors: the platform is where it is without a tail."""
    plain = pk.load(name)
    text = re.sub("match = .*\n", "", robot_file.located(name)[0].decode())
    robot = loaded(text + wrist(plain.n_actuators + 1, 1), tmp_path)
    assert robot.length == plain.length
    random = np.random.default_rng(3)
    common = [n for n in plain.geometry.names if ".joint" in n and n in robot.geometry.names]
    size = [0.1 if n[-1] in "xyz" else 2e-4 for n in common]
    errors = dict(zip(common, size * random.normal(0, 1, len(common)), strict=True))
    q = commands(plain, 6, share=0.3)
    turned = np.linspace(-0.5, 0.5, 6)[:, None]
    carried = plain.replace(errors).forward(q)
    found = robot.replace(errors).forward(np.hstack([q, turned]))
    assert carried.ok.all() and found.ok.all() and carried.residual.min() > 0.01
    axis, at = np.array(WRIST[0][1]), np.array(WRIST[0][0])
    spun = np.array([about(rotation(float(a) * axis), at) for a in turned[:, 0]])
    T = from_pose(carried.pose) @ np.linalg.inv(from_pose(plain.home))
    # the equilibrium is of first order in what the limbs miss, and seen from another point
    assert np.abs(from_pose(found.pose) - T @ spun @ from_pose(plain.home)).max() < 1e-5


def test_a_spherical_machine_carries_a_joint(tmp_path: Path) -> None:
    plain = pk.load("agile-eye")
    tail = '[[tail]]\nkind = "R"\naxis = [0.6, 0.0, 0.8]\nactuator = 4\n'
    robot = loaded(robot_file.located("agile-eye")[0].decode() + tail, tmp_path)
    q = commands(plain, 5, share=0.3)
    turned = np.linspace(-0.5, 0.5, 5)
    found = robot.forward(np.column_stack([q, turned])).pose
    for pose, carried, angle in zip(found, plain.forward(q).pose, turned, strict=True):
        T = from_pose(carried) @ np.linalg.inv(from_pose(plain.home))
        T = T @ about(rotation(angle * np.array([0.6, 0.0, 0.8])), np.zeros(3))
        assert np.abs(from_pose(pose) - T @ from_pose(robot.home)).max() < 1e-12


def test_a_tail_is_read_back_to_the_last_bit(tmp_path: Path) -> None:
    robot = disturbed(loaded(tricept(), tmp_path))
    robot.save(tmp_path / "one.toml")
    again = pk.load(tmp_path / "one.toml")
    assert again.geometry.names == robot.geometry.names
    assert again.geometry.values.tobytes() == robot.geometry.values.tobytes()
    q = commands(robot, 5)
    assert again.forward(q).pose.tobytes() == robot.forward(q).pose.tobytes()


@pytest.mark.filterwarnings("ignore::pkmcal.CalibrationWarning")  # some are weakly determined
def test_a_machine_with_a_wrist_calibrates(tmp_path: Path) -> None:
    robot = loaded(tricept(), tmp_path)
    true = disturbed(robot, 0.3)
    random = np.random.default_rng(0)
    q = commands(robot, 130, share=3.0)
    q[:, 3:] = random.uniform(-1.2, 1.2, (130, 3))
    measured = pk.VirtualMachine(true, noise=0.01).measure(q[:70], kind="pose")
    found = pk.identify(robot, measured)
    there = true.forward(q[70:]).pose

    def off(other: pk.Robot) -> float:
        return float(np.abs(other.forward(q[70:]).pose - there)[:, :3].max())

    assert isinstance(found.robot, pk.Robot) and off(found.robot) < 0.1 * off(robot)


def test_kinds_of_limbs_carry_a_wrist_too(tmp_path: Path) -> None:
    """A hexapod on which a spindle turns: its legs are read as chains."""
    plain = pk.load("hexapod")
    text = robot_file.located("hexapod")[0].decode()
    text = re.sub(r"\[(calibration|stated)\]\n(.+\n)*", "", text)
    numbers = iter(range(1, 7))
    if "actuator" not in text:
        text = re.sub(r"\[\[limb\]\]\n", lambda _: f"[[limb]]\nactuator = {next(numbers)}\n", text)
    robot = loaded(text + wrist(7, 1), tmp_path)
    q = commands(plain, 10, share=0.5)
    turned = np.linspace(-2, 2, 10)[:, None]
    found = robot.forward(np.hstack([q, turned]))
    T = from_pose(plain.forward(q).pose) @ np.linalg.inv(from_pose(plain.home))
    axis, at = np.array(WRIST[0][1]), np.array(WRIST[0][0])
    spun = np.array([about(rotation(float(a) * axis), at) for a in turned[:, 0]])
    assert np.abs(from_pose(found.pose) - T @ spun @ from_pose(plain.home)).max() < 1e-9


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("actuator = 5", "actuator = 7", "their actuators counted on from those of the limbs"),
        ("actuator = 5\n", "", "joints behind the platform are actuated"),
        ('[[tail]]\nkind = "R"', '[[tail]]\nkind = "U"', "has several axes"),
        ("actuator = 4\n", "actuator = 4\ncone = 3.0\n", "unknown key 'cone'"),
        ("actuator = 4\n", "actuator = 4\nsoft = 3.0\n", "unknown key 'soft'"),
        ("actuator = 4\n", 'actuator = 4\nerrors = { "dy" = 1.0 }\n', "'tail1.dy' is no error"),
        ("copies = 3\n", 'copies = 3\nerrors = { "platform.dx" = 1.0 }\n', "is no error"),
    ],
)
def test_what_is_no_tail_is_refused(old: str, new: str, said: str, tmp_path: Path) -> None:
    text = tricept()
    assert old in text
    with pytest.raises(FileError, match=re.escape(said)):
        loaded(text.replace(old, new, 1), tmp_path)


def test_a_home_with_the_axes_of_the_wrist_in_line_is_found(tmp_path: Path) -> None:
    """Its first axis is its third at home, nowhere else; if that is elsewhere, it never is."""
    assert pk.check_geometry(loaded(tricept(), tmp_path)).ok
    aligned = tricept().replace("[0.0, 10.0, 1150.0]", "[0.0, 0.0, 1150.0]")
    found = pk.check_geometry(loaded(aligned, tmp_path))
    assert [each.kind for each in found.findings] == ["singular"]
    assert "home is singular: the actuators move the tool in 5 ways there, nearby in 6" in str(
        found
    )
    straight, _, last = aligned.rpartition("axis = [0.0, 0.0, 1.0]")
    bent = f"{straight}axis = [0.8, -0.6, 0.0]{last}"
    assert pk.check_geometry(loaded(bent, tmp_path)).ok


def test_the_page_says_which_joints_are_behind_the_platform(tmp_path: Path) -> None:
    said = of_robot(loaded(tricept(), tmp_path)).replace("\N{COMBINING LOW LINE}", "_")
    assert said.startswith(
        "A platform on three chains of joints (UP_S) and one chain of joints (UP); behind it three"
        " more joints carry the tool (R_R_R_), underlined"
    )
    assert said.endswith(
        "Six actuators move the tool along x, y, z and turn it about x, y, z (α, β, γ)."
    )


def test_a_limit_of_the_wrist_is_told_once_and_is_no_limb_s(tmp_path: Path) -> None:
    text = tricept().replace("actuator = 5\n", "actuator = 5\nstroke = [-60.0, 60.0]\n")
    robot = loaded(text, tmp_path)
    q = robot.inverse(robot.home) + np.array([[0, 0, 0, 0, 0.5, 0], [0, 0, 0, 0, 1.5, 0]])
    found = robot.feasible(robot.forward(q).pose, q)
    assert found.stroke.shape == (2, len(robot.model.limbs) + 1)
    assert found.broken() == ["tail: stroke broken in rows 1"]
    assert found.stroke_margin[:, -1] == pytest.approx(np.pi / 3 - np.array([0.5, 1.5]))
    assert list(found.ok) == [True, False]
    off = text.replace("[-60.0, 60.0]", "[30.0, 60.0]")
    assert "at home the tail breaks a stroke" in str(pk.check_geometry(loaded(off, tmp_path)))


def test_dexterity_sees_axes_of_a_wrist_in_line(tmp_path: Path) -> None:
    """The sine of the angle by which the middle joint bends; the limbs do not turn the tool so."""
    aligned = tricept().replace("[0.0, 10.0, 1150.0]", "[0.0, 0.0, 1150.0]")
    robot = loaded(aligned, tmp_path)
    bent = np.array([0.02, 0.05, 0.2])
    q = robot.inverse(robot.home) * np.array([1, 1, 1, 0, 0, 0]) + np.outer(bent, np.eye(6)[4])
    found = pk.dexterity(robot, robot.forward(q).pose)
    ratio = found.transmission / np.sin(bent)
    assert (np.abs(ratio / ratio[0] - 1) < 0.1).all() and 0.1 < ratio[0] < 10
    straight = pk.dexterity(robot, robot.forward(q[0] * [1, 1, 1, 0, 0, 0]).pose)
    assert straight.transmission < 1e-6 and straight.conditioning > 1e-3


def test_chains_one_by_one_leave_the_wrist_at_home(tmp_path: Path) -> None:
    """The core itself: the platform is where the wrist at home carries the tool."""
    robot = loaded(tricept(), tmp_path)
    gain = {n: 2.0 for n in robot.geometry.names if n in ("gain4", "gain5", "gain6")}
    robot = robot.replace(gain | {"offset5": 0.1})
    q = np.hstack([commands(pk.load("tricept"), 5), np.tile([0.0, -0.05, 0.0], (5, 1))])
    pose, back = robot.forward(q).pose, np.empty_like(q)
    call("chain_inverse", robot.machine.struct, len(q), robot.slots, 0, pose, back, isa=ISA)
    assert np.abs(back - q).max() < 1e-9
