"""Evidence for an effect from poses left out in turn, with it and without.

By the linear model at the solution, so that no fit is repeated: an effect is judged by poses that
took no part. It may be one that the fit does not have, or one that it has.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray
from pkmcal.effects.effect import Changed, Effect
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.free_parameters import parameters
from pkmcal.estimation.parameters import Parameters
from pkmcal.fitted.fit import Fit
from pkmcal.fitted.fit_statistics import INVOLVED
from pkmcal.statistics.leave_out import LeftOut, leave_out
from pkmcal.statistics.linear_fit import numbered
from pkmcal.statistics.score_test import Columns, columns_of

LEAST_GAIN = 0.05  # share of the rms at poses left out that an effect must take away
LEAST_T = 2.0  # of the paired differences by pose
LEAST_POSES = 8


@dataclass(frozen=True)
class Comparison:
    """Poses left out in turn, without an effect and with it.

    Attributes
    ----------
    numbers : tuple of str
        Of the effect.
    poses : int
        How many were left out, one by one.
    before, after : float
        Rms distance of the points that were left out, mm: without the effect, and with it.
    alone : float
        That of the other numbers of the fit with the effect, without the effect, mm: what a
        controller makes of them that does not hold it.
    t : float
        Mean of the paired differences of squares by pose, over its standard deviation.
    shift : float
        How far the other numbers of the fit move by the effect, in their ±, rms.
    """

    numbers: tuple[str, ...]
    poses: int
    before: float
    after: float
    alone: float
    t: float
    shift: float

    @property
    def passes(self) -> bool:
        """True if the effect helps, beyond what chance does."""
        return self.after <= (1.0 - LEAST_GAIN) * self.before and self.t > LEAST_T

    def __str__(self) -> str:
        return f"the error at poses left out goes from {self.before:.3f} to {self.after:.3f} mm"


def compared_by_poses(
    fit: Fit,
    effects: Sequence[Effect | Changed] = (),
    lacking: Collection[str] | None = None,
) -> Comparison | None:
    """Compare two models of what was fitted, of which one lacks numbers of the other.

    Parameters
    ----------
    fit : Fit
        A solved calibration, by least squares.
    effects : sequence of Effect or Changed
        What both models have beside what was fitted; a `Changed` one is of the fit's machine.
    lacking : collection of str, optional
        Numbers that one of the models does not have: there they are as stated. By default those of
        the effects.

    Returns
    -------
    Comparison or None
        None where poses have unknowns, the loss is robust, or there are too few poses or readings
        to say.
    """
    sure = fit.uncertainty
    if sure.mixed or fit.estimate.state.loss != "linear" or not sure.known:
        return None
    equations, end = _with_effects(fit, effects) if effects else (sure.equations, fit.end)
    chosen = equations.parameters
    fitted = {*fit.parameters.names}
    beside = np.array([
        name not in fitted if lacking is None else name in lacking for name in chosen.names
    ])  # fmt: skip
    jacobian = equations.by_parameters(end, sure.factors) * chosen.scale
    if not beside.any() or jacobian.shape[0] != len(sure.blocks.pose):
        return None
    values = equations.residual(end, sure.factors)
    prior, known = chosen.prior_rows(end.theta), chosen.prior_left(end.theta)
    pose = numbered(sure.blocks.pose)
    if int(pose.max()) + 1 < LEAST_POSES:
        return None
    whole = leave_out(jacobian, values, prior, known, pose)
    if sure.blocks.unstated.all() and whole.deviation < 1.0:
        # the noise that the fit found is more than what the effect leaves: priors weigh less
        less = whole.deviation
        whole = leave_out(jacobian, values, less * prior, less * known, pose)
    # as stated in place of as found: what the effect's numbers have done is undone
    undone = jacobian[:, beside] @ ((end.theta - chosen.start) / chosen.scale)[beside]
    rest = prior[:, beside].any(axis=1)
    plain = leave_out(jacobian[:, ~beside], values + undone, prior[~rest][:, ~beside],
                      known[~rest], pose)  # fmt: skip
    added = (whole.without[pose][:, beside] * jacobian[:, beside]).sum(axis=1) + undone
    missed = plain.missed, whole.missed, whole.missed + added
    lengths = [_squares(fit, each, pose) for each in missed]
    return _comparison(lengths, beside, chosen, fit, _shift(fit, chosen, plain, whole, ~beside))


def effect_columns(fit: Fit, effects: Sequence[Effect | Changed]) -> Columns | None:
    """Derivative of the whitened predicted values by numbers of effects that the fit lacks.

    None where poses have unknowns, or the fit has these numbers.
    """
    sure = fit.uncertainty
    if sure.mixed:
        return None
    equations, end = _with_effects(fit, effects)
    chosen, fitted = equations.parameters, {*fit.parameters.names}
    new = [i for i, name in enumerate(chosen.names) if name not in fitted]
    if not new:
        return None
    return columns_of(equations.by_parameters(end, sure.factors)[:, new])


def _squares(fit: Fit, missed: FloatArray, pose: np.ndarray) -> FloatArray:
    """Sum of the squared lengths of each pose, mm²."""
    length = fit.uncertainty.blocks.length
    off = np.where(length, fit.uncertainty.in_units(missed), 0.0)
    return np.bincount(pose, off**2).astype(np.float64)


def _shift(fit: Fit, chosen: Parameters, plain: LeftOut, whole: LeftOut, kept: BoolArray) -> float:
    """Return by how many of their ± numbers that the fit determines move with the effect, rms."""
    place = {name: i for i, name in enumerate(fit.parameters.names)}
    moved = np.zeros(len(place))
    change = whole.found[kept] - plain.found
    for name, by in zip(np.array(chosen.names)[kept].tolist(), change.tolist(), strict=True):
        if name in place:
            moved[place[name]] = by
    determined = np.linalg.norm(np.linalg.qr(fit.uncertainty.fit.back)[0], axis=1)
    deviation = np.sqrt(np.maximum(np.diag(fit.uncertainty.scaled), 0.0))
    known = np.isfinite(deviation) & (deviation > 0.0) & (determined > 1.0 - INVOLVED)
    return float(np.sqrt(np.mean((moved[known] / deviation[known]) ** 2))) if known.any() else 0.0


def _comparison(
    squares: Sequence[FloatArray], beside: BoolArray, chosen: Parameters, fit: Fit, shift: float
) -> Comparison | None:
    plain, whole, bare = squares
    good = np.isfinite(plain) & np.isfinite(whole)
    blocks = fit.uncertainty.blocks
    rows_of = [np.unique(blocks.row[blocks.length & (numbered(blocks.pose) == k)]).size
               for k in range(len(plain))]  # fmt: skip
    points = float(np.array(rows_of)[good].sum())
    if int(good.sum()) < LEAST_POSES or not points:
        return None
    gain = (plain - whole)[good]
    spread = float(gain.std(ddof=1)) / np.sqrt(len(gain))
    return Comparison(
        numbers=tuple(name for name, own in zip(chosen.names, beside, strict=True) if own),
        poses=int(good.sum()),
        before=float(np.sqrt(plain[good].sum() / points)),
        after=float(np.sqrt(whole[good].sum() / points)),
        alone=float(np.sqrt(bare[good].sum() / points)),
        t=float(gain.mean()) / spread if spread > 0.0 else 0.0,
        shift=shift,
    )


def _with_effects(fit: Fit, effects: Sequence[Effect | Changed]) -> tuple[Equations, Evaluation]:
    """The equations of the fit with effects beside its own, at its solution."""
    fitted, own = fit.parameters, fit.uncertainty.equations
    machine, asked = fitted.robot, fitted.asked
    moving = [each for each in effects if not isinstance(each, Changed)]
    for each in effects:
        if isinstance(each, Changed):
            machine = each.machine
            asked = replace(asked, of_effects={**asked.of_effects, **each.free})
    datasets = [replace(data, effects=(*data.effects, *moving)) for data in own.prediction.datasets]
    chosen = parameters(machine, datasets, asked)
    place = {name: c for c, name in enumerate(chosen.names)}
    here = [place[name] for name in fitted.names]
    theta = chosen.start.copy()
    theta[here] = fit.end.theta
    origin = {here[first]: pose for first, pose in fitted.origin.items()}
    chosen = replace(chosen, origin={**chosen.origin, **origin})
    equations = Equations.of(datasets, chosen, own.missing)
    equations = equations.reweighted(own.whitening.deviations)
    return equations, equations.at(theta, near=fit.end.states)
