"""Serial arms with joint errors in independent multibody engines: MuJoCo and Pinocchio.

Each arm is built joint by joint from axes, points and errors, without a formula of this project:
the errors go into the places of the bodies. Engines that are not installed are skipped.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

Solver = Callable[[np.ndarray], np.ndarray]  # theta (N, n) -> tool (N, 4, 4)


def error_rotation(errors: np.ndarray) -> np.ndarray:
    """Rz(Δψ) Ry(Δθ) Rx(Δφ), each written out."""
    a, b, g = errors[3:]
    x = [[1, 0, 0], [0, math.cos(a), -math.sin(a)], [0, math.sin(a), math.cos(a)]]
    y = [[math.cos(b), 0, math.sin(b)], [0, 1, 0], [-math.sin(b), 0, math.cos(b)]]
    z = [[math.cos(g), -math.sin(g), 0], [math.sin(g), math.cos(g), 0], [0, 0, 1]]
    return np.array(z) @ np.array(y) @ np.array(x)


def error_quaternion(errors: np.ndarray) -> np.ndarray:
    """The same as a quaternion, scalar first."""

    def times(p: np.ndarray, q: np.ndarray) -> np.ndarray:
        return np.array([p[0] * q[0] - p[1:] @ q[1:],
                         *(p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:]))])  # fmt: skip

    total = np.array([1.0, 0.0, 0.0, 0.0])
    for i in (2, 1, 0):
        turn = np.zeros(4)
        turn[0], turn[1 + i] = math.cos(errors[3 + i] / 2), math.sin(errors[3 + i] / 2)
        total = times(total, turn)
    return total


def mujoco(arm: Any, errors: np.ndarray) -> Solver:
    """In MuJoCo: body i stands at joint i's point, parallel to the base at zero."""
    engine = pytest.importorskip("mujoco")
    spec = engine.MjSpec()
    spec.compiler.degree = False
    body, last = spec.worldbody, np.zeros(3)
    for i, (axis, point) in enumerate(zip(arm.axes, arm.points, strict=True)):
        body = body.add_body(
            name=f"link{i}", pos=point - last + errors[i, :3], quat=error_quaternion(errors[i])
        )
        kinds = {"revolute": engine.mjtJoint.mjJNT_HINGE, "prismatic": engine.mjtJoint.mjJNT_SLIDE}
        body.add_joint(name=f"joint{i}", type=kinds[arm.kinds[i]], axis=axis, pos=[0, 0, 0])
        body.mass, body.inertia, body.explicitinertial = 1.0, [1.0, 1.0, 1.0], True
        last = point
    body.add_site(name="tool", pos=arm.home[:3, 3] - last)
    model = spec.compile()
    data = engine.MjData(model)

    def solve(theta: np.ndarray) -> np.ndarray:
        tools = np.tile(np.eye(4), (len(theta), 1, 1))
        for row, tool in zip(theta, tools, strict=True):
            data.qpos[:] = row
            engine.mj_kinematics(model, data)
            tool[:3, :3] = data.site("tool").xmat.reshape(3, 3) @ arm.home[:3, :3]
            tool[:3, 3] = data.site("tool").xpos
        return tools

    return solve


def pinocchio(arm: Any, errors: np.ndarray) -> Solver:
    """In Pinocchio: joint i's placement in joint i - 1, both parallel to the base at zero."""
    engine = pytest.importorskip("pinocchio")
    model, parent, last = engine.Model(), 0, np.zeros(3)
    for i, (axis, point) in enumerate(zip(arm.axes, arm.points, strict=True)):
        joint = {
            "revolute": engine.JointModelRevoluteUnaligned,
            "prismatic": engine.JointModelPrismaticUnaligned,
        }[arm.kinds[i]](axis)
        place = engine.SE3(error_rotation(errors[i]), point - last + errors[i, :3])
        parent, last = model.addJoint(parent, joint, place, f"joint{i}"), point
    home = engine.SE3(arm.home[:3, :3], arm.home[:3, 3] - last)
    data = model.createData()

    def solve(theta: np.ndarray) -> np.ndarray:
        tools = []
        for row in theta:
            engine.forwardKinematics(model, data, row)
            tools.append((data.oMi[parent] * home).homogeneous)
        return np.array(tools)

    return solve


ENGINES = {"mujoco": mujoco, "pinocchio": pinocchio}
