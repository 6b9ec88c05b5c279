"""Hold-out: points that are not fitted, only compared with the calibrated machine.

`draw` splits them off before the fit, `evaluate` compares them after it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.calibration.distances import Distances, distances
from pkmcal.calibration.equations import Equations
from pkmcal.calibration.estimator import Estimate, Estimator
from pkmcal.calibration.mode_slips import in_their_modes
from pkmcal.calibration.parameters import FitData
from pkmcal.calibration.uncertainty import Labels, Uncertainty, labels, stated_variances
from pkmcal.measurements.measurements import Measurements
from pkmcal.statistics.distributions import chi2_tail
from pkmcal.statistics.holdout_test import HoldoutTest, Lengths, holdout_test
from pkmcal.statistics.linear_fit import numbered
from pkmcal.statistics.noise import Noise, noise

_ODD = 0.01  # chance of naming any held-out row that is as far off as expected


@dataclass(frozen=True)
class HeldOut:
    """Errors of the points held out, mm; NaN where there are none.

    Attributes
    ----------
    rms_before, rms : float
        Root mean square distances with the start's parameters and with the estimate's.
    expected : float
        What `rms` should be if noise and covariance are right; NaN where the noise is not known.
    failures : str
        Rows that were left out because their forward kinematics failed, in words.
    off_before, off : ndarray (N,)
        The distances themselves.
    rows : ndarray of int (N,)
        Their numbers in what was given.
    odd : tuple of int
        Rows further off than noise and covariance explain, numbered likewise.
    before, after : Distances
        The distances in short.
    test : HoldoutTest or None
        Whether they contradict the fit; None where that cannot be said.
    data : tuple of FitData
        The sets of measurements.
    like : tuple of int
        The fitted set of each.
    drawn : bool
        Whether they are of the same measurements as the fitted points, drawn at random.
    """

    rms_before: float = float("nan")
    rms: float = float("nan")
    expected: float = float("nan")
    failures: str = ""
    off_before: FloatArray = field(default_factory=lambda: np.empty(0))
    off: FloatArray = field(default_factory=lambda: np.empty(0))
    rows: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.intp))
    odd: tuple[int, ...] = ()
    before: Distances = field(default_factory=Distances)
    after: Distances = field(default_factory=Distances)
    test: HoldoutTest | None = None
    data: tuple[FitData, ...] = ()
    like: tuple[int, ...] = ()
    drawn: bool = False

    @property
    def contradicts(self) -> bool:
        """Whether the points contradict the fit."""
        return self.test is not None and self.test.contradicts

    @property
    def chance(self) -> float:
        """How likely such a rms would be if fit, noise and covariance were right."""
        return float("nan") if self.test is None else self.test.chance


def draw(data: FitData, holdout: float) -> tuple[FitData, FitData]:
    """Split rows into those to fit and those to hold out, as `Measurements.split` does."""
    measured = data.measured
    numbered = Measurements(
        measured.actuators, np.arange(len(measured)), "height", group=measured.pose_index
    )
    kept, out = (part.values.astype(np.intp) for part in numbered.split(holdout))
    return _rows(data, kept), _rows(data, out)


def _rows(data: FitData, chosen: IntArray) -> FitData:
    return replace(data, measured=data.measured.select(chosen), rows=data.rows[chosen])


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
    equations = Equations([data for data, _ in held], estimator.equations.parameters)
    after = in_their_modes(equations, equations.at(estimate.evaluation.theta))
    before = equations.at(estimator.start.theta)
    # what follows is of lengths: of a pose its position
    named = labels(equations)
    lengths = named.length
    row = named.row[lengths]
    like = np.array([i for _, i in held])[named.set_of[lengths]]
    own = np.concatenate([
        _variances(data.measured, uncertainty, i)[rows]
        for rows, (data, i) in zip(_rows_of(named), held, strict=True)
    ])  # fmt: skip
    jacobian = np.concatenate([
        part.reshape(-1, part.shape[2]) for part in equations.jacobian(after)
    ])[lengths]  # fmt: skip
    design = (jacobian * estimator.scale) @ uncertainty.fit.back
    covariance = uncertainty.by_cluster
    by_fit = np.einsum("ij,jk,ik->i", design, covariance, design)
    expected = np.bincount(row, own + by_fit)
    off_before, off = equations.distances(before), equations.distances(after)
    odd = np.array([
        chi2_tail(k * d**2 / e, k) < _ODD / len(off) if np.isfinite(d) and e > 0 else False
        for d, e, k in zip(off, expected, np.bincount(row), strict=True)
    ])  # fmt: skip
    good = np.isfinite(off)
    test = None
    if uncertainty.known and np.isfinite(own).all() and (own > 0).all() and good[row].any():
        chosen = good[row]
        residual = np.concatenate([r.ravel() for r in after.residuals])[lengths]
        unit = np.sqrt(own)[chosen]
        fitted, split = _fitted_lengths(uncertainty, np.unique(like))
        test = holdout_test(
            fitted,
            Lengths(
                residual[chosen] / unit,
                design[chosen] / unit[:, None],
                numbered(row[chosen]),
                numbered(named.pose[lengths][chosen]),
                named.component[lengths][chosen],
            ),
            split,
            covariance,
        )
    return HeldOut(
        rms_before=equations.rms(before),
        rms=equations.rms(after),
        expected=float(np.sqrt(np.nanmean(expected))) if uncertainty.known else float("nan"),
        failures=equations.failures(after),
        off_before=off_before,
        off=off,
        rows=equations.rows,
        odd=tuple(equations.rows[odd].tolist()),
        before=distances(off_before, odd),
        after=distances(off, odd),
        test=test,
        data=tuple(data for data, _ in held),
        like=tuple(i for _, i in held),
    )


def _rows_of(named: Labels) -> list[IntArray]:
    """Row of its set of each length, set by set."""
    found = []
    for i in range(int(named.set_of.max()) + 1):
        rows = named.row[named.length & (named.set_of == i)]
        found.append(rows - rows.min())
    return found


def _variances(measured: Measurements, uncertainty: Uncertainty, like: int) -> FloatArray:
    """Variance of a length of each row, mm² (N,): that of the fitted set, by sigma where stated."""
    total = uncertainty.noises[like].total
    own, fitted = stated_variances(measured), uncertainty.stated_variances(like)
    if own is None or fitted is None:
        return np.full(len(measured), total)
    return own * total / float(fitted.mean())


def _fitted_lengths(uncertainty: Uncertainty, sets: IntArray) -> tuple[Lengths, Noise]:
    """Lengths of some fitted sets, each in units of its own deviation, and how these split."""
    unit = np.zeros(len(uncertainty.fit.residual))
    for i in sets:
        unit[uncertainty.lengths_of(int(i))] = np.sqrt(uncertainty.noises[i].total)
    mine = unit > 0
    named = uncertainty.labels
    residual = uncertainty.adjusted[mine] / unit[mine]
    retained = uncertainty.covariance.sandwich.retained[mine]
    split = noise(residual, retained, numbered(uncertainty.fit.key[mine]))
    lengths = Lengths(
        residual,
        uncertainty.fit.design[mine],
        numbered(named.row[mine]),
        numbered(named.pose[mine]),
        named.component[mine],
    )
    return lengths, split
