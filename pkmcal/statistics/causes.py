"""Which of several causes explain what a fit leaves: score tests, one after the other.

Each cause is some columns beside the design. The one that explains most beyond chance is taken
first; the others are then tested beside it. All chances are times the number of causes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.statistics.distributions import f_tail
from pkmcal.statistics.linear_fit import LinearFit
from pkmcal.statistics.score_test import Score, score_test

_SAME = 1e-6  # share of a column that must be left beside the parameters


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


def causes(
    fit: LinearFit, columns: Sequence[FloatArray], chance: float, most: int
) -> list[Explained]:
    """Search forward for causes, at most `most`, each by chance less than `chance` in all.

    Parameters
    ----------
    fit : LinearFit
        The fit.
    columns : sequence of ndarray (M, d)
        Of each cause; whitened derivatives of the predicted values.
    """
    found: list[Explained] = []
    limit, left = chance / max(len(columns), 1), dict(enumerate(columns))
    while left and len(found) < most:
        scores = {k: _tested(fit, own, limit) for k, own in left.items()}
        known = {k: each for k, each in scores.items() if each is not None and each.chance < limit}
        if not known:
            break
        best = min(known, key=lambda k: (known[k].chance, -known[k].drop))
        score, taken = known[best], left.pop(best)
        after = _with(fit, taken, score)
        also = [k for k in known if k != best and not _sure(_tested(after, left[k], limit), limit)]
        found.append(
            Explained(
                best,
                min(1.0, score.chance * len(columns)),
                1.0 - float(np.sqrt(max(1.0 - score.drop / fit.squares, 0.0))),
                _shift(fit, taken, score),
                tuple(also),
            )
        )
        fit = after
        for k in also:
            del left[k]
    return found


def _sure(score: Score | None, limit: float) -> bool:
    return score is not None and score.chance < limit


def _unit(columns: FloatArray) -> FloatArray:
    """Columns (M, d) of length 1, without those that are nothing."""
    size = np.linalg.norm(columns, axis=0)
    unit: FloatArray = columns[:, size > 0.0] / size[size > 0.0]
    return unit


def _beside(fit: LinearFit, unit: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Combinations (d, k) of columns that the parameters cannot take up, of length 1 beside them.

    And how the basis of the fit follows the columns, (p, d).
    """
    by_basis = fit.design.T @ unit
    values, ways = np.linalg.eigh(unit.T @ unit - by_basis.T @ by_basis)
    new = values > _SAME
    return ways[:, new] / np.sqrt(values[new]), by_basis


def _tested(fit: LinearFit, columns: FloatArray, limit: float) -> Score | None:
    """The score test, where as much would be unlikely if equations of a pose shared nothing.

    That is quick; and shared errors make as much more likely.
    """
    unit = _unit(columns)
    half, _ = _beside(fit, unit)
    k, along = half.shape[1], half.T @ (unit.T @ fit.residual)
    drop, rest = float(along @ along), fit.freedom - half.shape[1]
    if not k or rest < 1.0:
        return None
    over = max(fit.squares - drop, 0.0) / rest
    if not over > 0.0 or f_tail(min(drop / k / over, 1e300), k, rest) >= limit:
        return None
    return score_test(fit, unit)


def _with(fit: LinearFit, columns: FloatArray, score: Score) -> LinearFit:
    """The fit with the columns of a cause among its parameters."""
    unit = _unit(columns)
    half, by_basis = _beside(fit, unit)
    own = (unit - fit.design @ by_basis) @ half
    return replace(
        fit,
        design=np.hstack([fit.design, own]),
        residual=fit.residual - score.explained,
        prior=np.hstack([fit.prior, -fit.prior @ by_basis @ half]),
        back=np.hstack([fit.back, -fit.back @ by_basis @ half]),
    )


def _shift(fit: LinearFit, columns: FloatArray, score: Score) -> float:
    """How far a cause moves the parameters, in standard deviations by what it leaves, rms."""
    moved = fit.back @ (fit.design.T @ _unit(columns) @ score.size)
    noise = np.sqrt(max(fit.squares - score.drop, 0.0) / max(fit.freedom - len(score.size), 1.0))
    deviation = noise * np.linalg.norm(fit.back, axis=1)
    known = deviation > 0.0
    return float(np.sqrt(np.mean((moved[known] / deviation[known]) ** 2))) if known.any() else 0.0
