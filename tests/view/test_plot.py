"""Machines drawn with matplotlib, and results in notebooks."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

import pkmcal as pk
from pkmcal.view.skeleton import skeleton

from ..simulated import hexapod_poses


def points(axes: object) -> np.ndarray:
    return np.concatenate([np.transpose(line.get_data_3d()) for line in axes.lines])  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", ["hexapod", "rotary-delta", "exechon"])
def test_lines_are_the_machine_at_the_pose(name: str) -> None:
    robot = pk.load(name)
    axes = Figure().add_subplot(projection="3d")
    pose = pk.sample_poses(robot, 1, seed=4, share=0.4)[0]
    assert robot.plot(axes, pose) is axes
    drawn = skeleton(robot, robot.inverse(pose), pose)
    assert drawn is not None
    limbs = np.concatenate(drawn.limbs)
    seen = points(axes)
    assert all((np.abs(seen - point).max(axis=1) < 1e-9).any() for point in limbs)
    assert [axes.get_xlabel(), axes.get_zlabel()] == ["x [mm]", "z [mm]"]
    assert [text.get_text().strip() for text in axes.texts] == [
        str(k + 1) for k in range(len(drawn.limbs))
    ]


def test_in_two_dimensions_it_is_seen_from_above() -> None:
    axes = Figure().add_subplot()
    pk.load("3rrr-planar").plot(axes, color="black", numbers=False)
    assert not axes.texts and {line.get_color() for line in axes.lines} == {"black"}
    assert axes.get_ylabel() == "y [mm]" and axes.get_aspect() == 1.0


def test_an_arm_ends_at_its_tool() -> None:
    arm, theta = pk.load("3r"), [0.2, -0.4, 0.9]
    axes = Figure().add_subplot(projection="3d")
    arm.plot(axes, theta)
    np.testing.assert_allclose(points(axes)[-1], arm.forward(theta)[:3, 3], atol=1e-9)


@pytest.mark.parametrize(
    ("name", "dimensions"), [("3rrr-planar", 2), ("five-bar", 2), ("hexapod", 3)]
)
def test_machines_of_the_plane_are_drawn_in_it(name: str, dimensions: int) -> None:
    from matplotlib import pyplot

    try:
        axes = pk.load(name).plot()
        assert hasattr(axes, "get_zlim") == (dimensions == 3)
    finally:
        pyplot.close("all")


def test_no_side_of_an_arm_in_a_plane_is_too_short_for_its_ticks() -> None:
    axes = Figure().add_subplot(projection="3d")
    pk.load("3r").plot(axes, [0.0, 0.0, 0.0])
    sides = [np.ptp(getattr(axes, f"get_{name}lim")()) for name in "xyz"]
    assert min(sides) > 0.35 * max(sides)


def test_without_axes_there_are_new_ones() -> None:
    from matplotlib import pyplot

    axes = pk.load("3rps").plot()
    try:
        assert axes.figure is pyplot.gcf() and axes.lines
    finally:
        pyplot.close("all")


def test_a_pose_that_is_not_reached_is_refused() -> None:
    with pytest.raises(ValueError, match="pose: linear delta does not get there"):
        pk.load("linear-delta").plot(Figure().add_subplot(), [900, 0, 120, 0, 0, 0])


def test_results_show_their_tables_in_notebooks() -> None:
    robot = pk.load("hexapod")
    poses = hexapod_poses(robot, 40, np.random.default_rng(0))
    machine = pk.VirtualMachine(robot.replace({"offset1": 0.4}), noise=0.01)
    measured = machine.measure(robot.inverse(poses))
    results = {
        "robot": robot,
        "arm": pk.load("3r"),
        "measurements": measured,
        "identification": pk.identify(robot, measured, free="offset*"),
        "plan": pk.plan_poses(robot, poses, count=10, free="offset*"),
        "tolerance": pk.tolerance(robot, poses[:3], sigma={"offset*": 0.1}, samples=100),
    }
    for name, result in results.items():
        assert "<table" in result._repr_html_(), name
