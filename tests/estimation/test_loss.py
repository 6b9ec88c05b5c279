"""Robust losses: the square of a scaled row is its loss, exactly, and so are the derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from pkmcal.estimation.loss import limits, scaled, scaled_jacobian, weights

COMPONENTS = np.array([3, 1, 6, 3, 3])


def rho(name: str, s: np.ndarray, c: np.ndarray) -> np.ndarray:
    if name == "huber":
        return np.where(s <= c, s**2, 2 * c * s - c**2)
    return c**2 * np.log(1 + s**2 / c**2)


@pytest.mark.parametrize("scale", [1e-2, 1.0, 30.0, 1e4])
@pytest.mark.parametrize("name", ["huber", "cauchy"])
def test_the_square_of_a_row_is_its_loss(name: str, scale: float) -> None:
    rng = np.random.default_rng(0)
    residual = scale * rng.normal(size=COMPONENTS.sum())
    rows = np.split(residual, np.cumsum(COMPONENTS)[:-1])
    limit = {"huber": 1.345, "cauchy": 2.385}[name] * np.sqrt(COMPONENTS)
    found = scaled(name, residual, COMPONENTS, limits(name, COMPONENTS, np.ones(5)))
    squares = [np.sum(part**2) for part in np.split(found, np.cumsum(COMPONENTS)[:-1])]
    expected = rho(name, np.array([np.linalg.norm(row) for row in rows]), limit)
    np.testing.assert_allclose(squares, expected, rtol=1e-6)


@pytest.mark.parametrize("scale", [1e-2, 1.0, 30.0, 1e4])
@pytest.mark.parametrize("name", ["huber", "cauchy"])
def test_jacobian_equals_differences(name: str, scale: float) -> None:
    rng = np.random.default_rng(1)
    limit = limits(name, COMPONENTS, np.array([1, 2, 0.5, 1, 1.0]))
    m = COMPONENTS.sum()
    matrix, residual = rng.normal(size=(m, 4)), scale * rng.normal(size=m)
    h = 1e-6 * scale
    columns = [
        (
            scaled(name, residual + h * matrix @ e, COMPONENTS, limit)
            - scaled(name, residual - h * matrix @ e, COMPONENTS, limit)
        )
        / (2 * h)
        for e in np.eye(4)
    ]
    np.testing.assert_allclose(
        scaled_jacobian(name, residual, matrix, COMPONENTS, limit),
        np.stack(columns, axis=1),
        atol=1e-6,
    )


@pytest.mark.parametrize("name", ["huber", "cauchy"])
def test_weight_is_the_slope_of_the_loss(name: str) -> None:
    s = np.array([0.1, 1.0, 3.0, 10.0])
    c = {"huber": 1.345, "cauchy": 2.385}[name]
    slope = (rho(name, np.sqrt(s**2 + 1e-6), c) - rho(name, np.sqrt(s**2 - 1e-6), c)) / 2e-6
    one = np.ones(4, dtype=int)
    found = weights(name, s, one, limits(name, one, np.ones(4)))
    np.testing.assert_allclose(found, slope, rtol=1e-6)
