"""Drive laws in robot files: read, written back to the last bit, kept, refused with their line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

import pkmcal as pk

from ..driven import content, parsed, with_laws
from ..workspaces import CHAINS, WORKSPACE

HEAD = """
name = "driven"
units = { length = "m", angle = "deg" }
[pose]
map = "planar"
home = { y = 0.4 }
[parameters]
bend = 2e-2
[calibration]
free = ["bend", "drive2.cos1"]
"""
LIMB = """
[[limb]]
kind = "UPS"  # a comment of mine
base = [%s, 0.0, 0.0]
platform = [%s, 0.02, 0.0]
stroke = [0.1, 0.9]
"""


def file(tmp_path: Path, *drives: str) -> Path:
    text = HEAD + "".join(
        LIMB % (base, platform) + f"drive = {drive}\n"
        for base, platform, drive in zip((-0.3, 0.3, 0.35), (0.1, -0.1, 0.1), drives, strict=True)
    )
    path = tmp_path / "driven.toml"
    path.write_text(text, encoding="utf-8")
    return path


THREE = (
    '{ quadratic = "bend", backlash = 1e-4 }',
    "{ harmonics = [{ k = 200.0, cos = 1e-4 }, { k = 31.0, sin = -2e-4 }] }",
    '{ quadratic = "-bend", table = [[0.3, 0.0], [0.4, 1e-3], [0.5, -1e-3]], smoothness = 1e-4 }',
)


@pytest.mark.parametrize("name", [*sorted(WORKSPACE), *CHAINS])
def test_laws_are_read_back_to_the_last_bit(name: str, tmp_path: Path) -> None:
    robot = with_laws(pk.load(name), np.random.default_rng(8))
    robot.save(tmp_path / "robot.toml")
    again = pk.load(tmp_path / "robot.toml")
    assert again.geometry.names == robot.geometry.names
    assert again.geometry.values.tobytes() == robot.geometry.values.tobytes()
    assert again.model.laws == robot.model.laws
    assert any(law is not None for law in robot.model.laws)


def test_units_of_laws_are_those_of_the_file(tmp_path: Path) -> None:
    geometry = pk.load(file(tmp_path, *THREE)).geometry
    robot = pk.load(file(tmp_path, *THREE))
    assert geometry["bend"] == pytest.approx(2e-5)  # 2e-2 a metre
    assert geometry.units[geometry.names.index("bend")] == "1/mm"
    assert geometry["drive1.backlash"] == pytest.approx(0.1)
    assert geometry["drive2.sin2"] == pytest.approx(-0.2)
    assert robot.model.laws[1].harmonics == pytest.approx((0.2, 0.031))  # waves a mm
    assert robot.model.laws[2].table == pytest.approx((300.0, 400.0, 500.0))
    assert robot.model.laws[2].smoothness == pytest.approx(0.1)
    way = robot.drives(np.array([[310.0, 420.0, 450.0]]))[0]
    expected = [
        310.0 + 2e-5 * 310.0**2,
        420.0 + 0.1 * np.cos(0.2 * 420.0) - 0.2 * np.sin(0.031 * 420.0),
        450.0 - 2e-5 * 450.0**2 + 0.0,
    ]
    assert abs(way - expected).max() < 1e-12


def test_one_number_may_be_that_of_several_limbs(tmp_path: Path) -> None:
    robot = pk.load(file(tmp_path, *THREE))
    assert robot.geometry["drive1.quadratic"] == -robot.geometry["drive3.quadratic"]
    with pytest.raises(ValueError, match=r"drive1.quadratic is driven by the parameter bend"):
        robot.replace({"drive1.quadratic": 0.0})
    changed = robot.replace({"bend": 3e-5})
    assert changed.geometry["drive3.quadratic"] == -3e-5
    q = robot.inverse(robot.home)
    pose = robot.forward(q).pose
    ends = [robot.replace({"bend": 2e-5 + e}).forward(q).pose for e in (-1e-9, 1e-9)]
    column = robot.error_jacobian(pose, q)[:, robot.geometry.names.index("bend")]
    assert abs((ends[1] - ends[0]) / 2e-9 - column).max() < 1e-5 * abs(column).max()


def test_a_kept_file_keeps_its_laws_and_comments(tmp_path: Path) -> None:
    path = file(tmp_path, *THREE)
    robot = pk.load(path)
    changes = {"bend": 3e-5, "drive2.cos1": 0.25, "drive3.table2": 0.5, "drive1.backlash": 0.3}
    robot.replace(changes).save(
        tmp_path / "kept.toml", like=path, deviations={"drive2.cos1": 0.01, "bend": 1e-6}
    )
    text = (tmp_path / "kept.toml").read_text(encoding="utf-8")
    assert "# a comment of mine" in text and "cos = 0.00025" in text and "± 0.001" in text
    again = pk.load(tmp_path / "kept.toml")
    for name, value in changes.items():
        assert again.geometry[name] == pytest.approx(value, rel=1e-13)


def test_the_gain_of_a_spool_is_by_length_and_kept_in_the_files_unit(tmp_path: Path) -> None:
    path = file(tmp_path, "{ spool = 0.05 }\ngain = 20.0", THREE[1], '{ quadratic = "bend" }')
    robot = pk.load(path)
    units = dict(zip(robot.geometry.names, robot.geometry.units, strict=True))
    assert (units["gain1"], units["gain2"]) == ("1/mm", "1")
    assert robot.geometry["gain1"] == pytest.approx(0.02, rel=1e-13)  # 20 a metre
    changed = robot.replace({"gain1": 0.021})
    changed.save(tmp_path / "kept.toml", like=path)
    assert pk.load(tmp_path / "kept.toml").geometry["gain1"] == pytest.approx(0.021, rel=1e-13)


@pytest.mark.parametrize(("drive", "message"), [
    ("{}", r"line 17: \[\[limb\]\] 1: drive: states no law; it may have quadratic"),
    ("{ quadratik = 1.0 }", r"line 17: .*unknown key 'quadratik' of a drive law.*quadratic"),
    ("{ buildup = 1.0 }", "drive.buildup: is that of a spool, whose radius is missing"),
    ("{ table = [[0.0, 1.0]] }", r"drive.table: must be pairs \[reading, correction\], two"),
    ("{ table = [[1.0, 0.0], [0.5, 0.0]] }", r"rising readings, found 1000 and then 500"),
    ("{ table = [[1.0, 0.0], [2.0]] }", r"must be pairs"),
    ("{ smoothness = 1.0 }", "is how far a table bends, above 0"),
    ("{ harmonics = [{ k = 1.0 }, { k = 1.0 }] }", "must have different k above 0"),
    ("{ harmonics = [{ cos = 1.0 }] }", "the key 'k' is missing"),
    ('{ backlash = "nothing" }', "defines no 'nothing'"),
    ("{ quadratic = -1.0 }", r"line 17: .*drive: limb 1: it turns back within its stroke"),
    ("{ harmonics = [{ k = 1000.0, cos = 0.1 }] }", r"limb 1: it turns back within"),
])  # fmt: skip
def test_a_mistake_is_said_with_its_line(tmp_path: Path, drive: str, message: str) -> None:
    plain = '{ quadratic = "bend" }'
    with pytest.raises(ValueError, match=message):
        pk.load(file(tmp_path, drive, THREE[1], plain))


def test_a_law_that_may_turn_back_needs_a_stroke(tmp_path: Path) -> None:
    path = file(tmp_path, *THREE)
    both = "{ quadratic = 1e-3, harmonics = [{ k = 10.0, cos = 1e-4 }] }"
    text = path.read_text(encoding="utf-8").replace("stroke = [0.1, 0.9]\n", "")
    path.write_text(text.replace(THREE[1], both), encoding="utf-8")
    with pytest.raises(
        ValueError, match=r"limb 2: its corrections may turn it back: state a strok"
    ):
        pk.load(path)


def test_a_law_that_came_to_turn_back_is_found_and_not_written(tmp_path: Path) -> None:
    robot = pk.load(file(tmp_path, *THREE)).replace({"drive2.cos1": 20.0})
    assert np.isnan(robot.inverse(robot.home)[1])
    (finding,) = (f for f in pk.check_geometry(robot).findings if f.kind == "drive")
    assert finding.limbs == (2,) and "turns back" in finding.what
    with pytest.raises(ValueError, match=r"robot: limb 2 of driven: its drive law: it turns back"):
        robot.save(tmp_path / "turned.toml")
    assert not (tmp_path / "turned.toml").exists()


def test_a_spool_turns_no_crank(tmp_path: Path) -> None:
    data: dict[str, Any] = content(pk.load("rotary-delta"))
    data["limb"][0]["drive"] = {"spool": 20.0}
    with pytest.raises(ValueError, match="takes up a length, and this actuator turns the limb"):
        parsed(data)


def test_copies_of_a_chain_have_its_law(tmp_path: Path) -> None:
    data = content(pk.load(CHAINS[0]))
    for limb in data["limb"]:
        for joint in limb["joints"]:
            if "actuator" in joint:
                joint["drive"] = {"quadratic": 1e-5}
    (tmp_path / "chains.toml").write_bytes(tomli_w.dumps(data).encode())
    robot = pk.load(tmp_path / "chains.toml")
    count = robot.n_actuators
    assert [n for n in robot.geometry.names if n.startswith("drive")] == [
        f"drive{i}.quadratic" for i in range(1, count + 1)
    ]


EXPORTS = {
    "mjcf": "hexapod", "klipper": "linear-delta", "reprap": "linear-delta",
    "marlin": "linear-delta",
}  # fmt: skip


@pytest.mark.parametrize("export", EXPORTS)
def test_an_export_that_holds_no_law_names_it(export: str, tmp_path: Path) -> None:
    data = content(pk.load(EXPORTS[export]))
    data["limb"][1]["drive"] = {"backlash": 0.01}
    robot = parsed(data)
    with pytest.raises(ValueError, match=r"limb 2 of .* has a drive law \(backlash\), which"):
        getattr(pk.export, export)(robot, tmp_path / "out")
    assert list(tmp_path.iterdir()) == []
