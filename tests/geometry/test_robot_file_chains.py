"""Chains of joints in robot files: what is read, what is refused, what is written back."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.exceptions import FileError
from pkmcal.files.toml_lines import Source
from pkmcal.geometry import robot_file
from pkmcal.geometry.model import Model

from ..workspaces import CHAINS


def read(text: str) -> Model:
    return robot_file.parse(Source(text.encode(), "chain.toml"), "chain.toml")


def text_of(name: str) -> str:
    return robot_file.located(name)[0].decode()


@pytest.mark.parametrize("name", CHAINS)
def test_machines_of_chains_read_back_to_the_last_bit(name: str, tmp_path: Path) -> None:
    robot = pk.load(name)
    random = np.random.default_rng(0)
    values = robot.geometry.values + random.normal(0, 1e-3, len(robot.geometry))
    wrong = robot.replace(values)
    wrong.save(tmp_path / "one.toml")
    again = pk.load(tmp_path / "one.toml")
    assert again.geometry.names == wrong.geometry.names
    assert again.geometry.values.tobytes() == wrong.geometry.values.tobytes()
    q = robot.inverse(robot.home) + 0.05
    assert again.forward(q).pose.tobytes() == wrong.forward(q).pose.tobytes()
    again.save(tmp_path / "two.toml")
    assert (tmp_path / "two.toml").read_bytes() == (tmp_path / "one.toml").read_bytes()


def test_copies_are_the_limbs_written_out() -> None:
    tricept = read(text_of("tricept"))
    assert tricept.chains is not None
    assert [len(limb) for limb in tricept.chains.limbs] == [3, 3, 3, 2]
    first, second, third = (limb[2].at for limb in tricept.chains.limbs[:3])
    turned = np.radians(120)
    R = np.array([[np.cos(turned), -np.sin(turned)], [np.sin(turned), np.cos(turned)]])
    assert np.abs(second[:2] - R @ first[:2]).max() < 1e-12
    assert np.abs(third[:2] - R @ R @ first[:2]).max() < 1e-12
    assert [limb.actuator for limb in tricept.limbs] == [0, 1, 2, -1]


def test_shared_joints_are_one_with_one_name_a_copy() -> None:
    delta = read(text_of("delta-parallelograms"))
    names = delta.geometry.names
    assert {"crank1.dx", "crank2.dx", "crank3.dx"} <= set(names)
    assert "limb1.joint1.dx" not in names and "limb2.joint2b.dpsi" in names
    assert len(names) == len(set(names)) == 132
    assert delta.n_actuators == 3 and len(delta.limbs) == 6


def test_errors_are_those_that_a_group_has() -> None:
    planar = read(text_of("five-bar")).geometry.names
    assert {name.rpartition(".")[2] for name in planar if "." in name} == {"dx", "dy", "dpsi"}
    turning = read(text_of("agile-eye")).geometry.names
    assert {name.rpartition(".")[2] for name in turning if "." in name} == {
        "dphi",
        "dtheta",
        "dpsi",
    }
    ball = [name for name in read(text_of("tricept")).geometry.names if "limb1.joint3" in name]
    assert ball == ["limb1.joint3.dx", "limb1.joint3.dy", "limb1.joint3.dz"]


def test_an_s_with_axes_has_three_joints_of_errors() -> None:
    at = 'kind = "S", at = { radius = 200.0'
    text = text_of("tricept").replace(at, f"axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]], {at}")
    names = read(text).geometry.names
    assert {"limb1.joint3.dpsi", "limb1.joint3b.dpsi", "limb1.joint3c.dpsi"} <= set(names)
    assert len([n for n in names if not n.startswith("gain")]) == 153


def test_errors_in_files_are_read_by_name() -> None:
    text = text_of("five-bar")
    joints = 'joints = [\n  { kind = "R", at = [-100.0'
    given = text.replace(
        joints, f'errors = {{ "joint2.dx" = 0.12, "platform.dpsi" = 0.5 }}\n{joints}'
    )
    geometry = read(given).geometry
    assert geometry["limb1.joint2.dx"] == 0.12
    assert geometry["limb1.platform.dpsi"] == np.radians(0.5)


def test_parameters_of_places_are_values_and_no_numbers() -> None:
    delta = read(text_of("delta-parallelograms"))
    assert "half" not in delta.geometry
    assert delta.chains is not None and delta.chains.limbs[0][1].at[0] == -60.0


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('kind = "chain"\ncopies', 'kind = "PUPS"\ncopies', "'PUPS' is no kind.*chain of joints"),
        ('kind = "S"', 'kind = "Q"', "'Q' is no kind of joint"),
        ("actuator = 1, ", "", "0 actuators, 3 ways to move|no joint has an actuator"),
        ("actuator = 1", "actuator = 2", "no joint has actuator 1"),
        ("actuator = 1", "actuator = 0", "actuators count from 1, found 0"),
        ("cone = 60.0", "cone = -60.0", "above 0, at most half a turn"),
        ("stroke = [-300.0, 300.0]", "stroke = [300.0, -300.0]", "must rise"),
        ('map = "spatial"', 'map = "2tpr2tps"', "go with the maps spatial, planar, spherical"),
        ('kind = "U", at = { radius', 'kind = "U", axes = [[1, 0, 0], [1, 0, 0]], at = { radius',
         "must not lie on one line"),
        ('kind = "P", axis = [0, 0, 1]', 'kind = "R"', "the key 'axis' is missing"),
        ("copies = 3", "copies = 0", "must be 1 or more"),
        ("copies = 3", "copies = 25", "at most 24 limbs"),
        ("copies = 3", "copies = 2147483648", "copies: a robot has at most 24 limbs"),
        ("copies = 3", 'copies = 3\nerrors = { "joint9.dx" = 1 }', "'limb1.joint9.dx' is no error"),
        ("axis = [0, 0, 1],", "axis = [0, 0, 1], actuator = 1, home_value = 9.0,",
         "actuator 1 reads at home 0 in one limb and 9 in another"),
        ("axis = [0, 0, 1],", "axis = [0, 0, 1], actuator = 1, gain = 2.0 },"
         ' { kind = "P", axis = [0, 1, 0], actuator = 1, gain = 3.0, at = [0, 0, 9],',
         "gain1 is 3 here and 2"),
        ("axis = [0, 0, 1],", "axis = [0, 0, 1], actuator = 1, drive = { quadratic = 1e-6 },",
         "actuator 1 has two drive laws"),
        ("axis = [0, 0, 1],", 'axis = [0, 0, 1], actuator = 1 }, { kind = "R", axis = [0, 1, 0],'
         " actuator = 1, at = [0, 0, 9],", "actuator 1 turns one joint and slides another"),
        ('kind = "S"', 'actuator = 9, kind = "S"', "has several axes: list the actuated one"),
        ('kind = "S"', 'soft = 3, kind = "S"', "the ball that ends a limb is always 1"),
        ("joints = [", 'joints = [ { kind = "R", share = "a", at = [0, 0, 9], axis = [0, 1, 0] },'
         ' { share = "a" },', "'a' is a joint of this limb already"),
    ],
)  # fmt: skip
def test_mistakes_are_one_line_that_says_where(old: str, new: str, said: str) -> None:
    text = text_of("tricept")
    assert old in text
    with pytest.raises(FileError, match=said) as caught:
        read(text.replace(old, new, 1))
    assert str(caught.value).startswith("chain.toml, line ")
    assert "\n" not in str(caught.value)


def test_an_unknown_kind_of_limb_is_told_of_chains() -> None:
    text = text_of("hexapod").replace('kind = "UPS"', 'kind = "UPRS"', 1)
    with pytest.raises(
        FileError, match=r"any other limb is a chain of joints \(docs/machines.md\)"
    ):
        read(text)


PAGE = (Path(__file__).parents[2] / "docs" / "machines.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("block", re.findall(r"```toml\n(name.*?)```", PAGE, re.S))
def test_machines_on_the_page_are_as_it_says(block: str, tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text(block, encoding="utf-8")
    robot = pk.load(tmp_path / "robot.toml")
    found = robot.forward(robot.inverse(robot.home))
    assert found.ok and np.abs(found.pose - robot.home).max() < 1e-9
    assert "no problems found" in str(pk.check_geometry(robot))


@pytest.mark.parametrize(
    ("name", "old", "new", "said"),
    [
        (
            "five-bar",
            "[208.0, 144.0, 0.0]",
            "[208.0, 144.0, 0.0], axis = [1, 0, 1]",
            "turn about z",
        ),
        ("five-bar", 'kind = "R", at = [208.0', 'kind = "U", at = [208.0', "are R and P, found U"),
        (
            "five-bar",
            "]\n\n[[limb]]",
            ']\n[[tail]]\nkind = "P"\nat = [0, 0]\naxis = [0, 0, 1]\nactuator = 3\n\n[[limb]]',
            "slide across z",
        ),
        ("agile-eye", '"R", axis = [0, 0, 1]', '"C", axis = [0, 0, 1]', "nothing slides"),
    ],
)
def test_joints_move_as_the_pose_map_does(name: str, old: str, new: str, said: str) -> None:
    """Out of the plane there is no error, no pose and no word of it."""
    text = text_of(name)
    assert old in text
    with pytest.raises(FileError, match=f"with the map (planar|spherical), .*{said}"):
        read(text.replace(old, new, 1))
