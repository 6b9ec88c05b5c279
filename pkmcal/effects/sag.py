"""Sag of an arm: its joints yield under the weight of its links, whose masses need not be known.

The torque of gravity about a joint is linear in the moments of the links behind it, and so is what
it turns the joint. Products of moment and compliance are found as numbers of the arm, in rad: they
are turns of a joint by a unit moment of a link. Where masses are known one compliance a joint says
as much (`Sag(tied=True)`), and what another payload does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pkmcal.arguments import instance, number
from pkmcal.arms.arm import SerialArm
from pkmcal.arms.joint_laws import Term, sag_term
from pkmcal.arms.joint_pulls import JointPulls
from pkmcal.arrays import FloatArray
from pkmcal.effects.effect import Changed
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.arm_machine import ArmMachine
from pkmcal.kinematics.calibratable import Calibratable, as_arm

Joints = Literal["main", "all"] | int | Sequence[int]
TURNS = 1e-3  # rad: by so much, more or less, the moments of its links turn a joint of an arm
_POSTURES = 200
_NOTHING = 1e-6  # share of a torque that is none
_MAIN = 2


@dataclass(frozen=True, repr=False)
class Sag:
    """Sag of an arm's joints under its own weight, an effect that `identify` finds.

    Parameters
    ----------
    joints : "main", "all", int or sequence of int
        Those that yield, counted from 1, by the moments of their links. "main": the two that the
        weight of the arm turns most. "all": every joint that gravity can turn.
    tied : bool
        Whether masses and centres of the links are known, from the arm's file or its URDF: then one
        compliance a joint is found.
    turns : float
        Standard deviation of what moments turn a joint, rad: the prior of its numbers.

    Examples
    --------
    >>> Sag("all")
    Sag('all')
    """

    joints: Joints = "main"
    tied: bool = False
    turns: float = TURNS

    @property
    def name(self) -> str:
        """Name of the effect in messages; products and compliances may be found together."""
        return "tied sag" if self.tied else "sag"

    def __repr__(self) -> str:
        stated = [] if self.joints == "main" else [repr(self.joints)]
        stated += ["tied=True"] * self.tied
        stated += [] if self.turns == TURNS else [f"turns={self.turns!r}"]
        return f"Sag({', '.join(stated)})"

    @property
    def option(self) -> str:
        """The effect as a word of ``--effects``."""
        if self.tied:
            return "sag=tied"
        if self.joints == "main":
            return "sag"
        joints = [self.joints] if isinstance(self.joints, str | int) else self.joints
        return f"sag={':'.join(map(str, joints))}"

    def of_machine(self, machine: Calibratable) -> Changed:
        """The arm with the numbers of its sag.

        Raises
        ------
        ValueError, TypeError
            No arm, a joint that it has not or that gravity cannot turn, masses that are not known.
        """
        arm = as_arm(machine)
        if arm is None:
            raise ArgumentError(
                f"sag: {machine.name} is no serial arm; of other machines compliances are numbers"
            )
        turns = number("turns", self.turns, above=0.0)
        products = _products(arm)
        joints = self._chosen(arm, products)
        if self.tied:
            return Changed(self.name, *_tied(arm, joints, turns))
        terms = _independent(products, joints)
        own = dict.fromkeys((term.name for term in terms), turns)
        return Changed(self.name, ArmMachine(arm.with_terms(terms)), own)

    def _chosen(self, arm: SerialArm, products: FloatArray) -> list[int]:
        """The joints that yield, counted from 0, by what gravity does in all postures."""
        largest = np.abs(products).max(axis=(0, 2, 3))
        turned: list[int] = np.flatnonzero(largest > _NOTHING).tolist()
        if not turned:
            raise ArgumentError(f"sag: gravity turns no joint of {arm.name}")
        if self.joints == "all":
            return turned
        if self.joints == "main":
            lever = _levers(arm)
            return sorted(sorted(turned, key=lambda i: -lever[i])[:_MAIN])
        if isinstance(self.joints, str):
            raise ArgumentError(f'sag: joints are "main", "all" or numbers; found {self.joints!r}')
        given = [self.joints] if isinstance(self.joints, int) else list(self.joints)
        for each in given:
            instance("joints", each, int)
            if each - 1 not in turned:
                known = ", ".join(str(i + 1) for i in turned)
                raise ArgumentError(f"sag: gravity turns joints {known}; found {each}")
        return sorted({each - 1 for each in given})


def _postures(arm: SerialArm) -> FloatArray:
    """Coordinates of all joints all over, which do not depend on what was measured."""
    turning = np.array([unit == "rad" for unit in arm.actuator_units])
    spread = np.where(turning, np.pi, arm.length)
    drawn = np.random.default_rng(0).uniform(-1.0, 1.0, (_POSTURES, arm.n_actuators))
    return arm.joint_coordinates(drawn * spread)


def _products(arm: SerialArm) -> FloatArray:
    """Return `gravity_products` in all postures, (_POSTURES, n, n, 3)."""
    laws, n = arm.joint_laws, arm.n_joints
    if not laws.pulls.directed:
        raise ArgumentError("gravity must have a direction, found 0 0 0")
    behind = np.triu(np.ones((n, n))) * np.array([[kind == "revolute"] for kind in arm.kinds])
    products = laws.pulls.products(laws.posture(_postures(arm)))
    return np.asarray(products * behind[..., None])


def _levers(arm: SerialArm) -> FloatArray:
    """Rms torque about each joint (n,) if all links weighed alike, half way to the next joint."""
    ends = np.vstack([arm.points[1:], arm.home[None, :3, 3]])
    return _rms_torques(arm, np.ones(arm.n_joints), (arm.points + ends) / 2)


def _rms_torques(arm: SerialArm, masses: FloatArray, centres: FloatArray) -> FloatArray:
    """Rms torque of links with these masses (n,) and centres (n, 3) about each joint, (n,)."""
    laws, postures = arm.joint_laws, _postures(arm)
    weights = JointPulls(arm.axes, arm.points, arm.kinds, laws.pulls.gravity, masses, centres)
    torques = weights.torques(laws.posture(postures), postures)
    rms: FloatArray = np.sqrt(np.mean(torques**2, axis=0))
    return rms


def _independent(products: FloatArray, joints: Sequence[int]) -> list[Term]:
    """Products of which each turns its joint otherwise than those before it.

    A moment along the axis of the next joint turns with that joint's link as well.
    """
    found: list[Term] = []
    for joint in joints:
        basis = np.zeros((_POSTURES, 0))
        for link in (each for each in joints if each >= joint):
            for axis in range(3):
                column = products[:, joint, link, axis]
                left = column - basis @ (basis.T @ column)
                size = float(np.linalg.norm(left))
                if size > _NOTHING * np.sqrt(_POSTURES):
                    basis = np.column_stack([basis, left / size])
                    found.append(sag_term(joint, link, axis))
    return found


def _tied(
    arm: SerialArm, joints: Sequence[int], turns: float
) -> tuple[ArmMachine, dict[str, float]]:
    """The arm with a compliance of each of these joints, and the deviations of their priors."""
    arm = arm.weighed()
    pulls = arm.joint_laws.pulls
    assert pulls.masses is not None and pulls.centres is not None
    if not pulls.masses.any():
        raise ArgumentError(
            "sag: tied needs masses: keys mass and centre of the joints in the arm's file, or"
            " inertials in its URDF"
        )
    size = _rms_torques(arm, pulls.masses, pulls.centres)
    own = {}
    for i in joints:
        if not size[i] > 0.0:
            raise ArgumentError(f"sag: the links behind joint {i + 1} weigh nothing")
        own[Term(i, "compliance")] = turns / float(size[i])
    return ArmMachine(arm.with_terms(own)), {term.name: each for term, each in own.items()}
