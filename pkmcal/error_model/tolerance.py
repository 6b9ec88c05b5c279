"""Pose error of machines whose geometry has random errors: Monte Carlo, linear, worst case."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pkmcal import display
from pkmcal.arguments import checked_seed, number, whole
from pkmcal.arrays import TIED, FloatArray, IntArray, as_numbers, largest_first, rms
from pkmcal.core.library import POSE
from pkmcal.core.statistics import pose_errors
from pkmcal.display import Table
from pkmcal.error_model.monte_carlo import Draw, simulate
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.elastic import is_kinematic
from pkmcal.kinematics.perturbed import Geometries, Ideal, forward_of, ideal
from pkmcal.kinematics.robot import Robot, require_parallel
from pkmcal.progress import Progress
from pkmcal.result import Result

WORST = 3.0  # standard deviations by which every number is off in the worst case
SHARES = {"interval95": (0.025, 0.975), "interval997": (0.0015, 0.9985)}
_NONE = 1e-12  # of the largest effect on a position or an orientation: no effect
_LISTED = 12  # numbers of the geometry that are printed

Sigma = float | Mapping[str, float] | ArrayLike


@dataclass(frozen=True, eq=False, repr=False)
class Tolerance(Result):
    """Spread of the pose error, for poses of any leading shape; mm and rad.

    Attributes
    ----------
    robot : Robot
        The machine without errors.
    names : tuple of str, k
        Numbers that have errors.
    sigma : ndarray (k,)
        Their standard deviations, mm and rad.
    samples, seed : int
        How many machines were drawn, and from which seed.
    poses : ndarray (..., 6)
        Ideal poses.
    mean, std : ndarray (..., 6)
        Of the pose error (eq. 16) of the machines, solved exactly: of those `samples` - `n_failed`
        that have a pose.
    interval95, interval997 : ndarray (..., 6, 2)
        Between these lie 95 % and 99.7 % of the machines, as many below as above. A machine
        without a pose lies beyond every limit: where too many have none, the ends are infinite.
    distance_rms, distance95, distance997 : ndarray (...)
        Root mean square distance of the position from the ideal one, of the machines that have a
        pose, and what 95 % and 99.7 % of all machines do not exceed; inf where too many have none.
    linear_std : ndarray (..., 6)
        Standard deviation by linear propagation, J Σ Jᵀ.
    worst_case : ndarray (..., 6)
        With every number off by three standard deviations, to the side that is worst by linear
        propagation, or all to the other side: the larger error of the two machines, solved
        exactly; inf where one has no pose. No bound: where the error is far from linear, another
        combination may be worse.
    contribution : ndarray (..., 6, k)
        Share of each number in the linear variance, percent; 0 where there is no variance.
    failed : ndarray of int (...)
        `n_failed` under its key in JSON.
    """

    robot: Robot
    names: tuple[str, ...]
    sigma: FloatArray
    samples: int
    seed: int
    poses: FloatArray
    mean: FloatArray
    std: FloatArray
    interval95: FloatArray
    interval997: FloatArray
    distance_rms: FloatArray
    distance95: FloatArray
    distance997: FloatArray
    linear_std: FloatArray
    worst_case: FloatArray
    contribution: FloatArray
    failed: IntArray

    @property
    def n_failed(self) -> IntArray:
        """Number of machines without a pose there, (...)."""
        return self.failed

    @property
    def position_share(self) -> FloatArray:
        """Share of each number in the variance of the position, over all poses, percent (k,)."""
        variance = (self.linear_std[..., :3, None] ** 2 * self.contribution[..., :3, :]).reshape(
            -1, 3, len(self.names)
        )
        total = variance[np.isfinite(variance).all(axis=(1, 2))].sum(axis=(0, 1))
        share: FloatArray = 100 * total / total.sum() if total.any() else total
        return share

    def failures(self) -> str:
        """Say how many machines have no pose; empty where all have one."""
        failed, count = int(np.sum(self.n_failed)), self.poses.size // 6
        if not failed:
            return ""
        where = "" if count == 1 else f" at {count} poses"
        return (
            f"{failed} of {self.samples * count} machines{where} have no pose: mean, std and rms"
            " are of the others; intervals count them as beyond every limit"
        )

    def _parts(self) -> Iterator[str | Table]:
        count = self.poses.size // 6
        over = "" if count == 1 else f", root mean square over {count} poses"
        yield (
            f"{self.robot.name}: errors of {len(self.names)} numbers, {self.samples} machines"
            f" (seed {self.seed}){over}"
        )
        columns = [
            *(self.mean, self.std, self.linear_std),
            *((ends[..., 1] - ends[..., 0]) / 2 for ends in (self.interval95, self.interval997)),
            self.worst_case,
        ]
        rows = []
        for i, name in enumerate(POSE):
            factor, unit = (1.0, "mm") if i < 3 else (180 / np.pi, "deg")
            rows.append([f"{name} [{unit}]", *(_shown(v[..., i] * factor) for v in columns)])
        heading = ["mean", "std", "linear", "95 % ±", "99.7 % ±", f"worst, {WORST:g} sigma"]
        yield Table(["error", *heading], rows, left=1)
        distance = (self.distance_rms, self.distance95, self.distance997)
        typical, most95, most997 = (_shown(v) for v in distance)
        within95, within997 = (
            "no limit" if most == "inf" else f"{most} mm" for most in (most95, most997)
        )
        yield (
            f"distance: {typical} mm rms; 95 % of the machines within {within95}, 99.7 % within"
            f" {within997}\n"
        )
        share = self.position_share
        order = largest_first(share, TIED)[:_LISTED]
        listed = [[*self._with_unit(k), display.fixed(float(share[k]), 1)] for k in order]
        yield Table(["number", "sigma", "share of position [%]"], listed, left=1)
        if self.failures():
            yield self.failures()

    def _with_unit(self, k: int) -> tuple[str, str]:
        geometry = self.robot.geometry
        unit = geometry.units[geometry.names.index(self.names[k])]
        value, shown = display.displayed(float(self.sigma[k]), unit)
        return f"{self.names[k]} [{shown}]", f"{value:.4g}"


def _shown(values: FloatArray) -> str:
    """Show one value as it is, several by their root mean square; poses that are NaN left out."""
    good = values[~np.isnan(values)]
    if not good.size:
        return "nan"
    return display.fixed(float(good[0]) if values.size == 1 else rms(good), 4)


def tolerance(
    robot: Robot,
    poses: ArrayLike,
    sigma: Sigma,
    *,
    samples: int = 100_000,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Tolerance:
    """Predict the pose error of machines whose geometry has random errors.

    Every error is normally distributed about 0 and independent of the others; one machine has the
    same errors at all poses. Poses are found by the exact kinematics at the ideal actuator
    coordinates.

    Parameters
    ----------
    robot : Robot
        The machine without errors.
    poses : array_like (..., 6)
        Where it is commanded, mm and rad: some poses or a grid over the workspace. A pose that its
        closures do not allow is completed (`Robot.complete`).
    sigma : float, mapping or array (p,)
        Standard deviations. A number is in mm and for every length that can be replaced; a mapping
        goes by name or wildcard, mm and rad, where a later entry overrides an earlier one; an array
        is in the order of ``geometry.names``, 0 for tied numbers.
    samples : int
        Machines to draw.
    seed : int
        Of the draws.
    executor : concurrent.futures.Executor, optional
        Whose workers solve: threads, processes, Dask, MPI. The numbers are the same bits with any
        of them and without.
    progress : callable, optional
        Called with the poses solved so far and those there are, all machines counted.

    Returns
    -------
    Tolerance
        A pose that does not exist is NaN.

    Raises
    ------
    ValueError, TypeError
        An unknown or tied name, a sigma that is negative or not finite, no sigma above 0, fewer
        than two samples, a wrong shape.

    Notes
    -----
    A machine that has no pose is further off than any limit, and counts so in the intervals and in
    what 95 % and 99.7 % of the machines do not exceed.

    Memory does not grow with `samples`: the moments are combined chunk by chunk, and the intervals
    come from counts in 2048 bins over ±8 standard deviations, which places their ends to less than
    1/128 of a standard deviation; drawing 100 000 machines places that of 99.7 % to 1/40.

    Examples
    --------
    >>> import pkmcal as pk
    >>> robot = pk.load("2tpr2tps")
    >>> found = pk.tolerance(robot, robot.home, {"offset*": 0.1}, samples=10_000)
    >>> bool((abs(found.std - found.linear_std) <= 0.03 * found.linear_std).all())
    True
    """
    require_parallel(robot)
    seed = checked_seed(seed)
    places, deviations = sigma_of(robot, sigma)
    whole("samples", samples, 2)
    at = ideal(robot, poses)
    effect = robot.error_jacobian(at.poses, at.actuators)[:, :, places] * deviations
    variance = effect**2
    total = variance.sum(axis=-1, keepdims=True)
    share = np.divide(100 * variance, total, out=np.zeros_like(variance), where=total != 0)
    root = np.random.SeedSequence(seed)
    draw = Draw(robot.model, places, deviations, at.poses, at.actuators, root, int(samples))
    columns: list[list[FloatArray | float]] = []
    for stream in simulate(draw, executor, progress):
        ends = {name: [stream.quantile(p, 0.5) for p in pair] for name, pair in SHARES.items()}
        columns.append([
            stream.mean[:6],
            stream.std[:6],
            *(np.stack([low[:6], high[:6]], axis=-1) for low, high in ends.values()),
            np.sqrt(stream.mean_square[6]),
            stream.quantile(0.95)[6],
            stream.quantile(0.997)[6],
            stream.n_failed,
        ])  # fmt: skip
    unsolved = np.isnan(at.poses).any(axis=1)
    for k in np.flatnonzero(unsolved).tolist():  # no pose to be far from
        columns[k][:-1] = [np.full_like(column, np.nan) for column in columns[k][:-1]]
    mean, std, within95, within997, distance_rms, far95, far997, failed = (
        np.array(column).reshape((*at.shape, *np.shape(column[0])))
        for column in zip(*columns, strict=True)
    )
    return Tolerance(
        robot,
        tuple(robot.geometry.names[place] for place in places),
        deviations,
        int(samples),
        seed,
        at.poses.reshape(*at.shape, 6),
        mean,
        std,
        within95,
        within997,
        distance_rms,
        far95,
        far997,
        np.sqrt(total[..., 0]).reshape(*at.shape, 6),
        _worst_case(robot, at, places, effect, deviations).reshape(*at.shape, 6),
        share.reshape(*at.shape, 6, len(places)),
        failed.astype(np.intp),
    )


def _worst_case(
    robot: Robot, at: Ideal, places: IntArray, effect: FloatArray, deviations: FloatArray
) -> FloatArray:
    """Largest error (N, 6) of the two machines that are worst by the linear `effect` (N, 6, k)."""
    size = np.abs(effect).reshape(-1, 2, 3, len(places))
    felt = (size > _NONE * size.max(axis=(2, 3), keepdims=True)).reshape(effect.shape)
    sides = np.where(felt, np.sign(effect), 0.0)
    geometries = Geometries(robot.geometry, places, 12)
    found = np.full((len(effect), 6), np.nan)
    for row in np.flatnonzero(np.isfinite(effect).all(axis=(1, 2))).tolist():
        errors = WORST * deviations * np.vstack([sides[row], -sides[row]])
        slots, pose = geometries.with_errors(errors), at.poses[row]
        (there,) = forward_of(robot, slots, at.actuators[row : row + 1], pose[None])
        moved = pose_errors(there, pose)[:6]
        two = np.abs(np.stack([moved[:, :6].diagonal(), moved[:, 6:].diagonal()]))
        found[row] = np.where(np.isnan(two), np.inf, two).max(axis=0)
    return found


def sigma_of(robot: Robot, sigma: Sigma) -> tuple[IntArray, FloatArray]:
    """Find the places in ``geometry.names`` that have errors, and their standard deviations.

    Raises
    ------
    ValueError, TypeError
        See `tolerance`.
    """
    geometry = robot.geometry
    units = np.array(geometry.units)
    found = np.zeros(len(geometry))
    if isinstance(sigma, Mapping):
        for pattern, given in sigma.items():
            matched = [geometry.names.index(name) for name in geometry.match(pattern, "sigma")]
            covered = sorted({geometry.units[place] for place in matched})
            if len(covered) > 1:
                raise ArgumentError(
                    f"sigma: {pattern!r} covers numbers in {' and '.join(covered)}; name them apart"
                )
            found[matched] = _deviations(f"sigma of {pattern}", given, ())
    elif as_numbers("sigma", sigma, len(geometry)).ndim == 0:
        kinematic = np.array([is_kinematic(name) for name in geometry.names])
        lengths = ~geometry.tied & (units == "mm") & kinematic
        if not lengths.any():
            raise ArgumentError(
                f"sigma: one number is for lengths, and {robot.name} has none of its own; name"
                " angles in a mapping, rad"
            )
        found[lengths] = _deviations("sigma", sigma, ())
    else:
        found[:] = _deviations("sigma", sigma, (len(geometry),))
        if found[geometry.tied].any():
            geometry.require_own(geometry.names[int(np.flatnonzero(found * geometry.tied)[0])])
    places = np.flatnonzero(found)
    if not len(places):
        raise ArgumentError("sigma must be above 0 for some number of the geometry, found none")
    return places, found[places]


def _deviations(name: str, given: ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    if shape == ():
        return np.array(number(name, given, least=0))
    array = as_numbers(name, given, "p")
    if array.shape != shape:
        raise ArgumentError(f"{name} must have shape {shape}, found {array.shape}")
    if not (np.isfinite(array) & (array >= 0)).all():
        worst = array[~(np.isfinite(array) & (array >= 0))].flat[0]
        raise ArgumentError(f"{name} must be finite and not negative, found {worst}")
    return array.astype(np.float64)
