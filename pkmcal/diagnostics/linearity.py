"""Check whether the machine is linear over what the parameters are uncertain by.

Standard deviations and intervals are those of the linear machine at the solution. Where a
combination is hardly determined they can carry the machine so far that they say nothing: the misfit
there is not what the linear machine has.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.estimation.estimate import Estimate
from pkmcal.estimation.identifiability import CLEAR, listed
from pkmcal.estimation.machine_size import machine_size
from pkmcal.estimation.uncertainty import Uncertainty
from pkmcal.exceptions import ArgumentError

_DRAWS = 8
_BY_PRIOR = 0.5  # share of what is known of a combination from which a prior determines it
_OFF = 0.5  # share of the rise of the misfit by which the machine may differ from the linear one


@dataclass(frozen=True)
class Weak:
    """Parameters whose deviations say little.

    Attributes
    ----------
    names : tuple of str
        Which.
    assembled : bool
        Whether the machine can be assembled, and reaches its poses, over these deviations.
    """

    names: tuple[str, ...]
    assembled: bool

    def __str__(self) -> str:
        how = "is not linear" if self.assembled else "could not even be assembled"
        return (
            f"{listed(self.names)} are hardly determined: the machine {how} over their ±, which say"
            " little; measure other poses, state a prior or free fewer parameters"
        )


def beyond_linear(estimate: Estimate, uncertainty: Uncertainty) -> Weak | None:
    """Find parameters so uncertain that their deviations say little; None if none are.

    Parameters are drawn by their covariance, and the rise of the sum of squares is compared with
    that of the linear machine; only where some combination that the measurements determine, more
    than a prior does, is not determined to `CLEAR` of the machine's size.
    """
    equations, state, linear_fit = uncertainty.equations, estimate.state, uncertainty.fit
    chosen, fitted = equations.parameters, state.fitted.identifiable
    shares, directions = np.linalg.eigh(linear_fit.prior.T @ linear_fit.prior)
    measured = directions[:, shares < _BY_PRIOR]
    if not uncertainty.known or not measured.shape[1]:
        return None
    values, vectors = np.linalg.eigh(uncertainty.covariance.of(measured.T))
    root = vectors * np.sqrt(np.maximum(values, 0.0)) @ vectors.T
    root = fitted @ (fitted.T @ linear_fit.back @ measured @ root)
    least = CLEAR * machine_size(equations, estimate.evaluation.theta)
    if not np.linalg.norm(root, 2) > least:
        return None
    weights = np.repeat(estimate.weights, equations.blocks.components)
    rises = []
    for draw in np.random.default_rng(0).normal(size=(_DRAWS, root.shape[1])):
        step = root @ draw
        here = estimate.evaluation
        try:
            there = equations.at(here.theta + chosen.scale * step, state.noise, here)
        except ArgumentError:  # so far that no machine has these numbers
            rises.append(np.inf)
            continue
        residual = equations.residual(there, state.noise)
        change = estimate.change(step)
        linear = estimate.residual - change
        beyond = weights @ residual**2 - weights @ linear**2
        rises.append(float(beyond / (weights @ change**2)))
    off = np.nan_to_num(np.abs(rises), nan=np.inf, posinf=np.inf)
    if np.median(off) < _OFF:
        return None
    names = [chosen.names[i] for i in np.flatnonzero(np.linalg.norm(root, axis=1) > least)]
    return Weak(tuple(names), bool(np.isfinite(np.median(off))))
