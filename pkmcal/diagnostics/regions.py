"""Accuracy where nothing was measured: regions, sessions and poses left out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.diagnostics.check import CHANCE, Check, at_most_one
from pkmcal.display import chance_text
from pkmcal.fitted.fit import Fit
from pkmcal.fitted.solution import Solution
from pkmcal.statistics.distributions import FEW
from pkmcal.statistics.left_out import left_out, residuals_left_out
from pkmcal.statistics.linear_fit import numbered
from pkmcal.statistics.singular_values import svd

_RATIO = 1.2  # … and by how much
_STRIPS = 5  # regions, along the direction in which the poses spread most
_FEWEST = 20  # poses, below which regions say nothing


@dataclass(frozen=True)
class CrossValidation:
    """Points that were left out, blocks of them at a time.

    Attributes
    ----------
    blocks : str
        "regions" or "sessions".
    rms : float
        Of their distances, each block left out, mm.
    at_random : float
        The same with each pose left out.
    ratio : float
        Of the residuals over what noise and covariance let expect.
    chance : float
        How likely as large a ratio is if noise and model are right.
    """

    blocks: str
    rms: float
    at_random: float
    ratio: float
    chance: float

    @property
    def worse(self) -> bool:
        """True if blocks that are left out are worse than expected."""
        return self.chance < CHANCE and self.ratio > _RATIO


def cross_validations(found: Solution) -> tuple[CrossValidation, ...]:
    """Leave out regions of the workspace, and sessions where there are several."""
    fit = found.fit
    sure = fit.uncertainty
    equations = sure.equations
    few = len(np.unique(sure.blocks.pose)) < _FEWEST or sure.fit.freedom < FEW
    if sure.mixed or sure.rounded or few or not sure.blocks.length.any():
        return ()
    if found.loss != "linear" or not (fit.end.status == 0).all():
        return ()
    row, pose = sure.blocks.row, sure.blocks.pose
    blocks = {"regions": _strips(fit)[pose]}
    sessions = [data.measured.session for data in equations.prediction.datasets]
    known = [each for each in sessions if each is not None]
    if len(known) == len(sessions):
        session = np.unique(np.concatenate(known), return_inverse=True)[1]
        if session.max() > 0:
            blocks["sessions"] = session[row]
    by_pose = residuals_left_out(sure.tested, numbered(pose))
    at_random = _rms(fit, by_pose)
    found_of = {}
    for name, block in blocks.items():
        plain = left_out(sure.tested, block)
        alike = plain if sure.own_deviations is None else left_out(sure.weighed.fit, block)
        found_of[name] = plain.residual, alike.ratio, alike.chance
    return tuple(
        CrossValidation(name, _rms(fit, residual), at_random, ratio, chance)
        for name, (residual, ratio, chance) in found_of.items()
    )


def _strips(fit: Fit) -> IntArray:
    """The region of each pose (K,): strips along the direction in which actuators differ most."""
    q = fit.end.actuators
    off = q - q.mean(axis=0)
    spread = off.std(axis=0)
    off = off / np.where(spread > 0.0, spread, 1.0)
    along = svd(off)[2][0]
    order = np.argsort(np.argsort(off @ along, kind="stable"), kind="stable")
    strips: IntArray = (order * _STRIPS) // len(order)
    return strips


def _rms(fit: Fit, whitened: FloatArray) -> float:
    """Rms of the distances that whitened residuals are, mm."""
    sure = fit.uncertainty
    lengths = sure.blocks.length
    squares = sure.in_units(whitened)[lengths] ** 2
    return float(np.sqrt(squares.sum() / len(np.unique(sure.blocks.row[lengths]))))


def _worse(found: Solution) -> tuple[CrossValidation, ...]:
    return at_most_one(next((each for each in cross_validations(found) if each.worse), None))


def _text(found: Solution, seen: CrossValidation) -> str:
    where = "regions" if seen.blocks == "regions" else "sessions"
    return (
        f"{where} that are left out of the fit are off by {seen.rms:.3g} mm rms, poses left out at"
        f" random by {seen.at_random:.3g} mm: in {where} that were not measured expect"
        f" {seen.ratio:.2g} times what ± say ({chance_text(seen.chance)}); the model misses"
        f" something that follows the {'place' if where == 'regions' else 'session'}"
    )


CHECKS = (
    Check(
        name="regions-left-out", about="regions or sessions that are left out are off by more",
        levels=("remark",), run=_worse, say=_text, unless=("grave",),
    ),
)  # fmt: skip
