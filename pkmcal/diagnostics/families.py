"""Check whether lengths or angles of a set are off while the others fit.

Without a stated sigma the noise of each family is what its residuals are: angles of other rows, in
another order or a column that was not filled would count as an instrument with a noise of degrees.
No instrument has that. Such residuals are far above those of the other family as arcs, and follow
from the angles themselves, or they do not fall and are larger than any error of a machine.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.diagnostics.check import Check
from pkmcal.display import displayed
from pkmcal.estimation.machine_size import machine_size, stated_size
from pkmcal.fitted.solution import Solution
from pkmcal.readings.components import Family
from pkmcal.statistics.distributions import f_tail
from pkmcal.statistics.singular_values import svd

GROSS = 0.05  # share of the machine's size by which measurements may be off before a calibration
_KEPT = 0.5  # share of a misfit that is left where the fit found nothing of it
_UNLIKE = 10.0  # times the misfit of the other family, in mm
_LEAST_ROWS = 6  # from which equal numbers are no chance
_VARIES = 1e-6  # share of the machine's size above which a predicted number varies
_CHANCE = 1e-3  # of residuals that follow from what they are of as much, if they were noise


@dataclass(frozen=True)
class UnlikeFamily:
    """A family that does not fit where another does.

    Attributes
    ----------
    number : int
        Of the set, from 0.
    family : Family
        Which.
    before, after : float
        Median misfit of a row in its unit, before and after the fit.
    ratio : float
        How many times the other family's misfit it is, in mm.
    """

    number: int
    family: Family
    before: float
    after: float
    ratio: float


def unlike_families(found: Solution) -> Iterator[UnlikeFamily]:
    """Families of sets without a stated sigma that do not fit where another does."""
    start, end, equations = found.fit.start, found.fit.end, found.fit.equations
    size, stated = machine_size(equations, end.theta), stated_size(equations)
    for i, m in enumerate(equations.table.sets):
        families = m.instrument.families
        if m.sigma is not None or len(families) < 2:
            continue
        arcs = m.instrument.arcs(m, size)
        after = [_median((end.residuals[i] * arcs)[:, list(each.columns)]) for each in families]
        for number, family in enumerate(families):
            columns = list(family.columns)
            off, other = after[number], min(np.delete(after, number))
            before = _median((start.residuals[i] * arcs)[:, columns])
            if not off > _UNLIKE * other:
                continue
            residual = end.residuals[i][:, columns]
            predicted = equations.prediction.values(end)[i][:, columns]
            largest = stated if family.unit == "mm" else size  # lengths of no size are not gross
            gross = off > GROSS * largest and off > _KEPT * before
            if gross or _follows(residual, predicted) < _CHANCE:
                arc = float(arcs[columns[0]])
                yield UnlikeFamily(i, family, before / arc, off / arc, off / max(other, 1e-300))


class Constant(NamedTuple):
    """A component that is the same number in every row: its name, and that number."""

    name: str
    unit: str
    value: float


def constant_components(found: Solution) -> Iterator[Constant]:
    """Components that are equal to the last digit where the machine says they vary."""
    end, equations = found.fit.end, found.fit.equations
    size = machine_size(equations, end.theta)
    for i, m in enumerate(equations.table.sets):
        values = m.values.reshape(len(m), -1)
        arcs = m.instrument.arcs(m, size)
        names = m.components if len(m.instrument.families) > 1 else ()
        for k, name in enumerate(names):
            seen = equations.prediction.values(end)[i][:, k]
            rows = np.isfinite(values[:, k]) & np.isfinite(seen)
            read, predicted = values[rows, k], seen[rows]
            if len(read) < _LEAST_ROWS or (read != read[0]).any():
                continue
            if float(np.ptp(predicted)) * arcs[k] > _VARIES * size:
                yield Constant(name, m.units[k], float(read[0]))


def _constant_text(found: Solution, seen: Constant) -> str:
    value, unit = displayed(seen.value, seen.unit)
    return (
        f"{seen.name} is {value:g} {unit} in every row, where the machine's varies: if it was not"
        " measured leave its column empty"
    )


def _median(residual: FloatArray) -> float:
    """Median length of rows (N, k), those left out of which anything was not read; 0 without."""
    off = np.linalg.norm(residual, axis=1)
    off = off[np.isfinite(off)]
    return float(np.median(off)) if len(off) else 0.0


def _follows(residual: FloatArray, predicted: FloatArray) -> float:
    """Return the chance of noise to follow what residuals (N, k) are of as well as these do.

    By a regression on its values, their squares and products; 1 where there are too few rows.
    """
    good = np.isfinite(residual).all(axis=1) & np.isfinite(predicted).all(axis=1)
    y, x = residual[good], predicted[good] - predicted[good].mean(axis=0)
    k = x.shape[1]
    products = [x[:, i] * x[:, j] for i in range(k) for j in range(i, k)]
    design = np.column_stack([np.ones(len(x)), x, *products])
    left, values, _ = svd(design)
    basis = left[:, values > 1e-9 * values.max(initial=0.0)]
    n, terms = basis.shape
    if n < 2 * terms:
        return 1.0
    explained = float(((basis.T @ y) ** 2).sum())
    rest = float((y**2).sum()) - explained
    ratio = (explained / terms) / (rest / (n - terms)) if rest > 0 else 1e300
    return f_tail(min(ratio, 1e300), y.shape[1] * terms, y.shape[1] * (n - terms))


def _text(found: Solution, seen: UnlikeFamily) -> str:
    after, unit = displayed(seen.after, seen.family.unit)
    before, _ = displayed(seen.before, seen.family.unit)
    several = len(found.fit.equations.table.sets) > 1
    whose = f" of measurements {seen.number + 1}" if several else ""
    return (
        f"the {seen.family.noun}{whose} are off by {after:.3g} {unit} ({before:.3g} {unit} before"
        f" the fit), {seen.ratio:.2g} times as much as the rest: look at their columns, rows,"
        " signs and order; if that is their noise, state sigma"
    )


CHECKS = (
    Check(
        name="family-off", about="lengths or angles do not fit where the others do",
        unless=("unit-errors", "constant-component"), run=unlike_families, say=_text,
    ),
    Check(
        name="constant-component",
        about="a component of poses is one number in all rows, as a column that was not measured",
        run=constant_components, say=_constant_text,
    ),
)  # fmt: skip
