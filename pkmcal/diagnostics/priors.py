"""Check whether what was known before agrees with the measurements."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import TIED, largest_first
from pkmcal.diagnostics.check import Check, Remedy, at_most_one
from pkmcal.display import chance_text
from pkmcal.fitted.solution import Solution
from pkmcal.statistics.distributions import t_tail
from pkmcal.statistics.prior_test import PriorTest

_PULLED = 2.0  # times what is expected, from which a pull on a prior is worth a word
_WRONG = 0.005  # chance below which an uncertainty is stated wrongly


def _contradicted(found: Solution) -> tuple[PriorTest, ...]:
    test = found.prior_test
    return at_most_one(test if test is not None and test.contradicted else None)


def _contradicted_text(found: Solution, test: PriorTest) -> str:
    """State the chance, the numbers that are pulled most, and a width that would agree."""
    pulls, stated = np.nan_to_num(test.pulls), found.fit.parameters.prior_names
    worst = [k for k in largest_first(np.abs(pulls), TIED)[:3] if abs(pulls[k]) > _PULLED]
    shown = ", ".join(f"{stated[k]} {abs(pulls[k]):.1f}" for k in worst)
    pulled = f" and pull {shown} times as far as prior and noise let expect" if worst else ""
    return (
        f"the measurements contradict the prior ({chance_text(test.chance_of_either)}){pulled}: a"
        f" prior {test.factor:.2g} times as wide would agree"
        + (", or leave the outliers out" if found.outliers else "")
    )


def _wider(found: Solution, test: PriorTest) -> tuple[Remedy, ...]:
    outliers = (Remedy("drop", "outliers"),) if found.outliers else ()
    return (Remedy("prior"), *outliers)


@dataclass(frozen=True)
class WrongUncertainty:
    """Numbers that are further from where they were than their stated uncertainty lets expect.

    Attributes
    ----------
    names : tuple of str
        Those that are so by themselves, the furthest first; empty where all together are.
    pulls : tuple of float
        How far, in deviations.
    chance : float
        How likely that would be if the statement were right.
    factor : float
        On all stated deviations, with which they would be right.
    """

    names: tuple[str, ...]
    pulls: tuple[float, ...]
    chance: float
    factor: float


def _uncertainty_contradicted(found: Solution) -> tuple[WrongUncertainty, ...]:
    test = found.uncertainty_test
    judged = [each for each in found.nuisances if np.isfinite(each.pull)]
    if test is None or not judged:
        return ()
    tests = 2.0 * len(judged)  # of each, and of all together
    chances = [tests * t_tail(abs(each.pull), test.freedom) for each in judged]
    far = [each for each, own in zip(judged, chances, strict=True) if own < _WRONG]
    far.sort(key=lambda each: -abs(each.pull))
    chance = min(1.0, 2.0 * test.chance, *chances)
    if chance >= _WRONG:
        return ()
    names, pulls = tuple(e.name for e in far), tuple(abs(e.pull) for e in far)
    return (WrongUncertainty(names, pulls, chance, test.factor),)


def _uncertainty_text(found: Solution, wrong: WrongUncertainty) -> str:
    if not wrong.names:
        return (
            f"numbers are further from where they were than their stated uncertainty lets expect"
            f" ({chance_text(wrong.chance)}): one {wrong.factor:.2g} times as large would agree"
        )
    pairs = zip(wrong.names[:3], wrong.pulls[:3], strict=True)
    shown = ", ".join(f"{name} is {pull:.1f}" for name, pull in pairs)
    more = f" and {len(wrong.names) - 3} more are" if len(wrong.names) > 3 else ""
    return (
        f"{shown}{more} times the stated uncertainty from where it was"
        f" ({chance_text(wrong.chance)}): free such a number, or state a larger one"
    )


def _freed(found: Solution, wrong: WrongUncertainty) -> tuple[Remedy, ...]:
    free = tuple(dict.fromkeys((*found.free, *wrong.names)))
    return (Remedy("uncertainty"), *((Remedy("free", free),) if wrong.names else ()))


CHECKS = (
    Check(
        name="prior-contradicted", about="the measurements contradict the prior", at_once=True,
        run=_contradicted, say=_contradicted_text, remedies=_wider,
    ),
    Check(
        name="uncertainty-contradicted",
        about="a number that is not free is far from where its stated uncertainty has it",
        at_once=True,
        run=_uncertainty_contradicted, say=_uncertainty_text, remedies=_freed,
    ),
)  # fmt: skip
