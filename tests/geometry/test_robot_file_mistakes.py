"""Mistakes in robot files: each is one line that says where it is and what was found."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import tomli_w

from pkmcal.files.toml_lines import Source
from pkmcal.geometry import robot_file
from pkmcal.geometry.model import Model

EXAMPLES = Path(__file__).parents[2] / "examples"
DELTA = (EXAMPLES / "linear-delta" / "robot.toml").read_text()
LEG = {"kind": "UPS", "base": [1.0, 2.0, 3.0], "platform": [4.0, 5.0, 6.0]}
CRANK = LEG | {"kind": "RUS", "rod": 2.0, "crank": 1.0, "branch": 1, "axis": [0, 0, 1]}


def parse(content: str) -> Model:
    return robot_file.parse(Source(content.encode(), "my.toml"), "my.toml")


def parse_limbs(*limbs: dict[str, Any]) -> Model:
    """Read a file of these limbs and three legs, which close the map whatever the limbs are."""
    content = {
        "name": "test machine",
        "units": {"length": "mm", "angle": "deg"},
        "pose": {"map": "translation", "home": {"z": 100.0}},
        "limb": [*limbs, LEG, LEG, LEG],
    }
    return parse(tomli_w.dumps(content))


@pytest.mark.parametrize(
    ("there", "instead", "message"),
    [
        ("name =", "name", "after a key in a key/value pair (at line"),
        ("units =", "unit =", "unknown key 'unit'; did you mean 'units'?"),
        ('"mm"', '"cm"', "[units]: length: 'cm' is no unit of length; known: mm, m, in"),
        ('"deg"', '"mm"', "[units]: angle: 'mm' is no unit of angle; known: rad, deg"),
        (', angle = "deg"', "", "[units]: the key 'angle' is missing"),
        ('"translation"', '"translate"', "map: 'translate' is no pose map; did you mean 'trans"),
        (
            '"translation"',
            '"spatial"',
            "spatial has 6 free coordinates, but the limbs close only 3",
        ),
        ("home =", "hom =", "[pose]: unknown key 'hom'; did you mean 'home'?"),
        ("z = 100.0", "alpha = 1.0", "home: unknown key 'alpha' of the map translation"),
        ("z = 100.0", 'z = "100"', "home.z: must be a number, found the text '100'; numbers are"),
        ("radius = 170.0", "radios = 170.0", "base.radius: [parameters] defines no 'radius'; did"),
        ("radius = 170.0", "radius = nan", "[parameters]: radius: must be finite, found nan"),
        ("radius = 170.0", "radius = true", "[parameters]: radius: must be a number, found true"),
        ("radius = 170.0", "radius = 1.0\nh = 3", "[parameters]: h: no limb uses this parameter"),
        ("radius = 170.0", "radius = 1.0\nrod1 = 3", "rod1: this is already the name of a limb's"),
        ("radius = 170.0", '"a b" = 170.0', "[parameters]: 'a b' is no name: letters, digits"),
        (
            '"angle1", z',
            '"radius", z',
            "radius is an angle here and a length in [[limb]] 1: base.r",
        ),
        (
            '"offset3"]',
            '"ofset3"]',
            "[calibration]: free: no number of the geometry matches 'ofset3'",
        ),
        ('"offset3"]', '"base1.x"]', "free: base1.x is driven by the parameters radius and angle1"),
        ('"offset3"]', "3]", "[calibration]: free: must be a list of names"),
        ("rod = 340.0\n", "road = 340.0\n", "[stated]: the robot has no number 'road'; did you"),
        ('"PUS"', '"PUSS"', "[[limb]] 1: kind: 'PUSS' is no kind of limb; did you mean 'PUS'?"),
        ('"PUS"', '"UPS"', "[[limb]] 1: unknown key 'slider' of a UPS limb"),
        (
            "platform =",
            "platfrm =",
            "unknown key 'platfrm' of a PUS limb; did you mean 'platform'?",
        ),
        ("platform = [0.0, 0.0, 0.0]", "", "[[limb]] 1: the key 'platform' is missing"),
        (
            "[0.0, 0.0, 0.0]",
            "[0.0, 0.0]",
            "platform: a point is [x, y, z] or { radius = ..., angle",
        ),
        ("[0.0, 0.0, 0.0]", "[0.0, 0.0, inf]", "[[limb]] 1: platform: must be finite, found inf"),
        (
            "[0.0, 0.0, 0.0]",
            '[0.0, "2*r", 0]',
            "must be a number or the name of a parameter, found",
        ),
        ('"angle1", z = 0.0', '"angle1"', "base: the key 'z' is missing"),
        ("[0, 0, 1]", "[0, 0, 0]", "slider: must be a direction, found the zero vector"),
        ("[0, 0, 1]", "[0, 1]", "slider: must be a direction of three numbers, found [0, 1]"),
        ("[0, 0, 1]", "[0, 0, 1]\nslider_tilt = 3", "slider_tilt: must be two angles, found 3"),
        ("branch = -1", "branch = 2", "[[limb]] 1: branch: must be 1 or -1, found 2"),
        ("branch = -1", "branch = 0.5", "branch: must be a whole number, found 0.5"),
        (
            "branch = -1",
            "branch = -1\nactuator = 5",
            "actuator: found 5, but no limb has actuator 1",
        ),
        ("branch = -1", "branch = -1\nactuator = 0", "actuators count from 1, found 0"),
        ("rod = 340.0  ", "rod = -340.0  ", "[[limb]] 1: rod: must be positive, found -340.0"),
        ("offset = 625.0", "gain = 0", "[[limb]] 1: gain: must not be 0"),
        ("[100.0, 625.0]", "[625, 100]", "stroke: must rise, found [625, 100]"),
        ("[100.0, 625.0]", "[100]", "stroke: must be two numbers"),
        ("stroke =", "base_cone = { axis = [0, 0, 1], angle = 270 } #", "base_cone.angle: must be"),
        ("stroke =", "base_cone = { axs = [0, 0, 1] } #", "base_cone: unknown key 'axs'; did you"),
        ("stroke =", "weights = [1.0] #", "unknown key 'weights' of a PUS limb"),
        ("[pose]", '[pose]\nmatch = ["x", "x"]', "match: must name some coordinates once each"),
        ("[pose]", '[pose]\nmatch = ["w"]', "[pose]: match: 'w' is no coordinate"),
        (
            "[pose]",
            "[frames]\nbse = {}\n[pose]",
            "[frames]: unknown key 'bse'; did you mean 'base'?",
        ),
    ],
)
def test_a_mistake_is_one_line_that_says_where(there: str, instead: str, message: str) -> None:
    assert there in DELTA
    with pytest.raises(ValueError) as error:
        parse(DELTA.replace(there, instead, 1))
    assert re.match(r"my\.toml(, line \d+|: not valid TOML): ", str(error.value))
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"kind": "UPR", "revolute": [1, 0, 0], "universal": [0, 1, 0]}, "universal: only a limb"),
        ({"kind": "UPR", "revolute": [1, 0, 0], "couple": 9.0}, "the key 'universal' is missing"),
        ({"kind": "UPR", "revolute": [1, 0, 0], "couple": 0}, "couple: must be positive, found 0"),
        (
            {"kind": "RPS", "normal": [0, 1, 0], "weights": [1, 2]},
            "weights: must be one number for",
        ),
        ({"kind": "RPS", "normal": [0, 1, 0], "weights": [0.0]}, "weights: must be positive"),
    ],
)
def test_a_limb_with_rows_of_its_own_says_what_is_wrong(
    changes: dict[str, Any], message: str
) -> None:
    there = rf"my\.toml, line \d+: \[\[limb\]\] 1: {re.escape(message)}"
    with pytest.raises(ValueError, match=there):
        parse_limbs(LEG | changes)


def test_a_crank_starts_at_a_right_angle_to_its_axis() -> None:
    with pytest.raises(ValueError, match="zero: must be at a right angle to axis, found 45 deg"):
        parse_limbs(CRANK | {"zero": [0, 1, 1]})


def test_an_actuator_moves_by_one_unit() -> None:
    with pytest.raises(
        ValueError, match=r"2: actuator: actuator 1 moves by an angle here and by a"
    ):
        parse_limbs(LEG, CRANK | {"zero": [0, 1, 0], "actuator": 1})


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (DELTA.replace("[[limb]]", "[limb]", 1).partition("[[limb]]")[0], "[[limb]] in double"),
        (DELTA.partition("[[limb]]")[0], "the key 'limb' is missing"),
        (
            DELTA.partition("[[limb]]")[0].replace("units", "limb = []\nunits", 1),
            "at least one limb",
        ),
        ("", "the key 'units' is missing"),
    ],
)
def test_a_robot_has_limbs(content: str, message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        parse(content)


@pytest.mark.parametrize(
    ("source", "error", "message"),
    [
        ("hexapd", ValueError, "unknown machine 'hexapd'; did you mean 'hexapod'?"),
        ("nowhere.toml", FileNotFoundError, "nowhere.toml: no such file"),
        (EXAMPLES / "robt.toml", FileNotFoundError, "no such file; did you mean 'robot.toml'?"),
        (EXAMPLES, ValueError, "this is a folder, not a robot file"),
        (3, TypeError, "robot must be a name or a path, found 3"),
    ],
)
def test_an_unknown_robot_is_named(source: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=re.escape(message)):
        robot_file.read(source)


def test_a_file_that_is_no_text_is_named(tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_bytes(b"name = \xff")
    with pytest.raises(ValueError, match=r"l, line 1: not .* in UTF-8 \(byte 7\): save it"):
        robot_file.read(tmp_path / "robot.toml")
