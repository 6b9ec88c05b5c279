"""Robot files: what they mean, that they come back to the last bit, and what each mistake says."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pkmcal.files.toml_lines import Source
from pkmcal.geometry import robot_file
from pkmcal.geometry.chain_joints import Joint
from pkmcal.geometry.chains import Chains
from pkmcal.geometry.limbs import Cone, Limb
from pkmcal.geometry.model import Model

from ..workspaces import CHAINS

EXAMPLES = Path(__file__).parents[2] / "examples"


def of_limbs(folder: Path) -> list[Path]:
    """The robot files there that are of no arm, which have joints for limbs."""
    texts = {path: path.read_text("utf-8") for path in folder.rglob("*.toml")}
    files = [path for path in texts if path.name != "certificate.toml"]
    return [path for path in files if "[[joint]]" not in texts[path]]


SLIDER_LIMB = {
    "kind": "PUS",
    "base": [1.0, 2.0, 3.0],
    "platform": [4.0, 5.0, 6.0],
    "slider": [0, 0, 1],
    "rod": 340.0,
    "branch": -1,
}
LEG = {"kind": "UPS", "base": [1.0, 2.0, 3.0], "platform": [4.0, 5.0, 6.0]}


def document(limbs: list[dict[str, Any]], **sections: Any) -> dict[str, Any]:
    """A file's content; three legs more let any limbs close the translation map."""
    return {
        "name": "test machine",
        "units": {"length": "mm", "angle": "deg"},
        "pose": {"map": "translation", "home": {"z": 100.0}},
        **sections,
        "limb": [*limbs, LEG, LEG, LEG],
    }


def parse(content: Mapping[str, Any] | str) -> Model:
    text = content if isinstance(content, str) else tomli_w.dumps(content)
    return robot_file.parse(Source(text.encode(), "my.toml"), "my.toml")


def written(model: Model, folder: Path) -> Model:
    robot_file.write(model, folder / "written.toml")
    return robot_file.read(folder / "written.toml")


# to the last bit ----------------------------------------------------------------------------------


def bits(value: object) -> object:
    """A value in a form that compares equal only when every bit is equal."""
    if isinstance(value, np.ndarray):
        return (value.shape, value.dtype.str, value.tobytes())
    if isinstance(value, float):
        return value.hex()
    if isinstance(value, Cone | Limb | Chains | Joint):
        return {each.name: bits(getattr(value, each.name)) for each in fields(value)}
    if isinstance(value, tuple | list):
        return [bits(each) for each in value]
    if isinstance(value, Mapping):
        return [(name, bits(each)) for name, each in value.items()]
    return value


def all_bits(model: Model) -> dict[str, object]:
    found = {each.name: bits(getattr(model, each.name)) for each in fields(model)}
    geometry = model.geometry
    found["geometry"] = bits([geometry.names, geometry.units, geometry.numbers, geometry.values])
    found["file"] = None
    return found


@pytest.mark.parametrize(
    "source",
    [*sorted({*robot_file.builtin_names()} - {*CHAINS}), *sorted(of_limbs(EXAMPLES))],
    ids=str,
)
def test_a_written_robot_reads_back_to_the_last_bit(source: str | Path, tmp_path: Path) -> None:
    model = robot_file.read(source)
    assert all_bits(written(model, tmp_path)) == all_bits(model)


KINDS = ["UPS", "TPR", "UPR", "RPS", "PUS", "PRS", "RUS", "cable", "pulley", "tackle"]
NUMBER = st.floats(-1e4, 1e4)
LENGTH = st.floats(1.0, 1e3)
NAMED_LENGTH = st.sampled_from(["p", "-q", "q"]) | NUMBER
NAMED_ANGLE = st.sampled_from(["turn", "-turn"]) | NUMBER
DIRECTION = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: math.hypot(*v) > 1e-6)
POINT = st.lists(NAMED_LENGTH, min_size=3, max_size=3) | st.fixed_dictionaries(
    {"radius": NAMED_LENGTH, "angle": NAMED_ANGLE, "z": NAMED_LENGTH}
)
CONE = st.fixed_dictionaries({"axis": DIRECTION.map(list), "angle": st.floats(0.1, 3.1)})
TILT = st.lists(NAMED_ANGLE, min_size=2, max_size=2)


@st.composite
def limbs(draw: st.DrawFn) -> dict[str, Any]:
    """A limb of any kind with any of its keys."""
    kind = draw(st.sampled_from(KINDS))
    limb = {"kind": kind, "base": draw(POINT), "platform": draw(POINT)}
    axes = {"TPR": ["revolute"], "UPR": ["revolute"], "RPS": ["normal"]}
    axes |= {"PUS": ["slider"], "PRS": ["slider", "normal"], "RUS": ["axis"]}
    axes |= {"pulley": ["swivel"]}
    named = list(axes.get(kind, []))
    if kind == "UPR":
        limb["couple"] = draw(LENGTH)
        named.append("universal")
    for key in named:
        limb[key] = list(draw(DIRECTION))
        if draw(st.booleans()):
            limb[f"{key}_tilt"] = draw(TILT)
    if kind in ("PUS", "PRS", "RUS"):
        limb |= {"rod": draw(LENGTH), "branch": draw(st.sampled_from([1, -1]))}
    if kind == "RUS" or (kind == "pulley" and draw(st.booleans())):
        x, y, z = limb[named[0]]
        k = min(range(3), key=lambda i: abs((x, y, z)[i]))
        limb["zero"] = [[0, -z, y], [z, 0, -x], [-y, x, 0]][k]
    if kind in ("RUS", "pulley"):
        limb["crank" if kind == "RUS" else "radius"] = draw(LENGTH | st.just("arm"))
    if kind == "tackle":
        limb["over"] = draw(
            st.lists(st.lists(NAMED_LENGTH, min_size=3, max_size=3), min_size=1, max_size=3)
        )
        count = 1 + len(limb["over"])
        limb["parts"] = draw(st.lists(st.integers(1, 4), min_size=count, max_size=count))
    if kind != "RUS" and draw(st.booleans()):
        limb["offset"] = draw(NAMED_LENGTH)
    rows = {"TPR": 1, "UPR": 2, "RPS": 1, "PRS": 1}.get(kind, 0)
    if rows and draw(st.booleans()):
        limb["weights"] = draw(st.lists(LENGTH, min_size=rows, max_size=rows))
    if draw(st.booleans()):
        limb["gain"] = draw(st.sampled_from([1.0, -1.5, 0.1, "ratio"]))
    if draw(st.booleans()):
        limb["stroke"] = sorted([draw(st.floats(0.0, 9.0)), draw(st.floats(10.0, 99.0))])
    for cone in ("base_cone", "platform_cone"):
        if draw(st.booleans()):
            limb[cone] = draw(CONE)
    return limb


@st.composite
def documents(draw: st.DrawFn) -> dict[str, Any]:
    angle, length = draw(st.sampled_from(["deg", "rad"])), draw(st.sampled_from(["mm", "m", "in"]))
    content = document(draw(st.lists(limbs(), min_size=1, max_size=4)))
    content["units"] = {"length": length, "angle": angle}
    values = {"p": 1.7, "q": -0.3, "turn": 33.3, "ratio": 1.1, "arm": 0.7}
    text = str(content["limb"])
    content["parameters"] = {
        name: value for name, value in values.items() if re.search(f"'-?{name}'", text)
    }
    if draw(st.booleans()):
        content["frames"] = {"base": {"x": draw(NUMBER), "gamma": draw(NUMBER)}}
    if draw(st.booleans()):
        content.setdefault("frames", {})["tool"] = {"z": draw(NUMBER), "alpha": draw(NUMBER)}
    if draw(st.booleans()):
        content["pose"]["match"] = ["x", "z", "y"]
    last = f"gain{len(content['limb'])}"
    content["calibration"] = {"free": [last, *content["parameters"]]}
    content["stated"] = {last: draw(NUMBER), "base.x": draw(NUMBER)}
    content["stated"] |= dict.fromkeys(content["parameters"], draw(NUMBER))
    return content


@settings(
    max_examples=60,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(documents())
def test_any_robot_reads_back_to_the_last_bit(tmp_path: Path, content: dict[str, Any]) -> None:
    model = parse(content)
    assert all_bits(written(model, tmp_path)) == all_bits(model)


def test_ties_survive_saving(tmp_path: Path) -> None:
    model = robot_file.read(EXAMPLES / "linear-delta" / "robot.toml")
    again = written(model, tmp_path).geometry.replace({"radius": 150.0})
    assert np.hypot(again["base3.x"], again["base3.y"]) == pytest.approx(150.0, rel=1e-15)
    assert again.numbers == model.geometry.numbers


def test_nothing_is_written_where_writing_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = robot_file.read("hexapod")
    with pytest.raises(FileNotFoundError, match=r"the folder .* does not exist"):
        robot_file.write(model, tmp_path / "missing" / "robot.toml")

    target = tmp_path / "robot.toml"
    target.write_text("what was there")
    monkeypatch.setattr("os.replace", lambda *_: (_ for _ in ()).throw(OSError("disk full")))
    with pytest.raises(OSError, match="disk full"):
        robot_file.write(model, target)
    assert target.read_text() == "what was there"
    assert list(tmp_path.iterdir()) == [target]


# what a file means --------------------------------------------------------------------------------


def test_units_are_converted_once() -> None:
    limb = SLIDER_LIMB | {"offset": 600.0, "slider_tilt": [0.5, 0.0], "stroke": [0.0, 50.8]}
    millimetres = parse(document([limb]))
    content = document([limb | {"base": [1 / 25.4, 2 / 25.4, 3 / 25.4], "rod": 340 / 25.4}])
    content["limb"][0] |= {"offset": 600 / 25.4, "stroke": [0.0, 2.0]}
    content["limb"][0]["slider_tilt"] = [math.radians(0.5), 0.0]
    content["units"] = {"length": "in", "angle": "rad"}
    inches = parse(content)
    for name in ("base1.x", "base1.z", "rod1", "offset1", "slider1.tilt1", "gain1"):
        assert inches.geometry[name] == pytest.approx(millimetres.geometry[name], rel=1e-15)
    assert inches.limbs[0].stroke == pytest.approx(millimetres.limbs[0].stroke)
    assert inches.home[2] == 100.0 * 25.4


def test_a_crank_turns_by_an_angle() -> None:
    limb = {"kind": "RUS", "base": [0, 0, 0], "platform": [0, 0, 0], "rod": 200.0, "branch": 1}
    limb |= {"axis": [0, 1, 0], "zero": [1, 0, 0], "crank": 90.0, "offset": 90.0}
    model = parse(document([limb | {"stroke": [-90.0, 90.0]}]))
    assert model.geometry["offset1"] == math.radians(90.0)
    assert model.limbs[0].stroke == (-math.radians(90.0), math.radians(90.0))
    assert model.actuator_units == ("rad", "mm", "mm", "mm")
    assert np.array_equal(model.limbs[0].frame, [[1, 0, 0], [0, 0, 1], [0, -1, 0]])


@pytest.mark.parametrize(("alias", "kind"), [("TPS", "UPS"), ("SPS", "UPS"), ("TPR", "UPR")])
def test_an_alias_is_the_same_limb(alias: str, kind: str) -> None:
    limb = LEG | ({"revolute": [1, 0, 0]} if kind == "UPR" else {})
    one, other = (parse(document([limb | {"kind": name}])) for name in (alias, kind))
    assert all_bits(one) == all_bits(other)


def test_each_kind_has_its_numbers() -> None:
    base = {"base": [0, 0, 0], "platform": [0, 0, 0]}
    slide = {"rod": 1.0, "branch": 1}
    limbs = [
        {"kind": "UPS"},
        {"kind": "UPR", "revolute": [1, 0, 0]},
        {"kind": "UPR", "revolute": [1, 0, 0], "universal": [0, 1, 0], "couple": 50.0},
        {"kind": "RPS", "normal": [0, 1, 0]},
        {"kind": "PUS", "slider": [0, 0, 1], **slide},
        {"kind": "RUS", "axis": [0, 0, 1], "zero": [1, 0, 0], "crank": 1.0, **slide},
        {"kind": "PRS", "slider": [0, 0, 1], "normal": [0, 1, 0], **slide},
    ]
    model = parse(document([base | limb for limb in limbs]))
    extra = [
        [number.name for number in model.geometry.numbers if number.limb == i][8:] for i in range(7)
    ]
    assert extra == [
        [],
        ["revolute2.tilt1", "revolute2.tilt2"],
        ["universal3.tilt1", "universal3.tilt2", "revolute3.tilt1", "revolute3.tilt2"],
        ["normal4.tilt1", "normal4.tilt2"],
        ["rod5", "slider5.tilt1", "slider5.tilt2"],
        ["rod6", "crank6", "axis6.tilt1", "axis6.tilt2"],
        ["rod7", "slider7.tilt1", "slider7.tilt2", "normal7.tilt1", "normal7.tilt2"],
    ]
    assert [limb.weights for limb in model.limbs[:5]] == [(), (1.0,), (1.0, 1.0), (1.0,), ()]
    assert [limb.branch for limb in model.limbs[:6]] == [0, 0, 0, 0, 1, 1]


@given(DIRECTION)
def test_frames_are_orthonormal_and_end_with_the_stated_axis(
    axis: tuple[float, float, float],
) -> None:
    frame = parse(document([SLIDER_LIMB | {"slider": list(axis)}])).limbs[0].frame
    # axes within 1e-15 of unit length keep their bits, so their squares may be 2e-15 off
    assert np.allclose(frame.T @ frame, np.eye(3), atol=3e-15, rtol=0)
    assert np.linalg.det(frame) == pytest.approx(1.0)
    assert np.allclose(frame[:, 2], np.array(axis) / np.linalg.norm(axis), atol=1e-15, rtol=0)


def test_an_upright_axis_tilts_about_x_and_y() -> None:
    assert np.array_equal(parse(document([SLIDER_LIMB])).limbs[0].frame, np.eye(3))


def test_a_polar_point_of_plain_numbers_is_cartesian(tmp_path: Path) -> None:
    base = {"radius": 200.0, "angle": 30.0, "z": 7.0}
    geometry = written(parse(document([LEG | {"base": base}])), tmp_path).geometry
    assert not geometry.tied.any()
    expected = [200.0 * math.sqrt(0.75), 100.0, 7.0]
    assert [geometry[f"base1.{axis}"] for axis in "xyz"] == pytest.approx(expected, rel=1e-15)
    assert geometry.replace({"base1.x": 3.0})["base1.x"] == 3.0


def test_any_number_can_have_a_name() -> None:
    limb = SLIDER_LIMB | {"rod": "a", "offset": "-a", "gain": "g", "slider_tilt": ["t", 0.0]}
    limb |= {"base": {"radius": 10.0, "angle": "t", "z": "a"}, "platform": ["a", "-a", 3.0]}
    model = parse(document([limb], parameters={"a": 5.0, "g": 2.0, "t": 90.0}))
    geometry = model.geometry.replace({"a": 8.0, "t": 0.0})
    names = ("rod1", "offset1", "gain1", "slider1.tilt1", "slider1.tilt2")
    assert [geometry[name] for name in names] == [8.0, -8.0, 2.0, 0.0, 0.0]
    assert [geometry[f"base1.{axis}"] for axis in "xyz"] == [10.0, 0.0, 8.0]
    assert [geometry[f"platform1.{axis}"] for axis in "xyz"] == [8.0, -8.0, 3.0]
    assert geometry.match(["slider1*"]) == ["slider1.tilt2"]


def test_limbs_may_share_an_actuator() -> None:
    limbs = [SLIDER_LIMB | {"actuator": number} for number in (1, 1, 2)]
    content = document(limbs)
    content["limb"] = limbs
    model = parse(content)
    assert [limb.actuator for limb in model.limbs] == [0, 0, 1]
    assert model.n_actuators == 2


def test_stated_values_go_by_number_or_for_all_limbs() -> None:
    stated = {"rod": 340.0, "base1": {"x": 1.5}, "slider1.tilt1": 90.0}
    model = parse(document([SLIDER_LIMB], stated=stated))
    assert model.stated == {"rod": 340.0, "base1.x": 1.5, "slider1.tilt1": math.radians(90.0)}


def test_wildcards_name_the_free_numbers() -> None:
    model = parse(document([SLIDER_LIMB], calibration={"free": ["offset*", "base1.?"]}))
    offsets = ("offset1", "offset2", "offset3", "offset4")
    assert model.free == (*offsets, "base1.x", "base1.y", "base1.z")


def test_frames_of_base_and_tool_are_poses() -> None:
    model = parse(document([], frames={"tool": {"z": 25.0, "gamma": 90.0}}))
    assert model.base_frame is None and model.tool_frame is not None
    assert model.tool_frame.tolist() == [0, 0, 25.0, 0, 0, math.radians(90.0)]
