"""A solved calibration: what was fitted, where it started, where it ended."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.estimate import Estimate
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.identifiability import decompose
from pkmcal.estimation.parameters import Parameters
from pkmcal.estimation.uncertainty import Uncertainty

_LEAST = 1e-6  # share of a combination that is more than rounding


@dataclass(frozen=True, eq=False)
class Fit:
    """The least-squares problem behind an `Identification`, and its solution.

    Attributes
    ----------
    equations : Equations
        The residual equations of the fitted rows, poses following from the actuators.
    start, end : Evaluation
        They at the nominal machine, an unknown frame aligned with the readings, and at the
        solution.
    estimate : Estimate
        What was fitted at the solution, with its statistics. On machines where every row has a
        pose of its own the residual equations there are those that are left of all.
    uncertainty : Uncertainty
        How sure it is; `Uncertainty.equations` are those that were fitted.
    """

    equations: Equations
    start: Evaluation
    end: Evaluation
    estimate: Estimate
    uncertainty: Uncertainty

    @property
    def covariance(self) -> FloatArray:
        """Of the reported parameters (n, n) along determined combinations, mm and rad.

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
        """How many combinations are determined that nuisance parameters do not explain.

        Of the measurements alone, whatever a prior says.
        """
        basis = self.estimate.state.measured.identifiable
        chosen = self.parameters
        beside = np.arange(len(chosen)) >= chosen.geometry.stop
        along = np.linalg.svd(basis[beside | chosen.uncertain], compute_uv=False)
        return int(basis.shape[1] - np.count_nonzero(along > _LEAST))
