"""The parts of an `Identification`, and the flat names by which users read them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import FloatArray, IntArray
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

_NAMES = (  # of `to_dict`, in the order in which they are written
    "robot",
    "free",
    "units",
    "values",
    "start",
    "stderr",
    "covariance",
    "rank",
    "gap",
    "unidentifiable",
    "gauges",
    "rms",
    "rms_before",
    "holdout_rms",
    "holdout_rms_before",
    "holdout_expected",
    "holdout_unreached",
    "holdout_off",
    "holdout_off_before",
    "closure_rms",
    "closure_rms_before",
    "chi2_per_dof",
    "dof",
    "noise",
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
    "at_bounds",
    "converged",
    "evaluations",
    "history",
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

        Scaled by the residual only where no sigma was given.
        """
        return self.table.covariance

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
    def gauges(self) -> tuple[str, ...]:
        """What readings of actuators alone leave open by their nature, in words.

        Where the base stands, the common scale; these combinations are not in `unidentifiable`.
        """
        return self.identifiability.gauges

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
        """What `holdout_rms` should be if noise and covariance are right."""
        return self.holdout.expected

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
        """Estimated deviation of each set of measurements, mm; NaN where sigma was given."""
        return self.misfit.noise

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
