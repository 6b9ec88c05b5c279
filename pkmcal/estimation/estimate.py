"""An estimate: what one solve took as given, and the equations with their statistics there."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.identifiability import Decomposed, Directions
from pkmcal.estimation.loss import LossName
from pkmcal.estimation.pose_system import Shares
from pkmcal.result import ReadOnly

LEAST_NOISE = 1e-9  # mm; what is left of measurements without noise


@dataclass(frozen=True, eq=False)
class IterationState(ReadOnly):
    """Fixed quantities of one least-squares solve, revised before the next.

    Attributes
    ----------
    noise : ndarray (G,)
        Factor on the stated deviations of each group of equations (the sets; where poses have
        unknowns the lengths and angles of each, then the actuators); where none is stated, the
        deviation in mm, of angles that of their arc.
    loss : {"linear", "huber", "cauchy"}
        How rows count.
    width : ndarray (B,)
        Factor on the limit of the loss of each block: see `loss.limits`.
    measured : Directions
        Identifiable from the measurements alone.
    determined : Directions
        Identifiable from measurements and prior.
    fitted : Directions
        Determined to `worst` or better; the rest is kept at its start.
    worst : float
        A standard deviation, mm: the machine's size, or less where searches did not end.
    at_start : tuple of Decomposed
        Combinations at the start, without and with the prior, at this noise.
    start_triangle : ndarray (k, n)
        R of the scaled, whitened Jacobian there.
    first_freedom : ndarray (G,) or None
        Degrees of freedom at equal noise of all groups, where poses have unknowns and some noise
        has been estimated.
    """

    noise: FloatArray
    loss: LossName
    width: FloatArray
    measured: Directions
    determined: Directions
    fitted: Directions
    worst: float
    at_start: tuple[Decomposed, Decomposed]
    start_triangle: FloatArray
    first_freedom: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Estimate(ReadOnly):
    """The equations and their statistics at the solution.

    All of it is of the M equations that are left when poses have taken their part: noise is 1 in
    each, and those of different poses are independent. Nothing else of poses and closures is to be
    known to judge a fit: `RowBlocks.pose_of_block` says which
    blocks are of one pose.

    Attributes
    ----------
    evaluation : Evaluation
        The equations there.
    state : IterationState
        Noise, loss and identifiable directions.
    residual : ndarray (M,)
        Measured less predicted, whitened.
    design : ndarray (M, n)
        Derivative of the predicted values, whitened, by the combinations of `basis`. It is the
        Jacobian, which is not kept beside it: `change` is what that says.
    triangle : ndarray (k, n)
        R of a QR factorisation of the scaled, whitened Jacobian, k = min(M, n).
    weights : ndarray (B,)
        Of each block (`Equations.components`); 1 unless the loss is robust.
    prior : ndarray (p, n)
        A row for each prior, scaled, in units of its deviation.
    basis : ndarray (n, n)
        Scaled combinations at right angles to each other: those of `half`, and those that are not
        determined.
    shares : Shares
        Of each group, the sum of squared residuals and what it says of the noise: `pose_system`.
    converged, evaluations, history
        Those of the `Estimator`.
    """

    evaluation: Evaluation
    state: IterationState
    residual: FloatArray
    design: FloatArray
    triangle: FloatArray
    weights: FloatArray
    prior: FloatArray
    basis: FloatArray
    shares: Shares
    converged: bool
    evaluations: int
    history: tuple[float, ...]

    @property
    def half(self) -> FloatArray:
        """Scaled combinations (n, r) whose covariance is 1, the best determined first."""
        return self.basis[:, : self.state.determined.rank]

    @property
    def covariance(self) -> FloatArray:
        """Scaled (n, n); nothing along combinations that are not determined."""
        matrix: FloatArray = self.half @ self.half.T
        return matrix

    def change(self, steps: FloatArray, design: FloatArray | None = None) -> FloatArray:
        """Differentiate whitened predicted values (M, ...) by scaled parameters (n, ...).

        `design` may be turned rows (k, n) in place of its own.
        """
        inverse = (self.basis / (self.basis**2).sum(axis=0)).T
        found: FloatArray = (self.design if design is None else design) @ (inverse @ steps)
        return found

    @property
    def freedom(self) -> FloatArray:
        """Equations of each group less the poses and parameters they went into, (G,)."""
        return self.shares[1]

    @property
    def exact_freedom(self) -> float:
        """Degrees of freedom of groups that are met exactly, beside others that are not."""
        squares, freedom, _ = self.shares
        exact = self.state.noise <= LEAST_NOISE
        return 0.0 if exact.all() else float(np.maximum(freedom - squares, 0.0)[exact].sum())

    def with_noise(self, state: IterationState, factor: float) -> Estimate:
        """The estimate of a linear loss where all noise is `factor` times what it was.

        Of readings alone, unless `factor` is 1: neither prior nor closures go with it.
        """
        squares, freedom, information = self.shares
        return replace(
            self,
            state=state,
            residual=self.residual / factor,
            triangle=self.triangle / factor,
            basis=self.basis * factor,
            shares=(squares / factor**2, freedom, information),
        )
