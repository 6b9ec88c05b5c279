"""The page computes what Python computes: the same C, of the same machine, in another processor."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.core.library import POSE
from pkmcal.kinematics.workspace import sample_poses
from pkmcal.view import parallel

from . import pages

NAMES = [name for name in pk.machines() if name not in ("3r", "rbt-6t03p-printed")]
BOX = 0.35  # of what is reached: the poses that are asked for


def _moves(robot: pk.Robot) -> list[list[Any]]:
    """Poses of the workspace coordinate by coordinate, then actuators from there."""
    data = parallel.data(robot, cloud=False)
    poses = sample_poses(robot, 3, seed=1, share=BOX)
    moves = [["movePose", j, float(pose[k])] for pose in poses for j, k in enumerate(data["moved"])]
    q = robot.inverse(poses[-1])
    for a, actuator in enumerate(data["actuators"]):
        by = 0.03 * (actuator["range"][1] - actuator["range"][0])
        moves.append(["moveActuator", a, float(q[a] + by)])
    return moves


@pytest.fixture(scope="module")
def robots() -> dict[str, pk.Robot]:
    return {name: pk.load(name) for name in NAMES}


@pytest.fixture(scope="module")
def moved(
    robots: dict[str, pk.Robot], tmp_path_factory: pytest.TempPathFactory
) -> dict[str, list[tuple[list[Any], dict[str, Any]]]]:
    moves = [_moves(robot) for robot in robots.values()]
    found = pages.said(tmp_path_factory.mktemp("view"), list(robots.values()), moves)
    return {
        name: list(zip([["home"], *asked], states, strict=True))
        for name, asked, states in zip(robots, moves, found, strict=True)
    }


@pytest.mark.parametrize("name", NAMES)
def test_inverse_is_pythons_to_the_bit(
    name: str, robots: dict[str, pk.Robot], moved: dict[str, Any]
) -> None:
    states = [state for move, state in moved[name] if move[0] != "moveActuator"]
    poses = np.array([state["pose"] for state in states])
    assert len(np.unique(poses, axis=0)) > 3
    np.testing.assert_array_equal([state["q"] for state in states], robots[name].inverse(poses))


@pytest.mark.parametrize("name", NAMES)
def test_forward_is_pythons(name: str, robots: dict[str, pk.Robot], moved: dict[str, Any]) -> None:
    states = [state for move, state in moved[name] if move[0] == "moveActuator"]
    q, pose = (np.array([state[key] for state in states]) for key in ("q", "pose"))
    assert not any(state["stopped"] for state in states)
    found = robots[name].forward(q, pose)
    assert found.ok.all()
    off = np.abs(found.pose - pose) * np.where(np.arange(6) < 3, 1.0, robots[name].length)
    assert off.max() < 1e-10


@pytest.mark.parametrize("name", NAMES)
def test_poses_keep_what_the_sliders_say(
    name: str, robots: dict[str, pk.Robot], moved: dict[str, Any]
) -> None:
    names = robots[name].moved
    for (verb, *asked), state in moved[name]:
        if verb == "movePose":
            assert not state["stopped"]
            k = POSE.index(names[asked[0]])
            assert state["pose"][k] == pytest.approx(asked[1], abs=1e-8)
            assert robots[name].violation(state["pose"]) < 1e-9 * robots[name].machine.struct.size


@pytest.mark.parametrize("name", NAMES)
def test_limits_and_conditioning_are_pythons(
    name: str, robots: dict[str, pk.Robot], moved: dict[str, Any]
) -> None:
    robot = robots[name]
    for _, state in moved[name]:
        there = pk.dexterity(robot, state["pose"])
        assert state["conditioning"] == pytest.approx(float(there.conditioning), rel=1e-7)
        kept = robot.feasible(state["pose"], state["q"])
        for i, limits in enumerate(state["limits"]):
            for key, margin in (
                ("stroke", kept.stroke_margin),
                ("base", kept.base_cone_margin),
                ("platform", kept.platform_cone_margin),
            ):
                said = np.inf if limits[key] is None else limits[key]  # JSON has no infinity
                assert said == pytest.approx(float(margin[i]), abs=1e-8)
