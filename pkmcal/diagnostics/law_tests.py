"""Check whether the numbers of a drive law are needed: an F test of each kind of them against 0."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import BoolArray
from pkmcal.display import chance_text
from pkmcal.estimation.uncertainty import Uncertainty
from pkmcal.fitted.solution import Solution
from pkmcal.geometry.geometry import Geometry
from pkmcal.statistics.distributions import f_tail

NEEDED = 0.05  # chance, were all of them 0, below which numbers are needed
_KEY = re.compile(r"drive\.(quadratic|buildup|(?:cos|sin)\d+|table|backlash)")
_WAVE = re.compile(r"(?:cos|sin)(\d+)")


@dataclass(frozen=True)
class LawTest:
    """An F test of numbers of drive laws: whether all of them may be 0.

    Attributes
    ----------
    names : tuple of str
        The parameters.
    ratio : float
        F: their squares in standard deviations, over their number.
    freedom : (float, float)
        Degrees of freedom of both of its mean squares.
    chance : float
        Of as large a ratio if all of them were 0.
    """

    names: tuple[str, ...]
    ratio: float
    freedom: tuple[float, float]
    chance: float

    @property
    def needed(self) -> bool:
        """True if the measurements need the law's numbers."""
        return self.chance < NEEDED

    def __str__(self) -> str:
        count, rest = self.freedom
        shown = self.names[0] if len(self.names) == 1 else f"{self.names[0]} … {self.names[-1]}"
        verdict = "needed" if self.needed else "not needed: all 0 would fit as well"
        degrees = "∞" if np.isinf(rest) else f"{rest:.3g}"
        return f"{shown}: {verdict} (F({count:g}, {degrees}) = {self.ratio:.3g}," + (
            f" {chance_text(self.chance)})"
        )


def law_tests(
    geometry: Geometry, table: Solution, uncertainty: Uncertainty, prior: BoolArray
) -> tuple[LawTest, ...]:
    """Test the free numbers of drive laws, each kind of all limbs together.

    Parameters
    ----------
    geometry : Geometry
        Of the machine.
    table : Solution
        The parameters.
    uncertainty : Uncertainty
        Of them. A sandwich of few poses is no sure measure of many numbers, as Hotelling's T² has
        it.
    prior : ndarray of bool (n,)
        Of which something was known before: the measurements alone do not decide, and nothing is
        said.
    """
    found = []
    reported = uncertainty.reported[table.columns]
    for names in _groups(geometry, table.free):
        columns = [table.free.index(name) for name in names]
        known = prior[columns].any()
        own = table.covariance[np.ix_(columns, columns)]
        if known or not np.isfinite(own).all():
            continue
        values = table.values[columns]
        scale = np.sqrt(np.diag(own))
        if not (scale > 0.0).all():
            continue
        size, axes = np.linalg.eigh(own / np.outer(scale, scale))
        if size[0] <= len(columns) * np.finfo(float).eps * size[-1]:
            continue
        squares = float(((axes.T @ (values / scale)) ** 2 / size).sum())
        freedom = float(table.parameter_dof[columns].min())
        count, spent = float(len(columns)), 0.0
        if table.covariance_rule == "cluster":
            freedom = uncertainty.covariance.sandwich.joint_freedom(reported[columns])
            spent = count - 1.0
        rest = freedom - spent
        if rest > 0.0:
            ratio = squares / count * (1.0 - spent / freedom)
            found.append(LawTest(names, ratio, (count, rest), f_tail(ratio, count, rest)))
    return tuple(found)


def _groups(geometry: Geometry, free: Sequence[str]) -> list[tuple[str, ...]]:
    """Free names by the kind of number of a law that they are, or that they drive."""
    kinds: dict[str, set[str]] = {}
    for number in geometry.numbers:
        names = (number.name,) if number.tie is None else number.tie.drivers
        for name in names:
            kinds.setdefault(name, set()).add(_kind(number.slot))
    groups: dict[str, list[str]] = {}
    for name in free:
        of = kinds.get(name.partition("@")[0], set())  # of whatever session
        if len(of) == 1 and (kind := next(iter(of))):
            groups.setdefault(kind, []).append(name)
    return [tuple(names) for names in groups.values()]


def _kind(slot: str) -> str:
    """Name the kind of a law's slot: a cosine and its sine are one, so is a whole table."""
    match = _KEY.match(slot)
    if match is None:
        return ""
    wave = _WAVE.fullmatch(match[1])
    return f"harmonic {wave[1]}" if wave else match[1]
