"""How readings follow numbers that a fit held: their columns beside those of its design."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.free_parameters import parameters
from pkmcal.estimation.parameters import Parameters
from pkmcal.estimation.uncertain_numbers import uncertain_sets
from pkmcal.estimation.uncertainty import Uncertainty
from pkmcal.geometry.stated_uncertainty import StatedUncertainty


@dataclass(frozen=True, eq=False)
class HeldNumbers:
    """Numbers that a fit held at their values, as if they were fitted along.

    Attributes
    ----------
    names, units : tuple of str, k
        The numbers.
    columns : ndarray (M, k)
        Derivative of the whitened predicted values by them, mm, rad and 1.
    spread : ndarray (k, k)
        Their stated covariance.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    columns: FloatArray
    spread: FloatArray


def held_numbers(
    sure: Uncertainty, end: Evaluation, stated: StatedUncertainty
) -> HeldNumbers | None:
    """The numbers that a statement names and the fit has not.

    None where equations are mixtures, or there are no such numbers.

    Parameters
    ----------
    sure : Uncertainty
        Of the fit.
    end : Evaluation
        Its solution, poses following from the actuators.
    stated : StatedUncertainty
        Which numbers, and their deviations.
    """
    if sure.mixed:
        return None
    fitted, chosen = sure.equations, sure.equations.parameters
    wide = beside(chosen, fitted.prediction.datasets, stated)
    if wide is None:
        return None
    sets, more = wide
    equations = Equations.of(sets, more).reweighted(fitted.whitening.deviations)
    evaluation = equations.at(theta_of(more, chosen, end.theta), near=end.states)
    new = [i for i, name in enumerate(more.names) if name not in chosen.names]
    columns = equations.by_parameters(evaluation, sure.factors)[:, new]
    mine = np.isin(np.flatnonzero(more.uncertain), new)
    return HeldNumbers(
        tuple(more.names[i] for i in new),
        tuple(more.units[i] for i in new),
        columns,
        more.spread[np.ix_(mine, mine)],
    )


def beside(
    chosen: Parameters, datasets: Sequence[FitData], stated: StatedUncertainty
) -> tuple[list[FitData], Parameters] | None:
    """The sets and parameters with further numbers; None where there are none."""
    asked = chosen.asked
    whole = asked.uncertainty.with_later(replace(stated, consider={}))
    whole = replace(whole, consider={})
    sets, roles = uncertain_sets(chosen.robot, datasets, stated)
    asked = replace(asked, uncertainty=whole, uncertain_roles=asked.uncertain_roles | roles)
    more = parameters(chosen.robot, sets, asked, like=chosen)
    if len(more) == len(chosen):
        return None
    known = {name: i for i, name in enumerate(chosen.names)}
    origin = {
        first: chosen.origin[known[more.names[first]]] if more.names[first] in known else at
        for first, at in more.origin.items()
    }
    return sets, replace(more, origin=origin)


def theta_of(more: Parameters, chosen: Parameters, theta: FloatArray) -> FloatArray:
    """Values of all parameters: those of the fit, others where they are."""
    known = dict(zip(chosen.names, theta.tolist(), strict=True))
    return np.array([
        known.get(name, start)
        for name, start in zip(more.names, more.start.tolist(), strict=True)
    ])  # fmt: skip
