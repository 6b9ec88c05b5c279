"""Check whether an instrument, or what is mounted on the platform, was moved between two poses.

A fit in which poses have unknowns takes what a moved camera shows for scatter of the actuators. It
would be explained by another frame, or another mounting, from some pose on: that is tested for
every pose.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.diagnostics.check import RARE, Check, at_most_one
from pkmcal.diagnostics.columns import of_rows
from pkmcal.diagnostics.two_machines import row_of_equation
from pkmcal.display import chance_text, displayed
from pkmcal.fitted.fit import Fit
from pkmcal.fitted.row_names import row_names
from pkmcal.fitted.solution import Solution
from pkmcal.readings.predicted import Predicted
from pkmcal.statistics.linear_fit import numbered
from pkmcal.statistics.score_test import jump
from pkmcal.statistics.weighed import Weighed

_FEWEST = 3  # poses before and after
_FEW = 10.0  # degrees of freedom below which nothing is told apart

Rows = dict[int, IntArray]  # of a place, in each set


@dataclass(frozen=True)
class MovedInstrument:
    """A thing that was elsewhere from some pose on.

    Attributes
    ----------
    thing : str
        Which, in words.
    numbers : str
        The names of the numbers of its place, as a wildcard.
    since : str
        The first row, or picture, that shows it.
    size : float
        By how much what it reads changed there, rms.
    unit : str
        Of that.
    chance : float
        How likely as much would be explained if nothing moved, times the number of things and of
        poses.
    """

    thing: str
    numbers: str
    since: str
    size: float
    unit: str
    chance: float

    @property
    def found(self) -> bool:
        """True if it was moved."""
        return self.chance < RARE

    def __str__(self) -> str:
        value, unit = displayed(self.size, self.unit)
        return (
            f"{self.thing} seems to have been moved: from {self.since} on readings are"
            f" {value:.2g} {unit} off ({chance_text(self.chance)}), which the fit has taken for"
            " scatter; fasten it and measure again, or state a session for the rows before and"
            f" after and find it in each: --per-session '{self.numbers}'"
            f" (per_session='{self.numbers}')"
        )


def moved_instrument(found: Solution) -> MovedInstrument | None:
    """Test everything that has a place of its own; None where poses have no unknowns, or too few.

    Where poses follow from the actuators residuals show it by their order: `measuring_order`.
    """
    fit, sure = found.fit, found.fit.uncertainty
    if not sure.mixed or sure.rounded or sure.tested.freedom < _FEW:
        return None
    tried = []
    visit, first = _visits(fit)
    for thing, numbers, of_frame, rows in _things(fit):
        tested = _tested(fit, found.weighed, of_frame, rows, visit)
        if tested is not None:
            tried.append((tested[0], thing, numbers, first[tested[1]], tested[2], tested[3]))
    if not tried:
        return None
    chance, thing, numbers, row, size, unit = min(tried)
    since = row_names(sure.equations.prediction.datasets, [row])
    return MovedInstrument(thing, numbers, since, size, unit, min(1.0, len(tried) * chance))


def _visits(fit: Fit) -> tuple[IntArray, IntArray]:
    """In the order of measuring the pose of each row (N,), from 0, and the first row of each."""
    equations = fit.uncertainty.equations
    time = np.concatenate([
        data.rows.astype(float) if data.measured.time is None else data.measured.time
        for data in equations.prediction.datasets
    ])  # fmt: skip
    pose = np.concatenate(equations.table.pose_of)
    begun = np.full(len(equations.table.actuators), np.inf)
    np.minimum.at(begun, pose, time)
    visit = numbered(np.argsort(np.argsort(begun, kind="stable"), kind="stable")[pose])
    order = np.lexsort((time, visit))
    first = order[np.diff(visit[order], prepend=-1) != 0]
    return visit, equations.table.rows[first]


def _things(fit: Fit) -> Iterator[tuple[str, str, bool, Rows]]:
    """Things whose place is found: in words, their numbers, whether a frame, and their rows."""
    prediction = fit.uncertainty.equations.prediction
    for of_frame, several in ((True, prediction.frames), (False, prediction.carried_things)):
        for first, rows in several.items():
            stem = prediction.parameters.names[first].rsplit(".", 1)[0]
            (one, *_) = (prediction.table.sets[i].instrument for i in rows)
            words = stem.split("@")[0].split(".")[1:]
            thing = " ".join(words) or (one.stands_by if of_frame else "what is mounted")
            stands = one.stands_by
            if of_frame and stands and stands not in words:
                thing = f"{stands} {' '.join(words)}".strip()
            yield (
                f"the {thing}" if thing else "the instrument",
                f"{stem.split('@')[0]}*",
                of_frame,
                rows,
            )


def _tested(
    fit: Fit, weighed: Weighed, of_frame: bool, rows: Rows, visit: IntArray
) -> tuple[float, int, float, str] | None:
    """Chance of a jump of a place, the visit from which on, its size and the unit of that."""
    sure = fit.uncertainty
    equations = sure.equations

    def change(i: int, some: slice, seen: Predicted) -> FloatArray:
        by = seen.by_frame if of_frame else seen.by.get(equations.prediction.carried[i])
        found = np.zeros((*seen.values.shape, 6))
        if i in rows and by is not None:
            mine = np.zeros(len(equations.table.sets[i]), dtype=bool)
            mine[rows[i]] = True
            found[mine[some]] = by[mine[some]]
        return found

    columns = np.empty((len(weighed.fit.residual), 6))
    for part, made in weighed.columns(of_rows(fit, change))():
        columns[part] = made
    own = np.concatenate([
        np.isin(np.arange(len(m)), rows.get(i, [])) for i, m in enumerate(equations.table.sets)
    ])  # fmt: skip
    named = np.unique(visit[own])
    at = np.searchsorted(named, visit[row_of_equation(sure)])
    among = np.minimum(at, len(named) - 1)
    found = jump(weighed.fit, columns, among, _FEWEST)
    if found is None:
        return None
    since, size, unit = int(named[found.at]), np.empty(0), ""
    before = 0
    for i, measured in enumerate(equations.table.sets):
        mine = visit[before : before + len(measured)] >= since
        before += len(measured)
        if i not in rows or not mine.any():
            continue
        for some, seen in equations.prediction.lots_of(i, fit.estimate.evaluation):
            off = change(i, some, seen)[mine[some]] @ found.size
            size, unit = np.append(size, (off**2).sum(axis=1)), measured.units[0]
    return found.chance, since, float(np.sqrt(np.mean(size))) if len(size) else 0.0, unit


CHECKS = (
    Check(
        name="moved-instrument", about="a camera, a board or another instrument was moved"
        " between two poses",
        levels=("doubt",), unless=("grave", "follows-loads"),
        run=lambda found: at_most_one(moved_instrument(found)),
        level_of=lambda found, seen: "doubt" if seen.found else None,
        say=lambda found, seen: str(seen),
    ),
)  # fmt: skip
