"""The flat result of a calibration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Generic

import numpy as np

from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import BoolArray, FloatArray, IntArray
from pkmcal.effects.expansion import stated
from pkmcal.estimation import misfits
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.identifiability import observability
from pkmcal.estimation.mixed_noise import of_own_noises
from pkmcal.estimation.solving import scaled_triangle
from pkmcal.fitted.datum import NO_DATUM, Datum
from pkmcal.fitted.distances import Distances, distances
from pkmcal.fitted.fit import Fit
from pkmcal.fitted.holdout import HeldOut
from pkmcal.fitted.nuisances import Nuisance
from pkmcal.fitted.slack import SlackCable
from pkmcal.kinematics.robot import Robot
from pkmcal.result import read_only
from pkmcal.statistics.noise import Split
from pkmcal.statistics.prior_test import PriorTest
from pkmcal.statistics.weighed import Weighed

if TYPE_CHECKING:  # which brings its own; the module is of Python 3.13 and later
    from typing_extensions import TypeVar

    Machine = TypeVar("Machine", bound=Robot | SerialArm, default=Robot | SerialArm, covariant=True)
else:
    from typing import TypeVar

    Machine = TypeVar("Machine")  # what `identify` was given

_NAMES = (  # of `to_dict`, in the order in which they are written
    "verdict", "robot", "free", "units", "values", "start", "stderr", "parameter_dof", "interval95",
    "covariance", "covariance_rule", "rank", "gap", "datum", "expansion", "unidentifiable",
    "nuisances", "breakeven", "gauges", "rms", "rms_before", "holdout_rms", "holdout_rms_before",
    "holdout_expected", "holdout_contradicts", "holdout_chance", "holdout_outliers",
    "holdout_unreached", "holdout_off",
    "holdout_off_before", "closure_rms", "closure_rms_before", "chi2_per_dof", "dof", "noise",
    "component_noise", "reading_noise", "pose_noise", "actuator_noise", "tension_noise",
    "tension_rms", "redundancy", "idle", "repeatability", "lack_of_fit", "lack_of_fit_chance",
    "observability", "residuals", "rows", "outliers", "dropped", "holdout_dropped", "slack",
    "distances_before", "distances", "holdout_distances_before", "holdout_distances", "at_bounds",
    "converged", "evaluations", "history", "moved", "sessions", "robots", "holdout_parameters",
    "law_tests", "drift", "measuring_order", "warnings",
)  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Solution(HeldOut, Generic[Machine]):
    """A solved calibration: every number that was found, each under one name.

    Those of points that were not fitted are described in the base class, `HeldOut`.

    Attributes
    ----------
    free : tuple of str
        Names (n,): numbers of the geometry, then of an unknown frame and unknown targets.
    units : tuple of str
        Unit of each parameter: "mm", "rad" or "1" (a ratio).
    columns : ndarray of int
        Which parameters (n,) of the fit they are: it may have had others, `nuisances`.
    nuisances : tuple of Nuisance
        Numbers that were fitted along because their uncertainty is stated. Those that moved by
        more than twice that are in `free`, too.
    values : ndarray
        Identified values (n,).
    start : ndarray
        Values (n,) before the calibration: nominal ones, and the frame, targets and other unknowns
        of the readings that fit the nominal machine best.
    stderr : ndarray
        Standard deviations (n,); inf where neither measurements nor prior determine.

        They know no bounds: for numbers `at_bounds` they are those without the bound.
    parameter_dof : ndarray
        Degrees of freedom (n,) of each `stderr`; inf where sigma says all, 0 where nothing.
    interval95 : ndarray
        Ends (n, 2) of intervals that hold the true value in 95 % of calibrations.

        By Student's t with `parameter_dof`: with few degrees of freedom much wider than twice
        `stderr`.
    covariance : ndarray
        Covariance (n, n) with stderr² on its diagonal; NaN beside an infinite variance.

        By `covariance_rule`. Where it is "cluster", its rank is at most the number of poses: each
        number in it is right, its inverse is not.
    correlation_matrix : ndarray
        Correlations (n, n) by the design; NaN beside parameters that are not determined.

        Those of equal independent errors at the poses that were measured: few poses show what
        each parameter's error is, not how the errors of two go together.
    at_bounds : tuple of str
        Parameters that ended at a bound.
    covariance_rule : str
        How: "classical", or "cluster" where rows of a pose share errors or a loss is robust.
    rank : int
        Number of combinations that the measurements alone determine, without prior.
    gap : float
        Singular value of the last identifiable combination over the next; inf if none.
    unidentifiable : tuple of str
        Combinations that change no measured quantity, as "base1.x − platform1.x".

        They keep what they had, or follow the prior. Coefficients are in mm at the machine: an
        angle counts as its arc.
    gauges : tuple of str
        What readings of actuators alone leave open by their nature, in words.

        Where the base stands, the common scale; these combinations are not in `unidentifiable`.
    rms : float
        √(Σ r²/N) over the N fitted points, mm.

        Unweighted; r is the distance of the measured from the predicted point, of a pose that of
        its position.
    rms_before : float
        `rms` at `start`.
    closure_rms : float
        How far the machine's own closures disagree at the poses found, mm of the actuators.

        NaN where poses follow from the actuators exactly: as many closures as free coordinates, and
        no `Measurements.actuator_sigma`.
    closure_rms_before : float
        `closure_rms` at `start`.
    closures : ndarray
        How far off the worst closure at each pose is (K,), mm; NaN where they hold.
    actuator_noise : float
        Estimated deviation of what the actuators read, mm; NaN where it was stated.
    tension_noise : float
        Estimated deviation of what load cells read, N; NaN where it was stated.
    tension_rms : float
        How far tensions are off what load cells read, N; NaN where they are no unknowns.
    redundancy : tuple of float
        Degrees of freedom left in each set, then in load cells and closures if fitted.

        Equations less what poses and parameters took of them; a deviation estimated from r of them
        is itself good to 1/√(2 r) of it.
    idle : int
        How many poses say nothing, for nothing is left when they are determined.
    chi2_per_dof : float
        χ² per degree of freedom: about 1 if the noise is as stated; NaN without sigma.
    dof : float
        Degrees of freedom: equations, those of the prior included, less parameters.
    noise : tuple of float
        Estimated deviation of each set of measurements, mm; NaN where sigma was given.

        That of residuals: what a reading has of its own and what its pose shares, the model's error
        included. NaN, too, where no equations are left to show it.
    component_noise : tuple of tuple of float
        `noise` of each component, in its own unit.

        Components are told apart where the residuals call for it: lengths and angles, x y and z.
    components : tuple of tuple of str
        What was read of each set: x, y, z.
    component_units : tuple of tuple of str
        Unit of each: "mm", "rad", "px".
    told_apart : bool
        Whether components differ in their noise.
    residuals : tuple of ndarray
        Measured less predicted (N, k) of the fitted rows of each set, mm and rad.
    rows : ndarray of int
        Numbers of the fitted rows, counted through all sets from 0.
    outliers : tuple of int
        Rows that the others contradict, numbered likewise.
    robot : Robot or SerialArm
        The machine with the identified geometry; that of the last session.
    fit : Fit
        The least-squares problem itself, for reports and the bootstrap.
    converged : bool
        Whether the least squares converged.
    evaluations : int
        How often the forward kinematics of all rows were solved.
    history : tuple of float
        Misfit rms in mm at `start` and after each step of the search; where poses have unknowns,
        with poses that fit best.
    prior_test : PriorTest or None
        Whether the measurements contradict the prior, where there is one.
    uncertainty_test : PriorTest or None
        Whether they contradict the stated uncertainty of `nuisances`, where there are any.
    robots : mapping of str to Robot or SerialArm
        The machine of each session, those that were held out too; empty without `per_session`.
    datum : Datum
        Numbers that are held because they only say where frames lie.
    dropped : tuple of int
        Rows that were left out, by their numbers.
    dropped_names : str
        These rows by lines of files, poses and targets.
    dropped_data : tuple of (FitData, int)
        Their measurements, each set with the number of the fitted one that it is like.
    slack : tuple of SlackCable
        Readings of cables that the others show to be slack, the longest first: left out, or
        fitted.
    """

    free: tuple[str, ...]
    units: tuple[str, ...]
    columns: IntArray
    nuisances: tuple[Nuisance, ...]
    values: FloatArray
    start: FloatArray
    stderr: FloatArray
    parameter_dof: FloatArray
    interval95: FloatArray
    covariance: FloatArray
    correlation_matrix: FloatArray
    at_bounds: tuple[str, ...]
    covariance_rule: str
    rank: int
    gap: float
    unidentifiable: tuple[str, ...]
    gauges: tuple[str, ...]
    rms: float
    rms_before: float
    closure_rms: float
    closure_rms_before: float
    closures: FloatArray
    actuator_noise: float
    tension_noise: float
    tension_rms: float
    redundancy: tuple[float, ...]
    idle: int
    chi2_per_dof: float
    dof: float
    noise: tuple[float, ...]
    component_noise: tuple[tuple[float, ...], ...]
    components: tuple[tuple[str, ...], ...]
    component_units: tuple[tuple[str, ...], ...]
    told_apart: bool
    residuals: tuple[FloatArray, ...]
    rows: IntArray
    outliers: tuple[int, ...]
    robot: Machine
    fit: Fit
    converged: bool
    evaluations: int
    history: tuple[float, ...]
    prior_test: PriorTest | None = None
    uncertainty_test: PriorTest | None = None
    robots: Mapping[str, Machine] = field(default_factory=dict)
    datum: Datum = NO_DATUM
    dropped: tuple[int, ...] = ()
    dropped_names: str = ""
    dropped_data: tuple[tuple[FitData, int], ...] = ()
    slack: tuple[SlackCable, ...] = ()

    @property
    def observability(self) -> dict[str, float]:
        """Indices O1 … O5 of the scaled Jacobian, over the identifiable combinations."""
        return dict(self._observability)

    @cached_property
    def _observability(self) -> dict[str, float]:
        estimate, poses = self.fit.estimate, len(self.fit.estimator.equations.table.actuators)
        scaled = scaled_triangle(self.fit.estimator, estimate.evaluation)
        return observability(scaled, poses, estimate.state.measured.rank)

    @cached_property
    def reading_noise(self) -> tuple[float, ...]:
        """What a single reading of each set has of its own, mm per coordinate."""
        return tuple(float(np.sqrt(own - shared)) for own, shared in self.fit.uncertainty.noises)

    @cached_property
    def pose_noise(self) -> tuple[float, ...]:
        """What rows of one pose share beside it, mm per coordinate: pose and model errors."""
        return tuple(float(np.sqrt(shared)) for _, shared in self.fit.uncertainty.noises)

    @property
    def repeatability(self) -> float:
        """Scatter of repeats about their mean, mm per coordinate; NaN without repeats."""
        return self._repeats.scatter

    @property
    def lack_of_fit(self) -> float:
        """What the model misses at a pose beyond that scatter, mm per coordinate."""
        return self._repeats.beyond

    @cached_property
    def lack_of_fit_chance(self) -> float:
        """P-value of the F test of lack of fit: small where the model misses something."""
        return self.fit.uncertainty.repeats().chance

    @cached_property
    def _repeats(self) -> Split:
        return self.fit.uncertainty.repeats(plain=True)

    @cached_property
    def weighed(self) -> Weighed:
        """The fit of which equations are equally uncertain and independent of each other.

        Also where a stated sigma, or that of the actuators, is wrong of some of them: tests of
        what the model misses rest on it. Outliers do not tell the noise.
        """
        sure = self.fit.uncertainty
        system, blocks = sure.equations.system, sure.blocks
        if system is None or blocks.unstated.all():
            return sure.weighed
        odd = np.isin(sure.equations.table.rows, self.outliers)
        use = ~np.isin(sure.blocks.row, blocks.block_of_row[odd])
        evaluation = self.fit.estimate.evaluation
        return of_own_noises(*sure.tested_with_prior, system, evaluation, sure.factors, use)

    @cached_property
    def distances_before(self) -> Distances:
        """Rms, median and 95 % quantile of the nominal machine's distances to fitted points, mm."""
        return self._distances(self.fit.start)

    @cached_property
    def distances(self) -> Distances:
        """Those of the calibrated machine, and its rms without `outliers`."""
        return self._distances(self.fit.end)

    def _distances(self, evaluation: Evaluation) -> Distances:
        off = misfits.distances(self.fit.estimator.equations, evaluation)
        return distances(off, np.isin(self.rows, self.outliers))

    @property
    def loss(self) -> str:
        """The loss that was asked for."""
        return self.fit.estimate.state.loss

    @property
    def sessions(self) -> tuple[str, ...]:
        """The fitted sessions, in the order of their first rows; empty without `per_session`."""
        return self.fit.parameters.sessions

    @property
    def read(self) -> BoolArray:
        """Mask of fitted rows (N,) of which more is known than where the actuators were."""
        read: BoolArray = self.fit.equations.table.count > 0
        return read_only(read)

    @property
    def expansion(self) -> dict[str, float]:
        """Coefficients of thermal expansion, 1/K, by part; empty where none were stated."""
        return stated(self.fit.equations.prediction.datasets[0].effects)

    @property
    def left_out(self) -> str:
        """The rows that were left out as asked, in words; "" where none were."""
        count = len(self.dropped) + len(self.holdout_dropped)
        names = ", ".join(filter(None, (self.dropped_names, self.holdout_dropped_names)))
        many = f"{count} rows were" if count > 1 else "1 row was"
        return f"{many} left out, as asked: {names}" if count else ""

    @property
    def holdout_parameters(self) -> dict[str, dict[str, float]]:
        """Numbers that were found of held-out sessions, as `Identification.parameters`."""
        own = self.holdout_own.items()
        return {name: {"value": value, "stderr": stderr} for name, (value, stderr) in own}

    # the names that lmfit and scipy give ----------------------------------------------------------

    @property
    def success(self) -> bool:
        """`converged`."""
        return self.converged

    @property
    def nfev(self) -> int:
        """`evaluations`."""
        return self.evaluations

    @property
    def covar(self) -> FloatArray:
        """`covariance`."""
        return self.covariance

    @property
    def redchi(self) -> float:
        """`chi2_per_dof`."""
        return self.chi2_per_dof

    def to_dict(self) -> dict[str, Any]:
        """Return all attributes by name, as JSON files hold them."""
        return {name: getattr(self, name) for name in _NAMES}
