"""MuJoCo reads the exported URDF of an arm, its joint errors included, as the same arm."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk

THETA = np.random.default_rng(3).uniform(-2, 2, (20, 4))
ERRORS = np.random.default_rng(4).normal(0, [0.5, 0.5, 0.5, 0.01, 0.01, 0.01], (4, 6))


def arm() -> pk.SerialArm:
    axes = [[0, 0, 1], [1, 0.2, 0], [0, 1, 0.5], [1, 0, 0]]
    points = [[0, 0, 0], [10, 0, 520], [0, 350, 500], [5, 700, 480]]
    kinds = ["revolute", "revolute", "prismatic", "revolute"]
    return pk.SerialArm(
        axes, points, [30, 900, 470, 0.2, -0.3, 0.5], kinds=kinds, joint_errors=ERRORS, name="a"
    )


def mujoco_tools(path: Path, theta: Any) -> Any:
    """Place of the tool, mm: MuJoCo joins links that are fixed to each other."""
    mujoco = pytest.importorskip("mujoco")
    text = path.read_text().replace(
        "<robot ", '<robot ><mujoco><compiler fusestatic="false"/></mujoco><!-- ', 1
    )
    text = text.replace('">', '" -->', 1)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    found = np.tile(np.eye(4), (len(theta), 1, 1))
    for row, place in zip(theta, found, strict=True):
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        body = data.body("tool")
        place[:3, :3], place[:3, 3] = body.xmat.reshape(3, 3), body.xpos * 1000.0
    return found


def test_mujoco_moves_the_tool_as_the_arm_does(tmp_path: Path) -> None:
    pk.export.urdf(arm(), tmp_path / "arm.urdf")
    metres = THETA * [1, 1, 1e-3, 1]  # a sliding joint
    tools = mujoco_tools(tmp_path / "arm.urdf", metres)
    want = arm().forward(THETA)
    np.testing.assert_allclose(tools[:, :3, 3], want[:, :3, 3], rtol=0, atol=1e-9)
    np.testing.assert_allclose(tools[:, :3, :3], want[:, :3, :3], rtol=0, atol=1e-12)
    assert np.abs(want - arm().replace(np.zeros((4, 6))).forward(THETA)).max() > 0.5


def test_what_is_written_is_read_back_as_the_same_arm(tmp_path: Path) -> None:
    pk.export.urdf(arm(), tmp_path / "arm.urdf")
    again = pk.SerialArm.from_urdf(tmp_path / "arm.urdf")
    np.testing.assert_allclose(again.forward(THETA), arm().forward(THETA), rtol=0, atol=1e-10)


def test_a_parallel_machine_is_no_tree(refused: Any, run: Any, tmp_path: Path) -> None:
    out = tmp_path / "x.urdf"
    message = refused("export", "hexapod", "--as", "urdf", "--out", out)
    assert "the target urdf is for serial arms" in message and not out.exists()
    with pytest.raises(pk.ArgumentError, match="a URDF is a tree and holds no loops"):
        pk.export.urdf(pk.load("hexapod"), out)
    assert run("export", "3r", "--as", "urdf", "--out", out).exit_code == 0
    assert pk.SerialArm.from_urdf(out).kinds == pk.load("3r").kinds
    assert "a serial arm" in refused("export", "3r", "--as", "c", "--out", tmp_path / "x.h")
