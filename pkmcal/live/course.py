"""A measurement that goes on: what rows have told so far, which pose is next, and when to stop.

The predicted error follows from where was measured and from the noise that is stated, not from what
was read. So a stop at a predicted error chooses nothing by its luck, and the ± of the calibration
keep what they promise. Readings enter in one way: where they scatter by more than was stated, the
prediction grows with it, and the stop comes later. Where no noise is stated it is that of the
readings, and for the stop the largest that their scatter allows at `_SURE`.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.special import chdtri

from pkmcal.calibration.identification import Identification
from pkmcal.calibration.identify import identify
from pkmcal.exceptions import Error
from pkmcal.measurements.measurements import Measurements
from pkmcal.planning.next_pose import NextPose

CHANCE = 1e-3  # below which a new row contradicts those before
_SURE = 0.95
# Degrees of freedom from which scatter may stop a measurement. Who stops as soon as readings
# scatter little believes their luck: with 8 and no noise stated 93.9 % of true values are in the
# 95 % intervals, with 12 94.6 % (a linear model of the printer, 20 000 runs).
_LEAST = 12
UNSTATED = 1.0  # mm; of a plan where no noise is stated: only its ratios count


@dataclass(frozen=True)
class Odd:
    """New rows that contradict those before.

    Attributes
    ----------
    off : float
        Their distance from what those before predict, rms, mm.
    expected : float
        What it should be by noise and covariance, mm.
    chance : float
        How likely it would be to be so far off, by the t or F test.
    """

    off: float
    expected: float
    chance: float

    def __str__(self) -> str:
        return (
            f"{self.off:.3g} mm off what the rows before predict, where {self.expected:.3g} are"
            f" expected (chance {self.chance:.1g})"
        )


@dataclass(frozen=True, eq=False)
class Course:
    """State of a measurement after the rows so far; `after` adds the rows of one more pose.

    Attributes
    ----------
    choice : NextPose
        The next candidate, and what is predicted.
    stated : bool
        Whether the noise is stated; else readings tell it.
    accuracy : float or None
        Predicted error, mm, at which it stops; None: when all candidates are measured.
    count : int or None
        Poses after which it stops, too.
    asked : mapping
        Arguments of `identify`.
    rows : Measurements or None
        All rows, in their order.
    poses : int
        How many poses they are of.
    scatter : float
        Of the rows of `found` over what was stated, 1 where it is less; of unstated noise the
        largest that is likely, mm; NaN where that cannot be said.
    odd : Odd or None
        Whether the newest rows contradict those before.
    found : Identification or None
        The calibration of all rows where it is `over`, else of those before the newest; None while
        they are too few.
    trouble : str
        Why rows that are as many as the parameters have no calibration; empty: they have one.
    """

    choice: NextPose
    stated: bool
    accuracy: float | None
    count: int | None = None
    asked: Mapping[str, Any] = field(default_factory=dict)
    rows: Measurements | None = None
    poses: int = 0
    scatter: float = float("nan")
    odd: Odd | None = None
    found: Identification[Any] | None = None
    trouble: str = ""

    @property
    def predicted(self) -> float:
        """Error at the targets, mm; inf: too few rows, NaN: nothing says what the noise is."""
        if not np.isfinite(self.choice.predicted):
            return float("inf")
        if self.stated:
            return self.choice.predicted * (1.0 if np.isnan(self.scatter) else self.scatter)
        return self.choice.predicted / UNSTATED * self.scatter

    @property
    def reached(self) -> bool:
        """True if the accuracy is reached, and nothing speaks against it.

        Not the newest rows, and the scatter of all has had the chance to.
        """
        if self.accuracy is None or self.odd is not None or self.found is None:
            return False
        return bool(self.found.dof >= _LEAST and self.predicted <= self.accuracy)

    @property
    def over(self) -> bool:
        """True if there is nothing more to measure."""
        return self.reached or not self.choice.left or self.poses == self.count

    def after(self, index: int, rows: Measurements) -> Course:
        """Take the rows of a candidate.

        Parameters
        ----------
        index : int
            The candidate that was measured.
        rows : Measurements
            All rows, the new ones last.
        """
        before = 0 if self.rows is None else len(self.rows)
        found, trouble = self._identified(self.rows, holdout=rows.select(slice(before, None)))
        made = replace(
            self,
            choice=self.choice.after(index),
            rows=rows,
            poses=self.poses + 1,
            found=found,
            scatter=self._scatter(found),
            odd=_odd(found),
            trouble=trouble,
        )
        return made.fitted() if made.over else made

    def without(self, index: int) -> Course:
        """Take a candidate away at which nothing was seen."""
        return replace(self, choice=self.choice.without(index))

    def fitted(self) -> Course:
        """Fit all rows and see how they scatter."""
        found, trouble = self._identified(self.rows)
        return replace(self, found=found, scatter=self._scatter(found), trouble=trouble)

    def _identified(
        self, rows: Measurements | None, **also: Any
    ) -> tuple[Identification[Any] | None, str]:
        """A calibration, None of too few rows; and why there is none of as many as are needed."""
        if rows is None or len(rows) * max(len(rows.components), 1) < len(self.choice.parameters):
            return None, ""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            try:
                return identify(self.choice.robot, rows, **self.asked, **also), ""
            except (Error, ArithmeticError, np.linalg.LinAlgError) as error:
                return None, str(error)

    def _scatter(self, found: Identification[Any] | None) -> float:
        if found is None or found.dof < 1:
            return float("nan")
        if self.stated:
            squares = found.chi2_per_dof
            return max(1.0, float(np.sqrt(squares))) if np.isfinite(squares) else float("nan")
        return float(found.noise[0] * np.sqrt(found.dof / chdtri(found.dof, _SURE)))


def _odd(found: Identification[Any] | None) -> Odd | None:
    """Contradiction of rows that were held out and those before; None without one."""
    if found is None or found.dof < 1 or not found.holdout_chance < CHANCE:
        return None
    return Odd(found.holdout_rms, found.holdout_expected, found.holdout_chance)
