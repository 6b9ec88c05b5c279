"""Bed probes of printers: where the nozzle was when the probe triggered.

A firmware reports the z at which it believed the nozzle to be. That is no measured height: it says
where the carriages were. What is measured is that the probe touched the bed there. Read as a
height, or beside actuators of another moment, it calibrates the machine the wrong way round with
residuals as small as those of the right way; so it has a column of its own.
"""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import instance
from pkmcal.arrays import FloatArray, as_rows, rms
from pkmcal.exceptions import ArgumentError, CalibrationWarning
from pkmcal.geometry.probe_offset import LOWEST, OTHER_SIGN
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.measurements import Measurements

_SAME = 0.05  # mm: of the z that the robot file gives at the actuators of a trigger
_CIRCULAR = 0.1  # of the scatter of heights that a machine's errors leave more than
_LEVEL = 2e-3  # mm: of commanded heights that are the same
_ROUNDING = 2e-3  # mm: no probe repeats so well
_FLAT = 0.02  # of the machine's size within which heights are of a bed


def probed(
    robot: Robot,
    points: ArrayLike,
    *,
    offset: ArrayLike | None = None,
    sigma: ArrayLike | None = None,
) -> Measurements:
    """Measurements by a printer's probe: the points at which it triggered.

    Parameters
    ----------
    robot : Robot
        The printer with the numbers that its firmware had when it probed.
    points : (N, 3) array
        x, y and z of the nozzle as the firmware reported them when the probe triggered, mm.
    offset : (3,) array
        The firmware's offsets of the probe, mm: it touches at nozzle + (x, y), and the nozzle is
        then z above the bed. By default that of the robot file, ``[probe] offset``.
    sigma : scalar or (N,) array, optional
        Standard deviation of the probe, mm.

    Returns
    -------
    Measurements
        Heights: at these actuators the probe's tip is at 0, on the bed.

    Raises
    ------
    ValueError
        A point that the robot cannot reach; a shape that does not fit; an offset that is stated
        nowhere.

    Examples
    --------
    >>> import pkmcal as pk
    >>> printer = pk.load("linear-delta")
    >>> m = pk.probed(printer, [[0, 0, 0.2], [50, 0, 0.1], [0, 50, 0.15]], offset=[0, 0, 0])
    >>> m.kind, m.values.tolist()
    ('height', [0.0, 0.0, 0.0])
    """
    instance("robot", robot, Robot)
    found, shape = as_rows("points", points, 3)
    if len(shape) != 1 or not len(found) or not np.isfinite(found).all():
        raise ArgumentError(f"points must be finite and have shape (N, 3); found {shape}")
    place = offset_of(robot, offset, "offset")
    actuators = actuators_at(robot, found)
    if not np.isfinite(actuators).all():
        row = int(np.argmin(np.isfinite(actuators).all(axis=1)))
        at = ", ".join(f"{v:g}" for v in found[row])
        raise ArgumentError(f"points: the robot does not reach ({at}), row {row}")
    return Measurements(
        actuators,
        np.zeros(len(found)),
        "height",
        sigma=sigma,
        target=place * [1.0, 1.0, -1.0],
        actuator_units=robot.actuator_units,
    )


def offset_of(robot: Robot, given: ArrayLike | None, argument: str) -> FloatArray:
    """The probe's offset (3,), mm: as given, or of the robot file.

    Raises
    ------
    ValueError
        Neither is there, or it is no offset.
    """
    if given is None and robot.model.probe is not None:
        return robot.model.probe
    if given is None:
        raise ArgumentError(
            f"{argument} is stated nowhere: x, y and z of the probe from the nozzle, in mm"
            " (--probe-offset X,Y,Z, or [probe] offset = {x = X, y = Y, z = Z} of the robot file);"
            " 0,0,0 where the nozzle itself touches the bed"
        )
    found, shape = as_rows(argument, given, 3)
    if shape or not np.isfinite(found).all():
        raise ArgumentError(f"{argument} must be three finite numbers: x, y and z of the probe")
    if found[0, 2] < LOWEST:
        raise ArgumentError(f"{argument}: {OTHER_SIGN.format(z=found[0, 2])}")
    place: FloatArray = found[0]
    return place


def actuators_at(robot: Robot, points: FloatArray) -> FloatArray:
    """Actuator coordinates (N, n) with the nozzle at points (N, 3)."""
    poses = np.repeat(robot.home[None], len(points), axis=0)
    poses[:, :3] = points
    q: FloatArray = robot.inverse(poses)
    return q


def apart_from(robot: Robot, actuators: FloatArray, z: FloatArray) -> FloatArray:
    """Return the reported z less the robot file's, mm (N,)."""
    off: FloatArray = np.abs(robot.forward(actuators).pose[:, 2] - z)
    return off


def is_of_trigger(robot: Robot, actuators: FloatArray, z: FloatArray) -> bool:
    """Return whether actuators are those at which the firmware reported this z."""
    return bool((apart_from(robot, actuators, z) < _SAME).all())


def is_of_a_flat(robot: Robot, measured: Measurements) -> bool:
    """Return whether heights of a bed were measured where the robot file has one and the same z."""
    nominal = robot.forward(measured.actuators).pose[:, 2]
    small = float(np.ptp(measured.values)) < _FLAT * robot.length
    return small and len(measured) > 2 and bool(np.ptp(nominal) < _LEVEL)


def agreement(robot: Robot, measured: Measurements, place: str) -> str:
    """Describe why heights of a bed are those of the robot file; "" where they are not.

    To rounding they are the file's own, and that is warned of. Within what a probe repeats to
    they may as well be those that the file was calibrated with.
    """
    z = measured.values - (0.0 if measured.target is None else measured.targets[:, 2])
    scatter = float(np.std(z))
    if len(z) < 3 or np.ptp(z) > _FLAT * robot.length or scatter == 0.0:
        return ""
    nominal = robot.forward(measured.actuators).pose[:, 2]
    off = nominal - z
    if not np.isfinite(off).all() or rms(off - off.mean()) >= _CIRCULAR * scatter:
        return ""
    if rms(off - off.mean()) < _ROUNDING:
        warnings.warn(
            f"{place}: the heights are those that the robot file itself gives at these actuators,"
            " and say nothing of the machine; where a firmware reported them when its probe"
            " triggered, call the column probe",
            CalibrationWarning,
            stacklevel=3,
        )
        return ""
    return (
        "the heights are those that the robot file gives at these actuators, within"
        f" {rms(off - off.mean()):.2g} mm; unless it was calibrated with them, they are a"
        " firmware's own, and the column is called probe"
    )
