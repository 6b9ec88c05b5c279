"""The flat result of a calibration: each number is declared where it is computed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import BoolArray, FloatArray
from pkmcal.fitted.datum import NO_DATUM, Datum
from pkmcal.fitted.fit import Fit
from pkmcal.fitted.fit_statistics import Identifiability, Misfit, ParameterTable, Repeats
from pkmcal.fitted.holdout import HeldOut
from pkmcal.fitted.slack import SlackCable
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


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Solution(ParameterTable, Identifiability, Misfit, Repeats, HeldOut):
    """A solved calibration: every number that was found, each under one name.

    The base classes are what single functions of `fitted/` return, with their documentation;
    `Solution(**vars(table), **vars(misfit), …)` sets all of them once.

    Attributes
    ----------
    robot : Robot or SerialArm
        The machine with the identified geometry; that of the last session.
    fit : Fit
        The least-squares problem itself, for reports and the bootstrap.
    converged : bool
        Whether the least squares converged.
    evaluations : int
        How often the forward kinematics of all rows were solved.
    history : tuple of float
        Misfit rms in mm at the start and after each step of the search.
    prior_test : PriorTest or None
        Whether the measurements contradict the prior, where there is one.
    robots : mapping of str to Robot or SerialArm
        The machine of each session, those that were held out too; empty without `per_session`.
    datum : Datum
        Numbers that are held because they only say where frames lie.
    dropped : tuple of int
        Rows that were left out, by their numbers.
    dropped_names : str
        These rows by lines of files, poses and targets.
    slack : tuple of SlackCable
        Readings of cables that the others show to be slack, the longest first: left out, or with
        ``slack="keep"`` fitted.
    """

    robot: Robot | SerialArm
    fit: Fit
    converged: bool
    evaluations: int
    history: tuple[float, ...]
    prior_test: PriorTest | None = None
    robots: Mapping[str, Robot | SerialArm] = field(default_factory=dict)
    datum: Datum = NO_DATUM
    dropped: tuple[int, ...] = ()
    dropped_names: str = ""
    slack: tuple[SlackCable, ...] = ()

    @property
    def loss(self) -> str:
        """The loss that was asked for."""
        return self.fit.estimate.state.loss.name

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
    def left_out(self) -> str:
        """Which rows were left out as asked, in words; "" where none were."""
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
        """All attributes by name, as JSON files hold them."""
        return {name: getattr(self, name) for name in _NAMES}
