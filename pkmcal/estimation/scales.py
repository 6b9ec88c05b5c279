"""Scales: the change of a number, by unit, that moves the machine by about 1 mm."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal.arrays import FloatArray, mm_per_unit
from pkmcal.geometry.carried import CARRIED
from pkmcal.geometry.elastic import COMPLIANCE, PER_LENGTH
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.measurements.measurements import Measurements

_GRAVITY = 9.80665  # m/s²
_WEIGHT = 100.0  # N, of a link of an arm, more or less
_SOFTNESS = 1e-3  # of the size: the sag by which a compliance is taken that is not known yet


def unit_scales(robot: Calibratable, sets: Sequence[Measurements]) -> dict[str, float]:
    """The scale of numbers of the geometry, by their units.

    An angle counts as its arc at the machine's length, a ratio by how far the actuators go, a
    compliance by the largest force that is known, a force by the largest compliance.
    """
    travel, length = max(_travel(robot, each) for each in sets), robot.length
    found = {"mm": 1.0, "rad": 1.0 / length, "1": 1.0 / travel}
    found |= {"1/mm": 1.0 / travel**2, "1/rad": length / travel**2}
    found["1/mm2"] = found["1/mm"] / length
    pull = max(_pull(robot, each) for each in sets)
    found |= {"1/N": 1.0 / travel / pull, "N": pull / length}
    found["rad/(N mm)"] = 1.0 / length / (_WEIGHT * length)
    if robot.model.elastic is None:
        return found
    found |= {"mm/N": 1.0 / pull, "rad/(N mm)": 1.0 / pull / length**2}
    softness = _softness(robot, pull)
    found |= {"N": 1.0 / softness, "N mm": length / softness, "kg": 1.0 / softness / _GRAVITY}
    found |= {"N/mm": 1.0 / softness / length}
    return found


def _travel(robot: Calibratable, measured: Measurements) -> float:
    """Largest actuator coordinate, mm; an angle counts as its arc."""
    arcs = measured.actuators * mm_per_unit(robot.actuator_units, robot.length)
    return max(1.0, float(np.abs(arcs).max()))


def _pull(robot: Calibratable, measured: Measurements) -> float:
    """Largest force that is known, N: of tensions, of a balanced load, of weights and payloads."""
    forces = [1.0]
    if measured.tension is not None:
        forces.append(float(np.nanmax(np.abs(measured.tension), initial=0.0)))
    if (load := robot.model.balanced_load) is not None:
        forces += [abs(each) for each in load.force]
    if robot.model.elastic is not None:
        numbers = dict(robot.geometry.items())
        own = sum(value for name, value in numbers.items() if name.startswith("mass."))
        stated = np.array([numbers.get(f"payload.{name}", 0.0) for name in CARRIED])
        carried = stated[None] if measured.load is None else measured.load
        forces.append(float(_weights(carried, own, robot.length).max()))
    return max(forces)


def _weights(carried: FloatArray, own: float, length: float) -> FloatArray:
    """Sizes (N,) of what pulls under loads (N, 10), N; a moment by its force at the length."""
    force, moment = (np.linalg.norm(carried[:, k : k + 3], axis=1) for k in (4, 7))
    return np.asarray((own + carried[:, 0]) * _GRAVITY + force + moment / length)


def _softness(robot: Calibratable, pull: float) -> float:
    """Largest compliance, mm/N; of angles as their arcs by a force at the length."""
    largest = 0.0
    for (name, value), unit in zip(robot.geometry.items(), robot.geometry.units, strict=True):
        if name.startswith(COMPLIANCE) and not name.endswith(PER_LENGTH):
            arc = robot.length**2 if unit == "rad/(N mm)" else 1.0
            largest = max(largest, abs(value) * arc)
    return largest or _SOFTNESS * robot.length / pull
