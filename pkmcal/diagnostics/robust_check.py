"""Check whether a few rows carry a least-squares fit: a robust fit beside it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import BoolArray, rms
from pkmcal.estimation import misfits
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.solving import solve
from pkmcal.fitted.dropped import outlying
from pkmcal.fitted.fit import Fit
from pkmcal.statistics.robust_scale import median_ratio, ratio_by_chance, robust_ratio

_SUSPECT = 1.25  # ratio of the linear model's noises from which the robust fit is made
DISAGREES, CARRIED = 1.5, 5.0  # ratio that is said, and that decides
_MOST = 500  # poses of which it is made, drawn at random


@dataclass(frozen=True)
class RobustCheck:
    """A robust fit beside a least-squares one.

    Attributes
    ----------
    ratio : float
        Noise of the least-squares fit over that of the robust one.
    by_chance : float
        The same that good rows hardly ever exceed; 1 where they are many.
    rows : tuple of int
        Rows that disagree with the rest there.
    rms : float
        Of the other rows there, mm; of their closures where nothing was read.
    """

    ratio: float
    by_chance: float
    rows: tuple[int, ...]
    rms: float

    @property
    def disagrees(self) -> bool:
        """True if some rows disagree with the rest, more than by chance."""
        return self.ratio > max(DISAGREES, self.by_chance)

    @property
    def carried(self) -> bool:
        """True if a few rows carry the least-squares fit off."""
        return self.ratio > CARRIED * max(self.by_chance / DISAGREES, 1.0)


def robust_check(fit: Fit) -> RobustCheck | None:
    """Compare a least-squares fit with a robust one; None where they agree.

    The linear model at the solution says whether the robust fit is worth its time. That starts from
    the nominal machine: from where gross rows have carried the least squares it can stay there.
    """
    equations, estimate = fit.uncertainty.equations, fit.estimate
    linear = fit.uncertainty.fit
    ratio = robust_ratio(linear.design, linear.residual, equations.blocks.components)
    if not ratio > _SUSPECT or fit.uncertainty.rounded:
        return None
    drawn = _drawn(fit)
    few = Equations.of([data for data, _ in drawn], fit.parameters).reweighted(
        [equations.whitening.deviations[i] for _, i in drawn]
    )
    commanded = few.with_exact_actuators()
    try:
        estimator = Estimator.of(*few.begin(commanded.at(fit.aligned.theta)), "cauchy")
        robust = solve(estimator)
    except ValueError:
        return None
    p = robust.state.fitted.rank
    m, own = int(few.blocks.components.sum()), int(equations.blocks.components.sum())
    if m <= p or own <= p:
        return None
    # both in units of the same noise
    noise = estimate.state.noise
    set_of_group = equations.whitening.set_of_group
    of_drawn = [noise[: len(set_of_group)][set_of_group == i] for _, i in drawn]
    of_sets = np.concatenate([*of_drawn, noise[len(set_of_group) :]])
    plain = equations.residual(estimate.evaluation, noise)
    squares = few.blocks.squares(few.residual(robust.evaluation, of_sets))
    scale = median_ratio(squares, few.blocks.components) * m / (m - p)
    named = outlying(estimator, robust)
    if not scale > 0:
        return None
    ratio = float(np.sqrt(plain @ plain / (own - p) / scale))
    by_chance = (
        ratio_by_chance(linear.design, equations.blocks.components) if ratio > DISAGREES else 1.0
    )
    return RobustCheck(
        ratio=ratio,
        by_chance=by_chance,
        rows=tuple(few.table.rows[named].tolist()),
        rms=_rms_of_others(few, commanded, robust.evaluation, named),
    )


def _rms_of_others(
    few: Equations, commanded: Equations, there: Evaluation, named: BoolArray
) -> float:
    """Return distances (N,) of rows not named, mm; of closures where nothing was read."""
    if not few.whitening.any_read:
        poses = np.ones(len(there.pose), dtype=bool)
        poses[np.concatenate(few.table.pose_of)[named]] = False
        return misfits.closure_rms(few, there, poses)
    off = misfits.distances(few, commanded.at(there.theta, near=there))[~named]
    return rms(off[np.isfinite(off)])


def _drawn(fit: Fit) -> list[tuple[FitData, int]]:
    """The fitted rows, or those of some poses if there are more than needed; and their sets."""
    equations = fit.equations
    pose = fit.uncertainty.blocks.pose_of_row
    count = int(pose.max()) + 1
    if count <= _MOST:
        return [(data, i) for i, data in enumerate(equations.prediction.datasets)]
    chosen = np.isin(pose, np.random.default_rng(0).permutation(count)[:_MOST])
    drawn = []
    for i, data in enumerate(equations.prediction.datasets):
        mine = np.flatnonzero(chosen[equations.table.set_of == i])
        if len(mine):
            drawn.append((data.select(mine), i))
    return drawn
