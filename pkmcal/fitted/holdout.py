"""Hold-out: points that are not fitted, only compared with the calibrated machine.

`draw` splits them off before the fit, `evaluate` compares them after it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.estimation import misfits
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.estimate import Estimate
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.solving import LEAST_FREEDOM
from pkmcal.estimation.uncertainty import Uncertainty
from pkmcal.fitted.distances import NO_DISTANCES, Distances, distances
from pkmcal.fitted.held_points import HeldFamily, families, odd_rows, points
from pkmcal.fitted.later import Later, OwnNumbers, compared, later
from pkmcal.measurements.measurements import Measurements
from pkmcal.result import ReadOnly
from pkmcal.statistics.holdout_test import HoldoutTest

_LOOSE = 1e-6  # share of a number in combinations that its session's rows do not show
_FEW_ODD = 0.25  # share of held-out points that may be off without the rest being so


@dataclass(frozen=True, eq=False, kw_only=True)
class HeldOut(ReadOnly):
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
    holdout_families : tuple of HeldFamily
        Lengths, angles and other components of one unit, each with its test; empty where nothing
        can be said.
    holdout_later : Later or None
        The rows.
    holdout_end : Evaluation or None
        The rows at the estimate, their own parameters found.
    holdout_own : mapping of str to (float, float)
        These parameters, of sessions that were not fitted: value and standard deviation.
    holdout_spare : float
        Equations that are left to compare when these parameters have taken theirs.
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
    holdout_distances_before: Distances = NO_DISTANCES
    holdout_distances: Distances = NO_DISTANCES
    holdout_families: tuple[HeldFamily, ...] = ()
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
    def holdout_contradicting(self) -> tuple[HeldFamily, ...]:
        """Evidence of held-out points against the fit that a few distant points do not explain."""
        few = 0 < len(self.holdout_outliers) <= _FEW_ODD * int(np.isfinite(self.holdout_off).sum())
        found = [each for each in self.holdout_families if each.contradicts]
        return tuple(each for each in found if not (few and each.agrees_otherwise))

    @property
    def holdout_contradicts(self) -> bool:
        """True if the points contradict the fit, and not only through a few that are far off."""
        return bool(self.holdout_contradicting)

    @property
    def holdout_test(self) -> HoldoutTest | None:
        """The test of what speaks most against the fit; None where that cannot be said."""
        tests = [each.test for each in self.holdout_families if each.test is not None]
        return min(tests, key=lambda test: (not test.contradicts, test.chance), default=None)

    @property
    def holdout_chance(self) -> float:
        """Chance of such a rms if fit, noise and covariance were right."""
        return float("nan") if self.holdout_test is None else self.holdout_test.chance


def draw(data: FitData, holdout: float) -> tuple[FitData, FitData]:
    """Split rows into those to fit and those to hold out, as `Measurements.split` does."""
    measured = data.measured
    numbered = Measurements(
        measured.actuators, np.arange(len(measured)), "height", group=measured.pose_index
    )
    kept, out = (part.values.astype(np.intp) for part in numbered.split(holdout))
    return data.select(kept), data.select(out)


def unfitted(
    held: Sequence[tuple[FitData, int]],
    estimator: Estimator,
    estimate: Estimate,
    uncertainty: Uncertainty,
    nominal: FloatArray,
) -> tuple[Later, Equations, tuple[Evaluation, Evaluation], OwnNumbers | None]:
    """Rows that were not fitted, their equations, and these before and after the calibration.

    `nominal` (n,) are the parameters before it.
    """
    rows = later(estimator.equations.parameters, held)
    whole = rows.equations(estimator.equations)
    exact = whole.with_exact_actuators()
    before = exact.start(rows.at(nominal), rows.own)
    equations, after, own = compared(rows, whole, estimate, uncertainty, before.begun)
    if rows.own.any():
        laid = exact.with_parameters(before.parameters)
        before = laid.of_machine_alone(before, rows.own)
    rows = replace(rows, parameters=equations.parameters)  # their own frames have been laid
    return rows, equations, (before, after), own


def evaluate(
    held: Sequence[tuple[FitData, int]],
    estimator: Estimator,
    estimate: Estimate,
    uncertainty: Uncertainty,
    nominal: FloatArray,
) -> HeldOut:
    """Compare points that were not fitted, before and after the calibration.

    Parameters
    ----------
    held : sequence of (FitData, int)
        With each, the fitted set whose noise it has.
    estimator, estimate, uncertainty : Estimator, Estimate, Uncertainty
        Of the fit.
    nominal : ndarray (n,)
        The parameters before it.
    """
    if not held:
        return HeldOut()
    rows, equations, (before, after), own = unfitted(
        held, estimator, estimate, uncertainty, nominal
    )
    blocks = equations.blocks
    seen = points(rows, equations, after, own, uncertainty)
    row, count = blocks.row, len(equations.table.rows)
    off_before, off = (misfits.distances(equations, each) for each in (before, after))
    good = np.isfinite(off)
    expected = np.bincount(row, seen.own + seen.by_fit(uncertainty), count)
    spare = float((1.0 - seen.taken[good[row]]).sum()) if good.any() else float("nan")
    usable = uncertainty.known and spare >= LEAST_FREEDOM
    odd = good & odd_rows(seen, row, count, uncertainty)
    judged = families(seen, blocks, good[row], odd[row], uncertainty) if usable else ()
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
        holdout_families=tuple(judged),
        holdout_later=rows,
        holdout_end=after,
        holdout_own=_of_own(rows, after, own, uncertainty),
        holdout_spare=spare,
    )


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
