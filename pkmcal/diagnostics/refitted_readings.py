"""Other readings of what was measured, each with the machine that fits it: signs, orders, columns.

A fit takes most of a small mistake, as of one angle with the other sign, into its numbers. Other
readings are therefore compared after a linear fit to each, from the machine that was found, by the
likelihood of what remains, where each family of each set has a variance of its own. A reading that
is wrong is more likely than the right one by a factor of k in at most one of k cases (the bound of
a likelihood ratio between two hypotheses): no threshold has to be tuned.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.diagnostics.check import Check, at_most_one
from pkmcal.diagnostics.other_readings import other_values
from pkmcal.fitted.solution import Solution
from pkmcal.measurements.measurements import Measurements
from pkmcal.statistics.linear_fit import column_basis, numbered

_CHANCE = 1e-4  # of a wrong reading that is as much more likely, all those that are tried together
_SMALLER = 0.85  # of the residuals: a model that is slightly wrong gains less from a wrong reading
_MOST = 4000  # equations that are compared


@dataclass(frozen=True)
class Likelier:
    """A reading that fits better than the one that was given.

    Attributes
    ----------
    number : int
        Of the set, from 0.
    words : str
        How it reads.
    residual : float
        Geometric mean of its residuals' deviations over those of the reading as given.
    """

    number: int
    words: str
    residual: float


class _Compared:
    """The equations that are compared, and what a linear fit to readings of them leaves."""

    def __init__(self, found: Solution) -> None:
        sure = found.fit.uncertainty
        odd = np.isin(sure.equations.table.rows, found.outliers)[sure.labels.row]
        use = np.flatnonzero(~odd)
        self.use: IntArray = use[:: max(1, -(-len(use) // _MOST))]
        self.found = found
        self.basis = column_basis(sure.fit.design[self.use])
        of_set, family = sure.labels.set_of[self.use], sure.labels.family[self.use]
        self.group = numbered(of_set, family)

    def log_likelihood(self, i: int, values: FloatArray) -> float:
        """Of the readings of all sets, where those of set `i` are `values`; up to a constant."""
        sure, end = self.found.fit.uncertainty, self.found.fit.end
        predicted = end.predicted[i]
        parts = list(end.residuals)
        parts[i] = sure.equations.table.sets[i].instrument.difference(values, predicted)
        residual = sure.equations.whitening.whitened(parts, sure.factors)[self.use]
        residual -= self.basis @ (self.basis.T @ residual)
        squares = np.bincount(self.group, residual**2)
        count = np.bincount(self.group)
        return float(-0.5 * (count * np.log(np.maximum(squares / count, 1e-300))).sum())


def likelier_reading(found: Solution) -> Likelier | None:
    """The likeliest other reading, if it is far likelier than the one that was given."""
    sure = found.fit.uncertainty
    if sure.mixed or sure.rounded or not sure.equations.whitening.any_read:
        return None
    compared = _Compared(found)
    count = len(compared.use)
    if count <= compared.basis.shape[1]:
        return None
    gains = {
        (i, words): compared.log_likelihood(i, other.values) + _volume(given, other)
        for i, given in enumerate(sure.equations.table.sets)
        if given.components
        for words, other in other_values(given)
    }
    if not gains:
        return None
    given = compared.log_likelihood(0, sure.equations.table.sets[0].values)
    i, words = max(gains, key=lambda each: gains[each])
    gain = gains[i, words] - given
    share = float(np.exp(-gain / count))
    if not gain > np.log(len(gains) / _CHANCE) or share > _SMALLER:
        return None
    return Likelier(i, words, share)


def _volume(given: Measurements, other: Measurements) -> float:
    """Logarithm of how much smaller a reading makes the numbers; of others 0.

    Smaller numbers have smaller residuals, whatever they mean: a likelihood counts their volume.
    """
    norms = [np.sqrt(np.nansum(m.values.reshape(len(m), -1) ** 2, axis=0)) for m in (given, other)]
    read = (norms[0] > 0.0) & (norms[1] > 0.0)
    shrunk = np.isfinite(given.values.reshape(len(given), -1)).sum(axis=0) * np.log(
        np.where(read, norms[1], 1.0) / np.where(read, norms[0], 1.0)
    )
    return min(0.0, float(shrunk.sum()))


def _text(found: Solution, seen: Likelier) -> str:
    several = len(found.fit.equations.table.sets) > 1
    which = f"measurements {seen.number + 1}" if several else "the measurements"
    return (
        f"{which} fit better if {seen.words}: the residuals are then {seen.residual:.2g} times as"
        " large; see how the file states them"
    )


CHECKS = (
    Check(
        name="other-reading",
        about="measurements fit better with other signs, orders or columns, numbers found anew",
        unless=("grave", "unit-errors"), run=lambda found: at_most_one(likelier_reading(found)),
        say=_text,
    ),
)  # fmt: skip
