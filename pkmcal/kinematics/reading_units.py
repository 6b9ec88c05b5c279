"""Units of what actuators read: lengths, angles, or counts of a motor that a gain converts."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from pkmcal.kinematics.robot import Robot

_SCALE = 2.0  # no scale of a length is off by more
_GEAR = np.radians(1.0)  # rad of a crank for one that is read: no gear turns it by less


class Actuated(Protocol):
    """A machine whose actuators have units: `Robot`, `SerialArm`."""

    @property
    def actuator_units(self) -> tuple[str, ...]:
        """Unit of each actuator, "mm" or "rad"."""


def gain_of(robot: Actuated, actuator: int) -> tuple[float | None, bool]:
    """The gain of the first limb of an actuator, and whether it turns a spool; None: no limb."""
    if not isinstance(robot, Robot) or not robot.model.closed_form:
        return None, False
    limbs = robot.model.limbs
    limb = next((k for k, limb in enumerate(limbs) if limb.actuator == actuator), None)
    if limb is None:
        return None, False
    law = limbs[limb].law
    return float(robot.geometry[f"gain{limb + 1}"]), law is not None and law.spool


def reading_units(robot: Actuated) -> tuple[str, ...]:
    """Unit of each actuator in tables and files: "mm", "rad", or "counts" of steps or turns.

    A robot file has no key for it; its gains say how much a step or a turn is.

    Examples
    --------
    >>> import pkmcal as pk
    >>> robot = pk.load("linear-delta")
    >>> reading_units(robot.replace({"gain1": -0.0125}))
    ('counts', 'mm', 'mm')
    """
    units = list(robot.actuator_units)
    for i, unit in enumerate(units):
        gain, winds = gain_of(robot, i)
        least, most = (1.0 / _SCALE, _SCALE) if unit == "mm" else (_GEAR, np.inf)
        if gain is not None and (winds or not least <= abs(gain) <= most):
            units[i] = "counts"
    return tuple(units)
