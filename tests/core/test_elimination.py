"""What the core does with equations of many poses is what dense linear algebra does with each."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from pkmcal.core.elimination import PoseEquations

COLUMNS = 5


class Drawn:
    """Poses with few, just enough and many equations, in any order."""

    def __init__(self, unknowns: int) -> None:
        draw = np.random.default_rng([51, unknowns])
        self.count = draw.integers(0, unknowns + 6, 29)
        total = int(self.count.sum())
        self.order, self.unknowns = draw.permutation(total), unknowns
        self.poses = PoseEquations(self.order, self.count, unknowns)
        self.by_unknown = draw.normal(size=(total, unknowns))
        self.residual, self.part = draw.normal(size=total), draw.normal(size=(total, COLUMNS))

    def each(self) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
        """Poses, the places of their equations, and of these in order."""
        ends = np.cumsum(self.count)
        for i, (end, count) in enumerate(zip(ends, self.count, strict=True)):
            yield i, self.order[end - count : end], np.arange(end - count, end)


@pytest.fixture(params=[1, 2, 3, 6, 9])
def drawn(request: pytest.FixtureRequest) -> Drawn:
    return Drawn(request.param)


def test_steps_solve_the_damped_normal_equations(drawn: Drawn) -> None:
    matrix, pull, squares = drawn.poses.normals(drawn.residual, drawn.by_unknown)
    damping = np.linspace(1e-3, 1.0, len(squares))
    step, gain, cost, left = drawn.poses.fit(drawn.residual, drawn.by_unknown, damping)
    np.testing.assert_array_equal(cost, squares)
    column = drawn.residual[:, None]
    np.testing.assert_array_equal(left, drawn.poses.left(drawn.by_unknown, column)[0][:, 0])
    for i, mine, _ in drawn.each():
        slopes, residual = drawn.by_unknown[mine], drawn.residual[mine]
        np.testing.assert_allclose(matrix[i], slopes.T @ slopes, atol=1e-12)
        np.testing.assert_allclose(pull[i], slopes.T @ residual, atol=1e-12)
        np.testing.assert_allclose(cost[i], residual @ residual, atol=1e-12)
        if len(mine):
            tall = np.vstack(
                [slopes, np.sqrt(damping[i]) * np.diag(np.linalg.norm(slopes, axis=0))]
            )
            target = np.concatenate([-residual, np.zeros(drawn.unknowns)])
            expected = np.linalg.lstsq(tall, target, rcond=None)[0]
            np.testing.assert_allclose(step[i], expected, rtol=1e-6, atol=1e-8)
            there = residual + slopes @ step[i]
            np.testing.assert_allclose(gain[i], cost[i] - there @ there, rtol=1e-6, atol=1e-8)
        else:
            assert not step[i].any() and gain[i] == 0.0


def test_units_of_a_poses_equations_change_no_step_of_any_pose(drawn: Drawn) -> None:
    poses = len(drawn.count)
    units, damping = 10.0 ** np.random.default_rng(8).uniform(-6, 6, poses), np.full(poses, 1e-3)
    each = np.empty(len(drawn.residual))
    for i, mine, _ in drawn.each():
        each[mine] = units[i]
    expected = drawn.poses.fit(drawn.residual, drawn.by_unknown, damping)
    found = drawn.poses.fit(drawn.residual * each, drawn.by_unknown * each[:, None], damping)
    np.testing.assert_allclose(found.step, expected.step, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.gain / units**2, expected.gain, rtol=1e-9, atol=1e-12)


def test_what_is_left_is_the_part_across_the_unknowns(drawn: Drawn) -> None:
    left, following = drawn.poses.left(drawn.by_unknown, drawn.part)
    spread = drawn.poses.spread(drawn.by_unknown, left)
    assert len(left) == drawn.poses.left_of.sum()
    for i, mine, dense in drawn.each():
        slopes, part = drawn.by_unknown[mine], drawn.part[mine]
        place, count = drawn.poses.place[i], drawn.poses.left_of[i]
        assert count == max(0, len(mine) - drawn.unknowns)
        taken = slopes @ np.linalg.pinv(slopes) if len(mine) else np.zeros((0, 0))
        across = part - taken @ part
        own = left[place : place + count]
        np.testing.assert_allclose(own.T @ own, across.T @ across, atol=1e-11)
        np.testing.assert_allclose(spread[dense], across, atol=1e-11)
        if count or len(mine) == drawn.unknowns:
            expected = -np.linalg.lstsq(slopes, part, rcond=None)[0]
            np.testing.assert_allclose(following[i], expected, rtol=1e-7, atol=1e-9)
        else:
            assert not np.isfinite(following[i]).any()


def test_an_unknown_that_no_equation_has_takes_no_step_and_no_part(drawn: Drawn) -> None:
    """So it is as if it were not there, which a pose with one fewer tells."""
    undamped, wider = np.zeros(len(drawn.count)), drawn.unknowns + 1
    more = PoseEquations(drawn.order, drawn.count, wider)
    for place in range(wider):
        by_unknown = np.insert(drawn.by_unknown, place, 0.0, axis=1)
        expected = drawn.poses.fit(drawn.residual, drawn.by_unknown, undamped)
        found = more.fit(drawn.residual, by_unknown, undamped)
        assert not found.step[:, place].any()
        step = np.delete(found.step, place, axis=1)
        tall = drawn.count >= drawn.unknowns  # of others many steps are as good
        np.testing.assert_allclose(step[tall], expected.step[tall], rtol=1e-6, atol=1e-8)
        np.testing.assert_allclose(found.gain, expected.gain, rtol=1e-6, atol=1e-8)


def test_slopes_of_one_are_slopes(drawn: Drawn) -> None:
    """Each unknown is read by an equation of its own, as an offset is; the others have no part."""
    by_unknown, undamped = np.zeros_like(drawn.by_unknown), np.zeros(len(drawn.count))
    for _, mine, _ in drawn.each():
        by_unknown[mine] = np.eye(len(mine), drawn.unknowns)
    step, _, _, left = drawn.poses.fit(drawn.residual, by_unknown, undamped)
    for i, mine, _ in drawn.each():
        own, place = min(len(mine), drawn.unknowns), drawn.poses.place[i]
        np.testing.assert_allclose(step[i, :own], -drawn.residual[mine[:own]], rtol=1e-9)
        rest = left[place : place + len(mine) - own]
        np.testing.assert_allclose(np.abs(rest), np.abs(drawn.residual[mine[own:]]), rtol=1e-9)


def test_numbers_that_are_not_finite_stay_with_their_pose() -> None:
    drawn = Drawn(3)
    bad = int(np.flatnonzero(drawn.count > 3)[0])
    whole = next(mine for i, mine, _ in drawn.each() if i == bad)
    drawn.residual[whole[0]] = np.nan
    undamped = np.zeros(len(drawn.count))
    step, gain, cost, left = drawn.poses.fit(drawn.residual, drawn.by_unknown, undamped)
    assert np.isnan(cost[bad]) and np.isnan(gain[bad]) and not step[bad].any()
    others = np.arange(len(cost)) != bad
    assert np.isfinite(gain[others]).all() and np.isfinite(step[others]).all()
    place, count = drawn.poses.place[bad], drawn.poses.left_of[bad]
    assert np.isfinite(np.delete(left, np.arange(place, place + count))).all()


def test_steps_that_gain_little_are_none(drawn: Drawn) -> None:
    undamped = np.zeros(len(drawn.count))
    whole = drawn.poses.fit(drawn.residual, drawn.by_unknown, undamped)
    share = np.divide(whole.gain, whole.cost, out=undamped.copy(), where=whole.cost > 0.0)
    least = 0.999 * float(np.median(share[share > 0.0]))
    some = drawn.poses.fit(drawn.residual, drawn.by_unknown, undamped, least)
    np.testing.assert_array_equal(some.gain, np.where(share > least, whole.gain, 0.0))
    np.testing.assert_array_equal(some.step, np.where(share[:, None] > least, whole.step, 0.0))
    slopes = drawn.poses.normals(drawn.residual, drawn.by_unknown)[0]
    length = np.sqrt(np.einsum("kii->k", slopes))
    some = drawn.count > 0
    rounding = 0.8 * float(np.median(whole.gain[some] / length[some] / np.sqrt(whole.cost[some])))
    made = rounding * length  # of the equations' length
    gains = whole.gain > made * (made + np.sqrt(whole.cost))
    assert gains.any() and not gains[some].all()
    rounded = drawn.poses.fit(drawn.residual, drawn.by_unknown, undamped, 0.0, rounding)
    np.testing.assert_array_equal(rounded.gain, np.where(gains, whole.gain, 0.0))
