"""Evidence of held-out points against the fit."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.diagnostics.check import Check, Level, Remedy, at_most_one
from pkmcal.diagnostics.moved import Moved, moved
from pkmcal.diagnostics.row_errors import likely_row_errors
from pkmcal.diagnostics.units import likely_unit_errors
from pkmcal.display import chance_text, decimals, displayed, fixed
from pkmcal.estimation.solving import FEW, LEAST_FREEDOM
from pkmcal.fitted.held_points import HeldFamily
from pkmcal.fitted.row_names import row_names
from pkmcal.fitted.solution import Solution
from pkmcal.measurements.measurements import Measurements


def _contradiction(found: Solution, several: tuple[HeldFamily, ...]) -> str:
    alone = len(found.holdout_families) == 1
    what = "points" if alone else " and ".join(each.family.noun for each in several)
    chance = min(each.test.chance for each in several if each.test is not None)
    text = f"the held-out {what} contradict the fit: {_compared(several)} ({chance_text(chance)})"
    return "; ".join([text, *_meant(found)])


def _meant(found: Solution) -> list[str]:
    """Name readings with which other measurements that were held out agree: signs, orders, rows."""
    later, end = found.holdout_later, found.holdout_end
    if found.holdout_drawn or later is None or end is None:
        return []
    named = likely_unit_errors(later.data, later.parameters, end, near=end.theta, least=0.0)
    return named or likely_row_errors(later.data, later.parameters, near=end.theta)


def _compared(several: tuple[HeldFamily, ...]) -> str:
    """Compare the residuals of each family with what is expected."""
    parts = []
    for each in several:
        off, unit = displayed(each.rms, each.family.unit)
        expected, _ = displayed(each.expected, each.family.unit)
        parts.append(f"{off:.3g} {unit} rms where {expected:.3g} {unit} is expected")
    return " and ".join(parts)


def _nearer(found: Solution) -> tuple[tuple[HeldFamily, ...], ...]:
    """The families that came out nearer than expected."""
    several = tuple(each for each in found.holdout_families if each.test and each.test.nearer)
    return at_most_one(several or None)


def _nearer_text(found: Solution, several: tuple[HeldFamily, ...]) -> str:
    chance = min(each.test.chance_nearer for each in several if each.test is not None)
    return (
        f"the held-out points are nearer than expected: {_compared(several)}"
        f" ({chance_text(chance)}): the fitted rows have errors that these do not, of the model"
        " where they are or of the instrument then"
    )


def _without_outliers(found: Solution) -> float:
    return found.holdout_distances.rms_without_outliers


def _level_of_few(found: Solution, rows: tuple[int, ...]) -> Level:
    return "remark" if all(each.agrees_otherwise for each in found.holdout_families) else "doubt"


def _few_off(found: Solution, rows: tuple[int, ...]) -> str:
    them, are = ("them", "s are") if len(rows) > 1 else ("it", " is")
    rest = _without_outliers(found)
    without = (
        f"without {them} the rms is {rest:.3g} mm" if np.isfinite(rest) else "no other is left"
    )
    return (
        f"{len(rows)} held-out point{are} off: {row_names(found.holdout_data, rows)}; {without},"
        f" {found.holdout_expected:.3g} mm is expected"
    )


def _drop(found: Solution, rows: tuple[int, ...]) -> tuple[Remedy, ...]:
    return (Remedy("drop", rows if found.holdout_drawn else "outliers"),)


def _moved(found: Solution) -> tuple[tuple[Moved, ...], ...]:
    """Name what moved; nothing where points were drawn, or agree with a fit of spare equations."""
    later, end, sure = found.holdout_later, found.holdout_end, found.fit.uncertainty
    if not found.holdout_contradicts and sure.fit.freedom >= FEW:
        return ()
    if found.holdout_drawn or later is None or end is None or not sure.known:
        return ()
    return at_most_one(moved(found.fit, later, end) or None)


def _anew(several: tuple[Moved, ...]) -> Remedy:
    return Remedy("per_session", tuple(dict.fromkeys(each.per_session for each in several)))


def _moved_text(found: Solution, several: tuple[Moved, ...]) -> str:
    parts = []
    for each in several:
        sizes = ", ".join(map(_size, each.shift, each.stderr, each.units))
        also = f" (or as well {', '.join(each.also)})" if each.also else ""
        parts.append(f"{each} by {sizes}{also}")
    return (
        "between the fitted and the held-out points moved, or the model is wrong there:"
        f" {'; '.join(parts)}; {_anew(several)} finds such numbers anew in each session"
    )


def _size(shift: float, sigma: float, unit: str) -> str:
    """A shift with its standard deviation, in the unit people read."""
    value, shown = displayed(shift, unit)
    deviation, _ = displayed(sigma, unit)
    places = decimals(deviation)
    sign, behind = "+" if value >= 0 else "", f" {shown}" if shown != "1" else ""
    return f"{sign}{fixed(value, places)} ± {fixed(deviation, places)}{behind}"


def _fitted_again(found: Solution) -> int:
    """Count the rows that were held out at actuators where others were fitted."""
    held = [row.tobytes() for data in found.holdout_data for row in _commands(data.measured)]
    sought = set(held)
    fitted = {
        key
        for m in found.fit.equations.table.sets
        for row in (_commands(m) if sought else ())
        if (key := row.tobytes()) in sought
    }
    return sum(key in fitted for key in held)


def _commands(measured: Measurements) -> FloatArray:
    """Actuators of each row, at both ends where there are two."""
    parts = [measured.actuators] + ([] if measured.other is None else [measured.other])
    return np.hstack(parts) + 0.0


CHECKS = (
    Check(
        name="holdout-contradicts",
        about="held-out points are further off than noise and covariance explain",
        run=lambda found: at_most_one(found.holdout_contradicting or None),
        say=_contradiction,
    ),
    Check(
        name="holdout-few-off",
        about="a few held-out points are off, the others are not, or not much",
        unless=("holdout-contradicts",), levels=("doubt", "remark"),
        run=lambda found: at_most_one(found.holdout_outliers or None), level_of=_level_of_few,
        say=_few_off, remedies=_drop,
    ),
    Check(
        name="holdout-nearer",
        about="held-out points are nearer than noise and covariance let expect",
        levels=("remark",), run=_nearer, say=_nearer_text,
    ),
    Check(
        name="moved",
        about="numbers moved between the fitted measurements and others that were held out",
        run=_moved, say=_moved_text, remedies=lambda found, several: (_anew(several),),
    ),
    Check(
        name="holdout-fitted-again", about="points were held out at poses where others were fitted",
        levels=("remark",), run=lambda found: at_most_one(_fitted_again(found) or None),
        say=lambda found, count: (
            f"{count} of the held-out points are at poses that were fitted as well: they show how"
            " these repeat, not how good the machine is elsewhere"
        ),
    ),
    Check(
        name="holdout-unreached", about="the machine does not reach rows that were held out",
        at_once=True, run=lambda found: at_most_one(found.holdout_unreached or None),
        say=lambda found, failures: f"holdout: {failures}; left out",
    ),
    Check(
        name="holdout-nothing-left",
        about="a held-out session's own numbers take all of its readings", at_once=True,
        run=lambda found: at_most_one(
            len(found.holdout_own) if found.holdout_spare < LEAST_FREEDOM else None
        ),
        say=lambda found, count: (
            f"holdout: {count} numbers of its own session take all of its readings, nothing is"
            " left to compare; hold out more rows of it"
        ),
    ),
)  # fmt: skip
