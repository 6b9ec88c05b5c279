"""The score test of held numbers says what a fit with them would find."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pkmcal.arrays import FloatArray
from pkmcal.statistics.linear_fit import linear_fit
from pkmcal.statistics.score_test import columns_of, score_test

from .designs import arm, errors, hexapod


def test_it_is_what_least_squares_with_the_numbers_finds() -> None:
    rng = np.random.default_rng(0)
    for prior in (np.zeros((0, 4)), np.diag([3.0, 0, 0, 0])[:1]):
        jacobian, columns = rng.normal(size=(30, 4)), rng.normal(size=(30, 2))
        y, q = rng.normal(size=30), len(prior)

        def solved(design: FloatArray, rows: FloatArray, y: FloatArray = y) -> FloatArray:
            known = np.concatenate([y, np.zeros(len(rows))])
            return np.linalg.lstsq(np.vstack([design, rows]), known, rcond=None)[0]

        left = y - jacobian @ solved(jacobian, prior)
        cluster = np.arange(30) // 2
        fit = linear_fit(jacobian, left, prior, np.eye(4), cluster, np.arange(30) % 2)
        found = score_test(fit, columns_of(columns))
        assert found is not None
        both = np.hstack([jacobian, columns])
        whole = solved(both, np.hstack([prior, np.zeros((q, 2))]))
        assert_allclose(found.size, whole[4:], rtol=1e-9)
        if not q:
            assert found.drop == pytest.approx(left @ left - ((y - both @ whole) ** 2).sum())
            assert_allclose(left - found.explained, y - both @ whole, atol=1e-12)


@pytest.mark.parametrize("shared", [0.0, 3.0])
def test_it_has_the_chance_it_states_whatever_poses_share(shared: float) -> None:
    """Of 400 draws 5 % are 20 ± 4.4."""
    for design in (arm(25), hexapod(20, 3)):
        rng = np.random.default_rng(1)
        columns = rng.normal(size=(len(design.fit.residual), 3))
        chances = []
        for _ in range(400):
            fit, _ = design.fitted(errors(design, shared, rng))
            found = score_test(fit, columns_of(columns))
            assert found is not None
            chances.append(found.chance)
        assert 6 <= np.sum(np.array(chances) < 0.05) <= 34


def test_what_parameters_take_up_is_not_tested() -> None:
    fit = hexapod(20).fit
    assert (
        score_test(replace(fit, residual=np.ones(len(fit.residual))), columns_of(fit.design[:, :2]))
        is None
    )


def test_columns_in_lots_are_the_columns_as_a_whole() -> None:
    """And those in other units say the same of what they explain."""
    fit = hexapod(20, 3).fit
    rng = np.random.default_rng(0)
    fit = replace(fit, residual=rng.normal(size=len(fit.residual)))
    columns = rng.normal(size=(len(fit.residual), 3))
    whole = score_test(fit, columns_of(columns))
    units = np.array([1e-3, 1.0, 1e4])
    lots = [slice(a, a + 7) for a in range(0, len(columns), 7)]
    other = score_test(fit, lambda: ((rows, columns[rows] * units) for rows in lots))
    assert whole is not None and other is not None
    assert_allclose(other.size * units, whole.size, rtol=1e-9)
    assert_allclose(other.deviation * units, whole.deviation, rtol=1e-9)
    assert other.chance == pytest.approx(whole.chance)
