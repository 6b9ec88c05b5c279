"""The parts of an `Identification`, and the flat names by which users read them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import FloatArray, IntArray
from pkmcal.calibration.distances import Distances
from pkmcal.calibration.fit import Fit
from pkmcal.calibration.fit_statistics import (
    Identifiability,
    Misfit,
    ParameterTable,
    Repeats,
    SearchRecord,
)
from pkmcal.calibration.holdout import HeldOut
from pkmcal.kinematics.robot import Robot
from pkmcal.statistics.prior_test import PriorTest

_NAMES = (  # of `to_dict`, in the order in which they are written
    "verdict",
    "robot",
    "free",
    "units",
    "values",
    "start",
    "stderr",
    "parameter_dof",
    "interval95",
    "covariance",
    "covariance_rule",
    "rank",
    "gap",
    "unidentifiable",
    "rms",
    "rms_before",
    "holdout_rms",
    "holdout_rms_before",
    "holdout_expected",
    "holdout_contradicts",
    "holdout_chance",
    "holdout_outliers",
    "holdout_unreached",
    "holdout_off",
    "holdout_off_before",
    "closure_rms",
    "closure_rms_before",
    "chi2_per_dof",
    "dof",
    "noise",
    "component_noise",
    "reading_noise",
    "pose_noise",
    "actuator_noise",
    "redundancy",
    "idle",
    "repeatability",
    "lack_of_fit",
    "lack_of_fit_chance",
    "observability",
    "residuals",
    "rows",
    "outliers",
    "distances_before",
    "distances",
    "holdout_distances_before",
    "holdout_distances",
    "at_bounds",
    "converged",
    "evaluations",
    "history",
    "moved",
    "warnings",
)


@dataclass(frozen=True, eq=False, repr=False)
class Parts:
    """What the modules of a calibration hand over, under flat names as well.

    Attributes
    ----------
    robot : Robot or SerialArm
        The machine with the identified geometry.
    table : ParameterTable
        The parameters, before and after.
    identifiability : Identifiability
        What the measurements alone determine.
    misfit : Misfit
        Residuals, and what they say of noise and outliers.
    holdout : HeldOut
        Errors of points that were not fitted.
    repeats : Repeats
        Pure error and lack of fit.
    search : SearchRecord
        How the least squares went.
    fit : Fit
        The least-squares problem itself, for reports and the bootstrap.
    warnings : tuple of str
        What looks wrong with measurements or result.
    prior_test : PriorTest or None
        Whether the measurements contradict the prior, where there is one.
    """

    robot: Robot | SerialArm
    table: ParameterTable
    identifiability: Identifiability
    misfit: Misfit
    holdout: HeldOut
    repeats: Repeats
    search: SearchRecord
    fit: Fit
    warnings: tuple[str, ...] = ()
    prior_test: PriorTest | None = None

    @property
    def free(self) -> tuple[str, ...]:
        """Names (n,): numbers of the geometry, then of an unknown frame and unknown targets."""
        return self.table.free

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each parameter: "mm", "rad" or "1" (a ratio)."""
        return self.table.units

    @property
    def values(self) -> FloatArray:
        """Identified values (n,)."""
        return self.table.values

    @property
    def start(self) -> FloatArray:
        """Values (n,) before the calibration."""
        return self.table.start

    @property
    def stderr(self) -> FloatArray:
        """Standard deviations (n,); inf where neither measurements nor prior determine.

        They know no bounds: for numbers `at_bounds` they are those without the bound.
        """
        return self.table.stderr

    @property
    def covariance(self) -> FloatArray:
        """Covariance (n, n) with stderr² on its diagonal; NaN beside an infinite variance.

        By `covariance_rule`. Where it is "cluster", its rank is at most the number of poses: each
        number in it is right, its inverse is not.
        """
        return self.table.covariance

    @property
    def covariance_rule(self) -> str:
        """How: "classical", or "cluster" where rows of a pose share errors or a loss is robust."""
        return self.table.rule

    @property
    def parameter_dof(self) -> FloatArray:
        """Degrees of freedom (n,) of each `stderr`; inf where sigma says all, 0 where nothing."""
        return self.table.dof

    @property
    def interval95(self) -> FloatArray:
        """Ends (n, 2) of intervals that hold the true value in 95 % of calibrations.

        By Student's t with `parameter_dof`: with few degrees of freedom much wider than twice
        `stderr`.
        """
        return self.table.interval95

    @property
    def rank(self) -> int:
        """Number of combinations that the measurements alone determine, without prior."""
        return self.identifiability.rank

    @property
    def gap(self) -> float:
        """Singular value of the last identifiable combination over the next; inf if none."""
        return self.identifiability.gap

    @property
    def unidentifiable(self) -> tuple[str, ...]:
        """Combinations that change no measured quantity, as "base1.x − platform1.x".

        They keep what they had, or follow the prior. Coefficients are in mm at the machine: an
        angle counts as its arc.
        """
        return self.identifiability.unidentifiable

    @property
    def rms(self) -> float:
        """√(Σ r²/N) over the N fitted points, mm.

        Unweighted; r is the distance of the measured from the predicted point, of a pose that of
        its position.
        """
        return self.misfit.rms

    @property
    def rms_before(self) -> float:
        """The same of the nominal machine, unknown frame and targets aligned with the readings."""
        return self.misfit.rms_before

    @property
    def holdout_rms(self) -> float:
        """`rms` of points that were held out; NaN where none were."""
        return self.holdout.rms

    @property
    def holdout_rms_before(self) -> float:
        """`rms_before` of points that were held out; NaN where none were."""
        return self.holdout.rms_before

    @property
    def holdout_expected(self) -> float:
        """What `holdout_rms` should be if noise and covariance are right; NaN if not known."""
        return self.holdout.expected

    @property
    def holdout_contradicts(self) -> bool:
        """Whether the held-out points contradict the fit: by chance, by rms and by median."""
        return self.holdout.contradicts

    @property
    def holdout_chance(self) -> float:
        """p-value of `holdout_rms`: small where fit, noise or covariance are wrong; else NaN."""
        return self.holdout.chance

    @property
    def holdout_outliers(self) -> tuple[int, ...]:
        """Held-out rows further off than expected, numbered in what was given."""
        return self.holdout.odd

    @property
    def holdout_unreached(self) -> str:
        """Which held-out rows failed and were left out, and why; empty where none."""
        return self.holdout.failures

    @property
    def holdout_off(self) -> FloatArray:
        """Distance of each held-out point from its prediction, mm; NaN where the row failed."""
        return self.holdout.off

    @property
    def holdout_off_before(self) -> FloatArray:
        """The same of the nominal machine."""
        return self.holdout.off_before

    @property
    def chi2_per_dof(self) -> float:
        """χ² per degree of freedom: about 1 if the noise is as stated; NaN without sigma."""
        return self.misfit.chi2_per_dof

    @property
    def dof(self) -> float:
        """Degrees of freedom: equations, those of the prior included, less parameters."""
        return self.misfit.dof

    @property
    def noise(self) -> tuple[float, ...]:
        """Estimated deviation of each set of measurements, mm; NaN where sigma was given.

        That of residuals: what a reading has of its own and what its pose shares, the model's error
        included. NaN, too, where no equations are left to show it.
        """
        return self.misfit.noise

    @property
    def component_noise(self) -> tuple[tuple[float, ...], ...]:
        """The same of each component, mm and rad.

        Components are told apart where the residuals call for it: lengths and angles, x y and z.
        """
        return self.misfit.component_noise

    @property
    def reading_noise(self) -> tuple[float, ...]:
        """What a single reading of each set has of its own, mm per coordinate."""
        return self.misfit.reading_noise

    @property
    def pose_noise(self) -> tuple[float, ...]:
        """What rows of one pose share beside it, mm per coordinate: pose and model errors."""
        return self.misfit.pose_noise

    @property
    def repeatability(self) -> float:
        """Scatter of repeats about their mean, mm per coordinate; NaN without repeats."""
        return self.repeats.repeatability

    @property
    def lack_of_fit(self) -> float:
        """What the model misses at a pose beyond that scatter, mm per coordinate."""
        return self.repeats.lack_of_fit

    @property
    def lack_of_fit_chance(self) -> float:
        """p-value of the F test of lack of fit: small where the model misses something."""
        return self.repeats.lack_of_fit_chance

    @property
    def observability(self) -> dict[str, float]:
        """Indices O1 … O5 of the scaled Jacobian, over the identifiable combinations."""
        return self.identifiability.observability

    @property
    def closure_rms(self) -> float:
        """How far the machine's own closures disagree at the poses found, mm of the actuators.

        NaN where poses follow from the actuators exactly: as many closures as free coordinates, and
        no `Measurements.actuator_sigma`.
        """
        return self.misfit.closure_rms

    @property
    def closure_rms_before(self) -> float:
        """The same of the nominal machine."""
        return self.misfit.closure_rms_before

    @property
    def actuator_noise(self) -> float:
        """Estimated deviation of what the actuators read, mm; NaN where it was stated."""
        return self.misfit.actuator_noise

    @property
    def redundancy(self) -> tuple[float, ...]:
        """Degrees of freedom left in each set, then in the closures where those are fitted.

        Equations less what poses and parameters took of them; a deviation estimated from r of them
        is itself good to 1/√(2 r) of it.
        """
        return self.misfit.redundancy

    @property
    def idle(self) -> int:
        """How many poses say nothing, for nothing is left when they are determined."""
        return self.misfit.idle

    @property
    def residuals(self) -> tuple[FloatArray, ...]:
        """Measured less predicted (N, k) of the fitted rows of each set, mm and rad."""
        return self.misfit.residuals

    @property
    def rows(self) -> IntArray:
        """Numbers of the fitted rows, counted through all sets from 0."""
        return self.misfit.rows

    @property
    def outliers(self) -> tuple[int, ...]:
        """Rows that the others contradict, numbered likewise."""
        return self.misfit.outliers

    @property
    def distances_before(self) -> Distances:
        """Rms, median and 95 % quantile of the nominal machine's distances to fitted points, mm."""
        return self.misfit.before

    @property
    def distances(self) -> Distances:
        """The same of the calibrated machine, and its rms without `outliers`."""
        return self.misfit.after

    @property
    def holdout_distances_before(self) -> Distances:
        """`distances_before` of the points held out."""
        return self.holdout.before

    @property
    def holdout_distances(self) -> Distances:
        """`distances` of the points held out; outliers are `holdout_outliers`."""
        return self.holdout.after

    @property
    def at_bounds(self) -> tuple[str, ...]:
        """Parameters that ended at a bound."""
        return self.table.at_bounds

    @property
    def converged(self) -> bool:
        """Whether the least squares converged."""
        return self.search.converged

    @property
    def evaluations(self) -> int:
        """How often the forward kinematics of all rows were solved."""
        return self.search.evaluations

    @property
    def history(self) -> tuple[float, ...]:
        """Misfit rms in mm at the start and after each step of the search."""
        return self.search.history

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
        """All attributes by name, as JSON files hold them."""
        return {name: getattr(self, name) for name in _NAMES}
