"""Residuals of a calibration as a figure: by row, over the workspace, as quantiles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.display import displayed, printable
from pkmcal.report.drawing import BLUE, GREEN, ORANGE, PINK, empty_figure, in_context, sample
from pkmcal.report.residual_vectors import measured_places, residual_vectors

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pkmcal.calibration.identification import Identification


_ARROW, _LONGEST_ARROW = 0.1, 0.25  # of the panel's width
_FAR = 3.0  # times the largest of the others: outliers beyond are marked at the edge
_MOST_DEVIATIONS = 10.0  # of normal residuals none is so far off
_FEW = 0.1  # of the residuals: more say that all are further off than stated
_LEAST = 1e-9  # of other lengths: arrows that nobody sees
_ROOM = 1.3  # of a panel, in the largest value that it shows
_LOOKS = ((BLUE, "o"), (ORANGE, "s"), (GREEN, "^"))
_FIRST = ("mm", "rad")  # units whose panels stand above those of others
_ALONE = (PINK, "D")  # of readings of one component


def _look(count: int, place: int, name: str) -> tuple[str, str]:
    """Colour and mark of a component, by its place among those of its unit."""
    if name == "z":  # a height is the z of a position
        return _LOOKS[2]
    return _ALONE if count == 1 else _LOOKS[place % len(_LOOKS)]


@in_context
def residuals(found: Identification) -> Figure:
    """Draw residuals row by row, over the workspace with their direction, and as quantiles.

    Of very many rows the outliers and a sample of the others; the title says so.
    """
    read = {unit for m in found.fit.equations.table.sets for unit in m.units}
    units = sorted(read, key=lambda unit: (_FIRST.index(unit) if unit in _FIRST else 2, unit))
    figure = empty_figure(11.0, 3.0 * len(units) + 4.2)
    figure.set_layout_engine("constrained", wspace=0.06)  # a bar's label stands beside a panel's
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
    by, shown = displayed(1.0, unit)
    outliers: list[FloatArray] = [np.empty((2, 0))]
    most = 0.0
    for i, (measured, residual) in enumerate(
        zip(equations.table.sets, found.residuals, strict=True)
    ):
        own = np.flatnonzero(equations.table.set_of == i)
        shared = np.isin(own, drawn)
        rows = found.rows[own][shared]
        odd = np.isin(rows, found.outliers)
        places = [k for k, each in enumerate(measured.units) if each == unit]
        for place, k in enumerate(places):
            name = measured.components[k]
            colour, mark = _look(len(places), place, name)
            values = by * residual[shared, k]
            label = None if name in seen else name
            panel.plot(rows, values, ls="", marker=mark, ms=3.5, color=colour, label=label)
            outliers.append(np.stack([rows[odd].astype(np.float64), values[odd]]))
            most = max(most, float(np.nanmax(np.abs(values[~odd]), initial=0.0)))
            seen.add(name)
    rows, values = np.concatenate(outliers, axis=1)
    _ring(panel, rows, values, most)
    panel.axhline(0.0, color="0.6", lw=0.8)
    panel.grid(axis="y")
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    panel.set(xlabel="row", ylabel=f"measured − predicted [{shown}]")
    panel.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(seen))


def _ring(panel: Axes, rows: FloatArray, values: FloatArray, most: float) -> None:
    """Ring outliers; where they are far beyond `most` at the edge, with their value."""
    far = bool(most > 0.0 and np.nanmax(np.abs(values), initial=0.0) > _FAR * most)
    edge = _ROOM * most if far else np.inf
    at = np.clip(values, -0.9 * edge, 0.9 * edge)
    panel.plot(rows, at, ls="", marker="o", ms=11, mfc="none", color="0.2")
    if not far:
        return
    panel.set_ylim(-edge, edge)
    for row, y, value in zip(rows.tolist(), at.tolist(), values.tolist(), strict=True):
        if abs(value) > edge:
            mark = "^" if value > 0 else "v"
            panel.plot(row, y, marker=mark, ms=4, color="0.2")
            panel.annotate(
                f"{value:.3g}", (row, y), (9, 0), textcoords="offset points", va="center"
            )


def _over_the_workspace(panel: Axes, found: Identification, drawn: IntArray) -> None:
    """Draw residuals where they were measured: arrows in x and y, a colour for z.

    Where no lengths were read the size of what was is the colour, and where nothing was, the
    closures.
    """
    vectors, label = residual_vectors(found.fit.equations, found.fit.end), "z [mm]"
    sizes = not np.isfinite(vectors).any()
    if sizes:
        vectors, label = _without_direction(found)
    odd = np.isin(found.rows, found.outliers)
    vectors = vectors[drawn]
    read = np.isfinite(vectors).all(axis=1)
    (x, y), odd = (
        measured_places(found.fit.equations, found.fit.end)[drawn][read, :2].T,
        odd[drawn][read],
    )
    dx, dy, colour = vectors[read].T
    usual = ~odd if (~odd).any() else np.ones(len(odd), dtype=bool)
    most = max(float(np.abs(colour[usual]).max(initial=0.0)), 1e-12)
    shades: Any = {"cmap": "coolwarm", "vmin": -most, "vmax": most}
    if sizes:
        shades = {"cmap": "viridis", "vmin": 0.0, "vmax": most}
    marks = panel.scatter(x, y, c=colour, s=26, zorder=3, **shades)
    lengths = np.hypot(dx, dy)
    long = float(np.quantile(lengths[usual], 0.9)) if len(dx) else 0.0
    margin = 0.15
    if long > _LEAST * max(most, float(lengths.max())):
        scale = max(long / _ARROW, float(lengths[usual].max()) / _LONGEST_ARROW)  # mm by width
        longest = _LONGEST_ARROW * scale
        cut = np.minimum(1.0, longest / np.maximum(lengths, 1e-300))
        share = 1.1 * min(float(lengths.max()), longest) / scale  # of the panel; its height is less
        margin = max(margin, share / (1.0 - 2.0 * share))  # of the data: tips stay inside
        arrows = panel.quiver(
            *(x, y, cut * dx, cut * dy),
            angles="xy",
            scale_units="width",
            scale=scale,
            width=0.004,
            color=np.where(cut < 1.0, ORANGE, "0.25"),
            zorder=2,
        )
        shortened = "; orange: longer" if (cut < 1.0).any() else ""
        panel.quiverkey(
            arrows, 0.12, 1.04, long, f"{long:.2g} mm{shortened}", labelpos="E", color="0.25"
        )
    panel.figure.colorbar(marks, ax=panel, label=label)
    panel.set(xlabel="x [mm]", ylabel="y [mm]")
    panel.margins(margin)


def _without_direction(found: Identification) -> tuple[FloatArray, str]:
    """Sizes of residuals (N, 3) as z, and what they are."""
    table, sizes, label = found.fit.equations.table, [], "closure [mm]"
    for m, place, residual in zip(table.sets, table.pose_of, found.residuals, strict=True):
        if residual.shape[1]:
            by, shown = displayed(1.0, m.units[0])
            sizes.append(by * np.linalg.norm(residual, axis=1))
            label = f"{'angle ' if m.units[0] == 'rad' else ''}off [{shown}]"
        else:
            sizes.append(found.closures[place])
    size = np.concatenate(sizes)
    return np.column_stack([0.0 * size, 0.0 * size, size]), label


def _quantiles(panel: Axes, found: Identification) -> None:
    """Draw residuals over their own deviation: on the line if noise is normal and as stated."""
    from scipy.special import ndtri

    estimate = found.fit.estimate
    components = found.fit.estimator.equations.blocks.components
    weights = np.repeat(estimate.weights, components)
    taken = estimate.change(estimate.half)
    redundancy = 1.0 - weights * np.einsum("ij,ij->i", taken, taken)
    checked = redundancy > 1e-6  # the others are fitted exactly, whatever was measured
    scaled = np.sort(estimate.residual[checked] / np.sqrt(redundancy[checked]))
    normal = ndtri((np.arange(len(scaled)) + 0.5) / max(len(scaled), 1))
    drawn = sample(len(scaled))
    panel.plot(normal[drawn], scaled[drawn], ls="", marker="o", ms=3.5, color=BLUE)
    ends = np.array([-3.0, 3.0])
    panel.plot(ends, ends, color="0.5", lw=0.8)
    panel.grid()
    panel.set(xlabel="normal quantile", ylabel="residual over its standard deviation")
    beyond = int((np.abs(scaled) > _MOST_DEVIATIONS).sum())
    if 0 < beyond < _FEW * len(scaled):
        near = np.abs(scaled) <= _MOST_DEVIATIONS
        edge = _ROOM * max(float(np.abs(scaled[near]).max(initial=0.0)), ends[1])
        panel.set_ylim(-edge, edge)
        panel.set_title(
            f"{beyond} of {len(scaled)} beyond ± {_MOST_DEVIATIONS:g}, not drawn", fontsize="medium"
        )
