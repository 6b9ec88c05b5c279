"""The size of a machine: for the search, and against which statements hold lengths."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.estimation.equations import Equations
from pkmcal.kinematics.calibratable import Calibratable, as_arm
from pkmcal.measurements.measurements import Measurements
from pkmcal.readings.unknowns import PLAIN


def machine_size(equations: Equations, theta: FloatArray) -> float:
    """Return the machine's characteristic length, mm.

    An arm all of whose axes meet in one point has none: then it is how far from there the points
    are that are measured, as stated or as found at the parameters `theta` (n,), and 1 at least.
    """
    parameters = equations.parameters
    arm = as_arm(parameters.robot)
    if arm is None or not arm.without_lengths:
        return parameters.robot.length
    values, places = parameters.reported(theta), [_stated_points(equations)]
    for key, number in parameters.nuisance.items():
        if parameters.natures.get(key, PLAIN).body == "platform":
            first = int(np.flatnonzero(parameters.number_of == number)[0])
            places.append(values[None, first : first + 3])
    far = float(np.linalg.norm(np.concatenate(places), axis=1).max())
    return max(far, parameters.robot.length)


def stated_size(equations: Equations) -> float:
    """Return the machine's characteristic length as it is stated, mm; inf where nothing states it.

    An arm all of whose axes meet in its tool has that of its stated targets. Where there are none,
    lengths that were found are errors of the arm, and no other length tells whether they are large.
    """
    arm = as_arm(equations.parameters.robot)
    if arm is None or not arm.without_lengths:
        return equations.parameters.robot.length
    return float(np.linalg.norm(_stated_points(equations), axis=1).max()) or np.inf


def _stated_points(equations: Equations) -> FloatArray:
    """The platform's origin and all stated targets, (N, 3)."""
    stated = [m.target.reshape(-1, 3) for m in equations.table.sets if m.target is not None]
    points: FloatArray = np.concatenate([np.zeros((1, 3)), *stated])
    return points


def sizes(equations: Equations) -> FloatArray:
    """Return the size (n,) that changes of each parameter are held against, mm at the machine.

    An angle counts as its arc at the machine's length, whatever size is stated.
    """
    chosen = equations.parameters
    lengths = np.array([unit == "mm" for unit in chosen.units])
    found: FloatArray = np.where(lengths, stated_size(equations), chosen.robot.length)
    return found


def compared_by(robot: Calibratable, measured: Measurements) -> FloatArray:
    """Return factors from each component's residual to mm, by which two readings are compared.

    An angle counts as its arc at the machine's length. Beside angles of an arm without lengths its
    lengths do not count: they are its errors, however it is read.
    """
    mm = measured.instrument.mm(measured, robot.length)
    arm, angles = as_arm(robot), np.array([unit == "rad" for unit in measured.units])
    return mm * angles if arm is not None and arm.without_lengths and angles.any() else mm
