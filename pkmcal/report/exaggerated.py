"""A machine as lines, beside the same machine with its errors made large enough to see."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.calibration.identification import Identification
from pkmcal.estimation.parameters import Parameters
from pkmcal.kinematics.calibratable import as_given
from pkmcal.view.skeleton import Skeleton, skeleton

_SEEN = 0.06  # of the machine's size: how far the most displaced joint is drawn off
_MOST = 0.2
_STEPS = tuple(a * 10**b for b in range(6) for a in (1, 2, 5))


def middle_exaggerated(found: Identification) -> tuple[Skeleton, Skeleton, int] | None:
    """`exaggerated` of a calibration, at the commands of the row in the middle."""
    equations = found.fit.equations
    middle = len(equations.table.actuators) // 2
    q, pose = equations.table.actuators[middle], found.fit.end.pose[middle]
    before, after = found.fit.start.theta, found.fit.end.theta
    return exaggerated(equations.parameters, before, after, q, pose)


def exaggerated(
    parameters: Parameters, before: FloatArray, after: FloatArray, q: FloatArray, guess: FloatArray
) -> tuple[Skeleton, Skeleton, int] | None:
    """A machine twice at the same commands, the second time with its change made large.

    Parameters
    ----------
    parameters : Parameters
        Of the calibration.
    before, after : ndarray (p,)
        Two values of them, mm and rad.
    q : ndarray (n,)
        The commands, mm and rad.
    guess : ndarray (6,)
        Near the pose.

    Returns
    -------
    (Skeleton, Skeleton, int) or None
        Before, after, and by how much the change is multiplied; None where there is no pose.
    """

    def drawn(theta: FloatArray) -> Skeleton | None:
        machine = parameters.robot.replace(parameters.values_at(theta))
        return skeleton(as_given(machine), q, guess)

    one = drawn(before)
    if one is None:
        return None
    size = float(np.ptp(one.joints, axis=0).max())
    best = None
    for times in _STEPS:
        other = drawn(before + times * (after - before))
        off = np.inf if other is None else np.linalg.norm(other.joints - one.joints, axis=1).max()
        if other is None or off > _MOST * size:
            break
        best = (one, other, times)
        if off > _SEEN * size:
            break
    return best
