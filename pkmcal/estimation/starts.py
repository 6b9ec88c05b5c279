"""Where what readings depend on is found with the nominal machine: where the search starts.

Zeros of runs, mountings of sensors and touched things have no present value; each follows in closed
form from the poses of the machine as it is described. A plane or a line is counted from the axis of
the base that is nearest to it, so that its two turnings stay below 55° and regular.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core import instruments
from pkmcal.estimation.alignment import angles_of, nearest_rotations, of_directions
from pkmcal.estimation.fit_data import FitData, Start
from pkmcal.estimation.joint_angles import angles
from pkmcal.exceptions import ArgumentError
from pkmcal.measurements import orientation
from pkmcal.measurements.calibratable import Calibratable
from pkmcal.measurements.components import Artefact
from pkmcal.measurements.measurements import Measurements

_EVERY = (0, 1, 2)
Found = dict[tuple[str, str], Start]  # by role and name


def with_starts(machine: Calibratable, datasets: Sequence[FitData]) -> list[FitData]:
    """The same sets, with where all is that they always find along."""
    found: Found = {}
    poses = [
        machine.forward(data.measured.actuators).pose if _has_own(data) else None
        for data in datasets
    ]
    pairs = [(d, pose) for d, pose in zip(datasets, poses, strict=True) if pose is not None]
    _zeros([(d.measured, pose) for d, pose in pairs if d.measured.run is not None], found)
    _touches([(d.measured, pose) for d, pose in pairs if d.measured.touched is not None], found)
    _joints(
        machine, [(d.measured, pose) for d, pose in pairs if d.measured.joint is not None], found
    )
    if any(data.measured.kind == "pose" for data in datasets):
        found["tool", ""] = Start(tuple(range(6)), np.zeros(6))  # `first_frames` lays it
    _mountings([pair for pair in pairs if pair[0].measured.kind in ("tilt", "orientation")], found)
    return [replace(data, starts=found) for data in datasets]


def known_distances(datasets: Sequence[FitData]) -> list[FitData]:
    """Distances between touched things that are stated, as readings of their own."""
    stated = [each for data in datasets for each in data.measured.touch_distances]
    if not stated:
        return []
    actuators, sigmas = [], []
    for one, other, _, _ in stated:
        places = {
            name: (data.measured, int(row))
            for name in (one, other)
            for data in datasets
            if data.measured.touched is not None
            for row in np.flatnonzero(data.measured.touched == name)[:1]
        }
        for name in (one, other):
            if name not in places:
                raise ArgumentError(f"touch_distances: no row touches {name!r}")
        measured, row = places[one]
        actuators.append(measured.actuators[row])  # a pose that is there; it has no part in them
        sigmas.append(None if measured.actuator_sigma is None else measured.actuator_sigma[row])
    first = 1 + max(int(data.rows.max()) for data in datasets)
    noisy = sigmas[0] is not None
    readings = Measurements(
        np.array(actuators),
        [mm for _, _, mm, _ in stated],
        "touch-distance",
        sigma=[sigma for *_, sigma in stated],
        touch_distances=tuple(stated),
        actuator_sigma=np.array(sigmas, dtype=np.float64) if noisy else None,
    )
    rows = np.arange(first, first + len(stated))
    return [FitData(readings, rows, False, False, starts=datasets[0].starts)]


def _has_own(data: FitData) -> bool:
    m = data.measured
    return m.kind in ("relative-distance", "touch", "angle", "tilt", "orientation")


def _zeros(sets: Sequence[tuple[Measurements, FloatArray]], found: Found) -> None:
    off: dict[str, list[FloatArray]] = {}
    for m, pose in sets:
        assert m.run is not None
        here = instruments.distances(pose, m.attachments, m.targets)[0] - m.values
        for name in np.unique(m.run).tolist():
            off.setdefault(name, []).append(here[m.run == name])
    for name, parts in off.items():
        found["run", name] = Start((0,), np.nan_to_num([_mean(np.concatenate(parts))]))


def _joints(
    machine: Calibratable, sets: Sequence[tuple[Measurements, FloatArray]], found: Found
) -> None:
    off: dict[str, list[FloatArray]] = {}
    for m, pose in sets:
        joint = str(m.joint)
        off.setdefault(joint, []).append(
            angles(machine, m.actuators, pose, joint, m.drive_state) - m.values
        )
    for joint, parts in off.items():
        turns = np.exp(1j * np.concatenate(parts))
        found["angle", joint] = Start((0,), np.array([np.angle(np.nansum(turns))]))


def _touches(sets: Sequence[tuple[Measurements, FloatArray]], found: Found) -> None:
    points: dict[str, list[FloatArray]] = {}
    kinds: dict[str, Artefact] = {}
    for m, pose in sets:
        assert m.touched is not None and m.artefact is not None
        target = np.zeros(3) if m.target is None else m.targets
        here = instruments.points(pose, target)[0]
        for name in np.unique(m.touched).tolist():
            if kinds.setdefault(name, m.artefact) != m.artefact:
                raise ArgumentError(f"values: {name!r} is a {kinds[name]} and a {m.artefact}")
            points.setdefault(name, []).append(here[m.touched == name])
    for name, parts in points.items():
        reached = np.concatenate(parts)
        reached = reached[np.isfinite(reached).all(axis=1)]
        if kinds[name] == "sphere":
            centre, radius = _sphere(reached)
            found["touch", name] = Start(_EVERY, centre)
            found["touch radius", name] = Start((0,), np.array([radius]))
        else:
            found["touch", name] = _ARTEFACTS[kinds[name]](reached)


def _point(points: FloatArray) -> Start:
    return Start(_EVERY, points.mean(axis=0) if len(points) else np.zeros(3))


def _plane(points: FloatArray) -> Start:
    middle, axes = _spread(points)
    k, slots, turnings = _direction(axes[2])
    place = middle @ axes[2] / axes[2, k]
    return Start((k, *slots), np.array([place, *turnings]), k)


def _line(points: FloatArray) -> Start:
    middle, axes = _spread(points)
    k, slots, turnings = _direction(axes[0])
    pierced = middle - axes[0] * (middle[k] / axes[0, k])  # where it passes through x, y or z = 0
    across = [i for i in range(3) if i != k]
    return Start((*across, *slots), np.array([*pierced[across], *turnings]), k)


_ARTEFACTS: Mapping[Artefact, Callable[[FloatArray], Start]] = {
    "point": _point,
    "plane": _plane,
    "line": _line,
}


def _spread(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The middle of points, and their principal axes as rows."""
    if len(points) < 2:
        return (points.mean(axis=0) if len(points) else np.zeros(3)), np.eye(3)
    middle = points.mean(axis=0)
    return middle, np.linalg.svd(points - middle, full_matrices=True)[2]


def _direction(d: FloatArray) -> tuple[int, tuple[int, ...], tuple[float, float]]:
    """The base's axis nearest to a direction, and the two turnings that take it there."""
    k = int(np.argmax(np.abs(d)))
    x, y, z = d * np.sign(d[k])
    if k == 0:  # Rz(γ) Ry(β) x
        return k, (4, 5), (float(np.arctan2(-z, np.hypot(x, y))), float(np.arctan2(y, x)))
    if k == 1:  # Rz(γ) Rx(α) y
        return k, (3, 5), (float(np.arctan2(z, np.hypot(x, y))), float(np.arctan2(-x, y)))
    # Ry(β) Rx(α) z
    return k, (3, 4), (float(np.arctan2(-y, np.hypot(x, z))), float(np.arctan2(x, z)))


def _sphere(points: FloatArray) -> tuple[FloatArray, float]:
    """Centre and radius of the sphere nearest to points, by its linear equation."""
    if len(points) < 4:
        return (points.mean(axis=0) if len(points) else np.zeros(3)), 1.0
    middle = points.mean(axis=0)
    near = points - middle
    lever = np.hstack([2.0 * near, np.ones((len(near), 1))])
    solved = np.linalg.lstsq(lever, (near**2).sum(axis=1), rcond=None)[0]
    return middle + solved[:3], float(np.sqrt(max(solved[3] + solved[:3] @ solved[:3], 1e-6)))


def _mountings(pairs: Sequence[tuple[FitData, FloatArray]], found: Found) -> None:
    """How a sensor is mounted: by orientations if any were read, else by tilts."""
    for kind, of in (("orientation", _of_orientations), ("tilt", _of_tilts)):
        mine = [(data, pose) for data, pose in pairs if data.measured.kind == kind]
        if mine and ("mounting", "") not in found:
            values = np.concatenate([data.measured.values for data, _ in mine])
            pose = np.concatenate([pose for _, pose in mine])
            known = np.isfinite(values).all(axis=1) & np.isfinite(pose).all(axis=1)
            mounting = np.zeros(3)
            if known.any():
                mounting = of(values[known], pose[known, 3:], mine[0][0].unknown_frame)
            found["mounting", ""] = Start(_EVERY, mounting)


def _of_orientations(values: FloatArray, turned: FloatArray, framed: bool) -> FloatArray:
    """Mounting (3,) with which a sensor reads these orientations."""
    platform, sensor = orientation.rotations(turned), orientation.rotations(values)
    frame = np.eye(3)
    if framed:  # turnings from the first reading on do not depend on the mounting
        first = np.zeros(len(turned), dtype=np.intp)
        turnings = [orientation.between(each, each[first]) for each in (values, turned)]
        frame = of_directions(*turnings)
    mountings = platform.transpose(0, 2, 1) @ frame.T @ sensor
    return angles_of(nearest_rotations(mountings.sum(axis=0)))


def _of_tilts(values: FloatArray, turned: FloatArray, framed: bool) -> FloatArray:
    """Mounting (3,) with which a sensor reads these tilts, whichever side up."""
    up = orientation.rotations(turned)[:, 2, :]  # the vertical in platform axes
    level = np.sin(values)
    rest = np.sqrt(np.maximum(0.0, 1.0 - (level**2).sum(axis=1)))
    trials = []
    for side in (1.0, -1.0):
        seen = np.column_stack([level, side * rest])
        turn = of_directions(up, seen)
        trials.append((float(((seen @ turn.T - up) ** 2).sum()), turn))
    upright, hanging = trials
    return angles_of(upright[1] if upright[0] <= hanging[0] else hanging[1])


def _mean(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else 0.0
