"""Numbers that were fitted along because they are not exact: what became of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray
from pkmcal.estimation.parameters import Parameters
from pkmcal.estimation.uncertain_numbers import own_deviations

_MOVED = 2.0  # times its stated deviation, from which such a number is part of the result
_FAR = 4.0  # times what its statement lets expect, from which a number is bound by it
CHECKED = 0.1  # share of its deviation by which measurements must move it to be judged


@dataclass(frozen=True)
class Nuisance:
    """A number that was not looked for, and was fitted along as its uncertainty is stated.

    Attributes
    ----------
    name, unit : str
        Of the number: "mm", "rad" or "1".
    stated : float
        Its stated standard deviation.
    start, value, stderr : float
        Where it was, where the measurements put it, and how well they know it.
    pull : float
        Its change over the deviation that a change has if the stated uncertainty is right; NaN
        where the measurements hardly say anything of it.
    """

    name: str
    unit: str
    stated: float
    start: float
    value: float
    stderr: float
    pull: float

    @property
    def moved(self) -> bool:
        """True if the number moved so far that it is part of the result."""
        return abs(self.value - self.start) > _MOVED * self.stated


def nuisances(
    chosen: Parameters, theta: FloatArray, values: FloatArray, covariance: FloatArray
) -> tuple[Nuisance, ...]:
    """The numbers that were fitted along.

    Parameters
    ----------
    chosen : Parameters
        All parameters.
    theta, values : ndarray (n,)
        They at the solution, and as they are reported.
    covariance : ndarray (n, n)
        Theirs, by the noise and the stated uncertainties, without a factor on these.
    """
    mine = np.flatnonzero(chosen.uncertain)
    if not len(mine):
        return ()
    change = (theta - chosen.start)[mine]
    left = np.diagonal(covariance)[mine]
    stated = np.diagonal(chosen.spread)
    expected = stated - left  # of the change, for the rest is what is not known of it
    judged = expected > CHECKED**2 * stated
    pulls = np.where(judged, change / np.sqrt(np.where(judged, expected, 1.0)), np.nan)
    start = chosen.reported(chosen.start)
    return tuple(
        Nuisance(
            chosen.names[i],
            chosen.units[i],
            float(np.sqrt(stated[k])),
            float(start[i]),
            float(values[i]),
            float(np.sqrt(left[k])),
            float(pulls[k]),
        )
        for k, i in enumerate(mine)
    )


def bound(chosen: Parameters, theta: FloatArray, covariance: FloatArray) -> BoolArray:
    """Mark numbers (u,) that were fitted along and that their statement binds.

    Where a number has no deviation of its own but a common one, or so small a one that no reading
    moves it by a tenth of it, it is held as it is, whatever is stated: a check of the statement
    says nothing of it. Where it is far from where its statement has it, the measurements would have
    it still further.

    Parameters
    ----------
    chosen : Parameters
        All parameters.
    theta, covariance : ndarray (n,), (n, n)
        As of `nuisances`.
    """
    mine = np.flatnonzero(chosen.uncertain)
    own = own_deviations(chosen.asked.uncertainty, [chosen.names[i] for i in mine])
    expected = chosen.spread - covariance[np.ix_(mine, mine)]  # of the changes
    by_own = np.asarray(np.linalg.solve(chosen.spread, np.diag(own)), dtype=np.float64)
    change = (theta - chosen.start)[mine] @ by_own  # of the own parts, in their deviations
    variance = np.einsum("ik,ij,jk->k", by_own, expected, by_own)
    found: BoolArray = (variance <= CHECKED**2) | (change**2 > _FAR**2 * variance)
    return found


def in_result(chosen: Parameters, beside: tuple[Nuisance, ...]) -> BoolArray:
    """Mark parameters (n,) that are part of the result."""
    if not chosen.uncertain.any():
        return np.ones(len(chosen), dtype=bool)
    far = {each.name for each in beside if each.moved}
    return np.array([
        not own or name in far for name, own in zip(chosen.names, chosen.uncertain, strict=True)
    ])  # fmt: skip
