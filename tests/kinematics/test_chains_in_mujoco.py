"""Chains with all their errors as bodies in MuJoCo: every limb ends where the platform is."""

from __future__ import annotations

import xml.etree.ElementTree as Xml

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.geometry.chain_joints import ERRORS
from pkmcal.screw import from_pose

from ..chain_twin import rpy
from .test_chains import commands, disturbed

mujoco = pytest.importorskip("mujoco")


def numbers(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)


def quaternion(R: np.ndarray) -> np.ndarray:
    found = np.empty(4)
    mujoco.mju_mat2Quat(found, np.ascontiguousarray(R).ravel())
    return found


def model(robot: pk.Robot) -> object:
    """Each chain as bodies in bodies, every joint's error the place of its body."""
    chains = robot.model.chains
    assert chains is not None
    home = from_pose(chains.home)
    top = Xml.Element("mujoco")
    Xml.SubElement(top, "compiler", angle="radian")
    world = Xml.SubElement(top, "worldbody")

    def wrong(name: str) -> np.ndarray:
        return np.array([robot.geometry[k] if (k := f"{name}.{e}") in robot.geometry else 0.0
                         for e in ERRORS])  # fmt: skip

    for i, limb in enumerate(chains.limbs):
        parent, before = world, np.zeros(3)
        for name in chains.members[i]:
            part, error = chains.parts[name], wrong(name)
            place = numbers(part.joint.at + error[:3] - before)
            turned = numbers(quaternion(rpy(*error[3:])))
            parent = Xml.SubElement(parent, "body", pos=place, quat=turned)
            kind = "slide" if part.slides else "hinge"
            Xml.SubElement(parent, "joint", name=f"{i} {name}", type=kind, axis=numbers(part.axis))
            Xml.SubElement(parent, "inertial", pos="0 0 0", mass="1", diaginertia="1 1 1")
            before = part.joint.at
        end = limb[-1].at
        if limb[-1].ball:
            place = end + wrong(f"limb{i + 1}.joint{len(limb)}")[:3] - before
            Xml.SubElement(parent, "site", name=f"end {i}", pos=numbers(place))
        else:
            error = wrong(f"limb{i + 1}.platform")
            E = np.eye(4)
            E[:3, :3], E[:3, 3] = rpy(*error[3:]), error[:3]
            to = home.copy()
            to[:3, 3] -= end
            local = np.linalg.inv(E) @ to
            local[:3, 3] += end - before
            turned = numbers(quaternion(local[:3, :3]))
            place = numbers(local[:3, 3])
            Xml.SubElement(parent, "site", name=f"end {i}", pos=place, quat=turned)
    return mujoco.MjModel.from_xml_string(Xml.tostring(top, encoding="unicode"))


@pytest.mark.parametrize("name", ("tricept", "delta-parallelograms", "eclipse", "five-bar"))
def test_every_limb_ends_on_the_platform(name: str) -> None:
    robot = disturbed(pk.load(name), 2.0)
    chains, made = robot.model.chains, model(robot)
    assert chains is not None
    state = mujoco.MjData(made)
    for q in commands(robot, 5):
        found = robot.forward(q)
        T = from_pose(found.pose)
        passive = dict(zip(robot.passive_names, found.passive, strict=True))
        for i, names in enumerate(chains.members):
            for part in names:
                actuator = chains.parts[part].joint.actuator
                if actuator is None:
                    value = passive[part]
                else:
                    drive = q[actuator] + robot.geometry[f"offset{actuator + 1}"]
                    value = drive - chains.parts[part].joint.home_value
                state.joint(f"{i} {part}").qpos[0] = value
        mujoco.mj_kinematics(made, state)
        carried = T @ np.linalg.inv(from_pose(chains.home))
        for i, limb in enumerate(chains.limbs):
            site = state.site(f"end {i}")
            if limb[-1].ball:
                wrong = [robot.geometry[f"limb{i + 1}.platform.{e}"] for e in ERRORS[:3]]
                joint = (carried @ [*(limb[-1].at + wrong), 1.0])[:3]
                assert np.abs(site.xpos - joint).max() < 1e-9
            else:
                there = np.abs(np.array(site.xpos) - T[:3, 3])
                turned = np.abs(np.array(site.xmat).reshape(3, 3) - T[:3, :3])
                assert there[:2].max() < 1e-9 and turned[:2, :2].max() < 1e-11
                if chains.map == "spatial":
                    assert there.max() < 1e-9 and turned.max() < 1e-11
