"""The parts of an `Identification`, and the flat names by which users read them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import BoolArray, FloatArray
from pkmcal.calibration.datum import NO_DATUM, Datum
from pkmcal.calibration.fit import Fit
from pkmcal.calibration.fit_statistics import (
    Identifiability,
    Misfit,
    ParameterTable,
    Repeats,
    SearchRecord,
)
from pkmcal.calibration.holdout import HeldOut
from pkmcal.calibration.misfit_names import MisfitNames
from pkmcal.calibration.slack import SlackCable
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
    "datum",
    "expansion",
    "unidentifiable",
    "gauges",
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
    "tension_noise",
    "tension_rms",
    "redundancy",
    "idle",
    "repeatability",
    "lack_of_fit",
    "lack_of_fit_chance",
    "observability",
    "residuals",
    "rows",
    "outliers",
    "dropped",
    "holdout_dropped",
    "slack",
    "distances_before",
    "distances",
    "holdout_distances_before",
    "holdout_distances",
    "at_bounds",
    "converged",
    "evaluations",
    "history",
    "moved",
    "sessions",
    "robots",
    "holdout_parameters",
    "law_tests",
    "drift",
    "measuring_order",
    "warnings",
)


@dataclass(frozen=True, eq=False, repr=False)
class Parts(MisfitNames):
    """What the modules of a calibration hand over, under flat names as well.

    Attributes
    ----------
    robot : Robot or SerialArm
        The machine with the identified geometry; that of the last session.
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
    robots : mapping of str to Robot or SerialArm
        The machine of each session, those that were held out too; empty without `per_session`.
    datum : Datum
        Numbers that are held because they only say where frames lie.
    dropped : tuple of int
        Rows that were left out, by their numbers.
    dropped_names : str
        The same by lines of files, poses and targets.
    slack : tuple of SlackCable
        Readings of cables that the others show to be slack, the longest first: left out, or with
        ``slack="keep"`` fitted.
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
    robots: Mapping[str, Robot | SerialArm] = field(default_factory=dict)
    datum: Datum = NO_DATUM
    dropped: tuple[int, ...] = ()
    dropped_names: str = ""
    slack: tuple[SlackCable, ...] = ()

    @property
    def sessions(self) -> tuple[str, ...]:
        """The fitted sessions, in the order of their first rows; empty without `per_session`."""
        return self.fit.parameters.sessions

    @property
    def read(self) -> BoolArray:
        """Of which fitted rows (N,) more is known than where the actuators were."""
        read: BoolArray = self.fit.equations.table.count > 0
        return read

    @property
    def expansion(self) -> dict[str, float]:
        """Coefficients of thermal expansion, 1/K, by part; empty where none were stated."""
        grows = self.fit.equations.datasets[0].expansion
        return {} if grows is None else dict(grows.given)

    @property
    def holdout_dropped(self) -> tuple[int, ...]:
        """Rows of measurements that were held out as a whole, left out as outliers."""
        return self.holdout.dropped

    @property
    def left_out(self) -> str:
        """Which rows were left out as asked, in words; "" where none were."""
        count = len(self.dropped) + len(self.holdout_dropped)
        names = ", ".join(filter(None, (self.dropped_names, self.holdout.dropped_names)))
        many = f"{count} rows were" if count > 1 else "1 row was"
        return f"{many} left out, as asked: {names}" if count else ""

    @property
    def holdout_parameters(self) -> dict[str, dict[str, float]]:
        """Numbers that were found of held-out sessions, as `Identification.parameters`."""
        own = self.holdout.own.items()
        return {name: {"value": value, "stderr": stderr} for name, (value, stderr) in own}

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
    def gauges(self) -> tuple[str, ...]:
        """What readings of actuators alone leave open by their nature, in words.

        Where the base stands, the common scale; these combinations are not in `unidentifiable`.
        """
        return self.identifiability.gauges

    @property
    def observability(self) -> dict[str, float]:
        """Indices O1 … O5 of the scaled Jacobian, over the identifiable combinations."""
        return self.identifiability.observability

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
