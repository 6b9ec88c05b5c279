"""The estimator: noise, rank and covariance around the least squares."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray
from pkmcal.estimation.elimination import Shares
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.estimate import LEAST_NOISE, Estimate, IterationState
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.identifiability import (
    Decomposed,
    Measured,
    decompose,
    directions,
    measured,
)
from pkmcal.estimation.least_squares import Search, SingularError, Trail
from pkmcal.estimation.loss import Loss, LossName
from pkmcal.exceptions import FitError
from pkmcal.statistics import prior_test
from pkmcal.statistics.linear_fit import (
    column_basis,
    multiply_in_place,
    triangle,
    unit_basis,
)
from pkmcal.statistics.robust_scale import median_ratio

_ROUNDS = 60  # of estimating noise and unidentifiable combinations again
_LESS = 0.1  # of the deviation to which combinations are fitted, after a search without an end
_LEAST_WORST = 5e-3  # of the machine's size: where that is not for want of measurements
_LEAST_FALL = 0.1  # of a mean square, which a step of scoring does not go below
LEAST_FREEDOM = 0.5  # degrees of freedom from which the noise can be estimated
FEW = 5.0  # below which residuals hardly show it
LEAST_REDUNDANCY = 2.0  # the same of one group of several that share poses

Known = tuple[FloatArray, FloatArray]  # a noise (G,), and R of the Jacobian with it


class Estimator:
    """Weighted least squares, iterated with the noise and rank that they imply.

    Parameters
    ----------
    equations : Equations
        What is fitted.
    start : Evaluation
        Where the search starts, and what unidentifiable combinations keep.
    loss : str
        A name in `loss.LIMITS`.
    """

    def __init__(self, equations: Equations, start: Evaluation, loss: LossName) -> None:
        self.equations, self.start, self.loss = equations, start, loss
        self.search = Search(equations, start)
        self.scale = self.search.scale
        self._priors = len(self.search.prior(start.theta))
        self.unstated = equations.blocks.unstated

    @property
    def least_freedom(self) -> float:
        """Degrees of freedom from which the noise of a group is estimated."""
        return LEAST_REDUNDANCY if self.equations.machines.unknowns else LEAST_FREEDOM

    def unknown_noise(self, estimate: Estimate) -> BoolArray:
        """Groups (G,) whose noise is neither stated nor can be estimated: too little is left.

        Where poses have unknowns it is what is left at equal noise of all groups: one that turns
        out small beside the others has little left, but is known to be small.
        """
        first = estimate.state.first_freedom
        freedom = estimate.freedom if first is None else first
        return self.unstated & (freedom < self.least_freedom)

    def solve(self, near: Evaluation | None = None) -> Estimate:
        """Estimate the parameters and, where no sigma is stated, the noise of each group.

        The search begins at `near`, or else at the start.
        """
        compressed = self._compressed()
        if compressed is not None:
            return self._of_compressed(compressed.solve(near))
        size = self.start.robot.length
        noise, freedom, known = self._first_noise()
        state = self._state(noise, self._first_loss(), size, known=known)
        state = replace(state, first_freedom=freedom)
        if not state.fitted.rank:
            names = ", ".join(self.equations.parameters.names)
            raise FitError(f"they depend on none of {names}")
        u, trail = np.zeros(len(self.scale)), self.search.begin()
        if near is not None:
            trail = replace(trail, near=near)
            u = (near.theta - self.start.theta) / self.scale
        risen: set[tuple[int, int]] = set()
        for _ in range(_ROUNDS):
            # rows that nothing contradicts pin what is not determined
            kept = state.fitted.unidentifiable
            pins = state.fitted.singular[0] * kept.T
            try:
                u, trail = self.search.best(trail, u, state.noise, state.loss, pins)
                u = u - kept @ (kept.T @ u)
                trail = self.search.at(trail, u, state.noise)
                estimate = self._estimate(trail, state)
                fewer = None if trail.converged else self._fewer(state, self._revised(estimate))
            except SingularError:
                fewer = self._fewer(state, state)
                if fewer is None:
                    raise
            if fewer is not None:
                state, u = fewer, np.zeros(len(self.scale))
                trail = replace(trail, near=self.start)
                continue
            if self.equations.machines.unknowns and state.first_freedom is None:
                state = replace(state, first_freedom=estimate.freedom)
                estimate = replace(estimate, state=state)
            revised = self._revised(estimate)
            rise = state.fitted.rank, revised.fitted.rank
            if rise in risen:
                break  # what is fitted decides what can be: the fewer combinations are kept
            if rise[0] < rise[1]:
                risen.add(rise)
            settled = self._settled(state, revised)
            state = revised
            if settled:
                break
        factor = self._common_factor(estimate.state, state)
        if factor is None:
            trail = self.search.at(trail, u, state.noise)
            estimate = self._estimate(trail, state, estimate)
        else:
            estimate = estimate.with_noise(state, factor)
        self.search.end(trail)
        return estimate

    def _compressed(self) -> Estimator | None:
        """The estimator by fewer equations, with which all is as with these; None: there is none.

        Not where a robust loss weighs rows of a lot one by one.
        """
        fewer = self.equations.compressed
        by_rows = self.loss != "linear" and not self.equations.machines.unknowns
        return None if fewer is None or by_rows else Estimator(fewer, self.start, self.loss)

    def _of_compressed(self, found: Estimate) -> Estimate:
        """The estimate by all equations where that by fewer ones has come to."""
        blocks, state = self.equations.blocks, found.state
        width, weights = state.loss.width, found.weights
        if not self.equations.machines.unknowns:  # rows, not poses
            width = weights = np.ones(len(blocks.components))
        loss = Loss(state.loss.name, blocks.components, width)
        evaluation = self.equations.kept(found.evaluation)
        design = self.search.own_jacobian(evaluation, state.noise)
        multiply_in_place(design, found.basis)
        return replace(
            found,
            evaluation=evaluation,
            state=replace(state, loss=loss),
            residual=self.equations.residual(evaluation, state.noise),
            design=design,
            weights=weights,
        )

    # between the least squares ------------------------------------------------------------------

    def _loss(self, name: LossName, width: FloatArray) -> Loss:
        blocks = self.equations.blocks
        return Loss(name, blocks.components, width[blocks.family_of_block], blocks.stands_for)

    def _first_noise(self) -> tuple[FloatArray, FloatArray | None, Known | None]:
        """1 mm where it is not stated; with a prior what the data alone show at the start.

        Noise and prior could else excuse each other: much of one leaves little of the other.
        Where the groups' noise is then not equal, also the `IterationState.first_freedom`. And R at
        the start, where it was made.
        """
        ones = np.ones(len(self.unstated))
        if not self._priors or self.loss != "linear":
            return ones, None, None
        jacobian = self.search.jacobian(self.start, ones)
        residual = self.equations.residual(self.start, ones)
        factor = triangle(jacobian)
        alone = self._alone(self.start, ones, jacobian, factor, residual)
        if alone is None:
            return ones, None, (ones, factor)
        freedom = alone[1] if self.equations.machines.unknowns else None
        noise = self._kept(ones * self._scored(alone)[0], ones)
        grown = common(noise)
        if grown is not None:
            jacobian /= grown
            self.search.keep(self.start, noise, jacobian)
        return noise, freedom, (ones, factor)

    def _alone(
        self,
        evaluation: Evaluation,
        noise: FloatArray,
        jacobian: FloatArray,
        factor: FloatArray,
        residual: FloatArray,
    ) -> Shares | None:
        """Return the residual of each group that no parameters explain, without the prior's help.

        `factor` is one of the Jacobian. None where too few equations are left to show it.
        """
        taken = column_basis(jacobian, factor)
        left = residual - taken @ (taken.T @ residual)
        every = np.ones(len(self.equations.blocks.components))
        shares = self.equations.by_groups(evaluation, noise, every, left, taken)
        freedom = shares[1]
        few = (freedom[self.unstated] < LEAST_FREEDOM).any()
        return None if few or freedom.sum() < prior_test.LEAST_FREEDOM else shares

    def _kept(self, noise: FloatArray, stated: FloatArray) -> FloatArray:
        """Estimated noise of groups where none is stated, else what multiplies the stated one."""
        return np.where(self.unstated, np.maximum(noise, LEAST_NOISE), stated)

    def _first_loss(self) -> Loss:
        """Limits wide enough for the nominal machine, and no wider than gross errors allow."""
        ones = np.ones(len(self.unstated))
        if self.loss == "linear":
            return self._loss("linear", ones)
        medians = self._medians(self.equations.residual(self.start, ones))
        return self._loss(self.loss, np.maximum(np.sqrt(medians), 1.0))

    def _medians(self, residual: FloatArray) -> FloatArray:
        """Variance (F,) that whitened residuals (M,) of each family show by their median."""
        blocks = self.equations.blocks
        squares, components = blocks.squares(residual), blocks.stands_for
        family_of = blocks.family_of_block
        return np.array([
            median_ratio(squares[family_of == f], components[family_of == f])
            for f in range(int(family_of.max()) + 1)
        ])  # fmt: skip

    def _state(
        self,
        noise: FloatArray,
        loss: Loss,
        worst: float,
        last: Estimate | None = None,
        fitted: bool = False,
        known: Known | None = None,
    ) -> IterationState:
        """Split the directions for this noise, before or after a fit; `last` is the last estimate.

        `worst` is that of `IterationState`; `known` is R at the start for another noise.
        """
        size = self.start.robot.length
        kept, noise_known = worst, fitted or not self.unstated.any() or worst < size
        worst = worst if noise_known else np.inf
        first, factor = self._at_start(noise, None if last is None else last.state, known)
        now: tuple[Measured | None, Measured | None] = (None, None)
        if fitted and last is not None:
            known = last.state.noise, last.triangle
            data, whole = self._parts(
                last.evaluation, self._triangle(last.evaluation, noise, known)
            )
            alone = measured(*data)
            now = alone, alone if whole is data else measured(*whole)
        by_data = directions(first[0], now[0], size)
        determined = directions(first[1], now[1], size)
        wanted = directions(first[1], now[1], size, worst)
        freedom = None if last is None else last.state.first_freedom
        return IterationState(
            noise, loss, by_data, determined, wanted, kept, first, factor, freedom
        )

    def _at_start(
        self, noise: FloatArray, last: IterationState | None, known: Known | None
    ) -> tuple[tuple[Decomposed, Decomposed], FloatArray]:
        """Decompose the start, and return its R.

        `last` has both for another noise, `known` has R alone.
        """
        if last is not None:
            known = last.noise, last.start_triangle
            if (noise == last.noise).all():
                return last.at_start, last.start_triangle
        factor = self._triangle(self.start, noise, known)
        grown = None if last is None else common(noise / last.noise)
        if last is None or grown is None or self._priors:
            data, whole = self._parts(self.start, factor)
            alone = decompose(*data)
            return (alone, alone if whole is data else decompose(*whole)), factor
        singular, basis = last.at_start[0]
        return ((singular / grown, basis),) * 2, factor

    def _parts(
        self, evaluation: Evaluation, factor: FloatArray
    ) -> tuple[tuple[FloatArray, ...], tuple[FloatArray, ...]]:
        """R, in parts below each other, without and with the prior; without one the same object."""
        data: tuple[FloatArray, ...] = (factor,)
        if not self._priors:
            return data, data
        prior, chosen = self.search.prior(evaluation.theta), self.equations.parameters
        if len(chosen.spread):  # what is fixed but for that is known without a prior, too
            data = factor, prior[chosen.prior_of_uncertain]
        return data, (factor, prior)

    def _triangle(
        self, evaluation: Evaluation, noise: FloatArray, known: Known | None
    ) -> FloatArray:
        """R of the Jacobian, made of what is known of it where all noise has grown alike."""
        grown = None if known is None else common(noise / known[0])
        if known is None or grown is None:
            return self.search.triangle(evaluation, noise)
        factor: FloatArray = known[1] / grown
        return factor

    def _fewer(self, state: IterationState, revised: IterationState) -> IterationState | None:
        """The state to begin again with after a search without an end; None where there is none.

        It went along what is hardly determined, far from any machine or into a singular one: less
        of it is fitted. `revised` has the noise that the search has shown.
        """
        worst = state.worst
        while worst > _LEAST_WORST * self.start.robot.length:
            worst *= _LESS
            fewer = self._state(revised.noise, state.loss, worst)
            if 0 < fewer.fitted.rank < state.fitted.rank:
                return replace(fewer, first_freedom=revised.first_freedom)
        return None

    def _revised(self, estimate: Estimate) -> IterationState:
        """Estimate unstated noise and limits of the loss, and split the directions again."""
        factor, of_families = self._spread(estimate)
        noise = self._kept(estimate.state.noise * factor, estimate.state.noise)
        # while the model is still far off, outliers are units further off than most
        family_of = self.equations.blocks.family_of_group
        families = range(len(of_families))
        none_stated = np.array([bool(self.unstated[family_of == f].all()) for f in families])
        width = np.where(none_stated, 1.0, np.maximum(of_families, 1.0))
        loss = self._loss(self.loss, width)
        return self._state(noise, loss, estimate.state.worst, estimate, fitted=True)

    def _spread(self, estimate: Estimate) -> tuple[FloatArray, FloatArray]:
        """Deviation of the whitened residuals of each group (G,), and of each family (F,)."""
        if self.loss != "linear":
            return self._scored(estimate.shares, self._medians(estimate.residual))
        alone = None
        if self._priors:
            alone = self._alone(
                estimate.evaluation,
                estimate.state.noise,
                estimate.design,
                estimate.triangle @ estimate.basis,
                estimate.residual,
            )
        return self._scored(estimate.shares if alone is None else alone)

    def _scored(
        self, shares: Shares, medians: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Deviation that the shares show of each group (G,), and of each family (F,).

        1 without freedom. `medians` (F,) are the variances of families that medians show, of
        robust losses.
        """
        family_of = self.equations.blocks.family_of_group
        squares, freedom, information = shares
        factor, of_families = np.ones(len(freedom)), np.ones(int(family_of.max()) + 1)
        for f in range(len(of_families)):
            mine = np.flatnonzero(family_of == f)
            left = float(freedom[mine].sum())
            if left < LEAST_FREEDOM:
                continue
            variance = together = float(squares[mine].sum()) / left
            if medians is not None:
                of_family = self.equations.blocks.family_of_block == f
                count = float(self.equations.blocks.stands_for[of_family].sum())
                variance = float(medians[f]) * count / left
            of_families[f] = np.sqrt(variance)
            known = mine[self.unstated[mine] & (freedom[mine] >= self.least_freedom)]
            if len(mine) == 1:
                known = mine
            # a step of Fisher's scoring of the restricted likelihood: of one group, its mean square
            excess = np.linalg.solve(
                information[np.ix_(known, known)], squares[known] - freedom[known]
            )
            common = variance / together if together > 0 else 1.0
            least = _LEAST_FALL * squares[known] / freedom[known]
            factor[known] = np.sqrt(common * np.maximum(1.0 + excess, least))
        return factor, of_families

    def _settled(self, old: IterationState, new: IterationState) -> bool:
        if old.fitted.rank != new.fitted.rank:
            return False
        if self.loss == "linear" and not self._priors and len(self.unstated) == 1:
            return True  # the noise does not move the solution
        if not np.allclose(old.noise, new.noise, rtol=1e-3, atol=LEAST_NOISE):
            return False
        return self.loss == "linear" or np.allclose(old.loss.width, new.loss.width, rtol=1e-3)

    def _common_factor(self, old: IterationState, new: IterationState) -> float | None:
        """Return the common factor of all groups' noise, as if nothing else distinguished a fit."""
        factor = common(new.noise / old.noise)
        if self.loss != "linear" or old.determined.rank != new.determined.rank:
            return None
        alone = not (self._priors or self.equations.machines.unknowns)
        return factor if factor == 1.0 or alone else None

    def scaled_triangle(self, evaluation: Evaluation) -> FloatArray:
        """R of the scaled Jacobian, not whitened: mm per mm, angles as their arc.

        Where poses have unknowns it is that of what is left of all equations, whitened as stated.
        """
        if self.equations.machines.unknowns:
            fewest = Search(self.equations.fewest, self.start)
            return fewest.triangle(evaluation, np.ones(len(self.unstated)))
        arcs = self.equations.mm
        factor = np.zeros((0, len(self.scale)))
        for _, parts in self.equations.prediction.derivatives(evaluation):
            for i, rows, part in parts:
                part *= arcs[i][:, None] * self.scale
                factor = triangle(factor, self.equations.whitening.stacked(part, i, rows))
        return factor

    def _estimate(
        self, trail: Trail, state: IterationState, last: Estimate | None = None
    ) -> Estimate:
        """The statistics where a search has come to; `last` are those for another noise."""
        evaluation = trail.here
        linear = self.loss == "linear"
        residual = self.equations.residual(evaluation, state.noise)
        weights = state.loss.weights(residual)
        root = np.sqrt(np.repeat(weights, self.equations.blocks.components))
        same = linear and last is not None and last.evaluation is evaluation
        grown = common(state.noise / last.state.noise) if same and last is not None else None
        if grown is None or last is None:
            design = self.search.own_jacobian(evaluation, state.noise)
            factor = triangle(design)
        else:
            factor = last.triangle / grown
        weighted = factor if linear else triangle(root[:, None] * design)
        prior = self.search.prior(evaluation.theta)
        half = unit_basis(weighted, prior, state.determined.identifiable)
        basis = np.hstack([half, state.determined.unidentifiable])
        if grown is None or last is None:
            multiply_in_place(design, basis)
        else:
            design = last.change(basis / grown)
        taken = design[:, : state.fitted.rank]
        shares = self.equations.by_groups(
            evaluation,
            state.noise,
            weights,
            root * residual,
            taken if linear else root[:, None] * taken,
        )
        return Estimate(
            evaluation,
            state,
            residual,
            design,
            factor,
            weights,
            prior,
            basis,
            shares,
            trail.converged,
            trail.evaluations,
            trail.history,
        )


def common(factors: FloatArray) -> float | None:
    """Return the factor (G,) of all groups; None where they have different ones."""
    first = float(factors[0])
    return first if (factors == first).all() else None
