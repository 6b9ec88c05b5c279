"""Robust fits: intervals and the lack-of-fit test are as right as those of least squares."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pkmcal.arrays import FloatArray
from pkmcal.estimation.loss import LossName, decline, limits, weights
from pkmcal.statistics.covariance import covariance
from pkmcal.statistics.distributions import t_factor
from pkmcal.statistics.linear_fit import LinearFit
from pkmcal.statistics.noise import split
from pkmcal.statistics.pseudo_residuals import pseudo_residuals
from pkmcal.statistics.robust_scale import median_ratio

from .designs import Design, arm, errors, hexapod


def robust_fit(design: Design, y: FloatArray, name: LossName) -> tuple[LinearFit, FloatArray]:
    """Iteratively reweighted least squares with the scale from medians; pseudo-residuals."""
    fit = design.fit
    components = np.bincount(design.row)
    m, p = fit.design.shape
    b = fit.design.T @ y
    if name != "linear":
        first = np.cumsum(components) - components
        for _ in range(100):
            r = y - fit.design @ b
            squares = np.add.reduceat(r**2, first)
            scale = np.sqrt(median_ratio(squares, components) * m / (m - p))
            of_rows = components, limits(name, components, np.full(len(components), scale))
            w = np.repeat(weights(name, r, *of_rows), components)
            new = np.linalg.solve(fit.design.T @ (w[:, None] * fit.design), fit.design.T @ (w * y))
            done = np.abs(new - b).max() < 1e-10 * scale
            b = new
            if done:
                break
    r = y - fit.design @ b
    if name != "linear":
        both = weights(name, r, *of_rows), decline(name, r, *of_rows)
        r = pseudo_residuals(r, components, *both, p)[0]
    return replace(fit, residual=r), design.contrasts @ b


def with_gross(design: Design, shared: float, share: float, rng: np.random.Generator) -> FloatArray:
    y = errors(design, shared, rng)
    bad = rng.random(int(design.row.max()) + 1) < share
    return np.where(bad[design.row], 30.0 * rng.normal(size=len(y)), y)


def held(design: Design, name: LossName, shared: float, share: float, runs: int) -> float:
    rng, inside = np.random.default_rng(3), []
    for _ in range(runs):
        fit, off = robust_fit(design, with_gross(design, shared, share, rng), name)
        found = covariance(fit, "auto", stated=False, robust=name != "linear")
        assert found.rule == "cluster"
        half = t_factor(found.freedom(design.contrasts)) * np.sqrt(
            np.diagonal(found.of(design.contrasts))
        )
        inside.append(np.abs(off) < half)
    return float(np.mean(inside))


@pytest.mark.parametrize("name", ["huber", "cauchy"])
@pytest.mark.parametrize("share", [0.0, 0.1])
def test_intervals_of_robust_fits_hold_95_percent(name: LossName, share: float) -> None:
    assert 0.92 < held(hexapod(60), name, 0.0, share, 120) < 0.98


@pytest.mark.slow
@pytest.mark.parametrize("name", ["huber", "cauchy"])
@pytest.mark.parametrize(
    ("design", "shared", "share"),
    [
        *((hexapod(60), 0.0, share) for share in (0.0, 0.05, 0.1, 0.2)),
        *((hexapod(12), 0.0, share) for share in (0.0, 0.1, 0.2)),
        (hexapod(40, 1, "pose"), 0.0, 0.2),
        *((arm(40), 1.5, share) for share in (0.0, 0.1)),
    ],
)
def test_intervals_of_robust_fits_hold_93_to_97_percent_in_500_fits(
    design: Design, shared: float, share: float, name: LossName
) -> None:
    assert 0.93 < held(design, name, shared, share, 500) < 0.975


def chances(name: LossName, shared: float, share: float, runs: int) -> FloatArray:
    design = hexapod(25, 3)
    rng, found = np.random.default_rng(0), []
    for _ in range(runs):
        fit, _ = robust_fit(design, with_gross(design, shared, share, rng), name)
        found.append(split(fit.residual, fit.key(), float(fit.leverage().sum())).chance)
    return np.array(found)


@pytest.mark.parametrize("name", ["linear", "huber", "cauchy"])
def test_a_sound_model_shows_no_lack_of_fit(name: LossName) -> None:
    found = chances(name, 0.0, 0.0, 150)
    assert np.mean(found) == pytest.approx(0.5, abs=4 / np.sqrt(12 * 150))
    assert np.mean(found < 0.05) < 0.12


@pytest.mark.slow
@pytest.mark.parametrize("name", ["linear", "huber", "cauchy"])
@pytest.mark.parametrize("share", [0.0, 0.1])
def test_chances_of_lack_of_fit_are_even_in_500_fits(name: LossName, share: float) -> None:
    assert 0.03 <= np.mean(chances(name, 0.0, share, 500) < 0.05) <= 0.07


def test_lack_of_fit_is_seen_though_rows_are_gross() -> None:
    for name in ("huber", "cauchy"):
        assert np.mean(chances(name, 1.0, 0.1, 60) < 0.05) > 0.9
    assert np.mean(chances("linear", 0.5, 0.0, 60) < 0.05) > 0.7
