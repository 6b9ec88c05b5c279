"""The figures of a calibration report."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.calibration.identification import Identification
from pkmcal.display import printable
from pkmcal.report.contents import Slice, WorkspaceAccuracy
from pkmcal.report.drawing import (
    BLUE,
    FAINT,
    GREEN,
    MOST_DRAWN,
    ORANGE,
    empty_figure,
    in_context,
    sample,
)
from pkmcal.report.exaggerated import middle_exaggerated
from pkmcal.report.yielding import Yielding
from pkmcal.view.plot import lines, widen

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_WIDTH = 9.0  # inches
_LEAST = 1e-6  # mm; what a logarithmic axis begins with
_FEW = 50  # largest over least below which numbers between the powers of ten are named
_NAMED = 80  # parameters up to which a correlation picture names each


@in_context
def before_after(groups: dict[str, tuple[FloatArray, FloatArray]]) -> Figure:
    """Draw the cumulative share of points over their distance: a panel for each group.

    Parameters
    ----------
    groups : dict of str to (ndarray, ndarray)
        By title; distances before and after, mm.
    """
    figure = empty_figure(_WIDTH, 3.4)
    panels = figure.subplots(1, len(groups), sharey=True, squeeze=False)[0]
    for panel, (title, pair) in zip(panels, groups.items(), strict=True):
        for values, colour, label in zip(pair, (ORANGE, BLUE), ("before", "after"), strict=True):
            off = np.sort(np.maximum(values[np.isfinite(values)], _LEAST))
            share = 100 * (np.arange(len(off)) + 0.5) / max(len(off), 1)
            drawn = sample(len(off))
            panel.plot(share[drawn], off[drawn], marker="o", ms=3, lw=1, color=colour, label=label)
        if max(map(len, pair)) > MOST_DRAWN:
            title += f", {MOST_DRAWN} drawn"
        panel.set(title=title, xlabel="cumulative share of points [%]", xlim=(0, 100), yscale="log")
        _grid(panel)
    panels[0].set_ylabel("distance, measured from predicted [mm]")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2)
    return figure


@in_context
def machine(found: Identification) -> Figure | None:
    """Draw the nominal machine and, with its change exaggerated, the calibrated one.

    Both at the same commands; None where one has no pose.
    """
    drawn = middle_exaggerated(found)
    if drawn is None:
        return None
    figure = empty_figure(_WIDTH, 4.8)
    assumed, calibrated, times = drawn
    panels = [figure.add_subplot(1, 2, k + 1, projection="3d", proj_type="ortho") for k in range(2)]
    for panel, (elevation, turn), title in zip(
        panels, ((22, -60), (90, -90)), ("side view", "top view"), strict=True
    ):
        lines(panel, assumed, FAINT, "nominal")
        lines(panel, calibrated, BLUE, f"calibrated, change × {times}")
        panel.set_title(title, fontsize="medium")
        panel.view_init(elevation, turn)
        panel.set(xlabel="x [mm]", ylabel="y [mm]", zlabel="" if elevation == 90 else "z [mm]")
        widen(panel)
        panel.set_aspect("equal")
        panel.tick_params(labelsize="small")
        for axis in (panel.xaxis, panel.yaxis, panel.zaxis):
            axis.set_pane_color((0, 0, 0, 0))
            axis.get_major_locator().set_params(nbins=4)
        if elevation == 90:
            panel.set_zticks([])
            panel.yaxis.labelpad = 14  # beside its ticks, which stand inside from above
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2)
    return figure


@in_context
def correlation(matrix: FloatArray, names: tuple[str, ...]) -> Figure:
    """Draw the correlations of the parameters; empty where one is not identifiable.

    Parameters
    ----------
    matrix : ndarray (n, n)
        -1 to 1, NaN where there is none.
    names : tuple of str, n
        Of the parameters.
    """
    n = len(names)
    side = min(max(0.17 * n, 2.0), 0.15 * _NAMED)
    figure = empty_figure(side + 2.2, side + 1.0)  # room for names, and for the bar beside
    panel = figure.subplots()
    shown = panel.imshow(matrix, cmap="RdBu_r", vmin=-1, vmax=1)
    if n <= _NAMED:
        labels = [printable(name)[:24] for name in names]
        panel.set_xticks(range(n), labels, rotation=90, fontsize="small")
        panel.set_yticks(range(n), labels, fontsize="small")
    else:
        panel.set(xlabel="parameter, in the order of the table", ylabel="parameter")
    figure.colorbar(shown, ax=panel, label="correlation", pad=0.02)
    return figure


@in_context
def convergence(history: tuple[float, ...]) -> Figure:
    """Draw the misfit after each step of the least squares.

    Parameters
    ----------
    history : tuple of float
        rms, mm.
    """
    from matplotlib.ticker import MaxNLocator

    figure = empty_figure(_WIDTH, 2.6)
    panel = figure.subplots()
    values = np.maximum(history, _LEAST)
    panel.plot(np.arange(len(values)), values, marker="o", ms=4, lw=1, color=BLUE)
    panel.set(xlabel="step", ylabel="misfit rms [mm]", yscale="log")
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    _grid(panel)
    return figure


@in_context
def accuracy(sampled: WorkspaceAccuracy, area: Slice | None) -> Figure:
    """Draw the expected error of the machine: over a slice, and over the poses drawn."""
    figure = empty_figure(_WIDTH, 3.8)
    left, right = figure.subplots(1, 2)
    if area is not None and np.isfinite(area.accuracy).any():
        title = "one standard deviation [mm], slice through home"
        _map(left, area.axes, area.values, area.accuracy, title)
    else:
        finite = np.isfinite(sampled.accuracy)
        x, y = sampled.tools[finite, :2].T
        marks = left.scatter(x, y, c=sampled.accuracy[finite], cmap="viridis", s=12)
        figure.colorbar(marks, ax=left)
        left.set(xlabel="x [mm]", ylabel="y [mm]")
        left.set_title("one standard deviation [mm], poses from above", fontsize="medium")
    _shares(right, sampled.predicted, len(sampled.accuracy), "one standard deviation [mm]")
    return figure


@in_context
def stiffness(found: Yielding) -> Figure:
    """Draw the stiffness along the softest direction: over a slice, and over the poses drawn."""
    assert found.map is not None
    figure = empty_figure(_WIDTH, 3.8)
    left, right = figure.subplots(1, 2)
    title = "softest direction [N/mm], slice through home"
    _map(left, found.map.axes, found.map.values, found.map.softest, title)
    _shares(right, found.softest, len(found.softest), "along the softest direction [N/mm]")
    return figure


def _map(
    panel: Axes,
    axes: tuple[str, str],
    values: tuple[FloatArray, FloatArray],
    shown: FloatArray,
    title: str,
) -> None:
    """Colour a slice of the workspace by a number."""
    first, second = values
    filled = panel.pcolormesh(
        first, second, shown.T, cmap="viridis", rasterized=True, shading="nearest"
    )
    panel.figure.colorbar(filled, ax=panel)
    panel.set(xlabel=f"{axes[0]} [mm]", ylabel=f"{axes[1]} [mm]")
    panel.set_title(title, fontsize="medium")


def _shares(panel: Axes, values: FloatArray, count: int, label: str) -> None:
    """Draw numbers over the cumulative share of so many poses."""
    share = 100 * (np.arange(len(values)) + 0.5) / count
    panel.plot(share, np.sort(values), color=BLUE)
    panel.set(xlabel="cumulative share of poses [%]", ylabel=label, xlim=(0, 100))
    panel.set_ylim(bottom=0)
    _grid(panel)


@in_context
def poses(score: dict[str, Any]) -> Figure:
    """Draw AP before and after and RP of each pose of one set.

    Parameters
    ----------
    score : dict
        Of `contents.iso9283`.
    """
    figure = empty_figure(_WIDTH, 3.0)
    panel = figure.subplots()
    drawn = sample(score["poses"])
    some = "" if len(drawn) == score["poses"] else f", {len(drawn)} of {score['poses']} drawn"
    for key, colour, mark, label in (
        ("accuracy_before", ORANGE, "o", "AP before"),
        ("accuracy", BLUE, "s", "AP after"),
        ("repeatability", GREEN, "^", "RP"),
    ):
        values = np.asarray(score[key], dtype=float)[drawn]
        if np.isfinite(values).any():
            shown = np.maximum(values, _LEAST)
            panel.plot(drawn + 1, shown, ls="", marker=mark, ms=4, color=colour, label=label)
    panel.set(xlabel=f"pose and target{some}", ylabel="[mm]", yscale="log")
    panel.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    _grid(panel)
    return figure


def _grid(panel: Axes) -> None:
    from matplotlib.ticker import LogLocator

    if panel.get_yscale() == "log":
        low, high = panel.get_ylim()
        panel.yaxis.set_major_formatter("{x:g}")
        panel.yaxis.set_minor_formatter("")
        if high < _FEW * low:
            panel.yaxis.set_minor_locator(LogLocator(subs=(2, 5)))
            panel.yaxis.set_minor_formatter("{x:g}")
    panel.grid(axis="y")
