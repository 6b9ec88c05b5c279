"""The built-in machines: their published numbers, homes, workspaces, branches and free sets."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.files.toml_lines import Source
from pkmcal.geometry import robot_file
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.geometry.model import Model

from .. import twin
from ..workspaces import CHAINS, WORKSPACE, poses

MACHINES = tuple(name for name in robot_file.builtin_names() if name not in CHAINS)
# The print of the RBT-6T03P is singular everywhere: it has no workspace and nothing to calibrate.
WORKING = tuple(name for name in MACHINES if name != "rbt-6t03p-printed")
# The paper's 28 errors hold two that do nothing: platform3.x and platform4.x leave their legs'
# lengths alone wherever x = z tan(beta).
DEPENDENT = {"2tpr2tps": 2}


def points(model: Model, point: str) -> np.ndarray:
    """Base or platform joints (n_limbs, 3)."""
    geometry = model.geometry
    rows = range(1, len(model.limbs) + 1)
    return np.array([[geometry[f"{point}{i}.{axis}"] for axis in "xyz"] for i in rows])


def test_every_machine_with_a_workspace_has_its_box() -> None:
    assert set(WORKSPACE) == set(WORKING)


@pytest.mark.parametrize("name", WORKING)
def test_home_is_reached_and_found_again(name: str) -> None:
    robot = pk.load(name)
    q = robot.inverse(robot.home)
    assert np.abs(twin.closures(robot.model, robot.home, q)).max() < 1e-9
    assert np.allclose(robot.forward(q).pose, robot.home, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", WORKING)
def test_poses_of_the_workspace_are_reached_and_found_again(name: str) -> None:
    robot, wanted = pk.load(name), poses(name, 1000)
    found = robot.forward(robot.inverse(wanted))
    assert found.ok.all()
    assert np.allclose(found.pose, wanted, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", WORKING)
def test_home_and_workspace_keep_every_limit(name: str) -> None:
    robot = pk.load(name)
    at = np.vstack([robot.home, poses(name, 200, seed=1)])
    q = robot.inverse(at)
    rotations = np.array([twin.rotation(pose) for pose in at])
    numbers = twin.numbers(robot.model, None)
    for limb, n in zip(robot.model.limbs, numbers, strict=True):
        low, high = limb.stroke or (-np.inf, np.inf)
        assert low < q[:, limb.actuator].min() and q[:, limb.actuator].max() < high
        if KINDS[limb.kind].driver.name == "length" and limb.base_cone is not None:
            legs = at[:, :3] + rotations @ twin.platform_point(n) - twin.base_point(n)
            cosines = legs @ limb.base_cone.axis / np.linalg.norm(legs, axis=1)
            assert np.arccos(cosines).max() < limb.base_cone.angle


@pytest.mark.parametrize("name", WORKING)
def test_branch_of_the_file_is_the_sign_of_the_closures_at_home(name: str) -> None:
    model = robot_file.read(name)
    q = twin.inverse(model, model.home)
    for limb, n in zip(model.limbs, twin.numbers(model, None), strict=True):
        anchor, _ = twin.driver(limb, n, q[limb.actuator])
        motion = twin.driver(limb, n, q[limb.actuator] + 1e-30j)[0].imag / 1e-30
        joint = model.home[:3] + twin.rotation(model.home) @ twin.platform_point(n)
        assert limb.branch == (np.sign((joint - anchor) @ motion) if motion.any() else 0)


@pytest.mark.parametrize("name", WORKING)
def test_default_free_set_is_independent(name: str) -> None:
    robot = pk.load(name)
    free = robot.model.free
    columns = [robot.geometry.names.index(each) for each in free]
    effects = robot.error_jacobian(poses(name, 60))[..., columns]
    effects[:, 3:] *= robot.length
    effects = effects.reshape(-1, len(free))
    sizes = np.linalg.norm(effects, axis=0)
    strength = np.linalg.svd(effects / np.maximum(sizes, 1e-9 * sizes.max()), compute_uv=False)
    assert np.sum(strength > 1e-7 * strength[0]) == len(free) - DEPENDENT.get(name, 0)


@pytest.mark.parametrize("name", (*MACHINES, *CHAINS))
def test_built_in_machines_are_untied_with_offset_0_and_gain_1(name: str) -> None:
    geometry = robot_file.read(name).geometry
    assert not geometry.tied.any() and not geometry.parameters
    for number in geometry.numbers:
        if number.slot in ("offset", "gain"):
            assert geometry[number.name] == (1.0 if number.slot == "gain" else 0.0)


@pytest.mark.parametrize("name", (*MACHINES, *CHAINS))
def test_built_in_machines_say_where_their_numbers_are_from(name: str) -> None:
    text = robot_file.located(name)[0].decode()
    comment = [line for line in text.splitlines() if line.startswith("#")]
    assert any(line.startswith("# Numbers: ") for line in comment)


def test_file_to_start_from_is_a_machine_that_keeps_its_limits() -> None:
    path = Path(__file__).parents[2] / "examples" / "robot.toml"
    robot, numbers = pk.load(path), np.random.default_rng(7)
    at = robot.home + numbers.uniform(-1, 1, (50, 6)) * [30, 30, 30, 0.1, 0.1, 0.1]
    assert robot.feasible(at).ok.all()
    assert np.allclose(robot.forward(robot.inverse(at)).pose, at, rtol=0, atol=1e-9)


# published numbers --------------------------------------------------------------------------------


def test_2tpr2tps_has_the_published_joints() -> None:
    """Table 1: a 140, b 80, c 200, e 384.7, f 278.5 mm; d is the 294.2 mm of Table 2."""
    a, b, c, d, e, f = 140.0, 80.0, 200.0, 294.2, 384.7, 278.5
    model = robot_file.read("2tpr2tps")
    base = [(d, -e / 2, 0), (d, e / 2, 0), (0, f / 2, 0), (0, -f / 2, 0)]
    platform = [(a, -b / 2, 0), (a, b / 2, 0), (0, c / 2, 0), (0, -c / 2, 0)]
    assert np.allclose(points(model, "base"), base, rtol=0, atol=1e-12)
    assert np.allclose(points(model, "platform"), platform, rtol=0, atol=1e-12)
    lengths = [454.959517429848, 454.959517429848, 401.921089892033, 401.921089892033]
    legs = model.home[:3] + points(model, "platform") - points(model, "base")
    assert np.allclose(np.linalg.norm(legs, axis=1), lengths, rtol=0, atol=1e-9)
    assert len(model.free) == 28


def test_hexapod_joints_lie_on_circles_of_650_and_250_mm() -> None:
    model = robot_file.read("hexapod")
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
    model = robot_file.read("linear-delta")
    reach = points(model, "base") - points(model, "platform")
    assert np.allclose(np.linalg.norm(reach, axis=1), 105.6)
    q = pk.load("linear-delta").inverse([0.0, 0.0, 240.0, 0.0, 0.0, 0.0])
    assert np.allclose(q, [limb.stroke[1] for limb in model.limbs if limb.stroke], atol=0.05)


def test_2tpr2tps_spatial_has_the_joints_of_2tpr2tps_and_its_poses() -> None:
    mapped, spatial = pk.load("2tpr2tps"), pk.load("2tpr2tps-spatial")
    for point in ("base", "platform"):
        assert np.array_equal(points(spatial.model, point), points(mapped.model, point))
    q = mapped.inverse(poses("2tpr2tps", 20))
    assert np.allclose(spatial.forward(q).pose, mapped.forward(q).pose, rtol=0, atol=1e-9)


def test_2tpr2tps_spatial_says_by_how_much_eq_7_is_missed() -> None:
    """A base joint 3 that is e further in x: both plane rows R r.d = 0 still have to hold.

    Their difference gives tan(gamma) = -e / f with the base joints f apart, their sum
    (R r).p = (R r).(T3 + T4) / 2, where eq. 7 has gamma = 0 and (R r).p = 0.
    """
    e, f = 0.5, 278.5
    robot = pk.load("2tpr2tps-spatial").replace({"base3.x": e})
    pose = robot.forward(pk.load("2tpr2tps").inverse([0, 0, 400, 0, 0, 0])).pose
    assert np.isclose(np.tan(pose[5]), -e / f, rtol=1e-9)
    across = twin.rotation(pose)[:, 0]
    assert np.isclose(across @ pose[:3], across[0] * e / 2, rtol=1e-9)


def test_rotary_delta_repeats_the_examples_of_the_flexpicker() -> None:
    """The two inverse examples of Williams's document: angles in degrees to the printed 0.1."""
    robot = pk.load("rotary-delta")
    for position, degrees in (
        ([0, 0, -900], [-20.5, -20.5, -20.5]),
        ([300, 500, -1100], [47.5, -11.6, 21.4]),
    ):
        q = np.degrees(robot.inverse([*position, 0, 0, 0]))
        assert np.allclose(q, degrees, rtol=0, atol=0.051)
    sides = np.linalg.norm(np.diff(points(robot.model, "platform"), axis=0), axis=1)
    assert np.allclose(sides, 76.0, atol=1e-3)


def test_6_rus_stands_on_hexagons_with_level_cranks() -> None:
    robot = pk.load("6-rus")
    for point, sides in (("base", [142, 230]), ("platform", [67, 250])):
        corners = points(robot.model, point)
        around = np.linalg.norm(corners - np.roll(corners, -1, axis=0), axis=1)
        # limbs 1 2 | 3 4 | 5 6 are the ends of the short sides, in turn around the base
        assert np.allclose(around[[0, 2, 4]], sides[0], atol=1e-4)
        long = corners[[1, 3, 5]] - corners[[2, 4, 0]]
        assert np.allclose(np.linalg.norm(long, axis=1), sides[1], atol=1e-4)
    assert np.allclose(robot.inverse(robot.home), 0.0, atol=1e-5)  # home is given to 1 um


def test_3rps_is_the_heliostat() -> None:
    robot = pk.load("3rps")
    assert np.allclose(np.linalg.norm(points(robot.model, "base"), axis=1), 400.0)
    assert np.allclose(np.linalg.norm(points(robot.model, "platform"), axis=1), 250.0)
    # a model without errors: the prototype's legs were measured with several mm between them
    assert np.allclose(robot.inverse(robot.home), [1645, 1653, 1650], rtol=0, atol=7)
    # the platform joints stay in the legs' planes
    q = np.random.default_rng(4).uniform(1500, 1800, (20, 3))
    pose = robot.forward(q).pose
    for i, limb in enumerate(robot.model.limbs):
        joints = [p[:3] + twin.rotation(p) @ points(robot.model, "platform")[i] for p in pose]
        assert np.abs(np.array(joints) @ limb.frame[:, 2]).max() < 1e-9


def test_planar_3rrr_has_the_published_triangle_and_works_on_one_side() -> None:
    robot = pk.load("3rrr-planar")
    corners = points(robot.model, "base")
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
    assert np.allclose(sides, 331.0, atol=1e-3)
    assert np.allclose(np.linalg.norm(points(robot.model, "platform"), axis=1), 75.06)
    q = robot.inverse(robot.home)
    assert np.ptp(q) < 1e-12 and 0 < q[0] < np.pi / 2  # turned to the left, as in the mode +++


def test_linear_delta_6_is_the_linear_delta_with_rods_in_pairs() -> None:
    one, six = pk.load("linear-delta"), pk.load("linear-delta-6")
    for point in ("base", "platform"):
        pairs = points(six.model, point).reshape(3, 2, 3)
        assert np.allclose(pairs.mean(axis=1), points(one.model, point), rtol=0, atol=1e-5)
        assert np.allclose(np.linalg.norm(pairs[:, 0] - pairs[:, 1], axis=1), 44.0, atol=1e-5)
    at = poses("linear-delta", 50)
    assert six.n_actuators == 3
    assert np.allclose(six.inverse(at), one.inverse(at), rtol=0, atol=1e-5)


@pytest.mark.parametrize("rod", [f"rod{i}" for i in range(1, 7)])
def test_linear_delta_6_turns_by_0_13_degrees_where_two_rods_differ_by_0_1_mm(rod: str) -> None:
    robot = pk.load("linear-delta-6")
    q = robot.inverse(robot.home)
    turned = robot.replace({rod: 215.1}).forward(q).pose
    angle = np.degrees(np.arccos((np.trace(twin.rotation(turned)) - 1.0) / 2.0))
    assert 0.125 < angle < 0.135


def test_rbt_6t03p_as_printed_gives_the_printed_lengths_for_five_legs() -> None:
    """Table 1, and Table 2 as its own formula gives it: 163.61 and 48.96 are misprints there."""
    robot = pk.load("rbt-6t03p-printed")
    lengths = {z: robot.inverse([0.0, 0.0, z, 0.0, 0.0, 0.0]) for z in (0.0, 50.0, -20.0)}
    others = [0, 1, 3, 4, 5]
    assert np.allclose(lengths[0.0][others], 212.5697, rtol=0, atol=5e-5)
    assert np.isclose(lengths[0.0][2], 514.1255, rtol=0, atol=5e-5)
    assert np.allclose(lengths[50.0][others], 163.695, rtol=0, atol=5e-4)
    assert np.allclose((lengths[50.0] - lengths[0.0])[others], -48.874, rtol=0, atol=1e-3)
    assert np.allclose(lengths[-20.0][others], 232.2536, rtol=0, atol=5e-5)
    assert np.allclose((lengths[-20.0] - lengths[0.0])[others], 19.6840, rtol=0, atol=1e-4)


def test_rbt_6t03p_as_printed_is_singular_in_every_pose() -> None:
    robot = pk.load("rbt-6t03p-printed")
    spread = np.random.default_rng(6).uniform(-1, 1, (50, 6)) * [20, 20, 20, 0.15, 0.15, 0.15]
    found = robot.forward(robot.inverse(spread), guess=spread)
    assert (found.status == 2).all() and np.isnan(found.pose).all()
    assert robot.model.free == ()


@pytest.mark.parametrize("name", [*MACHINES, *CHAINS])
def test_home_is_on_the_pose_map(name: str) -> None:
    robot = pk.load(name)
    np.testing.assert_allclose(robot.on_map(robot.own_home[None])[0], robot.own_home, atol=1e-12)


@pytest.mark.parametrize("beta", [-0.3, 0.2])
def test_home_of_a_2tpr2tps_follows_its_beta(beta: float) -> None:
    """x may not be stated: x = z tan(beta)."""
    text = robot_file.located("2tpr2tps")[0].decode()
    turned = text.replace("z = 400.0 }", f"z = 400.0, beta = {np.degrees(beta)} }}")
    assert turned != text
    robot = pk.Robot(robot_file.parse(Source(turned.encode(), "made.toml"), "made.toml"))
    assert robot.home[0] == pytest.approx(400.0 * np.tan(beta))
    assert robot.violation(robot.home) < 1e-9
    assert robot.forward(robot.inverse(robot.home)).ok
