"""Gears of an arm: periodic errors of joints, joints that others turn along, backlash.

Numbers of the arm as drive laws of parallel machines have them. An eccentric encoder or a tilted
joint makes one or two waves a turn of the joint, a harmonic drive twice its ratio.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pkmcal.arguments import instance, number
from pkmcal.arms.arm import SerialArm
from pkmcal.arms.joint_laws import Term
from pkmcal.effects.effect import Changed
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.arm_machine import ArmMachine
from pkmcal.kinematics.calibratable import Calibratable, as_arm

_TURNS = 1e-3  # rad: how large errors of gears are, more or less; of slides as many mm/m of an arm
_FOLLOWED = 0.1  # share of a ratio that is stated, by which it may be wrong, more or less
Joints = Literal["all"] | int | Sequence[int]


@dataclass(frozen=True)
class Harmonics:
    """Periodic errors of joints, an effect that `identify` finds.

    Parameters
    ----------
    waves : float or sequence of float
        Waves a turn of the joint; of joints that slide per mm, in rad.
    joints : "all", int or sequence of int
        Which have them, counted from 1; "all": every joint that turns.
    turns : float
        Standard deviation of each number, rad: its prior.

    Examples
    --------
    >>> Harmonics((1, 2)).name
    'harmonics 1, 2'
    """

    waves: float | Sequence[float]
    joints: Joints = "all"
    turns: float = _TURNS

    @property
    def name(self) -> str:
        """Name of the effect in messages."""
        of = "" if self.joints == "all" else f" of joint {_listed(_several(self.joints))}"
        return f"harmonics {_listed(self._waves())}{of}"

    @property
    def option(self) -> str:
        """The effect as a word of ``--effects``."""
        of = "" if self.joints == "all" else f"@{':'.join(map(str, _several(self.joints)))}"
        return f"harmonics={':'.join(f'{k:g}' for k in self._waves())}{of}"

    def _waves(self) -> list[float]:
        given = [self.waves] if isinstance(self.waves, int | float) else [*self.waves]
        found = [number("waves", each, above=0.0) for each in given]
        if not found or len(set(found)) < len(found):
            raise ArgumentError(f"waves: different numbers above 0, found {self.waves!r}")
        return found

    def of_machine(self, machine: Calibratable) -> Changed:
        """The arm with these numbers.

        Raises
        ------
        ValueError, TypeError
            No arm, joints that it has not, waves that are no numbers above 0.
        """
        arm = _arm(machine, "harmonics")
        joints = _joints(arm, self.joints)
        terms = [Term(i, kind, k) for i in joints for k in self._waves() for kind in ("cos", "sin")]
        return _changed(
            self.name, arm, terms, [number("turns", self.turns, above=0.0)] * len(terms)
        )


@dataclass(frozen=True)
class Coupling:
    """Joints that others turn along, as gears of a wrist do: an effect that `identify` finds.

    A coupling that is there by design, of linked axes, stands in the arm's file.

    Parameters
    ----------
    pairs : sequence of (int, int)
        A joint and the one that turns it, counted from 1.
    ratio : float, optional
        Standard deviation of each number, the share of the other joint's turn: its prior. By
        default 0.001, and a tenth of the ratio that the arm states where the joint follows.
    """

    pairs: Sequence[tuple[int, int]]
    ratio: float | None = None

    name = "coupling"

    @property
    def option(self) -> str:
        """The effect as a word of ``--effects``."""
        return f"coupling={':'.join(f'{joint}.{other}' for joint, other in self.pairs)}"

    def of_machine(self, machine: Calibratable) -> Changed:
        """The arm with these numbers.

        Raises
        ------
        ValueError, TypeError
            No arm, or no pairs of its joints.
        """
        arm = _arm(machine, self.name)
        if not isinstance(self.pairs, Iterable) or any(
            np.shape(pair) != (2,) for pair in self.pairs
        ):
            raise ArgumentError(f"coupling: pairs of joints, such as (5, 4); found {self.pairs!r}")
        terms, sigmas = [], []
        stated = arm.followers.table() or {}
        for pair in self.pairs:
            joint, other = _joints(arm, pair) if pair[0] < pair[1] else _joints(arm, pair)[::-1]
            terms.append(Term(joint, "coupling", other))
            follows = abs(stated.get(joint + 1, {}).get(other + 1, 0.0))
            own = max(_TURNS, _FOLLOWED * follows) if self.ratio is None else self.ratio
            sigmas.append(number("ratio", own, above=0.0))
        return _changed(self.name, arm, terms, sigmas)


@dataclass(frozen=True)
class Backlash:
    """Backlash: the way of a joint after a fall of its reading beyond that after a rise.

    The measurements say from where each joint came (`Measurements.approach`).

    Parameters
    ----------
    joints : "all", int or sequence of int
        Counted from 1; "all": every joint that turns.
    turns : float
        Standard deviation of each number, rad: its prior.
    """

    joints: Joints = "all"
    turns: float = _TURNS

    name = "backlash"

    def of_machine(self, machine: Calibratable) -> Changed:
        """The arm with these numbers.

        Raises
        ------
        ValueError, TypeError
            No arm, or joints that it has not.
        """
        arm = _arm(machine, self.name)
        terms = [Term(i, "backlash") for i in _joints(arm, self.joints)]
        return _changed(
            self.name, arm, terms, [number("turns", self.turns, above=0.0)] * len(terms)
        )


def _arm(machine: Calibratable, effect: str) -> SerialArm:
    arm = as_arm(machine)
    if arm is None:
        raise ArgumentError(
            f"{effect}: {machine.name} is no serial arm; limbs have drive laws in the robot file"
        )
    return arm


def _changed(name: str, arm: SerialArm, terms: Sequence[Term], sigmas: Sequence[float]) -> Changed:
    """The arm with these terms, free with priors of these deviations; of slides the arcs."""
    free = {
        term.name: sigma * arm.length
        if arm.kinds[term.joint] == "prismatic" and term.kind != "coupling"
        else sigma
        for term, sigma in zip(terms, sigmas, strict=True)
    }
    return Changed(name, ArmMachine(arm.with_terms(terms)), free)


def _several(given: Joints) -> list[int]:
    return [given] if isinstance(given, int) else [instance("joints", j, int) for j in given]


def _joints(arm: SerialArm, given: Joints) -> list[int]:
    """The joints, counted from 0, in their order."""
    if given == "all":
        return [i for i, kind in enumerate(arm.kinds) if kind == "revolute"]
    if isinstance(given, str):
        raise ArgumentError(f'joints: "all" or numbers from 1 to {arm.n_joints}; found {given!r}')
    found = _several(given)
    if not found or len(set(found)) < len(found) or not {*found} <= {*range(1, arm.n_joints + 1)}:
        raise ArgumentError(f"joints: different ones, 1 to {arm.n_joints}; found {given!r}")
    return sorted(each - 1 for each in found)


def _listed(numbers: Iterable[float]) -> str:
    return ", ".join(f"{each:g}" for each in numbers)
