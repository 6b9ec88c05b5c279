"""Poses at which much was read that agrees, but not with where the actuators say the machine was.

The picture of a board taken while the machine moved, or beside the actuators of another row: its
corners fit one another, and the noise of all readings hardly grows. The few equations of each pose
that tell where the machine was are compared by themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal.diagnostics.check import Check, Level, Remedy
from pkmcal.diagnostics.robust_check import CARRIED
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.solving import solve
from pkmcal.fitted.dropped import elsewhere, without
from pkmcal.fitted.fit import Fit
from pkmcal.fitted.row_names import row_names
from pkmcal.fitted.solution import Solution


@dataclass(frozen=True)
class PosesElsewhere:
    """Poses that the others contradict.

    Attributes
    ----------
    ratio : float
        Deviation of the actuators with them over that without them; NaN where it is stated, or too
        few others are there to tell.
    poses : int
        How many they are.
    rows : tuple of int
        What was read there.
    """

    ratio: float
    poses: int
    rows: tuple[int, ...]


def _elsewhere(found: Solution) -> tuple[PosesElsewhere, ...]:
    equations = found.fit.uncertainty.equations
    odd = elsewhere(equations, found.fit.estimate) if found.loss == "linear" else ()
    if not len(odd):
        return ()
    rows = equations.table.rows[np.isin(equations.blocks.block_of_row, odd)].tolist()
    ratio = _ratio(found.fit, rows)
    if ratio <= 1.0:  # without them the others scatter no less
        return ()
    return (PosesElsewhere(ratio, len(odd), tuple(rows)),)


def _ratio(fit: Fit, rows: Sequence[int]) -> float:
    """The deviation of the actuators over that in a fit without some rows; NaN if not estimated."""
    if not fit.uncertainty.equations.blocks.unstated[-1]:
        return float("nan")
    try:
        others = Equations.of(without(fit.equations.prediction.datasets, rows), fit.parameters)
        others = others.reweighted(fit.uncertainty.equations.whitening.deviations)
        start = others.with_exact_actuators().at(fit.aligned.theta)
        estimate = solve(Estimator.of(*others.begin(start)))
    except ValueError:
        return float("nan")
    return float(fit.estimate.state.noise[-1] / estimate.state.noise[-1])


def _level(found: Solution, which: PosesElsewhere) -> Level:
    return "grave" if which.ratio > CARRIED else "doubt"


def _say(found: Solution, which: PosesElsewhere) -> str:
    one = which.poses == 1
    it = "it" if one else "them"
    scatter = (
        f" (the actuators scatter {which.ratio:.2g} times as much as without {it})"
        if np.isfinite(which.ratio)
        else ""
    )
    names = row_names(found.fit.equations.prediction.datasets, which.rows)
    return (
        f"{names}: what was read there agrees, but not with where the actuators say the machine"
        f" was{scatter}: {'it' if one else 'they'} may have been read while the machine moved, or"
        f" at other actuators; leave {it} out with {Remedy('drop', 'outliers')}"
    )


CHECKS = (
    Check(
        name="poses-elsewhere",
        about="what was read at a pose agrees, but not with where the actuators say it is",
        levels=("grave", "doubt"), run=_elsewhere, level_of=_level, say=_say,
        remedies=lambda found, which: (Remedy("drop", which.rows), Remedy("drop", "outliers")),
    ),
)  # fmt: skip
