"""Tolerances by joint keep what is allowed, in equal shares or at the least cost."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.error_model.allocation import Allocation

from ..workspaces import WORKSPACE, poses

SAMPLES = 20_000
NOISE = 0.06  # of a 99.7 % quantile of so many machines, found twice: three deviations


def linear_distance(found: Allocation, sigma: np.ndarray) -> float:
    """Largest linear rms distance over the poses, with other sigmas of the joints, mm."""
    robot, at = found.check.robot, found.check.poses.reshape(-1, 6)
    deviations = np.zeros(len(robot.geometry))
    for joint, each in zip(found.joints, sigma, strict=True):
        for name in robot.geometry.match(joint):
            deviations[robot.geometry.names.index(name)] = each
    effect = robot.error_jacobian(at)[:, :3] * deviations
    return float(np.sqrt((effect**2).sum(axis=(1, 2)).max()))


def price(found: Allocation, sigma: np.ndarray) -> float:
    numbers = [len(found.check.robot.geometry.match(joint)) for joint in found.joints]
    weights = np.ones(len(sigma)) if found.cost is None else found.cost
    return float((weights * numbers / sigma).sum())


@pytest.mark.parametrize("cost", [None, 1.0])
@pytest.mark.parametrize("name", ["2tpr2tps", "linear-delta", "rbt-6t03p"])
def test_machines_with_these_tolerances_keep_what_is_allowed(name: str, cost: Any) -> None:
    robot = pk.load(name)
    found = pk.allocate_tolerance(robot, poses(name, 4), 0.2, cost=cost, samples=SAMPLES)
    assert found.reached["distance"] == pytest.approx(0.2, rel=NOISE)
    wider = {j: 1.2 * s for j, s in zip(found.joints, found.sigma, strict=True) if np.isfinite(s)}
    again = pk.tolerance(robot, poses(name, 4), wider, samples=SAMPLES, seed=9)
    assert again.distance997.max() > 0.2 * (1.2 - 3 * NOISE)


@pytest.mark.parametrize("allowed", [0.5, {"distance": 0.5, "alpha": 2e-3, "z": 0.2}])
@pytest.mark.parametrize("name", sorted(WORKSPACE))
def test_the_machines_keep_all_limits_at_all_poses(name: str, allowed: Any) -> None:
    """Machines of a generator of its own, each solved as a robot."""
    robot = pk.load(name)
    moved = {k: v for k, v in allowed.items() if k != "alpha"} if isinstance(allowed, dict) else {}
    wanted = moved if moved and "alpha" not in robot.coordinates else allowed
    at = robot.complete(poses(name, 12))
    found = pk.allocate_tolerance(robot, at, wanted, samples=SAMPLES)
    assert found.kept >= 99.7 - 3 * 100 * np.sqrt(0.003 / SAMPLES)
    deviations = np.zeros(len(robot.geometry))
    for joint, sigma in zip(found.joints, found.sigma, strict=True):
        places = [robot.geometry.names.index(each) for each in robot.geometry.match(joint)]
        deviations[places] = sigma if np.isfinite(sigma) else 0.0
    limits = wanted if isinstance(wanted, dict) else {"distance": wanted}
    rng, count, broken = np.random.default_rng(99), 600, 0
    q = robot.inverse(at)
    for _ in range(count):
        machine = robot.replace(
            robot.geometry.values + rng.normal(size=len(deviations)) * deviations
        )
        off = machine.forward(q, guess=at).pose - at
        size = {"distance": np.linalg.norm(off[:, :3], axis=1), "z": np.abs(off[:, 2]),
                "alpha": np.abs(off[:, 3])}  # fmt: skip
        broken += any(not (size[each] <= limit).all() for each, limit in limits.items())
    assert broken <= 0.003 * count + 4 * np.sqrt(0.003 * count)


def test_per_pose_allows_more_and_fewer_machines_keep_it_everywhere() -> None:
    robot = pk.load("2tpr2tps")
    at = pk.sample_poses(robot, 30, seed=4)
    joints = ["base*", "platform*", "offset*"]
    every, each = (
        pk.allocate_tolerance(robot, at, 0.5, joints=joints, per_pose=p, samples=SAMPLES)
        for p in (False, True)
    )
    assert (each.sigma > 1.05 * every.sigma).all()
    assert each.kept < 99.6 < every.kept
    assert each.reached["distance"] == each.check.distance997.max()
    assert every.check.distance997.max() < every.reached["distance"]
    assert "at the worst pose" in str(each) and f"{each.kept:.2f} % of these" in str(each)
    assert "at all poses" in str(every)


def test_the_same_machines_are_counted_with_any_executor() -> None:
    robot = pk.load("2tpr2tps")
    at = poses("2tpr2tps", 20)
    alone = pk.allocate_tolerance(robot, at, 0.5, samples=SAMPLES)
    with ThreadPoolExecutor(3) as executor:
        shared = pk.allocate_tolerance(robot, at, 0.5, samples=SAMPLES, executor=executor)
    np.testing.assert_array_equal(alone.sigma, shared.sigma)
    assert (alone.kept, alone.reached) == (shared.kept, shared.reached)


def test_at_one_pose_contributions_are_equal() -> None:
    robot = pk.load("hexapod")
    found = pk.allocate_tolerance(robot, robot.home, 0.3, samples=SAMPLES)
    assert len(found.joints) == 18  # base, platform and zero length of six limbs
    np.testing.assert_allclose(found.contribution, 100 / 18)


def test_no_joint_contributes_more_than_its_share_at_its_worst_pose() -> None:
    robot = pk.load("2tpr2tps")
    at = poses("2tpr2tps", 10)
    found = pk.allocate_tolerance(robot, at, 0.3, samples=SAMPLES)
    places = [
        [robot.geometry.names.index(name) for name in robot.geometry.match(joint)]
        for joint in found.joints
    ]
    jacobian = robot.error_jacobian(at)[:, :3]
    worst = [
        (jacobian[:, :, p] ** 2).sum(axis=(1, 2)).max() * s**2
        for p, s in zip(places, found.sigma, strict=True)
    ]
    np.testing.assert_allclose(worst, worst[0])


def test_no_other_sigmas_are_cheaper() -> None:
    robot = pk.load("2tpr2tps")
    found = pk.allocate_tolerance(
        robot, poses("2tpr2tps", 6), 0.3, cost={"offset1": 5.0, "base3.*": 0.2}, samples=SAMPLES
    )
    limit, least = linear_distance(found, found.sigma), price(found, found.sigma)
    rng = np.random.default_rng(0)
    for _ in range(300):
        other = found.sigma * np.exp(rng.normal(0, rng.choice([0.01, 0.1, 0.5]), len(found.sigma)))
        other *= limit / linear_distance(found, other)
        assert price(found, other) > least * (1 - 1e-6)


def test_at_one_pose_the_cheapest_is_the_closed_form() -> None:
    robot = pk.load("2tpr2tps")
    cost = {"offset1": 8.0, "offset2": 1.0, "offset3": 1.0, "offset4": 27.0}
    found = pk.allocate_tolerance(
        robot, robot.home, 0.3, joints=list(cost), cost=cost, samples=SAMPLES
    )
    places = [robot.geometry.names.index(name) for name in cost]
    use = (robot.error_jacobian(robot.home)[:3, places] ** 2).sum(axis=0)
    expected = np.cbrt(np.array(list(cost.values())) / use)  # Lagrange: cost/sigma² ~ use·sigma
    np.testing.assert_allclose(found.sigma / found.sigma[0], expected / expected[0], rtol=1e-4)


def test_a_dearer_joint_gets_a_wider_tolerance() -> None:
    robot = pk.load("2tpr2tps")
    joints = ["base*", "platform*", "offset*"]
    cheap = pk.allocate_tolerance(robot, robot.home, 0.3, joints=joints, cost=1.0, samples=SAMPLES)
    dear = pk.allocate_tolerance(
        robot, robot.home, 0.3, joints=joints, cost={"base*": 10.0}, samples=SAMPLES
    )
    ratio = dear.sigma / cheap.sigma
    assert ratio[0] > 1.0 > ratio[1] and ratio[2] < 1.0


def test_several_limits_hold_together() -> None:
    robot = pk.load("2tpr2tps")
    at = poses("2tpr2tps", 4)
    for allowed in ({"distance": 0.5, "alpha": 1e-3}, {"y": 0.1, "alpha": 0.1}):
        found = pk.allocate_tolerance(robot, at, allowed, samples=100_000)
        share = {name: found.reached[name] / limit for name, limit in allowed.items()}
        assert max(share.values()) == pytest.approx(1.0, rel=NOISE)
        assert found.kept == pytest.approx(99.7, abs=0.1)


def test_what_has_no_effect_may_be_as_wide_as_it_likes() -> None:
    robot = pk.load("3rrr-planar")
    found = pk.allocate_tolerance(
        robot, robot.home, 0.1, joints=["rod*", "base*.z"], cost=None, samples=1000
    )
    assert found.sigma[1] == np.inf and np.isfinite(found.sigma[0])
    assert found.contribution == pytest.approx([100.0, 0.0])
    assert "inf" in str(found)


def test_the_check_draws_other_machines_than_the_scaling() -> None:
    robot = pk.load("2tpr2tps")
    found = pk.allocate_tolerance(robot, robot.home, 0.3, samples=SAMPLES, seed=4)
    assert found.check.seed == 5
    assert found.reached["distance"] != 0.3


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"allowed": 0.0}, ValueError, "allowed distance must be above 0, found 0.0"),
        ({"allowed": {"alfa": 1.0}}, ValueError, "did you mean 'alpha'"),
        ({"allowed": {}}, ValueError, "allowed must limit something"),
        ({"allowed": {"x": "1"}}, TypeError, "allowed x must be a number"),
        ({"allowed": {"gamma": 0.1}}, ValueError, "has an effect on gamma"),
        ({"joints": ["base1.*", "base*.x"]}, ValueError, "base1.x is named by 'base1"),
        ({"joints": ["*1"]}, ValueError, "covers numbers in 1 and mm"),
        ({"joints": ["bse1.x"]}, ValueError, "did you mean 'base1.x'"),
        ({"cost": {"offset9": 1.0}}, ValueError, "cost: 'offset9' is none of the joints"),
        ({"cost": -1.0}, ValueError, "must be above 0"),
        ({"poses": [[0, 0, np.inf, 0, 0, 0]]}, ValueError, "cannot take row 0"),
    ],
)
def test_what_is_wrong_is_named(arguments: dict[str, Any], error: type, words: str) -> None:
    robot = pk.load("2tpr2tps")
    given = {"poses": robot.home, "allowed": 0.3, "samples": 10} | arguments
    with pytest.raises(error, match=words):
        pk.allocate_tolerance(robot, **given)


def test_a_limit_so_wide_that_machines_have_no_pose_is_refused() -> None:
    robot = pk.load("2tpr2tps")
    with pytest.raises(ValueError, match=r"leave \d+ of 500 machines without a pose; allow less"):
        pk.allocate_tolerance(robot, robot.home, 1e6, samples=500)


def test_joints_are_one_name_or_several_but_not_none() -> None:
    robot = pk.load("2tpr2tps")
    one, listed = (
        pk.allocate_tolerance(robot, robot.home, 0.5, joints=joints, samples=500)
        for joints in ("offset*", ["offset*"])
    )
    assert one.joints == listed.joints == ("offset*",)
    assert one.sigma == listed.sigma
    with pytest.raises(ValueError, match="joints: name at least one"):
        pk.allocate_tolerance(robot, robot.home, 0.5, joints=[])


def test_a_machine_without_lengths_is_allocated_by_the_angles_that_are_named() -> None:
    robot = pk.load("agile-eye")
    allowed = {"alpha": 0.01}
    with pytest.raises(ValueError, match=r"joints: by default .* agile eye has none"):
        pk.allocate_tolerance(robot, robot.home, allowed)
    with pytest.raises(ValueError, match="covers numbers in 1 and rad"):
        pk.allocate_tolerance(robot, robot.home, allowed, joints="*1")
    found = pk.allocate_tolerance(robot, robot.home, allowed, joints="offset*", samples=500)
    assert found.sigma[0] > 0
