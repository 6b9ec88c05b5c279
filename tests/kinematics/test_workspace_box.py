"""A machine stays in the box that its file states: `[workspace]`, `Robot.within`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk

POSITIONS = "[workspace]\nx = [-50, 60]\nz = [0, 300]\n"


def stated(tmp_path: Path, section: str, name: str = "linear-delta") -> Path:
    """A built-in machine's file with this section."""
    path = tmp_path / "robot.toml"
    pk.load(name).save(path)
    text = path.read_text("utf-8")
    path.write_text(text.replace("[pose]", section + "\n[pose]", 1), "utf-8")
    return path


def test_a_file_keeps_its_box(tmp_path: Path) -> None:
    robot = pk.load(stated(tmp_path, POSITIONS))
    assert robot.model.workspace == {"x": (-50.0, 60.0), "z": (0.0, 300.0)}
    robot.save(tmp_path / "again.toml")
    assert pk.load(tmp_path / "again.toml").model.workspace == robot.model.workspace


def test_units_of_the_file_are_those_of_its_box(tmp_path: Path) -> None:
    path = stated(tmp_path, "[workspace]\nz = [0.7, 0.9]\nalpha = [-10, 10]\n", "hexapod")
    text = path.read_text("utf-8").replace('length = "mm"', 'length = "m"').replace(
        'angle = "rad"', 'angle = "deg"'
    )  # fmt: skip
    path.write_text(text, "utf-8")
    box = pk.load(path).model.workspace
    np.testing.assert_allclose(box["z"], (700.0, 900.0))
    np.testing.assert_allclose(box["alpha"], np.radians([-10.0, 10.0]))


@pytest.mark.parametrize(
    "section, message",
    [
        ("[workspace]\nz = [300, 0]\n", "z: the least value must be below the largest"),
        ("[workspace]\nz = [1]\n", "z: "),
        ("[workspace]\nheight = [0, 1]\n", "'height'"),
    ],
)
def test_a_box_that_is_none_is_refused(tmp_path: Path, section: str, message: str) -> None:
    with pytest.raises(pk.FileError, match=message):
        pk.load(stated(tmp_path, section))


@pytest.mark.parametrize("name", ["linear-delta", "hexapod", "five-bar"])
def test_drawn_poses_are_in_the_box_and_others_are_not_feasible(name: str) -> None:
    robot = pk.load(name)
    x, y = robot.home[:2]
    small = robot.within({"x": (x - 20, x + 10), "y": (y - 5, y + 30)})
    drawn = pk.sample_poses(small, 50, share=1.0)
    assert (np.abs(drawn[:, 0] - x + 5) <= 15 + 1e-9).all()
    assert (np.abs(drawn[:, 1] - y - 12.5) <= 17.5 + 1e-9).all()
    far = pk.sample_poses(robot, 200, share=0.9)
    inside = (np.abs(far[:, 0] - x + 5) <= 15) & (np.abs(far[:, 1] - y - 12.5) <= 17.5)
    assert (small.feasible(far).ok == inside).all() and not inside.all()
    assert "outside the workspace" in small.feasible(far).broken()[0]


def test_of_two_boxes_the_nearer_ends_count(tmp_path: Path) -> None:
    robot = pk.load(stated(tmp_path, POSITIONS)).within({"z": (-100, 200), "y": (0, 1)})
    assert robot.model.workspace == {"x": (-50, 60), "z": (0, 200), "y": (0, 1)}
    with pytest.raises(pk.ArgumentError, match="nothing is left of z from 400 to 500"):
        robot.within({"z": (400, 500)})
    with pytest.raises(pk.ArgumentError, match="'w' is no coordinate"):
        robot.within({"w": (400, 500)})


def test_a_plan_stays_above_the_bed() -> None:
    """It went 134 mm below it."""
    robot = pk.load("linear-delta").within({"z": (0, 300)})
    candidates = pk.sample_poses(pk.load("linear-delta"), 300, seed=2, share=0.9)
    assert (candidates[:, 2] < 0).any(), "there is room below"
    plan = pk.plan_poses(robot, candidates, 10, kind="height", free="offset*")
    assert (plan.poses[:, 2] >= 0).all() and plan.left_out >= (candidates[:, 2] < 0).sum()


@pytest.mark.parametrize("name", ["linear-delta", "five-bar"])
def test_home_outside_the_box_is_found(tmp_path: Path, name: str) -> None:
    home = pk.load(name).home[0]
    path = stated(tmp_path, f"[workspace]\nx = [{home + 10}, {home + 50}]\n", name)
    findings = pk.check_geometry(pk.load(path)).findings
    assert "workspace" in [finding.kind for finding in findings]
    inside = stated(tmp_path, f"[workspace]\nx = [{home - 10}, {home + 50}]\n", name)
    assert "workspace" not in [each.kind for each in pk.check_geometry(pk.load(inside)).findings]
