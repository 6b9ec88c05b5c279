"""What check says of machines of chains."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.files.toml_lines import tomllib
from pkmcal.geometry import robot_file
from tests.driven import parsed
from tests.robots import made

BUILT_IN = (
    "five-bar", "agile-eye", "tricept", "trivariant", "eclipse", "4ups-ps", "delta-parallelograms",
    "exechon", "tripteron", "2tpr2tps-chains",
)  # fmt: skip
Z = [0.0, 0.0, 1.0]


def planar(*limbs: Sequence[dict[str, object]], **sections: object) -> pk.Robot:
    tables = [{"kind": "chain", "joints": list(limb)} for limb in limbs]
    return made("planar", {"y": 300.0}, tables, **sections)


def turn(x: float, y: float, actuator: int | None = None, **keys: object) -> dict[str, object]:
    joint: dict[str, object] = {"kind": "R", "at": [x, y, 0.0], **keys}
    return joint if actuator is None else joint | {"actuator": actuator}


@pytest.mark.parametrize("name", BUILT_IN)
def test_built_in_machines_of_chains_have_no_faults(name: str) -> None:
    found = pk.check_geometry(pk.load(name))
    assert found.ok, str(found)
    over = {"exechon": 2, "tripteron": 3, "2tpr2tps-chains": 2}.get(name)
    assert ("over-constrained" in str(found)) == (over is not None)
    if over:
        assert f"over-constrained by {over}" in str(found)


def test_too_few_actuators_are_refused_with_how_many_ways_there_are() -> None:
    with pytest.raises(ValueError, match="1 actuator, 2 ways to move"):
        planar(
            [turn(-100, 0, 1), turn(-208, 144)],
            [turn(100, 0), turn(208, 144), turn(0, 300)],
        )


def test_the_motion_that_nothing_holds_is_named() -> None:
    """Two parallel sliders and a free turn: rows enough, and all of them say the same."""
    slide = {"kind": "P", "axis": [0, 1, 0]}
    robot = made(
        "planar",
        {"y": 300.0},
        [
            {
                "kind": "chain",
                "joints": [
                    slide | {"at": [x, 0.0, 0.0], "actuator": k + 1},
                    {"kind": "R", "at": [0.0, 300.0, 0.0]},
                ],
            }
            for k, x in enumerate((-100.0, 100.0))
        ],
    )
    found = pk.check_geometry(robot)
    assert "mobility" in found.kinds
    what = found.findings[found.kinds.index("mobility")].what
    assert what.startswith("2 actuators, 3 ways to move")
    assert "turns about z through (0, 300, 0) mm" in what
    assert (robot.forward([1.0, 1.0]).status) == 2


def test_a_rod_between_two_s_spins() -> None:
    text = robot_file.located("tricept")[0].decode()
    with pytest.raises(ValueError, match="limb 1 can move while the platform stands still"):
        _read(text.replace('{ kind = "U", at = { radius', '{ kind = "S", at = { radius'))


def test_a_limb_at_its_dead_point_is_refused() -> None:
    parallel = {"kind": "P", "axis": [1, 0, 0]}
    with pytest.raises(ValueError, match="passive joints of limb 2 can move"):
        planar(
            [turn(-100, 0, 1), turn(-208, 144)],
            [
                {**parallel, "at": [100.0, 0.0, 0.0]},
                {**parallel, "at": [100.0, 300.0, 0.0]},
                turn(0, 300, 2),
            ],
        )


def test_a_home_value_that_is_nearly_the_distance_is_doubted() -> None:
    text = robot_file.located("2tpr2tps-chains")[0].decode()
    wrong = text.replace("home_value = 401.9210898920334", "home_value = 402.9", 1)
    found = pk.check_geometry(_read(wrong))
    assert found.kinds == ("home",)
    assert "reads 402.9 mm, but the joints beside it are 401.921 mm apart" in found.findings[0].what


def test_home_beyond_a_stroke_is_found() -> None:
    text = robot_file.located("tricept")[0].decode()
    found = pk.check_geometry(
        _read(
            text.replace(
                'stroke = [-300.0, 300.0] },\n  { kind = "S"',
                'stroke = [10.0, 300.0] },\n  { kind = "S"',
            )
        )
    )
    assert found.kinds == ("stroke",)
    assert found.findings[0].limbs == (1, 2, 3)


def test_cones_bend_as_joints_do() -> None:
    robot = pk.load("tricept")
    pose = robot.complete([200.0, 0.0, 1000.0, 0, 0, 0])
    margin = robot.feasible(pose).base_cone_margin[3]
    bent = np.arctan2(np.hypot(*pose[:2]), pose[2])
    assert abs(margin - (np.radians(45.0) - bent)) < 1e-9


def _read(text: str) -> pk.Robot:
    from pkmcal.files.toml_lines import Source

    return pk.Robot(robot_file.parse(Source(text.encode(), "changed.toml"), "changed.toml"))


@pytest.mark.parametrize("name", ["tricept", "delta-parallelograms"])
def test_a_tail_that_adds_no_way_to_move_is_said(name: str) -> None:
    """A slide behind a machine that goes along it already; a turn is another way."""
    plain = pk.load(name)
    place = {"at": plain.home[:3].tolist(), "axis": Z, "actuator": plain.n_actuators + 1}
    for kind, ok in (("P", False), ("R", True)):
        data = tomllib.loads(robot_file.located(name)[0].decode())
        data["pose"].pop("match", None)
        robot = parsed(data | {"tail": [{"kind": kind, **place}]})
        found = pk.check_geometry(robot)
        assert found.ok == ok and found.kinds == (() if ok else ("mobility",)), str(found)
        if ok:
            assert np.isfinite(robot.inverse(robot.home, match=True)).all()
        else:
            assert "tail" in found.findings[0].what and "3 ways" in found.findings[0].what
            with pytest.raises(ValueError, match="check_geometry"):
                robot.inverse(robot.home, match=True)
