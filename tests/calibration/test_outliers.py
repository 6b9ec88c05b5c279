"""Rows that the others contradict: judged in a fit of the rest, and only where these do."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.calibration.outliers import outliers

FALSE_ALARM = 0.01  # chance of naming any row of good ones


def named(residual: FloatArray, design: FloatArray, prior: FloatArray | None = None) -> list[int]:
    """Outliers of rows of one equation, all of weight 1, with the prior's equations."""
    known = np.empty((0, design.shape[1])) if prior is None else prior
    half = np.linalg.inv(np.linalg.cholesky(design.T @ design + known.T @ known)).T
    ones = np.ones(len(residual), dtype=np.intp)
    return outliers(residual, design @ half, ones, np.ones(len(residual)), known @ half).tolist()


def left(values: FloatArray, design: FloatArray) -> FloatArray:
    found: FloatArray = values - design @ np.linalg.lstsq(design, values, rcond=None)[0]
    return found


def without(values: FloatArray, design: FloatArray, row: int) -> float:
    """Residual of a row in a fit of all others, over its deviation."""
    rest = np.arange(len(values)) != row
    at = np.linalg.lstsq(design[rest], values[rest], rcond=None)[0]
    own = design[row] @ np.linalg.solve(design[rest].T @ design[rest], design[row])
    return float((values[row] - design[row] @ at) / np.sqrt(1.0 + own))


@pytest.mark.parametrize("share", [0.98, 1.02])
@pytest.mark.parametrize("row", [0, 7, 19])
def test_a_row_is_odd_by_its_residual_in_a_fit_of_all_others(row: int, share: float) -> None:
    """One of twenty exact rows is moved until the chance of that is one in a hundred."""
    design = np.random.default_rng(0).normal(size=(20, 3))
    values = np.zeros(20)
    values[row] = 1.0
    limit = np.sqrt(chi2.isf(FALSE_ALARM / 20, 1))
    values[row] = share * limit / without(values, design, row)
    assert named(left(values, design), design) == ([row] if share > 1.0 else [])


@pytest.mark.parametrize(("off", "odd"), [(3.0, []), (3.6, [0, 1])])
def test_rows_are_set_aside_only_while_the_rest_contradicts_one(off: float, odd: list[int]) -> None:
    """Two of six rows of one number are off alike: beside the other four, but not one by one."""
    design = np.zeros((40, 2))
    design[:6, 0], design[6:, 1] = 1.0, 1.0
    residual = np.zeros(40)
    residual[:2], residual[2:6] = off, -off / 2.0
    limit = chi2.isf(FALSE_ALARM / 40, 1)
    each, both = off**2 / (1.0 - 1.0 / 6.0), (1.5 * off) ** 2 / (1.0 + 1.0 / 4.0)
    assert (each > limit) == bool(odd) and both > limit
    assert named(residual, design) == odd


def test_where_all_is_noisier_than_stated_a_row_has_to_be_further_off() -> None:
    """Three times the noise that is stated, and one row fifteen times as far off as that."""
    rng = np.random.default_rng(1)
    design, values = rng.normal(size=(60, 2)), 3.0 * rng.normal(size=60)
    assert named(left(values, design), design) == []
    values[11] += 45.0
    assert named(left(values, design), design) == [11]


def test_a_prior_stays_where_rows_are_set_aside() -> None:
    """The only two rows of a number contradict what is known of it and each other."""
    design = np.vstack([np.eye(3)[[0, 0]], np.tile(np.eye(3)[1:], (10, 1))])
    prior = np.array([[10.0, 0.0, 0.0]])  # the first number is 0 ± 0.1
    values = np.zeros(22)
    values[:2] = 8.0, 0.05
    normal = design.T @ design + prior.T @ prior
    residual = values - design @ np.linalg.solve(normal, design.T @ values)
    assert named(residual, design, prior) == [0]


def test_rows_of_unlike_many_components_are_judged_alike() -> None:
    """Rows of one and of three equations, the square of each against its own χ²."""
    components: IntArray = np.array([1] * 10 + [3] * 10)
    first = np.cumsum(components) - components
    design = np.zeros((40, 1))
    for row, odd in ((4, True), (4, False), (15, True), (15, False)):
        residual = np.zeros(40)
        length = np.sqrt(chi2.isf(FALSE_ALARM / 20, components[row])) * (1.02 if odd else 0.98)
        residual[first[row] + components[row] - 1] = length
        found = outliers(residual, design, components, np.ones(20), np.eye(1))
        assert found.tolist() == ([row] if odd else [])
