"""Quality of motion at poses: conditioning, distance from singularities, transmission."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arrays import FloatArray, as_rows
from pkmcal.display import Table
from pkmcal.kinematics.robot import Robot, require_parallel
from pkmcal.result import Result

BLOCK = 20_000  # poses at a time
_SUMMARY = (np.min, np.median, np.max)


@dataclass(frozen=True, eq=False, repr=False)
class Dexterity(Result):
    """Dexterity: how well closures hold poses of any leading shape; NaN out of reach.

    The singular values are those of the closures by a twist of the platform, rotations as their
    arc at ``robot.length``: how far the joints part in mm when the platform yields by 1 mm.

    Attributes
    ----------
    conditioning : ndarray (...)
        σ_min/σ_max: 1 is isotropic, 0 a type-2 singularity. As `Forward.conditioning`.
    sigma_min : ndarray (...)
        The smallest: how well the weakest direction is held; 0 at a type-2 singularity.
    manipulability : ndarray (...)
        Their product.
    determinant : ndarray (...)
        The product with a sign, which changes across a type-2 singularity; NaN where there are
        more closures than free coordinates.
    transmission : ndarray (...)
        The least, over the limbs, of abs(cos) of the angle between limb and motion of its actuator;
        0 at a type-1 singularity, 1 for a limb whose own length is driven. Of a joint behind the
        platform the sine of the angle between its motion and what the other actuators can do: 0
        where a wrist's axes are in line.
    """

    conditioning: FloatArray
    sigma_min: FloatArray
    manipulability: FloatArray
    determinant: FloatArray
    transmission: FloatArray

    def _parts(self) -> Iterator[str | Table]:
        held = np.isfinite(self.conditioning)
        yield f"{int(held.sum())} of {held.size} poses within reach"
        if held.any():
            measures = [field.name for field in fields(self)]
            found = {name: getattr(self, name)[held] for name in measures}
            yield Table(
                ["measure", "least", "median", "largest"],
                [
                    [name.replace("_", " "), *(f"{f(values):.4g}" for f in _SUMMARY)]
                    for name, values in found.items()
                    if np.isfinite(values).all()  # no determinant: more closures than coordinates
                ],
                left=1,
            )


def dexterity(robot: Robot, poses: ArrayLike) -> Dexterity:
    """Conditioning, manipulability and distance from singularities at poses.

    Parameters
    ----------
    robot : Robot
        The machine.
    poses : array_like (..., 6)
        x y z in mm, α β γ in rad; on the machine's closures (`Robot.complete`).

    Returns
    -------
    Dexterity
        Arrays of the poses' leading shape.

    Raises
    ------
    ValueError, TypeError
        A wrong shape, or no numbers.

    Examples
    --------
    >>> import pkmcal as pk
    >>> robot = pk.load("2tpr2tps")
    >>> found = dexterity(robot, robot.home)
    >>> round(float(found.conditioning), 3), round(float(found.transmission), 3)
    (0.104, 1.0)
    """
    require_parallel(robot)
    rows, shape = as_rows("poses", poses, 6)
    found = [_measures(robot, rows[i : i + BLOCK]) for i in range(0, len(rows), BLOCK)]
    joined = np.concatenate(found, axis=1) if found else np.empty((5, 0))
    return Dexterity(*(column.reshape(shape) for column in joined))


def _measures(robot: Robot, poses: FloatArray) -> FloatArray:
    """The five measures, one per row (5, N)."""
    own = robot.on_map(robot.own_rows(poses)[0])
    slots = robot.slots
    q = robot.machine.inverse(slots, own)
    closure = robot.machine.closure(slots, own, q)
    out = np.full((5, len(own)), np.nan)
    numbers = np.concatenate([closure.by_step, closure.by_q], axis=-1)
    good = np.isfinite(numbers).all(axis=(1, 2))
    steps = closure.by_step[good]
    sigma = np.linalg.svd(steps, compute_uv=False)
    out[0, good] = sigma[:, -1] / sigma[:, 0]
    out[1, good] = sigma[:, -1]
    out[2, good] = sigma.prod(axis=1)
    if steps.shape[1] == steps.shape[2]:
        out[3, good] = np.linalg.det(steps)
    out[4, good] = robot.limb_kinematics.transmission(robot, own[good], q[good], closure.by_q[good])
    return out
