"""Other readings of what was measured, each with the machine that fits it: signs, orders, columns.

A fit takes most of a small mistake, as of one angle with the other sign, into its numbers. Other
readings are therefore compared after a linear fit to each, from the machine that was found, by the
likelihood of what remains, where each family of each set has a variance of its own. A reading that
is wrong is more likely than the right one by a factor of k in at most one of k cases (the bound of
a likelihood ratio between two hypotheses): no threshold has to be tuned.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.diagnostics.check import Check, at_most_one
from pkmcal.diagnostics.meant import Meant
from pkmcal.diagnostics.other_readings import other_values
from pkmcal.diagnostics.reach import reach
from pkmcal.estimation.whitening import Whitening
from pkmcal.fitted.solution import Solution
from pkmcal.measurements.measurements import Measurements
from pkmcal.statistics.linear_fit import column_basis, numbered, orthonormal

_CHANCE = 1e-4  # of a wrong reading that is as much more likely, all those that are tried together
_SMALLER = 0.92  # of the residuals: a model that is slightly wrong gains less from a wrong reading
_MOST = 4000  # equations that are compared
_TIMES = 3  # that weights are found anew


@dataclass(frozen=True)
class Likelier:
    """A reading that fits better than the one that was given.

    Attributes
    ----------
    number : int
        Of the set, from 0.
    meant : Meant
        How it reads.
    residual : float
        Geometric mean of its residuals' deviations over those of the reading as given.
    """

    number: int
    meant: Meant
    residual: float


@dataclass(frozen=True, eq=False)
class _Compared:
    """The equations that are compared.

    Attributes
    ----------
    found : Solution
        The calibration.
    sets : tuple of Measurements
        The rows that these equations are of.
    predicted, residuals : tuple of ndarray (N, k)
        What these rows should read, and measured less that.
    whitening : Whitening
        Theirs.
    use, group : ndarray of int (m,)
        Which of their equations, and which family of which set each is of.
    design : ndarray (m, p)
        Derivatives of these equations.
    """

    found: Solution
    sets: tuple[Measurements, ...]
    predicted: tuple[FloatArray, ...]
    residuals: tuple[FloatArray, ...]
    whitening: Whitening
    use: IntArray
    group: IntArray
    design: FloatArray

    @classmethod
    def of(cls, found: Solution) -> _Compared:
        sure = found.fit.uncertainty
        odd = np.isin(sure.equations.table.rows, found.outliers)[sure.blocks.row]
        use = sure.fit.without_idle(np.flatnonzero(~odd))
        use = use[:: max(1, -(-len(use) // _MOST))]
        group = numbered(sure.blocks.set_of[use], sure.blocks.family[use])
        table, end, white = sure.equations.table, found.fit.end, sure.equations.whitening
        needed = np.zeros(len(table.rows), dtype=bool)
        needed[sure.blocks.row[use]] = True
        rows = [np.flatnonzero(needed[table.set_of == i]) for i in range(len(table.sets))]
        rows = [own if len(own) else np.arange(1) for own in rows]  # measurements have a row
        for i, own in enumerate(rows):
            needed[np.flatnonzero(table.set_of == i)[own]] = True
        among = np.flatnonzero(needed[sure.blocks.row])
        predicted = found.fit.equations.prediction.values(end)
        return cls(
            found,
            tuple(m.select(own) for m, own in zip(table.sets, rows, strict=True)),
            tuple(each[own] for each, own in zip(predicted, rows, strict=True)),
            tuple(each[own] for each, own in zip(end.residuals, rows, strict=True)),
            replace(
                white,
                white=tuple(each[own] for each, own in zip(white.white, rows, strict=True)),
                read=tuple(each[own] for each, own in zip(white.read, rows, strict=True)),
            ),
            np.searchsorted(among, use),
            group,
            sure.fit.design[use],
        )

    @cached_property
    def basis(self) -> FloatArray:
        return column_basis(self.design)

    def residual(self, i: int, reading: Measurements) -> FloatArray:
        """Compute these residuals (m,) with other readings of set `i`."""
        parts = list(self.residuals)
        parts[i] = reading.instrument.difference(reading.values, self.predicted[i])
        return self.whitening.whitened(parts, self.found.fit.uncertainty.factors)[self.use]

    @cached_property
    def reach(self) -> FloatArray:
        """Return the way of numbers (n, r) along the basis in units of how far they can be off."""
        sure = self.found.fit.uncertainty
        changes: FloatArray = reach(sure, sure.fit) @ orthonormal(self.design)
        return changes

    def at_once(self, residual: FloatArray) -> float:
        """Logarithm of the likelihood after a linear fit with the weights that there are.

        −inf where no machine is so far off.
        """
        change = self.basis.T @ residual
        if np.linalg.norm(self.reach @ change) > 1.0:
            return -np.inf
        return self._likelihood(residual - self.basis @ change)[0]

    def refined(self, residual: FloatArray) -> float:
        """After one with weights by the residuals of each group."""
        left = residual - self.basis @ (self.basis.T @ residual)
        likelihood, deviation = self._likelihood(left)
        for _ in range(_TIMES):
            basis = column_basis(self.design / deviation[:, None])
            scaled = residual / deviation
            left = (scaled - basis @ (basis.T @ scaled)) * deviation
            likelihood, deviation = self._likelihood(left)
        return likelihood

    def _likelihood(self, left: FloatArray) -> tuple[float, FloatArray]:
        """Return the log-likelihood up to a constant, and each equation's group deviation (m,)."""
        count = np.bincount(self.group)
        variance = np.maximum(np.bincount(self.group, left**2) / count, 1e-300)
        return float(-0.5 * (count * np.log(variance)).sum()), np.sqrt(variance)[self.group]


def _fills(given: Measurements, other: Measurements) -> bool:
    """Return whether a column that takes no part, of 0 or not read, would have numbers."""
    before, after = (m.values.reshape(len(m), -1) for m in (given, other))
    still = (before == 0.0).all(axis=0)
    read = np.isfinite(before)
    return bool(np.any(after[:, still] != 0.0) or np.any(read != np.isfinite(after)))


def likelier_reading(found: Solution) -> Likelier | None:
    """The likeliest other reading, if it is far likelier than the one that was given."""
    sure = found.fit.uncertainty
    if sure.mixed or sure.rounded or not sure.equations.whitening.any_read:
        return None
    compared = _Compared.of(found)
    count = len(compared.use)
    if count <= compared.design.shape[1]:
        return None
    sets = compared.sets
    trials = {
        (i, meant): compared.at_once(compared.residual(i, other)) + _volume(given, other)
        for i, given in enumerate(sets)
        if given.components
        for meant, other in other_values(given)
        if not _fills(given, other)
    }
    if not trials:
        return None
    i, meant = max(trials, key=lambda each: trials[each])
    if not np.isfinite(trials[i, meant]):
        return None
    best = dict(other_values(sets[i]))[meant]
    gain = compared.refined(compared.residual(i, best)) + _volume(sets[i], best)
    gain -= compared.refined(compared.residual(i, sets[i]))
    share = float(np.exp(-gain / count))
    if not gain > np.log(len(trials) / _CHANCE) or share > _SMALLER:
        return None
    return Likelier(i, meant, share)


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
    sets = found.fit.equations.table.sets
    which = f"measurements {seen.number + 1}" if len(sets) > 1 else "the measurements"
    return (
        f"{which} fit better, with residuals {seen.residual:.2g} times as large, if"
        f" {seen.meant.among(sets)}; see how the file states them"
    )


CHECKS = (
    Check(
        name="other-reading",
        about="measurements fit better with other signs, orders or columns, numbers found anew",
        unless=("grave", "unit-errors"), run=lambda found: at_most_one(likelier_reading(found)),
        say=_text,
    ),
)  # fmt: skip
