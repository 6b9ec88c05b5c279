"""Rows that the others contradict."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import TIED_CLOSELY, BoolArray, FloatArray, IntArray, largest_first, lots
from pkmcal.statistics.robust_scale import median_ratio

FALSE_ALARM = 0.01  # chance of naming any row, or slack cable, where the noise is as stated
LARGE = 20  # components of a row that has an opinion of its own on how precise it is
_FEW = 8  # such rows, from which on their scatter can be told
_DEVIATION = 1.4826  # of a normal distribution in units of the median distance
_TINY = 1e-6  # scatter that is none
_NONE = np.finfo(float).tiny
_MOST = 4  # at most one row in so many can be odd
_TOGETHER = 4096  # rows that are looked at at once, to bound memory
_AT_ONCE = 1000  # of so many rows one is set aside at a time
_AS_ODD = 0.5  # of the worst row's excess, from which others are set aside with it
_OWN = 0.1  # share of itself that such a row decides at most: no other can move it as far


def outliers(
    residual: FloatArray,
    jacobian: FloatArray,
    components: IntArray,
    weights: FloatArray,
    prior: FloatArray,
    stated: bool = True,
) -> IntArray:
    """Rows further off than noise explains, by their residuals in a fit without them.

    The row that the rest contradicts most is set aside, the fit is corrected to first order, and
    so on until what is left agrees; then rows that fit the corrected fit after all return. Of very
    many rows some are set aside together: such as no other one can have moved so far.

    Parameters
    ----------
    residual : ndarray (M,)
        Measured less predicted at the solution, whitened.
    jacobian : ndarray (M, n)
        Derivative of the predicted values to what is determined, whitened, in a basis in which the
        normal matrix, that of the prior included, is about the identity.
    components : ndarray of int (N,)
        Equations of each row.
    weights : ndarray (N,)
        Of each row in the fit.
    prior : ndarray (p, n)
        Derivative of the prior's equations, which stay.
    stated : bool
        Whether the noise is at least that by which rows are whitened; else outliers may have
        been taken for noise.

    Returns
    -------
    ndarray of int
        In order. Where residuals exceed the stated noise on the whole, "further off" means
        further than most.
    """
    rows = len(components)
    alike = [
        mine[lot]
        for mine in (np.flatnonzero(components == k) for k in np.unique(components))
        for lot in lots(len(mine), _TOGETHER)
    ]
    first = np.cumsum(components) - components
    weight = np.repeat(weights, components)
    pull = jacobian.T @ (weight * residual)  # of the prior: at the solution the two balance
    kept = np.ones(rows, dtype=bool)
    while True:
        used = np.where(np.repeat(kept, components), weight, 0.0)
        normal = prior.T @ prior
        for lot in lots(len(residual)):
            normal += (used[lot, None] * jacobian[lot]).T @ jacobian[lot]
        # the ridge is for directions that only rows set aside determined
        covariance = np.linalg.inv(normal + 1e-14 * np.trace(normal) * np.eye(len(normal)))
        shift = covariance @ (jacobian.T @ (used * residual) - pull)
        left = residual - jacobian @ shift
        part = np.where(kept, -weights, 1.0)  # a fitted row has pulled the fit to itself
        squares, own = np.empty((2, rows))
        for mine in alike:
            e = first[mine, None] + np.arange(components[mine[0]])
            squares[mine], own[mine] = _squares(left[e], jacobian[e], covariance, part[mine])
        spread = max(median_ratio(squares[kept], components[kept]), 1.0 if stated else _NONE)
        freedom = _freedom(squares, components, kept, LARGE if stated else 1)
        scale = _median(freedom) / (_median(components) * spread)
        known = np.inf
        if not stated:
            known = _known(
                components[kept], float(np.trace(covariance @ (normal - prior.T @ prior)))
            )
        chance = _chance(squares * scale, freedom, known)
        # where the chance is 0 to the last digit, the squares decide; they exceed its logarithm
        excess = np.where(chance > 0, -np.log(np.maximum(chance, _NONE)), squares)
        excess = np.where(kept, np.maximum(excess, 0.0), -1.0)
        allowed = rows // _MOST + 1 - np.count_nonzero(~kept)
        worst = _worst(excess, own, min(max(rows // _AT_ONCE, 1), allowed))
        worst = worst[chance[worst] < FALSE_ALARM / rows]
        kept[worst] = False
        if len(worst) in (0, allowed):
            break
    odd: IntArray = np.flatnonzero(~kept & (chance < FALSE_ALARM / rows))
    return odd


def _worst(excess: FloatArray, own: FloatArray, most: int) -> IntArray:
    """The row with the largest excess, and at most so many in all that are about as odd.

    Rows that decide more of themselves, `own`, may be off by the error of another: not those.
    """
    largest = float(excess.max())
    some = np.flatnonzero(excess >= _AS_ODD * largest)
    order = some[largest_first(excess[some], TIED_CLOSELY * largest)]
    return np.concatenate([order[:1], order[1:][own[order[1:]] < _OWN]])[:most]


def _squares(
    r: FloatArray, j: FloatArray, covariance: FloatArray, part: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Squared length of residuals (N, k) in units of their own deviations, (N,).

    Then the share of itself that each row decides, in the component in which it is most.
    """
    variance = np.eye(r.shape[1]) + part[:, None, None] * (j @ covariance @ j.transpose(0, 2, 1))
    values, vectors = np.linalg.eigh(variance)
    along = (vectors.transpose(0, 2, 1) @ r[:, :, None])[:, :, 0]
    seen = values > 1e-6  # a row that the fit follows wherever it lies says nothing
    squares: FloatArray = np.where(seen, along**2 / np.where(seen, values, 1.0), 0.0).sum(axis=1)
    return squares, 1.0 - values[:, 0]


def _median(freedom: FloatArray | IntArray) -> FloatArray:
    """Return the median of χ², nearly (Wilson and Hilferty, 1931)."""
    given = np.asarray(freedom, dtype=np.float64)
    median: FloatArray = given * (1.0 - 2.0 / (9.0 * given)) ** 3
    return median


def _freedom(squares: FloatArray, components: IntArray, kept: BoolArray, least: int) -> FloatArray:
    """Degrees of freedom (N,) by how squares of rows of `least` components and more scatter.

    Rows of many components, such as pictures, are seldom equally precise: where their mean squares
    scatter more than chance lets them, one that is twice as large is no contradiction. As
    F. E. Satterthwaite (Biometrics Bulletin 2 (1946) 110-114), from the median of what they are
    off.
    """
    found = components.astype(np.float64)
    large = components >= least
    if np.count_nonzero(large & kept) >= _FEW:
        mean = squares[large & kept] / components[large & kept]
        off = np.abs(mean - np.median(mean))
        scatter = float(_DEVIATION * np.median(off) / np.median(mean))
        found[large] = np.minimum(found[large], max(2.0 / max(scatter, _TINY) ** 2, 1.0))
    return found


def _known(components: IntArray, taken: float) -> float:
    """Degrees of freedom of a variance by the median of rows with so many equations each.

    As many as make it scatter so; `taken` of the equations are met by the parameters.
    """
    from scipy.special import gammaln

    usual, rows = float(np.median(components)), len(components)
    half, median = usual / 2.0, float(_median(np.asarray(usual)))
    density = np.exp((half - 1.0) * np.log(median / 2.0) - median / 2.0 - gammaln(half)) / 2.0
    left = 1.0 - taken / float(components.sum())
    return max(float(8.0 * rows * (density * median) ** 2 * left), 1.0)


def _chance(squares: FloatArray, freedom: FloatArray, known: float) -> FloatArray:
    """Chance of squares, over a variance that is known with so many degrees of freedom."""
    from scipy.special import fdtrc, gammaincc

    if np.isinf(known):
        chance: FloatArray = gammaincc(freedom / 2, squares / 2)
        return chance
    estimated: FloatArray = fdtrc(freedom, known, squares / freedom)
    return estimated
