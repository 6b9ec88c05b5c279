"""Numbers that a calibration may hold because they only say where frames lie: the datum.

A measurement sees neither where the base frame lies in the base and the platform frame on the
platform, where nothing ties them, nor how the frames between an arm's joints are drawn. Changes of
the geometry that do no more than that are found from its twists alone: with E the twists of the
platform by the numbers, L those by motions of the base frame and R by motions of the platform
frame, they are the null space of [E L R] over poses of the whole workspace. As many numbers as the
measurements leave open of them are held at their present values (W. Baarda, S-transformations and
criterion matrices, 1973); what is left has finite deviations, in frames that these numbers define.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, first_largest
from pkmcal.estimation.estimate import Estimate
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.identifiability import ALIKE, decompose, listed
from pkmcal.estimation.parameters import Asked, Parameters
from pkmcal.kinematics.calibratable import as_parallel
from pkmcal.kinematics.workspace import sample_poses
from pkmcal.readings.unknowns import PLAIN
from pkmcal.screw import from_pose
from pkmcal.statistics.linear_fit import ROUNDING
from pkmcal.statistics.singular_values import svd

DATUM = "datum"  # the word that `fix` takes for them

_POSES, _SHARE = 60, 0.7  # at which twists are compared, and how far out
_OUTSIDE = 1e-6  # share of a combination outside some others that does not count
_FAMILIAR = 0.1  # of the best number's: a coordinate is held that has as much
_SAME_POINT = 2.0  # how much rather another coordinate of the same point is held


@dataclass(frozen=True)
class Datum:
    """Numbers of the geometry that are held because they only say where frames lie.

    Attributes
    ----------
    names : tuple of str
        The numbers; they keep their present values and are no parameters. Of a platform that does
        not turn they may be coordinates of a target.
    points : tuple of (str, str)
        Role and name of points whose coordinates are among them.
    base, platform, between : int
        How many say where the base frame lies, where the platform frame lies, and how frames
        between joints are drawn; the rest says where both frames lie at once.

    Examples
    --------
    >>> print(Datum(("base1.x", "base2.x"), base=2))
    datum: 2 numbers only say where frames lie and are held (2 for the base frame): base1.x, base2.x
    """

    names: tuple[str, ...] = ()
    base: int = 0
    platform: int = 0
    between: int = 0
    points: tuple[tuple[str, str], ...] = ()

    def asked(self, asked: Asked) -> Asked:
        """Return the question of this calibration with these numbers held."""
        of_points = tuple(f"{role}{name}." for role, name in self.points)
        fix = tuple(name for name in self.names if not name.startswith(of_points))
        return replace(asked, fix=(*asked.fix, *fix), held_points=frozenset(self.points))

    def __str__(self) -> str:
        parts = [
            (self.base, "for the base frame"),
            (self.platform, "for the platform frame"),
            (self.between, "for frames between joints"),
            (len(self.names) - self.base - self.platform - self.between, "for both frames at once"),
        ]
        shares = ", ".join(f"{count} {what}" for count, what in parts if count)
        return (
            f"datum: {len(self.names)} numbers only say where frames lie and are held ({shares}):"
            f" {listed(self.names)}"
        )


NO_DATUM = Datum()


def datum(estimator: Estimator, estimate: Estimate) -> Datum:
    """Choose the numbers to hold, of a calibration that has held none.

    A number with a prior or bounds is not held.
    """
    chosen = estimator.equations.parameters
    open_ones = estimate.state.determined.unidentifiable
    of_geometry = _basis(open_ones[chosen.geometry])
    # they are those of the nominal machine or of the identified one
    at_either = [_Frames(chosen, found) for found in (estimator.start, estimate.evaluation)]
    frames = max(at_either, key=lambda each: _inside(of_geometry, each.all).shape[1])
    free = _inside(of_geometry, frames.all)
    stated = np.isfinite(chosen.prior) | np.isfinite(chosen.lower) | np.isfinite(chosen.upper)
    stated |= np.array(["@" in name for name in chosen.names])  # of one session alone
    names = chosen.names[chosen.geometry]
    held = _held(free, names, ~stated[chosen.geometry])
    between = _inside(free, frames.between).shape[1]
    base, platform = _inside(free, frames.base), _inside(free, frames.platform)
    either = _basis(np.hstack([base, platform])).shape[1]
    points = _held_points(chosen, open_ones, stated)
    axes = [f"{role}{name}.{axis}" for role, name in points for axis in "xyz"]
    return Datum(
        (*(names[i] for i in sorted(held)), *axes),
        base.shape[1] - between,
        either - base.shape[1] + len(axes),
        between,
        tuple(points),
    )


def _held_points(
    chosen: Parameters, open_ones: FloatArray, stated: BoolArray
) -> list[tuple[str, str]]:
    """Points on a platform that does not turn, which shift with the frame alone."""
    _, singular, rows = np.linalg.svd(open_ones[chosen.geometry])
    rank = int(np.count_nonzero(singular > _OUTSIDE))
    rest: FloatArray = open_ones @ rows[rank:].T  # without any number of the geometry
    held = []
    for point, first in chosen.nuisance.items():
        if not chosen.natures.get(point, PLAIN).point_of:
            continue
        mine = np.flatnonzero(np.isin(chosen.number_of, np.arange(first, first + 3)))
        if len(mine) != 3 or stated[mine].any():  # or there is one in each session
            continue
        _, singular, rows = np.linalg.svd(rest[mine])
        if np.count_nonzero(singular > _OUTSIDE) == 3:
            held.append(point)
            rest = rest @ rows[3:].T
    return held


class _Frames:
    """Changes of the free geometry, scaled, that only move frames; orthonormal columns."""

    def __init__(self, chosen: Parameters, evaluation: Evaluation) -> None:
        robot = evaluation.robot
        poses, actuators = _over_the_workspace(evaluation)
        twists = robot.error_twists(poses, actuators)[:, :, chosen.places]
        # a number that is found in each session changes in all of them alike
        number = chosen.number_of[chosen.geometry]
        of_number = np.zeros(len(chosen.places))
        of_number[number] = chosen.scale[chosen.geometry]
        twists = twists * of_number
        motions = from_pose(poses)
        by_base, by_platform = np.zeros((2, len(poses), 6, 6))
        turns = np.tile(np.eye(3), (len(poses), 1, 1))
        by_base[:, :3, :3], by_base[:, 3:, 3:] = turns, turns
        by_base[:, 3:, :3] = np.cross(turns, motions[:, None, :3, 3]).transpose(0, 2, 1)
        by_platform[:, :3, :3] = by_platform[:, 3:, 3:] = motions[:, :3, :3]
        self.between = _basis(_still(twists, robot.length)[number])
        self.base = _basis(_still(twists, robot.length, by_base)[number])
        self.platform = _basis(_still(twists, robot.length, by_platform)[number])
        self.all = _basis(_still(twists, robot.length, by_base, by_platform)[number])


def _over_the_workspace(evaluation: Evaluation) -> tuple[FloatArray, FloatArray]:
    """Poses (N, 6) and actuator coordinates (N, n) out to most of the workspace."""
    robot = evaluation.robot
    if (parallel := as_parallel(robot)) is not None:
        try:
            places: FloatArray = sample_poses(parallel, _POSES, share=_SHARE)
        except ValueError:  # no workspace about home: where it was measured
            solved = evaluation.status == 0
            return evaluation.pose[solved], evaluation.actuators[solved]
    else:
        drawn = np.random.default_rng(0).uniform(-1.0, 1.0, (_POSES, robot.n_actuators))
        angle = np.array([unit == "rad" for unit in robot.actuator_units])
        places = drawn * np.where(angle, np.pi, robot.length)
    poses, actuators, _ = robot.commanded(places)
    return poses, actuators


def _still(twists: FloatArray, length: float, *frames: FloatArray) -> FloatArray:
    """Changes (p, d) of the numbers whose twists (N, 6, p) motions of the frames undo."""
    p = twists.shape[2]
    rows = np.concatenate([twists, *frames], axis=2)
    rows = rows[np.isfinite(rows).all(axis=(1, 2))]
    rows[:, :3] *= length
    rows[:, :, p:] /= np.tile([length] * 3 + [1.0] * 3, len(frames))
    singular, directions = decompose(rows.reshape(rows.shape[0] * 6, rows.shape[2]))
    still: FloatArray = directions[:p, singular <= ROUNDING * singular.max(initial=0.0)]
    return still


def _basis(columns: FloatArray) -> FloatArray:
    """Return orthonormal columns that span what the columns of a matrix span."""
    left, singular, _ = svd(columns)
    basis: FloatArray = left[:, singular > _OUTSIDE]
    return basis


def _inside(own: FloatArray, space: FloatArray) -> FloatArray:
    """Orthonormal basis of what of one space lies in another; both by orthonormal columns."""
    _, singular, rows = svd(own - space @ (space.T @ own))
    inside: FloatArray = own @ rows[singular < _OUTSIDE].T
    return inside


def _held(free: FloatArray, names: tuple[str, ...], allowed: BoolArray) -> list[int]:
    """Numbers, as many as columns, without which none of the combinations (p, d) can be.

    Coordinates of joints before other numbers and further coordinates of one joint before those of
    another, as in 3-2-1, where they do not determine the frames much worse.
    """
    point = np.array([name.rpartition(".")[0] for name in names])
    familiar = np.array([name[-2:] in (".x", ".y", ".z") for name in names])
    rest, held = free * allowed[:, None], list[int]()
    for _ in range(free.shape[1]):
        sizes = np.linalg.norm(rest, axis=1)
        best = float(sizes.max())
        if not best > _OUTSIDE:
            break  # what a prior or a bound says must not be held
        wanted = np.where(familiar & (sizes > _FAMILIAR * best), 1.0 / _FAMILIAR, 1.0)
        wanted[np.isin(point, point[held])] *= _SAME_POINT
        wanted *= sizes
        held.append(first_largest(wanted, ALIKE * float(wanted.max())))
        along = rest[held[-1]] / sizes[held[-1]]
        rest = rest - np.outer(rest @ along, along)
    return held
