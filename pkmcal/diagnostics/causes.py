"""Tests of causes that are not in the model and would explain the residuals of a fit."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from pkmcal.diagnostics.cause_columns import (
    WARMING,
    Cause,
    of_instruments_alone,
    place_after_place,
    possible,
    usable,
)
from pkmcal.diagnostics.check import Check, Level
from pkmcal.display import chance_text
from pkmcal.fitted.solution import Solution
from pkmcal.statistics.causes import causes, taken_along
from pkmcal.statistics.distributions import FEW
from pkmcal.statistics.linear_fit import LinearFit
from pkmcal.statistics.score_test import Columns, beside
from pkmcal.statistics.weighed import Weighed

CHANCE = 0.05  # of naming any cause of a sound machine
SURE = 0.01  # below which one that moves the numbers makes a result doubtful
HARMFUL = 1.0  # standard deviations, rms over the parameters
_MOST = 3  # that are named
_CERTAIN = 1e-4  # chance below which a cause is named of a fit that is none


@dataclass(frozen=True)
class FoundCause:
    """A cause that is not in the model and would explain what the fit leaves.

    Attributes
    ----------
    name : str
        Which.
    cure : str
        What helps.
    chance : float
        How likely as much would be explained by chance, of all causes.
    gain : float
        Share by which the rms of the residuals would fall.
    shift : float
        How far it moved the parameters, in their standard deviations, rms.
    also : tuple of str
        Causes that would explain the same as well.
    """

    name: str
    cure: str
    chance: float
    gain: float
    shift: float
    also: tuple[str, ...]


def found_causes(found: Solution) -> tuple[FoundCause, ...]:
    """Test all causes, the one that explains most first."""
    return _explained(found, possible)


def _of_instruments(found: Solution) -> tuple[FoundCause, ...]:
    """Numbers of an instrument that would explain the residuals of a bad fit."""
    sure = _explained(found, of_instruments_alone)
    return tuple(each for each in sure[:1] if each.chance < _CERTAIN)


def _explained(
    found: Solution, possible: Callable[[Solution], Iterator[tuple[Cause, Columns]]]
) -> tuple[FoundCause, ...]:
    """Test causes, the one that explains most first."""
    if not _testable(found):
        return ()
    pairs = list(possible(found))
    every = causes(found.weighed, [columns for _, columns in pairs], CHANCE, _MOST)
    return tuple(
        FoundCause(
            pairs[each.cause][0].name,
            pairs[each.cause][0].cure,
            each.chance,
            each.gain,
            each.shift,
            tuple(pairs[k][0].name for k in each.also),
        )
        for each in every
    )


def _testable(found: Solution) -> bool:
    """Return whether residuals are more than rounding errors, and enough of them."""
    sure = found.fit.uncertainty
    usual = usable(found.fit.estimate.evaluation)
    return not sure.rounded and usual and sure.tested.freedom >= FEW


def beside_causes(found: Solution, weighed: Weighed, residual: float) -> LinearFit | None:
    """The fit with numbers of the causes that surely explain residuals.

    None where these leave more than `residual` of the standard deviation of the residuals: a
    division of the rows that leaves so much is then no image of them.
    """
    if not _testable(found):
        return None
    columns = [weighed.columns(each) for _, each in possible(found)]
    fit = weighed.fit
    for each in causes(Weighed(fit), columns, SURE, _MOST):
        own = beside(fit, columns[each.cause])
        score = None if own is None else own.score()
        if own is not None and score is not None:
            fit = taken_along(own)
    before = weighed.fit
    left = fit.squares * before.freedom / (before.squares * max(fit.freedom, 1.0))
    return fit if fit is not before and left <= residual**2 else None


def _level(found: Solution, cause: FoundCause) -> Level:
    return "doubt" if cause.chance < SURE and cause.shift > HARMFUL else "remark"


def _text(found: Solution, cause: FoundCause) -> str:
    also = f" (or as well {', '.join(cause.also)})" if cause.also else ""
    harm = f", and the numbers move by {cause.shift:.2g} times their ±" if cause.shift > 0.5 else ""
    alike = (
        "; it was measured place after place: whether that is time or place is not known, poses in"
        " another order would tell"
        if WARMING in (cause.name, *cause.also) and place_after_place(found.fit)
        else ""
    )
    return (
        f"residuals look like {cause.name}{also}: with it they fall by {100 * cause.gain:.0f} %"
        f" ({chance_text(cause.chance)}){harm}; {cause.cure}{alike}"
    )


CHECKS = (
    Check(
        name="causes", about="a cause that is not in the model would explain residuals",
        levels=("doubt", "remark"), level_of=_level, run=found_causes, say=_text,
        unless=("grave", "sag-lacking", "follows-loads"),
    ),
    Check(
        name="instrument", about="a lens or a board that is not as stated would explain a bad fit",
        levels=("doubt",), run=_of_instruments, say=_text, unless=("causes",),
    ),
)  # fmt: skip
