"""Elasticity: what yields of a machine under the loads that its rows state, and its own weights.

A compliance is a number of the geometry, and the machine solves its poses by it (`docs/loads.md`):
exactly in its forward kinematics, with derivatives of first order. So the effect is the machine
that has these numbers, and which of them are estimated. Of an arm it is its joints that yield.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any, ClassVar

import numpy as np

from pkmcal.arguments import flag, words
from pkmcal.arms.arm import SerialArm
from pkmcal.arms.joint_laws import Term
from pkmcal.effects.effect import Changed
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.elastic import COMPLIANCE, PER_LENGTH
from pkmcal.geometry.yielding import elastic_numbers
from pkmcal.kinematics.arm_machine import ArmMachine
from pkmcal.kinematics.calibratable import as_arm


@dataclass(frozen=True)
class Elasticity:
    """Compliances of numbers of the limbs, or of joints of an arm, an effect that `identify` finds.

    Numbers that yield already begin at the compliance that the machine has, others at 0. The
    estimates are numbers of the geometry that is found: ``compliance.offset1`` …, in mm/N and
    rad/(N mm). Joints of an arm yield to the loads of the rows, and to the weights of links whose
    masses its file or URDF states: ``compliance1`` ….

    Parameters
    ----------
    numbers : str or sequence of str
        Names or wildcards: ``"offset*"`` of legs and screws, ``"rod*"``, ``"base*"`` of bearings,
        a parameter that several limbs follow; of an arm ``"joint*"``, ``"joint2"``.
    per_length : bool
        Whether compliances of legs and screws also grow along their way, mm/N per mm:
        ``compliance.offset1.per_length``.

    Examples
    --------
    >>> import pkmcal as pk
    >>> robot = pk.load("hexapod")
    >>> q = robot.inverse(pk.sample_poses(robot, 30))
    >>> soft = pk.VirtualMachine(robot.yielding({"offset*": 1e-4}), noise=0.01)
    >>> rows = [soft.measure(q, "pose", load=pk.Load(mass=kg)) for kg in (0, 100)]
    >>> found = pk.identify(robot, rows, free="offset*", effects=[pk.Elasticity("offset*")])
    >>> bool(abs(found.robot.geometry["compliance.offset1"] - 1e-4) < 1e-5)
    True
    """

    numbers: str | Sequence[str] = "offset*"
    per_length: bool = False
    name: ClassVar[str] = "elasticity"

    def __post_init__(self) -> None:
        if not words("numbers", self.numbers):
            raise ArgumentError("numbers: name at least one that yields")
        flag("per_length", self.per_length)

    @property
    def option(self) -> str:
        """The effect as a word of ``--effects``."""
        return f"elasticity={':'.join(words('numbers', self.numbers))}"

    def of_machine(self, machine: Any) -> Changed:
        """The machine that yields, its compliances free.

        Raises
        ------
        ValueError
            A name that matches no number of a limb and no joint of an arm, or one that does not
            yield.
        """
        if (arm := as_arm(machine)) is not None:
            return self._of_arm(arm)
        known = dict(machine.geometry.items())
        patterns = words("numbers", self.numbers)
        numbers = [name for each in patterns for name in elastic_numbers(machine.model, each)]
        compliance = {name: known.get(COMPLIANCE + name, 0.0) for name in numbers}
        freed = [COMPLIANCE + name for name in compliance]
        if self.per_length:
            freed += [name + PER_LENGTH for name in freed]
        yielding = machine.yielding(compliance, per_length=self.per_length)
        return Changed(self.name, yielding, dict.fromkeys(freed, np.inf))

    def _of_arm(self, arm: SerialArm) -> Changed:
        if self.per_length:
            raise ArgumentError(f"per_length: {arm.name} is an arm, whose joints have no length")
        names = [f"joint{i + 1}" for i in range(arm.n_joints)]
        chosen = set()
        for pattern in words("numbers", self.numbers):
            hits = [i for i, name in enumerate(names) if fnmatchcase(name, pattern)]
            if not hits:
                raise ArgumentError(
                    f"elasticity: no joint of the arm {arm.name} matches {pattern!r}; they are"
                    f" {', '.join(names)}"
                )
            chosen |= {*hits}
        terms = [Term(i, "compliance") for i in sorted(chosen)]
        yielding = ArmMachine(arm.weighed().with_terms(terms))
        return Changed(self.name, yielding, dict.fromkeys((term.name for term in terms), np.inf))
