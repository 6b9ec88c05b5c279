"""Check whether what a fit leaves changes with the order of measuring, as where something moved."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.diagnostics.check import CHANCE
from pkmcal.display import chance_text, displayed, printable
from pkmcal.estimation.fit_data import FitData
from pkmcal.fitted.fit import Fit
from pkmcal.fitted.row_names import row_names
from pkmcal.statistics.linear_fit import means, numbered
from pkmcal.statistics.order_test import Course, Series

_FEWEST = 8  # visits of a series
_MOST = 0.5  # of the residuals' variance, from which they are little else


@dataclass(frozen=True)
class MeasuringOrder:
    """Change of residuals with the order of measuring, in the series where it is largest.

    A series are the rows of one file, or of one session or touched point in it, in the order of the
    column `time`, or of the rows where there is none.

    Attributes
    ----------
    components : tuple of str
        What was read: x, y, z of positions.
    shift : tuple of float
        How far each went: at `jump`, or between its highest and lowest; mm and rad.
    scatter : tuple of float
        Standard deviation of one visit of a pose beside that.
    units : tuple of str
        Of each.
    chance : float
        How likely as much would be if nothing moved, by the test of `statistics.order_test`, times
        the number of series.
    share : float
        Of the residuals' variance that is in it, in the component in which it is most.
    jump : str
        The row from which on all are displaced, in words, where a jump explains most; else "".
    visits : int
        How many poses there were one after the other.
    series : str
        Which file or session, where there are several.
    by_place : bool
        Whether where the machine was explains as much: it was measured place after place.
    """

    components: tuple[str, ...]
    shift: tuple[float, ...]
    scatter: tuple[float, ...]
    units: tuple[str, ...]
    chance: float
    share: float
    jump: str
    visits: int
    series: str
    by_place: bool = False

    @property
    def found(self) -> bool:
        """True if residuals follow the order."""
        return self.chance < CHANCE

    @property
    def large(self) -> bool:
        """True if the order of measuring explains most of the residuals."""
        return self.found and self.share > _MOST and not self.by_place

    def _counted(self) -> list[int]:
        """Components that are lengths, or all where none is."""
        lengths = [k for k, unit in enumerate(self.units) if unit == "mm"]
        return lengths or list(range(len(self.units)))

    def __str__(self) -> str:
        counted = self._counted()
        size = float(np.linalg.norm([self.shift[k] for k in counted]))
        value, unit = displayed(size, self.units[counted[0]])
        most = self.components[max(counted, key=lambda k: abs(self.shift[k]))]
        along = "" if len(counted) == 1 else f", most of it {most}"
        where = f" from {self.jump} on" if self.jump else " in the course of measuring"
        of = f" of {self.series}" if self.series else ""
        if self.by_place:
            return (
                f"residuals{of} follow where the machine was ({chance_text(self.chance)}), up to"
                f" {value:.3g} {unit}{along}, and it was measured place after place: the model"
                " misses something there, or all drifted; poses in another order would tell"
            )
        return (
            f"residuals{of} are as if readings had shifted by {value:.3g} {unit}{where}{along}"
            f" ({chance_text(self.chance)}): machine or instrument moved meanwhile, or the model is"
            " wrong where the machine was then; measure some poses again at the end"
        )


def measuring_order(fit: Fit, odd: Collection[int]) -> MeasuringOrder | None:
    """Test the fitted rows of each series.

    None where none is long enough, rows are mixtures, or residuals rounding errors.

    Parameters
    ----------
    fit : Fit
        The fit.
    odd : collection of int
        Outliers, which are left out.
    """
    if fit.uncertainty.mixed or fit.uncertainty.rounded:
        return None
    visits = _visits(fit, odd)
    if not len(visits.row):
        return None
    tested = [_tested(visits, series) for series in range(len(visits.names))]
    known = [each for each in tested if each is not None]
    if not known:
        return None
    series, first, course = min(known, key=lambda each: each[2].chance)
    by_place = course.chance * len(known) < CHANCE and _place_explains(fit, visits, series)
    names, units = zip(*_components(fit).items(), strict=True)
    read = np.flatnonzero(course.scatter)
    at = [] if course.jump is None else [visits.row[first + course.jump]]
    return MeasuringOrder(
        components=tuple(names[k] for k in read),
        shift=tuple(course.shift[read].tolist()),
        scatter=tuple(course.scatter[read].tolist()),
        units=tuple(units[k] for k in read),
        chance=min(1.0, len(known) * course.chance),
        share=course.share,
        jump=row_names(fit.equations.prediction.datasets, at),
        visits=len(course.values),
        series=visits.names[series] if len(visits.names) > 1 else "",
        by_place=by_place,
    )


def _place_explains(fit: Fit, visits: _Visits, series: int) -> bool:
    """Return whether nothing is left of the course beside a quadratic function of the place."""
    place = fit.end.pose[np.concatenate(fit.equations.table.pose_of)[visits.place], :3]
    place = (place - place.mean(axis=0)) / max(float(np.ptp(place, axis=0).max()), 1e-300)
    products = [place[:, i] * place[:, j] for i in range(3) for j in range(i, 3)]
    functions = np.column_stack([place, *products])[visits.visit]
    added = visits.by_component[:, :, None] * functions[:, None]
    design = np.hstack([visits.design, added.reshape(len(added), -1)])
    tested = _tested(replace(visits, design=design), series)
    return tested is not None and tested[2].chance > CHANCE


@dataclass(frozen=True, eq=False)
class _Visits:
    """Rows between which the machine was nowhere else, in the order of measuring, as one."""

    names: tuple[str, ...]  # of the series
    series: IntArray  # (V,)
    row: IntArray  # the first of each, by its number
    place: IntArray  # it, by its place among the fitted rows
    visit: IntArray  # (E,) of each equation, components of a visit averaged
    design: FloatArray
    residual: FloatArray
    by_component: FloatArray


def _visits(fit: Fit, odd: Collection[int]) -> _Visits:
    sure, equations = fit.uncertainty, fit.uncertainty.equations
    series, names = _series(equations.prediction.datasets)
    time = np.concatenate([
        data.rows.astype(float) if data.measured.time is None else data.measured.time
        for data in equations.prediction.datasets
    ])  # fmt: skip
    use = ~np.isin(equations.table.rows, list(odd))
    order = np.lexsort((equations.table.rows, time, series))
    order = order[use[order]]
    pose = sure.blocks.pose_of_row
    new = (np.diff(pose[order], prepend=-1) != 0) | (np.diff(series[order], prepend=-1) != 0)
    visit = np.full(len(time), -1)
    visit[order] = np.cumsum(new) - 1
    first = order[new]
    blocks = sure.blocks
    mine = visit[blocks.row] >= 0
    of_equation = visit[blocks.row][mine]
    key = numbered(of_equation, blocks.component[mine])
    alone = np.array_equal(key, np.arange(len(mine)))  # there is nothing to average
    if not alone:
        of_equation = of_equation[np.unique(key, return_index=True)[1]]

    def averaged(part: FloatArray) -> FloatArray:
        return part if alone else means(part[mine], key)

    weighed = sure.weighed
    return _Visits(
        names=names,
        series=series[first],
        row=equations.table.rows[first],
        place=first,
        visit=of_equation,
        design=averaged(weighed.fit.design),
        residual=averaged(weighed.fit.residual[:, None])[:, 0],
        by_component=averaged(weighed.weigh(_by_component(fit))),
    )


def _series(datasets: Sequence[FitData]) -> tuple[IntArray, tuple[str, ...]]:
    """The series of each row (N,), and their names: files, sessions in them, what was touched."""
    found: list[IntArray] = []
    names: list[str] = []
    for i, data in enumerate(datasets):
        m = data.measured
        if m.session is None and m.touched is None:
            found.append(np.full(len(m), len(names), dtype=np.intp))
            names.append(printable(m.file or f"measurements {i + 1}"))
            continue
        columns = [each.tolist() for each in (m.session, m.touched) if each is not None]
        labels = list(zip(*columns, strict=True))
        numbers = {each: len(names) + k for k, each in enumerate(dict.fromkeys(labels))}
        found.append(np.array([numbers[each] for each in labels], dtype=np.intp))
        names += [printable(", ".join(each)) for each in numbers]
    return np.concatenate(found), tuple(names)


def _components(fit: Fit) -> dict[str, str]:
    """Return the components that were read, of all sets, and their unit."""
    sets = fit.uncertainty.equations.table.sets
    return {n: u for m in sets for n, u in zip(m.components, m.units, strict=True)}


def _by_component(fit: Fit) -> FloatArray:
    """Differentiate equations (M, k) by what was read, by component, mm or rad."""
    equations = fit.uncertainty.equations
    numbers = {n: k for k, n in enumerate(_components(fit))}
    parts = []
    for m in equations.table.sets:
        one = np.eye(len(numbers))[[numbers[n] for n in m.components]]
        parts.append(np.tile(one, (len(m), 1, 1)))
    return equations.whitening.whiten(parts, fit.uncertainty.factors)


def _tested(visits: _Visits, series: int) -> tuple[int, int, Course] | None:
    """Return the tested series, its first visit and its course; None where it is too short."""
    own = np.flatnonzero(visits.series == series)
    if len(own) < _FEWEST:
        return None
    visit = visits.visit
    if len(own) < len(visits.series):
        within = (visit >= own[0]) & (visit <= own[-1])
        visit = np.where(within, visit - own[0], -1)
    tested = Series(visits.design, visits.residual, visits.by_component, visit)
    course = tested.course()
    if course is None:
        return None
    return series, int(own[0]), tested.jumped(course) if course.chance < CHANCE else course
