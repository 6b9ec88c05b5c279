"""Hold-out: points that are not fitted, only compared with the calibrated machine.

`draw` splits them off before the fit, `evaluate` compares them after it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray, mm_per_unit
from pkmcal.estimation import misfits
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.estimate import Estimate
from pkmcal.estimation.estimator import FEW, LEAST_FREEDOM, Estimator
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.labels import Labels, labels
from pkmcal.estimation.uncertainty import Uncertainty, stated_variances
from pkmcal.fitted.distances import Distances, distances
from pkmcal.fitted.later import Later, OwnNumbers, compared, later
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.measurements.measurements import Measurements
from pkmcal.statistics.distributions import f_tail
from pkmcal.statistics.holdout_test import RATIO, HoldoutTest, Lengths, holdout_test
from pkmcal.statistics.linear_fit import numbered
from pkmcal.statistics.noise import Noise, noise

_LOOSE = 1e-6  # share of a number in combinations that its session's rows do not show
_NOTHING = 1e-6  # share of a variance below which nothing is left of a reading
_HUGE = 1e300
_FEW_ODD = 0.25  # share of held-out points that may be off without the rest being so
_ODD = 0.01  # chance of naming any held-out row that is as far off as expected


@dataclass(frozen=True, eq=False, kw_only=True)
class HeldOut:
    """Errors of the points held out, mm; NaN where there are none.

    Attributes
    ----------
    holdout_rms_before, holdout_rms : float
        Root mean square distances with the start's parameters and with the estimate's.
    holdout_expected : float
        What `holdout_rms` should be if noise and covariance are right; NaN where the noise is not
        known.
    holdout_unreached : str
        Rows that were left out because their forward kinematics failed, in words.
    holdout_off_before, holdout_off : ndarray (N,)
        The distances themselves.
    holdout_rows : ndarray of int (N,)
        Their numbers in what was given.
    holdout_outliers : tuple of int
        Rows further off than noise and covariance explain, numbered likewise.
    holdout_distances_before, holdout_distances : Distances
        The distances in short.
    holdout_test : HoldoutTest or None
        Whether they contradict the fit; None where that cannot be said.
    holdout_later : Later or None
        The rows.
    holdout_end : Evaluation or None
        The rows at the estimate, their own parameters found.
    holdout_own : mapping of str to (float, float)
        These parameters, of sessions that were not fitted: value and standard deviation.
    holdout_spare : float
        Lengths that are left to compare when these parameters have taken theirs.
    holdout_dropped : tuple of int
        Rows of other measurements that were left out as outliers; of those that were drawn, see
        `Identification.dropped`.
    holdout_dropped_names : str
        These rows by lines of files, poses and targets.
    holdout_drawn : bool
        Whether they are of the same measurements as the fitted points, drawn at random.
    """

    holdout_rms_before: float = float("nan")
    holdout_rms: float = float("nan")
    holdout_expected: float = float("nan")
    holdout_unreached: str = ""
    holdout_off_before: FloatArray = field(default_factory=lambda: np.empty(0))
    holdout_off: FloatArray = field(default_factory=lambda: np.empty(0))
    holdout_rows: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.intp))
    holdout_outliers: tuple[int, ...] = ()
    holdout_distances_before: Distances = field(default_factory=Distances)
    holdout_distances: Distances = field(default_factory=Distances)
    holdout_test: HoldoutTest | None = None
    holdout_later: Later | None = None
    holdout_end: Evaluation | None = None
    holdout_own: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    holdout_spare: float = float("nan")
    holdout_dropped: tuple[int, ...] = ()
    holdout_dropped_names: str = ""
    holdout_drawn: bool = False

    @property
    def holdout_units(self) -> dict[str, str]:
        """Unit of each parameter of the rows: "mm", "rad" or "1"."""
        if self.holdout_later is None:
            return {}
        chosen = self.holdout_later.parameters
        return dict(zip(chosen.names, chosen.units, strict=True))

    @property
    def holdout_data(self) -> tuple[FitData, ...]:
        """The sets of measurements."""
        return () if self.holdout_later is None else self.holdout_later.data

    @property
    def holdout_contradicts(self) -> bool:
        """Whether the points contradict the fit, and not only through a few that are far off."""
        if self.holdout_test is None or not self.holdout_test.contradicts:
            return False
        few = 0 < len(self.holdout_outliers) <= _FEW_ODD * int(np.isfinite(self.holdout_off).sum())
        return not (
            few and self.holdout_distances.rms_without_outliers <= RATIO * self.holdout_expected
        )

    @property
    def holdout_chance(self) -> float:
        """How likely such a rms would be if fit, noise and covariance were right."""
        return float("nan") if self.holdout_test is None else self.holdout_test.chance


def draw(data: FitData, holdout: float) -> tuple[FitData, FitData]:
    """Split rows into those to fit and those to hold out, as `Measurements.split` does."""
    measured = data.measured
    numbered = Measurements(
        measured.actuators, np.arange(len(measured)), "height", group=measured.pose_index
    )
    kept, out = (part.values.astype(np.intp) for part in numbered.split(holdout))
    return data.select(kept), data.select(out)


def evaluate(
    held: Sequence[tuple[FitData, int]],
    estimator: Estimator,
    estimate: Estimate,
    uncertainty: Uncertainty,
) -> HeldOut:
    """Compare points that were not fitted, before and after the calibration.

    Parameters
    ----------
    held : sequence of (FitData, int)
        With each, the fitted set whose noise it has.
    estimator, estimate, uncertainty : Estimator, Estimate, Uncertainty
        Of the fit.
    """
    if not held:
        return HeldOut()
    rows = later(estimator.equations.parameters, held)
    whole = rows.equations(estimator.equations)
    before = whole.with_exact_actuators().start(rows.at(estimator.start.theta), rows.own)
    equations, after, own = compared(rows, whole, estimate, uncertainty, before.begun)
    rows = replace(rows, parameters=equations.parameters)  # their own frames have been laid
    named = labels(equations)
    points = _points(rows, equations, after, named, own, uncertainty)
    row = named.row[named.length]
    count = len(equations.table.rows)
    off_before, off = (misfits.distances(equations, each) for each in (before, after))
    good = np.isfinite(off)
    expected = np.bincount(row, points.own + points.by_fit(uncertainty), count)
    spare = float((1.0 - points.taken[good[row]]).sum()) if good.any() else float("nan")
    usable = uncertainty.known and spare >= LEAST_FREEDOM
    test = _test(points, named, good[row], uncertainty) if usable else None
    odd = good & _odd(points, row, count, uncertainty)
    in_short = [distances(each, odd) for each in (off_before, off)]
    return HeldOut(
        holdout_rms_before=in_short[0].rms,
        holdout_rms=in_short[1].rms,
        holdout_expected=float(np.sqrt(np.mean(expected[good]))) if usable else float("nan"),
        holdout_unreached=equations.failures(after),
        holdout_off_before=off_before,
        holdout_off=off,
        holdout_rows=equations.table.rows,
        holdout_outliers=tuple(equations.table.rows[odd].tolist()),
        holdout_distances_before=in_short[0],
        holdout_distances=in_short[1],
        holdout_test=test,
        holdout_later=rows,
        holdout_end=after,
        holdout_own=_of_own(rows, after, own, uncertainty),
        holdout_spare=spare,
    )


@dataclass(frozen=True, eq=False)
class _Points:
    """Lengths (M,) of the points held out; of a pose its position.

    Residuals and design in mm, the variance of a reading and of what actuators add to it in mm²,
    the share of each that numbers of its own session took, and the fitted set that each is like.
    """

    residual: FloatArray
    design: FloatArray
    reading: FloatArray
    by_actuators: FloatArray
    taken: FloatArray
    like: IntArray

    @property
    def own(self) -> FloatArray:
        """Variance of a residual whatever the parameters of the fit are."""
        return (self.reading + self.by_actuators) * (1.0 - self.taken)

    def by_fit(self, uncertainty: Uncertainty) -> FloatArray:
        """Variance that the parameters' errors add."""
        added: FloatArray = np.einsum(
            "ij,jk,ik->i", self.design, uncertainty.by_cluster, self.design
        )
        return added


def _points(
    rows: Later,
    equations: Equations,
    after: Evaluation,
    named: Labels,
    own: OwnNumbers | None,
    uncertainty: Uncertainty,
) -> _Points:
    """The lengths at the solution."""
    like = rows.like
    by_actuators = after.machines.actuator_twists(after.states)
    variances, added = [], []
    seen = equations.prediction.predicted(after)
    for i, measured in enumerate(equations.table.sets):
        count, k = after.residuals[i].shape
        variances.append(np.repeat(_variances(measured, uncertainty, like[i]), k))
        sigma = _of_actuators(measured, after.robot, uncertainty)
        moved = seen[i].by_twist @ by_actuators[equations.table.pose_of[i]]
        part = (
            np.zeros((count, k)) if sigma is None else ((moved * sigma[:, None]) ** 2).sum(axis=2)
        )
        added.append(equations.arcs[i] ** 2 * part.ravel())
    jacobian = np.concatenate([
        arc * part.reshape(-1, part.shape[2])
        for arc, part in zip(equations.arcs, equations.jacobian(after), strict=True)
    ])[equations.whitening.present]  # fmt: skip
    back = uncertainty.fit.back
    by_all = (jacobian * equations.parameters.scale)[named.length]
    by_fitted = rows.by_fitted(by_all, len(back))

    def lengths(parts: Sequence[FloatArray]) -> FloatArray:
        return np.concatenate(parts)[equations.whitening.present][named.length]

    by_sigma, taken = lengths(added), np.zeros(len(by_all))
    if own is not None:
        by_own = by_all[:, rows.own]
        by_fitted += by_own @ own.follow
        arcs = np.array(equations.arcs)[named.set_of[named.length]]
        weighted = arcs**2 * equations.whitening.variances(own.noise)[named.length]
        if uncertainty.mixed:
            weighted += by_sigma / uncertainty.excess[0]
        taken = np.clip(((by_own @ own.half) ** 2).sum(axis=1) / weighted, 0.0, 1.0)
    return _Points(
        residual=lengths(
            [arc * part.ravel() for arc, part in zip(equations.arcs, after.residuals, strict=True)]
        ),
        design=by_fitted @ back,
        reading=lengths(variances),
        by_actuators=by_sigma,
        taken=taken,
        like=np.array(like)[named.set_of[named.length]],
    )


def _odd(
    points: _Points,
    row: IntArray,
    count: int,
    uncertainty: Uncertainty,
) -> BoolArray:
    """Which rows (N,) are further off than noise and covariance explain.

    The noise is an estimate itself, as good as that of the fitted rows.
    """
    odd = np.zeros(count, dtype=bool)
    if not uncertainty.known or not len(row):
        return odd
    freedom = uncertainty.fit.freedom if uncertainty.fit.freedom >= FEW else np.inf
    own = np.maximum(points.own, _NOTHING * float(np.median(points.own)))
    order, lengths = np.argsort(row, kind="stable"), np.bincount(row, minlength=count)
    first = np.cumsum(lengths) - lengths
    for k in np.unique(lengths[lengths > 0]).tolist():
        alike = np.flatnonzero(lengths == k)
        mine = order[first[alike, None] + np.arange(k)]
        design, residual = points.design[mine], points.residual[mine]
        variance = design @ uncertainty.by_cluster @ design.transpose(0, 2, 1)
        variance += np.eye(k) * own[mine][:, :, None]
        along = np.linalg.solve(variance, residual[:, :, None])[:, :, 0]
        squares = np.nan_to_num((residual * along).sum(axis=1), posinf=_HUGE)
        chances = [f_tail(min(each / k, _HUGE), k, freedom) for each in squares.tolist()]
        odd[alike] = np.array(chances) < _ODD / count
    return odd


def _of_own(
    rows: Later, after: Evaluation, own: OwnNumbers | None, uncertainty: Uncertainty
) -> dict[str, tuple[float, float]]:
    """Values and deviations of parameters that the fit has not; inf where nothing shows them."""
    if own is None:
        return {}
    chosen, mine = rows.parameters, np.flatnonzero(rows.own)
    follow, widened = own.follow @ uncertainty.fit.back, uncertainty.covariance.scale
    matrix = widened**2 * own.half @ own.half.T + follow @ uncertainty.by_cluster @ follow.T
    rates = (chosen.reported_rates(after.theta) * chosen.scale)[np.ix_(mine, mine)]
    deviation = np.sqrt(np.maximum(np.diagonal(rates @ matrix @ rates.T), 0.0))
    shown = np.diagonal(own.half @ np.linalg.pinv(own.half)) > 1.0 - _LOOSE
    deviation[~shown | (not uncertainty.known)] = np.inf
    values = chosen.reported(after.theta)[mine].tolist()
    names = [chosen.names[c] for c in mine]
    return dict(zip(names, zip(values, deviation.tolist(), strict=True), strict=True))


def _variances(measured: Measurements, uncertainty: Uncertainty, like: int) -> FloatArray:
    """Variance of a length of each row, mm² (N,): that of the fitted set, by sigma where stated."""
    total = uncertainty.noises[like][0]
    own = stated_variances(measured)
    fitted = stated_variances(uncertainty.equations.table.sets[like])
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
    return sigma * float(np.sqrt(uncertainty.excess[0]))


def _test(
    points: _Points, named: Labels, good: BoolArray, uncertainty: Uncertainty
) -> HoldoutTest | None:
    """Test lengths of the rows that were reached; None where their noise is not known."""
    own = points.own[good]
    if not (own > _NOTHING * np.median(own)).all():
        return None
    fitted, split = _fitted_lengths(uncertainty, np.unique(points.like))
    unit = np.sqrt(own)
    held = Lengths(
        points.residual[good] / unit,
        points.design[good] / unit[:, None],
        numbered(named.row[named.length][good]),
        numbered(named.pose[named.length][good]),
        named.component[named.length][good],
    )
    # rows at the same actuators have their errors in common
    total, shared = split
    common = shared + float(np.mean(points.by_actuators[good] / own)) * total
    of_held = total, min(common, total)
    taken = float(points.taken[good].mean())
    return holdout_test(fitted, held, split, uncertainty.by_cluster, of_held, taken)


def _fitted_lengths(uncertainty: Uncertainty, sets: IntArray) -> tuple[Lengths, Noise]:
    """Lengths of some fitted sets, each in units of its own deviation, and how these split.

    Of mixtures all equations, which are lengths in part.
    """
    sandwich, named = uncertainty.covariance.sandwich, uncertainty.labels
    unit = np.zeros(len(uncertainty.fit.residual))
    if uncertainty.mixed:
        values = sandwich.residual
        unit[:] = np.sqrt(uncertainty.excess[0])
    else:
        values = uncertainty.adjusted
        for i in sets:
            unit[uncertainty.lengths_of(int(i))] = np.sqrt(uncertainty.noises[i][0])
    mine = unit > 0
    residual = values[mine] / unit[mine]
    split = noise(residual, sandwich.retained[mine], numbered(uncertainty.fit.key[mine]))
    lengths = Lengths(
        residual,
        uncertainty.fit.design[mine],
        numbered(named.row[mine]),
        numbered(named.pose[mine]),
        named.component[mine],
    )
    return lengths, split
