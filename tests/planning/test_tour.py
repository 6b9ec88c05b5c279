"""The order in which the poses of a plan are measured is a short way through all of them."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.planning.tour import short_tour


def length(places: np.ndarray, start: np.ndarray, order: tuple[int, ...]) -> float:
    way = np.vstack([start, places[list(order)]])
    return float(np.abs(np.diff(way, axis=0)).max(axis=1).sum())


@pytest.mark.parametrize("seed", range(6))
def test_it_is_hardly_longer_than_the_shortest_of_all(seed: int) -> None:
    random = np.random.default_rng(seed)
    places, start = random.uniform(0, 100, (7, 3)), np.zeros(3)
    order, travel = short_tour(places, start)
    assert sorted(order) == list(range(7))
    assert travel == pytest.approx(length(places, start, tuple(order)))
    best = min(length(places, start, each) for each in itertools.permutations(range(7)))
    assert best - 1e-9 <= travel <= 1.15 * best


def test_places_on_a_line_are_taken_in_their_order() -> None:
    places = np.random.default_rng(1).permutation(np.arange(1.0, 60.0))[:, None]
    order, travel = short_tour(places, np.zeros(1))
    assert (np.diff(places[order, 0]) > 0).all() and travel == pytest.approx(59.0)


@pytest.mark.parametrize("count", [1, 2])
def test_one_place_and_two(count: int) -> None:
    order, travel = short_tour(np.array([[5.0], [2.0]])[:count], np.zeros(1))
    assert travel == 5.0 and sorted(order) == list(range(count))


def test_a_plan_is_a_tour_far_shorter_than_its_poses_at_random() -> None:
    robot = pk.load("hexapod")
    plan = pk.plan_poses(robot, pk.sample_poses(robot, 150), 25, kind="pose")
    home = robot.inverse(robot.home)
    assert plan.travel == pytest.approx(length(plan.actuators, home, tuple(range(25))))
    random = np.random.default_rng(0)
    others = [length(plan.actuators, home, tuple(random.permutation(25))) for _ in range(20)]
    assert plan.travel < 0.7 * min(others)
