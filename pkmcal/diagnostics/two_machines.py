"""Rows of another machine: tests of sets, sessions, halves, alternating rows, any rows.

Of rows in no order the division that fits best is tested. Its chance is that of one division times
the number of all, so that the search for it makes no false alarm where noise is Gaussian.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray
from pkmcal.diagnostics.causes import beside_causes
from pkmcal.diagnostics.check import RARE
from pkmcal.diagnostics.columns import of_actuators
from pkmcal.diagnostics.reach import reach
from pkmcal.diagnostics.visits import Visits, visits_of
from pkmcal.display import chance_text, first_rows, printable
from pkmcal.estimation.uncertainty import Uncertainty
from pkmcal.fitted.solution import Solution
from pkmcal.statistics.alike import drawn_alike
from pkmcal.statistics.distributions import f_tail
from pkmcal.statistics.group_test import Groups, few_equations, group_test, within_reach
from pkmcal.statistics.linear_fit import ROUNDING, LinearFit, numbered, orthonormal, reweighted
from pkmcal.statistics.two_regressions import best_division
from pkmcal.statistics.weighed import Weighed

_LARGE = 0.8  # times the residuals, above which errors of a model may be as large
_FAR = 0.7  # times the residuals, below which rows in no order, or elsewhere, are of another
_MOST = 300  # visits of which such rows are looked for
_OWN = 1.5  # equations for each parameter of such a group
_SHARE = 0.15  # of the visits, that are no outliers
_APART = 0.3  # of the variance of belonging to the group that the actuators explain


@dataclass(frozen=True)
class Apart:
    """The group of rows that numbers of the other rows fit worst.

    Attributes
    ----------
    group : str
        Which rows, in words.
    chance : float
        How likely a difference as large would be if all rows were of one machine, times the number
        of groups that were tested.
    residual : float
        Standard deviation of the residuals with numbers of its own, over that with common ones.
    elsewhere : bool
        Whether it was measured at other places than the other rows, or of other things: then a
        model that is slightly wrong shows alike, as long as it misses no more than the noise.
    """

    group: str
    chance: float
    residual: float
    elsewhere: bool

    @property
    def large(self) -> bool:
        """True if the difference is larger than a slightly wrong model shows."""
        return self.residual < (_FAR if self.elsewhere else _LARGE)

    @property
    def found(self) -> bool:
        """True if the rows are of another machine."""
        return self.chance < RARE

    def __str__(self) -> str:
        if self.elsewhere:
            return (
                f"fitted apart, {self.group} and the other rows, which were measured at other"
                f" places, leave residuals {self.residual:.2g} times as large"
                f" ({chance_text(self.chance)}): the model misses something there, or the machine"
                " was changed meanwhile; poses in another order would tell"
            )
        return (
            f"{self.group} and the other rows seem to come from two machines: fitted apart, they"
            f" leave residuals {self.residual:.2g} times as large ({chance_text(self.chance)})."
            " Were files joined, or was the machine changed meanwhile? Calibrate each by itself, or"
            " find what changed by session"
        )


def apart(found: Solution) -> Apart | None:
    """Test all groups; None where residuals are rounding errors, or too few."""
    sure = found.fit.uncertainty
    if sure.rounded or not sure.equations.whitening.any_read:
        return None
    visits = visits_of(found)
    use, key = equations_of_visits(found, visits)
    weighed = weighed_alike(found)
    seen = _apart(found, weighed.fit, visits, use, key)
    if seen is None or not seen.found:
        return seen
    explained = beside_causes(found, weighed, seen.residual)
    return seen if explained is None else _apart(found, explained, visits, use, key)


def _apart(
    found: Solution, fit: LinearFit, visits: Visits, use: IntArray, key: IntArray
) -> Apart | None:
    """Test groups that are known beforehand; then any rows, where that is not large."""
    groups = dict(_groups(found, visits))
    seen = _of_groups(found, fit, groups, visits, use, key)
    if seen is not None and seen.found:
        drawn = (_of_groups(found, each, groups, visits, use, key)
                 for each in _drawn_alike(found, fit, visits, use))  # fmt: skip
        seen = _unless_as_likely(seen, drawn)
        if seen.found and seen.large:
            return seen
    other = _in_no_order(found, fit, visits, use, key)
    if other is None or not other.found:
        return seen
    drawn = (_in_no_order(found, each, visits, use, key)
             for each in _drawn_alike(found, fit, visits, use))  # fmt: skip
    other = _unless_as_likely(other, drawn)
    return other if other.found else seen


def _of_groups(
    found: Solution, fit: LinearFit, groups: Mapping[str, BoolArray], visits: Visits,
    use: IntArray, key: IntArray,
) -> Apart | None:  # fmt: skip
    """Test groups that are known beforehand, and return the one that fits worst."""
    known = tested(found, fit, groups, use, key)
    if not known:
        return None
    name = min(known, key=lambda each: known[each].chance)
    best = known[name]
    chance = min(1.0, len(known) * best.chance)
    return Apart(name, chance, best.apart, _elsewhere(found, groups[name], visits))


def _unless_as_likely(seen: Apart, drawn: Iterator[Apart | None]) -> Apart:
    """The difference, with the chance that draws of one machine show; tests of it stop at one."""
    count = 1
    for other in drawn:
        if other is not None and other.chance <= seen.chance:
            return replace(seen, chance=max(seen.chance, 1.0 / count))
        count += 1
    return seen


def _drawn_alike(
    found: Solution, fit: LinearFit, visits: Visits, use: IntArray
) -> Iterator[LinearFit]:
    """Fits of residuals as of one machine."""
    sure = found.fit.uncertainty
    visit = numbered(visits.series, visits.visit)[row_of_equation(sure)][use]
    by_actuator = None if sure.mixed else _by_actuator(found)
    return drawn_alike(fit, use, numbered(visit), sure.blocks.component[use], by_actuator)


def _by_actuator(found: Solution) -> FloatArray | None:
    """What each actuator moves of equations (M, n); None where poses have unknowns."""
    count = found.fit.estimate.evaluation.actuators.shape[1]
    columns = of_actuators(found.fit, lambda poses: np.tile(np.eye(count), (len(poses), 1, 1)))
    if columns is None:
        return None
    parts = [some for _, some in weighed_alike(found).columns(columns)()]
    return np.concatenate(parts) if parts else None


def equations_of_visits(found: Solution, visits: Visits) -> tuple[IntArray, IntArray]:
    """Equations (u,) without outliers and idle ones, and the visit and the component of each.

    Of mixtures each stands for itself: components of two poses are unlike.
    """
    sure = found.fit.uncertainty
    row = row_of_equation(sure)
    odd = np.isin(sure.equations.table.rows, found.outliers)
    if sure.mixed:
        block = sure.blocks.block_of_row
        use = sure.fit.without_idle(np.flatnonzero(~np.isin(sure.blocks.row, block[odd])))
        return use, np.arange(len(use))
    use = sure.fit.without_idle(np.flatnonzero(~odd[row]))
    visit = visits.series[row][use], visits.visit[row][use]
    return use, numbered(*visit, sure.blocks.component[use])


def row_of_equation(sure: Uncertainty) -> IntArray:
    """Row of each equation (M,), of a mixture the first of its pose."""
    row: IntArray = sure.blocks.row
    if not sure.mixed:
        return row
    block, first = np.unique(sure.blocks.block_of_row, return_index=True)
    counted: IntArray = first[block >= 0][row]
    return counted


def tested(
    found: Solution, fit: LinearFit, groups: Mapping[str, BoolArray], use: IntArray, key: IntArray
) -> dict[str, Groups]:
    """Test each group of rows (N,) against the others; without those too small to be tested.

    `fit` is that of `weighed_alike`.
    """
    sure = found.fit.uncertainty
    row = row_of_equation(sure)
    cell = np.zeros(len(row), dtype=np.intp)
    for mine in groups.values():
        cell = numbered(cell, mine[row].astype(np.intp))
    few = few_equations(fit.design, fit.residual, use, key, cell, reach(sure, fit))
    first = np.unique(cell, return_index=True)[1]  # an equation of each cell
    every = {name: few.tested(mine[row][first][few.cell]) for name, mine in groups.items()}
    return {name: each for name, each in every.items() if each is not None}


def weighed_alike(found: Solution) -> Weighed:
    """`Solution.weighed`, in which sets whose noise nobody stated have it in common."""
    sure = found.fit.uncertainty
    system = sure.equations.system
    if system is None or sure.blocks.unstated.all():
        return _with_sets_alike(sure)
    return found.weighed


def _with_sets_alike(sure: Uncertainty) -> Weighed:
    """The fit in which sets whose noise nobody stated have that of the same component of others.

    A set of another machine may have got a noise that is what common numbers miss of it: then it
    would say too little of numbers of its own.
    """
    (fit, beyond), equations = sure.of_own_deviations, sure.equations
    if sure.mixed or len(equations.table.sets) == 1 or equations.whole is not None:
        return sure.weighed
    group = equations.whitening.of_equations(equations.whitening.groups)
    unstated = equations.blocks.unstated[group]
    own = np.where(unstated, np.log(sure.factors[group]), 0.0)
    alike = numbered(sure.blocks.component, unstated.astype(np.intp))
    common = (np.bincount(alike, own) / np.bincount(alike))[alike]
    if np.allclose(own, common):
        return sure.weighed
    deviations = np.exp(common - own)
    before = 1.0 if sure.own_deviations is None else sure.own_deviations
    return Weighed(reweighted(fit, deviations, beyond)[0], before * deviations)


def _in_no_order(
    found: Solution, fit: LinearFit, visits: Visits, use: IntArray, key: IntArray
) -> Apart | None:
    """Test the division of the visits into two groups that fits best."""
    sure = found.fit.uncertainty
    row = row_of_equation(sure)
    visit = numbered(visits.series, visits.visit)[row]
    chosen = np.unique(visit[use])
    chosen = chosen[:: max(1, -(-len(chosen) // _MOST))]
    among = np.isin(visit[use], chosen)
    use, key = use[among], key[among]
    few = few_equations(fit.design, fit.residual, use, key, visit, reach(sure, fit))
    unit = numbered(few.cell)
    mine = best_division(few.design, few.residual, unit)
    width = few.design.shape[1]
    count = int(few.counts.sum())
    share = mine[unit].mean()
    if min(share, 1.0 - share) * count < _OWN * width or mine.mean() < _SHARE:
        return None
    reached = within_reach(few.design, few.residual, mine[unit], few.reach)
    tested = group_test(reached, few.residual, mine[unit], count)
    if tested is None or tested.apart > _FAR:
        return None
    chance = min(1.0, tested.chance * 2.0 ** (len(mine) - 1))
    belongs = np.isin(visit, np.unique(visit[use])[mine])
    rows = np.zeros(len(sure.equations.table.rows), dtype=bool)
    rows[row[belongs]] = True
    group = f"rows {first_rows(sure.equations.table.rows[rows].tolist(), 6)}"
    return Apart(group, chance, tested.apart, _elsewhere(found, rows, visits))


def _elsewhere(found: Solution, mine: BoolArray, visits: Visits) -> bool:
    """Return whether rows (N,) were measured at other places, loads or targets than the rest.

    Places and loads that differ explain much of who belongs to the group, linearly. Each visit
    counts once, however many rows it has.
    """
    table = found.fit.equations.table
    first = np.unique(numbered(visits.series, visits.visit), return_index=True)[1]
    every = [m.actuators for m in table.sets]
    actuators = every[0] if len(every) == 1 else np.concatenate(every)
    tried = [(actuators[first], mine[first])]
    if len(table.sets) == 1:
        subject = table.sets[0].instrument.subject(len(mine))
        tried.append((subject[:, None] == np.unique(subject), mine))
    if all(m.load is not None for m in table.sets):
        load = np.concatenate([m.drive_state.load for m in table.sets])
        tried.append((load[first], mine[first]))
    return any(_explained(columns, belongs) for columns, belongs in tried)


def _explained(columns: FloatArray, mine: BoolArray) -> bool:
    """Return whether columns (N, k) explain who belongs to a group, much and not by chance."""
    belongs = mine - mine.mean()
    columns = columns[:, (columns != columns[0]).any(axis=0)].astype(np.float64, copy=False)
    if not columns.size or not belongs.any():
        return False
    columns -= columns.mean(axis=0)
    along = (belongs @ columns) @ orthonormal(columns)
    ways = len(along)
    freedom = max(1, len(mine) - ways - 1)
    missing = 1.0 - float((along**2).sum() / (belongs**2).sum())
    ratio = (1.0 - missing) / ways * freedom / max(missing, ROUNDING)
    much = 1.0 - missing * (len(mine) - 1) / freedom > _APART
    return much and f_tail(ratio, ways, freedom) < RARE


def _groups(found: Solution, visits: Visits) -> Iterator[tuple[str, BoolArray]]:
    """Groups of rows (N,) that may be of another machine, and what they are called."""
    equations = found.fit.equations
    yield "every second pose", visits.visit % 2 == 1
    yield "the second half of the rows", 2 * visits.visit >= visits.visits
    several = len(equations.table.sets) > 1
    for i, m in enumerate(equations.table.sets):
        mine = equations.table.set_of == i
        if several and m.components:
            yield printable(m.file or f"measurements {i + 1}"), mine
        if m.session is None or found.sessions:
            continue
        for name in m.sessions if len(m.sessions) > 1 else ():
            of_session = mine.copy()
            of_session[mine] = m.session == name
            yield f"session {printable(name)}", of_session
