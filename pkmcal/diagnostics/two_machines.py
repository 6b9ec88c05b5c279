"""Whether some of the rows are of another machine: sets, sessions, halves, rows in turn."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import BoolArray
from pkmcal.diagnostics.visits import Visits, visits_of
from pkmcal.display import chance_text, printable
from pkmcal.fitted.solution import Solution
from pkmcal.statistics.group_test import few_equations, group_test
from pkmcal.statistics.linear_fit import numbered

CHANCE = 1e-3  # below which a group of rows is of another machine


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
    """

    group: str
    chance: float
    residual: float

    @property
    def found(self) -> bool:
        """Whether it is of another machine."""
        return self.chance < CHANCE

    def __str__(self) -> str:
        return (
            f"{self.group} and the other rows are as if of two machines: with numbers of its own"
            f" each has {self.residual:.2g} times the residuals ({chance_text(self.chance)}). Were"
            " files joined, or was the machine changed meanwhile? Calibrate each by itself, or find"
            " what changed by session"
        )


def apart(found: Solution) -> Apart | None:
    """Test all groups; None where rows are mixtures, residuals rounding errors, or too few."""
    sure = found.fit.uncertainty
    if sure.mixed or sure.rounded or not sure.equations.whitening.any_read:
        return None
    visits = visits_of(found)
    row = sure.labels.row
    use = np.flatnonzero(~np.isin(sure.equations.table.rows, found.outliers)[row])
    key = numbered(visits.series[row][use], visits.visit[row][use], sure.labels.component[use])
    groups = dict(_groups(found, visits))
    cell = np.zeros(len(row), dtype=np.intp)
    for mine in groups.values():
        cell = numbered(cell, mine[row].astype(np.intp))
    few = few_equations(sure.fit.design, sure.fit.residual, use, key, cell)
    first = np.unique(cell, return_index=True)[1]  # an equation of each cell
    tested = {
        name: group_test(few.design, few.residual, mine[row][first][few.cell], few.count)
        for name, mine in groups.items()
    }
    known = {name: each for name, each in tested.items() if each is not None}
    if not known:
        return None
    name = min(known, key=lambda each: known[each].chance)
    best = known[name]
    return Apart(name, min(1.0, len(known) * best.chance), best.apart)


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
