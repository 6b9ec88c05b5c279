"""Check whether readings contradict what a fit held: combinations that the nominal machine hides.

Where the board sits on a platform that never turns changes nothing that a camera sees. The machine
as it was found turns a little, and then it does: too little to be estimated, but what is held far
off there goes into the other numbers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.diagnostics.check import CHANCE, Check, Remedy
from pkmcal.display import chance_text
from pkmcal.estimation.identifiability import listed, shown_beyond
from pkmcal.fitted.machine_accuracy import times_stated
from pkmcal.fitted.solution import Solution
from pkmcal.statistics.score_test import beside, columns_of

_SHARED = 0.05  # chance, by errors that rows of a pose share, below which readings contradict
_HARMFUL = 0.5  # times its ± by which the held combinations move the machine
_PART = 0.3  # of the largest, from which a number is named
_NAMED = 4


@dataclass(frozen=True)
class Held:
    """Combinations that are held and that the readings contradict.

    Attributes
    ----------
    count : int
        How many.
    names : tuple of str
        Numbers that have the largest part in them.
    chance : float
        How likely they would explain as much if they were right.
    shift : float
        How far the machine would move with them, over how well it is stated to be known; NaN where
        that is not known either.
    """

    count: int
    names: tuple[str, ...]
    chance: float
    shift: float


def held_combinations(found: Solution) -> Held | None:
    """Test all that are held; None where the machine as it was found shows none."""
    fit, sure = found.fit, found.fit.uncertainty
    if sure.rounded or not sure.known:
        return None
    estimate = fit.estimate
    held = shown_beyond(estimate.triangle, estimate.prior, estimate.state.determined.rank)[0]
    if not held.shape[1]:
        return None
    columns = fit.estimator.own_jacobian(estimate.evaluation, sure.factors) @ held
    taken = beside(found.weighed.fit, found.weighed.columns(columns_of(columns)))
    if taken is None or taken.chance >= CHANCE:
        return None
    score = taken.score()
    if score is None or score.chance >= _SHARED:
        return None
    along = held - taken.fit.back @ taken.by_basis
    moved = fit.parameters.scale[:, None] * (along @ score.size[:, None])
    part = np.abs(held @ score.size)
    largest = np.argsort(-part)[:_NAMED]
    names = tuple(fit.parameters.names[i] for i in sorted(largest) if part[i] > _PART * part.max())
    return Held(held.shape[1], names, score.chance, times_stated(fit, moved))


def _harmful(found: Solution) -> tuple[Held, ...]:
    seen = held_combinations(found)
    return () if seen is None or seen.shift <= _HARMFUL else (seen,)


def _say(found: Solution, seen: Held) -> str:
    far = f", by {seen.shift:.2g} times its ±" if np.isfinite(seen.shift) else ""
    return (
        f"{seen.count} combinations, of {listed(seen.names)} above all, are held where they began,"
        " for the machine as drawn does not show them; as it was found it does, and the readings"
        f" contradict what is held ({chance_text(seen.chance)}): the machine would be another{far};"
        " state roughly what these numbers are, or read something that tells them"
    )


CHECKS = (
    Check(
        name="held-combinations",
        about="the readings contradict what the machine as drawn does not show, and was held",
        unless=("grave",),
        run=_harmful, say=_say,
        remedies=lambda found, seen: (Remedy("prior"),),
    ),
)  # fmt: skip
