"""Draws of residuals that are as those of one machine: as large, shared as they are, by chance."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.statistics.alike import drawn_alike
from pkmcal.statistics.group_test import group_test
from pkmcal.statistics.linear_fit import LinearFit, linear_fit

VISITS, COMPONENTS = 40, 6


def fitted(errors: FloatArray, jacobian: FloatArray) -> LinearFit:
    m, p = jacobian.shape
    left = errors - jacobian @ np.linalg.lstsq(jacobian, errors, rcond=None)[0]
    rows = np.arange(m)
    return linear_fit(jacobian, left, np.zeros((0, p)), np.eye(p), rows, 0 * rows)


def places(visits: int, components: int) -> tuple[IntArray, IntArray, IntArray]:
    """Numbers of the equations, and visit and component of each."""
    visit, component = np.divmod(np.arange(visits * components), components)
    return np.arange(visits * components), visit, component


def draws(errors: FloatArray, by_cause: FloatArray | None = None) -> tuple[LinearFit, FloatArray]:
    """Of errors (visits, components), beside a parameter: the fit, and draws of residuals."""
    jacobian = np.random.default_rng(99).normal(size=(errors.size, 1))
    fit = fitted(errors.ravel(), jacobian)
    each = drawn_alike(fit, *places(*errors.shape), by_cause)
    return fit, np.array([one.residual.reshape(errors.shape) for one in each])


def test_draws_are_fits_of_their_own_errors() -> None:
    errors = np.random.default_rng(0).normal(size=(VISITS, COMPONENTS))
    fit, several = draws(errors)
    flat = several.reshape(len(several), -1)
    assert_allclose(flat @ fit.design, 0.0, atol=1e-12)
    assert np.linalg.matrix_rank(flat) == len(flat)  # each is another one
    assert_allclose(draws(errors)[1], several)


def ratios(components: int) -> FloatArray:
    """Squares of draws (draws, visits) over those of the fit, of visits of unlike noise."""
    rng = np.random.default_rng(1)
    loud = np.where(np.arange(300) % 3 == 0, 5.0, 1.0)[:, None]
    fit, several = draws(loud * rng.normal(size=(300, components)))
    own = (fit.residual.reshape(300, components) ** 2).sum(axis=1)
    found: FloatArray = (several**2).sum(axis=2) / own
    return found


@pytest.mark.parametrize("components", [3, 6])
def test_errors_are_as_large_at_each_visit_as_those_of_the_fit(components: int) -> None:
    """In each draw, but for what the numbers take up; some are 25 times as large as others."""
    found = ratios(components)
    assert_allclose(np.median(found, axis=0), 1.0, atol=0.4)
    assert np.median(found.std(axis=0)) < 0.2


@pytest.mark.parametrize("components", [1, 2])
def test_visits_of_few_equations_are_as_large_on_average_alone(components: int) -> None:
    """Of its own size one error would have another sign at most, as another machine's has."""
    found = ratios(components)
    assert np.median(found.mean(axis=0)) == pytest.approx(1.0, abs=0.1)
    assert np.median(found.std(axis=0)) > 0.8


def test_components_share_errors_as_they_do_on_average() -> None:
    """Where each was read once at a visit; of several readings each has errors of its own."""
    rng = np.random.default_rng(3)
    mix = np.eye(COMPONENTS)
    mix[1, 0], mix[4, 3] = 3.0, -2.0
    errors = rng.normal(size=(VISITS, COMPONENTS)) @ mix.T
    fit, several = draws(errors)
    residual = fit.residual.reshape(VISITS, COMPONENTS)
    flat = several.reshape(-1, COMPONENTS)
    assert_allclose(np.corrcoef(flat.T), np.corrcoef(residual.T), atol=0.1)
    twice = [
        one.residual.reshape(VISITS, COMPONENTS)
        for one in drawn_alike(fit, *places(VISITS, COMPONENTS)[:2], 0 * fit.component)
    ]
    assert np.abs(np.corrcoef(np.concatenate(twice).T) - np.eye(COMPONENTS)).max() < 0.15


def moved_by(rng: np.random.Generator, causes: int) -> FloatArray:
    """What each cause does to the equations of each visit: on average nothing in common."""
    return rng.normal(size=(VISITS, COMPONENTS, causes))


def of_causes(by_cause: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Errors of causes, independent at each visit, and a tenth as large ones of readings."""
    shared = np.einsum("vcn,vn->vc", by_cause, rng.normal(size=by_cause.shape[::2]))
    return shared + 0.1 * rng.normal(size=shared.shape)


def test_errors_are_shared_as_causes_let_them() -> None:
    """Two of them move six equations in two ways, which are others at each visit."""
    rng = np.random.default_rng(4)
    by_cause = moved_by(rng, 2)
    errors = of_causes(by_cause, rng)
    ways = np.linalg.qr(by_cause)[0]

    def along(several: FloatArray) -> float:
        inside = np.einsum("vcn,dvc->dvn", ways, several)
        return float((inside**2).sum() / (several**2).sum())

    flat = by_cause.reshape(-1, 2)
    assert along(draws(errors, flat)[1]) > 0.95 > along(errors[None]) - 0.05
    assert along(draws(errors)[1]) == pytest.approx(2 / COMPONENTS, abs=0.05)
    nothing = draws(errors, np.zeros_like(flat))[1]  # no cause does anything: as on average
    assert_allclose(nothing, draws(errors)[1])


def unlikely(
    fit: LinearFit, mine: FloatArray, by_cause: FloatArray, jacobian: FloatArray
) -> tuple[float, bool]:
    """The chance by itself of a group that is apart, and whether no draw has a smaller one."""

    def chance(residual: FloatArray) -> float:
        found = group_test(jacobian, residual, mine)
        assert found is not None
        return found.chance

    own = chance(fit.residual)
    each = drawn_alike(fit, *places(VISITS, COMPONENTS), by_cause)
    return own, all(chance(one.residual) > own for one in each)


def test_noise_of_actuators_alone_is_not_called_two_machines() -> None:
    """One of 40 is allowed, and kept; a test of independent errors calls many more so."""
    mine = np.repeat(np.arange(VISITS) % 2 == 0, COMPONENTS)
    plain, ours, second = [], [], []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        by_cause = moved_by(rng, 2)
        errors, flat = of_causes(by_cause, rng), by_cause.reshape(-1, 2)
        jacobian = flat + 0.2 * rng.normal(size=flat.shape)  # numbers move the machine likewise
        own, apart = unlikely(fitted(errors.ravel(), jacobian), mine, flat, jacobian)
        plain.append(own < 1 / 40)
        ours.append(apart)
        if seed < 8:
            other = errors.ravel() + 2.0 * mine * (jacobian @ rng.normal(size=2))
            second.append(unlikely(fitted(other, jacobian), mine, flat, jacobian)[1])
    assert sum(ours) <= 4  # 5 or more in 1 of 900 trials
    assert sum(plain) >= 5
    assert sum(second) >= 5
