"""Tolerance of each joint that keeps the pose error below a limit.

Linear propagation shares the limit out among the joints; all shares are then scaled together until
the exact machines keep it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import checked_seed, did_you_mean, flag, number, whole, words
from pkmcal.arrays import TIED, FloatArray, first_largest
from pkmcal.core.library import POSE
from pkmcal.display import Table, displayed
from pkmcal.error_model import shares
from pkmcal.error_model.monte_carlo import QUANTITIES, Draw, farthest
from pkmcal.error_model.tolerance import Tolerance, tolerance
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.elastic import is_kinematic
from pkmcal.kinematics.perturbed import Ideal, ideal
from pkmcal.kinematics.robot import Robot, require_parallel
from pkmcal.result import Result

DISTANCE = "distance"
_SHARE = 0.997  # of the machines
_TAIL = 3.0  # standard deviations: about this share of the machines is within
_SURE = 1.645  # standard deviations: so that 99.7 % keep the limits with 95 % confidence
_ROUNDS, _SCALED = 5, 1e-3  # of scaling: at most so many, until one changes less
_JOINT = re.compile(r"([a-z_]+[0-9]+)\.[xyz]")  # base1.x belongs to base1.*

Allowed = float | Mapping[str, float]


@dataclass(frozen=True, eq=False, repr=False)
class Allocation(Result):
    """Tolerances by joint, and what they lead to.

    Attributes
    ----------
    joints : tuple of str, g
        Each stands for the numbers that it matches.
    sigma : ndarray (g,)
        Standard deviation that each of its numbers may have, mm or rad; inf where they have no
        effect on what is limited.
    cost : ndarray (g,) or None
        Weights of what each joint costs; None for equal contributions.
    allowed : mapping of str to float
        Limits of the distance of the position and of coordinates, mm and rad.
    per_pose : bool
        Whether the limits hold at each pose by itself, or for a machine at all poses together.
    reached : mapping of str to float
        What 99.7 % of the machines do not exceed at any pose (`per_pose`: at the worst pose), limit
        by limit, by Monte Carlo with draws of its own.
    kept : float
        Share of these machines that keep all limits at all poses, percent.
    contribution : ndarray (g,)
        Share of each joint in the linear variance of what is limited, where it is tightest,
        percent.
    check : Tolerance
        The Monte Carlo behind `reached`.
    """

    joints: tuple[str, ...]
    sigma: FloatArray
    cost: FloatArray | None
    allowed: Mapping[str, float]
    per_pose: bool
    reached: Mapping[str, float]
    kept: float
    contribution: FloatArray
    check: Tolerance

    def _parts(self) -> Iterator[str | Table]:
        geometry = self.check.robot.geometry
        how = "equal contributions" if self.cost is None else "least cost"
        yield f"{self.check.robot.name}: tolerances by {how}, {self.check.poses.size // 6} poses"
        rows = []
        for joint, sigma, share in zip(self.joints, self.sigma, self.contribution, strict=True):
            first = geometry.names.index(geometry.match(joint)[0])
            value, unit = displayed(float(sigma), geometry.units[first])
            rows.append([f"{joint} [{unit}]", f"{value:.4g}", f"{share:.1f}"])
        yield Table(["joint", "sigma", "share [%]"], rows, left=1)
        where = "at the worst pose" if self.per_pose else "at all poses"
        for name, limit in self.allowed.items():
            quantity = "rad" if name in POSE[3:] else "mm"
            most, shown = displayed(limit, quantity)
            reached, _ = displayed(self.reached[name], quantity)
            yield (
                f"{name}: {most:.4g} {shown} allowed; 99.7 % of {self.check.samples} machines stay"
                f" within {reached:.4g} {shown} {where}"
            )
        every = "all limits" if len(self.allowed) > 1 else "the limit"
        yield f"{self.kept:.2f} % of these machines keep {every} at all poses"


def allocate_tolerance(
    robot: Robot,
    poses: ArrayLike,
    allowed: Allowed,
    *,
    joints: str | Sequence[str] | None = None,
    cost: float | Mapping[str, float] | None = None,
    per_pose: bool = False,
    samples: int = 100_000,
    seed: int = 0,
    executor: Executor | None = None,
) -> Allocation:
    """Share an allowed pose error out among the joints.

    Parameters
    ----------
    robot : Robot
        The machine without errors.
    poses : array_like (..., 6)
        Where the error is limited, mm and rad; see `tolerance`.
    allowed : float or mapping
        What 99.7 % of the machines must not exceed: a number is the distance of the position, mm;
        a mapping limits ``"distance"`` and coordinates ``"x"`` … ``"gamma"``, mm and rad. A machine
        counts among the 99.7 % if it keeps all limits at all poses; one without a pose does not.
    joints : str or sequence of str, optional
        Names or wildcards; all numbers that one matches get the same sigma. By default every joint
        and every other length: ``base1.*``, ``platform1.*``, ``offset1`` …
    cost : float or mapping, optional
        None gives every joint the same share of the variance. Otherwise the sum of cost/sigma over
        all numbers is made least: a tolerance half as wide costs twice as much; weights by joint,
        1 for those not named.
    per_pose : bool
        True: 99.7 % of the machines must keep each limit at each pose by itself, though not always
        the same ones; then fewer than 99.7 % keep all of them everywhere.
    samples, seed, executor
        Of the Monte Carlo simulations; see `tolerance`.

    Returns
    -------
    Allocation
        ``.sigma`` and the check of it.

    Raises
    ------
    ValueError, TypeError
        No limit above 0, one so wide that machines with such errors have no pose, an unknown or
        tied name, no name at all, a number named by two joints, a cost that is not above 0.

    Notes
    -----
    The shares come from linear propagation. Then all sigmas are scaled together until the exact
    machines, drawn from `seed`, keep the limits as widely as they may with 95 % confidence: of
    100 000 drawn, 271 break them rather than 300, for drawing varies that by 17. (With `per_pose`
    300 do, at the worst pose.) The check draws others, from `seed` + 1.

    Examples
    --------
    >>> import pkmcal as pk
    >>> robot = pk.load("2tpr2tps")
    >>> found = pk.allocate_tolerance(
    ...     robot, robot.home, 0.5, joints=["base*", "platform*", "offset*"]
    ... )
    >>> found.contribution.round(1)
    array([33.3, 33.3, 33.3])
    """
    require_parallel(robot)
    limits = _limits(allowed)
    groups = _groups(robot, joints)
    weights = None if cost is None else _weights(cost, groups)
    at = ideal(robot, poses)
    if not np.isfinite(at.poses).all():
        row = int(np.flatnonzero(~np.isfinite(at.poses).all(axis=1))[0])
        raise ArgumentError(f"poses: the machine cannot take row {row}")
    jacobian = robot.error_jacobian(at.poses, at.actuators)
    variance = np.stack(
        [(jacobian[:, :, places] ** 2).sum(axis=-1) for places in groups.values()], axis=-1
    )
    use = np.concatenate([_used(variance, name) / limit**2 for name, limit in limits.items()])
    if not use.any():
        raise ArgumentError(
            f"allowed: none of {', '.join(groups)} has an effect on {', '.join(limits)}"
        )
    felt = use.max(axis=0) > 1e-18 * use.max()
    sigma = np.full(len(groups), np.inf)
    sigma[felt] = (
        shares.equal(use[:, felt])
        if weights is None
        else shares.cheapest(use[:, felt], (weights * [len(p) for p in groups.values()])[felt])
    )
    flag("per_pose", per_pose)
    trial = _Trial(robot, at, groups, limits, samples, executor)
    sigma /= _TAIL
    for _ in range(_ROUNDS):
        if per_pose:
            used = max(trial.apart(trial.tolerance(sigma, seed)).values())
        else:
            used = _within(trial.together(sigma, seed).max(axis=0), _SURE)
        sigma /= used
        if abs(used - 1) <= _SCALED:
            break
    check, together = trial.tolerance(sigma, seed + 1), trial.together(sigma, seed + 1)
    if per_pose:
        used_up = trial.apart(check)
    else:
        used_up = {name: _within(row) for name, row in zip(limits, together, strict=True)}
    spent = use[:, felt] * sigma[felt] ** 2
    total = spent.sum(axis=1)
    tightest = spent[first_largest(total, TIED * float(total.max()))]
    contribution = np.zeros(len(groups))
    contribution[felt] = 100 * tightest / tightest.sum()
    return Allocation(
        tuple(groups),
        sigma,
        weights,
        limits,
        per_pose,
        {name: used_up[name] * limit for name, limit in limits.items()},
        100 * float((together <= 1).all(axis=0).mean()),
        contribution,
        check,
    )


def _used(variance: FloatArray, name: str) -> FloatArray:
    """Return what one mm² or rad² of each joint adds to the variance that is limited, (N, g)."""
    if name == DISTANCE:
        total: FloatArray = variance[:, :3].sum(axis=1)
        return total
    return variance[:, POSE.index(name)]


@dataclass(frozen=True, eq=False)
class _Trial:
    """Machines with errors, and how much of the limits they use up: 1 is all of it."""

    robot: Robot
    at: Ideal
    groups: Mapping[str, list[int]]
    limits: Mapping[str, float]
    samples: int
    executor: Executor | None

    def tolerance(self, sigma: FloatArray, seed: int) -> Tolerance:
        return tolerance(
            self.robot,
            self.at.poses,
            self._deviations(sigma),
            samples=self.samples,
            seed=seed,
            executor=self.executor,
        )

    def apart(self, found: Tolerance) -> dict[str, float]:
        """Return for each limit its value at the pose where 99.7 % of the machines use up most."""
        used = {}
        for name, limit in self.limits.items():
            if name == DISTANCE:
                most = found.distance997.max()
            else:
                most = np.abs(found.interval997[..., POSE.index(name), :]).max()
            used[name] = float(most) / limit
        self._refuse(int(found.n_failed.max()), *used.values())
        return used

    def together(self, sigma: FloatArray, seed: int) -> FloatArray:
        """Return for each limit each machine's value at its worst pose, (limits, samples)."""
        deviations = self._deviations(sigma)
        places = np.flatnonzero(deviations)
        root = np.random.SeedSequence(checked_seed(seed))
        largest = farthest(
            Draw(
                self.robot.model,
                places,
                deviations[places],
                self.at.poses,
                self.at.actuators,
                root,
                whole("samples", self.samples, 2),
            ),
            self.executor,
        )
        rows = [QUANTITIES.index(name) for name in self.limits]
        used: FloatArray = largest[rows] / np.array([list(self.limits.values())]).T
        self._refuse(int(np.isinf(used).any(axis=0).sum()), _within(used.max(axis=0)))
        return used

    def _deviations(self, sigma: FloatArray) -> FloatArray:
        deviations = np.zeros(len(self.robot.geometry))
        for places, each in zip(self.groups.values(), sigma, strict=True):
            deviations[places] = each if np.isfinite(each) else 0.0
        return deviations

    def _refuse(self, unsolved: int, *used: float) -> None:
        if not np.isfinite(used).all():
            raise ArgumentError(
                f"allowed: errors that use it up leave {unsolved} of {self.samples} machines"
                " without a pose; allow less"
            )


def _within(values: FloatArray, margin: float = 0.0) -> float:
    """Return the value that 99.7 % do not exceed, plus so many deviations of drawing."""
    drawing = np.sqrt(_SHARE * (1 - _SHARE) / len(values))
    return float(np.quantile(values, min(_SHARE + margin * drawing, 1.0), method="inverted_cdf"))


def _limits(allowed: Allowed) -> dict[str, float]:
    given = allowed if isinstance(allowed, Mapping) else {DISTANCE: allowed}
    known = (DISTANCE, *POSE)
    for name, limit in given.items():
        if name not in known:
            raise ArgumentError(
                f"allowed: {name!r} is no error of a pose{did_you_mean(name, known)}"
            )
        number(f"allowed {name}", limit, above=0)
    if not given:
        raise ArgumentError("allowed must limit something, found nothing")
    return {name: float(limit) for name, limit in given.items()}


def _groups(robot: Robot, joints: str | Sequence[str] | None) -> dict[str, list[int]]:
    """Places in ``geometry.names`` of the numbers of each joint."""
    geometry = robot.geometry
    if joints is None:
        lengths = [
            name
            for name, unit, tied in zip(geometry.names, geometry.units, geometry.tied, strict=True)
            if unit == "mm" and not tied and is_kinematic(name)
        ]
        if not lengths:
            raise ArgumentError(
                f"joints: by default they are those with lengths, and {robot.name} has none of its"
                " own; name angles"
            )
        joints = list(dict.fromkeys(_JOINT.sub(r"\1.*", name) for name in lengths))
    groups: dict[str, list[int]] = {}
    owner: dict[str, str] = {}
    joints = words("joints", joints)
    if not joints:
        raise ArgumentError("joints: name at least one")
    for joint in joints:
        names = geometry.match(joint, "joints")
        places = [geometry.names.index(name) for name in names]
        covered = sorted({geometry.units[place] for place in places})
        if len(covered) > 1:
            raise ArgumentError(
                f"joints: {joint!r} covers numbers in {' and '.join(covered)}; name them apart"
            )
        for name in names:
            if name in owner:
                raise ArgumentError(f"joints: {name} is named by {owner[name]!r} and {joint!r}")
            owner[name] = joint
        groups[joint] = places
    return groups


def _weights(cost: float | Mapping[str, float], groups: Mapping[str, list[int]]) -> FloatArray:
    given = cost if isinstance(cost, Mapping) else dict.fromkeys(groups, cost)
    for name, weight in given.items():
        if name not in groups:
            raise ArgumentError(f"cost: {name!r} is none of the joints{did_you_mean(name, groups)}")
        number(f"cost of {name}", weight, above=0)
    return np.array([float(given.get(name, 1.0)) for name in groups])
