"""Pictures show what was computed, and the same picture has the same bytes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.report import drawing
from pkmcal.report import error_figures as figures

from ..workspaces import poses


@pytest.fixture(scope="module")
def errors() -> pk.Sensitivity:
    return pk.sensitivity(pk.load("2tpr2tps"), poses("2tpr2tps", 6), cases=["offset1", "base*.x"])


@pytest.fixture(scope="module")
def plane() -> pk.Workspace:
    return pk.workspace(pk.load("2tpr2tps"), {"y": (-200, 200, 12), "z": (280, 500, 14)})


def test_files_are_the_same_bytes_each_time(errors: pk.Sensitivity, tmp_path: Path) -> None:
    found = []
    for name in ("one", "two"):
        written = drawing.write_both(figures.mean_errors(errors, "title"), tmp_path / name)
        assert [path.suffix for path in written] == [".png", ".svg"]
        found.append([path.read_bytes() for path in written])
    assert found[0] == found[1]
    assert found[0][0].startswith(b"\x89PNG") and b"<svg" in found[0][1]


def test_each_case_has_a_column_with_its_errors(errors: pk.Sensitivity) -> None:
    figure = figures.errors_by_pose(errors, "title")
    assert len(figure.axes) == 4  # two cases; positions and angles
    lines = figure.axes[0].lines
    drawn = [line.get_ydata() for line in lines if line.get_linestyle() == "None"]
    np.testing.assert_array_equal(drawn[1], errors.exact[0, :, 1])
    turned = [line.get_ydata() for line in figure.axes[2].lines if line.get_linestyle() == "None"]
    np.testing.assert_allclose(turned[0], np.degrees(errors.exact[0, :, 3]))
    assert [panel.get_title() for panel in figure.axes[:2]] == ["offset1", "base*.x"]


def test_bars_are_the_means(errors: pk.Sensitivity) -> None:
    panel = figures.mean_errors(errors, "title").axes[0]
    heights = [bar.get_height() for bar in panel.patches]
    np.testing.assert_allclose(heights, errors.mean[:, :3].T.ravel())


def test_what_does_not_move_is_not_drawn() -> None:
    robot = pk.load("linear-delta")
    found = pk.sensitivity(robot, poses("linear-delta", 3), cases=["rod1"])
    figure = figures.errors_by_pose(found, "title")
    assert [panel.get_ylabel() for panel in figure.axes] == ["error [mm]"]


def test_a_map_is_drawn_inside_the_limits(plane: pk.Workspace) -> None:
    found = pk.tolerance(plane.robot, plane.poses, 0.1, samples=500)
    figure = figures.tolerance_map(found, plane)
    assert figure.axes[0].get_xlabel() == "y [mm]" and figure.axes[0].get_ylabel() == "z [mm]"
    low, high = figure.axes[1].get_ylim()
    inside = found.distance95[plane.inside]
    assert low <= inside.min() and inside.max() <= high


def test_singularities_are_drawn_where_the_determinant_vanishes(tmp_path: Path) -> None:
    robot = pk.load("rbt-6t03p")
    grid = pk.workspace(robot, {"gamma": (-2.2, 2.2, 45), "z": (-40, 40, 10)})
    figure = figures.singularities([grid], "title")
    (locus,) = [c for c in figure.axes[0].collections if list(c.levels) == [0.0]]
    gamma = np.concatenate([path.vertices for path in locus.get_paths()])[:, 0]
    for angle in (gamma.min(), gamma.max()):
        near = pk.dexterity(robot, np.add(robot.home, [0, 0, 0, 0, 0, np.radians(angle)]))
        assert near.conditioning < 0.01
    drawing.write_both(figure, tmp_path / "loci")


def test_slices_show_what_is_inside(tmp_path: Path) -> None:
    robot = pk.load("rbt-6t03p")
    ends = (-120.0, 120.0, 12)
    grid = pk.workspace(robot, {"x": ends, "y": ends, "z": (-60, 60, 10)})
    figure = figures.workspace_slices(grid, "z", count=3)
    assert len(figure.axes) == 3
    shown = sum(float(np.sum(panel.collections[0].get_array())) for panel in figure.axes)
    heights = [float(panel.get_title().split()[2]) for panel in figure.axes]
    chosen = [int(np.argmin(np.abs(grid.values[2] - height))) for height in heights]
    assert shown == grid.inside[:, :, chosen].sum()
    drawing.write_both(figure, tmp_path / "slices")


def test_grids_of_other_axes_are_refused(plane: pk.Workspace) -> None:
    with pytest.raises(ValueError, match="grid must have 3 axes, found y, z"):
        figures.workspace_slices(plane, "z")
    line = pk.workspace(plane.robot, {"z": (300, 400, 4)})
    with pytest.raises(ValueError, match="grid must have 2 axes, found z"):
        figures.singularities([line], "title")
