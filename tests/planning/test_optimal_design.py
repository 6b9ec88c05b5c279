"""Exchange algorithm: against all choices where these can be counted, and its bookkeeping."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from pkmcal.planning.additions import gains, losses
from pkmcal.planning.gain_bounds import Screen
from pkmcal.planning.optimal_design import CRITERIA, Design

PRIOR = np.diag([0.1, 0.2, 0.3, 0.4])


def candidates(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """What 12 candidates tell of four parameters, two numbers each, and 5 aims."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(12, 2, 4)) * rng.uniform(0.3, 3, (12, 1, 1)), rng.normal(size=(5, 3, 4))


def covariance(blocks: np.ndarray, prior: np.ndarray) -> np.ndarray:
    rows = np.vstack([blocks.reshape(-1, 4), prior])
    return np.linalg.inv(rows.T @ rows)


def error(blocks: np.ndarray, prior: np.ndarray, aims: np.ndarray) -> float:
    spread = covariance(blocks, prior)
    return float(np.sqrt(np.einsum("nij,jk,nik->n", aims, spread, aims).mean()))


def test_predicted_error_is_that_of_the_information() -> None:
    blocks, aims = candidates(0)
    design = Design(blocks, PRIOR, aims, "prediction", 1e9)
    for chosen in ([0], [2, 5], range(12)):
        at = np.array(chosen)
        assert design.predicted(at) == pytest.approx(error(blocks[at], PRIOR, aims), rel=1e-9)


@pytest.mark.parametrize("criterion", CRITERIA)
@pytest.mark.parametrize("seed", range(8))
def test_choice_is_the_best_of_all_or_hardly_worse(criterion: str, seed: int) -> None:
    blocks, aims = candidates(seed)
    costs = {
        "prediction": lambda at: error(blocks[at], PRIOR, aims) ** 2,
        "A": lambda at: np.trace(covariance(blocks[at], PRIOR)),
        "D": lambda at: np.linalg.det(covariance(blocks[at], PRIOR)),
    }
    every = (np.array(at) for at in itertools.combinations(range(12), 4))
    least = min(costs[criterion](at) for at in every)
    chosen = Design(blocks, PRIOR, aims, criterion, 1e9).grown(4)
    assert len(set(chosen)) == 4 and (np.diff(chosen) > 0).all()
    assert costs[criterion](chosen) <= 1.02 * least


@pytest.mark.parametrize("criterion", CRITERIA)
def test_of_many_candidates_none_is_left_that_should_be_exchanged(criterion: str) -> None:
    """Also one that is not on the shortlist: all exchanges are tried, in plain NumPy."""
    rng = np.random.default_rng(3)
    blocks = rng.normal(size=(2500, 2, 4)) * rng.uniform(0.9, 1.0, (2500, 1, 1))
    aims = rng.normal(size=(5, 3, 4))
    chosen = Design(blocks, PRIOR, aims, criterion, 1e9).grown(4)

    def exchanged(rest: np.ndarray) -> np.ndarray:
        """With each candidate beside these: the logarithm of what is made least."""
        rows = blocks[rest].reshape(-1, 4)
        kept = rows.T @ rows + PRIOR.T @ PRIOR
        spread = np.linalg.inv(kept + np.einsum("nki,nkj->nij", blocks, blocks))
        if criterion == "D":
            return np.asarray(np.linalg.slogdet(spread)[1])
        aimed = np.eye(4) if criterion == "A" else np.einsum("nij,nik->jk", aims, aims)
        return np.log(np.einsum("nij,ij->n", spread, aimed))

    for member in chosen:
        left = exchanged(chosen[chosen != member])
        assert np.delete(left, chosen).min() > left[member] - 1e-5


def many(seed: int, weak: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What 700 candidates tell of nine parameters, what 8 of them and a prior tell, and aims."""
    rng = np.random.default_rng(seed)
    blocks = rng.normal(size=(700, 3, 9)) * rng.uniform(0.01, 30.0, (700, 1, 1))
    turned = np.linalg.qr(rng.normal(size=(9, 9)))[0]
    rows = blocks[:8].reshape(-1, 9)
    there = rows.T @ rows * weak + (turned * np.geomspace(weak, 5.0, 9)) @ turned.T
    return blocks, there, rng.normal(size=(4, 9))


def criterion_of(criterion: str, aimed: np.ndarray) -> np.ndarray | None:
    return {"D": None, "A": np.eye(9), "prediction": aimed.T @ aimed}[criterion]


def costs(information: np.ndarray, cost: np.ndarray | None) -> np.ndarray:
    """What the criterion makes least, in plain NumPy."""
    if cost is None:
        return np.asarray(-np.linalg.slogdet(information)[1])
    return np.asarray(np.trace(np.linalg.solve(information, cost), axis1=-2, axis2=-1))


@pytest.mark.parametrize("criterion", CRITERIA)
@pytest.mark.parametrize("k", [1, 3, 8])
def test_gains_and_losses_are_differences_of_the_criterion(criterion: str, k: int) -> None:
    rng = np.random.default_rng(k)
    blocks, cost = rng.normal(size=(40, k, 9)), criterion_of(criterion, rng.normal(size=(4, 9)))
    own = blocks.transpose(0, 2, 1) @ blocks
    there = np.eye(9) + own[:20].sum(axis=0)
    before = costs(there, cost)
    gained = gains(blocks[20:], there, cost)
    np.testing.assert_allclose(gained, before - costs(there + own[20:], cost), rtol=1e-9)
    lost = losses(blocks[:20], there, cost)
    np.testing.assert_allclose(lost, costs(there - own[:20], cost) - before, rtol=1e-9)


@pytest.mark.parametrize("criterion", CRITERIA)
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("weak", [1.0, 1e-4, 1e-8])
def test_gains_are_within_their_bounds(criterion: str, seed: int, weak: float) -> None:
    """Also where what is there tells hardly anything of some direction."""
    blocks, there, aimed = many(seed, weak)
    cost = criterion_of(criterion, aimed)
    bounds = Screen(blocks).bounds(there, cost)
    gained = costs(there, cost) - costs(there + blocks.transpose(0, 2, 1) @ blocks, cost)
    # the difference of two costs is rounded by a share of the larger
    slack = 1e-12 * abs(float(costs(there, cost)))
    assert (gained >= bounds.least * (1.0 - 1e-9) - slack).all()
    assert (gained <= bounds.most * (1.0 + 1e-9) + slack).all()
    if weak == 1.0:  # and they are no matter of course
        known = np.isfinite(bounds.most)
        assert known.mean() > 0.5
        assert np.median(bounds.least[known] / bounds.most[known]) > 0.9


@pytest.mark.parametrize("criterion", CRITERIA)
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("weak", [1.0, 1e-4])
def test_no_gain_beside_a_choice_without_a_member_is_above_its_bound(
    criterion: str, seed: int, weak: float
) -> None:
    blocks, there, aimed = many(seed, weak)
    cost, screen = criterion_of(criterion, aimed), Screen(blocks)
    most = screen.bounds(there + blocks[0].T @ blocks[0], cost).most
    bounds = screen.most_without(most, blocks[0], there, cost)
    gained = costs(there, cost) - costs(there + blocks.transpose(0, 2, 1) @ blocks, cost)
    assert (gained <= bounds * (1.0 + 1e-9) + 1e-12 * abs(float(costs(there, cost)))).all()
    if weak == 1.0:
        assert np.median(gained / bounds) > 0.2


@pytest.mark.parametrize("seed", range(8))
def test_fewest_candidates_for_an_error_are_found(seed: int) -> None:
    blocks, aims = candidates(seed)
    wanted = 1.3 * error(blocks, PRIOR, aims)
    chosen = Design(blocks, PRIOR, aims, "prediction", 1e9).reaching(wanted)
    assert error(blocks[chosen], PRIOR, aims) <= wanted
    fewer = itertools.combinations(range(12), len(chosen) - 1)
    assert all(error(blocks[list(at)], PRIOR, aims) > 0.99 * wanted for at in fewer)


def test_what_nothing_tells_is_named_and_does_not_count() -> None:
    blocks, aims = candidates(1)
    blocks[:, :, 3] = blocks[:, :, 2]  # only the sum of the last two is seen
    none = np.zeros((0, 4))
    design = Design(blocks, none, aims, "prediction", 1e9)
    np.testing.assert_allclose(
        np.abs(design.unidentifiable[:, 0]), [0, 0, 0.5**0.5, 0.5**0.5], atol=1e-9
    )
    assert design.predicted(np.array([3])) == float("inf")  # two equations for three parameters
    assert np.isfinite(design.predicted(np.array([3, 4])))
