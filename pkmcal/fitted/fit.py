"""A solved calibration: what was fitted, where it started, where it ended."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.estimate import Estimate
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.identifiability import decompose
from pkmcal.estimation.linear_model import solved
from pkmcal.estimation.parameters import Parameters
from pkmcal.estimation.uncertainty import Uncertainty, uncertainty
from pkmcal.fitted.datum import NO_DATUM, Datum
from pkmcal.fitted.held_numbers import with_considered
from pkmcal.fitted.slack import Cell
from pkmcal.statistics.covariance import CovarianceRule
from pkmcal.statistics.linear_fit import LinearFit

_LEAST = 1e-6  # share of a combination that is more than rounding


@dataclass(frozen=True, eq=False)
class Fit:
    """The least-squares problem behind an `Identification`, and its solution.

    Attributes
    ----------
    aligned : Evaluation
        Where the search began, poses following from the actuators: at the nominal machine, unknown
        frames aligned with the readings.
    estimator : Estimator
        The equations of the fitted rows, and the search.
    estimate : Estimate
        What was fitted at the solution, with its statistics. On machines where every row has a
        pose of its own the residual equations there are those that are left of all.
    slack : tuple of Cell
        Readings of slack cables that are left out.
    datum : Datum
        Numbers that are held because they only say where frames lie.
    classes : ndarray of int (M,) or None
        Classes of equations whose noise was told apart.
    rule : {"auto", "classical", "cluster"}
        Whether rows of a pose are taken to share errors.
    """

    aligned: Evaluation
    estimator: Estimator
    estimate: Estimate
    slack: tuple[Cell, ...] = ()
    datum: Datum = NO_DATUM
    classes: IntArray | None = None
    rule: CovarianceRule = "auto"

    @cached_property
    def start(self) -> Evaluation:
        """The equations at the nominal machine, all unknowns of the readings fitted to it."""
        return self._exact.of_machine_alone(self.aligned)

    @cached_property
    def _exact(self) -> Equations:
        """The equations with poses that follow from the actuators exactly."""
        return self.estimator.equations.with_exact_actuators()

    @cached_property
    def before(self) -> Evaluation:
        """The fitted equations at the numbers of `start`: where poses have unknowns, these fitted.

        The search may begin elsewhere, where frames and targets are found one after the other.
        """
        begun, theta = self.estimator.start, self.start.theta
        if np.array_equal(theta, begun.theta):
            return begun
        return self.estimator.equations.at(theta, near=begun)

    @cached_property
    def equations(self) -> Equations:
        """The residual equations of the fitted rows, poses following from the actuators."""
        if self._exact is self.estimator.equations:
            return self._exact
        return self._exact.with_tension(self.estimate.evaluation.states.tension)

    @cached_property
    def end(self) -> Evaluation:
        """The equations at the solution."""
        solution = self.estimate.evaluation
        if self.equations is self.estimator.equations:
            return solution
        return self.equations.at(solution.theta, near=solution)

    @cached_property
    def linear(self) -> LinearFit:
        """The linear model at the solution."""
        return solved(self.estimator, self.estimate)

    @cached_property
    def uncertainty(self) -> Uncertainty:
        """Uncertainty of the numbers; `Uncertainty.equations` are those that were fitted."""
        sure = uncertainty(self.estimator, self.estimate, self.linear, self.rule, self.classes)
        stated = self.estimator.equations.parameters.asked.uncertainty
        return with_considered(sure, self.estimate.evaluation, stated)

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the reported parameters (n, n), along determined combinations, mm and rad.

        inf where the noise is not known.
        """
        return self.uncertainty.matrix

    @property
    def parameters(self) -> Parameters:
        """The parameter vector."""
        return self.equations.parameters

    def undetermined(self) -> FloatArray:
        """Scaled combinations (n, d) that are not determined, at the identified geometry.

        `Estimate.state` has them at the nominal machine; they turn with its errors.
        """
        _, basis = decompose(self.estimate.triangle, self.estimate.prior)
        return basis[:, self.estimate.state.determined.rank :]

    def machine_combinations(self) -> int:
        """Return the number of determined combinations that nuisance parameters do not explain.

        Of the measurements alone, whatever a prior says.
        """
        basis = self.estimate.state.measured.identifiable
        chosen = self.parameters
        beside = np.arange(len(chosen)) >= chosen.geometry.stop
        along = np.linalg.svd(basis[beside | chosen.uncertain], compute_uv=False)
        return int(basis.shape[1] - np.count_nonzero(along > _LEAST))
