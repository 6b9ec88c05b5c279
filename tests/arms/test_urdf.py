"""URDF files in and out: chains, units, mistakes, and joint errors in the origins."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arms import urdf_file

# a fixed flange between moving joints, an oblique axis, an origin at 90 degrees and one left out
URDF = """<?xml version="1.0"?>
<robot name="demo">
  <!-- the shoulder -->
  <link name="base_link"/>
  <link name="upper"><visual><geometry><box size="1 1 1"/></geometry></visual></link>
  <link name="fore"/><link name="flange"/><link name="rod"/><link name="tool0"/>
  <link name="camera"/>
  <joint name="j1" type="revolute">
    <parent link="base_link"/><child link="upper"/>
    <origin xyz="0 0 0.4" rpy="0 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/>
  </joint>
  <joint name="j2" type="continuous">
    <parent link="upper"/><child link="fore"/>
    <origin xyz="0.1 0 0" rpy="0 1.5707963267948966 0.3"/><axis xyz="0 1 1"/>
  </joint>
  <joint name="f" type="fixed">
    <parent link="fore"/><child link="flange"/><origin xyz="0.3 0 0.2" rpy="0.1 0.2 0.3"/>
  </joint>
  <joint name="j3" type="prismatic">
    <parent link="flange"/><child link="rod"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/>
  </joint>
  <joint name="t" type="fixed">
    <parent link="rod"/><child link="tool0"/><origin xyz="0 0 0.05" rpy="0 0.5 0"/>
  </joint>
  <joint name="c" type="fixed">
    <parent link="upper"/><child link="camera"/><origin xyz="0 1 0" rpy="0 0 0"/>
  </joint>
</robot>
"""
THETA = np.random.default_rng(1).uniform(-2, 2, (20, 3)) * [1, 1, 300]
ERRORS = np.random.default_rng(2).normal(size=(3, 6)) * [1, 1, 1, 0.01, 0.01, 0.01]


@pytest.fixture
def source(tmp_path: Path) -> Path:
    (tmp_path / "arm.urdf").write_text(URDF, encoding="utf-8")
    return tmp_path / "arm.urdf"


def test_the_chain_is_read_in_mm(source: Path) -> None:
    arm = pk.SerialArm.from_urdf(source, tip="tool0")
    assert (arm.name, arm.kinds) == ("demo", ("revolute", "revolute", "prismatic"))
    assert arm.points[:2].tolist() == [[0, 0, 400], [100, 0, 400]]
    assert arm.axes[0].tolist() == [0, 0, 1]


def test_pinocchio_reads_the_same_arm(source: Path) -> None:
    engine = pytest.importorskip("pinocchio")
    model = engine.buildModelFromUrdf(str(source))
    data = model.createData()
    frame = model.getFrameId("tool0")
    arm = pk.SerialArm.from_urdf(source, tip="tool0")
    for row, tool in zip(THETA, arm.forward(THETA), strict=True):
        q = [row[0], np.cos(row[1]), np.sin(row[1]), row[2] / 1000.0]  # continuous: on the circle
        engine.framesForwardKinematics(model, data, np.array(q))
        place = data.oMf[frame]
        assert np.abs(place.rotation - tool[:3, :3]).max() < 1e-14
        assert np.abs(1000.0 * place.translation - tool[:3, 3]).max() < 1e-11


def test_a_part_of_the_chain(source: Path) -> None:
    whole = pk.SerialArm.from_urdf(source, tip="tool0")
    fore = pk.SerialArm.from_urdf(source, tip="tool0", base="fore")
    upper = pk.SerialArm.from_urdf(source, tip="fore")
    for row in THETA:
        both = upper.forward(row[:2]) @ fore.forward(row[2:])
        assert np.abs(both - whole.forward(row)).max() < 1e-11


def test_errors_go_into_the_origins(source: Path, tmp_path: Path) -> None:
    arm = pk.SerialArm.from_urdf(source, tip="tool0").replace(ERRORS)
    arm.save_urdf(tmp_path / "corrected.urdf", source, tip="tool0")
    again = pk.SerialArm.from_urdf(tmp_path / "corrected.urdf", tip="tool0")
    assert np.abs(again.forward(THETA) - arm.forward(THETA)).max() < 1e-11


def test_comments_around_the_robot_stay(source: Path, tmp_path: Path) -> None:
    """Licences stand above the first element."""
    text = source.read_text(encoding="utf-8")
    head, _, body = text.rpartition("<robot")
    around = tmp_path / "around.urdf"
    around.write_text(f"{head}<!-- ours: © -->\n<robot{body}\n<!-- the end -->\n", "utf-8")
    pk.SerialArm.from_urdf(around, tip="tool0").save_urdf(tmp_path / "n.urdf", around, tip="tool0")
    new = (tmp_path / "n.urdf").read_text(encoding="utf-8")
    assert new.index("<!-- ours: © -->") < new.index("<robot") < new.index("</robot>")
    assert new.index("</robot>") < new.index("<!-- the end -->")


def test_all_else_stays_in_the_file(source: Path, tmp_path: Path) -> None:
    arm = pk.SerialArm.from_urdf(source, tip="tool0")
    arm.save_urdf(tmp_path / "same.urdf", source, tip="tool0")
    text = (tmp_path / "same.urdf").read_text(encoding="utf-8")
    assert "<!-- the shoulder -->" in text
    old, new = (
        {joint.get("name"): joint for joint in ElementTree.parse(path).getroot().findall("joint")}
        for path in (source, tmp_path / "same.urdf")
    )
    for name in ("f", "t", "c"):
        assert ElementTree.tostring(old[name]) == ElementTree.tostring(new[name])
    assert ElementTree.tostring(old["j1"].find("limit")) == ElementTree.tostring(
        new["j1"].find("limit")
    )
    origin = new["j2"].find("origin")
    numbers = [float(n) for n in f"{origin.get('xyz')} {origin.get('rpy')}".split()]
    assert numbers == pytest.approx([0.1, 0, 0, 0, np.pi / 2, 0.3], abs=1e-15)


@pytest.mark.parametrize(
    "old, new, arguments, message",
    [
        ("", "", {}, "tip: name one of the ends of .*: tool0, camera"),
        ("", "", {"tip": "tool"}, "has no link 'tool'; did you mean 'tool0'"),
        ("", "", {"tip": "camera", "base": "fore"}, "base: 'fore' is not above 'camera'"),
        ("", "", {"tip": "base_link"}, "no moving joint above the link 'base_link'"),
        (
            "continuous",
            "floating",
            {"tip": "tool0"},
            "'j2' is floating, which a serial arm has not",
        ),
        ('name="j2"', 'name="j1"', {"tip": "tool0"}, "several joints are named 'j1'"),
        (
            '<child link="camera"/>',
            '<child link="tool0"/>',
            {"tip": "tool0"},
            "'tool0' is the child of several joints",
        ),
        (
            'axis xyz="0 1 1"',
            'axis xyz="0 1"',
            {"tip": "tool0"},
            "'j2': xyz must be .* '0 1'",
        ),
        ('axis xyz="0 1 1"', 'axis xyz="0 0 0"', {"tip": "tool0"}, "'j2': axis .*, found 0 0 0"),
        (
            'xyz="0 0 0.05"',
            'xyz="0 nan 0"',
            {"tip": "tool0"},
            "'t': xyz must be .* '0 nan 0'",
        ),
        ("</robot>", "", {"tip": "tool0"}, "not valid XML"),
        ("robot", "mujoco", {"tip": "tool0"}, "begins with <mujoco>, not <robot>"),
        ('name="j1" ', "", {"tip": "tool0"}, "<joint> has no name"),
    ],
)
def test_mistakes_are_named(
    old: str, new: str, arguments: dict[str, str], message: str, source: Path
) -> None:
    source.write_text(URDF.replace(old, new), encoding="utf-8")
    with pytest.raises(ValueError, match=message):
        pk.SerialArm.from_urdf(source, **arguments)


def test_errors_do_not_go_into_another_arms_file(source: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"source: .* holds another arm"):
        pk.load("3r").save_urdf(tmp_path / "new.urdf", source, tip="tool0")


# --- what is not as it should be -----------------------------------------------------------------

DEEP = "<gazebo>" + "<p>" * 300 + "</p>" * 300 + "</gazebo>"
LAUGHS = '<!DOCTYPE r [<!ENTITY a "aa"><!ENTITY b "&a;&a;">]>'


@pytest.mark.parametrize(
    "old, new, message",
    [
        ('<link name="fore"/>', DEEP + '<link name="fore"/>', "nested deeper than 100"),
        ('<child link="fore"/>', "<child/>", "joint 'j2': <child> has no link"),
        ('<child link="fore"/>', "", "joint 'j2' has no <child>"),
        ('<child link="fore"/>', '<child link="fro"/>', "there is no link 'fro', its child"),
        ('<child link="fore"/>', '<child link="upper"/><child link="fore"/>', "2 elements <child>"),
        ('<parent link="rod"/>', '<parent link="tool0"/>', "'t' joins 'tool0' with itself"),
        ('xyz="0.1 0 0"', 'xyz="0.1 0 0 0"', "'j2': xyz must be three finite numbers"),
        ('xyz="0.1 0 0"', f'xyz="{"0 " * 100_000}"', "'j2': xyz must be three finite numbers"),
        ('rpy="0.1 0.2 0.3"', 'rpy=""', "'f': rpy must be three finite numbers, found ''"),
        ('rpy="0.1 0.2 0.3"', 'rpy="1 2"', "'f': rpy must be three finite numbers, found '1 2'"),
        ('rpy="0.1 0.2 0.3"', 'rpy="1 2 inf"', "'f': rpy must be three finite numbers"),
        ("<!-- the shoulder -->", '<xacro:include xmlns:xacro="http://www.ros.org/wiki/xacro"/>',
         "<xacro:include>: give the file that xacro makes"),
        ('<?xml version="1.0"?>', '<?xml version="1.0"?>' + LAUGHS, "a document type"),
        ('<?xml version="1.0"?>', '<?xml version="1.0" encoding="zzz"?>', "unknown encoding: zzz"),
        ('<?xml version="1.0"?>', '<?xml version="1.0" encoding="big5"?>', "not valid XML: multi"),
    ],
)  # fmt: skip
def test_a_file_that_is_not_whole_is_refused_and_not_cut_short(
    old: str, new: str, message: str, source: Path
) -> None:
    assert old in URDF
    source.write_text(URDF.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(pk.FileError, match=rf"arm\.urdf: .*{message}"):
        pk.SerialArm.from_urdf(source, tip="tool0")


def test_a_file_that_ends_anywhere_is_refused(source: Path) -> None:
    whole = URDF.rstrip()
    for end in range(1, len(whole), 7):
        source.write_text(whole[:end], encoding="utf-8")
        with pytest.raises(pk.FileError, match="not valid XML"):
            pk.SerialArm.from_urdf(source, tip="tool0")


def test_what_belongs_to_links_is_not_looked_at(source: Path) -> None:
    arm = pk.SerialArm.from_urdf(source, tip="tool0")
    source.write_text(URDF.replace('<box size="1 1 1"/>', ""), encoding="utf-8")
    np.testing.assert_array_equal(pk.SerialArm.from_urdf(source, tip="tool0").home, arm.home)


def test_another_library_reads_the_same_joints(source: Path) -> None:
    yourdfpy = pytest.importorskip("yourdfpy")
    other = yourdfpy.URDF.load(str(source), load_meshes=False)
    read = urdf_file.read(source)
    assert [joint.name for joint in read.joints] == [joint.name for joint in other.robot.joints]
    for mine, theirs in zip(read.joints, other.robot.joints, strict=True):
        assert (mine.parent, mine.child, mine.type) == (theirs.parent, theirs.child, theirs.type)
        origin = np.eye(4) if theirs.origin is None else theirs.origin.copy()
        origin[:3, 3] *= 1000.0
        np.testing.assert_allclose(mine.origin, origin, atol=1e-13)


# --- on the command line -------------------------------------------------------------------------


def test_a_urdf_file_is_loaded_as_other_robots_are(source: Path) -> None:
    arm = pk.load(f"{source}#base_link:tool0")
    assert arm.joint_names == ("j1", "j2", "j3")
    np.testing.assert_array_equal(arm.home, pk.SerialArm.from_urdf(source, tip="tool0").home)
    with pytest.raises(pk.FileError, match=r"name one of the ends .*: tool0, camera.*#TIP"):
        pk.load(source)


def test_a_calibrated_arm_remembers_its_file(source: Path, tmp_path: Path) -> None:
    arm = pk.load(f"{source}#tool0").replace(ERRORS)
    arm.save_urdf(tmp_path / "remembered.urdf")
    arm.save_urdf(tmp_path / "stated.urdf", source, tip="tool0")
    written = [(tmp_path / f"{name}.urdf").read_bytes() for name in ("remembered", "stated")]
    assert written[0] == written[1]
    with pytest.raises(pk.ArgumentError, match="not read from a URDF file"):
        pk.load("3r").save_urdf(tmp_path / "new.urdf")


def test_names_of_joints_go_through_the_arms_own_file(source: Path, tmp_path: Path) -> None:
    pk.load(f"{source}#tool0").save(tmp_path / "arm.toml")
    assert pk.load(tmp_path / "arm.toml").joint_names == ("j1", "j2", "j3")
    text = (tmp_path / "arm.toml").read_text(encoding="utf-8").replace('"j2"', '"j1"')
    (tmp_path / "arm.toml").write_text(text, encoding="utf-8")
    with pytest.raises(pk.FileError, match=r"line \d+: \[\[joint\]\] 2: name: 'j1' is another"):
        pk.load(tmp_path / "arm.toml")


def test_an_arm_is_calibrated_from_its_urdf_and_a_log_with_names_of_joints(
    run: Any, source: Path, tmp_path: Path
) -> None:
    """Joint states by name, mm and deg; the URDF that is written goes where the machine goes."""
    true = pk.SerialArm.from_urdf(source, tip="tool0").replace(ERRORS)
    rng = np.random.default_rng(5)
    q = rng.uniform(-1.5, 1.5, (60, 3)) * [1, 1, 200]
    points = true.forward(q)[:, :3, 3]
    lines = ["position.j3 [mm],j1 [deg],j2_position (deg),X,Y,Z,Std"]
    for (one, two, three), point in zip(q, points, strict=True):
        cells = [three, np.degrees(one), np.degrees(two), *point, 0.01]
        lines.append(",".join(repr(float(v)) for v in cells))
    (tmp_path / "log.csv").write_text("\n".join(lines))
    done = run(
        "calibrate",
        f"{source}#tool0",
        tmp_path / "log.csv",
        "--units",
        "mm",
        "--out",
        tmp_path / "out",
    )
    assert done.exit_code in (0, 1), done.stderr
    found = pk.SerialArm.from_urdf(tmp_path / "out" / "robot.urdf", tip="tool0")
    other = rng.uniform(-1.5, 1.5, (20, 3)) * [1, 1, 200]
    off = np.linalg.norm((found.forward(other) - true.forward(other))[:, :3, 3], axis=1)
    assert off.max() < 1e-5


def test_an_arms_numbers_are_exported_from_the_command_line(
    run: Any, source: Path, tmp_path: Path
) -> None:
    done = run("export", f"{source}#tool0", "--as", "dh", "--out", tmp_path / "dh.csv")
    assert done.exit_code == 0 and (tmp_path / "dh.csv").exists()
    done = run("export", "hexapod", "--as", "dh", "--out", tmp_path / "no.csv")
    assert done.exit_code == 2 and "is for serial arms" in done.stderr
