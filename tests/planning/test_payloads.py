"""Plans of poses under several payloads."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk

NOISE = 0.01


@pytest.fixture(scope="module")
def robot() -> pk.Robot:
    return pk.load("hexapod").yielding({"offset*": 1e-4})


def plan(robot: pk.Robot, payloads: tuple[Any, ...], **options: Any) -> pk.Plan:
    candidates = pk.sample_poses(robot.rigid, 50, seed=1)
    given = {"count": 16, "free": ["offset*", "compliance.*"], "kind": "pose", "noise": NOISE}
    return pk.plan_poses(robot, candidates, payloads=payloads, **(given | options))


def test_deviations_of_a_plan_are_those_of_the_calibration_to_come(robot: pk.Robot) -> None:
    made = plan(robot, (0.0, 100.0))
    rows = pk.VirtualMachine(robot, NOISE, seed=1).measure(made.actuators, "pose", load=made.load)
    found = pk.identify(robot, rows, free=["offset*", "compliance.*"], loss="classical")
    assert made.parameters == found.free
    np.testing.assert_allclose(found.stderr, made.stderr, rtol=1e-3)


def test_two_payloads_predict_compliances_better_than_one(robot: pk.Robot) -> None:
    free = [*robot.rigid.model.free, "compliance.*"]  # of 48 numbers with those of the geometry
    both = plan(robot, (0.0, 100.0), free=free, count=40)
    one = plan(robot, (100.0,), free=free, count=40)
    assert both.stderr[42:].max() <= 0.035 * 1e-4
    assert both.stderr[42:].max() < 0.8 * one.stderr[42:].max()
    assert both.predicted < both.at_random


def test_without_a_load_compliances_of_a_machine_without_weight_stay_open(robot: pk.Robot) -> None:
    made = plan(robot, (0.0,))
    assert np.isinf(made.stderr[6:]).all()
    assert np.isfinite(made.stderr[:6]).all()


def test_poses_under_one_payload_follow_one_another(robot: pk.Robot) -> None:
    """And the tour is what the drives travel, whatever is carried."""
    made = plan(robot, (0.0, pk.Load(mass=60.0, centre=(0, 0, 80)), 100.0))
    masses = np.asarray(made.load.mass)
    assert np.count_nonzero(np.diff(masses)) == len(set(masses.tolist())) - 1
    assert np.asarray(made.load.centre)[masses == 60.0].tolist() == [[0, 0, 80]] * int(
        (masses == 60.0).sum()
    )
    way = np.vstack([robot.inverse(robot.home), made.actuators])
    assert made.travel == pytest.approx(np.abs(np.diff(way, axis=0)).max(axis=1).sum())
    weighed = plan(robot, (0.0, 100.0), travel_weight=0.5)
    assert weighed.travel <= weighed.travel_unweighted


def test_a_plan_under_payloads_finds_compliances_of_an_effect() -> None:
    """Of a rigid machine as of one that yields by 0, and predicts what a calibration states."""
    robot = pk.load("hexapod")
    rigid = plan(robot, (0.0, 80.0), free="offset*", effects=[pk.Elasticity("offset*")])
    soft = robot.yielding({"offset*": 0.0})
    stated = plan(soft, (0.0, 80.0), free=["offset*", "compliance.*"])
    assert rigid.parameters == stated.parameters
    np.testing.assert_array_equal(rigid.actuators, stated.actuators)
    with pytest.raises(ValueError, match="expansion follows rows"):
        plan(robot, (), effects=[pk.Expansion(1e-5)])


def test_a_plan_for_an_arm_predicts_what_its_calibration_states() -> None:
    """Deviations of compliances by payloads, each at half of the poses, against a calibration."""
    arm = pk.SerialArm(
        [[0, 0, 1], [0, 1, 0], [0, 1, 0]], [[0, 0, 0], [0, 0, 290], [0, 0, 560]],
        [450, 0, 630, 0, 0, 0],
    )  # fmt: skip
    theta = np.random.default_rng(0).uniform(-1.5, 1.5, (60, arm.n_joints))
    effects = [pk.Sag(), pk.Elasticity(["joint2", "joint3"])]
    made = pk.plan_poses(
        arm, theta, 30, payloads=(0.0, 8.0), effects=effects, noise=0.02, target=[50.0, 30.0, 20.0]
    )
    names = list(made.parameters)
    places = [names.index(name) for name in ("compliance2", "compliance3")]
    soft = pk.VirtualMachine(arm.yielding({2: 2e-8, 3: 4e-8}), noise=0.02, seed=1)
    rows = soft.measure(made.actuators, target=[50.0, 30.0, 20.0], load=made.load)
    found = pk.identify(arm, rows, effects=effects, loss="classical")
    sure = [found.parameters[names[i]]["stderr"] for i in places]
    np.testing.assert_allclose(made.stderr[places], sure, rtol=0.2)


def test_no_candidate_gives_way_under_a_payload() -> None:
    soft = pk.load("hexapod").yielding({"offset*": 1e-3})
    candidates = pk.sample_poses(soft.rigid, 80, seed=1)
    heavy = pk.Load(mass=150.0)
    held = soft.forward(soft.rigid.inverse(candidates), load=heavy).ok
    assert 0 < held.sum() < len(held)
    made = pk.plan_poses(
        soft, candidates, 8, free=["offset*", "compliance.*"], kind="pose", payloads=(0.0, heavy)
    )
    assert held[made.indices].all()
    assert made.left_out >= (~held).sum()


@pytest.mark.parametrize(
    ("name", "payloads", "message"),
    [
        ("hexapod", (5.0,), "nothing of hexapod yields"),
        ("soft", 5.0, "payloads must be several masses"),
        ("soft", ("5",), "payloads must be several masses"),
        ("soft", (-5.0,), "must not be negative"),
        ("soft", (pk.Load(mass=[1.0, 2.0]),), "load: mass"),
        ("3r", (5.0,), "nothing of 3R arm yields: .*joint"),
    ],
)
def test_payloads_that_do_not_fit_are_refused(name: str, payloads: Any, message: str) -> None:
    machine = pk.load("hexapod" if name == "soft" else name)
    if name == "soft":
        machine = machine.yielding({"offset*": 1e-4})
    candidates = np.zeros((3, 3)) if name == "3r" else pk.sample_poses(pk.load("hexapod"), 10)
    with pytest.raises((ValueError, TypeError), match=message):
        pk.plan_poses(machine, candidates, 3, payloads=payloads)


def test_the_command_line_plans_and_its_rows_state_the_payload(run: Any, tmp_path: Path) -> None:
    options = ["--count", "8", "--kind", "pose", "--free", "offset*,compliance.*", "--json"]
    options += ["--compliance", "offset*=1e-4", "--payloads", "0,100 kg"]
    said = json.loads(run("plan", "hexapod", *options, "--out", tmp_path / "plan").stdout)
    assert sorted(set(said["load"]["mass"])) == [0.0, 100.0]
    lines = (tmp_path / "plan" / "commands.csv").read_text(encoding="utf-8").splitlines()
    heads = next(line for line in lines if line.startswith("q1")).split(",")
    assert "payload [kg]" in heads
