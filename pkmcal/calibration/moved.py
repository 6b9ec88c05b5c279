"""Which parameters moved between the fitted measurements and others that were held out."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.calibration.equations import Equations
from pkmcal.calibration.evaluation import Evaluation
from pkmcal.calibration.fit import Fit
from pkmcal.calibration.fit_data import FitData
from pkmcal.calibration.identifiability import listed
from pkmcal.calibration.labels import labels
from pkmcal.calibration.mode_slips import in_their_modes
from pkmcal.statistics.shifts import shifted

_MAY_MOVE = re.compile(
    r"(offset|gain)\d*$|joint\d+\.dpsi$|(frame|target.*|anchor.*|attachment.*)\."
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

    def __str__(self) -> str:
        return named(self.names, self.together)


def named(names: Sequence[str], together: bool) -> str:
    """The names of a candidate in words."""
    shown = listed(names)
    return f"{shown} alike" if together and len(names) > 1 else shown


def moved(fit: Fit, held: Sequence[FitData], like: Sequence[int]) -> tuple[Moved, ...]:
    """Find what moved.

    Parameters
    ----------
    fit : Fit
        Of the first session.
    held : sequence of FitData
        The second session.
    like : sequence of int
        The fitted set of each, whose noise it has.
    """
    later, evaluation, noise = _later_session(fit, held, like)
    solved = evaluation.status[later.pose_of_unit] == 0
    chosen = fit.parameters
    candidates = _candidates(chosen.names)
    if not solved.any() or not candidates:
        return ()
    use = np.repeat(solved, later.components)
    jacobian = later.by_parameters(evaluation, noise)[use] * chosen.scale
    residual = later.residual(evaluation, noise)[use]
    cluster = labels(later).pose[use]
    rates = chosen.reported_rates(fit.end.theta) * chosen.scale
    by_reported = np.asarray(np.linalg.inv(rates), dtype=np.float64)
    directions = [
        by_reported[:, columns] @ np.ones((len(columns), 1))
        if together
        else by_reported[:, columns]
        for columns, together in candidates
    ]
    shifts = shifted(
        _first_session(fit),
        (jacobian, residual, cluster),
        fit.estimate.state.determined.identifiable,
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
    fit: Fit, held: Sequence[FitData], like: Sequence[int]
) -> tuple[Equations, Evaluation, FloatArray]:
    """The equations of the second session at the fit, and the noise of their groups (G,).

    Their poses have unknowns where those of the first have.
    """
    of_fit = fit.uncertainty.equations
    whole = Equations(held, fit.parameters).reweighted([
        np.ones(len(data.measured.components)) if _differs(fit, data, i) else of_fit.deviations[i]
        for data, i in zip(held, like, strict=True)
    ])  # fmt: skip
    commanded = whole.commanded()
    evaluation = in_their_modes(commanded, commanded.at(fit.end.theta))
    if not of_fit.closures.unknowns:
        return commanded, evaluation, _noise_factors(fit, commanded, held, like)
    noise = _noise_factors(fit, whole, held, like)
    begun = whole.begin(commanded, evaluation)
    return whole, whole.at(begun.theta, noise), noise


def _noise_factors(
    fit: Fit, later: Equations, held: Sequence[FitData], like: Sequence[int]
) -> FloatArray:
    """What multiplies the deviations of each group of equations of the later session."""
    sure = fit.uncertainty
    factors = []
    for data, i in zip(held, like, strict=True):
        if not _differs(fit, data, i):
            factors.append(float(sure.factors[i]))
        else:
            stated = data.measured.sigma is not None
            factors.append(1.0 if stated else float(np.sqrt(sure.noises[i].total)))
    if len(later.unstated) > len(held):  # the actuators, whose noise was stated or estimated alike
        of_fit = sure.factors[len(sure.equations.sets) :]
        factors += [float(of_fit[0])] if later.unstated[-1] and len(of_fit) else [1.0]
    return np.array(factors)


def _differs(fit: Fit, data: FitData, like: int) -> bool:
    """Whether kind or stated sigma of a set are not those of the fitted set."""
    own, of_fit = data.measured, fit.equations.sets[like]
    return own.kind != of_fit.kind or (own.sigma is None) != (of_fit.sigma is None)


def _first_session(fit: Fit) -> tuple[FloatArray, FloatArray, np.ndarray]:
    """Jacobian, residuals and clusters of the fitted rows and of the prior."""
    chosen, sure = fit.parameters, fit.uncertainty
    rows = chosen.prior_rows
    pulled = rows @ ((chosen.start - fit.end.theta) / chosen.scale)
    own = np.arange(len(rows)) + sure.fit.clusters
    return (
        np.vstack([fit.estimate.jacobian, rows]),
        np.concatenate([sure.fit.residual, pulled]),
        np.concatenate([sure.fit.cluster, own]),
    )
