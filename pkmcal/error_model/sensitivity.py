"""Pose error caused by an error of each number of the geometry (eq. 14 to 17)."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import number, word, words
from pkmcal.arrays import FloatArray, IntArray
from pkmcal.core.library import POSE
from pkmcal.display import Table
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.elastic import is_kinematic
from pkmcal.kinematics.perturbed import ideal, off
from pkmcal.kinematics.robot import Robot, require_parallel
from pkmcal.result import Result

# What a step of 1 is: 1 mm, 1 mrad, a ratio's 0.001, and by as much over a metre or a radian; 1 N,
# 1 kg, and what gives 1 µm or 1 nrad more by 1 N, or 1 N mm.
PER_STEP = {
    "mm": 1.0,
    "rad": 1e-3,
    "1": 1e-3,
    "1/mm": 1e-6,
    "1/rad": 1e-3,
    "1/mm2": 1e-9,
    "1/N": 1e-6,
    "N": 1.0,
    "N mm": 1.0,
    "N/mm": 1.0,
    "mm/N": 1e-3,
    "rad/(N mm)": 1e-9,
    "kg": 1.0,
}
Study = Literal["limb1", "offsets", "all-limbs"]
STUDIES: tuple[Study, ...] = get_args(Study)
_NUMBERED = re.compile(r"([a-z_]+)[0-9]+(.*)")


@dataclass(frozen=True, eq=False, repr=False)
class Sensitivity(Result):
    """Pose errors, case by case: pose with erroneous geometry minus ideal pose (eq. 16).

    Attributes
    ----------
    robot : Robot
        The machine without errors.
    cases : tuple of str, c
        Which number was in error; a wildcard stands for all that match, in error together.
    step : float
        The error: mm for lengths, mrad for angles, thousandths for ratios.
    poses : ndarray (..., 6)
        Ideal poses, mm and rad.
    exact : ndarray (c, ..., 6)
        Pose errors by solving the machine with the error again, mm and rad; NaN where it, or the
        ideal one, has no pose.
    linear : ndarray (c, ..., 6)
        The same as the error Jacobian predicts it.
    """

    robot: Robot
    cases: tuple[str, ...]
    step: float
    poses: FloatArray
    exact: FloatArray
    linear: FloatArray

    @property
    def mean(self) -> FloatArray:
        """Mean over the poses of the size of `exact`, (c, 6), mm and rad; NaN rows left out."""
        return _mean_size(self.exact)

    @property
    def mean_linear(self) -> FloatArray:
        """Mean over the poses of the size of `linear`, (c, 6), mm and rad; NaN rows left out."""
        return _mean_size(self.linear)

    @property
    def n_failed(self) -> IntArray:
        """Number of poses that were not solved, (c,)."""
        missing = np.isnan(self.exact).any(axis=-1)
        counted: IntArray = missing.reshape(len(self.cases), -1).sum(axis=1)
        return counted

    @property
    def failed(self) -> IntArray:
        """The former name of `n_failed`."""
        return self.n_failed

    def __getitem__(self, case: str) -> FloatArray:
        """`exact` of one case (..., 6)."""
        if case not in self.cases:
            raise KeyError(f"no case {case!r}")
        found: FloatArray = self.exact[self.cases.index(case)]
        return found

    def failures(self) -> str:
        """Say which cases have no pose where; empty where all were solved."""
        count = self.poses.size // 6
        return "; ".join(
            f"{bad} of {count} poses not solved with an error of {case}"
            for case, bad in zip(self.cases, self.n_failed, strict=True)
            if bad
        )

    def _parts(self) -> Iterator[str | Table]:
        count = self.poses.size // 6
        sizes = np.concatenate([self.mean[:, :3], np.degrees(self.mean[:, 3:])], axis=1)
        yield (
            f"{self.robot.name}: mean size of the pose error over {count} pose{'s' * (count != 1)}"
            f"\nfor an error of {self.step:g} mm (angles {self.step:g} mrad, ratios"
            f" {self.step / 1000:g})"
        )
        rows = [
            [case, *(f"{v:.4f}" for v in size)]
            for case, size in zip(self.cases, sizes, strict=True)
        ]
        heading = [f"{name} [{'mm' if name in 'xyz' else 'deg'}]" for name in POSE]
        yield Table(["error of", *heading], rows, left=1)
        if self.n_failed.any():
            yield self.failures()


def sensitivity(
    robot: Robot,
    poses: ArrayLike,
    step: float = 1.0,
    *,
    cases: str | Sequence[str] | None = None,
) -> Sensitivity:
    """Compute the pose error that an error of each number of the geometry causes.

    Parameters
    ----------
    robot : Robot
        The machine without errors.
    poses : array_like (..., 6)
        Where it is commanded, mm and rad. A pose that its closures do not allow is completed
        (`Robot.complete`); ``.poses`` says to what.
    step : float
        The error: mm for lengths, mrad for angles, thousandths for ratios.
    cases : str or sequence of str, optional
        Names; a wildcard puts all that match in error together: ``"base*.x"``. By default every
        number that can be replaced, one by one.

    Returns
    -------
    Sensitivity
        ``.exact`` and ``.linear`` (cases, ..., 6).

    Raises
    ------
    ValueError, TypeError
        An unknown or tied name, no name at all, a step that is not a finite number or 0, a wrong
        shape.

    Notes
    -----
    Eq. 16 of the 2TPR&2TPS paper, ΔP = FK(geometry + error) - FK(geometry) at the same actuator
    coordinates; the linear prediction is its derivative, -M Φ_u⁻¹ Φ_θ.

    Examples
    --------
    >>> import pkmcal as pk
    >>> robot = pk.load("2tpr2tps")
    >>> found = pk.sensitivity(robot, [[0, 0, 400, 0, 0, 0]], cases=["offset3", "base*.y"])
    >>> found.mean[1].round(6)
    array([0., 1., 0., 0., 0., 0.])
    """
    require_parallel(robot)
    size = step_size(step)
    names = own_names(robot) if cases is None else list(words("cases", cases))
    if not names:
        raise ArgumentError("cases: name at least one number of the geometry")
    at = ideal(robot, poses)
    jacobian = robot.error_jacobian(at.poses, at.actuators)
    geometry = robot.geometry
    exact = np.empty((len(names), len(at.poses), 6))
    linear = np.empty_like(exact)
    for i, case in enumerate(names):
        places = [geometry.names.index(name) for name in geometry.match(case, "cases")]
        errors = [size * PER_STEP[geometry.units[place]] for place in places]
        changed = {
            geometry.names[place]: geometry.values[place] + error
            for place, error in zip(places, errors, strict=True)
        }
        solved = robot.replace(changed).forward(at.actuators, guess=at.poses)
        exact[i] = off(solved.pose, at.poses)
        linear[i] = jacobian[:, :, places] @ errors
    shape = (len(names), *at.shape, 6)
    return Sensitivity(
        robot,
        tuple(names),
        size,
        at.poses.reshape(*at.shape, 6),
        exact.reshape(shape),
        linear.reshape(shape),
    )


def own_names(robot: Robot) -> list[str]:
    """List every number that can be replaced and that poses follow, parameters too."""
    geometry = robot.geometry
    names = zip(geometry.names, geometry.tied, strict=True)
    return [name for name, tied in names if not tied and is_kinematic(name)]


def study_cases(robot: Robot, study: Study) -> list[str]:
    """List the cases of one of the three studies of §3.3, for any robot.

    Parameters
    ----------
    robot : Robot
        Its default free set says which numbers count, where it has one.
    study : {"limb1", "offsets", "all-limbs"}
        The numbers of limb 1 one by one (Fig. 4, 5); the zero lengths of all limbs (Fig. 6, 7);
        each kind of number in error on all limbs together (Fig. 8, 9), and named parameters.

    Returns
    -------
    list of str
        Empty where named parameters drive all of them.

    Examples
    --------
    >>> import pkmcal as pk
    >>> study_cases(pk.load("2tpr2tps"), "all-limbs")[:3]
    ['offset*', 'base*.x', 'base*.y']
    """
    require_parallel(robot)
    word("study", study, STUDIES)
    geometry = robot.geometry
    own = set(own_names(robot))
    if study == "offsets":
        return [n.name for n in geometry.numbers if n.slot == "offset" and n.name in own]
    free = own & set(robot.model.free) or own
    # zero length first, as the paper has them
    numbers = sorted(geometry.numbers, key=lambda number: number.slot != "offset")
    if study == "limb1":
        return [n.name for n in numbers if n.limb == 0 and n.name in free]
    kinds = (_NUMBERED.sub(r"\1*\2", n.name) for n in numbers if n.name in free)
    return [*dict.fromkeys(kinds), *(name for name in geometry.parameters if name in free)]


def step_size(step: float) -> float:
    """Check that a step is a number other than 0.

    Raises
    ------
    ValueError, TypeError
        No number, not finite, or 0.
    """
    size = number("step", step)
    if size == 0:
        raise ArgumentError(f"step must not be 0, found {step}")
    return size


def _mean_size(errors: FloatArray) -> FloatArray:
    sizes = np.abs(errors).reshape(len(errors), -1, 6)
    solved = np.isfinite(sizes).all(axis=-1, keepdims=True)
    total = np.where(solved, sizes, 0.0).sum(axis=1)
    count = solved.sum(axis=1)
    mean: FloatArray = np.divide(total, count, out=np.full_like(total, np.nan), where=count > 0)
    return mean
