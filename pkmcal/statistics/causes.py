"""Score tests of several causes of a fit's residuals, one after the other.

Each cause is some columns beside the design. The one that explains most beyond chance is taken
first; the others are then tested beside it. All chances are times the number of causes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.statistics.linear_fit import LinearFit
from pkmcal.statistics.score_test import Beside, Columns, Score, beside
from pkmcal.statistics.weighed import Weighed


@dataclass(frozen=True, eq=False)
class Explained:
    """A cause that explains something.

    Attributes
    ----------
    cause : int
        Which.
    chance : float
        How likely as much would be explained if there were no cause at all.
    gain : float
        Share by which the rms of the residuals falls with it, beside the causes before it.
    shift : float
        How far it moves the parameters, in their standard deviations, rms.
    spent : tuple of int
        Causes that explain something, and nothing any more beside this one.
    also : tuple of int
        Those of them that would do as well: nor does this one explain anything beside them.
    """

    cause: int
    chance: float
    gain: float
    shift: float
    spent: tuple[int, ...]
    also: tuple[int, ...]


def causes(
    weighed: Weighed, columns: Sequence[Columns], chance: float, most: int
) -> list[Explained]:
    """Search forward for causes, at most `most`, each by chance less than `chance` in all.

    One that explains nothing any more beside those that were found after it is left out again.

    Parameters
    ----------
    weighed : Weighed
        The fit, with weights for tests.
    columns : sequence of Columns
        Of each cause, by the fit without these weights; those that are all 0 do not count.
    """
    fit = weighed.fit
    begun = ((k, beside(fit, weighed.columns(own))) for k, own in enumerate(columns))
    left = {k: each for k, each in begun if each is not None}
    limit = chance / max(len(left), 1)
    count = len(left)
    found = _forward(weighed, left, limit, most)
    while (spent := _explained_by_others(left, found, limit)) is not None:
        left.pop(spent)
        found = _forward(weighed, left, limit, most)
    return [replace(each, chance=min(1.0, each.chance * count)) for each in found]


def _forward(
    weighed: Weighed, left: Mapping[int, Beside], limit: float, most: int
) -> list[Explained]:
    """Take the cause that explains most, then the next beside it; chances are those of each."""
    found: list[Explained] = []
    fit = weighed.fit
    while left and len(found) < most:
        scores = {k: _sure(each, limit) for k, each in left.items()}
        known = {k: each for k, each in scores.items() if each is not None}
        if not known:
            break
        best = min(known, key=lambda k: (known[k].chance, -known[k].drop))
        score, taken = known[best], left[best]
        after = taken_along(taken)
        tested = {k: beside(after, each.columns) for k, each in left.items() if k != best}
        spent = [k for k in known if k != best and _sure(tested[k], limit) is None]
        also = [
            k for k in spent
            if _sure(beside(taken_along(left[k]), taken.columns), limit) is None
        ]  # fmt: skip
        found.append(
            Explained(
                best,
                score.chance,
                1.0 - _size(weighed, fit.residual - score.explained) / _size(weighed, fit.residual),
                _shift(taken, score),
                tuple(spent),
                tuple(also),
            )
        )
        fit = after
        left = {k: each for k, each in tested.items() if each is not None and k not in spent}
    return found


def _explained_by_others(
    left: Mapping[int, Beside], found: Sequence[Explained], limit: float
) -> int | None:
    """The first cause that explains nothing beside those that were found after it, if any."""
    for place, each in enumerate(found[:-1]):
        others = [other.cause for k, other in enumerate(found) if k != place]
        alone: Beside | None = left[others[0]]
        for other in others[1:]:
            score = None if alone is None else alone.score()
            if alone is None or score is None:
                break
            alone = beside(taken_along(alone), left[other].columns)
        score = None if alone is None else alone.score()
        if alone is None or score is None:
            continue
        if _sure(beside(taken_along(alone), left[each.cause].columns), limit) is None:
            return each.cause
    return None


def _size(weighed: Weighed, residual: FloatArray) -> float:
    """Norm of residuals in units of the fit without the weights."""
    return float(np.linalg.norm(weighed.unweigh(residual)))


def _sure(tested: Beside | None, limit: float) -> Score | None:
    """The score of columns that explain more than chance does.

    Where as much would be likely if equations of a pose shared nothing nothing else is asked: that
    is quick; and shared errors make as much more likely.
    """
    if tested is None or tested.chance >= limit:
        return None
    score = tested.score()
    return score if score is not None and score.chance < limit else None


def taken_along(taken: Beside) -> LinearFit:
    """The fit with the columns of a cause among its parameters."""
    fit, turned = taken.fit, taken.by_basis @ taken.half
    return replace(
        fit,
        design=np.hstack([fit.design, taken.own]),
        residual=fit.residual - taken.own @ taken.along,
        prior=np.hstack([fit.prior, -fit.prior @ turned]),
        back=np.hstack([fit.back, -fit.back @ turned]),
    )


def _shift(taken: Beside, score: Score) -> float:
    """Return the parameters' shift by a cause, in standard deviations with it, rms."""
    fit = taken.fit
    moved = fit.back @ (taken.by_basis @ score.size)
    noise = np.sqrt(max(fit.squares - score.drop, 0.0) / max(fit.freedom - len(score.size), 1.0))
    deviation = noise * np.linalg.norm(fit.back, axis=1)
    known = deviation > 0.0
    return float(np.sqrt(np.mean((moved[known] / deviation[known]) ** 2))) if known.any() else 0.0
