"""Whether measurements can be what they are said to be: units, columns, repeats, enough of them."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from pkmcal.arguments import instance
from pkmcal.arrays import BoolArray, FloatArray, largest_first, mm_per_unit, rms
from pkmcal.core.library import POSE
from pkmcal.display import chance_text, first_rows, printable
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.identifiability import listed
from pkmcal.estimation.parameters import Parameters
from pkmcal.geometry.load import is_of_load
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements import repeats
from pkmcal.measurements.measurements import Measurements
from pkmcal.statistics.prior_test import PriorTest

GROSS = 0.05  # share of the machine's size by which measurements may be off before a calibration
FAR = 0.25  # share of the machine's size by which errors of manufacture do not move a parameter
_BEYOND = 0.01  # share of a stroke by which errors of a machine may carry it beyond its ends
_CHANCE = 3  # rows of a set that may equal those of another one by coarse digits alone
_LEAST_FREEDOM = 0.5  # degrees of freedom from which residuals show how good a fit is
MISFIT_RATIO = 0.2  # of the misfit that another reading may leave to be named as what was meant
_SHRUNK = 0.02  # share of its size by which errors of manufacture do not shrink a machine
_REMOTE = 3.0  # times a machine's reach within which a point of its platform is
_PULLED = 2.0  # times what is expected, from which a pull on a prior is worth a word
_ALIKE = 1e-6  # share by which misfits, or pulls, differ that are not equal
_REVERSED = "counts the other way"
_FACTORS = {
    "mm": (("metres", 1e3), ("centimetres", 10.0), ("inches", 25.4), ("micrometres", 1e-3)),
    "rad": (
        ("degrees", np.pi / 180),
        ("milliradians", 1e-3),
        ("radians that were taken for degrees", 180 / np.pi),
    ),
}


def likely_unit_errors(
    datasets: Sequence[FitData], parameters: Parameters, evaluation: Evaluation
) -> list[str]:
    """Suspect units or exchanged columns in measurements that are grossly off.

    Each set is read in other units and with columns exchanged; a reading that fits far better is
    named. Where some rows are out of reach as given, it has to fit better than the others do.
    """
    size = parameters.robot.length
    found = []
    for i, data in enumerate(datasets):
        read = np.isfinite(data.measured.values.reshape(evaluation.residuals[i].shape))
        if not read.any():
            continue
        residual = np.where(read, evaluation.residuals[i], 0.0)
        off = _misfits(residual, data.measured.units, size)
        present = _together(off)
        if present <= GROSS * size:
            continue
        trials = {
            words: _misfits(
                np.where(read, _alone(replace(data, measured=other), parameters), 0.0),
                other.units,
                size,
            )
            for words, other in other_readings(data.measured, parameters.robot.actuator_units)
        }
        misfit = {words: _together(trial) for words, trial in trials.items()}
        # exchanges that are equivalent on a symmetric machine misfit alike
        least = min(misfit.values())
        words = next(text for text in trials if misfit[text] <= least * (1.0 + _ALIKE))
        if misfit[words] < MISFIT_RATIO * present and _better_where_reached(trials[words], off):
            which = f"measurements {i + 1}: " if len(datasets) > 1 else ""
            where = (
                f"off by {present:.3g} mm" if np.isfinite(present) else "out of the machine's reach"
            )
            found.append(f"{which}{where} as given, but by {misfit[words]:.3g} mm if {words}")
    return found


def _alone(data: FitData, parameters: Parameters) -> FloatArray:
    (residual,) = Equations.of([data], parameters).with_exact_actuators().start().residuals
    return residual


def _misfits(residual: FloatArray, units: Sequence[str], size: float) -> FloatArray:
    """Residual of each row, mm; angles as their arc. NaN if the row is not reached."""
    off: FloatArray = np.linalg.norm(residual * mm_per_unit(units, size), axis=1)
    return off


def _together(off: FloatArray) -> float:
    """Root mean square of all rows; inf if one is not reached."""
    return rms(off) if np.isfinite(off).all() else float("inf")


def _better_where_reached(trial: FloatArray, off: FloatArray) -> bool:
    """Whether the rows that are reached as given speak for another reading, too.

    Their medians, for some rows may be solved in another assembly mode.
    """
    reached = np.isfinite(off)
    if reached.all() or not reached.any():
        return True
    return bool(np.median(trial[reached]) < MISFIT_RATIO * np.median(off[reached]))


def other_readings(
    measured: Measurements, actuator_units: Sequence[str]
) -> Iterator[tuple[str, Measurements]]:
    """Read measurements in other units, with other signs and with columns exchanged."""
    for unit in dict.fromkeys(actuator_units):
        mine = np.array([unit == other for other in actuator_units])
        for name, factor in _FACTORS.get(unit, ()):
            q = np.where(mine, measured.actuators * factor, measured.actuators)
            yield f"the actuators are in {name}", replace(measured, actuators=q)
    yield "the actuators count the other way", replace(measured, actuators=-measured.actuators)
    yield from exchanges(measured)
    for unit in dict.fromkeys(measured.units):
        mine = np.array([unit == other for other in measured.units])
        what = {"mm": "measured lengths", "rad": "angles"}.get(unit, unit)
        for name, factor in _FACTORS.get(unit, ()):
            values = measured.values * (factor if mine.all() else np.where(mine, factor, 1.0))
            yield f"the {what} are in {name}", replace(measured, values=values)
    names = measured.components
    for one, other in itertools.combinations(range(len(names)), 2):
        if measured.units[one] != measured.units[other]:
            continue
        values = measured.values.copy()
        values[:, [one, other]] = values[:, [other, one]]
        yield f"{names[one]} and {names[other]} are exchanged", replace(measured, values=values)
    yield from _other_turns(measured)
    yield from _single_columns(measured, actuator_units)


def _single_columns(
    measured: Measurements, actuator_units: Sequence[str]
) -> Iterator[tuple[str, Measurements]]:
    """Read one column in another unit, or with the other sign."""
    for i, unit in enumerate(actuator_units):
        for words, factor in (*_FACTORS.get(unit, ()), (_REVERSED, -1.0)):
            q = measured.actuators.copy()
            q[:, i] *= factor
            yield _of_column(f"q{i + 1}", words), replace(measured, actuators=q)
    rows = measured.values.reshape(len(measured), -1)
    for k, (name, unit) in enumerate(zip(measured.components, measured.units, strict=True)):
        for words, factor in (*_FACTORS.get(unit, ()), (_REVERSED, -1.0)):
            values = rows.copy()
            values[:, k] *= factor
            values = values.reshape(measured.values.shape)
            yield _of_column(name, words), replace(measured, values=values)


def _of_column(name: str, words: str) -> str:
    return f"{name} {words}" if words == _REVERSED else f"{name} is in {words}"


def _other_turns(measured: Measurements) -> Iterator[tuple[str, Measurements]]:
    """Read orientations as quaternions in the other order, and as those of the base."""
    from scipy.spatial.transform import Rotation

    angles = [k for k, name in enumerate(measured.components) if name in POSE[3:]]
    if len(angles) < 3 or measured.values is None:
        return
    turned = measured.values[:, angles]
    good = np.isfinite(turned).all(axis=1)
    given = Rotation.from_euler("xyz", turned[good])
    q = given.as_quat()  # x y z w
    for words, other in (
        ("the scalar of the quaternions is their last number", q[:, [3, 0, 1, 2]]),
        ("the scalar of the quaternions is their first number", q[:, [1, 2, 3, 0]]),
        ("orientations are those of the base in the platform's frame", given.inv().as_quat()),
    ):
        values = measured.values.copy()
        values[np.ix_(good, np.array(angles))] = Rotation.from_quat(other).as_euler("xyz")
        yield words, replace(measured, values=values)


def exchanges(measured: Measurements) -> Iterator[tuple[str, Measurements]]:
    """Read measurements with two actuators exchanged."""
    columns = np.arange(measured.actuators.shape[1])
    for a, b in itertools.combinations(columns, 2):
        order = columns.copy()
        order[[a, b]] = b, a
        swapped = replace(measured, actuators=measured.actuators[:, order])
        yield f"q{a + 1} and q{b + 1} are exchanged", swapped


def beyond_strokes(equations: Equations, start: Evaluation, end: Evaluation) -> list[str]:
    """Rows whose actuators are out of the strokes that the robot file states.

    Both with the nominal machine, whose offsets may be unknown, and with the identified one,
    which may have been misled.
    """
    robot = start.robot
    if not isinstance(robot, Robot):
        return []  # the file of an arm states no strokes
    out = _out_of_stroke(robot, _drives(end))
    if not out.any():
        return []
    drive = _drives(start)
    out &= _out_of_stroke(robot, drive)
    if not out.any():
        return []
    limbs = []
    for i in np.flatnonzero(out.any(axis=0)):
        low, high = robot.model.limbs[i].stroke or (0.0, 0.0)
        beyond = drive[out[:, i], i]
        limbs.append(
            f"limb {i + 1} at {beyond.min():.4g} to {beyond.max():.4g}, its stroke is {low:g} to"
            f" {high:g}"
        )
    poses_of = np.concatenate(equations.pose_of)
    broken = np.asarray(out.any(axis=1))
    rows = equations.rows[broken[poses_of]].tolist()
    more = f" and {len(limbs) - 2} more limbs" if len(limbs) > 2 else ""
    return [
        f"actuators out of stroke in {len(rows)} of {len(poses_of)} rows"
        f" (rows {first_rows(rows, 10)}): {'; '.join(limbs[:2])}{more}; check units,"
        " signs and columns of the actuators, or the strokes in the robot file"
    ]


def _drives(evaluation: Evaluation) -> FloatArray:
    """Drive coordinates (K, limbs) at the poses, each of its session's machine."""
    return evaluation.machines.joined(
        lambda robot, own: instance("robot", robot, Robot).feasible(evaluation.pose[own]).drive
    )


def _out_of_stroke(robot: Robot, drive: FloatArray) -> BoolArray:
    """Which drives (K, limbs) are beyond their strokes by more than errors explain."""
    strokes = [limb.stroke or (-np.inf, np.inf) for limb in robot.model.limbs]
    drive = drive[:, : len(strokes)]  # without the tail
    low, high = np.array(strokes).T
    room = np.where(np.isfinite(low), _BEYOND * (high - low), 0.0)
    out: BoolArray = (drive < low - room) | (drive > high + room)
    return out


def implausible_changes(start: Evaluation, end: Evaluation, parameters: Parameters) -> list[str]:
    """Find numbers of the geometry that moved further than errors of manufacture explain."""
    moved = np.abs((end.theta - start.theta) / parameters.scale)[parameters.geometry]
    moved[[is_of_load(name) for name in parameters.names[parameters.geometry]]] = 0.0
    far = np.flatnonzero(moved > FAR * parameters.robot.length)
    if not len(far):
        return []
    names = listed([parameters.names[i] for i in far])
    return [
        f"{names} moved by up to {moved.max():.3g} mm, further than errors of a machine: check that"
        " the robot file describes this one, or free fewer parameters"
    ]


def distant_points(end: Evaluation, parameters: Parameters) -> list[str]:
    """Find points of the platform that were sought near it and found far away.

    Poses that hardly turn do not determine where a target is; noise may then carry it anywhere.
    """
    reach = float(np.linalg.norm(end.pose[:, :3], axis=1).max())
    geometry = parameters.robot.geometry
    lengths = np.abs(geometry.values[np.array(geometry.units) == "mm"]).max(initial=0.0)
    size = _REMOTE * max(reach, parameters.robot.length, float(lengths))
    found = []
    for (role, point), number in parameters.found_along.items():
        if role not in ("target", "attachment"):
            continue
        for first in np.flatnonzero(parameters.number_of == number).tolist():
            place = end.theta[first : first + 3]
            moved = float(np.linalg.norm(place - parameters.start[first : first + 3]))
            far = float(np.linalg.norm(place))
            if min(moved, far) <= size:
                continue
            behind = parameters.names[first].partition("@")[2]
            name = f"{point} of {printable(behind)}" if behind else point
            found.append(
                f"{role} {name} was found {far:.3g} mm from the platform's origin, beyond the"
                f" machine's size ({size:.0f} mm): measure poses that turn more, or state where it"
                " is"
            )
    return found


def shrunk(equations: Equations, start: Evaluation, end: Evaluation) -> list[str]:
    """Say where a machine that touches has become smaller, which makes all of its misfits smaller.

    That a point, a line or a plane was touched again says nothing of how large the machine is.
    """
    kinds = {measured.kind for measured in equations.sets}
    if not kinds <= {"touch", "orientation", "tilt", "angle", "closure"}:
        return []  # some length was read
    pairs = zip(equations.sets, equations.pose_of, strict=True)
    touching = [place for measured, place in pairs if measured.kind == "touch"]
    if not touching:
        return []
    rows = np.concatenate(touching)
    spans = []
    for evaluation in (start, end):
        places = evaluation.pose[rows, :3]
        spans.append(rms(np.linalg.norm(places - places.mean(axis=0), axis=1)))
    share = 1.0 - spans[1] / spans[0]
    if share < _SHRUNK:
        return []
    return [
        f"the poses lie {100 * share:.2g} % closer together than before: touches alone do not say"
        " how large a machine is, state touch_distances or measure a length as well"
    ]


def contradicted_prior(
    test: PriorTest | None, parameters: Parameters, with_outliers: bool
) -> list[str]:
    """Say where the measurements contradict the prior, and how wide one would have to be."""
    if test is None or not test.contradicted:
        return []
    pulls = np.nan_to_num(test.pulls)
    stated = parameters.prior_names
    worst = [k for k in largest_first(np.abs(pulls), _ALIKE)[:3] if abs(pulls[k]) > _PULLED]
    shown = ", ".join(f"{stated[k]} {abs(pulls[k]):.1f}" for k in worst)
    pulled = f" and pull {shown} times as far as prior and noise let expect" if worst else ""
    return [
        f"the measurements contradict the prior ({chance_text(test.chance_of_either)}){pulled}: a"
        f" prior {test.factor:.2g} times as wide would agree"
        + (", or leave the outliers out" if with_outliers else "")
    ]


def insufficient_data(equations: Equations, rank: int, dof: float, with_prior: bool) -> list[str]:
    """Find too few measurements, one pose only, rows that were entered twice."""
    found = []
    n, count = len(equations.parameters), int(equations.components.sum())
    if len(equations.actuators) == 1 and len(equations.rows) > 1:
        found.append("all rows have the same actuators: measure different poses")
    elif count < n and not with_prior:
        found.append(
            f"{count} equations for {n} parameters: measure more poses, free fewer parameters or"
            " state a prior"
        )
    elif dof < _LEAST_FREEDOM:
        found.append(
            f"{count} equations for {rank} identifiable combinations: no degrees of"
            " freedom are left to show how good the fit is; measure more poses"
        )
    return [*found, *_copies(equations)]


def _copies(equations: Equations) -> list[str]:
    """Rows that equal others of their set to the last digit, and sets whose rows all do."""
    found, earlier, start = list[str](), list[tuple[str, int, set[bytes]]](), 0
    for measured, pose in zip(equations.sets, equations.pose_of, strict=True):
        rows = equations.rows[start : start + len(measured)]
        start += len(measured)
        if not measured.components:
            continue  # the same readings of actuators alone may well occur twice
        table = np.column_stack([
            measured.actuators,
            np.empty((len(measured), 0)) if measured.other is None else measured.other,
            measured.values.reshape(len(measured), -1),
            repeats.targets(measured),
        ])  # fmt: skip
        keys = {row.tobytes() for row in table} if len(equations.sets) > 1 else set()
        for kind, first, others in earlier:
            if kind == measured.kind and len(keys) > _CHANCE and keys <= others:
                found.append(
                    f"all {len(measured)} rows from row {rows[0]} equal rows from row {first} to"
                    " the last digit: the same measurements twice?"
                )
        earlier.append((measured.kind, int(rows[0]), keys))
        if len(np.unique(pose)) == len(pose):
            continue
        _, twin, inverse = np.unique(table, axis=0, return_index=True, return_inverse=True)
        twins = twin[inverse.reshape(-1)]
        copies = np.flatnonzero(twins != np.arange(len(measured)))
        if len(copies):
            pairs = [f"{rows[i]} of {rows[twins[i]]}" for i in copies[:5]]
            more = ", …" if len(copies) > 5 else ""
            found.append(
                f"{len(copies)} rows equal others to the last digit (row {', '.join(pairs)}{more}):"
                " copied, not measured again?"
            )
    return found
