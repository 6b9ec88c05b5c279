"""Uncertainty budgets after the GUM: combined and expanded uncertainty, degrees of freedom.

JCGM 100:2008, Evaluation of measurement data - Guide to the expression of uncertainty in
measurement: 5.1.2 (combination), G.4.1 (Welch and Satterthwaite), G.3 (coverage by Student's t).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pkmcal.statistics.distributions import MANY

Distribution = Literal["normal", "rectangular", "triangular", "U-shaped"]
DIVISORS: dict[Distribution, float] = {
    "normal": 1.0,
    "rectangular": 3.0**0.5,
    "triangular": 6.0**0.5,
    "U-shaped": 2.0**0.5,
}


@dataclass(frozen=True)
class Contribution:
    """One line of a budget: independent of the others.

    Attributes
    ----------
    source : str
        What it is of.
    standard : float
        Standard uncertainty of the source, in its own unit.
    sensitivity : float
        Derivative of the result by the source.
    dof : float
        Degrees of freedom of the standard uncertainty.
    type : {"A", "B"}
        From statistics of the measurements, or from other knowledge.
    remark : str
        Where it comes from.
    """

    source: str
    standard: float
    sensitivity: float = 1.0
    dof: float = float("inf")
    type: Literal["A", "B"] = "A"
    remark: str = ""

    @property
    def share(self) -> float:
        """Share of the combined standard uncertainty, in the unit of the result."""
        return abs(self.sensitivity) * self.standard


@dataclass(frozen=True)
class Budget:
    """Budget of uncertainty of a result.

    Attributes
    ----------
    contributions : tuple of Contribution
        The lines.
    factor : float
        Coverage factor k.

    Examples
    --------
    >>> budget = Budget((Contribution("scale", 3.0), Contribution("repeats", 4.0, dof=9)))
    >>> budget.combined, budget.expanded, round(budget.dof, 1)
    (5.0, 10.0, 22.0)
    >>> round(budget.coverage, 3)
    0.942
    """

    contributions: tuple[Contribution, ...]
    factor: float = 2.0

    @property
    def combined(self) -> float:
        """Combined standard uncertainty."""
        return float(np.sqrt(sum(each.share**2 for each in self.contributions)))

    @property
    def expanded(self) -> float:
        """Expanded uncertainty U = k u."""
        return self.factor * self.combined

    @property
    def dof(self) -> float:
        """Effective degrees of freedom of the combined uncertainty."""
        known = sum(each.share**4 / each.dof for each in self.contributions if each.share > 0)
        return self.combined**4 / known if known > 0 else float("inf")

    @property
    def coverage(self) -> float:
        """Probability that the interval ±U holds the value, by Student's t."""
        from scipy.special import stdtr

        return float(1.0 - 2.0 * stdtr(min(self.dof, MANY), -self.factor))


def standard(half_width: float, distribution: Distribution) -> float:
    """Standard uncertainty of a half width with a distribution; of a normal one it is itself.

    Examples
    --------
    >>> round(standard(1.0, "rectangular"), 4)
    0.5774
    """
    return half_width / DIVISORS[distribution]
