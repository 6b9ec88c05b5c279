"""A set of numbers of a machine whose effects on the pose are independent."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import TIED, FloatArray, first_largest
from pkmcal.geometry.elastic import is_kinematic
from pkmcal.kinematics.robot import Robot

INDEPENDENT = 1e-7  # least part of a number's effect that the others cannot have
POSES = 40  # at least
_HALVINGS = 8
_KNOWN = ("gain", "drive")  # better than what an arm of a machine is
SHARE = 0.2  # of the characteristic length, and rad: how far from home the actuators go
ERRORS = {"mm": 0.1, "rad": 1e-3}  # sizes at which effects are compared


def independent_numbers(robot: Robot) -> tuple[str, ...]:
    """Names of numbers that poses of the workspace tell apart, as many as there are.

    Gains and drive laws are not among them: they are known better than what an arm of a machine
    is. Of the effects that are left, the largest is taken next, of those alike the first.

    Parameters
    ----------
    robot : Robot
        The machine.

    Returns
    -------
    tuple of str
        In the order of ``geometry.names``.

    Examples
    --------
    >>> import pkmcal as pk
    >>> len(independent_numbers(pk.load("five-bar")))
    13
    """
    geometry = robot.geometry
    places = np.array(
        [
            i
            for i, (name, tied) in enumerate(zip(geometry.names, geometry.tied, strict=True))
            if not tied and not name.startswith(_KNOWN) and is_kinematic(name)
        ]
    )
    effects = near_home(robot)[:, :, places]
    effects[:, 3:] *= robot.length
    scale = np.array([ERRORS[geometry.units[i]] for i in places])
    columns = effects.reshape(-1, len(places)) * scale
    return tuple(geometry.names[places[i]] for i in sorted(_independent(columns)))


def _independent(columns: FloatArray) -> list[int]:
    """Choose independent columns; LAPACK's exchanges decide between equal ones by rounding."""
    left = np.asarray(np.linalg.qr(columns, mode="r"))
    found: list[int] = []
    least = INDEPENDENT * float(np.linalg.norm(left, axis=0).max(initial=0.0))
    while len(found) < min(left.shape):
        size = np.linalg.norm(left, axis=0)
        size[found] = 0.0
        if not size.max() > least:
            break
        found.append(first_largest(size, TIED * float(size.max())))
        along = left[:, found[-1]] / size[found[-1]]
        left -= np.outer(along, along @ left)
    return found


def near_home(robot: Robot) -> FloatArray:
    """Effects (N, 6, p) of every number at random poses near home, as twists (v, ω).

    Closures are met there, as far as the geometry lets them. The coordinates are so near that the
    machine can be solved at half of them, and so many that the poses do not limit what is
    independent.
    """
    home = robot.inverse(robot.home)
    way = np.array([SHARE * (robot.length if u == "mm" else 1.0) for u in robot.actuator_units])
    columns = robot.geometry.slot_index.astype(np.int32)
    poses = max(POSES, len(columns) // 2)
    found = np.empty((0, 6, len(columns)))
    for _ in range(_HALVINGS):
        q = home + np.random.default_rng(0).uniform(-way, way, (poses, robot.n_actuators))
        solved = robot.forward(q)
        good = np.asarray(solved.ok)
        own, _ = robot.own_rows(solved.pose[good])
        met = q[good]
        if robot.machine.rows > robot.machine.m:  # what actuators contradict each other by is none
            met = robot.machine.inverse(robot.slots, own)
        given = (robot.slots, own, np.ascontiguousarray(met), columns, True)
        effects = robot.machine.error_jacobian(*given)[:, [3, 4, 5, 0, 1, 2]]
        effects = effects[np.isfinite(effects).all(axis=(1, 2))]
        if len(effects) > len(found):
            found = effects
        if 2 * len(found) >= poses:
            break
        way = way / 2
    return found
