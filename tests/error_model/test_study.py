"""The numbers of docs/error-model.md: the paper's model of the 2TPR&2TPS and spatial ones.

The paper's model keeps x = z tan(beta) and gamma = 0 under error; the spatial one has the plane row
of either TPR limb instead (six rows), or its couple too (eight rows, a least squares).
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.kinematics.perturbed import Geometries, forward_of

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "docs" / "error-model.md").read_text(encoding="utf-8")
MODELS = {
    "paper": "2tpr2tps",
    "six": "2tpr2tps-spatial",
    "eight": str(ROOT / "examples" / "2tpr2tps-eight-rows.toml"),
}
OVERCONSTRAINING = ("base3.x", "base4.x", "base3.z", "base4.z", "platform3.x", "platform4.x")
POSE = (0.0, 20.0, 390.0, 0.15, 0.2, 0.0)  # completed to x = z tan(beta)


@cache
def model(name: str) -> pk.Robot:
    return pk.load(MODELS[name])


def apart(one: str, other: str, machines: int = 2000, sigma: float = 0.5) -> np.ndarray:
    """Distance of the positions at home by two models of the same machines, mm."""
    names = model("paper").model.free
    drawn = np.random.default_rng(0).normal(0.0, sigma, (machines, len(names)))
    poses = []
    for robot in (model(one), model(other)):
        places = np.array([robot.geometry.names.index(name) for name in names])
        slots = Geometries(robot.geometry, places, machines).with_errors(drawn)
        (found,) = forward_of(robot, slots, robot.inverse(robot.home[None]), robot.home[None])
        poses.append(found[:, :3])
    return np.linalg.norm(poses[0] - poses[1], axis=1)


def with_error(name: str, number: str, error: float = 0.5) -> pk.Forward:
    robot, pose = model(name), model("paper").complete(POSE)
    q = model("paper").inverse(pose)
    return robot.replace({number: robot.geometry[number] + error}).forward(q, guess=pose)


def said(text: str) -> bool:
    """Whether the document has these words."""
    return " ".join(text.split()) in " ".join(TEXT.split())


def test_without_errors_the_three_models_are_one() -> None:
    pose = model("paper").complete(POSE)
    q = model("paper").inverse(pose)
    for name in MODELS:
        np.testing.assert_allclose(model(name).forward(q).pose, pose, atol=1e-9)


def test_paper_and_spatial_model_differ_by_0_4_mm_in_the_mean() -> None:
    off = apart("paper", "six")
    low, median, high = np.quantile(off, [0.025, 0.5, 0.975])
    assert off.mean() == pytest.approx(0.40, abs=0.02)
    assert (low, median, high) == pytest.approx((0.07, 0.36, 0.92), abs=0.03)
    assert said("0.40 mm in the mean, 0.36 in the median, and 95 % of machines between 0.07 and")


def test_six_and_eight_rows_differ_by_0_1_mm_in_the_mean() -> None:
    assert apart("six", "eight", 500).mean() == pytest.approx(0.10, abs=0.01)
    assert apart("paper", "eight", 500).mean() == pytest.approx(0.31, abs=0.02)
    assert said("0.10 mm") and said("0.31 mm")


def test_the_difference_grows_with_the_errors() -> None:
    small, large = apart("paper", "six", 300, 0.05), apart("paper", "six", 300, 0.5)
    np.testing.assert_allclose(small.mean() * 10, large.mean(), rtol=0.01)


@pytest.mark.parametrize("number", model("paper").model.free)
def test_six_errors_over_constrain_and_the_others_do_not(number: str) -> None:
    """Only the errors named in the document leave something over that no pose can close."""
    paper, six, eight = (with_error(name, number) for name in MODELS)
    if number in OVERCONSTRAINING:
        assert eight.residual > 0.02
        assert np.abs(paper.pose - six.pose)[:3].max() > 0.03
    else:
        assert eight.residual < 1e-9
        np.testing.assert_allclose(six.pose, paper.pose, atol=1e-8)
        np.testing.assert_allclose(eight.pose, paper.pose, atol=1e-8)


def test_an_error_across_the_limb_plane_turns_the_platform() -> None:
    """(R r)·(T3 - T4) = (R r)·R(B3 - B4) = 0 turns r by the error over the distance of T3, T4."""
    found = with_error("six", "base3.x")
    between = model("six").geometry["base3.y"] - model("six").geometry["base4.y"]
    axis = np.array([np.cos(found.pose[5]) * np.cos(found.pose[4]), np.sin(found.pose[5])])
    turned = -np.arctan(0.5 / between)
    assert found.pose[5] == pytest.approx(turned, rel=1e-2)
    assert axis[1] == pytest.approx(np.sin(turned), rel=1e-2)
    assert said("1.8 mrad") and between == 278.5


def test_eight_rows_leave_0_12_mm_over() -> None:
    assert with_error("eight", "base3.x").residual == pytest.approx(0.116, abs=0.002)
    assert said("0.12 mm")


def test_the_constraints_of_two_tpr_limbs_have_rank_two_of_four() -> None:
    robot = model("eight")
    pose = model("paper").complete(POSE)[None]
    closure = robot.machine.closure(robot.slots, pose, robot.inverse(pose))
    rows = closure.by_step[0, [3, 4, 6, 7]]  # plane and couple of limbs 3 and 4
    sigma = np.linalg.svd(rows, compute_uv=False)
    assert (sigma[:2] > 0.1).all() and (sigma[2:] < 1e-12).all()
    assert said("rank 2")
