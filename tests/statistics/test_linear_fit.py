"""Factorisations on which the statistics of a fit rest."""

from __future__ import annotations

import numpy as np
import pytest

from pkmcal.statistics.linear_fit import column_basis, linear_fit, reweighted, triangle


@pytest.mark.parametrize("columns", [3, 64, 65, 90, 140])
def test_a_factor_has_the_normal_matrix_of_its_rows(columns: int) -> None:
    """Also where columns are so many that rows join a factor by few columns at a time."""
    rng = np.random.default_rng(columns)
    rows = rng.normal(size=(500, columns)) * np.logspace(0, 3, columns)
    rows[:, 1] = 0.0  # a number that nothing shows
    rows[:, 2] = 2.0 * rows[:, 0]
    factor = triangle(rows[:17], [rows[17:, :2], rows[17:, 2:]])
    size = np.maximum(np.linalg.norm(rows, axis=0), 1.0)
    assert factor.shape == (columns, columns) and not np.tril(factor, -1).any()
    np.testing.assert_allclose(
        factor.T @ factor / np.outer(size, size), rows.T @ rows / np.outer(size, size), atol=1e-13
    )


def test_fewer_rows_than_columns_have_as_many_in_their_factor() -> None:
    rows = np.random.default_rng(0).normal(size=(40, 100))
    factor = triangle(rows)
    assert factor.shape == (40, 100)
    np.testing.assert_allclose(factor.T @ factor, rows.T @ rows, atol=1e-11)


def test_a_known_factor_gives_the_basis_that_the_matrix_gives() -> None:
    matrix = np.random.default_rng(1).normal(size=(300, 6))
    matrix[:, 5] = matrix[:, 4]
    basis = column_basis(matrix, triangle(matrix))
    assert basis.shape == (300, 5)
    np.testing.assert_allclose(basis.T @ basis, np.eye(5), atol=1e-12)
    np.testing.assert_allclose(basis @ (basis.T @ matrix), matrix, atol=1e-12)


def test_a_fit_that_is_weighted_twice_is_that_of_both_weights_at_once() -> None:
    """Against least squares of all rows, those of the prior among them."""
    rng = np.random.default_rng(2)
    design, values = rng.normal(size=(30, 3)), rng.normal(size=30)
    prior, known = 2.0 * np.eye(3)[:2], rng.normal(size=2)
    first, second = rng.uniform(0.2, 5.0, (2, 30))

    def left(deviations: np.ndarray) -> np.ndarray:
        rows = np.vstack([design / deviations[:, None], prior])
        wanted = np.concatenate([values / deviations, known])
        return wanted - rows @ np.linalg.lstsq(rows, wanted, rcond=None)[0]

    plain, each = left(np.ones(30)), np.arange(30)
    fit = linear_fit(design, plain[:30], prior, np.eye(3), each, each)
    once = reweighted(fit, first, plain[30:])
    twice = reweighted(once[0], second, once[1])
    for (found, beyond), deviations in ((once, first), (twice, first * second)):
        np.testing.assert_allclose(
            np.concatenate([found.residual, beyond]), left(deviations), atol=1e-12
        )


def test_a_basis_of_columns_that_are_none_or_zero_is_empty() -> None:
    """As of parts that only others reach: there the test of two machines had ended in an error."""
    assert column_basis(np.zeros((5, 0))).shape == (5, 0)
    assert column_basis(np.zeros((5, 2))).shape == (5, 0)
