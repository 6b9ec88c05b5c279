"""Moves of a machine: straight in space or straight in its actuators, and what they break."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import instance, number, word
from pkmcal.arrays import FloatArray, as_rows
from pkmcal.core.library import POSE
from pkmcal.display import POSE_HEADER, Table, displayed, long_table, pose_cells
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.carried import Load
from pkmcal.kinematics.complete import ON_THE_MANIFOLD, Completed, complete, completed_rates
from pkmcal.kinematics.dexterity import dexterity
from pkmcal.kinematics.perturbed import off
from pkmcal.kinematics.robot import Robot, require_parallel
from pkmcal.moves import derivatives
from pkmcal.moves.events import Event, events
from pkmcal.moves.jumps import Jump, jumps, said
from pkmcal.moves.leaps import leap, same
from pkmcal.moves.peaks import STEPS, largest, peaks
from pkmcal.moves.time_laws import (
    CUBIC,
    QUINTIC,
    JerkLimited,
    Polynomial,
    jerk_limited,
    limit,
    seconds,
)
from pkmcal.moves.turns import continued, unwrapped
from pkmcal.result import Result
from pkmcal.screw import from_pose, to_pose

_LAWS = {"cubic": CUBIC, "quintic": QUINTIC}

Space = Literal["pose", "coordinates", "joint"]


@dataclass(frozen=True, eq=False, repr=False)
class MoveSample(Result):
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
        Its derivative by time.
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

    def _parts(self) -> Iterator[str | Table]:
        times = self.time.reshape(-1)
        yield f"{times.size} times of a move of {self.actuators.shape[-1]} actuators"
        rows = zip(times, self.pose.reshape(-1, 6), strict=True)
        cells = ([f"{time:.4f}", *pose_cells(pose)] for time, pose in rows)
        yield from long_table(["t [s]", *POSE_HEADER], cells, times.size)


@dataclass(frozen=True, eq=False, repr=False)
class Move(Result):
    """A move of a machine from rest to rest, made by `move`.

    Attributes
    ----------
    robot : Robot
        The machine.
    start, end : ndarray (6,)
        Poses.
    space : str
        What is straight: "pose", "coordinates" or "joint".
    law : Polynomial or JerkLimited
        Of the actuators in joint space, else of the share of the way.
    jumps : tuple of Jump
        Where a drive law passes a node of its table, and speeds jump: of the actuators, or in joint
        space of the platform. Accelerations, and limits of these, are those between.
    """

    robot: Robot
    start: FloatArray
    end: FloatArray
    space: Space
    law: Polynomial | JerkLimited
    jumps: tuple[Jump, ...] = ()

    @property
    def duration(self) -> float:
        """Duration, s."""
        return self.law.duration

    def sample(self, t: ArrayLike) -> MoveSample:
        """Position, velocity and acceleration of platform and actuators at times.

        Parameters
        ----------
        t : array_like (...)
            s.
        """
        times = seconds(t)
        made = {
            "pose": self._in_pose,
            "coordinates": self._in_coordinates,
            "joint": self._in_joint,
        }
        motion, actuators = made[self.space](times.reshape(-1))
        twist, twist_rate = derivatives.twists(motion)
        found = (to_pose(motion[:, 0]), twist, twist_rate, *actuators)
        return MoveSample(times, *(each.reshape(*times.shape, each.shape[-1]) for each in found))

    def events(self) -> list[Event]:
        """Limits that are broken and singularities that are met, in order of time (`events`)."""
        return events(self)

    def conditioning(self, t: ArrayLike) -> FloatArray:
        """Return the conditioning of the pose at times (...): 1 best, 0 at a singularity."""
        return dexterity(self.robot, self.sample(t).pose).conditioning

    def _parts(self) -> Iterator[str | Table]:
        yield f"{self.robot.name}: straight in {self._straight}, {self.duration:.4g} s"
        ends = self.sample(np.array([0.0, self.duration]))
        speeds, accelerations = peaks(self.sample, self.duration)
        rows = []
        for i, unit in enumerate(self.robot.actuator_units):
            factor, unit = displayed(1.0, unit)
            numbers = (*ends.actuators[:, i], speeds[i], accelerations[i])
            rows.append([f"q{i + 1} [{unit}]", *(f"{number * factor:.4g}" for number in numbers)])
        head = ["actuator", "from", "to", "top speed [/s]", "top acceleration [/s²]"]
        yield Table(head, rows, left=1)
        times = np.linspace(0.0, self.duration, STEPS + 1)
        worse = largest(
            lambda t: -self.conditioning(t)[:, None], times, -self.conditioning(times)[:, None]
        )
        if self.jumps:
            yield said(self.jumps)
        yield f"conditioning {-worse[0]:.3g} at least"
        yield from map(str, self.events())

    # --------------------------------------------------------------------------------------------

    def _in_pose(self, times: FloatArray) -> tuple[FloatArray, tuple[FloatArray, ...]]:
        position, velocity, acceleration = self.law.sample(times)
        motion = derivatives.straight(self.start, self.end, (position, velocity, acceleration))
        return motion, self._driven(motion, position)

    def _driven(self, motion: FloatArray, share: FloatArray) -> tuple[FloatArray, ...]:
        """Actuators with their speeds and accelerations as the platform moves at shares (N,)."""
        robot, slots, frames = self.robot, self.robot.slots, self.robot.frames
        q = self._inverse(frames.inward(to_pose(motion[:, 0])), share)
        own = np.ascontiguousarray(frames.motion_inward(motion))
        return q, *robot.machine.rates(slots, own, q)

    def _in_joint(self, times: FloatArray) -> tuple[FloatArray, tuple[FloatArray, ...]]:
        robot, frames, slots = self.robot, self.robot.frames, self.robot.slots
        q, velocity, acceleration = self.law.sample(times)
        way = self.law.end - self.law.start
        share = (q - self.law.start) @ way / max(float(way @ way), 1e-300)
        still = np.zeros_like(share)
        guess = to_pose(derivatives.straight(self.start, self.end, (share, still, still))[:, 0])
        own = np.ascontiguousarray(frames.inward(robot.forward(q, guess=guess).pose))
        actuators = (q, velocity, acceleration)
        motion = robot.machine.motion(slots, own, *map(np.ascontiguousarray, actuators))[0]
        return frames.motion_outward(motion), actuators

    def _in_coordinates(self, times: FloatArray) -> tuple[FloatArray, tuple[FloatArray, ...]]:
        robot, frames, slots = self.robot, self.robot.frames, self.robot.slots
        share, speed, bend = (each[:, None] for each in self.law.sample(times))
        matched = [POSE.index(name) for name in robot.moved]
        if len(matched) == len(POSE) and robot.machine.rows == robot.machine.m:
            way = off(self.end, self.start)  # all are known, and at β = ±90° rates by them are not
            motion = derivatives.written(self.start + share * way, speed * way, bend * way)
            return motion, self._driven(motion, share[:, 0])
        way = off(self.end, self.start)[matched]
        at = self._completed(share)
        velocity, acceleration = completed_rates(
            robot.machine, robot.model.map, slots, frames, at, matched, (speed * way, bend * way)
        )
        motion = robot.machine.motion(slots, at.own, at.q, velocity, acceleration)[0]
        return frames.motion_outward(motion), (at.q, velocity, acceleration)

    def _completed(self, share: FloatArray) -> Completed:
        """Poses and actuators at shares (N, 1) of a way that is straight in coordinates."""
        if self._turns is None:
            return self._complete(share)
        return self._complete(share, lambda own: self._inverse(own, share[:, 0]))

    def _complete(
        self, share: FloatArray, start: Callable[[FloatArray], FloatArray] | None = None
    ) -> Completed:
        robot = self.robot
        matched = [POSE.index(name) for name in robot.moved]
        way = self.start + share * off(self.end, self.start)
        parts = robot.machine, robot.model.map, robot.slots, robot.frames
        return complete(*parts, way, matched, start=start)

    def _inverse(self, own: FloatArray, share: FloatArray) -> FloatArray:
        """Coordinates (N, n) at own poses (N, 6) and shares (N,), at the turns of the way."""
        machine, slots = self.robot.machine, self.robot.slots
        if self._turns is None:
            return machine.inverse(slots, own)
        shares = np.linspace(0.0, 1.0, len(self._turns))
        near = np.stack([np.interp(share, shares, each) for each in self._turns.T], axis=1)
        return continued(machine, slots, machine.drives_at(slots, own), near)

    @cached_property
    def _turns(self) -> FloatArray | None:
        """q̃ of each drive (k, drives) evenly along the way, whose angles do not jump.

        None where no drive turns.
        """
        robot, machine, slots = self.robot, self.robot.machine, self.robot.slots
        if not machine.turning.any():
            return None
        share = np.linspace(0.0, 1.0, STEPS + 1)
        if self.space == "coordinates":
            own = self._complete(share[:, None]).own
        else:
            still = np.zeros_like(share)
            motion = derivatives.straight(self.start, self.end, (share, still, still))
            own = robot.frames.inward(to_pose(motion[:, 0]))
        start = machine.drives(slots, robot.inverse(self.start)[None])[0]
        return unwrapped(machine, start, machine.drives_at(slots, own))

    @property
    def _straight(self) -> str:
        if self.space == "coordinates":
            return " ".join(self.robot.moved)
        return f"{self.space} space"


def move(
    robot: Robot,
    start: ArrayLike,
    end: ArrayLike,
    *,
    duration: float | None = None,
    law: Literal["cubic", "quintic", "jerk-limited"] = "quintic",
    space: Space = "pose",
    velocity: ArrayLike | None = None,
    acceleration: ArrayLike | None = None,
    jerk: ArrayLike | None = None,
    load: Load | None = None,
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
    law : {"quintic", "cubic", "jerk-limited"}
        The last in joint space alone.
    space : {"pose", "coordinates", "joint"}
        "pose": the platform's origin goes straight and the platform turns about one axis (SLERP);
        "coordinates": those that the robot file declares to match, or else those that it moves,
        go straight, angles the short way round, and the machine determines the others, as by
        `Robot.complete`;
        "joint": the actuators go straight, those that turn the short way round unless a stroke
        forbids it.
    velocity, acceleration, jerk : array_like () or (n,), optional
        Limits of the actuators, mm or rad, and s; without `duration` at least one is needed. They
        hold between samples too: see Notes.

    load : Load, optional
        What a machine that yields carries all along, in place of the payload that its file states:
        the actuators are those that hold the poses under it, as they are at rest. Ends are poses
        under the load.

    Returns
    -------
    Move
        ``.sample(t)``, ``.events()``, ``.duration``; ``print`` shows peaks and broken limits.

    Raises
    ------
    ValueError
        An end that the machine cannot take, a straight path that it cannot follow, or on which it
        would have to leave its assembly mode, no duration and no limits, limits that are not
        positive.

    Notes
    -----
    The largest velocity and acceleration are sought along the path at 2001 places, and wherever the
    position or the velocity changes by more from one to the next than these can explain, in ever
    smaller steps; each maximum is then closed in on to rounding. What can be missed is shorter than
    a step, 1/2000 of the duration, and changes the position (a velocity) or the velocity (an
    acceleration) there by less than the largest of them does in a step. Steps end at 5e-10 of the
    duration, and a change of less than 1e-11 of the largest position or velocity is rounding.

    The speed of an actuator jumps where its drive law passes a node of a table: accelerations, and
    limits of these, are those of the pieces between. ``.jumps`` has these times, and ``print`` says
    that there are some.

    Examples
    --------
    >>> import pkmcal as pk
    >>> robot = pk.load("rbt-6t03p")
    >>> way = pk.trajectory.move(robot, robot.home, [0, 0, 30, 0, 0, 0.1], velocity=50.0)
    >>> bool(abs(way.sample(way.duration / 2).velocities).max() <= 50.0)
    True
    """
    require_parallel(robot)
    if load is not None:
        instance("load", load, Load).rows(())  # one for the whole move
        robot = robot.under(load)
    ends = [_pose(robot, "start", start), _pose(robot, "end", end)]
    word("space", space, ("pose", "coordinates", "joint"))
    word("law", law, (*_LAWS, "jerk-limited"))
    if duration is not None:
        number("duration", duration, above=0)
    n = robot.n_actuators
    limits = {
        name: limit(name, value, n)
        for name, value in (("velocity", velocity), ("acceleration", acceleration), ("jerk", jerk))
        if value is not None
    }
    q = np.stack([_actuators(robot, pose) for pose in ends])
    q[1] = robot.short_way(q[0], q[1])
    if law == "jerk-limited":
        if space != "joint" or duration is not None or len(limits) < 3:
            raise ArgumentError(
                "a jerk-limited move is straight in joint space and takes velocity, acceleration"
                " and jerk, no duration"
            )
        smooth = jerk_limited(q[0], q[1], **limits)
        return _with_jumps(_followed(Move(robot, ends[0], ends[1], space, smooth)))
    if "jerk" in limits:
        raise ArgumentError("jerk is limited by the law 'jerk-limited' alone")
    sides = (q[0], q[1]) if space == "joint" else (np.array(0.0), np.array(1.0))

    def lasting(seconds: float) -> Move:
        made = Polynomial(sides[0], sides[1], seconds, _LAWS[law])
        return Move(robot, ends[0], ends[1], space, made)

    unit = _followed(lasting(1.0))
    return _with_jumps(lasting(duration if duration is not None else _fastest(unit, limits)))


def _pose(robot: Robot, name: str, pose: ArrayLike) -> FloatArray:
    rows, shape = as_rows(name, pose, 6)
    if shape != ():
        raise ArgumentError(f"{name} must be one pose (6,), found {(*shape, 6)}")
    if np.isnan(_actuators(robot, rows[0])).any():
        missed = float(robot.violation(rows[0]))
        why = f"its closures miss by {missed:.3g} mm" if np.isfinite(missed) else "out of reach"
        raise ArgumentError(
            f"{name}: {robot.name} cannot take this pose, {why}; robot.complete(pose) makes one"
        )
    pose_given: FloatArray = rows[0]
    return pose_given


def _actuators(robot: Robot, pose: FloatArray) -> FloatArray:
    """Coordinates (n,) that lead to a pose (6,); NaN where the machine cannot take it.

    With more closures than free coordinates, and numbers that are not exact, a pose may be as near
    to all closures as it gets: `Robot.complete` leaves it where it is, and limb by limb the inverse
    kinematics has other coordinates for it.
    """
    if robot.violation(pose) <= ON_THE_MANIFOLD:
        return robot.inverse(pose)
    over = robot.machine.rows > robot.machine.m
    if over and np.abs(off(robot.complete(pose), pose)).max() <= ON_THE_MANIFOLD:
        return robot.inverse(pose, match=True)
    return np.full(robot.n_actuators, np.nan)


def _followed(made: Move) -> Move:
    """The move; raises ValueError where the machine cannot follow the straight path."""
    if made.space == "pose":
        pose = made.sample(np.linspace(0.0, made.duration, 101)).pose
        off = made.robot.violation(pose)
        worst = float(np.nan_to_num(off).max())
        if worst > ON_THE_MANIFOLD:
            raise ArgumentError(
                f"{made.robot.name} cannot follow the straight path: its closures miss by"
                f" {worst:.3g} mm on the way; use space='coordinates' or 'joint'"
            )
    if made.space == "coordinates":
        names = " ".join(made.robot.moved)
        t = np.linspace(0.0, made.duration, 101)
        pose = made.sample(t).pose
        unreached = np.flatnonzero(~np.isfinite(pose).all(axis=1))
        if unreached.size:
            raise ArgumentError(
                f"{made.robot.name} cannot follow the path: no pose has its {names}"
                f" {t[unreached[0]]:.4g} s after the start"
            )
        ends = from_pose(pose[[0, -1]]) - from_pose(np.stack([made.start, made.end]))
        if np.abs(ends).max() > ON_THE_MANIFOLD:
            raise ArgumentError(
                f"{made.robot.name}: the path of {names} does not"
                f" lead from start to end but to another assembly mode"
            )
    if made.space != "pose":
        _one_mode(made)
    return made


def _one_mode(made: Move) -> None:
    """Raise ValueError where poses that were found are not of one assembly mode."""
    name, length = made.robot.name, made.robot.length
    if not same(made.sample(made.duration).pose, made.end, length):
        raise ArgumentError(
            f"{name}: the move of the actuators does not lead from start to end but to another"
            " assembly mode"
        )
    time = leap(made.sample, made.duration, length)
    if time is not None:
        raise ArgumentError(
            f"{name} cannot follow the path: {time:.4g} s after the start its assembly mode ends,"
            " and only poses of another one are found; poses nearer to each other may be joined"
        )


def _with_jumps(made: Move) -> Move:
    found = jumps(made.robot, lambda t: made.sample(t).actuators, made.duration)
    return replace(made, jumps=found)


def _fastest(unit: Move, limits: dict[str, FloatArray]) -> float:
    """The shortest duration within limits: speeds go with 1/T and accelerations with 1/T²."""
    if not limits:
        raise ArgumentError("give a duration, or limits of velocity or acceleration")
    largest = dict(zip(("velocity", "acceleration"), peaks(unit.sample, 1.0), strict=True))
    shortest = 0.0
    for name, most in limits.items():
        order = 1 if name == "velocity" else 2
        if not np.isfinite(largest[name]).all():
            raise ArgumentError(
                "the path leaves the machine's reach or is singular: no fastest move"
            )
        shortest = max(shortest, float(((largest[name] / most) ** (1 / order)).max()))
    if shortest == 0.0:
        raise ArgumentError("start and end are the same pose: give a duration")
    return shortest
