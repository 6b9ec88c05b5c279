"""Machines as lines: limbs as long as they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.view.skeleton import skeleton

from ..workspaces import CHAINS

PRINTED = "rbt-6t03p-printed"  # as misprinted: the machine has no pose at home


@pytest.mark.parametrize("name", sorted({*pk.machines()} - {"3r", PRINTED, *CHAINS}))
def test_limbs_are_as_long_as_geometry_and_actuators_say(name: str) -> None:
    robot = pk.load(name)
    q = robot.inverse(robot.home)
    drawn = skeleton(robot, q, robot.home)
    assert drawn is not None and len(drawn.limbs) == len(robot.model.limbs)
    for i, (limb, line) in enumerate(zip(robot.model.limbs, drawn.limbs, strict=True)):
        last = np.linalg.norm(line[-1] - line[-2])
        if len(line) == 2:
            assert last == pytest.approx(q[limb.actuator], abs=1e-9)
            continue
        assert last == pytest.approx(robot.geometry[f"rod{i + 1}"], abs=1e-9)
        first = np.linalg.norm(line[1] - line[0])
        crank = f"crank{i + 1}"
        moved = robot.geometry[crank] if crank in robot.geometry else abs(
            q[limb.actuator] * robot.geometry[f"gain{i + 1}"] + robot.geometry[f"offset{i + 1}"]
        )  # fmt: skip
        assert first == pytest.approx(moved, abs=1e-9)


def test_chain_of_an_arm_ends_at_its_tool() -> None:
    arm = pk.load("3r")
    q = np.radians([-30.0, 20.0, 40.0])
    drawn = skeleton(arm, q, np.zeros(6))
    assert drawn is not None
    (chain,) = drawn.limbs
    np.testing.assert_allclose(chain[-1], arm.forward(q)[:3, 3], atol=1e-12)
    np.testing.assert_allclose(
        np.linalg.norm(np.diff(chain[1:], axis=0), axis=1), [520, 350, 250], atol=1e-9
    )


def test_a_base_frame_moves_the_whole_machine() -> None:
    plain = pk.load("hexapod")
    frame = np.array([100.0, -20.0, 5.0, 0.1, -0.2, 0.3])
    moved = pk.Robot(replace(plain.model, base_frame=frame))
    q = plain.inverse(plain.home)
    one, other = skeleton(plain, q, plain.home), skeleton(moved, q, moved.home)
    assert one is not None and other is not None
    near = np.linalg.norm(one.joints[:, None] - one.joints, axis=2)
    np.testing.assert_allclose(
        np.linalg.norm(other.joints[:, None] - other.joints, axis=2), near, atol=1e-9
    )
    assert np.linalg.norm(other.joints - one.joints, axis=1).min() > 50


def test_a_machine_without_a_pose_is_not_drawn() -> None:
    printed = pk.load(PRINTED)
    assert skeleton(printed, printed.inverse(printed.home), printed.home) is None
    robot = pk.load("linear-delta")
    assert skeleton(robot, np.array([1e5, 0.0, 0.0]), robot.home) is None
