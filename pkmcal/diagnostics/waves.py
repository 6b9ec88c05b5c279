"""Waves a turn of a joint that residuals of an arm follow: its gear, or a harmonic drive.

Each joint and each whole number of waves is tried by a score test whose variance is that of the
poses, so that errors that rows of a pose share count once; the largest is judged as the largest of
all that were tried.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.diagnostics.check import Check, Remedy
from pkmcal.display import chance_text
from pkmcal.effects.gears import Harmonics
from pkmcal.estimation.uncertainty import Uncertainty
from pkmcal.fitted.solution import Solution
from pkmcal.kinematics.calibratable import as_arm
from pkmcal.statistics.distributions import f_tail
from pkmcal.statistics.linear_fit import numbered, sums

WAVES = range(20, 321)  # a turn: gears of joints are no coarser, and few drives are finer
LEAST_POSES = 100
_SURE = 0.01  # chance of naming a wave where there is none
_NEAREST = 5  # numbers of waves that are named where many look alike
_STEP = 1e-3  # of a step, by which places on a grid may be off


class Wave(NamedTuple):
    """A wave that residuals follow.

    Attributes
    ----------
    joint : int
        Counted from 1.
    waves : int
        A turn.
    size : float
        Amplitude, rad.
    chance : float
        Of as much in any of the waves that were tried, if there were none.
    steps : float
        Of a regular grid on which the joint stood, rad: then other numbers of waves look alike;
        0 without one.
    """

    joint: int
    waves: int
    size: float
    chance: float
    steps: float


def scan_waves(found: Solution, waves: Sequence[int] = WAVES) -> tuple[Wave, ...]:
    """The waves of each joint of an arm that residuals follow, at most one a joint.

    Parameters
    ----------
    found : Identification
        Of a serial arm, with its sag: it hides waves.
    waves : sequence of int
        Waves a turn that are tried.

    Returns
    -------
    tuple of Wave
        Those that chance would hardly make in all that were tried; none where poses are fewer
        than 100 or the loss is robust.
    """
    fit, sure = found.fit, found.fit.uncertainty
    arm = as_arm(fit.end.robot)
    if arm is None or sure.mixed or fit.estimate.state.loss != "linear":
        return ()
    pose = numbered(sure.blocks.pose)
    if int(pose.max()) + 1 < LEAST_POSES:
        return ()
    theta, by_joint = _along_joints(found, pose)
    turning = [i for i, kind in enumerate(arm.kinds) if kind == "revolute"]
    tried = len(turning) * len(waves)
    every = [_largest(i, theta[:, i], by_joint[:, i], sure, pose, waves) for i in turning]
    told = [each._replace(chance=min(1.0, tried * each.chance)) for each in every]
    return tuple(each for each in told if each.chance < _SURE)


def _along_joints(found: Solution, pose: np.ndarray) -> tuple[FloatArray, FloatArray]:
    """Joint coordinates of each pose (K, n), and whitened readings by each joint (M, n)."""
    fit, sure = found.fit, found.fit.uncertainty
    equations = sure.equations
    arm, table = as_arm(fit.end.robot), equations.table
    assert arm is not None
    theta = arm.joint_coordinates(table.actuators)
    twists = arm.joint_jacobian(table.actuators, frame="tip")
    seen = equations.prediction.predicted(fit.end)
    parts = [each.by_twist @ twists[place] for each, place in zip(seen, table.pose_of, strict=True)]
    white = [
        equations.whitening.whiten_rows(part, i, slice(0, len(part)), sure.factors)
        for i, part in enumerate(parts)
    ]
    row = sure.blocks.row
    of_rows = np.concatenate([theta[place] for place in table.pose_of])[row]
    first = np.unique(pose, return_index=True)[1]
    return of_rows[first], np.concatenate(white)


def _largest(
    i: int,
    theta: FloatArray,
    by_joint: FloatArray,
    sure: Uncertainty,
    pose: np.ndarray,
    waves: Sequence[int],
) -> Wave:
    """The wave of a joint that the residuals follow most; its chance is that of it alone."""
    fit = sure.fit
    gain = np.bincount(pose, by_joint * fit.residual)
    design = sums(fit.design * by_joint[:, None], pose)
    taken = sums(fit.design * fit.residual[:, None], pose)
    square = np.bincount(pose, by_joint**2)
    count, best = len(theta), Wave(i + 1, 0, 0.0, 1.0, _grid(theta))
    for m in waves:
        wave = np.column_stack([np.cos(m * theta), np.sin(m * theta)])
        own = wave.T @ design
        score = wave * gain[:, None] - taken @ own.T
        total, spread = score.sum(axis=0), score.T @ score
        if np.linalg.matrix_rank(spread) < 2:
            continue
        statistic = float(total @ np.linalg.solve(spread, total))
        # Hotelling's T², whose variance is about the mean of the scores
        share = min(statistic / count, 1.0 - 1e-12)
        chance = f_tail(share / (1.0 - share) * (count - 2) / 2.0, 2.0, float(count - 2))
        if chance < best.chance:
            information = (wave * square[:, None]).T @ wave - own @ own.T
            size = float(np.linalg.norm(np.linalg.solve(information, total)))
            best = best._replace(waves=m, size=size, chance=chance)
    return best


def _grid(theta: FloatArray) -> float:
    """Step of the regular grid on which a joint stood; 0 where it stood on none."""
    places = np.unique(np.round(theta, 9))
    steps = np.diff(places)
    steps = steps[steps > _STEP * max(float(np.ptp(places)), 1e-9)]
    if len(steps) < 2:
        return 0.0
    step = float(steps.min())
    off = (places - places[0]) / step
    return step if np.abs(off - np.round(off)).max() < _STEP * len(places) ** 0.5 else 0.0


def _run(found: Solution) -> tuple[Wave, ...]:
    """Waves of an arm of which sag was found."""
    own = found.fit.parameters.asked.of_effects
    return scan_waves(found) if any(name.startswith(("sag", "compliance")) for name in own) else ()


def _alike(waves: int, period: int) -> list[str]:
    """Numbers of waves that a grid of so many steps a turn cannot tell from these, the nearest."""
    most = 2 * waves // period + 2
    turns = range(-most, most + 1)
    others = {abs(sign * waves + turn * period) for turn in turns for sign in (-1, 1)} - {waves, 0}
    return [str(each) for each in sorted(sorted(others, key=lambda k: abs(k - waves))[:_NEAREST])]


def _say(found: Solution, wave: Wave) -> str:
    effect = Harmonics(wave.waves, joints=wave.joint)
    alike = ""
    if wave.steps:
        period = round(2 * np.pi / wave.steps)
        alike = (
            f"; the joint stood at steps of {np.degrees(wave.steps):.3g} deg, where"
            f" {', '.join(_alike(wave.waves, period))} … waves look alike"
        )
    return (
        f"residuals follow {wave.waves} waves a turn of joint {wave.joint}, of"
        f" {wave.size * 1e6:.3g} µrad ({chance_text(wave.chance)} among all that were tried): a"
        f" harmonic drive of ratio {wave.waves / 2:g} makes as many{alike};"
        f" {Remedy('effects', (effect,))}"
    )


CHECKS = (
    Check(
        name="waves", about="waves of gears that residuals of an arm follow",
        levels=("remark",),
        unless=("sag-lacking",),
        run=_run,
        say=_say,
        remedies=lambda found, wave: (
            Remedy("effects", (Harmonics(wave.waves, joints=wave.joint),)),
        ),
    ),
)  # fmt: skip
