"""The equations of a calibration: measured less predicted, whitened, and their Jacobian."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arrays import FloatArray, Int32Array, IntArray, mm_per_unit, rms
from pkmcal.calibration.alignment import PointPairs, of_heights, of_points, of_poses
from pkmcal.calibration.parameters import POINTS, FitData, Parameters
from pkmcal.core import instruments
from pkmcal.core.library import STATUS
from pkmcal.measurements import orientation
from pkmcal.measurements.calibratable import Calibratable
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.observation import (
    Predicted,
    by_difference,
    difference,
    distance_per_point,
    predict,
)
from pkmcal.result import failed_rows


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The equations evaluated at one parameter vector.

    Attributes
    ----------
    theta : ndarray (n,)
        The parameters, mm and rad.
    robot : Calibratable
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
    robot: Calibratable
    pose: FloatArray
    status: Int32Array
    predicted: tuple[Predicted, ...]
    residuals: tuple[FloatArray, ...]

    @property
    def ok(self) -> bool:
        """Whether the forward kinematics solved every row."""
        return not self.status.any()


class Equations:
    """The stacked residual equations of all measurements, and their Jacobian.

    Parameters
    ----------
    datasets : sequence of FitData
        The rows to fit; rows with the same actuators are solved once.
    parameters : Parameters
        The parameter vector.
    """

    def __init__(self, datasets: Sequence[FitData], parameters: Parameters) -> None:
        self.datasets = tuple(datasets)
        self.sets = tuple(data.measured for data in datasets)
        self.rows = np.concatenate([data.rows for data in datasets])
        self.parameters = parameters
        self._framed = [data.framed for data in datasets]
        self._columns = [  # of the points that are sought, by what `predict` calls them
            {
                name: parameters.columns_of(role, data.measured)
                for name, role in POINTS[data.measured.kind].items()
                if role in data.sought
            }
            for data in datasets
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
                self._guess[place, :3] = measured.values[:, :3]
                if measured.kind == "pose":
                    self._guess[place, 3:] = orientation.shortest(measured.values[:, 3:])
        self.deviations = tuple(np.ones(len(m.components)) for m in self.sets)
        self._whiten = [_whitening(m, parameters.robot.length) for m in self.sets]
        self.components = np.concatenate([np.full(len(m), len(m.components)) for m in self.sets])
        self.first = np.cumsum(self.components) - self.components  # equation of each row
        self.set_of = np.repeat(np.arange(len(self.sets)), np.diff(edges))

    def at(self, theta: FloatArray) -> Evaluation:
        """Evaluate at `theta` (n,)."""
        robot = self.parameters.robot._with_values(self.parameters.values_at(theta))
        solved = robot.forward(self.actuators, self._guess)
        predicted = self._predicted(solved.pose, theta)
        residuals = self._residuals(predicted)
        return Evaluation(theta, robot, solved.pose, solved.status, predicted, residuals)

    def _predicted(self, pose: FloatArray, theta: FloatArray) -> tuple[Predicted, ...]:
        """Readings of each set at poses (K, 6)."""
        frame = self.parameters.frame_at(theta)
        return tuple(
            predict(
                measured.kind,
                pose[self.pose_of[i]],
                frame=frame if self._framed[i] else None,
                origin=self.parameters.origin,
                **self._known[i],
                **{name: theta[columns] for name, columns in self._columns[i].items()},
            )
            for i, measured in enumerate(self.sets)
        )

    def _residuals(self, predicted: Sequence[Predicted]) -> tuple[FloatArray, ...]:
        """Measured less predicted of each set."""
        return tuple(
            difference(measured.kind, measured.values, seen.values)
            for measured, seen in zip(self.sets, predicted, strict=True)
        )

    def misfit(self, pose: FloatArray, theta: FloatArray) -> FloatArray:
        """How far off the worst reading at each pose (K, 6) is, mm (K,); inf without a pose.

        Angles count as their arc.
        """
        worst = np.zeros(len(pose))
        residuals = self._residuals(self._predicted(pose, theta))
        for measured, place, residual in zip(self.sets, self.pose_of, residuals, strict=True):
            arcs = mm_per_unit(measured.units, self.parameters.robot.length)
            off = np.linalg.norm(residual * arcs, axis=1)
            np.maximum.at(worst, place, np.where(np.isfinite(off), off, np.inf))
        return worst

    def start_from(self, rows: IntArray, poses: FloatArray) -> None:
        """Start the forward kinematics of some distinct rows of actuators from poses (s, 6)."""
        self._guess = self._guess.copy()
        self._guess[rows] = poses

    def with_values(self, values: Sequence[FloatArray], prior_centre: FloatArray) -> Equations:
        """The same with other measured values (N, k) of each set, and another centre (n,)."""
        other = copy.copy(self)
        other.sets = tuple(
            replace(measured, values=given.reshape(measured.values.shape))
            for measured, given in zip(self.sets, values, strict=True)
        )
        other.parameters = replace(self.parameters, start=prior_centre)
        return other

    def reweighted(self, deviations: Sequence[FloatArray]) -> Equations:
        """The same where the components (k,) of each set have other relative deviations."""
        other = copy.copy(self)
        pairs = zip(self._whiten, deviations, strict=True)
        other._whiten = [white / relative for white, relative in pairs]
        other.deviations = tuple(deviations)
        return other

    def start(self) -> Evaluation:
        """Evaluate at the present parameters, an unknown frame aligned with the readings.

        Rows that fail from a measured pose are tried from home, those that then miss grossly in
        every assembly mode.
        """
        theta = self.parameters.start.copy()
        evaluation = self.at(theta)
        if not evaluation.ok:
            self._guess[evaluation.status != 0] = self.parameters.robot.home
            evaluation = self.at(theta)
        if self.parameters.frame is None or not evaluation.ok:
            return evaluation
        frame, theta = self._aligned(evaluation)
        self.parameters, theta = self.parameters.aligned(theta, frame)
        return self.at(theta)

    def _aligned(self, evaluation: Evaluation) -> tuple[FloatArray, FloatArray]:
        """The frame (6,) nearest to the readings, and parameters with unknown targets shifted."""
        theta = evaluation.theta.copy()
        framed = {
            kind: [i for i, m in enumerate(self.sets) if self._framed[i] and m.kind == kind]
            for kind in ("position", "pose", "height")
        }
        if not framed["position"]:
            kind = "pose" if framed["pose"] else "height"
            values = np.concatenate([self.sets[i].values for i in framed[kind]])
            if kind == "pose":
                poses = np.concatenate([evaluation.pose[self.pose_of[i]] for i in framed[kind]])
                return of_poses(values, poses), theta
            points = np.concatenate([self._points(evaluation, i)[0] for i in framed[kind]])
            return of_heights(values, points), theta
        columns = np.concatenate([
            self._columns[i]["target"][:, 0]
            if "target" in self._columns[i]
            else np.full(len(self.sets[i]), -1)
            for i in framed["position"]
        ])  # fmt: skip
        sought, target = np.unique(columns, return_inverse=True)
        target = target.reshape(-1) - int(sought[0] < 0)
        parts = [self._points(evaluation, i) for i in framed["position"]]
        seen = PointPairs(
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

    def _points(self, evaluation: Evaluation, i: int) -> tuple[FloatArray, FloatArray]:
        """Where the targets of set `i` are in the base frame (N, 3), and how they are turned."""
        sought = self._columns[i].get("target")
        target = self._known[i]["target"] if sought is None else evaluation.theta[sought]
        places, _, turn = instruments.points(evaluation.pose[self.pose_of[i]], target)
        return places, turn

    def warm_start(self, evaluation: Evaluation) -> None:
        """Start the forward kinematics of later calls of `at` from its poses."""
        self._guess = np.where(evaluation.status[:, None] == 0, evaluation.pose, self._guess)

    def jacobian(self, evaluation: Evaluation) -> list[FloatArray]:
        """Derivative of the predicted values of each set to the parameters, (N, k, n).

        With the opposite sign that of the residuals.
        """
        p = self.parameters
        by_geometry = evaluation.robot.error_twists(evaluation.pose, self.actuators)[:, :, p.places]
        parts = []
        for i, seen in enumerate(evaluation.predicted):
            rows, k = seen.values.shape
            part = np.zeros((rows, k, len(p)))
            part[:, :, : len(p.places)] = seen.by_twist @ by_geometry[self.pose_of[i]]
            if seen.by_frame is not None and p.frame is not None:
                part[:, :, p.frame : p.frame + 6] = seen.by_frame
            for name, columns in self._columns[i].items():
                by_point = seen.by_target if name == "target" else seen.by_anchor
                assert by_point is not None
                np.put_along_axis(part, np.repeat(columns[:, None, :], k, axis=1), by_point, axis=2)
            parts.append(by_difference(self.sets[i].kind, part, evaluation.residuals[i]))
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

    def unwhiten(self, whitened: FloatArray, noise: FloatArray) -> list[FloatArray]:
        """Invert `whitened` for vectors (M,): parts (N, k) of all sets, mm and rad."""
        parts, rest = [], whitened
        for measured, white, factor in zip(self.sets, self._whiten, noise, strict=True):
            mine, rest = np.split(rest, [len(measured) * white.shape[1]])
            part = factor * mine.reshape(len(measured), -1)
            if white.ndim == 3:
                parts.append(np.linalg.solve(white, part[:, :, None])[:, :, 0])
            else:
                parts.append(part / white)
        return parts

    def distances(self, evaluation: Evaluation) -> FloatArray:
        """How far off each measured point is, mm, in the order of the sets."""
        return np.concatenate([distance_per_point(r) for r in evaluation.residuals])

    def rms(self, evaluation: Evaluation) -> float:
        """Root mean square of `distances` over the rows that were reached; NaN without any."""
        off = self.distances(evaluation)
        return rms(off[np.isfinite(off)])

    def status(self, evaluation: Evaluation) -> Int32Array:
        """Of the forward kinematics, for each row."""
        return np.concatenate([evaluation.status[place] for place in self.pose_of])

    def failures(self, evaluation: Evaluation) -> str:
        """Say which rows failed and why; empty where the forward kinematics solved all."""
        return failed_rows(self.status(evaluation), STATUS, self.rows, most=10)


def _whitening(measured: Measurements, length: float) -> FloatArray:
    """Factors (N, k) or matrices (N, k, k) that make the noise one; 1 mm where it is not known."""
    sigma = measured.sigma
    if sigma is None:
        return np.tile(mm_per_unit(measured.units, length), (len(measured), 1))
    if measured.kind == "pose" and not _same_turnings(sigma):
        sigma = orientation.covariance(sigma, measured.values[:, 3:])
    if sigma.ndim == 2:
        return 1.0 / sigma
    return np.linalg.inv(np.linalg.cholesky(sigma))


def _same_turnings(sigma: FloatArray) -> bool:
    """Whether standard deviations (N, 6) are the same about every axis."""
    return sigma.ndim == 2 and bool((sigma[:, 4:] == sigma[:, 3:4]).all())
