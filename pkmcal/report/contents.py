"""Content of a calibration report: numbers and sentences; `report` renders it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pkmcal import display
from pkmcal.arrays import TIED, FloatArray, largest_first, propagate, rms
from pkmcal.calibration.identification import Identification
from pkmcal.core.library import POSE
from pkmcal.display import printable
from pkmcal.estimation import misfits
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.fit_data import FitData
from pkmcal.fitted.machine_accuracy import machine_accuracy
from pkmcal.kinematics.calibratable import as_machine
from pkmcal.measurements.iso9283 import performance
from pkmcal.measurements.repeats import groups
from pkmcal.readings.constants import names_of_constants
from pkmcal.report.places import Places

_WORST = 10  # rows that are listed
_MOSTLY, _ONLY = 0.5, 0.99  # of the prior's deviation, above which the prior dominates
_ELSEWHERE = 1.0  # mm: a pose so far from the desired one is of another assembly mode
_NEGLIGIBLE = 1e-3  # share of a parameter in unidentifiable combinations


@dataclass(frozen=True, eq=False)
class WorkspaceAccuracy:
    """Expected error of the calibrated machine over its workspace, one standard deviation, mm.

    Attributes
    ----------
    poses : ndarray (N, 6)
        Where, mm and rad; of an arm joint coordinates (N, n).
    tools : ndarray (N, 6)
        Poses of the tool there, mm and rad.
    accuracy : ndarray (N,)
        inf where the measurements do not determine it.
    where : str
        How the poses were chosen.
    """

    poses: FloatArray
    tools: FloatArray
    accuracy: FloatArray
    where: str

    @property
    def predicted(self) -> FloatArray:
        """Return the finite entries of `accuracy`."""
        return self.accuracy[np.isfinite(self.accuracy)]


@dataclass(frozen=True, eq=False)
class Slice:
    """The accuracy over two coordinates, NaN out of the workspace; `axes` names them."""

    axes: tuple[str, str]
    values: tuple[FloatArray, FloatArray]
    accuracy: FloatArray


_COLOURS = {"calibrated": "good", "doubtful": "doubtful", "not calibrated": "bad"}


def verdict(found: Identification) -> tuple[str, str]:
    """Rate the calibration: "good", "doubtful" or "bad", and one sentence."""
    return _COLOURS[found.verdict.state], f"{found.verdict}."


def instrument_identified(found: Identification) -> bool:
    """Say whether a frame or points of the instrument are among the parameters."""
    return bool((found.columns >= found.fit.parameters.geometry.stop).any())


def export_command(found: Identification) -> str:
    """Return the command that writes the calibrated machine for its firmware; "" of others."""
    controller = found.fit.parameters.robot.model.controller
    return "" if controller is None else controller.command("robot.toml")


def instruments(found: Identification) -> list[dict[str, Any]]:
    """List instruments of which a file is written: its name, their numbers, motions in mm."""
    listed = {}
    for each in found.instruments:
        if each.file_name:
            numbers = {name: getattr(each, name) for name in names_of_constants(each)}
            listed[each.file_name] = {
                "file": each.file_name,
                "numbers": {k: v for k, v in numbers.items() if isinstance(v, int | float)},
                "motions": {name: motion.tolist() for name, motion in each.motions.items()},
            }
    return [*listed.values()]


def pictures(found: Identification) -> list[dict[str, Any]]:
    """List pictures of boards: what each shows beside the calibration; mm, rad and px."""
    return [
        {
            "name": each.name,
            "use": each.use,
            "camera": each.camera,
            "board": each.board,
            "outliers": each.outliers,
            **vars(each.seen),
        }
        for each in found.pictures
    ]


def directions(found: Identification) -> list[dict[str, Any]]:
    """List mean, rms and largest residual of each component read, before and after; mm and rad."""
    names: dict[str, tuple[str, list[FloatArray], list[FloatArray]]] = {}
    parts = zip(
        found.fit.equations.table.sets, found.fit.start.residuals, found.residuals, strict=True
    )
    for measured, first, last in parts:
        pairs = zip(measured.components, measured.units, strict=True)
        for k, (name, unit) in enumerate(pairs):
            read = np.isfinite(measured.values.reshape(first.shape)[:, k])
            if not read.any():  # such as the height of a planar machine
                continue
            entry = names.setdefault(name, (unit, [], []))
            entry[1].append(first[read, k])
            entry[2].append(last[read, k])
    rows = []
    for name, (unit, firsts, lasts) in names.items():
        row: dict[str, Any] = {"name": name, "unit": unit}
        for when, values in (("before", np.concatenate(firsts)), ("after", np.concatenate(lasts))):
            row[f"mean_{when}"] = float(values.mean())
            row[f"rms_{when}"] = rms(values)
            row[f"largest_{when}"] = float(np.abs(values).max())
        rows.append(row)
    return rows


def points(found: Identification) -> list[dict[str, Any]]:
    """List every fitted row: its number, the pose, the distance before and after, mm."""
    equations = found.fit.equations
    off_before = misfits.distances(equations, found.fit.start)
    off = misfits.distances(equations, found.fit.end)
    place = np.concatenate(equations.table.pose_of)
    at = found.fit.end.pose[place]
    return [
        {
            "row": int(row),
            "pose": [float(number) for number in pose],
            "before": float(first),
            "after": float(last),
            "outlier": int(row) in found.outliers,
        }
        for row, pose, first, last in zip(found.rows, at, off_before, off, strict=True)
    ]


def worst(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Select the rows with the largest distances after the calibration."""
    read = [row for row in rows if np.isfinite(row["after"])]
    off = np.array([row["after"] for row in read])
    return [read[i] for i in largest_first(off, TIED)[:_WORST]]


def moved(rows: list[dict[str, Any]]) -> list[tuple[int, str, str, int]]:
    """List the coordinates that are not always 0: place, name, unit, and decimals to show."""
    some = np.any([row["pose"] for row in rows], axis=0)
    units = [("mm", 1)] * 3 + [("rad", 2)] * 3
    return [(k, POSE[k], *units[k]) for k in range(len(POSE)) if some[k]]


def parameters(found: Identification) -> list[dict[str, Any]]:
    """List each parameter before and after, and in words how well it is determined."""
    share = _unidentifiable_share(found)
    rows = []
    for i in range(len(found.free)):
        prior = float(found.fit.parameters.prior[found.columns[i]])
        rows.append({
            "name": printable(found.free[i]),
            "unit": found.units[i],
            "before": float(found.start[i]),
            "after": float(found.values[i]),
            "stderr": float(found.stderr[i]),
            "dof": float(found.parameter_dof[i]),
            "half95": float(found.interval95[i, 1] - found.values[i]),
            "identifiable": bool(np.isfinite(found.stderr[i])),
            "told": bool(np.isfinite(found.stderr[i])),  # the former name, for readers of JSON
            "prior": prior,
            "knowledge": _knowledge(found, i, prior, float(share[i])),
        })  # fmt: skip
    return rows


def _unidentifiable_share(found: Identification) -> FloatArray:
    """Return how much of each parameter lies in unidentifiable combinations, 0 to 1."""
    share = np.linalg.norm(found.fit.estimate.state.measured.unidentifiable, axis=1)
    return np.asarray(share[found.columns])


def _knowledge(found: Identification, i: int, prior: float, share: float) -> str:
    if found.free[i] in found.at_bounds:
        return "at its bound"
    sigma = float(found.stderr[i])
    if not np.isfinite(sigma):
        return "not identifiable"
    if np.isfinite(prior) and sigma > _ONLY * prior:
        return "prior only"
    if np.isfinite(prior) and sigma > _MOSTLY * prior:
        return "mostly prior"
    identified = share < _NEGLIGIBLE or np.isfinite(prior)
    return "identified" if identified else "partly determined"


def correlation(found: Identification) -> FloatArray:
    """Return the correlations (n, n); NaN for parameters that are not identifiable."""
    return found.correlation_matrix


def iso9283(found: Identification) -> list[dict[str, Any]]:
    """Compute AP, RP and AD of every set of positions or poses, before and after.

    Without outliers, which are errors of the measurement.
    """
    equations = found.fit.equations
    before = equations.prediction.values(found.fit.start)
    scores = []
    for i, measured in enumerate(equations.table.sets):
        if not measured.instrument.is_place:
            continue
        read = np.isfinite(measured.values).all(axis=1)
        odd = np.isin(equations.table.rows[equations.table.set_of == i], found.outliers)
        left_out = int((read & odd).sum())
        read &= ~odd
        if not read.any():
            continue
        group = np.unique(groups(measured)[read], return_inverse=True)[1]
        values = measured.values[read, :3]
        first = performance(values, before[i][read, :3], group)
        last = performance(values, values - found.residuals[i][read, :3], group)
        scores.append({
            "set": i + 1,
            "outliers": left_out,
            "poses": len(first.repeats),
            "repeats": [int(first.repeats.min()), int(first.repeats.max())],
            "accuracy_before": first.accuracy.tolist(),
            "accuracy": last.accuracy.tolist(),
            "accuracy_mean_before": float(first.accuracy.mean()),
            "accuracy_mean": float(last.accuracy.mean()),
            "repeatability": last.repeatability.tolist(),
            "repeatability_largest": _largest(last.repeatability),
            "distance_before": rms(first.distance_accuracy),
            "distance": rms(last.distance_accuracy),
            "distance_largest_before": _largest(first.distance_accuracy),
            "distance_largest": _largest(last.distance_accuracy),
        })  # fmt: skip
    return scores


def expected(
    found: Identification, places: FloatArray, reference: FloatArray | None = None
) -> FloatArray:
    """Predict the standard deviation of the tool, mm (N,), at poses (N, 6) or joints (N, n).

    Where the instrument's frame or targets were identified too, that of the first target in the
    instrument's frame: in the base frame it would contain the pose of the base, which no
    measurement determines. Of an instrument that reads no lengths, as a camera, that of the machine
    by itself, whose frames are moved over the `reference` places, by default these.
    """
    if not instrument_identified(found):
        return found.accuracy(places)
    if reads_lengths(found):
        return as_seen(found, places)
    return machine_accuracy(found.fit, places, places if reference is None else reference)


def reads_lengths(found: Identification) -> bool:
    """Say whether what the first instrument reads, in the last session, are lengths."""
    data, _ = _first_of_last(found)
    return data.measured.instrument.units[:1] == ("mm",)


def as_seen(found: Identification, places: FloatArray) -> FloatArray:
    """Predict that of the first row's target in the instrument's frame, as `expected` does.

    Of sessions that of the last.
    """
    known = found.fit.equations
    at, q, _ = as_machine(found.robot).commanded(places)
    like, first = _first_of_last(found)
    rows = np.full(len(q), first)
    measured = replace(like.measured.select(rows), actuators=q, group=np.arange(len(q)))
    equations = Equations.of([replace(like, measured=measured, rows=rows)], known.parameters)
    equations = equations.with_exact_actuators()
    point = equations.at(found.fit.end.theta)
    jacobian = equations.jacobian(point)[0][:, :3]
    jacobian *= known.parameters.scale
    variance = propagate(jacobian, found.fit.uncertainty.scaled)
    undetermined = jacobian @ found.fit.undetermined()
    sure = np.linalg.norm(undetermined, axis=(1, 2)) < _NEGLIGIBLE
    distance = np.abs(point.pose[equations.table.pose_of[0]] - at)[:, :3].max(axis=1)
    sure &= (distance < _ELSEWHERE) & found.fit.uncertainty.known
    return np.where(sure, np.sqrt(variance), np.inf)


def _first_of_last(found: Identification) -> tuple[FitData, int]:
    """A set and the number of its first row that is of the last session, whose is the robot."""
    for data in found.fit.equations.prediction.datasets:
        session = data.measured.session
        if not found.sessions:
            return data, 0
        if session is not None and (session == found.sessions[-1]).any():
            return data, int(np.argmax(session == found.sessions[-1]))
    raise AssertionError("a session without rows")


def held_out_numbers(found: Identification) -> list[dict[str, Any]]:
    """List numbers that were found of sessions held out."""
    return [
        {
            "name": printable(name),
            "unit": found.holdout_units[name],
            "value": value,
            "stderr": stderr,
        }
        for name, (value, stderr) in found.holdout_own.items()
    ]


def over_the_workspace(
    found: Identification, places: Places
) -> tuple[WorkspaceAccuracy, Slice | None]:
    """Predict the accuracy over the workspace from the covariance."""
    accuracy = expected(found, places.poses)
    sampled = WorkspaceAccuracy(places.poses, places.tools, accuracy, places.where)
    if places.area is None:
        return sampled, None
    area = places.area
    return sampled, Slice(
        area.axes, area.values, area.filled(expected(found, area.poses, places.poses))
    )


def over_the_measured(found: Identification) -> FloatArray:
    """Predict the accuracy at the poses that were measured, mm; those that are known."""
    end, machine = found.fit.end, found.fit.parameters.robot
    predicted = expected(found, machine.as_commands(end.pose, end.actuators))
    return predicted[np.isfinite(predicted)]


def _largest(values: FloatArray) -> float:
    finite = np.abs(values[np.isfinite(values)])
    return float(finite.max()) if finite.size else float("nan")


def shown(value: float, unit: str, sigma: float) -> str:
    """Show a number in the unit people read, to the digits that `sigma` supports."""
    number, _ = display.displayed(value, unit)
    deviation, _ = display.displayed(sigma, unit)
    return display.fixed(number, display.decimals(deviation) if np.isfinite(deviation) else 4)
