"""Slack cables: readings of actuators that are longer than the way to the platform.

A cable pulls and cannot push: what its winch has let out is the distance to the platform or more.
Where it is more the reading says next to nothing of the pose, and taken for a distance it bends the
geometry. Slack shows on machines with more cables than needed, as a residual of one sign.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray, first_largest
from pkmcal.display import first_rows
from pkmcal.estimation.begin import estimator_at
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.estimate import Estimate
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.pose_minima import (
    TOLD_APART,
    in_least_minima,
    solved_in_least_minima,
    squares_of_poses,
)
from pkmcal.exceptions import ArgumentError
from pkmcal.fitted.outliers import FALSE_ALARM
from pkmcal.kinematics.calibratable import Calibratable, as_parallel
from pkmcal.kinematics.robot import Robot
from pkmcal.statistics.robust_scale import median_ratio

_LISTED = 3  # cables that a warning names
_ROUNDS = 10  # of leaving cables out and fitting anew
_TOO_SHORT = 4.0  # deviations by which a reading is shorter than a slack cable's can be
_SEEN = 1e-6  # degrees of freedom from which an equation's residual shows anything
_ALIKE = 1e-3  # share by which squares differ that cannot be told apart
_ROUNDING = 1e-6  # share by which they differ that are equal


@dataclass(frozen=True)
class SlackCable:
    """A cable that was slack at a pose.

    Attributes
    ----------
    rows : tuple of int
        Numbers of the rows that are of this pose.
    actuators : tuple of int
        Whose reading it is, counted from 1; several where noise does not let it be told which of
        them, the likeliest first.
    longer : float
        By how much the reading, of the likeliest, is longer than the way, mm.
    """

    rows: tuple[int, ...]
    actuators: tuple[int, ...]
    longer: float

    def __str__(self) -> str:
        which = " or ".join(f"q{a}" for a in self.actuators)
        return f"{which} of row {first_rows(self.rows, 3)} by {self.longer:.3g} mm"


@dataclass(frozen=True)
class Cell:
    """A reading at a pose that is too long: the pose, and the closures that it may be.

    The likeliest comes first: that is the one to be left out.
    """

    pose: int
    closures: tuple[int, ...]


def _slack_cells(estimator: Estimator, estimate: Estimate) -> list[Cell]:
    """Readings that the others show to be longer than the way, at most one a pose."""
    equations = estimator.equations
    odd, limit, width = _odd_poses(equations, estimate)
    if not len(odd):
        return []
    gain, longer = _without_each(equations, estimate, odd)
    pulling, cells = _pulling(equations), []
    for pose, own, sign in zip(odd.tolist(), gain, longer > 0.0, strict=True):
        # if one that is too short explains more, something else is wrong with this row
        most = own.max()
        alike = sign & (own >= most - max(TOLD_APART * width, _ALIKE * most))
        if most > limit and alike.any() and pulling[alike].all():
            first = first_largest(np.where(alike, own, -np.inf), _ROUNDING * most)
            others = (k for k in np.flatnonzero(alike).tolist() if k != first)
            cells.append(Cell(pose, (first, *others)))
    return cells


def _odd_poses(equations: Equations, estimate: Estimate) -> tuple[IntArray, float, float]:
    """Poses at which some closure is further off than noise explains; and two squared deviations.

    The first is what a closure has to explain, of all that are far off; the second that of one.
    """
    from scipy.special import ndtri

    longer, redundancy = _longer(equations, estimate)
    seen = redundancy > _SEEN
    used = int(seen.sum())
    if not used:
        return np.empty(0, dtype=np.intp), np.inf, np.inf
    standard = np.where(seen, longer**2 / np.where(seen, redundancy, 1.0), 0.0)
    width = max(1.0, median_ratio(standard[seen], np.ones(used, dtype=np.intp)))
    limit = float(ndtri(FALSE_ALARM / used) ** 2 * width)
    return np.flatnonzero(standard.max(axis=1) > limit), limit, width


def _without_each(
    equations: Equations, estimate: Estimate, poses: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return the fall of the squares of some poses without each closure, (P, equations).

    And how much longer it then reads than needed, whitened. The poses are found anew, for long
    slack moves them far; the geometry is held.
    """
    evaluation, noise = estimate.evaluation, estimate.state.noise
    before = squares_of_poses(equations, evaluation, noise)[poses]
    shape = (len(poses), equations.machines.equations)
    gain, longer = np.zeros(shape), np.zeros(shape)
    for k in range(shape[1]):
        cells = [(pose, k) for pose in poses.tolist()]
        other = equations.without_closures([*equations.slack_cells, *cells], evaluation)
        there = in_least_minima(other, other.at(evaluation.theta, noise, evaluation), noise)
        gain[:, k] = np.where(
            there.status[poses] == 0, before - squares_of_poses(other, there, noise)[poses], 0.0
        )
        off, _ = there.machines.residual(there.states)
        longer[:, k] = -off[poses, k]
    return gain, longer * np.sign(_slopes(equations, evaluation))[poses]


def taut(equations: Equations, start: Evaluation) -> tuple[Equations, tuple[Cell, ...]]:
    """The equations without cables that are slack, and which these are.

    One a pose and robust fit, until what is left agrees. A cable that turns out to be shorter than
    the way is taut after all.
    """
    cells: dict[tuple[int, int], Cell] = {}
    if equations.machines.cells:
        raise ArgumentError(
            "slack: cables are not looked at for slack where their tensions are unknown"
        )
    if not _pulling(equations).any():
        return equations, ()
    for k in range(_ROUNDS):
        estimator = estimator_at(equations, start, "cauchy")
        estimate = solved_in_least_minima(estimator)
        longer, _ = _longer(equations, estimate)
        kept = {key: cell for key, cell in cells.items() if longer[key] > -_TOO_SHORT}
        more = _slack_cells(estimator, estimate)
        found = kept | {(cell.pose, cell.closures[0]): cell for cell in more}
        if k and found.keys() == cells.keys():
            break
        cells = found
        equations = equations.without_closures(list(cells), estimate.evaluation)
    return equations, tuple(cells.values())


def _longer(equations: Equations, estimate: Estimate) -> tuple[FloatArray, FloatArray]:
    """Return the excess lengths of cables (K, equations), whitened, and their redundancy."""
    root = np.sqrt(np.repeat(estimate.weights, equations.blocks.components))
    taken = root[:, None] * estimate.change(estimate.half)
    every = np.ones(len(estimate.weights))  # what a robust loss sets aside is looked at as well
    assert equations.system is not None
    off, redundancy = equations.system.closure_residuals(
        estimate.evaluation, estimate.state.noise, every, taken
    )
    return off * np.sign(_slopes(equations, estimate.evaluation)), redundancy


def slack_cables(
    equations: Equations, estimate: Estimate, cells: Sequence[Cell]
) -> tuple[SlackCable, ...]:
    """List slack cables in words and mm, at poses found without them, the longest first."""
    if not cells:
        return ()
    evaluation = estimate.evaluation
    keys = [(cell.pose, cell.closures[0]) for cell in cells]
    without = equations.without_closures(keys, evaluation)
    there = without.at(evaluation.theta, estimate.state.noise, evaluation)
    assert without.system is not None
    off = -without.system.readings_off(there) * _slopes(equations, there)
    pose_of, actuator = np.concatenate(equations.table.pose_of), equations.machines.actuators
    cables = [
        SlackCable(
            tuple(equations.table.rows[pose_of == cell.pose].tolist()),
            tuple(actuator[closure] + 1 for closure in cell.closures),
            float(off[cell.pose, cell.closures[0]]),
        )
        for cell in cells
    ]
    return tuple(sorted(cables, key=lambda each: (-each.longer, each.rows)))


def listed_slack(cables: Sequence[SlackCable]) -> str:
    """Name the longest ones."""
    more = f" and {len(cables) - _LISTED} more" if len(cables) > _LISTED else ""
    return ", ".join(map(str, cables[:_LISTED])) + more


def _pulling(equations: Equations) -> BoolArray:
    """Mark closures of cables, (equations,)."""
    robot = as_parallel(equations.parameters.robot)
    if robot is None or not any(limb.cable for limb in robot.model.limbs):
        return np.zeros(equations.machines.equations, dtype=bool)
    home = robot.inverse(robot.home)[None]
    slope = robot.machine.slopes(robot.slots, home)[0]
    cables = np.array([limb.cable for limb in robot.model.limbs])
    of_limbs = _of_limbs(robot)
    pulling = [
        bool(cables[mine].all()) and abs(np.sign(slope[mine]).sum()) == mine.sum()
        for mine in (of_limbs == a for a in range(robot.n_actuators))
    ]  # an actuator that lets one cable out and takes another in says nothing by its sign
    return np.array([a >= 0 and pulling[a] for a in equations.machines.actuators], dtype=bool)


def _slopes(equations: Equations, evaluation: Evaluation) -> FloatArray:
    """Return slopes of cable lengths by readings (K, equations), negative if reversed."""
    actuators = equations.machines.actuators

    def slopes(machine: Calibratable, poses: IntArray) -> FloatArray:
        found, robot = np.ones((len(poses), len(actuators))), as_parallel(machine)
        if robot is None or not robot.model.closed_form:
            return found
        slope = robot.machine.slopes(robot.slots, equations.table.actuators[poses])
        for k, a in enumerate(actuators):
            if a >= 0:
                found[:, k] = slope[:, _of_limbs(robot) == a].mean(axis=1)
        return found

    return evaluation.machines.joined(slopes)


def _of_limbs(robot: Robot) -> IntArray:
    """The actuator of each limb."""
    return np.array([limb.actuator for limb in robot.model.limbs])
