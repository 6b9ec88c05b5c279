"""Rows that the others contradict: judged in a fit of the rest, and only where these do."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.stats import chi2

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.fitted import outliers as odd_rows
from pkmcal.fitted.outliers import outliers

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


def without(value: float, design: FloatArray, row: int, prior: FloatArray) -> float:
    """Residual of a row in a fit of all others, which are 0, over its deviation."""
    rest = np.delete(design, row, axis=0)
    normal = rest.T @ rest + prior.T @ prior
    own = design[row] @ np.linalg.solve(normal, design[row])
    return float(value / np.sqrt(1.0 + own))


@pytest.mark.parametrize("known", [0.0, 1.0, 10.0])
@pytest.mark.parametrize("share", [0.98, 1.02])
@pytest.mark.parametrize("row", [0, 7, 19])
def test_a_row_is_odd_by_its_residual_in_a_fit_of_all_others(
    row: int, share: float, known: float
) -> None:
    """One of twenty exact rows is moved until the chance of that is one in a hundred."""
    rng = np.random.default_rng(0)
    design, prior = rng.normal(size=(20, 3)), known * rng.normal(size=(2, 3))
    limit = np.sqrt(chi2.isf(FALSE_ALARM / 20, 1))
    values = np.zeros(20)
    values[row] = share * limit / without(1.0, design, row, prior)
    normal = design.T @ design + prior.T @ prior
    residual = values - design @ np.linalg.solve(normal, design.T @ values)
    assert named(residual, design, prior) == ([row] if share > 1.0 else [])


@pytest.mark.parametrize(("gross", "odd"), [(5, 5), (9, 6)])
def test_at_most_a_quarter_of_the_rows_and_one_are_odd(gross: int, odd: int) -> None:
    """Those that are furthest off, though the chance of each is 0 to the last digit."""
    residual = np.zeros(20)
    residual[:gross] = 1e3 + np.arange(gross)
    design = np.zeros((20, 1))
    ones = np.ones(20)
    found = outliers(residual, design, np.ones(20, dtype=np.intp), ones, np.eye(1))
    assert found.tolist() == list(range(gross))[-odd:]


def test_the_rows_of_the_least_chance_are_odd_first() -> None:
    """Of seven rows two may be; a square of 30 in three components is likelier than 25 in one."""
    components: IntArray = np.array([1, 3, 1, 3, 3, 1, 1])
    residual = np.zeros(13)
    residual[[0, 1, 4]] = np.sqrt([25.0, 30.0, 28.0])
    found = outliers(residual, np.zeros((13, 1)), components, np.ones(7), np.eye(1))
    assert chi2.sf(28, 1) < chi2.sf(25, 1) < chi2.sf(30, 3) < FALSE_ALARM / 7
    assert found.tolist() == [0, 2]


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


def test_rows_of_unlike_many_components_are_judged_alike() -> None:
    """Rows of one and of three equations, the square of each against its own χ²."""
    components: IntArray = np.array([1] * 10 + [3] * 9 + [2])
    first = np.cumsum(components) - components
    design = np.zeros((39, 1))
    for row, odd in itertools.product((4, 15, 19), (True, False)):
        residual = np.zeros(39)
        length = np.sqrt(chi2.isf(FALSE_ALARM / 20, components[row])) * (1.02 if odd else 0.98)
        residual[first[row] + components[row] - 1] = length
        found = outliers(residual, design, components, np.ones(20), np.eye(1))
        assert found.tolist() == ([row] if odd else [])


@pytest.mark.parametrize("seed", range(3))
def test_many_gross_rows_take_few_rounds_and_are_those_of_one_at_a_time(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The time of a round grows with the rows: one round for each gross row is their product."""
    rng = np.random.default_rng(seed)
    rows, count = 3000, 60
    design = rng.normal(size=(rows, 4))
    values = rng.normal(size=rows)
    gross = np.sort(rng.choice(rows, count, replace=False))
    values[gross] += 10.0 ** rng.uniform(1.0, 4.0, count)
    rounds: list[int] = []
    median = odd_rows.median_ratio
    monkeypatch.setattr(odd_rows, "median_ratio", lambda *given: rounds.append(1) or median(*given))
    monkeypatch.setattr(odd_rows, "_AT_ONCE", 100)
    assert set(gross) <= set(found := named(left(values, design), design))
    few = len(rounds)
    monkeypatch.setattr(odd_rows, "_AT_ONCE", rows)
    assert named(left(values, design), design) == found
    assert few < (len(rounds) - few) / 2


def test_of_two_rows_that_alone_say_something_one_gross_does_not_take_both() -> None:
    """Both are off by as much: which one is gross nobody can tell, and one of them is named."""
    rng = np.random.default_rng(0)
    design = np.column_stack([np.ones(4000), np.zeros(4000)])
    design[:2, 1] = 1.0
    values = rng.normal(size=4000)
    values[0] += 1000.0
    assert len(named(left(values, design), design)) == 1
