"""Corrections of the actuator commands that bring a machine to the poses asked for (eq. 18)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pkmcal import digits
from pkmcal.core import as_rows
from pkmcal.robot import Robot

FloatArray = NDArray[np.float64]
Measured = ArrayLike | Callable[[FloatArray], ArrayLike]

ORIENTATIONS = ("measured", "assumed", "from-position")
_LISTED = 12  # a longer list of poses is printed with its middle left out


@dataclass(frozen=True, eq=False)
class Compensation:
    """Corrected commands. Rows are poses; a row that a limb cannot reach is NaN.

    Attributes
    ----------
    actuators : ndarray (N, n)
        What to command: the ideal commands with the correction added, mm or rad.
    correction : ndarray (N, n)
        ΔL of eq. 18, mm or rad.
    objective : ndarray (N,)
        E of eq. 18 at this correction: 0 unless one correction serves all poses.
    history : ndarray (N, passes)
        E with the correction that was in force at each measurement: how far off the actuators'
        readings were, as the ideal machine sees them.
    """

    actuators: FloatArray
    correction: FloatArray
    objective: FloatArray
    history: FloatArray

    def __str__(self) -> str:
        n = self.actuators.shape[1]
        heads = ["row", *(f"q{i + 1}" for i in range(n)), *(f"correction{i + 1}" for i in range(n))]
        rows = [
            [str(row), *(digits.fixed(float(value), 4) for value in (*q, *dq))]
            for row, (q, dq) in enumerate(zip(self.actuators, self.correction, strict=True))
        ]
        if len(rows) > _LISTED:
            rows[_LISTED - 4 : -3] = [["⋮"] * len(heads)]
        off = ", ".join(f"{value:.3g}" for value in np.sqrt(np.nanmean(self.history**2, axis=0)))
        title = f"{len(self.actuators)} poses; off by {off} (rms of the actuators, pass by pass)"
        return title + "\n" + digits.table(heads, rows)


def compensate(
    robot: Robot,
    desired: ArrayLike,
    measured: Measured,
    method: str = "exact",
    orientation: str = "measured",
    common: bool = False,
    passes: int = 1,
) -> Compensation:
    """Correct the commands of a machine by where it went.

    Eq. 18 of the 2TPR&2TPS paper asks for the ΔL that makes E = √Σ(L* - L - ΔL)² least, with L*
    the actuators of the desired pose and L those of the measured one, both through the inverse
    kinematics of the ideal machine. Its minimiser is ΔL = L* - L.

    Parameters
    ----------
    robot : Robot
        The ideal machine: the one whose inverse kinematics makes the commands.
    desired : array_like (N, 6)
        Poses asked for, mm and rad.
    measured : array_like (N, 6) or (N, 3), or callable
        Poses or positions that were reached with the ideal commands; or a function that takes
        commands (N, n), has them carried out and returns what was measured.
    method : {"exact"}
        The minimiser in closed form.
    orientation : {"measured", "assumed", "from-position"}
        Where the orientation of the measured pose comes from. "measured": from the six numbers.
        "assumed": it is the desired one. "from-position": of the 2TPR&2TPS, whose β follows from
        the position by x = z tan β (eq. 7); the other angles are the desired ones.
    common : bool
        One correction for all poses, the mean, in place of one for each.
    passes : int
        How often to measure and correct; more than once needs a callable.

    Returns
    -------
    Compensation
        Corrected commands, corrections, and E pass by pass.

    Raises
    ------
    ValueError, TypeError
        An argument that does not fit.

    Examples
    --------
    >>> import pkmcal as pk
    >>> from pkmcal.compensate import compensate
    >>> robot = pk.load("hexapod")
    >>> real = robot.replace({"offset1": 0.2})
    >>> found = compensate(
    ...     robot, [[0, 0, 850, 0, 0, 0]], lambda q: real.forward(q).pose, passes=3
    ... )
    >>> found.correction.round(6) + 0.0
    array([[-0.2,  0. ,  0. ,  0. ,  0. ,  0. ]])
    """
    if method != "exact":
        raise ValueError(f"method must be 'exact', found {method!r}")
    if orientation not in ORIENTATIONS:
        raise ValueError(
            f"orientation must be one of {', '.join(ORIENTATIONS)}; found {orientation!r}"
        )
    if orientation == "from-position" and robot.model.map != "2tpr2tps":
        raise ValueError(
            "orientation='from-position' is for machines whose position tells their orientation,"
            f" those of the pose map 2tpr2tps; {robot.name} has the map {robot.model.map}"
        )
    if isinstance(passes, bool) or not isinstance(passes, int) or passes < 1:
        raise ValueError(f"passes must be a whole number from 1, found {passes!r}")
    if passes > 1 and not callable(measured):
        raise ValueError("passes: more than one needs measured to be a function of the commands")
    poses, shape = as_rows("desired", desired, 6)
    if len(shape) != 1:
        raise ValueError(f"desired must have shape (N, 6), found {(*shape, 6)}")
    ideal = robot.inverse(poses)
    correction = np.zeros_like(ideal)
    history = np.empty((len(poses), passes))
    for k in range(passes):
        reached = measured(ideal + correction) if callable(measured) else measured
        off = ideal - robot.inverse(_pose_of(reached, poses, orientation))
        history[:, k] = np.linalg.norm(off, axis=1)
        step = np.broadcast_to(np.nanmean(off, axis=0), off.shape) if common else off
        correction = correction + step
    return Compensation(
        actuators=ideal + correction,
        correction=correction,
        objective=np.linalg.norm(off - step, axis=1),
        history=history,
    )


def _pose_of(reached: ArrayLike, desired: FloatArray, orientation: str) -> FloatArray:
    """The measured poses, their orientation from where `orientation` says."""
    given = np.asarray(reached)
    width = given.shape[-1] if given.ndim else 0
    if orientation != "measured" and width == 3:
        rows, shape = as_rows("measured", given, 3)
    elif width == 3:
        raise ValueError(
            "measured: positions do not tell the orientation; give poses (N, 6), or"
            " orientation='assumed'"
        )
    else:
        rows, shape = as_rows("measured", given, 6)
    if shape != (len(desired),):
        raise ValueError(
            f"measured must have one row for each of {len(desired)} poses, found {given.shape}"
        )
    if orientation == "measured":
        return rows
    pose: FloatArray = desired.copy()
    pose[:, :3] = rows[:, :3]
    if orientation == "from-position":
        pose[:, 4] = np.arctan2(pose[:, 0], pose[:, 2])
    return pose
