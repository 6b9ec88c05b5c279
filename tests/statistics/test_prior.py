"""Priors: contradicted ones are found, and the noise is what the data alone show."""

from __future__ import annotations

import numpy as np
import pytest

from pkmcal.arrays import FloatArray
from pkmcal.statistics.prior_test import PriorTest, data_alone, prior_test

from .designs import arm, hexapod


def simulated(prior: float, wrong: float, rng: np.random.Generator) -> PriorTest:
    """33 parameters of an arm whose prior has deviation `prior`; one is `wrong` of these off."""
    jacobian = arm(40).fit.design * np.sqrt(360.0 / 33.0)
    k = 20
    true = rng.normal(size=k) * prior
    if wrong:
        true[rng.integers(k)] = wrong * prior * rng.choice([-1.0, 1.0])
    others = rng.normal(size=jacobian.shape[1] - k) * 3.0
    data = jacobian @ np.concatenate([true, others]) + 0.1 * rng.normal(size=len(jacobian))
    return contrasted(jacobian, k, data, prior)


def contrasted(jacobian: FloatArray, k: int, data: FloatArray, prior: float) -> PriorTest:
    squares, freedom = data_alone(jacobian, data)
    return prior_test(prior * jacobian[:, :k], jacobian[:, k:], data, squares / freedom, freedom)


def test_noise_of_the_data_alone_does_not_depend_on_parameters() -> None:
    jacobian = hexapod(20).fit.design
    rng = np.random.default_rng(0)
    noise = rng.normal(size=len(jacobian))
    pure = data_alone(jacobian, noise)
    for scale in (1.0, 1e3):
        squares, freedom = data_alone(jacobian, noise + jacobian @ rng.normal(size=6) * scale)
        assert (squares, freedom) == pytest.approx(pure, rel=1e-9)
    assert pure[1] == len(jacobian) - 6
    left = noise - jacobian @ (jacobian.T @ noise)
    assert pure[0] == pytest.approx(left @ left, rel=1e-9)


def test_the_ratio_is_the_prior_predictive_mean_square() -> None:
    """zᵀ (σ² + J P Jᵀ)⁻¹ z over the rank, in the space that the others leave."""
    rng = np.random.default_rng(1)
    jacobian, data = rng.normal(size=(12, 5)), rng.normal(size=12)
    found = prior_test(0.3 * jacobian[:, :3], jacobian[:, 3:], data, 0.04, np.inf)
    basis = np.linalg.svd(jacobian[:, 3:])[0][:, 2:]
    own, left = basis.T @ jacobian[:, :3], basis.T @ data
    whole = np.linalg.inv(0.04 * np.eye(10) + 0.09 * own @ own.T)
    alone = left @ left - left @ own @ np.linalg.solve(own.T @ own, own.T @ left)
    assert found.ratio * 3 == pytest.approx(left @ whole @ left - alone / 0.04, rel=1e-9)


@pytest.mark.parametrize("prior", [0.05, 0.3, 2.0])
def test_right_priors_are_rarely_contradicted(prior: float) -> None:
    rng = np.random.default_rng(2)
    found = [simulated(prior, 0.0, rng) for _ in range(300)]
    assert np.mean([test.chance < 0.01 for test in found]) < 0.03
    assert np.mean([test.pull_chance < 0.01 for test in found]) < 0.03
    assert np.mean([test.chance for test in found]) == pytest.approx(0.5, abs=0.08)


def test_a_prior_ten_times_too_small_is_contradicted_and_the_fitting_one_named() -> None:
    rng, jacobian = np.random.default_rng(3), arm(40).fit.design * np.sqrt(360.0 / 33.0)
    for _ in range(20):
        data = jacobian @ rng.normal(size=33) + 0.1 * rng.normal(size=len(jacobian))
        found = contrasted(jacobian, 33, data, 0.1)
        assert found.contradicted
        assert 5.0 < found.factor < 20.0


def test_a_number_far_off_has_the_largest_pull() -> None:
    rng, jacobian = np.random.default_rng(4), hexapod(40).fit.design * np.sqrt(120.0 / 6.0)
    for _ in range(20):
        true = rng.normal(size=6) * 0.3
        true[2] = 3.0
        found = contrasted(jacobian, 6, jacobian @ true + 0.05 * rng.normal(size=120), 0.3)
        assert found.contradicted and np.nanargmax(np.abs(found.pulls)) == 2


def test_a_prior_on_which_the_data_say_nothing_is_not_contradicted() -> None:
    rng = np.random.default_rng(5)
    others = rng.normal(size=(6, 6))
    found = prior_test(rng.normal(size=(6, 3)), others, rng.normal(size=6), 1.0, np.inf)
    assert not found.contradicted and np.isnan(found.pulls).all()


def test_a_prior_of_which_the_data_say_next_to_nothing_is_not_contradicted() -> None:
    """Far tighter than what the data could show: no parameter is moved enough to be judged."""
    rng = np.random.default_rng(5)
    jacobian = rng.normal(size=(30, 4))
    found = contrasted(jacobian, 2, rng.normal(size=30), 1e-6)
    assert np.isnan(found.pulls).all()
    assert found.pull_chance == 1.0 and not found.contradicted
