"""Errors of numbers that a fit held at which its stated uncertainty is doubled.

An error φ of held numbers moves the parameters by G K φ, with K the derivative of the whitened
readings by them and G that of the parameters by the readings. Independent errors of deviation t add
t² G K Kᵀ Gᵀ to the covariance C: its trace is four times that of C at t² = 3 tr C / tr G K Kᵀ Gᵀ.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.display import displayed
from pkmcal.estimation.parameters import Parameters
from pkmcal.estimation.uncertain_numbers import uncertain_names
from pkmcal.fitted.fit import Fit
from pkmcal.fitted.held_numbers import held_numbers
from pkmcal.geometry.elastic import is_elastic
from pkmcal.geometry.load import is_of_load
from pkmcal.geometry.stated_uncertainty import StatedUncertainty
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.statistics.linear_fit import column_basis

_KINDS = ("mm", "rad", "1")
_NOTHING = 1e-9  # share of the largest motion by a number of its unit: less is rounding
_MOST = {"mm": 0.02, "rad": 0.02, "1": 0.02}  # of the machine's length, rad, and of a ratio
_POSES = 4096  # at most, over all of them, at which descriptions are compared
_REDUNDANT = 1e-6  # share of a number's motion that no free number has, below which it is one


@dataclass(frozen=True)
class Breakeven:
    """Numbers of one unit that a fit held, and how wrong they may be.

    Attributes
    ----------
    kinds : tuple of str
        The numbers, as wildcards where none of that kind is stated.
    unit : str
        "mm", "rad" or "1".
    deviation : float
        Of independent errors of all of them, with which the standard deviations of the result are
        double on the whole.
    """

    kinds: tuple[str, ...]
    unit: str
    deviation: float

    def __str__(self) -> str:
        value, unit = displayed(self.deviation, self.unit)
        verb = "are" if len(self.kinds) > 1 or self.kinds[0].endswith("*") else "is"
        size = f"{value:.2g}" if unit == "1" else f"{value:.2g} {unit}"
        return f"{', '.join(self.kinds)} {verb} wrong by {size}"


def breakeven(fit: Fit) -> tuple[Breakeven, ...]:
    """Return the errors of held numbers that double ±: lengths, angles and ratios.

    Nothing where equations are mixtures or the noise is not known, and nothing of numbers that
    would have to be wrong by more than machines are.
    """
    sure, chosen = fit.uncertainty, fit.parameters
    if not sure.known or sure.mixed or not len(chosen.places):
        return ()
    names = _candidates(fit, chosen.robot)
    held = held_numbers(sure, fit.end, StatedUncertainty(dict.fromkeys(names, 1.0)))
    if held is None:
        return ()
    follow = sum(sure.fit.back @ (sure.fit.design[rows].T @ some) for rows, some in held.columns())
    total = float(np.trace(sure.scaled))
    most = _MOST | {"mm": _MOST["mm"] * chosen.robot.length}
    found = []
    for unit in _KINDS:
        mine = [i for i, own in enumerate(held.units) if own == unit]
        moved = float((follow[:, mine] ** 2).sum())
        if moved > 0.0 and (wrong := float(np.sqrt(3.0 * total / moved))) <= most[unit]:
            kinds = _kinds([held.names[i] for i in mine], chosen)
            found.append(Breakeven(kinds, unit, wrong))
    return tuple(found)


def _kinds(names: list[str], chosen: Parameters) -> tuple[str, ...]:
    """Wildcards for names; the names themselves of a kind of which some are stated."""
    geometry, asked = chosen.robot.geometry, chosen.asked.uncertainty
    stated = {*uncertain_names(asked, chosen.robot, ()), *_considered(chosen)}
    found = dict[str, None]()
    for name in names:
        kind = re.sub(r"[0-9].*", "*", name)
        found[name if stated.intersection(geometry.match(kind)) else kind] = None
    return tuple(found)


def _considered(chosen: Parameters) -> list[str]:
    """Numbers that are held, and for whose errors ± allow."""
    return uncertain_names(StatedUncertainty(chosen.asked.uncertainty.consider), chosen.robot, ())


def in_words(found: tuple[Breakeven, ...]) -> str:
    """Return one sentence on these errors; "" without any."""
    if not found:
        return ""
    return (
        f"numbers that are not free count as exact; ± double on the whole if"
        f" {', or '.join(map(str, found))}: state --uncertainty (uncertainty=) if such errors are"
        " possible"
    )


def _candidates(fit: Fit, robot: Calibratable) -> list[str]:
    """Numbers of the geometry that are held and are no other description of the free ones."""
    geometry, chosen = robot.geometry, fit.parameters
    free = {geometry.names[place] for place in chosen.places}
    tied = {name for name in geometry.names if name not in geometry.match("*")}
    others = [
        name
        for name, unit in zip(geometry.names, geometry.units, strict=True)
        if name not in {*free, *tied, *_considered(chosen)} and unit in _KINDS
        if not is_elastic(name) and not is_of_load(name)
    ]
    own = [geometry.names.index(name) for name in others]
    twists = _twists(fit)
    size = np.linalg.norm(twists, axis=0)
    for unit in _KINDS:
        alike = np.array(geometry.units) == unit
        size[alike & (size <= _NOTHING * size[alike].max(initial=0.0))] = 0.0
    twists = np.where(size > 0.0, twists, 0.0) / np.where(size > 0.0, size, 1.0)
    basis = column_basis(twists[:, chosen.places])
    columns = twists[:, own]
    left = np.linalg.norm(columns - basis @ (basis.T @ columns), axis=0)
    return [name for name, each in zip(others, left, strict=True) if each > _REDUNDANT]


def _twists(fit: Fit) -> FloatArray:
    """Return the platform's twists by all numbers (6 N, p) at poses of the fit, mm."""
    end, robot = fit.end, fit.end.robot
    good = np.flatnonzero(end.status == 0)
    good = good[:: -(-len(good) // _POSES)]
    twists = robot.error_twists(end.pose[good], end.actuators[good]).copy()
    twists[:, :3] *= robot.length
    flat: FloatArray = twists.reshape(-1, twists.shape[2])
    return flat
