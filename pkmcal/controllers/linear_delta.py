"""A linear delta as printer firmware has it: one radius, vertical towers, arms and end stops.

Klipper, RepRapFirmware and Marlin all have this model: towers at (r cos θ, r sin θ), and with the
nozzle at x, y, z the carriage of a tower at z + √(arm² - ‖(x, y) - tower‖²). What they call the
position of an end stop is the height of the *nozzle*, in the middle, with the carriage there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.controllers import robot_files
from pkmcal.controllers.laws import require_plain_limbs
from pkmcal.controllers.loss import Loss, cylinder, fitted, require_held
from pkmcal.controllers.robot_files import About
from pkmcal.core.library import SLOTS
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.robot import Robot, require_parallel

_TOWERS = 3
_POSES = 300
_FREE = ("radius", "angle1", "angle2", "offset1", "offset2", "offset3")
_RODS = ("rod1", "rod2", "rod3")
_HELD_RODS = "; heights hardly determine the rods"


@dataclass(frozen=True)
class FirmwareDelta:
    """The numbers of a linear delta.

    Attributes
    ----------
    radius : float
        Distance of each tower from the middle, less the joint offsets of carriage and effector; mm.
    angles : tuple of float
        Of each tower, deg from x.
    arms : tuple of float
        Length of each tower's rods, mm.
    carriages : tuple of float
        Height of each carriage's joint at its end stop, over the effector's joints with the
        nozzle on the bed; mm. The `offset` of a robot file.
    """

    radius: float
    angles: tuple[float, ...]
    arms: tuple[float, ...]
    carriages: tuple[float, ...]

    @property
    def endstops(self) -> tuple[float, ...]:
        """Height of the nozzle in the middle with each carriage at its end stop, mm."""
        pairs = zip(self.carriages, self.arms, strict=True)
        return tuple(at - float(np.sqrt(arm**2 - self.radius**2)) for at, arm in pairs)


@dataclass(frozen=True)
class Bed:
    """The bed: where a firmware lets the nozzle go.

    Attributes
    ----------
    radius : float or None
        How far from the middle, mm; None where the firmware's file does not state it.
    lowest, highest : float
        The least height, and the largest at which a firmware still lets it go as far from the
        middle; mm.
    """

    radius: float | None = None
    lowest: float = 0.0
    highest: float = np.inf


def _box(firmware: FirmwareDelta, bed: Bed) -> dict[str, list[float]]:
    """The workspace: between the towers, over the bed and below the end stops.

    Without the radius of a bed, a square in the circle of the towers: no firmware goes beyond that.
    """
    across, high = firmware.radius, _down(min(*firmware.endstops, bed.highest))
    if across <= 0.0 or high <= max(0.0, bed.lowest):
        return {}
    across = _down(across if bed.radius is not None else across / np.sqrt(2.0))
    box = {"x": [-across, across], "y": [-across, across], "z": [bed.lowest, high]}
    return box if bed.radius is None else box | {"radius": [0.0, bed.radius]}


def _down(value: float) -> float:
    """Round to what is not above."""
    return float(np.floor(1e3 * value + 1e-6) / 1e3)


def of_robot(robot: Robot, project: bool) -> tuple[FirmwareDelta, Loss]:
    """The firmware's numbers of a robot, and what they lose.

    Raises
    ------
    ValueError
        No linear delta; or one that the firmware cannot hold, unless `project`.
    """
    require_delta(robot)
    firmware = as_built(robot)
    poses, over = _workspace(firmware)
    q = robot.inverse(poses)
    if not np.isfinite(q).all():
        raise ArgumentError(f"robot: {robot.name} does not reach its bed: no pose for some {over}")
    built = [firmware.radius, *firmware.angles, *firmware.arms, *firmware.carriages]
    x, lost = fitted(
        lambda x: as_robot(_with_numbers(x), gains(robot)), np.array(built), q, poses, over
    )
    lacks = "the firmware has one radius and vertical towers, this robot has not"
    require_held(robot, lost, project, lacks)
    firmware = _with_numbers(x)
    if min(firmware.endstops) <= 0.0:
        raise ArgumentError(
            f"robot: {robot.name}: the end stops would be {min(firmware.endstops):.6g} mm over the"
            " bed; q must be 0 at the end stops, so that `offset` is their height"
        )
    return firmware, lost


def require_delta(robot: Robot) -> None:
    """Refuse what is no linear delta with three carriages of its own."""
    require_parallel(robot)
    require_plain_limbs(robot, "a firmware")
    if not _is_linear(robot):
        raise ArgumentError(
            f"robot: {robot.name} is no linear delta of three PUS limbs that only translates"
        )
    if not is_delta(robot):
        raise ArgumentError(
            f"robot: {robot.name}: a firmware has no base and tool frames, and its carriages are"
            " above the nozzle"
        )


def is_delta(robot: Robot) -> bool:
    """Return whether three carriages of their own, above, move a platform without turning it."""
    above = all(limb.branch <= 0 for limb in robot.model.limbs)
    return _is_linear(robot) and robot.frames.trivial and above


def _is_linear(robot: Robot) -> bool:
    kinds = [(limb.kind, limb.actuator) for limb in robot.model.limbs]
    return robot.model.map == "translation" and kinds == [("PUS", i) for i in range(_TOWERS)]


def gains(robot: Robot) -> tuple[float, ...]:
    """Mm a carriage rises for a unit of its actuator."""
    return tuple(robot.slots[:, SLOTS.index("gain")].tolist())


def as_built(robot: Robot) -> FirmwareDelta:
    """Return the towers as if they were vertical and equally far: exact where they are."""
    slots = robot.slots
    towers = slots[:, 0:3] - slots[:, 3:6]
    angles = np.degrees(np.arctan2(towers[:, 1], towers[:, 0])) % 360.0
    return FirmwareDelta(
        float(np.hypot(towers[:, 0], towers[:, 1]).mean()),
        tuple(angles.tolist()),
        tuple(slots[:, SLOTS.index("rod")].tolist()),
        tuple((slots[:, SLOTS.index("offset")] + towers[:, 2]).tolist()),
    )


def _workspace(firmware: FirmwareDelta) -> tuple[FloatArray, str]:
    """Poses over the bed, and what to call them."""
    across = 0.8 * firmware.radius
    high = max(0.0, 0.5 * min(firmware.endstops))
    over = f"within {across:.0f} mm of the middle and {high:.0f} mm of the bed"
    return cylinder(across, high, _POSES), over


def _with_numbers(x: FloatArray) -> FirmwareDelta:
    """The delta with its numbers in a row: radius, angles, arms, carriages."""
    angles, arms, carriages = (tuple(part.tolist()) for part in x[1:].reshape(3, _TOWERS))
    return FirmwareDelta(float(x[0]), angles, arms, carriages)


def as_robot(firmware: FirmwareDelta, gains: Sequence[float]) -> Robot:
    """The robot with the firmware's numbers."""
    text = text_of(firmware, gains, About("linear delta"))
    return robot_files.robot_of(text, "the firmware's numbers")


def text_of(
    firmware: FirmwareDelta,
    gains: Sequence[float],
    about: About,
    bed: Bed | None = None,
    rods: bool = False,
) -> str:
    """A robot file with the firmware's numbers.

    Parameters
    ----------
    firmware : FirmwareDelta
        The numbers.
    gains : sequence of float
        Mm a carriage rises for a unit of its actuator, which is 0 at the end stop.
    about : About
        Its name and where it comes from.
    bed : Bed or None
        Where the nozzle stays; carriages then stay below their end stops.
    rods : bool
        Whether a calibration frees the rods: where distances across the bed were measured.
    """
    box = {} if bed is None else _box(firmware, bed)
    lowest = 0.0 if bed is None else min(0.0, bed.lowest)  # no carriage is below the nozzle
    parameters = {"radius": firmware.radius}
    parameters |= {f"angle{i}": angle for i, angle in enumerate(firmware.angles, 1)}
    limbs = [
        {
            "kind": "PUS",
            "base": {"radius": "radius", "angle": f"angle{i}", "z": 0.0},
            "platform": [0.0, 0.0, 0.0],
            "slider": [0, 0, 1],
            "rod": arm,
            "offset": carriage,
            "gain": gain,
            "branch": -1,
        }
        | ({"stroke": [lowest, carriage]} if bed is not None and carriage > lowest else {})
        for i, (arm, carriage, gain) in enumerate(
            zip(firmware.arms, firmware.carriages, gains, strict=True), 1
        )
    ]
    home = min(round(0.5 * max(firmware.endstops), 3), box["z"][1] if box else np.inf)
    return robot_files.text_of(
        about,
        {"map": "translation", "home": {"z": home}},
        [*_FREE, *_RODS] if rods else _FREE,
        limbs,
        parameters,
        f"# Nothing determines which way x is, so angle3 stays{'' if rods else _HELD_RODS}.\n",
        box,
    )
