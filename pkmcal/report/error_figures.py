"""Figures of errors and workspaces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core.library import POSE
from pkmcal.error_model.sensitivity import Sensitivity
from pkmcal.error_model.tolerance import Tolerance
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.workspace import Workspace
from pkmcal.report.drawing import BLUE, GREEN, ORANGE, empty_figure, in_context

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LETTERS = ("x", "y", "z", "α", "β", "γ")
_COLOURS = (BLUE, ORANGE, GREEN) * 2
_MARKS = ("o", "s", "^") * 2
_SEEN = 1e-9  # mm, rad: less is rounding, and not drawn


@in_context
def errors_by_pose(found: Sensitivity, title: str) -> Figure:
    """Draw Fig. 4, 6, 8: the error of each pose, a column a case; exact with marks, linear dashed.

    Parameters
    ----------
    found : Sensitivity
        At a batch of poses (N, 6).
    title : str
        Above all.
    """
    groups = _groups(found)
    columns = len(found.cases)
    figure = empty_figure(1.2 + 1.75 * columns, 0.9 + 2.2 * len(groups))
    axes = figure.subplots(len(groups), columns, sharex=True, sharey="row", squeeze=False)
    number = np.arange(1, found.exact.shape[1] + 1)
    for row, (group, unit, factor) in zip(axes, groups, strict=True):
        for panel, exact, linear in zip(row, found.exact, found.linear, strict=True):
            for k in group:
                panel.plot(number, linear[:, k] * factor, ls="--", lw=0.8, color=_COLOURS[k])
                panel.plot(
                    number,
                    exact[:, k] * factor,
                    ls="",
                    marker=_MARKS[k],
                    ms=2.6,
                    color=_COLOURS[k],
                    label=f"Δ{LETTERS[k]}",
                )
            _grid(panel)
        row[0].set_ylabel(f"error [{unit}]")
        row[-1].legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    for panel, case in zip(axes[0], found.cases, strict=True):
        panel.set_title(case, fontsize="medium")
    for panel in axes[-1]:
        panel.set_xlabel("pose")
    figure.suptitle(f"{title}\nmarks: solved exactly; dashed: linear prediction", fontsize="medium")
    return figure


@in_context
def mean_errors(found: Sensitivity, title: str) -> Figure:
    """Draw Fig. 5, 7, 9: the mean size of the error over the poses, case by case.

    Parameters
    ----------
    found : Sensitivity
        At a batch of poses.
    title : str
        Above all.
    """
    groups = _groups(found)
    columns = len(found.cases)
    figure = empty_figure(1.5 + (0.9 + 0.62 * columns) * len(groups), 3.6)
    axes = figure.subplots(1, len(groups), squeeze=False)[0]
    place = np.arange(columns)
    for panel, (group, unit, factor) in zip(axes, groups, strict=True):
        width = 0.8 / len(group)
        for i, k in enumerate(group):
            at = place + (i - (len(group) - 1) / 2) * width
            sizes = found.mean[:, k] * factor
            panel.bar(at, sizes, 0.9 * width, color=_COLOURS[k], label=f"|Δ{LETTERS[k]}|")
            linear = found.mean_linear[:, k] * factor
            label = "linear" if k == group[-1] else None
            panel.plot(at, linear, ls="", marker="_", ms=7, color="black", label=label)
        panel.set_xticks(place, found.cases, rotation=45, ha="right", rotation_mode="anchor")
        panel.set_ylabel(f"mean size of the error [{unit}]")
        panel.set_ylim(bottom=0)
        _grid(panel)
        handles, labels = panel.get_legend_handles_labels()
        panel.legend(
            handles[1:] + handles[:1],
            labels[1:] + labels[:1],
            loc="lower center",
            bbox_to_anchor=(0.5, 1.0),
            fontsize="small",
            ncols=4,
        )
    figure.suptitle(title, fontsize="medium")
    return figure


def _groups(found: Sensitivity) -> list[tuple[list[int], str, float]]:
    """Group what moves: places in x y z α β γ, the unit shown and its factor."""
    sizes = np.nan_to_num(np.abs(found.exact)).reshape(-1, 6).max(axis=0)
    groups = []
    for first, unit, factor in ((0, "mm", 1.0), (3, "deg", 180 / np.pi)):
        seen = [k for k in range(first, first + 3) if sizes[k] > _SEEN]
        if seen:
            groups.append((seen, unit, factor))
    return groups or [([0, 1, 2], "mm", 1.0)]  # nothing was solved: empty panels


@in_context
def tolerance_map(found: Tolerance, grid: Workspace, levels: int = 12) -> Figure:
    """Draw a heat map of the distance that 95 % of the machines keep within, over a slice.

    Parameters
    ----------
    found : Tolerance
        At the poses of the grid.
    grid : Workspace
        With two axes; outside its limits nothing is drawn.
    levels : int
        Steps of the colours.
    """
    _require_axes(grid, 2)
    figure = empty_figure(5.6, 4.4)
    panel = figure.subplots()
    shown = np.where(grid.inside, found.distance95, np.nan)
    filled = panel.contourf(*_plane(grid), shown.T, levels=levels, cmap="viridis")
    figure.colorbar(filled, label="95 % of the machines are within [mm]")
    _limits(panel, grid)
    panel.set_title(f"{found.robot.name}: position error", fontsize="medium")
    return figure


@in_context
def singularities(grids: list[Workspace], title: str) -> Figure:
    """Draw slices coloured by conditioning, with the singularity loci and the limits.

    Parameters
    ----------
    grids : list of Workspace
        Each with two axes.
    title : str
        Above all.
    """
    figure = empty_figure(0.8 + 3.9 * len(grids), 4.3)
    panels = figure.subplots(1, len(grids), squeeze=False)[0]
    for panel, grid in zip(panels, grids, strict=True):
        _require_axes(grid, 2)
        plane = _plane(grid)
        conditioning = grid.dexterity.conditioning
        filled = panel.contourf(*plane, conditioning.T, levels=12, cmap="viridis")
        panel.contour(*plane, grid.dexterity.determinant.T, levels=[0.0], colors=ORANGE)
        panel.patch.set(facecolor="0.85", hatch="///", edgecolor="0.7")
        _limits(panel, grid)
        figure.colorbar(filled, ax=panel, location="bottom", label="conditioning σmin/σmax")
    legend = "red: type-2 singularities; white: limits"
    if any(np.isnan(grid.dexterity.conditioning).any() for grid in grids):
        legend += "; hatched: out of reach, its edge is a type-1 singularity"
    figure.suptitle(f"{title}\n{legend}", fontsize="medium")
    return figure


@in_context
def workspace_slices(grid: Workspace, axis: str, count: int = 6) -> Figure:
    """Draw the reachable workspace with limits, as slices across one axis, and its volume.

    Parameters
    ----------
    grid : Workspace
        With three axes.
    axis : str
        The one that is cut across.
    count : int
        Slices to draw, evenly over those that are not empty.
    """
    _require_axes(grid, 3)
    place = grid.axes.index(axis)
    inside = np.moveaxis(grid.inside, place, 0)
    filled = np.flatnonzero(inside.any(axis=(1, 2)))
    if not filled.size:
        raise ArgumentError("grid: no pose of it is inside the workspace")
    spread = np.linspace(0, filled.size - 1, min(count, filled.size) + 2)[1:-1]  # not the tips
    chosen = filled[spread.round().astype(int)]
    others = [k for k in range(3) if k != place]
    figure = empty_figure(0.6 + 2.3 * len(chosen), 3.4)
    panels = figure.subplots(1, len(chosen), sharex=True, sharey=True, squeeze=False)[0]
    first, second = (_shown(grid, k) for k in others)
    for panel, k in zip(panels, chosen, strict=True):
        panel.pcolormesh(
            first, second, inside[k].T, cmap="Blues", vmin=0, vmax=1.6, rasterized=True
        )
        value = _shown(grid, place)[k]
        panel.set_title(
            f"{LETTERS[POSE.index(axis)]} = {value:.4g} {_unit(axis)}", fontsize="medium"
        )
        panel.set_xlabel(_label(grid.axes[others[0]]))
    panels[0].set_ylabel(_label(grid.axes[others[1]]))
    figure.suptitle(f"{grid.robot.name}: {str(grid).splitlines()[-1]}", fontsize="medium")
    return figure


def _grid(panel: Axes) -> None:
    panel.grid(axis="y")
    panel.axhline(0.0, color="0.6", lw=0.8)


def _require_axes(grid: Workspace, count: int) -> None:
    if len(grid.axes) != count:
        raise ArgumentError(f"grid must have {count} axes, found {', '.join(grid.axes)}")


def _plane(grid: Workspace) -> tuple[FloatArray, FloatArray]:
    return _shown(grid, 0), _shown(grid, 1)


def _shown(grid: Workspace, place: int) -> FloatArray:
    """Values of an axis in the unit that is drawn."""
    values = grid.values[place]
    return np.degrees(values) if _unit(grid.axes[place]) == "deg" else values


def _unit(axis: str) -> str:
    return "deg" if axis in POSE[3:] else "mm"


def _label(axis: str) -> str:
    return f"{LETTERS[POSE.index(axis)]} [{_unit(axis)}]"


def _limits(panel: Axes, grid: Workspace) -> None:
    """Outline of what keeps all limits, and the names of the axes."""
    inside = grid.feasibility.ok
    if inside.any() and not inside.all():
        panel.contour(*_plane(grid), inside.T.astype(float), levels=[0.5], colors="white")
    panel.set(xlabel=_label(grid.axes[0]), ylabel=_label(grid.axes[1]))
