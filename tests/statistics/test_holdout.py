"""Points held out: how far off they should be, and when they contradict the fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.statistics.clusters import Sandwich
from pkmcal.statistics.distributions import f_tail, skew_f_tail
from pkmcal.statistics.holdout_test import CHANCE, HoldoutTest, Lengths, holdout_test
from pkmcal.statistics.linear_fit import linear_fit, numbered
from pkmcal.statistics.noise import noise

from .designs import Design, arm, errors, hexapod


def parted(design: Design, fitted: int) -> tuple[Design, FloatArray, IntArray]:
    """A fit to the first poses alone, the design of the others in its basis, and which they are."""
    whole = design.fit
    mine = whole.cluster < fitted
    p = whole.design.shape[1]
    fit = linear_fit(
        whole.design[mine], whole.residual[mine], np.zeros((0, p)), np.eye(p),
        whole.cluster[mine], whole.component[mine],
    )  # fmt: skip
    rest = np.flatnonzero(~mine)
    part = Design(
        replace(fit, back=whole.back @ fit.back), design.known, numbered(design.row[mine])
    )
    return part, whole.design[rest] @ fit.back, rest


def drawn(design: Design, shared: float, tails: bool, rng: np.random.Generator) -> FloatArray:
    """Errors (M,) of unit deviation, normal or with the tails of Student's t of 4."""
    if not tails:
        return errors(design, shared, rng)
    of_key = rng.standard_t(4, size=int(design.fit.key().max()) + 1) / np.sqrt(2.0)
    own = rng.standard_t(4, size=len(design.fit.key())) / np.sqrt(2.0)
    total: FloatArray = own + shared * of_key[design.fit.key()]
    return total


def compared(
    design: Design, fitted: int, y: FloatArray, factor: float = 1.0
) -> tuple[HoldoutTest, float, float]:
    """The test of points held out, and their mean square, actual and expected."""
    part, outside, rest = parted(design, fitted)
    mine = design.fit.cluster < fitted
    fit, _ = part.fitted(y[mine])
    sandwich = Sandwich(fit)
    of_noise = noise(sandwich.residual, sandwich.retained, fit.key())
    unit = np.sqrt(of_noise[0])
    left = factor * (y[rest] - outside @ (fit.design.T @ y[mine]))
    test = holdout_test(
        Lengths(sandwich.residual / unit, fit.design, part.row, fit.cluster, fit.component),
        Lengths(
            left / unit, outside / unit, numbered(design.row[rest]),
            numbered(design.fit.cluster[rest]), design.fit.component[rest],
        ),
        noise(sandwich.residual / unit, sandwich.retained, fit.key()),
        sandwich.data,
    )  # fmt: skip
    expected = of_noise[0] + np.einsum("ij,jk,ik->", outside, sandwich.data, outside) / len(rest)
    return test, float(np.mean(left**2)), float(expected)


CELLS = [
    (hexapod(60), 30, 0.0),
    (arm(40), 25, 0.0),
    (arm(40), 25, 2.0),
    (hexapod(40, 5), 25, 2.0),
]


def several(
    design: Design, fitted: int, shared: float, runs: int, tails: bool = False
) -> tuple[float, float, float]:
    """Share of alarms, of chances below 1 %, and rms over what was expected."""
    rng = np.random.default_rng(11)
    found = [compared(design, fitted, drawn(design, shared, tails, rng)) for _ in range(runs)]
    tests = [test for test, _, _ in found]
    actual, expected = np.mean([(a, e) for _, a, e in found], axis=0)
    return (
        float(np.mean([test.contradicts for test in tests])),
        float(np.mean([test.chance < 0.01 for test in tests])),
        float(np.sqrt(actual / expected)),
    )


@pytest.mark.parametrize(("design", "fitted", "shared"), CELLS)
def test_what_is_expected_comes_true_and_sound_fits_raise_no_alarm(
    design: Design, fitted: int, shared: float
) -> None:
    alarms, _, ratio = several(design, fitted, shared, 60)
    assert alarms <= 4 / 60
    assert 0.93 < ratio < 1.07


@pytest.mark.slow
@pytest.mark.parametrize(("design", "fitted", "shared"), CELLS)
def test_alarms_are_at_most_2_percent_in_500_fits(
    design: Design, fitted: int, shared: float
) -> None:
    alarms, low, ratio = several(design, fitted, shared, 500)
    assert alarms <= 0.02 and low <= 0.03
    assert 0.97 < ratio < 1.03


@pytest.mark.slow
@pytest.mark.parametrize(
    ("design", "fitted", "shared", "tails"),
    [
        (hexapod(12), 6, 0.0, False),
        (hexapod(15, 5), 10, 2.0, False),
        *((design, fitted, shared, True) for design, fitted, shared in CELLS),
    ],
)
def test_alarms_are_at_most_5_percent_with_few_poses_or_heavy_tails(
    design: Design, fitted: int, shared: float, tails: bool
) -> None:
    assert several(design, fitted, shared, 500, tails)[0] <= 0.05


def test_points_twice_as_far_off_contradict_the_fit() -> None:
    rng = np.random.default_rng(5)
    for design, fitted, shared in CELLS:
        found = [compared(design, fitted, errors(design, shared, rng), 2.0)[0] for _ in range(30)]
        # errors that the points of a pose share make the sum of their squares scatter more
        assert np.mean([test.contradicts for test in found]) > (0.65 if shared else 0.8)


def test_a_few_gross_points_are_named_not_taken_for_a_shift() -> None:
    rng, design = np.random.default_rng(6), hexapod(60)
    rest = parted(design, 30)[2]
    found = []
    for _ in range(20):
        y = errors(design, 0.0, rng)
        y[rest[:3]] += 40.0
        found.append(compared(design, 30, y)[0])
    assert all(test.few_off for test in found)
    assert np.mean([test.contradicts for test in found]) <= 0.15  # by chance of the median


@pytest.mark.parametrize("share", [0.2, 0.7, 0.98])
def test_errors_that_a_pose_has_in_common_take_degrees_of_freedom(share: float) -> None:
    """Those of actuators, say: as many as a sum of squares of drawn errors has, by its variance."""
    rng = np.random.default_rng(int(100 * share))
    poses, k, n, p = 12, 3, 6, 5
    pose = np.repeat(np.arange(poses), k)
    moved = rng.normal(size=(poses, k, n)) * [3, 2, 1, 0.3, 0.1, 0.1]
    moved *= np.sqrt(share) / np.linalg.norm(moved, axis=2, keepdims=True)
    design = rng.normal(size=(poses * k, p))
    half = 0.1 * rng.normal(size=(p, p))
    many = Lengths(
        rng.normal(size=6000), np.zeros((6000, p)), np.arange(6000), np.arange(6000) // 30,
        np.zeros(6000, dtype=np.intp),
    )  # fmt: skip
    held = Lengths(rng.normal(size=poses * k), design, pose, pose, np.tile(np.arange(k), poses))
    test = holdout_test(many, held, (1.0, 0.0), half @ half.T, moved.reshape(-1, n))
    runs = 20_000
    common = np.einsum("pki,rpi->rpk", moved, rng.normal(size=(runs, poses, n))).reshape(runs, -1)
    own = np.sqrt(1.0 - share) * rng.normal(size=(runs, poses * k))
    squares = ((common + own + rng.normal(size=(runs, p)) @ half.T @ design.T) ** 2).sum(axis=1)
    assert test.freedom[0] == pytest.approx(2.0 * squares.mean() ** 2 / squares.var(), rel=0.05)


@pytest.mark.parametrize("ratio", [2.2, 2.6, 3.0])
def test_the_upper_tail_of_a_skew_sum_is_that_of_draws(ratio: float) -> None:
    """A direction of the parameters that points share weighs ten times as much as the noise."""
    rng = np.random.default_rng(0)
    weights = np.array([10.0] + 29 * [1.0])
    above = []
    for _ in range(8):
        squares = rng.chisquare(1.0, (50_000, 30)) @ weights / weights.sum()
        above.append(np.mean(squares > ratio * rng.chisquare(50.0, 50_000) / 50.0))
    first, second, third = (float((weights**k).sum()) for k in (1, 2, 3))
    freedom, skewness = first**2 / second, second**3 / third**2
    found = skew_f_tail(ratio, freedom, 50.0, skewness)
    assert found == pytest.approx(np.mean(above), rel=0.1)
    assert f_tail(ratio, freedom, 50.0) < 0.9 * found


def test_the_least_ratio_is_where_points_begin_to_contradict() -> None:
    tested = HoldoutTest(2.0, 2.0, 0.0, (12.0, 50.0), skewness=3.0)
    limit = tested.least_ratio
    assert skew_f_tail(limit**2, 12.0, 50.0, 3.0) == pytest.approx(CHANCE, rel=1e-4)
    plain = HoldoutTest(2.0, 2.0, 0.0, (12.0, 50.0)).least_ratio
    assert f_tail(plain**2, 12.0, 50.0) == pytest.approx(CHANCE, rel=1e-4)
    assert plain < limit


def test_parameters_that_all_points_share_make_their_squares_skew() -> None:
    """Against eigenvalues of the covariance of the residuals."""
    rng = np.random.default_rng(3)
    design, root = rng.normal(size=(24, 4)), rng.normal(size=(4, 4))
    covariance = 0.3 * root @ root.T
    rows = np.arange(24)
    held = Lengths(rng.normal(size=24), design, rows, rows, 0 * rows)
    fitted = Lengths(rng.normal(size=60), rng.normal(size=(60, 4)) * 0.1, *3 * [np.arange(60)])
    tested = holdout_test(fitted, held, (1.0, 0.0), covariance)
    size = np.linalg.eigvalsh(np.eye(24) + design @ covariance @ design.T)
    expected = (size**2).sum() ** 3 / (size**3).sum() ** 2
    whole = size.sum() ** 2 / (size**2).sum()
    assert tested.skewness == pytest.approx(expected * tested.freedom[0] / whole, rel=1e-9)
