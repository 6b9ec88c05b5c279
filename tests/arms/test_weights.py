"""Torques of gravity on the joints of arms, against MuJoCo and the masses of URDF files (A5)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arms import urdf
from pkmcal.arms.weights import at_rest, gravity_products, gravity_torques, link_moments

AXES = [[0, 0, 1], [0, 1, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0]]
POINTS = [[0, 0, 0], [0, 0, 290], [0, 0, 560], [0, 0, 630], [302, 0, 630], [374, 0, 630]]
MASSES = np.array([3.0, 4.0, 3.5, 1.5, 0.8, 0.3])
CENTRES = np.array(
    [[0, 0, 200], [10, 20, 420], [50, 0, 620], [200, 0, 630], [320, 0, 640], [380, 10, 630]], float
)
HOME = [450, 0, 630, 0, 0, 0]
SLIDING = ["prismatic", *["revolute"] * 4, "prismatic"]
ARMS = {
    "six turning": pk.SerialArm(AXES, POINTS, HOME),
    "with slides": pk.SerialArm(AXES, POINTS, HOME, kinds=SLIDING),
}


def thetas(arm: pk.SerialArm, count: int = 20) -> np.ndarray:
    scale = np.array([1.0 if unit == "rad" else 100.0 for unit in arm.actuator_units])
    return np.random.default_rng(0).uniform(-2, 2, (count, arm.n_joints)) * scale


@pytest.mark.parametrize("name", ARMS)
def test_torques_of_gravity_are_those_of_mujoco(name: str) -> None:
    engine = pytest.importorskip("mujoco")
    arm, gravity = ARMS[name], [0.3, -0.5, -9.7]
    spec = engine.MjSpec()
    spec.option.gravity = np.array(gravity) * 1e3  # mm: forces come out in mN mm
    spec.compiler.degree = False
    body, last = spec.worldbody, np.zeros(3)
    for i in range(6):
        body = body.add_body(name=f"link{i}", pos=arm.points[i] - last)
        kinds = {"revolute": engine.mjtJoint.mjJNT_HINGE, "prismatic": engine.mjtJoint.mjJNT_SLIDE}
        body.add_joint(name=f"joint{i}", type=kinds[arm.kinds[i]], axis=arm.axes[i])
        body.mass, body.ipos = MASSES[i], CENTRES[i] - arm.points[i]
        body.inertia, body.explicitinertial = [1e4, 1e4, 1e4], True
        last = arm.points[i]
    model = spec.compile()
    data, theta = engine.MjData(model), thetas(arm)
    found = gravity_torques(arm, theta, MASSES, CENTRES, gravity)
    for i in range(len(theta)):
        data.qpos[:] = theta[i]
        engine.mj_forward(model, data)
        wanted = -data.qfrc_bias / 1e3
        assert np.abs(found[i] - wanted).max() <= 1e-12 * np.abs(found).max()


def test_torques_are_the_change_of_the_height_of_all_masses() -> None:
    """By differences, with joint errors and slides, where no engine is installed."""
    errors = np.random.default_rng(1).normal(size=(6, 6)) * [1, 1, 1, 1e-2, 1e-2, 1e-2]
    for arm in ARMS.values():
        wrong = arm.replace(errors)
        theta = thetas(arm, 3)
        found = gravity_torques(wrong, theta, MASSES, CENTRES)
        assert found.shape == (3, 6)
        for k in range(6):
            step = np.zeros(6)
            step[k] = 1e-4 if arm.kinds[k] == "revolute" else 1e-2
            ends = [_energy(wrong, theta + sign * step) for sign in (1, -1)]
            change = (ends[0] - ends[1]) / (2 * step[k])
            assert np.abs(found[:, k] - change).max() < 1e-6 * np.abs(found).max()


def _energy(arm: pk.SerialArm, theta: np.ndarray) -> np.ndarray:
    """Work of gravity on each mass, each at the tip of an arm of its own."""
    total = np.zeros(len(theta))
    for k in range(6):
        tip = [*CENTRES[k], 0, 0, 0]
        part = pk.SerialArm(arm.axes[: k + 1], arm.points[: k + 1], tip, kinds=arm.kinds[: k + 1],
                            joint_errors=arm.joint_errors[: k + 1])  # fmt: skip
        total -= MASSES[k] * 9.80665 * part.forward(theta[:, : k + 1])[:, 2, 3]
    return total


def test_moments_of_links_give_the_torques_of_masses() -> None:
    arm = ARMS["six turning"]
    theta, gravity = thetas(arm), np.array([1.0, -2.0, -9.0])
    products = gravity_products(arm, theta, gravity)
    moments = link_moments(arm, MASSES, CENTRES) * np.linalg.norm(gravity)
    by_moments = np.einsum("nilk,lk->ni", products, moments)
    by_masses = gravity_torques(arm, theta, MASSES, CENTRES, gravity)
    assert np.abs(by_moments - by_masses).max() < 1e-12 * np.abs(by_masses).max()
    assert not products[:, 3, :3].any()  # links before a joint
    upright = gravity_products(arm, theta)
    assert np.abs(upright[:, 0]).max() < 1e-12  # gravity does not turn a vertical axis


def test_elastic_joints_rest_where_motors_and_torques_agree() -> None:
    arm, compliance = ARMS["six turning"], np.full(6, 1e-8)
    theta = thetas(arm)

    def torques(at: np.ndarray) -> np.ndarray:
        return gravity_torques(arm, at, MASSES, CENTRES)

    rest = at_rest(torques, theta, compliance)
    assert np.abs(rest - compliance * torques(rest) - theta).max() < 1e-14
    assert np.abs(rest - theta).max() > 1e-4
    assert np.isnan(at_rest(torques, theta, np.full(6, 1e-3))).any()


def test_inertials_of_a_urdf_file_hang_on_its_joints(tmp_path: Path) -> None:
    """Fixed links count with the joint before them, links beside the chain too."""
    path = tmp_path / "arm.urdf"
    path.write_text(
        """<robot name="two"><link name="world"><inertial><mass value="9"/></inertial></link>
        <link name="a"><inertial><origin xyz="0.1 0 0"/><mass value="2"/></inertial></link>
        <link name="box"><inertial><mass value="1"/></inertial></link>
        <link name="b"><inertial><origin xyz="0 0 0.2"/><mass value="3"/></inertial></link>
        <link name="tool"/><link name="finger"><inertial><mass value="0.5"/></inertial></link>
        <joint name="j1" type="revolute"><parent link="world"/><child link="a"/>
          <origin xyz="0 0 0.5"/><axis xyz="0 1 0"/><limit lower="-1" upper="1"/></joint>
        <joint name="f" type="fixed"><parent link="a"/><child link="box"/>
          <origin xyz="0.4 0 0"/></joint>
        <joint name="j2" type="continuous"><parent link="a"/><child link="b"/>
          <origin xyz="0.3 0 0" rpy="0 1.5707963267948966 0"/><axis xyz="0 0 1"/></joint>
        <joint name="t" type="fixed"><parent link="b"/><child link="tool"/></joint>
        <joint name="g" type="prismatic"><parent link="b"/><child link="finger"/>
          <origin xyz="0 0 0.1"/></joint></robot>"""
    )
    masses, centres = urdf.weights(path, "tool", None)
    assert masses.tolist() == [3.0, 3.5]
    a = (2 * np.array([100, 0, 500]) + np.array([400, 0, 500])) / 3
    b = (3 * np.array([500, 0, 500]) + 0.5 * np.array([400, 0, 500])) / 3.5
    assert np.abs(centres - [a, b]).max() < 1e-9
    path.write_text(path.read_text().replace('value="3"', 'value="-3"'))
    with pytest.raises(pk.FileError, match="link 'b': <inertial> must have a mass of 0 or more"):
        urdf.weights(path, "tool", None)
