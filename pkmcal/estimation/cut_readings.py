"""Test of readings in steps: rounded, or cut to the step below or to the one towards zero.

What is cut is off by half a step more than what is rounded, in all rows alike. A score test of that
offset tells where the machine cannot take it up. Where nothing tells, the offset may be there, and
counts in ± as an error of all rows with the deviation of one of them, step/√12.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.estimation.coarse_readings import Coarse, component_of
from pkmcal.estimation.equations import Equations
from pkmcal.statistics.linear_fit import LinearFit
from pkmcal.statistics.score_test import columns_of, score_test

_CHANCE = 1e-4  # of as large an offset, were they rounded
_HALF = 0.5  # of half a step, above which an offset is that of readings that were cut
_REFUTED = 3.0  # deviations by which an offset is smaller than half a step
_UNIFORM = 3.0**-0.5  # deviation of what is as likely anywhere up to half a step, of half a step


@dataclass(frozen=True, eq=False)
class Cut:
    """Evidence of a set that its readings in steps were cut.

    Attributes
    ----------
    set : int
        Which.
    components : tuple of Coarse
        Those that were read in steps.
    to_zero : bool
        Whether towards zero; else to the step below.
    size, deviation : float
        Offset in half steps, and its standard deviation; inf where the machine takes it up.
    chance : float
        How likely as large an offset would be, were they rounded.
    moved : ndarray (p,)
        How the basis of the fit follows half a step.
    """

    set: int
    components: tuple[Coarse, ...]
    to_zero: bool
    size: float
    deviation: float
    chance: float
    moved: FloatArray

    @property
    def seen(self) -> bool:
        """True if the readings were cut."""
        return self.chance < _CHANCE and self.size > _HALF

    @property
    def refuted(self) -> bool:
        """True if the readings were not cut."""
        return self.size + _REFUTED * self.deviation < 1.0

    @property
    def error(self) -> FloatArray:
        """Derivative of the basis (p,) by the offset, in its deviation."""
        return _UNIFORM * self.moved


def cut_readings(
    equations: Equations,
    fit: LinearFit,
    factors: FloatArray,
    coarse: Sequence[Coarse],
) -> Iterator[Cut]:
    """Test readings in steps for being cut, either way, with noise factors (G,)."""
    component = component_of(equations) if coarse else np.zeros(0)
    for i in dict.fromkeys(each.set for each in coarse):
        mine = tuple(each for each in coarse if each.set == i)
        values = equations.table.sets[i].values
        values = values.reshape(len(values), -1)
        down = np.zeros(values.shape)
        for each in mine:
            down[:, each.component] = -0.5 * each.step
        towards = down * np.sign(values)
        ways = (
            [(False, down)] if np.array_equal(towards, down) else [(False, down), (True, towards)]
        )
        for to_zero, offset in ways:
            parts = [np.zeros((len(m), len(m.components))) for m in equations.table.sets]
            parts[i] = offset
            column = equations.whitening.whitened(parts, factors)
            of_set = equations.blocks.set_of == i
            used = of_set & np.isin(component, [each.component for each in mine])
            column[~used] = 0.0
            score = score_test(fit, columns_of(column[:, None]))
            size, deviation, chance = (
                (0.0, np.inf, 1.0)
                if score is None
                else (float(score.size[0]), float(score.deviation[0]), score.chance)
            )
            yield Cut(i, mine, to_zero, size, deviation, chance, fit.design.T @ column)
