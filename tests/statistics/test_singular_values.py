"""Singular values where LAPACK's fast method does not converge."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pkmcal.statistics.linear_fit import column_basis
from pkmcal.statistics.singular_values import svd


def _gives_up(*given: Any, **options: Any) -> Any:
    raise np.linalg.LinAlgError("SVD did not converge")


@pytest.mark.parametrize("shape", [(40, 7), (7, 7), (3, 7)])
def test_another_method_finds_them_where_the_fast_one_gives_up(
    shape: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    matrix = np.random.default_rng(0).normal(size=shape)
    fast = svd(matrix)
    monkeypatch.setattr(np.linalg, "svd", _gives_up)
    left, sizes, rows = svd(matrix)
    assert [each.shape for each in (left, sizes, rows)] == [each.shape for each in fast]
    assert np.allclose((left * sizes) @ rows, matrix, atol=1e-12)
    assert np.allclose(sizes, fast[1], rtol=1e-12)


def test_a_basis_of_orthonormal_columns_is_found_though_the_fast_method_gives_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    columns = np.linalg.qr(np.random.default_rng(1).normal(size=(60, 32)))[0]
    monkeypatch.setattr(np.linalg, "svd", _gives_up)
    basis = column_basis(columns)
    assert np.allclose(basis @ (basis.T @ columns), columns, atol=1e-12)


def test_matrices_that_are_not_finite_are_refused() -> None:
    with pytest.raises(np.linalg.LinAlgError):
        svd(np.full((3, 2), np.nan))
