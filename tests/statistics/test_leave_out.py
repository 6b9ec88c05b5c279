"""Clusters left out in closed form against as many fits by NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pkmcal.statistics.leave_out import leave_out


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), clusters=st.integers(4, 9), priors=st.integers(0, 3))
def test_what_is_missed_is_what_fits_without_the_cluster_miss(
    seed: int, clusters: int, priors: int
) -> None:
    rng = np.random.default_rng(seed)
    cluster = np.sort(np.r_[np.arange(clusters), rng.integers(0, clusters, 20)])
    jacobian, values = rng.normal(size=(len(cluster), 5)), rng.normal(size=len(cluster))
    prior, known = rng.normal(size=(priors, 5)), rng.normal(size=priors)
    found = leave_out(jacobian, values, prior, known, cluster)
    for k in range(clusters):
        rest = cluster != k
        x = np.linalg.lstsq(
            np.vstack([jacobian[rest], prior]), np.r_[values[rest], known], rcond=None
        )[0]
        np.testing.assert_allclose(found.without[k], x, rtol=0, atol=1e-8)
        missed = values[~rest] - jacobian[~rest] @ x
        np.testing.assert_allclose(found.missed[~rest], missed, rtol=0, atol=1e-7)


def test_rows_that_alone_decide_a_number_are_not_compared() -> None:
    jacobian = np.eye(4, 2)
    jacobian[2:, 0] = 1.0  # the second number is decided by one row
    found = leave_out(jacobian, np.arange(4.0), np.zeros((0, 2)), np.zeros(0), np.arange(4))
    assert np.isnan(found.missed).tolist() == [False, True, False, False]


def test_the_deviation_is_that_of_the_noise() -> None:
    rng = np.random.default_rng(0)
    jacobian = rng.normal(size=(4000, 6))
    values = jacobian @ np.arange(6.0) + rng.normal(0, 0.3, 4000)
    found = leave_out(jacobian, values, np.zeros((0, 6)), np.zeros(0), np.arange(4000) // 4)
    assert found.deviation == pytest.approx(0.3, rel=0.05)
