"""Equations of points that were held out, beside what noise and covariance let expect of them.

Lengths and angles are families of their own: each is compared with the noise that its own fitted
residuals show, so that neither hides behind the other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray, mm_per_unit
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.row_blocks import RowBlocks
from pkmcal.estimation.solving import FEW
from pkmcal.estimation.uncertainty import Uncertainty, stated_variances
from pkmcal.fitted.held_numbers import considered_errors
from pkmcal.fitted.later import Later, OwnNumbers
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.measurements.measurements import Measurements
from pkmcal.readings.components import Family
from pkmcal.statistics.distributions import f_tail
from pkmcal.statistics.holdout_test import RATIO, HoldoutTest, Lengths, holdout_test
from pkmcal.statistics.linear_fit import met_exactly, numbered
from pkmcal.statistics.noise import Noise, noise

_NOTHING = 1e-6  # share of a variance below which nothing is left of a reading
_HUGE = 1e300
_ODD = 0.005  # chance of naming any held-out row that is as far off as expected


@dataclass(frozen=True, kw_only=True)
class HeldFamily:
    """Components of one unit of the points held out.

    Attributes
    ----------
    family : Family
        Which.
    rms, expected, rms_without_outliers : float
        Root mean square of a point in that unit: as it is, as noise and covariance let expect, and
        without the points that are off.
    test : HoldoutTest or None
        Whether they contradict the fit; None where their noise is not known.
    """

    family: Family
    rms: float
    expected: float
    rms_without_outliers: float
    test: HoldoutTest | None

    @property
    def contradicts(self) -> bool:
        """True if held-out points contradict the fit, the few that are far off included."""
        return self.test is not None and self.test.contradicts

    @property
    def agrees_otherwise(self) -> bool:
        """True if the points that are not off are as expected."""
        return self.rms_without_outliers <= RATIO * self.expected


@dataclass(frozen=True, eq=False)
class Points:
    """Equations (M,) of the points held out, in mm; angles as their arcs.

    Residuals and design, what considered numbers make of them, the variance of a reading and of
    what actuators add to it in mm² and by which of them (M, n), the square roots of the parts with
    their signs, the share of each that numbers of its own session took, the
    number of its unit, the fitted set that each is like and the number of its family there, whether
    it is of a component that is met exactly; and the units. Variances are NaN where the fit shows
    none of that family, 0 of what is met exactly.
    """

    residual: FloatArray
    design: FloatArray
    considered: FloatArray
    reading: FloatArray
    by_actuators: FloatArray
    by_actuator: FloatArray
    taken: FloatArray
    unit: IntArray
    like: IntArray
    family: IntArray
    arc: FloatArray
    idle: BoolArray
    units: tuple[str, ...]

    @property
    def own(self) -> FloatArray:
        """Variance of a residual whatever the parameters of the fit are."""
        return (self.reading + self.by_actuators) * (1.0 - self.taken)

    @property
    def known(self) -> BoolArray:
        """Mask of equations of known noise, without those that are met exactly."""
        return np.isfinite(self.reading) & ~self.idle

    def by_fit(self, uncertainty: Uncertainty) -> FloatArray:
        """Variance that the parameters' errors add."""
        added: FloatArray = np.einsum(
            "ij,jk,ik->i", self.design, uncertainty.by_cluster, self.design
        )
        added += (self.considered**2).sum(axis=1)
        return added

    def whole(self, uncertainty: Uncertainty) -> tuple[FloatArray, FloatArray]:
        """Design (M, p + k) of all that makes an error, and the covariance of that."""
        k, matrix = self.considered.shape[1], uncertainty.by_rule
        if not k:
            return self.design, matrix
        covariance = np.eye(len(matrix) + k)
        covariance[: len(matrix), : len(matrix)] = matrix
        return np.hstack([self.design, self.considered]), covariance


def points(
    rows: Later,
    equations: Equations,
    after: Evaluation,
    own: OwnNumbers | None,
    uncertainty: Uncertainty,
) -> Points:
    """The equations at the solution."""
    present, arcs = equations.whitening.present, equations.arcs
    variances, moves, families, per_mm = [], [], [], []
    seen = equations.prediction.predicted(after)
    for i, measured in enumerate(equations.table.sets):
        count, k = after.residuals[i].shape
        family = _families(measured, uncertainty, rows.like[i])
        each = [_variances(measured, uncertainty, rows.like[i], *pair) for pair in family]
        variances.append(np.stack(each, axis=1) if each else np.zeros((count, 0)))
        families.append(np.tile(np.array([there for _, there in family], dtype=np.intp), count))
        per_mm.append(np.tile(arcs[i], count))
        sigma = _of_actuators(measured, after.robot, uncertainty)
        moved = seen[i].by_twist @ after.machines.actuator_twists(
            after.states, equations.table.pose_of[i]
        )
        part = np.zeros((count, k, 0)) if sigma is None else moved * sigma[:, None]
        moves.append((arcs[i][:, None] * part).reshape(count * k, part.shape[2]))
    jacobian = np.concatenate([
        (arc[:, None] * part).reshape(-1, part.shape[2])
        for arc, part in zip(arcs, equations.jacobian(after), strict=True)
    ])[present]  # fmt: skip
    back = uncertainty.fit.back
    by_all = jacobian * equations.parameters.scale
    by_fitted = rows.by_fitted(by_all, len(back))

    def stacked(parts: Sequence[FloatArray]) -> FloatArray:
        return np.concatenate([part.ravel() for part in parts])[present]

    most = max(part.shape[1] for part in moves)
    by_each = np.concatenate([np.pad(p, ((0, 0), (0, most - p.shape[1]))) for p in moves])[present]
    by_sigma, taken, arc = (by_each**2).sum(axis=1), np.zeros(len(by_all)), stacked(per_mm)
    if own is not None:
        by_own = by_all[:, rows.own]
        by_fitted += by_own @ own.follow
        weighted = arc**2 * equations.whitening.variances(own.noise)
        if uncertainty.mixed:
            weighted += by_sigma / uncertainty.excess[0]
        taken = np.clip(((by_own @ own.half) ** 2).sum(axis=1) / weighted, 0.0, 1.0)
    units = tuple(dict.fromkeys(unit for m in equations.table.sets for unit in m.units))
    residual = stacked([a * part for a, part in zip(arcs, after.residuals, strict=True)])
    idle = met_exactly(residual, equations.blocks.component) & bool(uncertainty.idle.any())
    return Points(
        residual=residual,
        design=by_fitted @ back,
        considered=considered_errors(rows, equations, after, uncertainty, by_fitted @ back),
        reading=np.where(idle, 0.0, stacked(variances)),
        by_actuators=by_sigma,
        by_actuator=by_each,
        taken=taken,
        unit=np.concatenate(
            [np.tile([units.index(unit) for unit in m.units], len(m)) for m in equations.table.sets]
        )[present],
        like=np.array(rows.like)[equations.blocks.set_of],
        family=np.concatenate(families)[present],
        arc=arc,
        idle=idle,
        units=units,
    )


def _families(measured: Measurements, uncertainty: Uncertainty, like: int) -> list[tuple[int, int]]:
    """Return each component's family (k,), and that of the fitted set with its noise.

    That of the same unit. Where a reading of one family is compared with a fit that has none of
    its unit the first, as arcs; -1 where nothing is known.
    """
    mine, theirs = (
        m.instrument.families for m in (measured, uncertainty.equations.table.sets[like])
    )
    units = [each.unit for each in theirs]
    other = 0 if len(mine) == 1 and theirs else -1
    there = [units.index(each.unit) if each.unit in units else other for each in mine]
    of = {k: i for i, each in enumerate(mine) for k in each.columns}
    return [(of[k], there[of[k]]) for k in range(len(of))]


def _variances(
    measured: Measurements, uncertainty: Uncertainty, like: int, family: int, there: int
) -> FloatArray:
    """Variance of a component of each row, mm² (N,): that of the fitted set, by sigma if stated."""
    if there < 0:
        return np.full(len(measured), np.nan)
    total = uncertainty.noise_of_moving(like, there)
    own = stated_variances(measured, family)
    fitted = stated_variances(uncertainty.equations.table.sets[like], there)
    if own is None or fitted is None:
        return np.full(len(measured), total)
    return own * total / float(fitted.mean())


def _of_actuators(
    measured: Measurements, robot: Calibratable, uncertainty: Uncertainty
) -> FloatArray | None:
    """Deviations (N, n) of what the actuators of held-out rows read; None where they have none."""
    if not uncertainty.mixed:  # what fitted actuators add is in the noise of the fit
        return None
    sigma = measured.actuator_sigma
    if sigma is None:
        units = mm_per_unit(robot.actuator_units, robot.length)
        sigma = np.tile(uncertainty.factors[-1] / units, (len(measured), 1))
    deviations: FloatArray = sigma * float(np.sqrt(uncertainty.excess[0]))
    return deviations


def odd_rows(points: Points, row: IntArray, count: int, uncertainty: Uncertainty) -> BoolArray:
    """Mark the rows (N,) that are further off than noise and covariance explain.

    The noise is an estimate itself, as good as that of the fitted rows.
    """
    odd = np.zeros(count, dtype=bool)
    whole, covariance = points.whole(uncertainty)
    if not uncertainty.known or not len(row):
        return odd
    freedom = uncertainty.fit.freedom if uncertainty.fit.freedom >= FEW else np.inf
    for _, mine in _each_unit(points):
        freedom = min(freedom, _freedom_of_noise(points, mine, uncertainty))
    together = points.by_actuator * np.sqrt(1.0 - points.taken)[:, None]
    own = _floored(points)
    alone = np.maximum(own - (together**2).sum(axis=1), _NOTHING * own)
    some = np.flatnonzero(points.known)
    order = some[np.argsort(row[some], kind="stable")]
    lengths = np.bincount(row[some], minlength=count)
    first = np.cumsum(lengths) - lengths
    for k in np.unique(lengths[lengths > 0]).tolist():
        alike = np.flatnonzero(lengths == k)
        mine = order[first[alike, None] + np.arange(k)]
        design, residual = whole[mine], points.residual[mine]
        variance = design @ covariance @ design.transpose(0, 2, 1)
        variance += np.eye(k) * alone[mine][:, :, None]
        variance += together[mine] @ together[mine].transpose(0, 2, 1)
        along = np.linalg.solve(variance, residual[:, :, None])[:, :, 0]
        squares = np.nan_to_num((residual * along).sum(axis=1), posinf=_HUGE)
        chances = [f_tail(min(each / k, _HUGE), k, freedom) for each in squares.tolist()]
        odd[alike] = np.array(chances) < _ODD / count
    return odd


def _floored(points: Points) -> FloatArray:
    """`Points.own`, no family's below a trace of its median, or of all where that is nothing.

    Angles of a machine that cannot turn are all 0 in many files, and so is what is left of them.
    """
    own: FloatArray = points.own.copy()
    every = max(float(own[points.known].max(initial=0.0)), np.finfo(np.float64).tiny / _NOTHING)
    for _, mine in _each_unit(points):
        own[mine] = np.maximum(own[mine], _NOTHING * (float(np.median(own[mine])) or every))
    return own


def _each_unit(points: Points) -> Iterator[tuple[str, BoolArray]]:
    for number, unit in enumerate(points.units):
        if (mine := points.known & (points.unit == number)).any():
            yield unit, mine


def families(
    points: Points, blocks: RowBlocks, good: BoolArray, odd: BoolArray, uncertainty: Uncertainty
) -> Iterator[HeldFamily]:
    """Return families of equations (M,) that were reached; `odd` (M,) are of outlying rows."""
    by_fit = points.by_fit(uncertainty)

    def rms(squares: FloatArray, of: BoolArray) -> float:
        if not (count := len(np.unique(blocks.row[of]))):
            return float("nan")
        return float(np.sqrt((squares / points.arc**2)[of].sum() / count))

    several = [(unit, mine) for unit, whole in _each_unit(points) if (mine := whole & good).any()]
    for unit, mine in several:
        test = _test(points, blocks, mine, uncertainty)
        yield HeldFamily(
            family=Family(unit),
            rms=rms(points.residual**2, mine),
            expected=rms(points.own + by_fit, mine),
            rms_without_outliers=rms(points.residual**2, mine & ~odd),
            test=None if test is None else replace(test, of=len(several)),
        )


def _test(
    points: Points, blocks: RowBlocks, good: BoolArray, uncertainty: Uncertainty
) -> HoldoutTest | None:
    """Test one family of the rows that were reached; None where its noise is not known."""
    own = points.own[good]
    if not (own > _NOTHING * np.median(own)).all():
        return None
    fitted, split = _fitted(uncertainty, points.like[good], points.family[good])
    if not split[0] > 0.0:  # as many equations as parameters: all are met exactly
        return None
    unit = np.sqrt(own)
    whole, covariance = points.whole(uncertainty)
    beside = ((0, 0), (0, points.considered.shape[1]))  # no part of the fit
    fitted = replace(fitted, design=np.pad(fitted.design, beside))
    held = Lengths(
        points.residual[good] / unit,
        whole[good] / unit[:, None],
        numbered(blocks.row[good]),
        numbered(blocks.pose[good]),
        blocks.component[good],
    )
    left = np.sqrt(1.0 - points.taken[good]) / unit
    by_actuator = points.by_actuator[good] * left[:, None]
    taken = float(points.taken[good].mean())
    most = _freedom_of_noise(points, good, uncertainty)
    return holdout_test(fitted, held, split, covariance, by_actuator, taken, most)


def _freedom_of_noise(points: Points, good: BoolArray, uncertainty: Uncertainty) -> float:
    """Degrees of freedom of the noise of some equations (M,), of mixtures; else inf.

    Residuals of mixtures are of all groups in part: what they say of one of these is less than
    their number.
    """
    if not uncertainty.mixed:
        return float("inf")
    whitening = uncertainty.equations.whitening
    shares = np.zeros(len(uncertainty.factors))
    for like, family in set(zip(points.like[good], points.family[good], strict=True)):
        mine = good & (points.like == like) & (points.family == family)
        columns = uncertainty.equations.table.sets[like].instrument.families[family].columns
        shares[whitening.groups[like][columns[0]]] += points.reading[mine].sum()
    shares[-1] += points.by_actuators[good].sum()
    return uncertainty.freedom_of_noise(shares / shares.sum())


def _fitted(uncertainty: Uncertainty, sets: IntArray, family: IntArray) -> tuple[Lengths, Noise]:
    """A family each of some fitted sets, in units of its own deviation, and how these split.

    Of mixtures all equations, which are of all families in part.
    """
    sandwich, blocks = uncertainty.covariance.sandwich, uncertainty.blocks
    unit = np.zeros(len(uncertainty.fit.residual))
    if uncertainty.mixed:
        values = sandwich.residual
        unit[:] = np.sqrt((values**2).sum() / sandwich.retained.sum())
    else:
        values = uncertainty.adjusted
        for i, there in sorted(set(zip(sets.tolist(), family.tolist(), strict=True))):
            unit[uncertainty.family_of(i, there)] = np.sqrt(uncertainty.noise_of_moving(i, there))
    mine = (unit > 0) & ~uncertainty.idle
    residual = values[mine] / unit[mine]
    split = noise(residual, sandwich.retained[mine], numbered(uncertainty.fit.key()[mine]))
    lengths = Lengths(
        residual,
        uncertainty.fit.design[mine],
        numbered(blocks.row[mine]),
        numbered(blocks.pose[mine]),
        blocks.component[mine],
    )
    return lengths, split
