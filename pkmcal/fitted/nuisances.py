"""Numbers that were fitted along because they are not exact: what became of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray
from pkmcal.estimation.parameters import Parameters

_MOVED = 2.0  # times its stated deviation, from which such a number is part of the result
_CHECKED = 0.1  # share of its deviation by which measurements must move it to be judged


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
    judged = expected > _CHECKED**2 * stated
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


def in_result(chosen: Parameters, beside: tuple[Nuisance, ...]) -> BoolArray:
    """Mark parameters (n,) that are part of the result."""
    if not chosen.uncertain.any():
        return np.ones(len(chosen), dtype=bool)
    far = {each.name for each in beside if each.moved}
    return np.array([
        not own or name in far for name, own in zip(chosen.names, chosen.uncertain, strict=True)
    ])  # fmt: skip
