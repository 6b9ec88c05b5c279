"""A weight of travel trades the predicted error of a plan against the length of its tour."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.kinematics.robot import Robot
from pkmcal.planning.optimal_design import Design
from pkmcal.planning.plan_poses import Plan
from pkmcal.planning.travel_weight import with_travel

from .test_tour import length


@pytest.fixture(scope="module")
def plans(hexapod: Robot) -> dict[float, Plan]:
    candidates = pk.sample_poses(hexapod, 100)
    return {
        weight: pk.plan_poses(hexapod, candidates, 16, kind="pose", travel_weight=weight)
        for weight in (0.0, 0.3, 1.0)
    }


def test_the_heavier_travel_weighs_the_shorter_is_the_tour(plans: dict[float, Plan]) -> None:
    none, some, much = plans.values()
    assert much.travel < some.travel < none.travel
    assert much.predicted > some.predicted > none.predicted
    assert much.predicted < none.at_random
    for plan in (some, much):
        assert plan.predicted_unweighted == none.predicted
        assert plan.travel_unweighted == none.travel


@pytest.mark.parametrize("weight", [0.3, 1.0])
def test_no_other_plan_is_better_by_its_own_weight(plans: dict[float, Plan], weight: float) -> None:
    """Travel is that of the tour as it is printed, and what was weighed is what is reported."""

    def weighed(plan: Plan) -> float:
        return float(np.log(plan.predicted) + weight * np.log(plan.travel))

    assert min(plans.values(), key=weighed) is plans[weight]
    plan = plans[weight]
    assert isinstance(plan.robot, Robot)
    home = plan.robot.inverse(plan.robot.home)
    assert plan.travel == pytest.approx(length(plan.actuators, home, tuple(range(16))))
    assert f"travel weight {weight:g}; without it" in str(plan)


def small(criterion: Any, seed: int) -> tuple[Design, np.ndarray]:
    """Eight candidates of four parameters, and places."""
    random = np.random.default_rng(seed)
    blocks, aims = random.normal(size=(8, 2, 4)), random.normal(size=(5, 3, 4))
    return Design(blocks, np.zeros((0, 4)), aims, criterion, 1e6), random.uniform(0, 9, (8, 2))


@pytest.mark.parametrize("seed", range(5))
def test_it_is_hardly_worse_than_the_best_of_all_choices_and_orders(seed: int) -> None:
    design, places = small("prediction", seed)
    start, weight = np.zeros(2), 0.5
    chosen, travel = with_travel(design, design.grown(4), places, start, weight)
    assert travel == pytest.approx(length(places, start, tuple(chosen)))

    def weighed(order: tuple[int, ...]) -> float:
        tour = length(places, start, order)
        return float(np.log(design.predicted(np.array(order))) + weight * np.log(tour))

    best = min(weighed(order) for order in itertools.permutations(range(8), 4))
    assert best - 1e-9 <= weighed(tuple(chosen)) <= best + 0.1


@pytest.mark.parametrize("criterion", ["prediction", "A", "D"])
def test_an_exchange_is_worth_what_the_criterion_says_of_the_new_choice(criterion: Any) -> None:
    random = np.random.default_rng(3)
    blocks, aims = random.normal(size=(8, 2, 4)), random.normal(size=(5, 3, 4))
    design = Design(blocks, np.zeros((0, 4)), aims, criterion, 1e6)
    chosen = np.array([1, 2, 4, 6])
    worth = design.exchanged_for(chosen, 4)

    def deviation(rows: list[int]) -> float:
        """Of the parameters in the coordinates they are given in."""
        information = blocks[rows].reshape(-1, 4)
        covariance = np.linalg.inv(information.T @ information)
        if criterion == "D":
            return float(np.linalg.slogdet(covariance)[1]) / 8
        if criterion == "A":
            return float(np.log(np.trace(covariance))) / 2
        spread = np.einsum("tij,jk,tik->", aims, covariance, aims) / len(aims)
        return float(np.log(spread)) / 2

    others = [1, 2, 6]
    expected = np.array([deviation([*others, j]) for j in (0, 3, 4, 5, 7)])
    assert np.diff(worth[[0, 3, 4, 5, 7]]) == pytest.approx(np.diff(expected), abs=1e-6)
    assert np.isinf(worth[others]).all()


def test_an_accuracy_that_is_wanted_is_kept(hexapod: Robot) -> None:
    candidates = pk.sample_poses(hexapod, 100)
    wanted = {"kind": "pose", "accuracy": 0.025}
    first = pk.plan_poses(hexapod, candidates, **wanted)  # type: ignore[arg-type]
    plan = pk.plan_poses(hexapod, candidates, **wanted, travel_weight=2.0)  # type: ignore[arg-type]
    assert len(plan) == len(first) and plan.travel < first.travel
    with pytest.raises(pk.ArgumentError, match="goes with the criterion prediction, found D"):
        pk.plan_poses(hexapod, candidates, **wanted, criterion="D", travel_weight=1)  # type: ignore[arg-type]
    assert first.predicted <= 0.025 * (1 + 1e-6) and plan.predicted <= 0.025 * (1 + 1e-6)


def test_kinds_keep_their_numbers_of_poses(hexapod: Robot) -> None:
    plan = pk.plan_poses(
        hexapod,
        pk.sample_poses(hexapod, 60),
        kind={"pose": 6, "distance": 4},
        target={"distance": [[0, 0, -300], [100, 0, -300]]},
        travel_weight=1.0,
    )
    assert sorted(plan.kinds) == ["distance"] * 4 + ["pose"] * 6
    assert plan.travel <= plan.travel_unweighted
    assert {kind: points.tolist() for kind, points in plan.target.items()} == {
        "distance": [[0, 0, -300], [100, 0, -300]]
    }
