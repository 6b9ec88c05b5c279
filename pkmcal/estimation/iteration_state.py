"""The state of an iteration for a noise: which combinations of the parameters it determines."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.estimation.estimate import Estimate, IterationState
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.identifiability import (
    Decomposed,
    Measured,
    decompose,
    directions,
    measured,
)

Known = tuple[FloatArray, FloatArray]  # a noise (G,), and R of the Jacobian with it


def state_for(
    estimator: Estimator,
    noise: FloatArray,
    width: FloatArray,
    worst: float,
    last: Estimate | None = None,
    fitted: bool = False,
    known: Known | None = None,
) -> IterationState:
    """Split the directions for this noise, before or after a fit; `last` is the last estimate.

    `worst` is that of `IterationState`; `known` is R at the start for another noise.
    """
    size = estimator.size
    kept, noise_known = worst, fitted or not estimator.unstated.any() or worst < size
    worst = worst if noise_known else np.inf
    first, factor = _at_start(estimator, noise, None if last is None else last.state, known)
    now: tuple[Measured | None, Measured | None] = (None, None)
    if fitted and last is not None:
        known = last.state.noise, last.triangle
        data, whole = _parts(
            estimator, last.evaluation, _triangle(estimator, last.evaluation, noise, known)
        )
        alone = measured(*data)
        now = alone, alone if whole is data else measured(*whole)
    by_data = directions(first[0], now[0], size)
    determined = directions(first[1], now[1], size)
    wanted = directions(first[1], now[1], size, worst)
    freedom = None if last is None else last.state.first_freedom
    return IterationState(
        noise, estimator.loss, width, by_data, determined, wanted, kept, first, factor, freedom
    )


def _at_start(
    estimator: Estimator, noise: FloatArray, last: IterationState | None, known: Known | None
) -> tuple[tuple[Decomposed, Decomposed], FloatArray]:
    """Decompose the start, and return its R.

    `last` has both for another noise, `known` has R alone.
    """
    if last is not None:
        known = last.noise, last.start_triangle
        if (noise == last.noise).all():
            return last.at_start, last.start_triangle
    factor = _triangle(estimator, estimator.start, noise, known)
    grown = None if last is None else common(noise / last.noise)
    if last is None or grown is None or len(estimator.priors):
        data, whole = _parts(estimator, estimator.start, factor)
        alone = decompose(*data)
        return (alone, alone if whole is data else decompose(*whole)), factor
    singular, basis = last.at_start[0]
    return ((singular / grown, basis),) * 2, factor


def _parts(
    estimator: Estimator, evaluation: Evaluation, factor: FloatArray
) -> tuple[tuple[FloatArray, ...], tuple[FloatArray, ...]]:
    """R, in parts below each other, without and with the prior; without one the same object."""
    data: tuple[FloatArray, ...] = (factor,)
    if not len(estimator.priors):
        return data, data
    prior, chosen = estimator.prior(evaluation.theta), estimator.equations.parameters
    if len(chosen.spread):  # what is fixed but for that is known without a prior, too
        data = factor, prior[chosen.prior_of_uncertain]
    return data, (factor, prior)


def _triangle(
    estimator: Estimator, evaluation: Evaluation, noise: FloatArray, known: Known | None
) -> FloatArray:
    """R of the Jacobian, made of what is known of it where all noise has grown alike."""
    grown = None if known is None else common(noise / known[0])
    if known is None or grown is None:
        return estimator.triangle(evaluation, noise)
    factor: FloatArray = known[1] / grown
    return factor


def common(factors: FloatArray) -> float | None:
    """Return the factor (G,) of all groups; None where they have different ones."""
    first = float(factors[0])
    return first if (factors == first).all() else None
