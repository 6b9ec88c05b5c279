"""The noise and the rank around the least squares: these are iterated with them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray
from pkmcal.estimation.derivatives import derivatives
from pkmcal.estimation.estimate import LEAST_NOISE, Estimate, IterationState
from pkmcal.estimation.estimator import Estimator, SingularError
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.iteration_state import Known, common, state_for
from pkmcal.estimation.loss import limits
from pkmcal.estimation.loss import weights as weights_of
from pkmcal.estimation.pose_system import Shares
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


def least_freedom(estimator: Estimator) -> float:
    """Degrees of freedom from which the noise of a group is estimated."""
    return LEAST_REDUNDANCY if estimator.equations.machines.unknowns else LEAST_FREEDOM


def unknown_noise(estimator: Estimator, estimate: Estimate) -> BoolArray:
    """Groups (G,) whose noise is neither stated nor can be estimated: too little is left.

    Where poses have unknowns it is what is left at equal noise of all groups: one that turns
    out small beside the others has little left, but is known to be small.
    """
    first = estimate.state.first_freedom
    freedom = estimate.freedom if first is None else first
    return estimator.unstated & (freedom < least_freedom(estimator))


def solve(estimator: Estimator, near: Evaluation | None = None) -> Estimate:
    """Estimate the parameters and, where no sigma is stated, the noise of each group.

    The search begins at `near`, or else at the start.
    """
    compressed = _compressed(estimator)
    if compressed is not None:
        return _of_compressed(estimator, solve(compressed, near))
    size = estimator.size
    noise, freedom, known = _first_noise(estimator)
    state = state_for(estimator, noise, _first_width(estimator), size, known=known)
    state = replace(state, first_freedom=freedom)
    if not state.fitted.rank:
        names = ", ".join(estimator.equations.parameters.names)
        raise FitError(f"they depend on none of {names}")
    u, search = np.zeros(len(estimator.scale)), estimator
    if near is not None:
        search = replace(search, near=near)
        u = (near.theta - estimator.start.theta) / estimator.scale
    risen: set[tuple[int, int]] = set()
    for _ in range(_ROUNDS):
        # rows that nothing contradicts pin what is not determined
        kept = state.fitted.unidentifiable
        pins = state.fitted.singular[0] * kept.T
        try:
            search = search.best(u, state.noise, state.width, pins)
            u = search.u - kept @ (kept.T @ search.u)
            search = search.at(u, state.noise)
            estimate = _estimate(estimator, search, state)
            fewer = (
                None
                if search.converged
                else _fewer(estimator, state, _revised(estimator, estimate))
            )
        except SingularError:
            fewer = _fewer(estimator, state, state)
            if fewer is None:
                raise
        if fewer is not None:
            state, u = fewer, np.zeros(len(estimator.scale))
            search = replace(search, near=estimator.start)
            continue
        if estimator.equations.machines.unknowns and state.first_freedom is None:
            state = replace(state, first_freedom=estimate.freedom)
            estimate = replace(estimate, state=state)
        revised = _revised(estimator, estimate)
        rise = state.fitted.rank, revised.fitted.rank
        if rise in risen:
            break  # what is fitted decides what can be: the fewer combinations are kept
        if rise[0] < rise[1]:
            risen.add(rise)
        settled = _settled(estimator, state, revised)
        state = revised
        if settled:
            break
    factor = _common_factor(estimator, estimate.state, state)
    if factor is None:
        search = search.at(u, state.noise)
        estimate = _estimate(estimator, search, state, estimate)
    else:
        estimate = estimate.with_noise(state, factor)
    search.end()
    return estimate


def _compressed(estimator: Estimator) -> Estimator | None:
    """The estimator by fewer equations, with which all is as with these; None: there is none.

    Not where a robust loss weighs rows of a lot one by one.
    """
    fewer = estimator.equations.compressed
    by_rows = estimator.loss != "linear" and not estimator.equations.machines.unknowns
    return (
        None if fewer is None or by_rows else Estimator.of(fewer, estimator.start, estimator.loss)
    )


def _of_compressed(estimator: Estimator, found: Estimate) -> Estimate:
    """The estimate by all equations where that by fewer ones has come to."""
    blocks, state = estimator.equations.blocks, found.state
    width, weights = state.width, found.weights
    if not estimator.equations.machines.unknowns:  # rows, not poses
        width = weights = np.ones(len(blocks.components))
    evaluation = estimator.equations.kept(found.evaluation)
    design = estimator.own_jacobian(evaluation, state.noise)
    multiply_in_place(design, found.basis)
    return replace(
        found,
        evaluation=evaluation,
        state=replace(state, width=width),
        residual=estimator.equations.residual(evaluation, state.noise),
        design=design,
        weights=weights,
    )


# between the least squares ------------------------------------------------------------------


def _first_noise(estimator: Estimator) -> tuple[FloatArray, FloatArray | None, Known | None]:
    """1 mm where it is not stated; with a prior what the data alone show at the start.

    Noise and prior could else excuse each other: much of one leaves little of the other.
    Where the groups' noise is then not equal, also the `IterationState.first_freedom`. And R at
    the start, where it was made.
    """
    ones = np.ones(len(estimator.unstated))
    if not len(estimator.priors) or estimator.loss != "linear":
        return ones, None, None
    jacobian = estimator.jacobian(estimator.start, ones)
    residual = estimator.equations.residual(estimator.start, ones)
    factor = triangle(jacobian)
    alone = _alone(estimator, estimator.start, ones, jacobian, factor, residual)
    if alone is None:
        return ones, None, (ones, factor)
    freedom = alone[1] if estimator.equations.machines.unknowns else None
    noise = _kept(estimator, ones * _scored(estimator, alone)[0], ones)
    grown = common(noise)
    if grown is not None:
        jacobian /= grown
        estimator.keep(estimator.start, noise, jacobian)
    return noise, freedom, (ones, factor)


def _alone(
    estimator: Estimator,
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
    every = np.ones(len(estimator.equations.blocks.components))
    shares = estimator.equations.by_groups(evaluation, noise, every, left, taken)
    freedom = shares[1]
    few = (freedom[estimator.unstated] < LEAST_FREEDOM).any()
    return None if few or freedom.sum() < prior_test.LEAST_FREEDOM else shares


def _kept(estimator: Estimator, noise: FloatArray, stated: FloatArray) -> FloatArray:
    """Estimated noise of groups where none is stated, else what multiplies the stated one."""
    return np.where(estimator.unstated, np.maximum(noise, LEAST_NOISE), stated)


def _first_width(estimator: Estimator) -> FloatArray:
    """Limits (B,) wide enough for the nominal machine, no wider than gross errors allow."""
    blocks, ones = estimator.equations.blocks, np.ones(len(estimator.unstated))
    if estimator.loss == "linear":
        return np.ones(len(blocks.components))
    medians = _medians(estimator, estimator.equations.residual(estimator.start, ones))
    return np.maximum(np.sqrt(medians), 1.0)[blocks.family_of_block]


def _medians(estimator: Estimator, residual: FloatArray) -> FloatArray:
    """Variance (F,) that whitened residuals (M,) of each family show by their median."""
    blocks = estimator.equations.blocks
    squares, components = blocks.squares(residual), blocks.stands_for
    family_of = blocks.family_of_block
    return np.array([
        median_ratio(squares[family_of == f], components[family_of == f])
        for f in range(int(family_of.max()) + 1)
    ])  # fmt: skip


def _fewer(
    estimator: Estimator, state: IterationState, revised: IterationState
) -> IterationState | None:
    """The state to begin again with after a search without an end; None where there is none.

    It went along what is hardly determined, far from any machine or into a singular one: less
    of it is fitted. `revised` has the noise that the search has shown.
    """
    worst = state.worst
    while worst > _LEAST_WORST * estimator.size:
        worst *= _LESS
        fewer = state_for(estimator, revised.noise, state.width, worst)
        if 0 < fewer.fitted.rank < state.fitted.rank:
            return replace(fewer, first_freedom=revised.first_freedom)
    return None


def _revised(estimator: Estimator, estimate: Estimate) -> IterationState:
    """Estimate unstated noise and limits of the loss, and split the directions again."""
    factor, of_families = _spread(estimator, estimate)
    noise = _kept(estimator, estimate.state.noise * factor, estimate.state.noise)
    # while the model is still far off, outliers are units further off than most
    family_of = estimator.equations.blocks.family_of_group
    families = range(len(of_families))
    none_stated = np.array([bool(estimator.unstated[family_of == f].all()) for f in families])
    width = np.where(none_stated, 1.0, np.maximum(of_families, 1.0))
    width = width[estimator.equations.blocks.family_of_block]
    return state_for(estimator, noise, width, estimate.state.worst, estimate, fitted=True)


def _spread(estimator: Estimator, estimate: Estimate) -> tuple[FloatArray, FloatArray]:
    """Deviation of the whitened residuals of each group (G,), and of each family (F,)."""
    if estimator.loss != "linear":
        return _scored(estimator, estimate.shares, _medians(estimator, estimate.residual))
    alone = None
    if len(estimator.priors):
        alone = _alone(
            estimator,
            estimate.evaluation,
            estimate.state.noise,
            estimate.design,
            estimate.triangle @ estimate.basis,
            estimate.residual,
        )
    return _scored(estimator, estimate.shares if alone is None else alone)


def _scored(
    estimator: Estimator, shares: Shares, medians: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Deviation that the shares show of each group (G,), and of each family (F,).

    1 without freedom. `medians` (F,) are the variances of families that medians show, of
    robust losses.
    """
    family_of = estimator.equations.blocks.family_of_group
    squares, freedom, information = shares
    factor, of_families = np.ones(len(freedom)), np.ones(int(family_of.max()) + 1)
    for f in range(len(of_families)):
        mine = np.flatnonzero(family_of == f)
        left = float(freedom[mine].sum())
        if left < LEAST_FREEDOM:
            continue
        variance = together = float(squares[mine].sum()) / left
        if medians is not None:
            of_family = estimator.equations.blocks.family_of_block == f
            count = float(estimator.equations.blocks.stands_for[of_family].sum())
            variance = float(medians[f]) * count / left
        of_families[f] = np.sqrt(variance)
        known = mine[estimator.unstated[mine] & (freedom[mine] >= least_freedom(estimator))]
        if len(mine) == 1:
            known = mine
        # a step of Fisher's scoring of the restricted likelihood: of one group, its mean square
        excess = np.linalg.solve(information[np.ix_(known, known)], squares[known] - freedom[known])
        common = variance / together if together > 0 else 1.0
        least = _LEAST_FALL * squares[known] / freedom[known]
        factor[known] = np.sqrt(common * np.maximum(1.0 + excess, least))
    return factor, of_families


def _settled(estimator: Estimator, old: IterationState, new: IterationState) -> bool:
    if old.fitted.rank != new.fitted.rank:
        return False
    if estimator.loss == "linear" and not len(estimator.priors) and len(estimator.unstated) == 1:
        return True  # the noise does not move the solution
    if not np.allclose(old.noise, new.noise, rtol=1e-3, atol=LEAST_NOISE):
        return False
    return estimator.loss == "linear" or np.allclose(old.width, new.width, rtol=1e-3)


def _common_factor(estimator: Estimator, old: IterationState, new: IterationState) -> float | None:
    """Return the common factor of all groups' noise, as if nothing else distinguished a fit."""
    factor = common(new.noise / old.noise)
    if estimator.loss != "linear" or old.determined.rank != new.determined.rank:
        return None
    alone = not (len(estimator.priors) or estimator.equations.machines.unknowns)
    return factor if factor == 1.0 or alone else None


def scaled_triangle(estimator: Estimator, evaluation: Evaluation) -> FloatArray:
    """R of the scaled Jacobian, not whitened: mm per mm, angles as their arc.

    Where poses have unknowns it is that of what is left of all equations, whitened as stated.
    """
    if estimator.equations.machines.unknowns:
        fewest = Estimator.of(estimator.equations.fewest, estimator.start, estimator.loss)
        return fewest.triangle(evaluation, np.ones(len(estimator.unstated)))
    mm = estimator.equations.mm
    factor = np.zeros((0, len(estimator.scale)))
    for _, parts in derivatives(estimator.equations.prediction, evaluation):
        for i, rows, part in parts:
            part *= mm[i][rows, :, None] * estimator.scale
            factor = triangle(factor, estimator.equations.whitening.stacked(part, i, rows))
    return factor


def _estimate(
    estimator: Estimator, search: Estimator, state: IterationState, last: Estimate | None = None
) -> Estimate:
    """The statistics where a search has come to; `last` are those for another noise."""
    evaluation = search.here
    linear = estimator.loss == "linear"
    residual = estimator.equations.residual(evaluation, state.noise)
    blocks = estimator.equations.blocks
    limit = limits(state.loss, blocks.stands_for, state.width)
    weights = weights_of(state.loss, residual, blocks.components, limit)
    root = np.sqrt(np.repeat(weights, estimator.equations.blocks.components))
    same = linear and last is not None and last.evaluation is evaluation
    grown = common(state.noise / last.state.noise) if same and last is not None else None
    if grown is None or last is None:
        design = estimator.own_jacobian(evaluation, state.noise)
        factor = triangle(design)
    else:
        factor = last.triangle / grown
    weighted = factor if linear else triangle(root[:, None] * design)
    prior = estimator.prior(evaluation.theta)
    half = unit_basis(weighted, prior, state.determined.identifiable)
    basis = np.hstack([half, state.determined.unidentifiable])
    if grown is None or last is None:
        multiply_in_place(design, basis)
    else:
        design = last.change(basis / grown)
    taken = design[:, : state.fitted.rank]
    shares = estimator.equations.by_groups(
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
        search.converged,
        search.evaluations,
        search.history,
    )
