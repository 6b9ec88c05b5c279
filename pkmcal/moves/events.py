"""Limits and singularities that a move meets, with their times."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.kinematics.dexterity import dexterity
from pkmcal.kinematics.limits import Feasibility
from pkmcal.kinematics.robot import Robot
from pkmcal.moves.jumps import HALVINGS
from pkmcal.result import Result

_STEPS = 2000  # along a move
_THIRDS = 40  # taken off two steps, to where a margin is least
_NEAR = 4.0  # times what a margin falls by in a step: no dip between steps goes deeper
_STILL = 1e-9  # mm, rad or share: what a margin at rest changes by


class Sample(Protocol):
    """A machine at times of a move."""

    @property
    def pose(self) -> FloatArray:
        """Poses (N, 6)."""

    @property
    def actuators(self) -> FloatArray:
        """Return coordinates of the actuators at times, (N, n)."""


class Sampled(Protocol):
    """The interface that events ask of a move; `Move` describes each member."""

    @property
    def robot(self) -> Robot:
        """The machine."""

    @property
    def start(self) -> FloatArray:
        """First pose (6,) of the move."""

    @property
    def duration(self) -> float:
        """Duration, s."""

    def sample(self, t: FloatArray) -> Sample:
        """The machine at times (N,)."""


@dataclass(frozen=True, repr=False)
class Event(Result):
    """A limit that a move meets.

    Attributes
    ----------
    time : float
        s; when it is first broken.
    until : float
        s; when it is kept again, or the end of the move.
    what : {"reach", "stroke", "base_cone", "platform_cone", "singularity", "pose"}
        The limit; "pose": no pose is found.
    limb : int or None
        Which limb, counted from 1, joints behind the platform as one more; None for the machine as
        a whole.
    """

    time: float
    until: float
    what: str
    limb: int | None

    def _parts(self) -> Iterator[str]:
        machine = {"singularity": "singularity met", "pose": "no pose found"}
        what = machine.get(self.what, f"limb {self.limb}: {self.what.replace('_', ' ')} broken")
        yield f"{self.time:.4f} to {self.until:.4f} s  {what}"


def events(move: Sampled) -> list[Event]:
    """Limits that are broken and singularities that are met, with their times, in order.

    Strokes, joint cones and reach of every limb; a singularity is met where the determinant of
    the closures changes its sign, and from there the machine is on its other side. (With more
    closures than free coordinates there is no determinant: see `Move.conditioning`.)

    Each limit's margin is looked at 2001 times and followed to its least between them, so that
    a limit is found however briefly it is broken. What can be missed lasts less than 1/1000 of
    the duration, in a margin that has more than one minimum in that time or falls more than four
    times as far as from one look to the next; or it goes less than 1e-9 mm or rad too far.

    Strokes are compared with where the actuators drive the limbs. Where no pose is found, as it may
    be straight in joint space, the event says so, and of reach and cones nothing is known.
    """
    times = np.linspace(0.0, move.duration, _STEPS + 1)
    times = np.unique(np.concatenate([times, _dips(move, times)]))
    states = _margins(move, times) < 0.0
    found = []
    for column, (what, limb) in enumerate(_names(move)):
        broken = states[:, column]
        edges = np.flatnonzero(broken[1:] != broken[:-1]).tolist()
        turns = [_turn(move, times[k], times[k + 1], column, bool(broken[k])) for k in edges]
        if broken[0]:
            turns.insert(0, 0.0)
        if len(turns) % 2:
            turns.append(move.duration)
        pairs = zip(turns[::2], turns[1::2], strict=True)
        found += [Event(first, last, what, limb) for first, last in pairs]
    return sorted(found, key=lambda event: event.time)


def _names(move: Sampled) -> list[tuple[str, int | None]]:
    tail = move.robot.model.mechanism.tail > 0
    limbs = range(1, len(move.robot.model.limbs) + tail + 1)
    names: list[tuple[str, int | None]] = [
        (what, limb) for what in Feasibility.LIMITS for limb in limbs
    ]
    return [*names, ("singularity", None), ("pose", None)]


def _margins(move: Sampled, times: FloatArray) -> FloatArray:
    """Return the margin of each limit at times, (N, limits); below 0 where it is broken.

    Reach is left where a limb's actuator can no longer move it: where its transmission is 0.
    """
    at = move.sample(times)
    pose, feasible = at.pose, move.robot.feasible(at.pose, at.actuators)
    known = np.isfinite(pose).all(axis=1, keepdims=True)
    there = dexterity(move.robot, np.vstack([move.start, pose]))
    reach = np.where(feasible.reach, np.nan_to_num(there.transmission[1:, None]), -1.0)
    found = [np.where(known, reach, np.inf)]
    for what in Feasibility.LIMITS[1:]:
        margin = getattr(feasible, f"{what}_margin")
        inside = np.where(getattr(feasible, what), np.maximum(margin, 0.0), -1.0)
        found.append(np.where(np.isnan(margin), np.inf, inside))
    side = there.determinant[1:] * np.sign(there.determinant[0])
    side = np.where(np.isnan(side), np.inf, side)[:, None]
    return np.hstack([*found, side, np.where(known, np.inf, -1.0)])


def _dips(move: Sampled, times: FloatArray) -> FloatArray:
    """Return times of least margin, of margins that may vanish between times (N,)."""
    margins = _margins(move, times)
    before, here, after = margins[:-2], margins[1:-1], margins[2:]
    with np.errstate(invalid="ignore"):  # limits not stated are infinitely far
        fall = np.maximum(before - here, after - here)
        least = (here >= 0) & (here <= before) & (here <= after)
        rows, columns = np.nonzero(least & (fall > _STILL) & (here < _NEAR * fall))
    low, high = times[rows], times[rows + 2]
    own = np.arange(len(rows)), columns
    for _ in range(_THIRDS if len(rows) else 0):
        left, right = low + (high - low) / 3, high - (high - low) / 3
        falls = _margins(move, left)[own] > _margins(move, right)[own]
        low, high = np.where(falls, left, low), np.where(falls, high, right)
    return (low + high) / 2


def _turn(move: Sampled, low: float, high: float, column: int, before: bool) -> float:
    """Find the time between two at which a limit changes."""
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        if bool(_margins(move, np.array([middle]))[0, column] < 0) == before:
            low = middle
        else:
            high = middle
    return (low + high) / 2
