"""Closure rows of machines of limbs and all their derivatives, beside complex steps of the twin."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import pkmcal as pk

from .. import robots, twin
from ..workspaces import WORKSPACE, poses
from .test_machines_twin import EIGHT_ROWS, ERRORS, close, free, slots

WEIGHT = 0.4


def head_with_a_leg() -> pk.Robot:
    """The 3-PRS with a measured leg to its middle: a row more than coordinates, others weighted."""
    limbs = [
        {"kind": "PRS", "base": robots.ring(350.0, angle), "platform": robots.ring(250.0, angle)}
        | {"slider": [0.0, 0.0, 1.0], "normal": robots.ring(1.0, angle + 90.0)}
        | {"rod": 500.0, "branch": 1, "weights": [WEIGHT]}
        for angle in (0.0, 120.0, 240.0)
    ]
    limbs.append({"kind": "UPS", "base": [30.0, 20.0, -100.0], "platform": [10.0, -20.0, 5.0]})
    return robots.made("spatial", {"z": 700.0}, limbs)


MACHINES = {name: lambda name=name: pk.load(name) for name in WORKSPACE}
MACHINES |= {"eight rows": lambda: pk.load(EIGHT_ROWS), "a leg more": head_with_a_leg}
WHERE = {"eight rows": "2tpr2tps-spatial", "a leg more": "3prs"}


@pytest.mark.parametrize("name", MACHINES)
def test_closures_and_all_their_derivatives_are_those_of_the_twin(name: str) -> None:
    robot = MACHINES[name]()
    pose = poses(WHERE.get(name, name), 5, seed=3)
    q = robot.inverse(pose)
    geometry = robot.geometry
    noise = np.random.default_rng(5).standard_normal(len(geometry))
    sigma = np.array([1e-3 * ERRORS[unit] for unit in geometry.units])
    robot = robot.replace(geometry.values + sigma * noise)  # closures are missed a little
    found = robot.machine.closure(robot.slots, pose, q)
    model, g = robot.model, slots(robot)
    for i, u in enumerate(free(robot, pose)):

        def missed(u: np.ndarray, q: np.ndarray) -> np.ndarray:
            return twin.closures(model, twin.pose_of_free(model, u), q, g)

        # spheres in the core are (d.d - rho^2) / (2 rho): they differ by what is missed over rho
        expected = missed(u, q[i])
        assert 1e-5 < np.abs(expected).max() < 0.1
        np.testing.assert_allclose(found.residual[i], expected, rtol=1e-3, atol=1e-9)
        close(found.by_q[i], twin.complex_step(lambda q, u=u: missed(u, q), q[i]), 1e-3)
        close(found.by_free[i], twin.complex_step(lambda u, q=q[i]: missed(u, q), u), 1e-3)
        at = twin.complex_step(lambda u: twin.pose_of_free(model, u), u)
        np.testing.assert_allclose(found.pose[i], twin.pose_of_free(model, u), rtol=0, atol=1e-9)
        np.testing.assert_allclose(found.pose_by_free[i], at, rtol=0, atol=1e-9)


def test_of_a_limb_that_does_not_reach_a_reading_misses_its_closure_over_its_slope() -> None:
    robot = pk.load("linear-delta")
    pose = robot.home + 200.0 * np.eye(6)[0]
    reaches = np.isfinite([twin.limb_inverse(limb, n, pose) for limb, n in numbered(robot)])
    assert 0 < reaches.sum() < 3 and np.isnan(robot.inverse(pose)).all()
    q = robot.inverse(robot.home) + np.array([10.0, -20.0, 30.0])
    missed = robot.machine.readings(robot.slots, pose[None], q[None])[0][0]
    for k, (limb, n) in enumerate(numbered(robot)):

        def square(q: np.ndarray, limb: Any = limb, n: dict[str, float] = n) -> np.ndarray:
            row = twin.limb_rows(limb, n, pose, q[0])[0]  # |d| - rod
            return np.array([(row + n["rod"]) ** 2 - n["rod"] ** 2])

        at = q[limb.actuator]
        newton = -square(np.array([at])) / twin.complex_step(square, np.array([at]))[0]
        expected = twin.limb_inverse(limb, n, pose) - at if reaches[k] else newton[0]
        np.testing.assert_allclose(missed[k], expected, rtol=1e-9)


def numbered(robot: pk.Robot) -> list[tuple[Any, dict[str, float]]]:
    return list(zip(robot.model.limbs, twin.numbers(robot.model, None), strict=True))
