"""Readings before the machine had arrived, or after it left, and logs that are late: a test.

Such a reading is off where the machine stops by a share of the way from the pose before, or to the
next. One number says how much; a score test of it, through the machine's own derivatives, sees what
is far below a row: trials of whole rows that are late do not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.diagnostics.check import RARE
from pkmcal.diagnostics.columns import of_rows
from pkmcal.diagnostics.visits import visits_of
from pkmcal.display import chance_text
from pkmcal.fitted.solution import Solution
from pkmcal.readings.predicted import Predicted
from pkmcal.statistics.score_test import Columns, beside

_MOST = 2.0  # ways: rows that are late by more are tried as whole rows


@dataclass(frozen=True)
class Late:
    """The lag of readings: before the machine arrived, or after it left.

    Attributes
    ----------
    share : float
        Of the way from the pose before, or to the next; negative where the actuators were read
        there and not the instrument.
    stderr : float
        Its standard deviation.
    chance : float
        How likely a share as large, of either way, would be if they were not.
    leaving : bool
        Whether it is of the way to the next pose.
    """

    share: float
    stderr: float
    chance: float
    leaving: bool

    @property
    def found(self) -> bool:
        """True if readings and actuators are of different moments."""
        return self.chance < RARE

    def __str__(self) -> str:
        odds = chance_text(self.chance)
        if self.leaving:
            way = f"{100 * abs(self.share):.2g} % of the way to the next pose"
            return (
                f"{'readings' if self.share > 0.0 else 'actuators'} are as if"
                f" {'taken' if self.share > 0.0 else 'logged'} after the machine had gone {way}"
                f" ({odds}): log both at one moment, when the machine stands; or the rows stand in"
                " the reversed order of measuring, and readings are late"
            )
        short = f"{100 * abs(self.share):.2g} % of the way from the pose before"
        if self.share > 0.0:
            return (
                f"readings are as if taken {short}, before the machine arrived ({odds}): let it"
                " settle for longer before each reading, and see that actuators and instrument are"
                " logged at one moment"
            )
        return (
            f"actuators are as if logged {short}, before the machine arrived where the instrument"
            f" read it ({odds}): log both at one moment, when the machine stands"
        )


def late(found: Solution) -> Late | None:
    """Test for late readings; None where chance explains as much, or residuals are rounding."""
    sure = found.fit.uncertainty
    if sure.rounded or not sure.equations.whitening.any_read:
        return None
    visits = visits_of(found)
    tested = {
        leaving: beside(sure.tested, _columns(found, visits.actuators, place))
        for leaving, place in ((False, visits.before), (True, visits.after))
    }
    ways = {leaving: each for leaving, each in tested.items() if each is not None}
    # shared errors make as much more likely: of what is likely without them nothing else is asked
    scores = {
        leaving: each.score() for leaving, each in ways.items() if len(ways) * each.chance < RARE
    }
    known = {
        leaving: score
        for leaving, score in scores.items()
        if score is not None and abs(score.size[0]) <= _MOST
    }
    if not known:
        return None
    leaving = min(known, key=lambda each: (known[each].chance, -known[each].drop))
    score = known[leaving]
    chance = min(1.0, len(ways) * score.chance)
    return Late(float(score.size[0]), float(score.deviation[0]), chance, leaving)


def _columns(found: Solution, actuators: FloatArray, place: IntArray) -> Columns:
    """Differentiate equations by the share of the way to other places that readings are off.

    The places are actuator readings, rows `place` (N,) of `actuators` (K, n).
    """
    fit = found.fit
    table, end = fit.equations.table, fit.estimate.evaluation
    first = np.cumsum([0, *map(len, table.sets)])

    def change(i: int, rows: slice, seen: Predicted) -> FloatArray:
        way = actuators[place[first[i] : first[i + 1]][rows]] - table.sets[i].actuators[rows]
        twists = end.machines.actuator_twists(end.states, table.pose_of[i][rows])
        return seen.by_twist @ (twists @ way[:, :, None])

    return of_rows(fit, change)
