"""Check whether machine, instrument or targets were elsewhere in the course of measuring."""

from __future__ import annotations

import numpy as np

from pkmcal.diagnostics.check import Check, Level, Remedy, at_most_one
from pkmcal.diagnostics.displaced import DisplacedTarget, displaced_target
from pkmcal.diagnostics.drift import Drift, drift
from pkmcal.diagnostics.late import late
from pkmcal.diagnostics.measuring_order import MeasuringOrder, measuring_order
from pkmcal.diagnostics.two_machines import Apart, apart
from pkmcal.fitted.solution import Solution


def _level(found: Solution, seen: Drift | MeasuringOrder | DisplacedTarget | Apart) -> Level | None:
    return "doubt" if seen.large else "remark" if seen.found else None


def _drift(found: Solution) -> tuple[Drift, ...]:
    odd = {*found.outliers, *found.holdout_outliers}
    return at_most_one(drift(found.fit, found, odd))


def _expands(found: Solution, seen: Drift) -> tuple[Remedy, ...]:
    return () if np.isnan(seen.temperatures[0]) else (Remedy("effects"),)


CHECKS = (
    Check(
        name="drift", about="poses that were measured again moved with time",
        levels=("doubt", "remark"), run=_drift, level_of=_level, say=lambda found, seen: str(seen),
        remedies=_expands,
    ),
    Check(
        name="measuring-order", about="residuals follow the order of measuring",
        unless=("grave", "drift", "follows-loads", "sag-lacking"), levels=("doubt", "remark"),
        run=lambda found: at_most_one(measuring_order(found.fit, found.outliers)), level_of=_level,
        say=lambda found, seen: str(seen),
    ),
    Check(
        name="late-readings", about="residuals follow the way from the pose before, or to the next",
        unless=("grave", "follows-loads"), run=lambda found: at_most_one(late(found)),
        level_of=lambda found, seen: "doubt" if seen.found else None,
        say=lambda found, seen: str(seen),
    ),
    Check(
        name="two-machines", about="sets, sessions, halves or other rows fit better apart",
        unless=("grave", "copies", "displaced-target", "follows-loads", "moved-instrument",
                "sag-lacking"),
        levels=("doubt", "remark"),
        run=lambda found: at_most_one(apart(found)),
        level_of=lambda found, seen: _level(found, seen) if seen.found else None,
        say=lambda found, seen: str(seen),
    ),
    Check(
        name="displaced-target", about="a known target seems to be elsewhere than it is stated",
        unless=("grave",), levels=("doubt", "remark"),
        run=lambda found: at_most_one(displaced_target(found)), level_of=_level,
        say=lambda found, seen: str(seen),
        remedies=lambda found, seen: (Remedy("unknown", "target"),),
    ),
)  # fmt: skip
