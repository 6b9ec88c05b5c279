"""Steps of readings, ends at which they crowd, and groups that are unlike: rules on arrays."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pkmcal.statistics.extremes import tied_extremes
from pkmcal.statistics.group_test import few_equations, group_test
from pkmcal.statistics.steps import deviation, step_of

from ..sweeps import sweep

seeds = st.integers(0, 10_000)


def near(x: np.ndarray) -> np.ndarray:
    """Of no size: whatever parameters differ by is possible."""
    return np.zeros((1, x.shape[1]))


@given(
    seeds, st.sampled_from([5.0, 0.5, 0.1, 0.02, 1e-3]), st.sampled_from(["mm", "inch", "deg"]),
    st.floats(-50.0, 50.0),
)  # fmt: skip
def test_what_is_rounded_is_a_multiple_of_its_step(
    seed: int, step: float, unit: str, offset: float
) -> None:
    """Whatever constant was taken off, and in inches and degrees, too."""
    size = {"mm": 1.0, "inch": 25.4, "deg": np.pi / 180}[unit]
    counts = np.random.default_rng(seed).integers(-500, 500, 40)
    counts[:2] = 0, 1
    found = step_of((counts * step + offset) * size, "rad" if unit == "deg" else "mm")
    assert found == pytest.approx(step * size, rel=1e-6)


@given(seeds, st.floats(1e-6, 1e3))
def test_readings_of_full_digits_have_no_step(seed: int, size: float) -> None:
    assert step_of(size * np.random.default_rng(seed).normal(size=12), "mm") == 0.0


def test_few_readings_equal_ones_and_none_show_no_step() -> None:
    assert step_of(np.array([0.1, 0.2, 0.3, 0.4]), "mm") == 0.0
    assert step_of(np.full(20, 0.3), "mm") == 0.0
    assert step_of(np.full(20, np.nan), "mm") == 0.0
    assert step_of(np.array([0.3, 0.4, np.nan, 0.3, 0.4, 0.3]), "mm") == pytest.approx(0.1)
    assert step_of(np.arange(9.0), "mm", least=2.0) == 0.0


def test_a_step_has_the_deviation_of_an_even_distribution() -> None:
    """∫ e² de over a step, by its quadrature."""
    e = (np.arange(100_000) + 0.5) / 100_000 - 0.5
    assert deviation(1.0) == pytest.approx(np.sqrt(np.mean(e**2)), rel=1e-9)


@given(seeds, st.sampled_from([0.0, 0.01]), st.integers(12, 25), st.integers(12, 25))
def test_clipped_readings_crowd_at_both_ends(seed: int, step: float, low: int, high: int) -> None:
    """A fifth of the readings or more at each end; the others anywhere between."""
    rng = np.random.default_rng(seed)
    values = np.repeat([-0.5, 0.5, 0.0], [low, high, 60 - low - high])
    values[low + high :] = rng.uniform(-0.49, 0.49, 60 - low - high)
    values = rng.permutation(np.round(values / step) * step if step else values)
    found = {round(value, 6): rows for value, rows in tied_extremes(values, np.arange(60), step)}
    assert set(found) == {-0.5, 0.5}
    assert (found[0.5] == (values == values.max())).all()


@given(seeds, st.sampled_from([0.0, 0.5, 0.05]))
def test_other_readings_do_not(seed: int, step: float) -> None:
    """Repeats of the highest pose, a gauge of three heights, coarse steps: equal by nature."""
    rng = np.random.default_rng(seed)
    values = rng.normal(size=40)
    values = np.round(values / step) * step if step else values
    pose = np.arange(40)
    assert not list(tied_extremes(np.repeat(values, 3), np.repeat(pose, 3), step))
    heights = rng.choice([0.0, 10.0, 25.0], 40)
    assert not list(tied_extremes(heights, pose, step_of(heights, "mm")))
    assert not list(tied_extremes(np.zeros(40), pose, 0.0))


def test_chances_of_groups_are_those_of_two_fits() -> None:
    """The textbook's way: a fit of all rows against one of each group."""
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(40, 3)), rng.normal(size=40)
    mine = np.arange(40) % 3 == 0

    def rest(rows: np.ndarray) -> float:
        return float(np.linalg.lstsq(x[rows], y[rows], rcond=None)[1][0])

    from scipy.stats import f

    whole, parts = rest(np.ones(40, dtype=bool)), rest(mine) + rest(~mine)
    found = group_test(x, y, mine)
    assert found is not None
    assert found.chance == pytest.approx(f.sf((whole - parts) / 3 / (parts / 34), 3, 34), rel=1e-9)
    assert found.apart == pytest.approx(np.sqrt(parts / 34 / (whole / 37)), rel=1e-9)
    assert group_test(x[:8], y[:8], mine[:8]) is None  # too few
    assert group_test(x, y, np.zeros(40, dtype=bool)) is None


def test_few_equations_stand_for_the_averages_of_many() -> None:
    """Visits of one to three equations, more of them than are taken at a time, in two cells."""
    rng = np.random.default_rng(2)
    key = np.sort(rng.integers(0, 5000, 10_000))
    key = np.unique(key, return_inverse=True)[1]
    cell = key % 2
    order = rng.permutation(len(key))
    key, cell = key[order], cell[order]
    x, y = rng.normal(size=(len(key), 3)), rng.normal(size=len(key))
    y = y + 0.1 * cell * x[:, 0]
    few = few_equations(x, y, np.arange(len(key)), key, cell, near(x))
    assert len(few.design) == 8
    assert few.counts.tolist() == [len(np.unique(key[cell == k])) for k in (0, 1)]
    count = np.bincount(key)
    averaged = np.column_stack([np.bincount(key, each) / count for each in (*x.T, y)])
    first = np.unique(key, return_index=True)[1]
    one = group_test(averaged[:, :3], averaged[:, 3], cell[first] == 1)
    other = group_test(few.design, few.residual, few.cell == 1, int(few.counts.sum()))
    assert one is not None and other is not None
    assert other.chance == pytest.approx(one.chance, rel=1e-8)
    assert other.apart == pytest.approx(one.apart, rel=1e-12)


def test_a_group_of_another_machine_is_told_whatever_its_weights() -> None:
    """Weights by what common parameters miss: a third of all fits the other group, and no more."""
    rng = np.random.default_rng(3)
    x, mine = rng.normal(size=(60, 6)), np.arange(60) < 30
    y = x @ rng.normal(size=6) * mine + 0.01 * rng.normal(size=60)
    weight = np.where(mine, 1.0, 100.0)
    x, y = x * weight[:, None], y * weight
    few = few_equations(x, y, np.arange(60), np.arange(60), mine.astype(np.intp), near(x))
    plain, tested = group_test(x, y, mine), few.tested(few.cell == 1)
    assert plain is not None and tested is not None
    assert tested.chance < 1e-16
    assert tested.apart < 0.1 < plain.apart


@sweep(
    "sizes, louder",
    product([(14, 14), (14, 60), (60, 14)], [1.0, 10.0]),
    quick=[((14, 60), 10.0), ((60, 14), 10.0)],
)
def test_groups_of_unlike_noise_are_called_unlike_as_seldom(
    sizes: tuple[int, int], louder: float
) -> None:
    rng, count = np.random.default_rng(4), sum(sizes)
    mine = np.arange(count) < sizes[0]
    x, chances = rng.normal(size=(count, 4)), []
    for _ in range(600):
        y = rng.normal(size=count) * np.where(mine, louder, 1.0)
        few = few_equations(x, y, np.arange(count), np.arange(count), mine.astype(np.intp), near(x))
        chances.append(few.tested(few.cell == 1).chance)  # type: ignore[union-attr]
    assert np.mean(np.array(chances) < 0.05) < 0.09
    assert np.mean(np.array(chances) < 1e-3) < 0.006


def test_alike_groups_are_called_unlike_as_seldom_as_stated() -> None:
    rng = np.random.default_rng(1)
    x = rng.normal(size=(30, 4))
    turns = np.arange(30) % 2 == 0
    chances = [group_test(x, rng.normal(size=30), turns).chance for _ in range(400)]  # type: ignore[union-attr]
    assert 0.02 < np.mean(np.array(chances) < 0.05) < 0.09
