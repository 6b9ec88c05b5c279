"""MuJoCo, which knows nothing of our formulas, assembles the exported model in our poses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pkmcal as pk

from .. import robots

mujoco = pytest.importorskip("mujoco")
METRE = 1e-3
CASES = {
    "hexapod": lambda: pk.load("hexapod"),
    "3rps": lambda: pk.load("3rps"),
    "6-rus": lambda: pk.load("6-rus"),
    "rbt-6t03p": lambda: pk.load("rbt-6t03p"),
    "linear-delta": lambda: pk.load("linear-delta"),
    "linear-delta-6": lambda: pk.load("linear-delta-6"),
    "rotary-delta": lambda: pk.load("rotary-delta"),
    "3rrr-planar": lambda: pk.load("3rrr-planar"),
    "leaning rails": lambda: pk.load("linear-delta").replace({"slider1.tilt1": 0.01, "rod2": 216}),
    "leaning axes": lambda: pk.load("rotary-delta").replace({"axis1.tilt2": 0.02, "crank3": 525}),
    "drives": lambda: robots.hexapod({"offset": 5.0, "gain": -1.01}),
}


def with_errors(name: str) -> pk.Robot:
    """Errors in every number, as calibrations leave them: the file's home does not close."""
    robot, rng = pk.load(name), np.random.default_rng(0)
    size = {"mm": 0.5, "rad": 3e-3}
    pairs = list(zip(robot.geometry.names, robot.geometry.units, strict=True))
    return robot.replace({n: robot.geometry[n] + rng.normal() * size.get(u, 0.0) for n, u in pairs})


CASES |= {
    f"{name} with errors": lambda name=name: with_errors(name)  # type: ignore[misc]
    for name in list(CASES)[:8]
}


def assembled(model: Any, drives: Any) -> tuple[Any, Any]:
    """Platform's place and turning with the drives held, by Newton on MuJoCo's constraints."""
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data = mujoco.MjData(model)
    held = np.zeros(model.nv, dtype=bool)
    data.qpos[:] = model.qpos0
    for i, drive in enumerate(drives, 1):
        joint = model.joint(f"q{i}")
        held[joint.dofadr[0]] = True
        data.qpos[joint.qposadr[0]] = drive
    for _ in range(60):
        mujoco.mj_fwdPosition(model, data)
        jacobian = data.efc_J.reshape(data.nefc, model.nv)[:, ~held]
        move = np.zeros(model.nv)
        move[~held] = np.linalg.lstsq(jacobian, -data.efc_pos, rcond=1e-9)[0]
        mujoco.mj_integratePos(model, data.qpos, move, 1.0)
        if abs(move).max() < 1e-14:
            break
    mujoco.mj_fwdPosition(model, data)
    assert abs(data.efc_pos).max() < 1e-12
    body = data.body("platform")
    return body.xpos / METRE, body.xmat.reshape(3, 3)


@pytest.mark.parametrize("case", CASES)
def test_mujoco_reaches_our_poses(case: str, tmp_path: Path) -> None:
    robot = CASES[case]()
    pk.export.mjcf(robot, tmp_path / "robot.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    rng = np.random.default_rng(1)
    moved = robot.home + rng.uniform(-1, 1, (10, 6)) * [15, 15, 15, 0.05, 0.05, 0.05]
    poses = robot.complete(moved)
    q = robot.inverse(poses, match=True)
    g = robot.slots
    units = [METRE if limb.kind != "RUS" else 1.0 for limb in robot.model.limbs]
    for pose, coordinates in zip(poses, q, strict=True):
        own = coordinates[[limb.actuator for limb in robot.model.limbs]]
        place, turned = assembled(model, (g[:, 7] * own + g[:, 6]) * units)
        np.testing.assert_allclose(place, pose[:3], rtol=0, atol=1e-9)
        want = Rotation.from_euler("xyz", pose[3:]).as_matrix()
        np.testing.assert_allclose(turned, want, rtol=0, atol=1e-11)


def test_actuators_are_those_of_the_robot(tmp_path: Path) -> None:
    """Two rods on one carriage have one drive, and the other follows."""
    pk.export.mjcf(pk.load("linear-delta-6"), tmp_path / "robot.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    assert model.nu == 3
    assert (model.eq_type == int(mujoco.mjtEq.mjEQ_JOINT)).sum() == 3


def test_what_the_model_cannot_hold_is_refused(tmp_path: Path) -> None:
    framed = robots.hexapod(frames={"base": dict.fromkeys(("x", "y", "z"), 1.0)})
    for robot, reason in (
        (pk.load("2tpr2tps"), "pose map 2tpr2tps"),
        (pk.load("2tpr2tps-spatial"), "limb 3, a UPR"),
        (framed, "frames"),
    ):
        with pytest.raises(pk.ArgumentError, match=reason):
            pk.export.mjcf(robot, tmp_path / "x.xml")
    assert not (tmp_path / "x.xml").exists()
