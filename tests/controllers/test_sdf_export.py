"""An exported SDF model moves its tool as the arm does: by the format's rules, and in Drake."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pkmcal as pk

from .test_urdf_export import ERRORS, THETA, arm


def frame(text: str) -> Any:
    """The motion of a pose: x y z, then roll, pitch, yaw about fixed axes."""
    numbers = np.array(text.split(), dtype=float)
    made = np.eye(4)
    made[:3, :3] = Rotation.from_euler("xyz", numbers[3:]).as_matrix()
    made[:3, 3] = numbers[:3]
    return made


def read_tool(path: Path, theta: Any) -> Any:
    """Where the link "tool" is with the joints at theta, in the world, as SDFormat 1.7 has it.

    A pose is relative to the frame that it names, and a joint's frame is at rest in its child; the
    axis is in the joint's frame.
    """
    model = Xml.parse(path).getroot().find("model")
    assert model is not None
    links = {each.get("name"): each for each in model.findall("link")}
    joints = {each.get("name"): each for each in model.findall("joint")}
    names = [*links, *joints]
    assert len(set(names)) == len(names)  # frames of one model

    def pose(element: Any) -> tuple[Any, str]:
        found = element.find("pose")
        return frame(found.text), found.get("relative_to")

    place, moved, left = {"__model__": np.eye(4)}, iter(theta), dict(joints)
    at = {"world": np.eye(4)}
    while left:  # from the world outwards: poses at rest, and where motions take them
        name = next(n for n, each in left.items() if each.findtext("parent") in at)
        joint = left.pop(name)
        parent, child = joint.findtext("parent"), joint.findtext("child")
        origin, relative_to = pose(joint)
        if relative_to == child:  # the root
            place[child] = place[pose(links[child])[1]] @ pose(links[child])[0]
            place[name] = place[child] @ origin
        else:
            place[name] = place[relative_to] @ origin
            offset, relative_to = pose(links[child])
            place[child] = place[relative_to] @ offset
        motion = np.eye(4)
        if joint.get("type") != "fixed":
            axis = np.array(joint.findtext("axis/xyz").split(), dtype=float)
            value = next(moved)
            if joint.get("type") == "revolute":
                motion[:3, :3] = Rotation.from_rotvec(axis * value).as_matrix()
            else:
                motion[:3, 3] = axis * value
        rest = at[parent] @ np.linalg.inv(place.get(parent, np.eye(4)))
        at[child] = rest @ place[name] @ motion @ np.linalg.inv(place[name]) @ place[child]
    found = at["tool"]
    found[:3, 3] *= 1000.0
    return found


def drake_tool(path: Path, theta: Any) -> Any:
    plant_of = pytest.importorskip("pydrake.multibody.plant")
    parser_of = pytest.importorskip("pydrake.multibody.parsing")
    plant = plant_of.MultibodyPlant(0.0)
    parser_of.Parser(plant).AddModels(str(path))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, theta)
    found = plant.GetBodyByName("tool").EvalPoseInWorld(context).GetAsMatrix4().copy()
    found[:3, 3] *= 1000.0
    return found


@pytest.mark.parametrize("tool", [read_tool, drake_tool])
def test_the_tool_moves_as_that_of_the_arm(tool: Any, tmp_path: Path) -> None:
    pk.export.sdf(arm(), tmp_path / "arm.sdf")
    want = arm().forward(THETA)
    for theta, pose in zip(THETA * [1, 1, 1e-3, 1], want, strict=True):
        found = tool(tmp_path / "arm.sdf", theta)
        np.testing.assert_allclose(found[:3, 3], pose[:3, 3], rtol=0, atol=1e-9)
        np.testing.assert_allclose(found[:3, :3], pose[:3, :3], rtol=0, atol=1e-12)
    assert np.abs(want - arm().replace(np.zeros_like(ERRORS)).forward(THETA)).max() > 0.5


def test_joints_that_are_called_as_links_are_renamed(tmp_path: Path) -> None:
    (tmp_path / "a.urdf").write_text(
        '<robot name="a"><link name="b"/><link name="t"/><joint name="link1" type="continuous">'
        '<parent link="b"/><child link="t"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/></joint>'
        "</robot>"
    )
    pk.export.sdf(pk.SerialArm.from_urdf(tmp_path / "a.urdf"), tmp_path / "a.sdf")
    text = (tmp_path / "a.sdf").read_text()
    assert '<joint name="link1_joint" type="revolute">' in text
    found = read_tool(tmp_path / "a.sdf", [0.3])
    want = pk.SerialArm.from_urdf(tmp_path / "a.urdf").forward([0.3])
    np.testing.assert_allclose(found, want, rtol=0, atol=1e-9)


def test_a_parallel_machine_is_no_tree(refused: Any, run: Any, tmp_path: Path) -> None:
    out = tmp_path / "x.sdf"
    assert "the target sdf is for serial arms" in refused(
        "export", "hexapod", "--as", "sdf", "--out", out
    )
    with pytest.raises(pk.ArgumentError, match="an SDF model is a tree and holds no loops"):
        pk.export.sdf(pk.load("hexapod"), out)
    assert not out.exists()
    assert run("export", "3r", "--as", "sdf", "--out", out).exit_code == 0
    assert read_tool(out, [0.1, 0.2, 0.3]).shape == (4, 4)
