"""Which parameters moved between the fitted measurements and others that were held out."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.calibration.equations import Equations
from pkmcal.calibration.fit import Fit
from pkmcal.calibration.identifiability import listed
from pkmcal.calibration.mode_slips import in_their_modes
from pkmcal.calibration.parameters import FitData
from pkmcal.calibration.uncertainty import poses_of_rows
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
    later = Equations(held, fit.parameters).reweighted(
        [
            np.ones(len(data.measured.components)) if _differs(fit, data, i) else of_fit
            for data, i, of_fit in zip(held, like, _deviations(fit, like), strict=True)
        ]
    )
    evaluation = in_their_modes(later, later.at(fit.end.theta))
    good = np.concatenate([evaluation.status[place] == 0 for place in later.pose_of])
    chosen = fit.parameters
    candidates = _candidates(chosen.names)
    if not good.any() or not candidates:
        return ()
    noise = np.array([_noise_factor(fit, data, i) for data, i in zip(held, like, strict=True)])
    use = np.repeat(good, later.components)
    jacobian = later.whitened(later.jacobian(evaluation), noise)[use] * chosen.scale
    residual = later.whitened(evaluation.residuals, noise)[use]
    cluster = np.repeat(poses_of_rows(later), later.components)[use]
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


def _noise_factor(fit: Fit, data: FitData, like: int) -> float:
    """What multiplies the deviations of a set of the later session."""
    if not _differs(fit, data, like):
        return float(fit.estimate.state.noise[like])
    stated = data.measured.sigma is not None
    return 1.0 if stated else float(np.sqrt(fit.uncertainty.noises[like].total))


def _deviations(fit: Fit, like: Sequence[int]) -> list[FloatArray]:
    return [fit.equations.deviations[i] for i in like]


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
