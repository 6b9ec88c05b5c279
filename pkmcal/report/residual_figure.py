"""Residuals of a calibration as a figure: by row, over the workspace, as quantiles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pkmcal.arrays import IntArray, propagate
from pkmcal.display import displayed, printable
from pkmcal.report.drawing import BLUE, GREEN, ORANGE, PINK, empty_figure, in_context, sample

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pkmcal.calibration.identification import Identification


_ARROW, _LONGEST_ARROW = 0.1, 0.25  # of the panel's width
_LOOKS = {
    "x": (BLUE, "o"),
    "y": (ORANGE, "s"),
    "z": (GREEN, "^"),
    "distance": (PINK, "D"),
    "alpha": (BLUE, "o"),
    "beta": (ORANGE, "s"),
    "gamma": (GREEN, "^"),
}


@in_context
def residuals(found: Identification) -> Figure:
    """Draw residuals row by row, over the workspace with their direction, and as quantiles.

    Of very many rows the outliers and a sample of the others; the title says so.
    """
    units = [
        unit for unit in ("mm", "rad") if any(unit in m.units for m in found.fit.equations.sets)
    ]
    figure = empty_figure(11.0, 3.0 * len(units) + 4.2)
    heights = [3.0] * len(units) + [4.2]
    grid = figure.add_gridspec(len(units) + 1, 2, height_ratios=heights)
    drawn = sample(len(found.rows), np.isin(found.rows, found.outliers))
    for k, unit in enumerate(units):
        _by_row(figure.add_subplot(grid[k, :]), found, drawn, unit)
    _over_the_workspace(figure.add_subplot(grid[-1, 0]), found, drawn)
    _quantiles(figure.add_subplot(grid[-1, 1]), found)
    title = f"{printable(found.robot.name)}: residuals of the calibration"
    if len(drawn) < len(found.rows):
        title += f", {len(drawn)} of {len(found.rows)} rows drawn"
    figure.suptitle(title)
    return figure


def _by_row(panel: Axes, found: Identification, drawn: IntArray, unit: str) -> None:
    """Draw one mark per row and component, rows that are outliers ringed."""
    from matplotlib.ticker import MaxNLocator

    equations, seen = found.fit.equations, set()
    shown = displayed(0.0, unit)[1]
    for i, (measured, residual) in enumerate(zip(equations.sets, found.residuals, strict=True)):
        own = np.flatnonzero(equations.set_of == i)
        shared = np.isin(own, drawn)
        rows = found.rows[own][shared]
        odd = np.isin(rows, found.outliers)
        for k, name in enumerate(measured.components):
            if measured.units[k] != unit:
                continue
            colour, mark = _LOOKS[name]
            values = displayed(1.0, unit)[0] * residual[shared, k]
            label = None if name in seen else name
            panel.plot(rows, values, ls="", marker=mark, ms=3.5, color=colour, label=label)
            panel.plot(rows[odd], values[odd], ls="", marker="o", ms=11, mfc="none", color="0.2")
            seen.add(name)
    panel.axhline(0.0, color="0.6", lw=0.8)
    panel.grid(axis="y")
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    panel.set(xlabel="row", ylabel=f"measured − predicted [{shown}]")
    panel.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(seen))


def _over_the_workspace(panel: Axes, found: Identification, drawn: IntArray) -> None:
    """Draw residuals at their poses: arrows in x and y, a colour for the other component."""
    equations, pose = found.fit.equations, found.fit.end.pose
    at, along, other = [], [], []
    for place, residual in zip(equations.pose_of, found.residuals, strict=True):
        at.append(pose[place, :2])
        flat = residual.shape[1] <= 1  # a height or a distance has no direction across
        along.append(np.zeros((len(residual), 2)) if flat else residual[:, :2])
        worst = found.misfit.closures[place]  # where nothing was read
        last = residual[:, -1 if flat else 2] if residual.shape[1] else worst
        other.append(last)
    (x, y), (dx, dy) = np.concatenate(at)[drawn].T, np.concatenate(along)[drawn].T
    colour = np.concatenate(other)[drawn]
    read = np.isfinite(colour) & np.isfinite(dx + dy)
    x, y, dx, dy, colour = x[read], y[read], dx[read], dy[read], colour[read]
    most = max(float(np.abs(colour).max(initial=0.0)), 1e-12)
    marks = panel.scatter(x, y, c=colour, cmap="coolwarm", vmin=-most, vmax=most, s=26, zorder=3)
    lengths = np.hypot(dx, dy)
    long = float(np.quantile(lengths, 0.9)) if len(dx) else 0.0
    margin = 0.15
    if long > 0:
        scale = max(long / _ARROW, float(lengths.max()) / _LONGEST_ARROW)  # mm by width
        share = 1.1 * float(lengths.max()) / scale  # of the panel; its height is a little less
        margin = max(margin, share / (1.0 - 2.0 * share))  # of the data: tips stay inside
        arrows = panel.quiver(
            *(x, y, dx, dy),
            angles="xy",
            scale_units="width",
            scale=scale,
            width=0.004,
            color="0.25",
            zorder=2,
        )
        panel.quiverkey(arrows, 0.12, 0.96, long, f"{long:.2g} mm", labelpos="E")
    panel.figure.colorbar(marks, ax=panel, label="z, height or distance [mm]")
    panel.set(xlabel="x [mm]", ylabel="y [mm]")
    panel.margins(margin)


def _quantiles(panel: Axes, found: Identification) -> None:
    """Draw residuals over their own deviation: on the line if noise is normal and as stated."""
    from scipy.special import ndtri

    estimate = found.fit.estimate
    weighted = (
        estimate.jacobian
        * np.sqrt(np.repeat(estimate.weights, estimate.state.loss.components))[:, None]
    )
    redundancy = 1.0 - propagate(weighted[:, None], estimate.covariance)
    checked = redundancy > 1e-6  # the others are fitted exactly, whatever was measured
    scaled = np.sort(estimate.residual[checked] / np.sqrt(redundancy[checked]))
    normal = ndtri((np.arange(len(scaled)) + 0.5) / max(len(scaled), 1))
    drawn = sample(len(scaled))
    panel.plot(normal[drawn], scaled[drawn], ls="", marker="o", ms=3.5, color=BLUE)
    ends = np.array([-3.0, 3.0])
    panel.plot(ends, ends, color="0.5", lw=0.8)
    panel.grid()
    panel.set(xlabel="normal quantile", ylabel="residual over its standard deviation")
