"""Columns, beside the design, of numbers that a fit held."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.free_parameters import parameters
from pkmcal.estimation.parameters import Parameters
from pkmcal.estimation.sessions import matches
from pkmcal.estimation.uncertain_numbers import spread, uncertain_names, uncertain_sets
from pkmcal.estimation.uncertainty import Uncertainty
from pkmcal.exceptions import ArgumentError
from pkmcal.fitted.later import Later
from pkmcal.fitted.nuisances import bound
from pkmcal.geometry.stated_uncertainty import StatedUncertainty
from pkmcal.statistics.linear_fit import allowing
from pkmcal.statistics.score_test import Columns

_LEAST_NOISE = 0.25  # of the residuals' variance, that is noise whatever numbers are considered


@dataclass(frozen=True, eq=False)
class HeldNumbers:
    """Numbers that a fit held at their values, as if they were fitted along.

    Attributes
    ----------
    names, units : tuple of str, k
        The numbers.
    columns : Columns
        Derivatives of the whitened predicted values by them, mm, rad and 1.
    spread : ndarray (k, k)
        Their stated covariance.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    columns: Columns
    spread: FloatArray

    def matrix(self) -> FloatArray:
        """Return the columns, (M, k)."""
        return np.concatenate([some for _, some in self.columns()])


def held_numbers(
    sure: Uncertainty, end: Evaluation, stated: StatedUncertainty
) -> HeldNumbers | None:
    """The numbers that a statement names and the fit has not.

    None where there are no such numbers.

    Parameters
    ----------
    sure : Uncertainty
        Of the fit.
    end : Evaluation
        Its solution.
    stated : StatedUncertainty
        Which numbers, and their deviations.
    """
    fitted = sure.equations
    wide = beside(fitted.parameters, fitted.prediction.datasets, stated)
    if wide is None:
        return None
    known = fitted.parameters.names
    return _held(sure, end, *wide, [name for name in wide[1].names if name not in known])


def bound_numbers(
    sure: Uncertainty, end: Evaluation, stated: StatedUncertainty
) -> HeldNumbers | None:
    """The numbers that a statement names and that are where they are whatever was measured.

    Those that the fit has not, those that `fix` holds, and those that were fitted along and that
    their statement binds: see `bound`.
    """
    fitted = sure.equations
    chosen = fitted.parameters
    along_bound = bound_names(sure, end)
    geometry = chosen.robot.geometry
    free = [geometry.names[place] for place in chosen.places]
    along = {name for name, own in zip(chosen.names, chosen.uncertain, strict=True) if own}
    asked = replace(chosen.asked, free=[name for name in free if name not in along], fix=())
    wide = beside(replace(chosen, asked=asked), fitted.prediction.datasets, stated)
    sets, more = (list(fitted.prediction.datasets), chosen) if wide is None else wide
    named = [
        name
        for name in more.names
        if name not in chosen.names
        or (name in along_bound and any(matches(pattern, name) for pattern in stated.patterns))
    ]
    return _held(sure, end, sets, more, named) if named else None


def bound_names(sure: Uncertainty, end: Evaluation) -> frozenset[str]:
    """Numbers that were fitted along, and that their statement binds: see `bound`."""
    chosen = sure.equations.parameters
    if not chosen.uncertain.any():
        return frozenset()
    back = chosen.scale[:, None] * sure.fit.back
    along = np.flatnonzero(chosen.uncertain)[bound(chosen, end.theta, back @ back.T)]
    return frozenset(chosen.names[i] for i in along)


def _held(
    sure: Uncertainty, end: Evaluation, sets: list[FitData], more: Parameters, names: list[str]
) -> HeldNumbers:
    fitted, chosen = sure.equations, sure.equations.parameters
    new = [more.names.index(name) for name in names]

    def columns() -> Iterator[tuple[slice, FloatArray]]:
        equations, theta = fitted.with_more(sets, more), theta_of(more, chosen, end.theta)
        evaluation = equations.at(theta, sure.factors, end.states)
        for _, rows, some in equations.batches(evaluation, sure.factors):
            yield rows, some[:, new]

    mine = np.isin(np.flatnonzero(more.uncertain), new)
    return HeldNumbers(
        tuple(names), tuple(more.units[i] for i in new), columns, more.spread[np.ix_(mine, mine)]
    )


def with_considered(sure: Uncertainty, end: Evaluation, stated: StatedUncertainty) -> Uncertainty:
    """The uncertainty with that of numbers that are to stay where they are.

    Where the noise is estimated, without what they explain of the residuals (at most three
    quarters).

    Raises
    ------
    ValueError
        Poses do not follow from the actuators.
    """
    if not any(stated.consider.values()):
        return sure
    if sure.mixed:
        raise ArgumentError(
            "uncertainty: consider needs poses that follow from the actuators: no actuator_sigma,"
            " and no surplus actuators"
        )
    geometry = sure.equations.parameters.robot.geometry
    for pattern in stated.consider:
        geometry.match(pattern, "uncertainty: consider")
    held = held_numbers(sure, end, StatedUncertainty(stated.consider))
    if held is None:
        return sure
    columns = held.matrix() @ np.linalg.cholesky(held.spread)
    follow = sure.fit.design.T @ columns
    left = float(((columns - sure.fit.design @ follow) ** 2).sum())
    share = max(1.0 - left / sure.fit.squares, _LEAST_NOISE)
    covariance = sure.covariance
    if np.isfinite(covariance.scale_freedom):
        covariance = replace(covariance, scale=covariance.scale * float(np.sqrt(share)))
    allowed = allowing(sure.fit, columns, float(np.sqrt(share)), sure.prior_residual)
    return replace(
        sure, considered=follow, covariance=covariance, noise_share=share, allowed=allowed
    )


def considered_places(chosen: Parameters) -> tuple[IntArray, FloatArray]:
    """Places (k,) of considered numbers in the geometry's values, and the root of their spread."""
    stated, geometry = StatedUncertainty(chosen.asked.uncertainty.consider), chosen.robot.geometry
    free = [geometry.names[place] for place in chosen.places]
    names = uncertain_names(stated, chosen.robot, free)
    places = np.array([geometry.names.index(name) for name in names], dtype=np.intp)
    root: FloatArray = np.linalg.cholesky(spread(stated, names)).astype(np.float64)
    return places, root


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


def considered_errors(
    rows: Later,
    equations: Equations,
    after: Evaluation,
    uncertainty: Uncertainty,
    design: FloatArray,
) -> FloatArray:
    """Errors (M, k) that considered numbers make in rows held out, mm in their deviations.

    Parameters
    ----------
    rows, equations, after : Later, Equations, Evaluation
        The rows that were held out.
    uncertainty : Uncertainty
        Of the fit.
    design : ndarray (M, p)
        Of the rows, mm by the basis of the fit.
    """
    if uncertainty.considered is None:
        return np.zeros((len(design), 0))
    chosen = rows.parameters
    wide = beside(chosen, rows.data, StatedUncertainty(chosen.asked.uncertainty.consider))
    assert wide is not None  # as of the fit
    sets, more = wide
    other = Equations.of(sets, more)
    at = other.at(theta_of(more, chosen, after.theta), near=after.states)
    new = [i for i, name in enumerate(more.names) if name not in chosen.names]
    jacobian = np.concatenate([
        (arc[:, None] * part).reshape(-1, part.shape[2])[:, new]
        for arc, part in zip(equations.arcs, other.jacobian(at), strict=True)
    ])[equations.whitening.present]  # fmt: skip
    mine = np.isin(np.flatnonzero(more.uncertain), new)
    root = np.linalg.cholesky(more.spread[np.ix_(mine, mine)])
    found: FloatArray = jacobian @ root - design @ uncertainty.considered
    return found
