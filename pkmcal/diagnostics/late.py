"""Whether readings were taken before the machine had arrived, or logs are not of one moment.

Such a reading is short of where the machine stops by a share of the way from the pose before. One
number says how much; a score test of it, through the machine's own derivatives, sees what is far
below a row: trials of whole rows that are late do not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.diagnostics.visits import visits_of
from pkmcal.display import chance_text
from pkmcal.fitted.solution import Solution
from pkmcal.statistics.score_test import score_test

CHANCE = 1e-3  # below which readings are late


@dataclass(frozen=True)
class Late:
    """By how much readings are late.

    Attributes
    ----------
    share : float
        Of the way from the pose before; negative where the actuators were read too early.
    stderr : float
        Its standard deviation.
    chance : float
        How likely a share as large would be if they were not.
    """

    share: float
    stderr: float
    chance: float

    @property
    def found(self) -> bool:
        """Whether one of them is of another moment."""
        return self.chance < CHANCE

    def __str__(self) -> str:
        short = f"{100 * abs(self.share):.2g} % of the way from the pose before"
        odds = chance_text(self.chance)
        if self.share > 0.0:
            return (
                f"readings are as if taken {short} before the machine arrived ({odds}): let it"
                " settle for longer before each reading, and see that actuators and instrument are"
                " logged at one moment"
            )
        return (
            f"actuators are as if logged {short} before the machine arrived where the instrument"
            f" read it ({odds}): log both at one moment, when the machine stands"
        )


def late(found: Solution) -> Late | None:
    """Test it; None where rows are mixtures, or residuals rounding errors."""
    sure = found.fit.uncertainty
    if sure.mixed or sure.rounded or not sure.equations.whitening.any_read:
        return None
    score = score_test(sure.fit, _columns(found))
    if score is None:
        return None
    return Late(float(score.size[0]), float(score.deviation[0]), score.chance)


def _columns(found: Solution) -> FloatArray:
    """How equations (M, 1) change with the share of the way that all readings are late by."""
    fit = found.fit
    sure, equations, end = fit.uncertainty, fit.equations, fit.end
    way = visits_of(found).before - np.concatenate([m.actuators for m in equations.table.sets])
    twists = end.machines.actuator_twists(end.states)[np.concatenate(equations.table.pose_of)]
    back = np.split(
        (twists @ way[:, :, None])[:, :, 0], np.cumsum([len(m) for m in equations.table.sets])[:-1]
    )
    seen = equations.prediction.predicted(end)
    parts = [each.by_twist @ own[:, :, None] for each, own in zip(seen, back, strict=True)]
    return sure.equations.whitening.whitened(parts, sure.factors)
