"""The built-in machines: their published numbers, their homes, and their default free sets."""

from __future__ import annotations

import numpy as np
import pytest

import pkmcal as pk
from pkmcal import robotfile
from pkmcal.core import MAPS, POSE
from pkmcal.limb_kinds import KINDS
from pkmcal.model import Model

MACHINES = robotfile.builtin_names()

# How far poses may be from home for the checks below: mm and rad in every free coordinate.
REACH = {"hexapod": (60.0, 0.26), "rbt-6t03p": (15.0, 0.12), "linear-delta": (60.0, 0.0)}
# The paper's 28 errors hold two that do nothing: platform3.x and platform4.x leave their legs'
# lengths alone wherever x = z tan(beta).
DEPENDENT = {"2tpr2tps": 2}


def points(model: Model, point: str) -> np.ndarray:
    """Base or platform joints (n_limbs, 3)."""
    geometry = model.geometry
    rows = range(1, len(model.limbs) + 1)
    return np.array([[geometry[f"{point}{i}.{axis}"] for axis in "xyz"] for i in rows])


def poses(model: Model, name: str, count: int = 40) -> np.ndarray:
    """Random poses of the machine around its home, (count, 6)."""
    length, angle = REACH.get(name, (30.0, 0.12))
    reach = np.array([length] * 3 + [angle] * 3)
    free = [POSE.index(each) for each in MAPS[model.map]]
    found = np.tile(model.home, (count, 1))
    spread = np.random.default_rng(5).uniform(-1.0, 1.0, (count, 6)) * reach
    found[:, free] += spread[:, free]
    if model.map == "2tpr2tps":
        found[:, 0] = found[:, 2] * np.tan(found[:, 4])
    return found


@pytest.mark.parametrize("name", MACHINES)
def test_home_is_reached_and_found_again(name: str) -> None:
    robot = pk.load(name)
    q = robot.inverse(robot.home)
    assert np.isfinite(q).all()
    assert np.allclose(robot.forward(q).pose, robot.home, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", MACHINES)
def test_home_keeps_every_limit(name: str) -> None:
    model = robotfile.read(name)
    q = pk.load(name).inverse(model.home)
    assert not model.home[3:].any()  # R is the identity there
    legs = model.home[:3] + points(model, "platform") - points(model, "base")
    for i, limb in enumerate(model.limbs):
        low, high = limb.stroke or (-np.inf, np.inf)
        assert low < q[limb.actuator] < high
        if KINDS[limb.kind].driver == "length" and limb.base_cone is not None:
            cosine = legs[i] @ limb.base_cone.axis / np.linalg.norm(legs[i])
            assert np.arccos(cosine) < limb.base_cone.angle


@pytest.mark.parametrize("name", MACHINES)
def test_poses_around_home_are_reached_and_found_again(name: str) -> None:
    robot = pk.load(name)
    wanted = poses(robot.model, name)
    found = robot.forward(robot.inverse(wanted))
    assert found.ok.all()
    assert np.allclose(found.pose, wanted, rtol=0, atol=1e-8)


@pytest.mark.parametrize("name", MACHINES)
def test_default_free_set_is_independent(name: str) -> None:
    robot = pk.load(name)
    free = robot.model.free
    columns = [robot.geometry.names.index(each) for each in free]
    effects = robot.error_jacobian(poses(robot.model, name))[..., columns]
    effects[:, 3:] *= robot.length
    effects = effects.reshape(-1, len(free))
    sizes = np.linalg.norm(effects, axis=0)
    strength = np.linalg.svd(effects / np.maximum(sizes, 1e-9 * sizes.max()), compute_uv=False)
    assert np.sum(strength > 1e-7 * strength[0]) == len(free) - DEPENDENT.get(name, 0)


@pytest.mark.parametrize("name", MACHINES)
def test_built_in_machines_are_untied_with_offset_0_and_gain_1(name: str) -> None:
    geometry = robotfile.read(name).geometry
    assert not geometry.tied.any() and not geometry.parameters
    for number in geometry.numbers:
        if number.slot in ("offset", "gain"):
            assert geometry[number.name] == (1.0 if number.slot == "gain" else 0.0)


# published numbers --------------------------------------------------------------------------------


def test_2tpr2tps_has_the_published_joints() -> None:
    """Table 1: a 140, b 80, c 200, e 384.7, f 278.5 mm; d is the 294.2 mm of Table 2."""
    a, b, c, d, e, f = 140.0, 80.0, 200.0, 294.2, 384.7, 278.5
    model = robotfile.read("2tpr2tps")
    base = [(d, -e / 2, 0), (d, e / 2, 0), (0, f / 2, 0), (0, -f / 2, 0)]
    platform = [(a, -b / 2, 0), (a, b / 2, 0), (0, c / 2, 0), (0, -c / 2, 0)]
    assert np.allclose(points(model, "base"), base, rtol=0, atol=1e-12)
    assert np.allclose(points(model, "platform"), platform, rtol=0, atol=1e-12)
    lengths = [454.959517429848, 454.959517429848, 401.921089892033, 401.921089892033]
    legs = model.home[:3] + points(model, "platform") - points(model, "base")
    assert np.allclose(np.linalg.norm(legs, axis=1), lengths, rtol=0, atol=1e-9)
    assert len(model.free) == 28


def test_hexapod_joints_lie_on_circles_of_650_and_250_mm() -> None:
    model = robotfile.read("hexapod")
    for point, radius, degrees in (
        ("base", 325.0, [20, 100, 140, -140, -100, -20]),
        ("platform", 125.0, [42.5, 77.5, 162.5, -162.5, -77.5, -42.5]),
    ):
        angles = np.radians(degrees)
        expected = radius * np.array([np.cos(angles), np.sin(angles), 0.0 * angles]).T
        assert np.allclose(points(model, point), expected, rtol=0, atol=6e-5)  # 4 decimals printed
    assert len(model.free) == 42


def test_rbt_6t03p_stands_in_mid_stroke_on_rods_of_223_mm() -> None:
    robot = pk.load("rbt-6t03p")
    assert np.allclose(robot.inverse(robot.home), 208.8966245, rtol=0, atol=1e-7)
    # so the table's joints and a height of 208.897 mm give rods of 223.00035 mm
    legs = points(robot.model, "platform") - points(robot.model, "base") - [0.0, 0.0, 208.897]
    assert np.allclose(np.linalg.norm(legs, axis=1), 223.00035, rtol=0, atol=2e-6)


def test_linear_delta_is_a_mini_kossel() -> None:
    model = robotfile.read("linear-delta")
    reach = points(model, "base") - points(model, "platform")
    assert np.allclose(np.linalg.norm(reach, axis=1), 105.6)
    q = pk.load("linear-delta").inverse([0.0, 0.0, 240.0, 0.0, 0.0, 0.0])
    assert np.allclose(q, [limb.stroke[1] for limb in model.limbs if limb.stroke], atol=0.05)
