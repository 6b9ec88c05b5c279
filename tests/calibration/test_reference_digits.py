"""Numbers of an independent implementation of the same formulas, to four digits and more.

It used matrices of all rows and NumPy's inverses on the same simulated measurements.
"""

from __future__ import annotations

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.estimation.loss import decline, limits
from pkmcal.measurements.measurements import Measurements
from pkmcal.statistics.pseudo_residuals import pseudo_residuals

from ..statistics.designs import UNKNOWN, seen_by_tracker, six_joints

# seed: rms, noise, score; then of joint2.dx and joint3.dz value, stderr, dof, half width
ARM = {
    0: ((0.267267, 0.161905, 18.319), (0.066944, 0.056671, 19.93, 0.11824),
        (-0.053537, 0.047963, 19.59, 0.10018)),
    1: ((0.227495, 0.137812, 17.108), (0.036187, 0.032728, 20.82, 0.06810),
        (-0.015521, 0.039601, 18.68, 0.08298)),
    2: ((0.260542, 0.157832, 17.877), (0.035564, 0.040028, 16.28, 0.08474),
        (-0.025245, 0.040536, 21.76, 0.08412)),
}  # fmt: skip

# seed: offset1, stderr, dof, held out, expected, p, f1, f2; of cauchy the width of its loss as the
# deviation in mm before, and its mean slope at the end
LINEAR = {
    0: (0.011116, 0.008715, 16.35, 0.108377, 0.093581, 0.0544, 73.52, 218.12),
    1: (-0.012892, 0.008867, 25.36, 0.096386, 0.084350, 0.0869, 63.57, 189.43),
    2: (0.003261, 0.010773, 19.32, 0.107033, 0.092503, 0.0570, 72.13, 214.95),
}
CAUCHY = {
    0: (0.011040, 0.008811, 16.35, 0.108364, 0.094152, 0.0626, 73.24, 217.25, 0.12954168, 0.95442),
    1: (-0.012888, 0.008774, 25.36, 0.096376, 0.084132, 0.0636, 77.64, 231.36, 0.10636765, 0.94615),
    2: (0.003011, 0.010800, 19.32, 0.106929, 0.092428, 0.0533, 75.53, 224.30, 0.11913740, 0.94835),
}


def like(value: float, digits: float) -> bool:
    """Equal to 1e-4, or to the last digit that is given."""
    last = 10.0 ** -len(f"{digits}".partition(".")[2])
    return abs(value - digits) <= max(1e-4 * abs(digits), 0.6 * last)


@pytest.mark.parametrize("seed", ARM)
def test_of_an_arm_whose_reflectors_share_errors(seed: int) -> None:
    rng, arm = np.random.default_rng(seed), six_joints()
    q = rng.uniform(-1.5, 1.5, (40, 6))
    errors = rng.normal(0, 0.15, (40, 1, 3))
    measured = seen_by_tracker(arm, q, errors + rng.normal(0, 0.05, (40, 3, 3)))
    found = pk.identify(arm, measured, **UNKNOWN)
    (rms, noise, score), *rows = ARM[seed]
    assert like(found.rms, rms) and like(found.noise[0], noise)
    assert like(found.fit.uncertainty.covariance.score, score)
    for name, (value, stderr, dof, half) in zip(("joint2.dx", "joint3.dz"), rows, strict=True):
        i = found.free.index(name)
        assert like(found.values[i], value) and like(found.stderr[i], stderr)
        assert like(found.parameter_dof[i], dof)
        assert like(found.interval95[i, 1] - found.values[i], half)


def of_hexapod(seed: int, loss: str, sigma: float | None) -> pk.Identification:
    """60 poses of five repeats, 20 more held out; the model misses 0.05 mm, readings 0.02 mm."""
    robot, rng = pk.load("hexapod"), np.random.default_rng(seed)
    q = robot.inverse(pk.sample_poses(robot, 80, seed=seed, share=0.5))
    seen = robot.forward(q).pose[:, :3] + rng.normal(0, 0.05, (80, 3))

    def readings(part: slice, sigma: float | None) -> Measurements:
        noise = rng.normal(0, 0.02, (5 * len(q[part]), 3))
        values = np.repeat(seen[part], 5, axis=0) + noise
        return Measurements(np.repeat(q[part], 5, axis=0), values, "position", sigma=sigma)

    first, later = readings(slice(0, 60), sigma), readings(slice(60, 80), None)
    return pk.identify(robot, first, free="offset*", holdout=later, loss=loss)  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", LINEAR)
@pytest.mark.parametrize("loss", ["linear", "cauchy"])
def test_of_a_hexapod_with_repeats_and_a_holdout(seed: int, loss: str) -> None:
    """The robust fit's loss has the width that the table was made with: that of this sigma."""
    digits = LINEAR[seed] if loss == "linear" else CAUCHY[seed]
    found = of_hexapod(seed, loss, None if loss == "linear" else digits[8])
    test = found.holdout_test
    assert test is not None
    numbers = (
        found.values[0], found.stderr[0], found.parameter_dof[0], found.holdout_rms,
        found.holdout_expected, test.chance, *test.freedom,
    )  # fmt: skip
    assert abs(numbers[0] - digits[0]) < 1e-4 * digits[1]  # of its deviation: it is near zero
    for number, digit in zip(numbers[1:], digits[1:8], strict=True):
        assert like(float(number), digit)
    if loss == "cauchy":
        blocks, estimate = found.fit.uncertainty.blocks, found.fit.estimate
        state, components = estimate.state, blocks.components
        limit = limits(state.loss, blocks.stands_for, state.width)
        falls = decline(state.loss, estimate.residual, components, limit)
        given = estimate.residual, components, estimate.weights, falls
        _, slope, _ = pseudo_residuals(*given, estimate.state.determined.rank)
        assert like(slope, digits[9])
