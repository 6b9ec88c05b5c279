"""Commands of a controller, and where they lead a machine that has other numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray, wrapped
from pkmcal.core.library import POSE
from pkmcal.geometry.carried import Load
from pkmcal.kinematics.complete import written_as
from pkmcal.kinematics.robot import Robot, determines_others

_LETTERS = dict(zip(POSE, "XYZABC", strict=True))
_ONTO_NODE = 2  # steps by the secant, which is good: segments are short


class CommandedMachine:
    """Commands of the controller for coordinates (N, axes) in mm and deg, and where they lead.

    Parameters
    ----------
    controller, calibrated : Robot
        The machine as the controller computes it, and as it is.
    joints : bool
        Whether commands are actuator coordinates.
    loads : sequence of Load
        What the calibrated machine carries in turn: the calls say by `carried` (N,) which of them.
        Without any it carries what its file states.
    """

    def __init__(
        self, controller: Robot, calibrated: Robot, joints: bool, loads: Sequence[Load] = ()
    ) -> None:
        self._loads = np.array([load.rows(()) for load in loads])
        self.axes = controller.moved
        self.letters = "".join(_LETTERS[axis] for axis in self.axes)
        self.joints = joints
        self.written = "XYZABC"[: controller.n_actuators] if joints else self.letters
        self.length = controller.length
        self._places = [POSE.index(axis) for axis in self.axes]
        self._turns = np.array([place >= 3 for place in self._places])
        self._match = True if determines_others(controller) else None
        self._controller, self._calibrated = controller, calibrated
        self._degrees = np.array(
            [np.degrees(1.0) if unit == "rad" else 1.0 for unit in controller.actuator_units]
        )
        self._nodes = [
            (drive.actuator, node)
            for robot in (controller, calibrated)
            for drive in robot.model.drives
            for node in ([] if drive.table is None else drive.table.tolist())
        ]

    def shown(self, pose: FloatArray) -> FloatArray:
        """Return the axes of poses (..., 6), in mm and deg."""
        found: FloatArray = pose[..., self._places]
        return np.where(self._turns, np.degrees(found), found)

    def _near(self, pose: FloatArray, coordinates: FloatArray) -> FloatArray:
        """`shown`, of poses (N, 6) with rotations as coordinates (N, axes) write theirs."""
        if self._controller.machine.turns_freely:
            wanted = np.where(self._turns, np.radians(coordinates), coordinates)
            pose = written_as(pose, self._places, wanted)
        return self.shown(pose)

    def _poses(self, coordinates: FloatArray, robot: Robot) -> FloatArray:
        poses = np.tile(robot.home, (len(coordinates), 1))
        poses[:, self._places] = np.where(self._turns, np.radians(coordinates), coordinates)
        return poses

    def _load(self, carried: IntArray) -> Load | None:
        return Load.of_rows(self._loads[carried]) if len(self._loads) else None

    def command(self, coordinates: FloatArray, carried: IntArray) -> FloatArray:
        """Return the command at which the calibrated machine is at a pose; NaN where there is none.

        Angles are in the turn of the coordinates; those of actuators in any.
        """
        poses = self._poses(coordinates, self._calibrated)
        q = self._calibrated.inverse(poses, match=self._match, load=self._load(carried))
        if self.joints:
            found: FloatArray = q * self._degrees
            return found
        found = self._near(self._controller.forward(q, guess=poses).pose, coordinates)
        turned: FloatArray = coordinates + np.degrees(wrapped(np.radians(found - coordinates)))
        return np.where(self._turns, turned, found)

    def keeps_limits(self, coordinates: FloatArray) -> BoolArray:
        """Return whether the calibrated machine keeps its limits, as far as it states any."""
        robot = self._calibrated
        poses = self._poses(coordinates, robot)
        if self._match:  # the other coordinates follow from these
            poses = robot.forward(robot.inverse(poses, match=True), guess=poses).pose
        return robot.feasible(poses).ok

    def continuous(self, commands: FloatArray) -> FloatArray:
        """Commands (..., N, n) of which actuators take the short way from each to the next."""
        robot = self._calibrated
        found: FloatArray = commands.copy()
        if not self.joints:
            return found
        turns = robot.turns * self._degrees
        for k in np.flatnonzero(np.isfinite(turns)):
            found[..., k] = np.unwrap(found[..., k], period=abs(turns[k]))
        angles = np.array(robot.actuator_units) == "rad"
        if np.isinf(turns[angles]).any():  # whose drive laws are others after a turn
            q = found / self._degrees
            for i in range(1, q.shape[-2]):
                q[..., i, :] = robot.nearest_turns(q[..., i, :], near=q[..., i - 1, :])
            found = q * self._degrees
        return found

    def reached(self, command: FloatArray, near: FloatArray, carried: IntArray) -> FloatArray:
        """Return the pose of the calibrated machine at a command."""
        poses = self._poses(near, self._calibrated)
        q = self._readings(command)
        solved = self._calibrated.forward(q, guess=poses, load=self._load(carried))
        return self._near(solved.pose, near)

    def _readings(self, command: FloatArray) -> FloatArray:
        """The actuator coordinates to which the controller drives on a command."""
        if self.joints:
            found: FloatArray = command / self._degrees
            return found
        poses = self._poses(command, self._controller)
        return self._controller.inverse(poses, match=self._match)

    def bends(self, begin: FloatArray, end: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return shares of ways between commands (N, axes) at which a drive passes a node.

        Which of the ways, and at which share of it: the error has a bend there.
        """
        if not self._nodes:
            return np.empty(0, dtype=np.intp), np.empty(0)
        first, last = self._readings(begin), self._readings(end)
        rows, shares = [], []
        for a, node in self._nodes:
            off, way = node - first[:, a], last[:, a] - first[:, a]
            row = np.flatnonzero((off * way > 0.0) & (np.abs(off) < np.abs(way)))
            share = off[row] / way[row]
            for _ in range(0 if self.joints else _ONTO_NODE):  # between poses no straight line
                at = begin[row] + share[:, None] * (end - begin)[row]
                share = np.clip(share + (node - self._readings(at)[:, a]) / way[row], 0.0, 1.0)
            rows.append(row)
            shares.append(share)
        return np.concatenate(rows), np.concatenate(shares)

    def distance(self, one: FloatArray, other: FloatArray) -> FloatArray:
        """Between coordinates, mm; angles as arcs."""
        turned = wrapped(np.radians((one - other)[:, self._turns])) * self.length
        off: FloatArray = np.linalg.norm(
            np.concatenate([(one - other)[:, ~self._turns], turned], axis=1), axis=1
        )
        return off
