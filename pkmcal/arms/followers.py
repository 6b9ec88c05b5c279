"""Joints of an arm that follow others by a fixed ratio: stages of a telescope, linked axes.

All joints stand at θ = S q, with the commands q of the joints that have an actuator: a row of S is
that joint's own 1, or the ratios by which a joint without actuator follows.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import NamedTuple

import numpy as np

from pkmcal.arguments import instance, number, shown
from pkmcal.arrays import FloatArray, IntArray
from pkmcal.exceptions import ArgumentError, ArgumentTypeError

Follows = Mapping[int, Mapping[int, float]]


class Ratio(NamedTuple):
    """A joint without actuator, a joint that it follows, both counted from 1, and by how much."""

    joint: int
    leader: int
    by: float


class Followers:
    """The joints of an arm that follow others.

    Parameters
    ----------
    ratios : mapping of int to mapping of int to float, or None
        Of a joint that follows, the joints that lead it, counted from 1, each with mm or rad of
        the follower per mm or rad of the leader.
    joints : int
        Number of joints, n.

    Raises
    ------
    ValueError, TypeError
        A joint that the arm has not, one that follows itself or a follower, or nothing that leads.
    """

    def __init__(self, ratios: Follows | None, joints: int) -> None:
        given = {} if ratios is None else ratios
        self.joints = joints
        self.ratios = tuple(sorted(_checked(given, joints)))
        self.driven: IntArray = np.array(
            [i for i in range(joints) if i + 1 not in given], dtype=np.intp
        )
        if not self.driven.size:
            raise ArgumentError("follows: no joint is left that has an actuator")

    def __bool__(self) -> bool:
        return bool(self.ratios)

    @cached_property
    def shares(self) -> FloatArray:
        """S, (n, m): how far each joint moves by each actuator."""
        found = np.zeros((self.joints, self.driven.size))
        found[self.driven, np.arange(self.driven.size)] = 1.0
        column = {int(joint) + 1: k for k, joint in enumerate(self.driven)}
        for joint, leader, by in self.ratios:
            found[joint - 1, column[leader]] = by
        return found

    def joints_at(self, commands: FloatArray) -> FloatArray:
        """Return the coordinates (N, n) of all joints at commands (N, m)."""
        if not self:
            return commands
        found: FloatArray = np.empty((len(commands), self.joints))
        found[:, self.driven] = commands
        for joint in dict.fromkeys(ratio.joint for ratio in self.ratios):
            leaders = [(leader, by) for own, leader, by in self.ratios if own == joint]
            found[:, joint - 1] = sum(by * found[:, leader - 1] for leader, by in leaders)
        return found

    def table(self) -> dict[int, dict[int, float]]:
        """The argument that makes the same followers."""
        found: dict[int, dict[int, float]] = {}
        for joint, leader, by in self.ratios:
            found.setdefault(joint, {})[leader] = by
        return found

    def limits(self, of_joints: FloatArray) -> FloatArray:
        """Ends of the commands (m, 2) at which no joint leaves its own (n, 2).

        A joint that follows several bounds none of them by itself, and is left out.
        """
        found: FloatArray = of_joints[self.driven].copy()
        column = {int(joint) + 1: k for k, joint in enumerate(self.driven)}
        for joint, of in self.table().items():
            if len(of) > 1:
                continue
            ((leader, by),) = of.items()
            if by:
                low, high = sorted((of_joints[joint - 1] / by).tolist())
                ends = found[column[leader]]
                ends[:] = max(low, ends[0]), min(high, ends[1])
        return found


def _checked(given: Follows, joints: int) -> Iterator[Ratio]:
    if not isinstance(given, Mapping) or not all(isinstance(e, Mapping) for e in given.values()):
        raise ArgumentTypeError(f"follows must be {{joint: {{leader: by}}}}, found {shown(given)}")
    for joint, leaders in given.items():
        if not 1 <= instance("follows", joint, int) <= joints:
            raise ArgumentError(f"follows: joints are 1 to {joints}, found {shown(joint)}")
        if not leaders:
            raise ArgumentError(f"follows: joint {joint} follows none")
        for leader, by in leaders.items():
            if not 1 <= instance("follows", leader, int) <= joints or leader == joint:
                raise ArgumentError(
                    f"follows: joint {joint} must follow another one, 1 to {joints};"
                    f" found {shown(leader)}"
                )
            if leader in given:
                raise ArgumentError(
                    f"follows: joint {joint} follows joint {leader}, which follows others: state"
                    " those"
                )
            yield Ratio(joint, leader, number(f"follows: joint {joint} by joint {leader}", by))
