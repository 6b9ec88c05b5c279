"""A measurement with a machine that is driven: to a pose, wait, read, write down, choose the next.

Nothing moves before `MeasuringRun.start`, which a person has to ask for, and nothing after `stop`.
What happened is on the disk before anything else does: whoever pulls a plug loses the pose that is
being measured, and no other.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.robot import Robot
from pkmcal.kinematics.straight_way import straight_way
from pkmcal.live.course import Course
from pkmcal.live.device import FARTHEST, DeviceError, Instrument, Machine
from pkmcal.live.row_log import RowLog

_THERE, _TURNED = 0.02, 1e-3  # mm and rad by which a controller may be off the pose asked for
_SAME = 0.5  # mm by which its drives may be off its place by the robot file
_DONE = 0.1  # mm, and 1e-3 rad: a row so near to a candidate is of it


class Stopped(Exception):
    """The measurement was stopped by `MeasuringRun.stop`."""


@dataclass(frozen=True)
class Rules:
    """Rules by which poses are measured.

    Attributes
    ----------
    feed : float
        mm/min.
    dwell : float
        Seconds at rest before it is read.
    repeats : int
        Readings at each pose, each a row.
    safe_height : float or None
        z in mm to which it rises between poses, where it is lower; None: straight from pose to
        pose.
    """

    feed: float = 1500.0
    dwell: float = 0.5
    repeats: int = 1
    safe_height: float | None = None


class MeasuringRun:
    """Poses that are driven to and measured, one after another.

    Parameters
    ----------
    robot : Robot
        The machine as its controller has it, within the limits of its file and of the user.
    machine, instrument : Machine, Instrument or None
        What is driven, and what is read; None where the actuators are all that is read.
    log : RowLog
        Where rows go.
    rules : Rules
        How poses are measured.
    tell : callable
        Takes a line on what happened.
    """

    def __init__(
        self,
        robot: Robot,
        machine: Machine,
        instrument: Instrument | None,
        log: RowLog,
        rules: Rules,
        tell: Callable[[str], object],
    ) -> None:
        self._robot, self._machine, self._instrument = robot, machine, instrument
        self._log, self._rules, self._tell = log, rules, tell
        self._stopping, self._moving = threading.Event(), threading.Event()
        self._at: list[FloatArray] = []  # where it was sent last; empty: not known

    def start(self, course: Course) -> Iterator[Course]:
        """Measure until the course is over; what has been told after each pose.

        Raises
        ------
        DeviceError
            Machine or instrument do not answer, refuse, or are elsewhere than they say.
        Stopped
            By `stop`.
        OSError
            The rows cannot be written.
        """
        self._machine.require_ready()
        self._same()
        while not course.over:
            index = course.choice.index
            pose = course.choice.pose
            for place in self._way(pose):
                self._drive(place)
            self._wait(self._rules.dwell)
            actuators = self._arrived(pose)
            values = self._read(f"row {_count(course) + 1}, at {pose_words(pose)}")
            if values is None:
                self._tell(
                    f"at {pose_words(pose)} nothing was seen: this pose has no row and is not tried"
                    " again"
                )
                course = course.without(index)
                continue
            self._log.append(actuators, values, round(time.time(), 1))
            rows = self._log.rows
            assert rows is not None
            course = course.after(index, rows)
            yield course

    def stop(self) -> None:
        """Stop at once, from any thread; tell it if the machine does not obey."""
        self._stopping.set()
        if self._moving.is_set():
            self._stop_machine()

    def _stop_machine(self) -> None:
        try:
            self._machine.stop()
        except DeviceError as error:
            self._tell(f"the machine did not obey the stop: stop it by hand ({error})")

    def _end_of_move(self) -> None:
        """Stop the machine, also where Ctrl-C comes once more before it has heard."""
        stopping = threading.Thread(target=self._stop_machine)
        stopping.start()
        stopping.join()

    def _drive(self, pose: FloatArray) -> None:
        """One straight move within the limits."""
        self._require_running()
        self._moving.set()
        try:
            self._machine.go(pose, self._rules.feed)
        except DeviceError:
            self._require_running()  # else it was stopped, and that is what it says
            raise
        except BaseException:  # Ctrl-C while it moves
            self._end_of_move()
            raise
        finally:
            self._moving.clear()
        self._require_running()
        self._at = [pose]

    def _way(self, pose: FloatArray) -> list[FloatArray]:
        """Poses to drive through, all of the way within the limits.

        Raises
        ------
        ValueError
            The way there leaves them.
        """
        here = self._here()
        way = [] if here is None else [here]
        height = self._rules.safe_height
        if height is not None:
            over = pose.copy()
            over[2] = max(pose[2], height)
            if here is not None:
                up = here.copy()
                up[2] = max(here[2], height)
                over[2] = up[2] = max(over[2], up[2])
                way.append(up)
            way.append(over)
        way.append(pose)
        for start, end in pairwise(way):
            self._require_within(start, end)
        moves = way if here is None else way[1:]
        return [at for i, at in enumerate(moves) if i == 0 or (at != moves[i - 1]).any()]

    def _here(self) -> FloatArray | None:
        if self._at:
            return self._at[0]
        said = self._machine.where().pose
        return None if said is None or not np.isfinite(said).all() else said

    def _require_within(self, start: FloatArray, end: FloatArray) -> None:
        """Refuse a move that leaves strokes, cones or the box; where it began may be outside."""
        way = straight_way(start, end)
        inside = self._robot.feasible(way).ok
        began = bool(self._robot.feasible(start).ok)
        first = int(np.argmax(inside)) if not began else 0  # it may come in from outside
        if not inside[first:].all() or not inside[-1]:
            raise ArgumentError(
                f"the way from {pose_words(start)} to {pose_words(end)} leaves the limits of"
                f" {self._robot.name} at {pose_words(way[first:][~inside[first:]][0])}: choose"
                " --safe-height, --within or --poses"
            )

    def _same(self) -> None:
        """Refuse a controller whose drives are not where the robot file has them at its place."""
        said = self._machine.where()
        if said.pose is None or said.actuators is None:
            return
        found = self._robot.forward(said.actuators, guess=_filled(said.pose)).pose
        known = np.isfinite(said.pose)
        off = np.abs(found - said.pose)[known]
        if not np.isfinite(off).all() or off[:3].max() > _SAME:
            raise DeviceError(
                f"the controller says it is at {pose_words(said.pose)}, and its drives are at"
                f" {pose_words(found)} by the robot file: it is not the machine of this file, or"
                " its numbers have changed; import its configuration again"
            )

    def _arrived(self, pose: FloatArray) -> FloatArray:
        """The actuators where it has arrived: as the controller says, or else as commanded."""
        said = self._machine.where()
        if said.pose is not None:
            off = np.abs(said.pose - pose)
            off = np.where(np.isfinite(off), off, 0.0)
            if off[:3].max() > _THERE or off[3:].max() > _TURNED:
                raise DeviceError(
                    f"sent to {pose_words(pose)}, the controller is at {pose_words(said.pose)}:"
                    " an offset or a mesh bends its moves; switch it off"
                )
        if said.actuators is not None:
            return said.actuators
        actuators: FloatArray = self._robot.inverse(pose)
        return actuators

    def _read(self, wanted: str) -> FloatArray | None:
        """Readings (R, k) that were seen; None where nothing was."""
        if self._instrument is None:
            return np.empty((self._rules.repeats, 0))
        found = []
        for i in range(self._rules.repeats):
            self._require_running()
            which = f", {i + 1} of {self._rules.repeats}" if self._rules.repeats > 1 else ""
            found.append(self._instrument.read(wanted + which))
        self._require_running()
        seen = np.array(found)
        if (np.abs(seen) > FARTHEST).any():  # NaN is not
            raise DeviceError(
                f"at {wanted} the instrument reads {seen[np.abs(seen) > FARTHEST][0]:g}: no such"
                " place is near"
            )
        seen = seen[np.isfinite(seen).all(axis=1)]
        return seen if len(seen) else None

    def _wait(self, seconds: float) -> None:
        self._stopping.wait(seconds)
        self._require_running()

    def _require_running(self) -> None:
        if self._stopping.is_set():
            raise Stopped


def measured_already(robot: Robot, candidates: FloatArray, log: RowLog) -> list[int]:
    """Candidates that rows of a log are of."""
    if log.rows is None:
        return []
    poses = robot.forward(np.unique(log.rows.actuators, axis=0)).pose
    off = np.abs(candidates[:, None] - poses[None])
    near = (off[:, :, :3].max(axis=2) < _DONE) & (off[:, :, 3:].max(axis=2) < _TURNED)
    return [int(i) for i in np.flatnonzero(near.any(axis=1))]


def _filled(pose: FloatArray) -> FloatArray:
    return np.where(np.isfinite(pose), pose, 0.0)


def _count(course: Course) -> int:
    return 0 if course.rows is None else len(course.rows)


def pose_words(pose: FloatArray) -> str:
    """A pose in words, without what it does not have."""
    shown = np.r_[pose[:3], np.degrees(pose[3:])]
    names = ("x", "y", "z", "alpha", "beta", "gamma")
    parts = [
        f"{name} {value:.3f}"
        for name, value in zip(names, shown, strict=True)
        if np.isfinite(value) and (value or name in "xyz")
    ]
    return " ".join(parts)
