"""The numbers of an arm by name."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np

from pkmcal.arguments import did_you_mean, words
from pkmcal.arms.joint_laws import JointLaws
from pkmcal.arrays import FloatArray
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.chain_joints import ERRORS


@dataclass(frozen=True, eq=False)
class ArmGeometry:
    """The numbers of an arm by name: joint errors, ``joint1.dx`` … ``joint6.dpsi``, then laws.

    Attributes
    ----------
    names, units : tuple of str, p
    values : ndarray (p,)
        mm and rad.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: FloatArray

    @property
    def chain(self) -> FloatArray:
        """Derivative (p, p) of the numbers by themselves: none is tied to another."""
        return np.eye(len(self.values))

    def items(self) -> Iterator[tuple[str, float]]:
        """Name and value of each number."""
        return zip(self.names, self.values.tolist(), strict=True)

    def match(self, patterns: str | Iterable[str], argument: str = "") -> list[str]:
        """Find names and wildcards, each name once, in the order of the patterns.

        Raises
        ------
        ValueError
            A pattern that matches nothing.
        """
        found: dict[str, None] = {}
        for pattern in words(argument or "patterns", patterns):
            hits = [name for name in self.names if fnmatchcase(name, pattern)]
            if not hits:
                known = did_you_mean(pattern, self.names)
                lead = f"{argument}: " if argument else ""
                raise ArgumentError(f"{lead}no number of the arm matches {pattern!r}{known}")
            found.update(dict.fromkeys(hits))
        return list(found)


def arm_geometry(joint_errors: FloatArray, laws: JointLaws | None) -> ArmGeometry:
    """The numbers of an arm with these joint errors (n, 6) and laws of its joints."""
    joints = range(1, len(joint_errors) + 1)
    names = tuple(f"joint{i}.{error}" for i in joints for error in ERRORS)
    units = ("mm", "mm", "mm", "rad", "rad", "rad") * len(joint_errors)
    values = joint_errors.reshape(-1)
    if laws is None:
        return ArmGeometry(names, units, values)
    together = np.concatenate([values, laws.values])
    return ArmGeometry(names + laws.names, units + laws.units, together)
