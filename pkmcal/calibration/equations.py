"""The equations of a calibration: measured less predicted, whitened, and their Jacobian."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pkmcal.arrays import FloatArray
from pkmcal.calibration.alignment import Seen, of_heights, of_points, of_poses
from pkmcal.calibration.parameters import POINTS, Parameters, Share
from pkmcal.core import instruments
from pkmcal.core.library import STATUS
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.observation import Predicted, difference, distance_per_point, predict


@dataclass(frozen=True, eq=False)
class Point:
    """The equations at one parameter vector.

    Attributes
    ----------
    theta : ndarray (n,)
        The parameters, mm and rad.
    robot : Robot
        With their geometry.
    pose : ndarray (K, 6)
        Where the machine is at each distinct row of actuators; NaN where it cannot be.
    status : ndarray of int (K,)
        Of the forward kinematics.
    predicted : tuple of Predicted
        Of each set of measurements.
    residuals : tuple of ndarray (N, k)
        Measured less predicted of each set, mm and rad.
    """

    theta: FloatArray
    robot: Robot
    pose: FloatArray
    status: NDArray[np.int32]
    predicted: tuple[Predicted, ...]
    residuals: tuple[FloatArray, ...]

    @property
    def reached(self) -> bool:
        """Whether the machine reaches every row."""
        return not self.status.any()


class Equations:
    """What some measurements say about the parameters.

    Parameters
    ----------
    shares : sequence of Share
        Rows with the same actuators are solved once.
    parameters : Parameters
        What is estimated.
    """

    def __init__(self, shares: Sequence[Share], parameters: Parameters) -> None:
        self.shares = tuple(shares)
        self.sets = tuple(share.measured for share in shares)
        self.rows = np.concatenate([share.rows for share in shares])
        self.parameters = parameters
        self._framed = [share.framed for share in shares]
        self._columns = [  # of the points that are sought, by what `predict` calls them
            {
                name: parameters.columns_of(role, share.measured)
                for name, role in POINTS[share.measured.kind].items()
                if role in share.sought
            }
            for share in shares
        ]
        self._known = [
            {
                name: m.attachments if role == "attachment" else m.targets
                for name, role in POINTS[m.kind].items()
                if name not in columns
            }
            for m, columns in zip(self.sets, self._columns, strict=True)
        ]
        # several targets or repeats at the same actuators are one pose
        actuators = np.concatenate([m.actuators for m in self.sets])
        self.actuators, inverse = np.unique(actuators, axis=0, return_inverse=True)
        edges = np.cumsum([0, *map(len, self.sets)])
        self.pose_of = [inverse.reshape(-1)[a:b] for a, b in itertools.pairwise(edges)]
        self._guess = np.tile(parameters.robot.home, (len(self.actuators), 1))
        for measured, framed, place in zip(self.sets, self._framed, self.pose_of, strict=True):
            if measured.kind in ("pose", "position") and not framed:
                self._guess[place, : len(measured.components)] = measured.values
        self._whiten = [_whitening(m, parameters.robot.length) for m in self.sets]
        self.components = np.concatenate([np.full(len(m), len(m.components)) for m in self.sets])
        self.first = np.cumsum(self.components) - self.components  # equation of each row
        self.set_of = np.repeat(np.arange(len(self.sets)), np.diff(edges))

    def at(self, theta: FloatArray) -> Point:
        """The equations at `theta` (n,)."""
        robot = self.parameters.robot._with_values(self.parameters.values_at(theta))
        solved = robot.forward(self.actuators, self._guess)
        frame = self.parameters.frame_at(theta)
        predicted, residuals = [], []
        for i, measured in enumerate(self.sets):
            seen = predict(
                measured.kind,
                solved.pose[self.pose_of[i]],
                frame=frame if self._framed[i] else None,
                origin=self.parameters.origin,
                **self._known[i],
                **{name: theta[columns] for name, columns in self._columns[i].items()},
            )
            predicted.append(seen)
            residuals.append(difference(measured.kind, measured.values, seen.values))
        return Point(theta, robot, solved.pose, solved.status, tuple(predicted), tuple(residuals))

    def with_values(self, values: Sequence[FloatArray], prior_centre: FloatArray) -> Equations:
        """The same with other measured values (N, k) of each set, and another centre (n,)."""
        other = copy.copy(self)
        other.sets = tuple(
            replace(measured, values=given.reshape(measured.values.shape))
            for measured, given in zip(self.sets, values, strict=True)
        )
        other.parameters = replace(self.parameters, start=prior_centre)
        return other

    def start(self) -> Point:
        """The equations at the present parameters, an unknown frame laid on what was measured.

        Rows that are not reached from a measured pose are tried from home.
        """
        theta = self.parameters.start.copy()
        point = self.at(theta)
        if not point.reached:
            self._guess[point.status != 0] = self.parameters.robot.home
            point = self.at(theta)
        if self.parameters.frame is None or not point.reached:
            return point
        frame, theta = self._laid(point)
        self.parameters, theta = self.parameters.laid(theta, frame)
        return self.at(theta)

    def _laid(self, point: Point) -> tuple[FloatArray, FloatArray]:
        """The frame (6,) in which readings lie nearest, and parameters with targets moved along."""
        theta = point.theta.copy()
        framed = {
            kind: [i for i, m in enumerate(self.sets) if self._framed[i] and m.kind == kind]
            for kind in ("position", "pose", "height")
        }
        if not framed["position"]:
            kind = "pose" if framed["pose"] else "height"
            values = np.concatenate([self.sets[i].values for i in framed[kind]])
            if kind == "pose":
                poses = np.concatenate([point.pose[self.pose_of[i]] for i in framed[kind]])
                return of_poses(values, poses), theta
            points = np.concatenate([self._points(point, i)[0] for i in framed[kind]])
            return of_heights(values, points), theta
        columns = np.concatenate([
            self._columns[i]["target"][:, 0]
            if "target" in self._columns[i]
            else np.full(len(self.sets[i]), -1)
            for i in framed["position"]
        ])  # fmt: skip
        sought, target = np.unique(columns, return_inverse=True)
        target = target.reshape(-1) - int(sought[0] < 0)
        parts = [self._points(point, i) for i in framed["position"]]
        seen = Seen(
            values=np.concatenate([self.sets[i].values for i in framed["position"]]),
            point=np.concatenate([places for places, _ in parts]),
            turn=np.concatenate([turn for _, turn in parts]),
            target=target,
        )
        frame, shifts = of_points(seen)
        for first, shift in zip(sought[sought >= 0], shifts, strict=True):
            mine = slice(first, first + 3)
            moved = theta[mine] + shift
            theta[mine] = np.clip(moved, self.parameters.lower[mine], self.parameters.upper[mine])
        return frame, theta

    def _points(self, point: Point, i: int) -> tuple[FloatArray, FloatArray]:
        """Where the targets of set `i` are in the base frame (N, 3), and how they are turned."""
        sought = self._columns[i].get("target")
        target = self._known[i]["target"] if sought is None else point.theta[sought]
        places, _, turn = instruments.points(point.pose[self.pose_of[i]], target)
        return places, turn

    def go_on_from(self, point: Point) -> None:
        """Let later calls of `at` start from its poses."""
        self._guess = np.where(point.status[:, None] == 0, point.pose, self._guess)

    def jacobian(self, point: Point) -> list[FloatArray]:
        """Derivative of the predicted values of each set to the parameters, (N, k, n)."""
        p = self.parameters
        by_geometry = point.robot.error_twists(point.pose, self.actuators)[:, :, p.places]
        parts = []
        for i, seen in enumerate(point.predicted):
            rows, k = seen.values.shape
            part = np.zeros((rows, k, len(p)))
            part[:, :, : len(p.places)] = seen.by_twist @ by_geometry[self.pose_of[i]]
            if seen.by_frame is not None and p.frame is not None:
                part[:, :, p.frame : p.frame + 6] = seen.by_frame
            for name, columns in self._columns[i].items():
                by_point = seen.by_target if name == "target" else seen.by_anchor
                assert by_point is not None
                np.put_along_axis(part, np.repeat(columns[:, None, :], k, axis=1), by_point, axis=2)
            parts.append(part)
        return parts

    def whitened(self, parts: Sequence[FloatArray], noise: FloatArray) -> FloatArray:
        """Parts (N, k, ...) of all sets in units of their standard deviation, stacked: (M, ...).

        `noise` (sets,) multiplies what `Measurements.sigma` says.
        """
        stacked = []
        for part, white, factor in zip(parts, self._whiten, noise, strict=True):
            if white.ndim == 3:
                scaled = np.einsum("nij,nj...->ni...", white, part)
            else:
                scaled = white.reshape(*white.shape, *(1,) * (part.ndim - 2)) * part
            stacked.append((scaled / factor).reshape(-1, *part.shape[2:]))
        return np.concatenate(stacked)

    def coloured(self, whitened: FloatArray, noise: FloatArray) -> list[FloatArray]:
        """The reverse of `whitened` for vectors (M,): parts (N, k) of all sets, mm and rad."""
        parts, rest = [], whitened
        for measured, white, factor in zip(self.sets, self._whiten, noise, strict=True):
            mine, rest = np.split(rest, [len(measured) * white.shape[1]])
            part = factor * mine.reshape(len(measured), -1)
            if white.ndim == 3:
                parts.append(np.linalg.solve(white, part[:, :, None])[:, :, 0])
            else:
                parts.append(part / white)
        return parts

    def white(self, i: int) -> FloatArray:
        """Matrices (N, k, k) that make the noise of set `i` one, as its sigma says."""
        white = self._whiten[i]
        return white if white.ndim == 3 else white[:, :, None] * np.eye(white.shape[1])

    def distances(self, point: Point) -> FloatArray:
        """How far off each measured point is, mm, in the order of the sets."""
        return np.concatenate([distance_per_point(r) for r in point.residuals])

    def rms(self, point: Point) -> float:
        """Root mean square of `distances` over the rows that were reached; NaN without any."""
        off = self.distances(point)
        off = off[np.isfinite(off)]
        return float(np.sqrt(np.mean(off**2))) if off.size else float("nan")

    def status(self, point: Point) -> NDArray[np.int32]:
        """Of the forward kinematics, for each row."""
        return np.concatenate([point.status[place] for place in self.pose_of])

    def unreached(self, point: Point) -> str:
        """Which rows the machine does not reach and why, in words; empty where it reaches all."""
        status = self.status(point)
        parts = []
        for code in sorted(set(status.tolist()) - {0}):
            rows = self.rows[status == code].tolist()
            shown = ", ".join(map(str, rows[:10])) + (", …" if len(rows) > 10 else "")
            parts.append(f"{len(rows)} of {len(status)} rows {STATUS[code]} (rows {shown})")
        return "; ".join(parts)


def _whitening(measured: Measurements, length: float) -> FloatArray:
    """Factors (N, k) or matrices (N, k, k) that make the noise one; 1 mm where it is not known."""
    sigma = measured.sigma
    if sigma is None:
        per_unit = np.array([length if unit == "rad" else 1.0 for unit in measured.units])
        return np.tile(per_unit, (len(measured), 1))
    if sigma.ndim == 2:
        return 1.0 / sigma
    return np.linalg.inv(np.linalg.cholesky(sigma))
