"""Moves of a machine: straight in space or straight in its actuators, and what they break."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from pkmcal import digits
from pkmcal import motion as motions
from pkmcal.core import FloatArray, as_rows
from pkmcal.feasible import Feasibility
from pkmcal.geometries import ON_THE_MANIFOLD
from pkmcal.law import CUBIC, QUINTIC, JerkLimited, Polynomial, jerk_limited, limit
from pkmcal.limb_kinds import KINDS
from pkmcal.robot import Robot, require_parallel
from pkmcal.screw import to_pose
from pkmcal.workspace import dexterity

_LAWS = {"cubic": CUBIC, "quintic": QUINTIC}
_STEPS = 2000  # along a move, in search of peaks and of limits
_HALVINGS = 50  # of a step, to the time a limit is met

Space = Literal["pose", "joint"]


@dataclass(frozen=True, eq=False)
class MoveSample:
    """A machine at N times of a move; every array has the shape of the times first.

    Attributes
    ----------
    time : ndarray (...)
        s.
    pose : ndarray (..., 6)
        x y z in mm, α β γ in rad.
    twist : ndarray (..., 6)
        (ω, v) in rad/s and mm/s, v that of the platform's origin; base axes.
    twist_rate : ndarray (..., 6)
        Its derivative by time. NaN in a move straight in the actuators of a machine whose limbs
        constrain the pose.
    actuators, velocities, accelerations : ndarray (..., n)
        mm or rad, and s.
    """

    time: FloatArray
    pose: FloatArray
    twist: FloatArray
    twist_rate: FloatArray
    actuators: FloatArray
    velocities: FloatArray
    accelerations: FloatArray


@dataclass(frozen=True)
class Event:
    """A limit that a move meets.

    Attributes
    ----------
    time : float
        s; when it is first broken.
    until : float
        s; when it is kept again, or the end of the move.
    what : str
        The limit: "reach", "stroke", "base_cone", "platform_cone" or "singularity".
    limb : int or None
        Which limb, counted from 1; None for the machine as a whole.
    """

    time: float
    until: float
    what: str
    limb: int | None


@dataclass(frozen=True, eq=False)
class Move:
    """A move of a machine from rest to rest, made by `move`.

    Attributes
    ----------
    robot : Robot
        The machine.
    start, end : ndarray (6,)
        Poses.
    space : str
        What is straight: "pose" or "joint".
    law : Polynomial or JerkLimited
        Of the share of the way in pose space, of the actuators in joint space.
    """

    robot: Robot
    start: FloatArray
    end: FloatArray
    space: Space
    law: Polynomial | JerkLimited

    @property
    def duration(self) -> float:
        """How long it takes, s."""
        return self.law.duration

    def sample(self, t: ArrayLike) -> MoveSample:
        """Position, velocity and acceleration of platform and actuators at times.

        Parameters
        ----------
        t : array_like (...)
            s.
        """
        times = np.asarray(t, dtype=np.float64)
        made = self._in_pose if self.space == "pose" else self._in_joint
        motion, actuators = made(times.reshape(-1))
        twist, twist_rate = motions.twists(motion)
        found = (to_pose(motion[:, 0]), twist, twist_rate, *actuators)
        return MoveSample(times, *(each.reshape(*times.shape, -1) for each in found))

    def events(self) -> list[Event]:
        """Limits that are broken and singularities that are met, with their times, in order.

        Strokes, joint cones and reach of every limb; a singularity is met where the determinant of
        the closures changes its sign, and from there the machine is on its other side.
        """
        times = np.linspace(0.0, self.duration, _STEPS + 1)
        states = self._states(times)
        found = []
        for column, (what, limb) in enumerate(self._names()):
            broken = states[:, column]
            edges = np.flatnonzero(broken[1:] != broken[:-1]).tolist()
            turns = [self._turn(times[k], times[k + 1], column, bool(broken[k])) for k in edges]
            if broken[0]:
                turns.insert(0, 0.0)
            if len(turns) % 2:
                turns.append(self.duration)
            pairs = zip(turns[::2], turns[1::2], strict=True)
            found += [Event(first, last, what, limb) for first, last in pairs]
        return sorted(found, key=lambda event: event.time)

    def conditioning(self, t: ArrayLike) -> FloatArray:
        """How well the pose is held at times (...): 1 best, 0 at a singularity."""
        return dexterity(self.robot, self.sample(t).pose).conditioning

    def __str__(self) -> str:
        at = self.sample(np.linspace(0.0, self.duration, _STEPS + 1))
        rows = []
        for i, unit in enumerate(self.robot.actuator_units):
            factor, unit = digits.displayed(1.0, unit)
            numbers = (at.actuators[0, i], at.actuators[-1, i], np.abs(at.velocities[:, i]).max(),
                       np.abs(at.accelerations[:, i]).max())  # fmt: skip
            rows.append([f"q{i + 1} [{unit}]", *(f"{number * factor:.4g}" for number in numbers)])
        title = (
            f"{self.robot.name}: straight in {self.space} space, {self.duration:.4g} s,"
            f" conditioning {np.min(self.conditioning(at.time)):.3g} at least"
        )
        head = ["actuator", "from", "to", "top speed [/s]", "top acceleration [/s²]"]
        lines = [title, digits.table(head, rows, left=1)]
        for event in self.events():
            limb = "" if event.limb is None else f"limb {event.limb}: "
            broken = "met" if event.what == "singularity" else "broken"
            lines.append(
                f"{event.time:.4f} to {event.until:.4f} s  {limb}{event.what.replace('_', ' ')}"
                f" {broken}"
            )
        return "\n".join(lines)

    # --------------------------------------------------------------------------------------------

    def _in_pose(self, times: FloatArray) -> tuple[FloatArray, tuple[FloatArray, ...]]:
        position, velocity, acceleration = self.law.sample(times)
        motion = motions.straight(self.start, self.end, (position, velocity, acceleration))
        pose = to_pose(motion[:, 0])
        return motion, (self.robot.inverse(pose), *self.robot.rates(motion))

    def _in_joint(self, times: FloatArray) -> tuple[FloatArray, tuple[FloatArray, ...]]:
        robot, frames, slots = self.robot, self.robot._frames, self.robot._slots
        q, velocity, acceleration = self.law.sample(times)
        way = self.law.end - self.law.start
        share = (q - self.law.start) @ way / max(float(way @ way), 1e-300)
        still = np.zeros_like(share)
        guess = to_pose(motions.straight(self.start, self.end, (share, still, still))[:, 0])
        own = np.ascontiguousarray(frames.inward(robot.forward(q, guess=guess).pose))
        by_q = robot._machine.forward_jacobian(slots, own, np.ascontiguousarray(q))
        rate = np.einsum("nij,nj->ni", by_q, velocity)
        none = np.zeros_like(rate)
        carried = robot._machine.rates(slots, motions.of_pose(own, rate, none))[1]
        bend = np.einsum("nij,nj->ni", by_q, acceleration - carried)
        if not _limbs_alone_determine(robot):
            bend[:] = np.nan
        motion = frames.motion_outward(motions.of_pose(own, rate, bend))
        return motion, (q, velocity, acceleration)

    def _names(self) -> list[tuple[str, int | None]]:
        limbs = range(1, len(self.robot.model.limbs) + 1)
        names: list[tuple[str, int | None]] = [
            (what, limb) for what in Feasibility.LIMITS for limb in limbs
        ]
        return [*names, ("singularity", None)]

    def _states(self, times: FloatArray) -> FloatArray:
        """Which limits are broken at times, (N, limits)."""
        pose = self.sample(times).pose
        feasible = self.robot.feasible(pose)
        side = dexterity(self.robot, np.vstack([self.start, pose])).determinant
        crossed = np.where(np.isfinite(side[1:]), side[1:] * side[0] <= 0, False)
        kept = [getattr(feasible, what) for what in Feasibility.LIMITS]
        return np.hstack([*(~each for each in kept), crossed[:, None]])

    def _turn(self, low: float, high: float, column: int, before: bool) -> float:
        """When a limit changes between two times."""
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            if bool(self._states(np.array([middle]))[0, column]) == before:
                low = middle
            else:
                high = middle
        return (low + high) / 2


def move(
    robot: Robot,
    start: ArrayLike,
    end: ArrayLike,
    duration: float | None = None,
    law: Literal["cubic", "quintic", "jerk-limited"] = "quintic",
    space: Space = "pose",
    velocity: ArrayLike | None = None,
    acceleration: ArrayLike | None = None,
    jerk: ArrayLike | None = None,
) -> Move:
    """A move of a machine from rest to rest between two poses.

    Parameters
    ----------
    robot : Robot
        The machine.
    start, end : array_like (6,)
        x y z in mm, α β γ in rad.
    duration : float, optional
        s; by default the shortest within the limits.
    law : str
        "quintic", "cubic", or in joint space "jerk-limited".
    space : str
        "pose": the platform's origin goes straight and the platform turns about one axis (SLERP);
        "joint": the actuators go straight.
    velocity, acceleration, jerk : array_like () or (n,), optional
        Limits of the actuators, mm or rad, and s; without `duration` at least one is needed.

    Returns
    -------
    Move
        ``.sample(t)``, ``.events()``, ``.duration``; ``print`` shows peaks and broken limits.

    Raises
    ------
    ValueError
        An end that the machine cannot take, a straight path that it cannot follow, no duration and
        no limits, limits that are not positive.

    Examples
    --------
    >>> import pkmcal as pk
    >>> robot = pk.load("rbt-6t03p")
    >>> way = pk.trajectory.move(robot, robot.home, [0, 0, 30, 0, 0, 0.1], velocity=50.0)
    >>> bool(abs(way.sample(way.duration / 2).velocities).max() <= 50.0)
    True
    """
    require_parallel(robot)
    ends = [_pose(robot, "start", start), _pose(robot, "end", end)]
    if space not in ("pose", "joint"):
        raise ValueError(f"space must be 'pose' or 'joint', found {space!r}")
    if duration is not None and not (np.isfinite(duration) and duration > 0):
        raise ValueError(f"duration must be positive, in s; found {duration}")
    n = robot.n_actuators
    limits = {
        name: limit(name, value, n)
        for name, value in (("velocity", velocity), ("acceleration", acceleration), ("jerk", jerk))
        if value is not None
    }
    q = robot.inverse(np.stack(ends))
    if law == "jerk-limited":
        if space == "pose" or duration is not None or len(limits) < 3:
            raise ValueError(
                "a jerk-limited move is straight in joint space and takes velocity, acceleration"
                " and jerk, no duration"
            )
        smooth = jerk_limited(q[0], q[1], **limits)
        return _followed(Move(robot, ends[0], ends[1], space, smooth))
    if law not in _LAWS:
        raise ValueError(f"law must be cubic, quintic or jerk-limited, found {law!r}")
    if "jerk" in limits:
        raise ValueError("jerk is limited by the law 'jerk-limited' alone")
    sides = (q[0], q[1]) if space == "joint" else (np.array(0.0), np.array(1.0))

    def lasting(seconds: float) -> Move:
        made = Polynomial(sides[0], sides[1], seconds, _LAWS[law])
        return Move(robot, ends[0], ends[1], space, made)

    unit = _followed(lasting(1.0))
    return lasting(duration if duration is not None else _fastest(unit, limits))


def _pose(robot: Robot, name: str, pose: ArrayLike) -> FloatArray:
    rows, shape = as_rows(name, pose, 6)
    if shape != ():
        raise ValueError(f"{name} must be one pose (6,), found {(*shape, 6)}")
    off = float(robot.violation(rows[0]))
    if not off <= ON_THE_MANIFOLD:
        why = f"its closures miss by {off:.3g} mm" if np.isfinite(off) else "out of reach"
        raise ValueError(
            f"{name}: {robot.name} cannot take this pose, {why}; robot.complete(pose) makes one"
        )
    pose_given: FloatArray = rows[0]
    return pose_given


def _followed(made: Move) -> Move:
    """The move; raises ValueError where the machine cannot follow the straight path."""
    if made.space == "pose":
        pose = made.sample(np.linspace(0.0, made.duration, 101)).pose
        off = made.robot.violation(pose)
        worst = float(np.nan_to_num(off).max())
        if worst > ON_THE_MANIFOLD:
            raise ValueError(
                f"{made.robot.name} cannot follow the straight path: its closures miss by"
                f" {worst:.3g} mm on the way; use space='joint'"
            )
    return made


def _limbs_alone_determine(robot: Robot) -> bool:
    """Whether a limb an actuator holds the pose, whose other coordinates rest."""
    plain = not any(KINDS[limb.kind].all_rows(limb.couple > 0) for limb in robot.model.limbs)
    count = robot.n_actuators == len(robot.model.limbs) == len(robot.coordinates)
    return plain and count and robot.model.map in ("spatial", "translation", "planar")


def _fastest(unit: Move, limits: dict[str, FloatArray]) -> float:
    """The shortest duration within limits: speeds go with 1/T and accelerations with 1/T²."""
    if not limits:
        raise ValueError("give a duration, or limits of velocity or acceleration")
    parts: dict[str, Callable[[MoveSample], FloatArray]] = {
        "velocity": lambda at: at.velocities,
        "acceleration": lambda at: at.accelerations,
    }
    shortest = 0.0
    for name, most in limits.items():
        order = 1 if name == "velocity" else 2
        peaks = _peaks(unit, parts[name])
        if not np.isfinite(peaks).all():
            raise ValueError("the path leaves the machine's reach or is singular: no fastest move")
        shortest = max(shortest, float(((peaks / most) ** (1 / order)).max()))
    if shortest == 0.0:
        raise ValueError("start and end are the same pose: give a duration")
    return shortest


def _peaks(unit: Move, part: Callable[[MoveSample], FloatArray]) -> FloatArray:
    """The largest size of each actuator's velocity or acceleration, looked at again closely."""
    coarse = np.linspace(0.0, 1.0, _STEPS + 1)
    sizes = np.abs(part(unit.sample(coarse)))
    peaks = sizes.max(axis=0)
    for i, k in enumerate(sizes.argmax(axis=0).tolist()):
        near = np.linspace(coarse[max(k - 1, 0)], coarse[min(k + 1, _STEPS)], _STEPS + 1)
        peaks[i] = max(peaks[i], np.abs(part(unit.sample(near)))[:, i].max())
    return np.asarray(peaks)
