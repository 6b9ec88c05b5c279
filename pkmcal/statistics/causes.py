"""Score tests of several causes of a fit's residuals, one after the other.

Each cause is some columns beside the design. The one that explains most beyond chance is taken
first; the others are then tested beside it. All chances are times the number of causes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal.statistics.linear_fit import LinearFit
from pkmcal.statistics.score_test import Beside, Columns, Score, beside


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
    also : tuple of int
        Causes that explain something, and nothing any more beside this one.
    """

    cause: int
    chance: float
    gain: float
    shift: float
    also: tuple[int, ...]


def causes(fit: LinearFit, columns: Sequence[Columns], chance: float, most: int) -> list[Explained]:
    """Search forward for causes, at most `most`, each by chance less than `chance` in all.

    Parameters
    ----------
    fit : LinearFit
        The fit.
    columns : sequence of Columns
        Of each cause; those that are all 0 do not count.
    """
    found: list[Explained] = []
    begun = ((k, beside(fit, own)) for k, own in enumerate(columns))
    left = {k: each for k, each in begun if each is not None}
    count = len(left)
    limit = chance / max(count, 1)
    while left and len(found) < most:
        scores = {k: _sure(each, limit) for k, each in left.items()}
        known = {k: each for k, each in scores.items() if each is not None}
        if not known:
            break
        best = min(known, key=lambda k: (known[k].chance, -known[k].drop))
        score, taken = known[best], left.pop(best)
        after = _with(taken, score)
        tested = {k: beside(after, each.columns) for k, each in left.items()}
        also = [k for k in known if k != best and _sure(tested[k], limit) is None]
        found.append(
            Explained(
                best,
                min(1.0, score.chance * count),
                1.0 - float(np.sqrt(max(1.0 - score.drop / fit.squares, 0.0))),
                _shift(taken, score),
                tuple(also),
            )
        )
        fit = after
        left = {k: each for k, each in tested.items() if each is not None and k not in also}
    return found


def _sure(tested: Beside | None, limit: float) -> Score | None:
    """The score of columns that explain more than chance does.

    Where as much would be likely if equations of a pose shared nothing nothing else is asked: that
    is quick; and shared errors make as much more likely.
    """
    if tested is None or tested.chance >= limit:
        return None
    score = tested.score()
    return score if score is not None and score.chance < limit else None


def _with(taken: Beside, score: Score) -> LinearFit:
    """The fit with the columns of a cause among its parameters."""
    fit, turned = taken.fit, taken.by_basis @ taken.half
    return replace(
        fit,
        design=np.hstack([fit.design, taken.own]),
        residual=fit.residual - score.explained,
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
