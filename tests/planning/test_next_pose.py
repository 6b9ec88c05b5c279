"""The next pose: that of a plan of one more, chosen while a measurement goes on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.kinematics.robot import Robot

PRINTER = Path(__file__).resolve().parents[2] / "examples" / "linear-delta" / "robot.toml"
NOISE = 0.02
KINDS: list[dict[str, Any]] = [
    {"kind": "pose"},
    {"kind": "position", "prior": 0.5, "unknown": "frame"},
    {"kind": "height", "prior": 0.5, "direction": (0, 0, 1)},
]


@pytest.fixture
def printer() -> Robot:
    return pk.load(PRINTER)


@pytest.mark.parametrize("options", KINDS)
def test_the_next_pose_is_that_of_a_plan_beside_the_rows(
    hexapod: Robot, options: dict[str, Any]
) -> None:
    """Both that are told one by one and those that were there from the beginning."""
    options = {**options, "noise": NOISE}
    poses = pk.sample_poses(hexapod, 60)
    options["targets"] = poses
    every = pk.VirtualMachine(hexapod, NOISE, seed=2).measure(
        hexapod.inverse(poses), options["kind"]
    )
    first = list(range(12))
    choice = pk.next_pose(hexapod, poses, measured=every.select(first), done=first, **options)
    done = first
    for _ in range(4):
        rest = np.setdiff1d(np.arange(len(poses)), done)
        plan = pk.plan_poses(hexapod, poses[rest], 1, measured=every.select(done), **options)
        assert choice.index == rest[plan.indices[0]]
        assert choice.predicted_after == pytest.approx(plan.predicted, rel=1e-6)
        done = [*done, choice.index]
        choice = choice.after()
        assert choice.predicted == pytest.approx(plan.predicted, rel=1e-6)


def test_it_is_the_best_of_all_that_are_tried(hexapod: Robot) -> None:
    """By the covariance of a calibration of all rows, which knows nothing of plans."""
    poses = pk.sample_poses(hexapod, 24)
    q = hexapod.inverse(poses)
    exact = pk.VirtualMachine(hexapod, NOISE).measure(q, "pose")
    exact = replace(exact, values=pk.VirtualMachine(hexapod, 0.0).measure(q, "pose").values)
    choice = pk.next_pose(
        hexapod, poses, kind="pose", noise=NOISE, measured=exact.select(range(14)),
        done=range(14), targets=poses[:5],
    )  # fmt: skip
    rms = {}
    for i in range(14, 24):
        found = pk.identify(hexapod, exact.select([*range(14), i]))
        rms[i] = float(np.sqrt((found.accuracy(poses[:5]) ** 2).mean()))
    assert choice.index == min(rms, key=rms.__getitem__)
    assert choice.predicted_after == pytest.approx(min(rms.values()), rel=1e-3)


def test_one_direction_is_predicted_as_a_calibration_says_it(printer: Robot) -> None:
    poses = pk.sample_poses(printer, 20)
    exact = pk.VirtualMachine(printer, 0.0).measure(printer.inverse(poses), "height")
    exact = replace(exact, sigma=NOISE)
    found = pk.identify(printer, exact)
    free = [printer.geometry.names.index(name) for name in found.free]
    by = printer.error_jacobian(poses)[:, 2, free]
    wanted = np.sqrt(np.einsum("ni,ij,nj->n", by, found.covariance, by).mean())
    options: dict[str, Any] = {"kind": "height", "noise": NOISE}
    plan = pk.plan_poses(printer, poses, len(poses), direction=(0, 0, 2.0), **options)
    assert plan.predicted == pytest.approx(wanted, rel=1e-6)
    assert plan.predicted < pk.plan_poses(printer, poses, len(poses), **options).predicted
    assert "predicted error along z" in str(plan)


def test_the_dilution_does_not_depend_on_the_noise(printer: Robot) -> None:
    poses = pk.sample_poses(printer, 20)
    choice = pk.next_pose(printer, poses, kind="height", noise=0.1)
    assert np.isinf(choice.after().dilution)
    found = []
    for noise in (0.1, 2.0):
        plan = pk.plan_poses(printer, poses, len(poses), kind="height", noise=noise)
        found.append(plan.dilution)
        assert plan.dilution == pytest.approx(plan.predicted / noise)
    assert found[0] == pytest.approx(found[1], rel=1e-9)
    noises = {"height": 0.1, "position": 0.2}
    both = pk.plan_poses(printer, poses, kind={"height": 18, "position": 2}, noise=noises)
    assert np.isnan(both.dilution)


def test_the_next_of_a_thousand_candidates_takes_milliseconds(hexapod: Robot) -> None:
    """42 numbers; of processor time. 20 ms are promised."""
    poses = pk.sample_poses(hexapod, 1000)
    choice = pk.next_pose(hexapod, poses, kind="pose", noise=NOISE)
    times = []
    for _ in range(20):
        began = process_time()
        choice = choice.after()
        assert choice.index >= 0 and choice.predicted > 0
        times.append(process_time() - began)
    assert np.median(times) < 0.02


@pytest.mark.parametrize(("index", "said"), [(99, "index"), (1.5, "index")])
def test_what_is_no_candidate_is_refused(hexapod: Robot, index: Any, said: str) -> None:
    choice = pk.next_pose(hexapod, pk.sample_poses(hexapod, 12), kind="pose")
    with pytest.raises((ValueError, TypeError), match=said):
        choice.after(index)


def test_all_measured_is_said(hexapod: Robot) -> None:
    poses = pk.sample_poses(hexapod, 12)
    choice = pk.next_pose(hexapod, poses, kind="pose", done=range(1, 12))
    while choice.left:
        choice = choice.after()
    assert choice.left == 0
    assert "all candidates are measured" in str(choice)
    with pytest.raises(ValueError, match="candidates: all of them are measured"):
        choice.index  # noqa: B018
