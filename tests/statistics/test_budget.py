"""Budgets give what the worked examples of the GUM and of its Supplement 1 (JCGM 101) give.

The laws of propagation and distribution are computed independently, by drawing.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from pkmcal.statistics.budget import Budget, Contribution, standard

DRAWS = 400_000


def factor(probability: float, dof: float) -> float:
    """Coverage factor by Student's t, as SciPy has it."""
    return float(stats.t.ppf(0.5 + probability / 2.0, dof))


def test_the_end_gauge_of_the_gum() -> None:
    """JCGM 100, H.1: u = 32 nm, 16 degrees of freedom, U99 = 93 nm."""
    length, expansion = 50.000623e6, 11.5e-6  # nm, 1/K
    lines = (
        Contribution("standard", 25.0, dof=18),
        Contribution("comparator", 9.7, dof=25.6),
        Contribution("difference of expansion", 0.58e-6, length * 0.1, dof=50, type="B"),
        Contribution("difference of temperature", 0.029, length * expansion, dof=2, type="B"),
    )
    budget = Budget(lines, factor(0.99, 16))
    assert [round(line.share, 1) for line in lines] == [25.0, 9.7, 2.9, 16.7]
    assert round(budget.combined) == 32
    assert int(budget.dof) == 16
    assert round(budget.expanded) == 93
    assert budget.coverage == pytest.approx(0.99, abs=2e-3)


def test_four_normal_inputs_of_supplement_1() -> None:
    """JCGM 101, 9.2.2: u = 2.0, the 95 % interval is ±3.92."""
    lines = tuple(Contribution(f"X{i}", 1.0) for i in range(4))
    budget = Budget(lines, factor(0.95, np.inf))
    assert budget.combined == 2.0 and round(budget.expanded, 2) == 3.92
    assert budget.dof == np.inf and budget.coverage == pytest.approx(0.95)
    drawn = np.random.default_rng(0).normal(size=(4, DRAWS)).sum(axis=0)
    held = np.mean(np.abs(drawn) < budget.expanded)
    assert held == pytest.approx(0.95, abs=4 * np.sqrt(0.95 * 0.05 / DRAWS))


def test_four_rectangular_inputs_of_supplement_1() -> None:
    """JCGM 101, 9.2.3: u = 2.0; by the GUM ±3.92, by drawing ±3.88."""
    half = np.sqrt(3.0)  # of unit variance
    lines = tuple(Contribution(f"X{i}", standard(half, "rectangular"), type="B") for i in range(4))
    budget = Budget(lines, factor(0.95, np.inf))
    assert budget.combined == pytest.approx(2.0) and round(budget.expanded, 2) == 3.92
    drawn = np.random.default_rng(1).uniform(-half, half, (4, DRAWS)).sum(axis=0)
    assert np.quantile(np.abs(drawn), 0.95) == pytest.approx(3.88, abs=0.01)


def test_one_dominant_rectangular_input_of_supplement_1() -> None:
    """JCGM 101, 9.2.4: u = 10.1; by the GUM ±19.9, by drawing ±17.0."""
    lines = (
        *(Contribution(f"X{i}", standard(np.sqrt(3.0), "rectangular")) for i in range(3)),
        Contribution("X4", standard(10.0 * np.sqrt(3.0), "rectangular")),
    )
    budget = Budget(lines, factor(0.95, np.inf))
    assert round(budget.combined, 1) == 10.1 and round(budget.expanded, 1) == 19.9
    rng = np.random.default_rng(2)
    widths = np.array([1.0, 1.0, 1.0, 10.0])[:, None] * np.sqrt(3.0)
    drawn = (rng.uniform(-1.0, 1.0, (4, DRAWS)) * widths).sum(axis=0)
    assert np.quantile(np.abs(drawn), 0.95) == pytest.approx(17.0, abs=0.1)


@pytest.mark.parametrize("shape", ["rectangular", "triangular", "U-shaped"])
def test_divisors_are_those_of_drawn_distributions(shape: str) -> None:
    u = np.random.default_rng(3).uniform(-1.0, 1.0, (2, DRAWS))
    drawn = {"rectangular": u[0], "triangular": u.mean(axis=0), "U-shaped": np.sin(np.pi * u[0])}
    assert standard(1.0, shape) == pytest.approx(float(np.std(drawn[shape])), rel=5e-3)  # type: ignore[arg-type]


@pytest.mark.parametrize("few", [3, 8])
def test_the_coverage_that_is_stated_comes_true(few: int) -> None:
    """A scale whose deviation is known, and one that few repeats estimate: k = 2."""
    rng = np.random.default_rng(few)
    mean = rng.normal(0.0, 1.0 / np.sqrt(few + 1), 20_000)
    squares = rng.chisquare(few, 20_000) / few
    scale = rng.normal(0.0, 0.2, 20_000)
    own = np.sqrt(squares / (few + 1))
    budgets = [
        Budget((Contribution("repeats", u, dof=few), Contribution("scale", 0.2, type="B")))
        for u in own[:2000]
    ]
    held = np.mean([
        abs(m + s) < budget.expanded
        for m, s, budget in zip(mean, scale, budgets, strict=False)
    ])  # fmt: skip
    stated = np.mean([budget.coverage for budget in budgets])
    assert held == pytest.approx(stated, abs=4 * np.sqrt(0.1 / 2000))
