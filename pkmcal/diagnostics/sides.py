"""Test whether the two sides of the workspace fit better apart.

A joint with play hangs to the side to which the platform leans, a rail is bowed, a probe tilts its
nozzle: no column of a cause has the shape of each. That one model does not hold on both sides of
the middle shows whatever the shape is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import BoolArray
from pkmcal.diagnostics.causes import beside_causes
from pkmcal.diagnostics.check import RARE, Check, Level, at_most_one
from pkmcal.diagnostics.two_machines import equations_of_visits, tested, weighed_alike
from pkmcal.diagnostics.visits import visits_of
from pkmcal.display import chance_text
from pkmcal.fitted.solution import Solution
from pkmcal.statistics.linear_fit import LinearFit

_FAR = 1.5  # times what noise lets expect, above which ± do not hold
_TRAVEL = 1e-3  # of the machine's length, from which poses have sides
_WAYS = (
    "at the two sides along x", "at the two sides along y", "below and above the middle",
    "that lean to the two sides about x", "that lean to the two sides about y",
    "that are turned to the two sides about z",
)  # fmt: skip


@dataclass(frozen=True)
class Sides:
    """Poses on the two sides of the middle, if numbers of each side differ.

    Attributes
    ----------
    where : str
        Which poses, in words.
    chance : float
        How likely as large a difference is if one model holds, times the number of ways.
    residual : float
        Standard deviation of the residuals with numbers for each side, over that with common ones.
    ratio : float
        How far these numbers differ, in what noise lets expect.
    """

    where: str
    chance: float
    residual: float
    ratio: float

    def __str__(self) -> str:
        return (
            f"poses {self.where} and the others fit better apart: their numbers then differ"
            f" {self.ratio:.2g} times as much as noise lets expect, and the residuals are"
            f" {self.residual:.2g} times as large ({chance_text(self.chance)}). The model misses"
            " something that changes sides, such as play of a joint that hangs where the load"
            " pushes it, or a bowed rail"
        )


def sides(found: Solution) -> Sides | None:
    """Test all ways to divide the poses by the middle of a coordinate; None where it cannot be."""
    sure = found.fit.uncertainty
    if sure.mixed or sure.rounded or not sure.equations.whitening.any_read:
        return None
    if not (found.fit.end.status == 0).all():
        return None
    weighed = weighed_alike(found)
    seen = _worst(found, weighed.fit)
    if seen is None or seen.chance >= RARE:
        return seen
    explained = beside_causes(found, weighed, seen.residual)
    return seen if explained is None else _worst(found, explained)


def _worst(found: Solution, fit: LinearFit) -> Sides | None:
    """The way to divide the poses that shows the largest difference."""
    groups = dict(_groups(found))
    use, key = equations_of_visits(found, visits_of(found))
    known = tested(found, fit, groups, use, key) if groups else {}
    if not known:
        return None
    where = min(known, key=lambda each: known[each].chance)
    best = known[where]
    chance = min(1.0, len(known) * best.chance)
    return Sides(where, chance, best.apart, float(np.sqrt(best.ratio)))


def _groups(found: Solution) -> Iterator[tuple[str, BoolArray]]:
    """Rows (N,) on one side of the middle of each coordinate of the poses."""
    equations, end = found.fit.equations, found.fit.end
    pose = end.pose[np.concatenate(equations.table.pose_of)]
    arcs = pose * np.repeat([1.0, end.robot.length], 3)
    for name, way in zip(_WAYS, arcs.T, strict=True):
        if np.ptp(way) > _TRAVEL * end.robot.length:
            yield name, way > np.median(way)


def _level(found: Solution, seen: Sides) -> Level | None:
    if seen.chance >= RARE:
        return None
    return "doubt" if seen.ratio > _FAR else "remark"


CHECKS = (
    Check(
        name="sides", about="the two sides of the workspace fit better apart",
        unless=("grave", "copies", "two-machines", "displaced-target", "follows-loads",
                "sag-lacking"),
        levels=("doubt", "remark"),
        run=lambda found: at_most_one(sides(found)), level_of=_level,
        say=lambda found, seen: str(seen),
    ),
)  # fmt: skip
