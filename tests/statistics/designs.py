"""Linear fits of real machines, and simulated errors of them: exact, and quick enough to repeat."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

import pkmcal as pk
from pkmcal.arrays import FloatArray, IntArray
from pkmcal.measurements.measurements import Measurements
from pkmcal.statistics.distributions import t_factor
from pkmcal.statistics.linear_fit import LinearFit, linear_fit, numbered

TARGETS = np.diag([100.0, 100.0, 100.0])
UNKNOWN: dict[str, Any] = {"unknown": ["frame", "target"]}


def six_joints() -> pk.SerialArm:
    """An arm of six joints, by its Denavit-Hartenberg numbers."""
    return pk.SerialArm.from_dh(
        a=[312, 1075, 225, 0, 0, 0],
        d=[670, 0, 0, 1280, 0, 215],
        alpha=np.radians([-90, 0, -90, 90, -90, 0]),
        theta=np.radians([0, -90, 0, 0, 0, 0]),
    )


def seen_by_tracker(arm: pk.SerialArm, q: FloatArray, errors: FloatArray) -> Measurements:
    """Three reflectors at joints (N, 6), with errors (N, 3, 3)."""
    pose = arm.forward(q)
    seen = np.einsum("nij,kj->nki", pose[:, :3, :3], TARGETS) + pose[:, None, :3, 3]
    index = np.tile(np.arange(3), len(q))
    values = (seen + errors).reshape(-1, 3)
    return Measurements(
        np.repeat(q, 3, axis=0), values, "position", target=TARGETS, target_index=index
    )


@dataclass(frozen=True, eq=False)
class Design:
    """A linear fit, and which of its parameters are determined."""

    fit: LinearFit
    known: FloatArray
    row: IntArray

    @property
    def contrasts(self) -> FloatArray:
        return self.fit.back[self.known]

    def fitted(self, errors: FloatArray) -> tuple[LinearFit, FloatArray]:
        """The fit to errors (M,), and the errors of the parameters that follow."""
        b = self.fit.design.T @ errors
        return replace(self.fit, residual=errors - self.fit.design @ b), self.contrasts @ b


def _design(found: pk.Identification) -> Design:
    fit = found.fit.uncertainty.fit
    size = np.sqrt(len(fit.residual) / fit.design.shape[1])
    even = replace(fit, back=fit.back * size)
    return Design(even, np.isfinite(found.stderr), found.fit.uncertainty.blocks.row)


@cache
def arm(poses: int) -> Design:
    """33 numbers of an arm from three reflectors, frame and reflectors unknown."""
    rng, robot = np.random.default_rng(0), six_joints()
    q = rng.uniform(-1.5, 1.5, (poses, 6))
    measured = seen_by_tracker(robot, q, rng.normal(0, 0.01, (poses, 3, 3)))
    return _design(pk.identify(robot, measured, **UNKNOWN))


@cache
def hexapod(
    poses: int, repeats: int = 1, kind: str = "position", free: str | None = "offset*"
) -> Design:
    robot = pk.load("hexapod")
    q = np.repeat(robot.inverse(pk.sample_poses(robot, poses, seed=0, share=0.5)), repeats, axis=0)
    pose = robot.forward(q).pose
    values = pose if kind == "pose" else pose[:, :3]
    noise = np.random.default_rng(0).normal(size=values.shape) * 1e-5
    return _design(pk.identify(robot, Measurements(q, values + noise, kind), free=free))  # type: ignore[arg-type]


def errors(design: Design, shared: float, rng: np.random.Generator) -> FloatArray:
    """Unit errors (M,) of readings, and errors that equations of a pose and component share."""
    key = design.fit.key()
    own = rng.normal(size=len(key))
    return own + shared * rng.normal(size=int(key.max()) + 1)[key]


def coverage(
    design: Design,
    draw: Callable[[np.random.Generator], FloatArray],
    covered: Callable[[LinearFit], tuple[FloatArray, FloatArray]],
    runs: int,
    seed: int = 0,
) -> tuple[float, FloatArray, FloatArray]:
    """Share of true values in 95 % intervals, their half widths and the errors, run by run.

    `covered` gives variance and degrees of freedom of each contrast of a fit.
    """
    rng = np.random.default_rng(seed)
    widths, off = [], []
    for _ in range(runs):
        fit, error = design.fitted(draw(rng))
        variance, freedom = covered(fit)
        widths.append(t_factor(freedom) * np.sqrt(variance))
        off.append(error)
    half, wrong = np.array(widths), np.array(off)
    return float((np.abs(wrong) < half).mean()), half, wrong


def refitted(
    design: Design, relative: FloatArray, errors: FloatArray
) -> tuple[Design, LinearFit, FloatArray]:
    """The same with equations divided by deviations (M,): design, fit and errors of parameters."""
    fit = design.fit
    jacobian = fit.design / relative[:, None]
    p = jacobian.shape[1]
    other = linear_fit(
        jacobian, errors / relative, np.zeros((0, p)), np.eye(p), fit.cluster, fit.component
    )
    weighted = Design(replace(other, back=fit.back @ other.back), design.known, design.row)
    return (weighted, *weighted.fitted(errors / relative))


def classes_of(design: Design, scheme: list[int]) -> IntArray:
    return numbered(np.array(scheme)[design.fit.component])
