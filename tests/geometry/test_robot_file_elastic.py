"""What robot files say of stiffness, masses and payloads: read, refused, written to the bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from tests.robots import hexapod


def stiff(**sections: object) -> pk.Robot:
    return hexapod(*[{"stiffness": 2e4}] * 6, **sections)


def elastic_everything() -> pk.Robot:
    return hexapod(
        *[{"stiffness": 2e4, "mass": "m"}] * 5,
        {"stiffness": {"value": 3e4, "at": 900.0, "per_length": 1e-8}},
        compliance={"base*": "c", "platform1.x": {"value": 1e-5}},
        parameters={"c": 2e-6, "m": 4.0},
        gravity=[0.0, -9.7, 1.0],
        gravity_tilt=[0.01, 0.02],
        platform={"mass": 30.0, "centre": [1.0, 2.0, 40.0]},
        payload={
            "mass": 5.0,
            "centre": [3.0, 2.0, 1.0],
            "force": [1.0, 0.0, -4.0],
            "moment": [7.0, 0.0, 0.0],
        },
        balancer=[
            {"base": [0.0, 0.0, 1e3], "platform": [0.0, 0.0, 0.0], "rate": 0.5, "free": 100.0}
        ],
    )


def test_a_stiffness_is_a_compliance_of_the_number_that_yields() -> None:
    robot = stiff(compliance={"base2*": 1e-6})
    assert robot.geometry["compliance.offset3"] == 1.0 / 2e4
    assert robot.geometry["compliance.base2.y"] == 1e-6
    units = dict(zip(robot.geometry.names, robot.geometry.units, strict=True))
    assert units["compliance.offset3"] == "mm/N" and units["gravity.tilt1"] == "rad"
    assert "compliance.base1.x" not in units


def test_a_crank_is_stiff_in_newton_metres() -> None:
    from tests.kinematics.test_loaded import heavy_crank

    robot = heavy_crank()
    assert robot.geometry["compliance.offset1"] == pytest.approx(1.0 / (5e3 * 1e3), rel=1e-15)
    assert robot.geometry["compliance.rod1"] == 1.0 / 8e3


@pytest.mark.parametrize("unit", ["mm", "m", "in"])
def test_units_of_a_file_do_not_change_what_is_in_newtons(unit: str, tmp_path: Path) -> None:
    size = {"mm": 1.0, "m": 1e-3, "in": 1 / 25.4}[unit]
    path = tmp_path / "robot.toml"
    pk.load("hexapod").save(path)
    content = path.read_text()
    content = content.replace("[[limb]]\n", "[[limb]]\nstiffness = 2e4\n", 1)
    content += '[compliance]\n"base1*" = 1e-6\n'
    content += f"[platform]\nmass = 3.0\ncentre = [0.0, 0.0, {40 * size!r}]\n"
    if unit != "mm":
        content = _in_unit(content, unit, size)
    path.write_text(content)
    robot = pk.load(path)
    assert robot.geometry["compliance.offset1"] == 1.0 / 2e4
    assert robot.geometry["compliance.base1.x"] == 1e-6
    assert robot.geometry["centre.platform.z"] == pytest.approx(40.0, rel=1e-15)


def _in_unit(content: str, unit: str, size: float) -> str:
    """The file with its joints, home and stroke in another unit of length."""
    import tomli_w

    from pkmcal.files.toml_lines import tomllib

    data = tomllib.loads(content)
    data["units"]["length"] = unit
    data["pose"]["home"] = {
        k: v * size if k in "xyz" else v for k, v in data["pose"]["home"].items()
    }
    for limb in data["limb"]:
        for key in ("base", "platform", "stroke"):
            if key in limb:
                limb[key] = [float(each) * size for each in limb[key]]
    data.pop("stated", None)
    return tomli_w.dumps(data)


@pytest.mark.parametrize("made", [elastic_everything, stiff])
def test_files_of_machines_that_yield_are_read_back_to_the_last_bit(made, tmp_path: Path) -> None:
    robot = made()
    rng = np.random.default_rng(3)
    free = ~robot.geometry.tied
    values = np.where(free, robot.geometry.values * (1 + 1e-3 * rng.random(len(free))), 0.0)
    robot = robot.replace(
        {n: v for n, v, f in zip(robot.geometry.names, values, free, strict=True) if f}
    )
    path = tmp_path / "robot.toml"
    robot.save(path)
    again = pk.load(path)
    assert dict(again.geometry.items()) == dict(robot.geometry.items())
    assert again.model.elastic == robot.model.elastic
    q = robot.inverse(robot.home)
    assert np.array_equal(again.inverse(robot.home), q)
    assert np.array_equal(again.forward(q).pose, robot.forward(q).pose)


def test_one_compliance_may_be_that_of_several_numbers() -> None:
    robot = elastic_everything()
    changed = robot.replace({"c": 5e-6})
    assert changed.geometry["compliance.base4.z"] == 5e-6
    with pytest.raises(pk.ArgumentError, match="driven by the parameter c"):
        robot.replace({"compliance.base4.z": 1e-6})


def test_the_rigid_machine_has_no_number_of_what_yields() -> None:
    robot = elastic_everything()
    rigid = robot.rigid
    assert rigid.model.elastic is None and rigid.rigid is rigid
    assert not any(
        name.startswith(("compliance", "mass", "payload", "gravity")) for name in rigid.geometry
    )
    assert "c" not in rigid.geometry
    plain = hexapod()
    q = plain.inverse(plain.home)
    assert np.array_equal(rigid.inverse(plain.home), q)
    assert np.array_equal(rigid.forward(q).pose, plain.forward(q).pose)


def test_masses_stand_in_a_file_of_compliances_to_be_identified() -> None:
    """As the refusal of masses alone says: the compliance is stated as 0, and identified."""
    robot = hexapod({"mass": 4.0}, compliance={"offset*": 0.0}, platform={"mass": 30.0})
    assert robot.geometry["compliance.offset1"] == 0.0
    q = robot.inverse(robot.home)
    assert np.abs(robot.forward(q).pose - robot.rigid.forward(q).pose).max() < 1e-12
    names = [f"compliance.offset{i}" for i in range(1, 7)]
    true = robot.replace(dict.fromkeys(names, 2e-4))
    rows = pk.VirtualMachine(true, 1e-6).measure(
        robot.inverse(pk.sample_poses(robot.rigid, 20)), "pose"
    )
    found = pk.identify(robot, rows, free="compliance*")
    assert [found.robot.geometry[name] for name in names] == pytest.approx([2e-4] * 6, rel=1e-2)


@pytest.mark.parametrize(
    ("limb", "sections", "message"),
    [
        ({"stiffness": -1.0}, {}, r"line 25: \[\[limb\]\] 1: stiffness: must be positive"),
        ({"stiffness": "k"}, {}, "what has a name goes into \\[compliance\\]"),
        ({"stiffness": {"value": 1e4, "at": 5.0}}, {}, "at: is where per_length is 0"),
        ({"stifness": 1e4}, {}, "unknown key 'stifness'.*did you mean 'stiffness'"),
        ({"mass": 4.0}, {}, "mass: pulls at a machine in which nothing yields.*\"offset\\*\" = 0"),
        ({}, {"platform": {"mass": 3.0}}, "platform: pulls at a machine in which nothing yields"),
        ({}, {"compliance": {"bse*": 1e-6}}, "the limbs have no number 'bse\\*'"),
        ({}, {"compliance": {"gain1": 1e-6}}, "gain1 is no length and no angle"),
        ({"stiffness": 1e4}, {"compliance": {"offset*": 1e-6}}, "offset1 has a compliance already"),
        ({"stiffness": 1e4}, {"platform": {"mass": -3.0}}, "mass: must not be negative"),
        ({"stiffness": 1e4}, {"payload": {"wieght": 3.0}}, "unknown key 'wieght'"),
        ({"stiffness": 1e4}, {"gravity": [0.0, 1.0]}, "gravity: must be three numbers"),
        ({}, {"compliance": {"base1.x": {"value": 1e-6, "at": 0.0, "per_length": 1e-9}}},
         "per_length: is of a leg or a screw"),
    ],
)  # fmt: skip
def test_mistakes_are_named_with_their_line(limb: dict, sections: dict, message: str) -> None:
    with pytest.raises(pk.FileError, match=message):
        hexapod(limb, **sections)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"mass": -1.0}, "mass of the load must not be negative"),
        ({"mass": np.nan}, "the load must be finite"),
        ({"centre": [1.0, 2.0]}, r"centre of the load must have shape \(..., 3\)"),
        ({"mass": [1.0, 2.0], "force": np.zeros((3, 3))}, "do not go with one another"),
        ({"mass": "5 kg"}, "mass of the load must be an array of numbers"),
    ],
)
def test_loads_that_make_no_sense_are_refused(arguments: dict, message: str) -> None:
    with pytest.raises(pk.ArgumentError, match=message):
        pk.Load(**arguments)
