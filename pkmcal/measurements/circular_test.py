"""The ball bar's report: how round a machine's circles are, after ISO 230-4:2005."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import number
from pkmcal.arrays import FloatArray, as_rows
from pkmcal.display import Table
from pkmcal.exceptions import ArgumentError
from pkmcal.result import Result

_LEAST = 4  # points of a path: three lie on a circle whatever they are
_FULL = np.pi / 6  # largest gap of a full circle that is sampled


@dataclass(frozen=True, eq=False, repr=False)
class CircularTest(Result):
    """Circular test: roundness of paths that were to be circles; mm.

    Attributes
    ----------
    deviation : tuple of float
        Circular deviation G of each path, in the order given: the largest less the smallest
        distance from the centre of its least-squares circle.
    bidirectional : float
        Bi-directional circular deviation G(b): the same of both paths about one centre, that of
        the least-squares circle of all points. NaN where one was given.
    radial : tuple of (float, float)
        Radial deviation F of each path: the largest and the smallest distance from the instrument's
        centre, or from that of the least-squares circle, less the nominal radius.
    mean_radial : float
        Mean bi-directional radial deviation D: the mean radius of both paths less the nominal one.
        NaN unless both are full circles.
    centre : ndarray (2,)
        Of the least-squares circle of all points.
    radius : float
        Its radius.
    nominal : float
        The radius that was commanded.
    full : bool
        Whether every path goes all round, in steps of 30 degrees or less.
    """

    deviation: tuple[float, ...]
    bidirectional: float
    radial: tuple[tuple[float, float], ...]
    mean_radial: float
    centre: FloatArray
    radius: float
    nominal: float
    full: bool

    def _parts(self) -> Iterator[str | Table]:
        shape = "full circles" if self.full else "arcs"
        yield f"{len(self.deviation)} paths, {shape} of radius {self.nominal:g} mm, after ISO 230-4"
        heads = ["[mm]", *(f"path {i + 1}" for i in range(len(self.deviation))), "both"]
        both = [self.bidirectional, np.nan, np.nan, self.mean_radial]
        rows = zip(
            ("circular deviation G", "radial deviation, most", "least", "mean radial deviation D"),
            (
                self.deviation,
                [most for most, _ in self.radial],
                [least for _, least in self.radial],
                [np.nan] * len(self.radial),
            ),
            both,
            strict=True,
        )
        cells = [[name, *map(_cell, [*own, of_both])] for name, own, of_both in rows]
        yield Table(heads, cells, left=1)


def _cell(value: float) -> str:
    return "" if np.isnan(value) else f"{value:.4f}"


def circular_test(
    path: ArrayLike, other: ArrayLike | None = None, *, radius: float, centred: bool = True
) -> CircularTest:
    """Report a circular test of a ball bar or another instrument.

    Parameters
    ----------
    path : array_like (N, 2)
        Where the machine went, in the plane of the circle, about the instrument's centre, mm. A
        ball bar that reads a radius ρ at an angle φ was at ρ cos φ, ρ sin φ.
    other : array_like (M, 2), optional
        The same in the other direction of contouring.
    radius : float
        Nominal, mm.
    centred : bool
        Whether the radial deviation is from the least-squares centre of each path, as the standard
        allows for full circles; else from the instrument's.

    Returns
    -------
    CircularTest

    Raises
    ------
    ValueError, TypeError
        Fewer than four points, points of a line, or arcs whose radial deviation is to be centred.

    Notes
    -----
    After ISO 230-4:2005 G may be evaluated as the maximum radial range around the centre of the
    least-squares circle, which is done here; the least zone of two concentric circles is never
    larger.

    Examples
    --------
    >>> angle = np.linspace(0, 2 * np.pi, 360, endpoint=False)
    >>> oval = np.column_stack([100.01 * np.cos(angle), 99.99 * np.sin(angle)])
    >>> found = circular_test(oval, radius=100.0)
    >>> round(found.deviation[0], 6), tuple(round(each, 6) for each in found.radial[0])
    (0.02, (0.01, -0.01))
    """
    nominal = number("radius", radius, above=0)
    given = {"path": path} | ({} if other is None else {"other": other})
    paths = [_points(name, points) for name, points in given.items()]
    centres = [_least_squares(points)[0] for points in paths]
    distances = [_away(points, own) for points, own in zip(paths, centres, strict=True)]
    centre, size = _least_squares(np.concatenate(paths))
    full = all(_goes_round(points, own) for points, own in zip(paths, centres, strict=True))
    if centred and not full:
        raise ArgumentError(
            "path: an arc has no least-squares centre that radial deviations may be counted from:"
            " give centred=False"
        )
    counted = distances if centred else [_away(points, np.zeros(2)) for points in paths]
    off = [each - nominal for each in counted]
    several = len(paths) > 1
    radii = [each.mean() for each in distances]
    return CircularTest(
        deviation=tuple(float(np.ptp(each)) for each in distances),
        bidirectional=float(np.ptp(_away(np.concatenate(paths), centre))) if several else np.nan,
        radial=tuple((float(each.max()), float(each.min())) for each in off),
        mean_radial=float(np.mean(radii)) - nominal if several and full else np.nan,
        centre=centre,
        radius=size,
        nominal=nominal,
        full=full,
    )


def _points(name: str, given: ArrayLike) -> FloatArray:
    points, shape = as_rows(name, given, 2)
    if len(shape) != 1 or len(points) < _LEAST or not np.isfinite(points).all():
        raise ArgumentError(
            f"{name} must be {_LEAST} or more finite points (N, 2); found {np.shape(given)}"
        )
    return points


def _away(points: FloatArray, centre: FloatArray) -> FloatArray:
    distance: FloatArray = np.linalg.norm(points - centre, axis=1)
    return distance


def _least_squares(points: FloatArray) -> tuple[FloatArray, float]:
    """Centre and radius of the circle from which points are off least, radially."""
    from scipy.optimize import least_squares

    middle = points.mean(axis=0)
    near = points - middle
    lever = np.column_stack([2.0 * near, np.ones(len(near))])
    start, _, rank, _ = np.linalg.lstsq(lever, (near**2).sum(axis=1), rcond=1e-12)
    if rank < 3:
        raise ArgumentError("path: its points lie on a line, or are one")
    size = float(np.sqrt(start[2] + start[:2] @ start[:2]))
    found = least_squares(
        lambda x: _away(near, x[:2] * size) / size - x[2],
        [*start[:2] / size, 1.0],
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
    )
    return middle + found.x[:2] * size, float(found.x[2] * size)


def _goes_round(points: FloatArray, centre: FloatArray) -> bool:
    angle = np.sort(np.arctan2(*(points - centre).T[::-1]))
    gaps = np.diff(angle, append=angle[0] + 2 * np.pi)
    return bool(gaps.max() <= _FULL)
