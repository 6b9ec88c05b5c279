"""Blocks left out in closed form, against fits without them; their variance against draws."""

import numpy as np
import pytest

from pkmcal.statistics.left_out import left_out, residuals_left_out
from pkmcal.statistics.linear_fit import linear_fit


def made(seed, m=60, n=5, own=0):
    """A linear fit, its Jacobian, readings and blocks; `own` columns are of the last block."""
    random = np.random.default_rng(seed)
    block = np.repeat(np.arange(4), m // 4)
    jacobian = random.normal(size=(m, n))
    jacobian[block < 3, n - own :] = 0.0
    y = random.normal(size=m)
    theta = np.linalg.lstsq(jacobian, y, rcond=None)[0]
    rows = np.arange(m)
    fit = linear_fit(jacobian, y - jacobian @ theta, np.zeros((0, n)), np.eye(n), rows, 0 * rows)
    return fit, jacobian, y, block


@pytest.mark.parametrize("seed", range(5))
def test_it_is_a_fit_without_the_block(seed):
    fit, jacobian, y, block = made(seed)
    found = left_out(fit, block)
    for b in range(4):
        rest = block != b
        theta = np.linalg.lstsq(jacobian[rest], y[rest], rcond=None)[0]
        np.testing.assert_allclose(
            found.residual[~rest], y[~rest] - jacobian[~rest] @ theta, atol=1e-9
        )


@pytest.mark.parametrize(("blocks", "own"), [(4, 0), (4, 2), (20, 0), (60, 0)])
def test_small_blocks_together_are_each_left_out(blocks, own):
    """Of more equations than numbers, of fewer, and of one."""
    fit, jacobian, y, quarter = made(2, own=own)
    block = quarter if own else np.arange(60) % blocks
    found = residuals_left_out(fit, block)
    np.testing.assert_allclose(found, left_out(fit, block).residual, atol=1e-9)
    for b in range(0 if own else blocks):
        rest = block != b
        theta = np.linalg.lstsq(jacobian[rest], y[rest], rcond=None)[0]
        np.testing.assert_allclose(found[~rest], y[~rest] - jacobian[~rest] @ theta, atol=1e-9)


def test_numbers_of_a_block_alone_are_found_from_it():
    fit, jacobian, y, block = made(3, own=2)
    found = left_out(fit, block)
    common = np.linalg.lstsq(jacobian[block < 3, :3], y[block < 3], rcond=None)[0]
    last = block == 3
    own = jacobian[last, 3:]
    off = y[last] - jacobian[last, :3] @ common
    best = np.linalg.lstsq(own, off, rcond=None)[0]
    np.testing.assert_allclose(found.residual[last], off - own @ best, atol=1e-8)


def test_variance_and_chance_are_those_of_draws():
    random, fit = np.random.default_rng(0), made(1)[0]
    block = made(1)[3]
    squares, ratios, low = np.zeros(60), [], 0
    for _ in range(400):
        noise = random.normal(size=60)
        residual = noise - fit.design @ (fit.design.T @ noise)
        other = type(fit)(fit.design, residual, fit.prior, fit.back, fit.cluster, fit.component)
        found = left_out(other, block)
        squares += found.residual**2 / 400
        ratios.append(found.ratio)
        low += found.chance < 0.05
    np.testing.assert_allclose(
        squares.mean(),
        (left_out(fit, block).variance / (fit.squares / fit.freedom)).mean(),
        rtol=0.05,
    )
    assert np.mean(np.square(ratios)) == pytest.approx(1.0, abs=0.05)
    assert low / 400 < 0.07
