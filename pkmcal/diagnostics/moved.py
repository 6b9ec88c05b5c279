"""Parameters that moved between the fitted measurements and others that were held out."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.identifiability import listed
from pkmcal.estimation.mode_slips import in_their_modes
from pkmcal.fitted.fit import Fit
from pkmcal.fitted.later import Later, noise_factors
from pkmcal.statistics.shifts import shifted

_MAY_MOVE = re.compile(  # what is found anew in each session has an @ in its name
    r"(offset|gain)\d*$|joint\d+\.dpsi$|(frame|target[^@]*|anchor[^@]*|attachment[^@]*)\.\w+$"
)


@dataclass(frozen=True)
class Moved:
    """A parameter, or several together, that moved between two sessions.

    Attributes
    ----------
    names : tuple of str
        The parameters.
    together : bool
        Whether all of them moved by the same.
    shift, stderr : tuple of float
        By how much, mm and rad, and its standard deviation: one number if they moved together.
    units : tuple of str
        Of each name.
    chance : float
        How likely the shift would show without one, among all that were tried.
    also : tuple of str
        What would explain the same as well.
    """

    names: tuple[str, ...]
    together: bool
    shift: tuple[float, ...]
    stderr: tuple[float, ...]
    units: tuple[str, ...]
    chance: float
    also: tuple[str, ...]

    @property
    def per_session(self) -> str:
        """The wildcard for `identify` that finds these numbers anew in each session."""
        first, point, rest = self.names[0].partition(".")
        if first.startswith("joint"):
            return f"joint*.{rest}"
        return f"{first}.*" if point else re.sub(r"\d+$", "*", first)

    def __str__(self) -> str:
        return named(self.names, self.together)


def named(names: Sequence[str], together: bool) -> str:
    """The names of a candidate in words."""
    shown = listed(names)
    return f"{shown} alike" if together and len(names) > 1 else shown


def moved(fit: Fit, later: Later, end: Evaluation) -> tuple[Moved, ...]:
    """Find what moved.

    Parameters
    ----------
    fit : Fit
        Of the first session.
    later : Later
        The second session.
    end : Evaluation
        It at the fit, its own numbers found.
    """
    second, evaluation, noise = _later_session(fit, later, end)
    solved = evaluation.status[second.blocks.pose_of_block] == 0
    chosen = fit.parameters
    candidates = _candidates(chosen.names)
    if not solved.any() or not candidates:
        return ()
    use = np.repeat(solved, second.blocks.components)
    whole = second.by_parameters(evaluation, noise)[use] * later.parameters.scale
    # the second session's own numbers follow those of the fit
    jacobian = np.hstack([later.by_fitted(whole, len(chosen)), whole[:, later.own]])
    residual = second.residual(evaluation, noise)[use]
    cluster = second.blocks.pose[use]
    n, own = len(chosen), int(later.own.sum())
    rates = chosen.reported_rates(fit.end.theta) * chosen.scale
    by_reported = np.vstack([np.linalg.inv(rates), np.zeros((own, n))])
    directions = [
        by_reported[:, columns] @ np.ones((len(columns), 1))
        if together
        else by_reported[:, columns]
        for columns, together in candidates
    ]
    first, squares, clusters = _first_session(fit)
    identifiable = fit.estimate.state.determined.identifiable
    basis = np.zeros((n + own, identifiable.shape[1] + own))
    basis[:n, : -own or None], basis[n:, identifiable.shape[1] :] = identifiable, np.eye(own)
    shifts = shifted(
        (np.hstack([first, np.zeros((len(first), own))]), squares, clusters),
        (jacobian, residual, cluster),
        basis,
        directions,
    )
    names = [tuple(chosen.names[i] for i in columns) for columns, _ in candidates]
    return tuple(
        Moved(
            names=names[shift.candidate],
            together=candidates[shift.candidate][1],
            shift=tuple(shift.size.tolist()),
            stderr=tuple(shift.deviation.tolist()),
            units=tuple(chosen.units[i] for i in candidates[shift.candidate][0]),
            chance=shift.chance,
            also=tuple(named(names[j], candidates[j][1]) for j in shift.also),
        )
        for shift in shifts
    )


def _candidates(names: Sequence[str]) -> list[tuple[list[int], bool]]:
    """Columns of what may move, and whether all of them by the same."""
    each = [i for i, name in enumerate(names) if _MAY_MOVE.match(name)]
    found = [([i], False) for i in each]
    offsets = [i for i in each if names[i].startswith("offset")]
    if len(offsets) > 1:
        found += [(offsets, True), (offsets, False)]
    return found


def _later_session(
    fit: Fit, later: Later, end: Evaluation
) -> tuple[Equations, Evaluation, FloatArray]:
    """The equations of the second session at the fit, and the noise of their groups (G,).

    Their poses have unknowns where those of the first have.
    """
    sure = fit.uncertainty
    whole = later.equations(sure.equations)
    commanded = whole.with_exact_actuators()
    evaluation = in_their_modes(commanded, commanded.at(end.theta, near=end))
    if not sure.equations.machines.unknowns:
        return commanded, evaluation, noise_factors(later, commanded, sure)
    noise = noise_factors(later, whole, sure)
    whole, start = whole.begin(evaluation)
    return whole, whole.at(start.theta, noise, start), noise


def _first_session(fit: Fit) -> tuple[FloatArray, FloatArray, np.ndarray]:
    """Jacobian, residuals and clusters of the fitted rows and of the prior."""
    chosen, sure = fit.parameters, fit.uncertainty
    rows = chosen.prior_rows(fit.end.theta)
    pulled = chosen.prior_left(fit.end.theta)
    own = np.arange(len(rows)) + sure.fit.clusters
    return (
        np.vstack([fit.estimate.change(np.eye(len(chosen))), rows]),
        np.concatenate([sure.fit.residual, pulled]),
        np.concatenate([sure.fit.cluster, own]),
    )
