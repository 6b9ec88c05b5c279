"""Machines whose limbs are chains of joints: forward, inverse, errors."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.core.chains import ChainMachine
from pkmcal.core.library import ISAS, POSE
from pkmcal.geometry import robot_file
from pkmcal.screw import from_pose
from tests import solved_again
from tests.chain_files import (
    BOOMS,
    all_errors,
    as_chains,
    described,
    leg_on_leg,
    same_errors,
)
from tests.chain_twin import Twin

DIGITS = Path(__file__).parents[3] / "shared" / "design" / "chains.json"
SQUARE = (
    "five-bar",
    "agile-eye",
    "tricept",
    "trivariant",
    "eclipse",
    "4ups-ps",
    "delta-parallelograms",
)
OVER = {"exechon": 2, "tripteron": 3, "2tpr2tps-chains": 2}
FAST = ("hexapod", "rbt-6t03p", "6-rus", "3rps", "3rrr-planar", "linear-delta-6")


def loaded(text: str, folder: Path) -> pk.Robot:
    file = folder / "robot.toml"
    file.write_text(text, encoding="utf-8")
    return pk.load(file)


def reference() -> list[Any]:
    if not DIGITS.exists():
        return [pytest.param(None, marks=pytest.mark.skip(reason="no reference digits here"))]
    machines = json.loads(DIGITS.read_text(encoding="utf-8"))["machines"]
    return [pytest.param(machine, id=machine["name"]) for machine in machines]


def commands(robot: pk.Robot, count: int, seed: int = 0, share: float = 1.0) -> np.ndarray:
    random = np.random.default_rng(seed)
    way = np.array([30.0 if unit == "mm" else 0.2 for unit in robot.actuator_units]) * share
    return robot.inverse(robot.home) + random.uniform(-way, way, (count, robot.n_actuators))


def disturbed(robot: pk.Robot, size: float = 1.0, seed: int = 0) -> pk.Robot:
    random = np.random.default_rng(seed)
    sigma = {"mm": 0.3 * size, "rad": 1e-3 * size, "1": 0.0}
    values = robot.geometry.values + [random.normal(0, 1) * sigma[u] for u in robot.geometry.units]
    return robot.replace(values)


@pytest.mark.parametrize("machine", reference())
def test_poses_are_those_of_the_reference(machine: dict[str, Any], tmp_path: Path) -> None:
    robot = loaded(described(machine), tmp_path)
    answers = machine["answers"]
    nominal = robot.forward(machine["q"])
    assert np.abs(from_pose(nominal.pose) - answers["nominal"]["T"]).max() < 1e-9
    assert robot.machine.rows - robot.machine.m == machine["over"]
    if machine["over"] == 0:  # others give way in the reference by other weights
        wrong = robot.replace(all_errors(machine, robot)).forward(machine["q"])
        assert np.abs(from_pose(wrong.pose) - answers["errors"]["T"]).max() < 1e-9
        assert np.abs(wrong.pose - nominal.pose).max() > 1e-4


@pytest.mark.parametrize("name", SQUARE)
def test_poses_are_those_of_products_of_exponentials(name: str) -> None:
    robot = disturbed(pk.load(name))
    for q in commands(robot, 1):
        T, theta, missed = Twin(robot).forward(q)
        found = robot.forward(q)
        assert missed < 1e-9
        assert np.abs(from_pose(found.pose) - T).max() < 1e-9
        twin = dict(zip(Twin(robot).passive, theta, strict=True))
        there = [twin[passive] for passive in robot.passive_names]
        off = (found.passive - there + np.pi) % (2 * np.pi) - np.pi
        assert np.abs(off).max() < 1e-9


@pytest.mark.parametrize("name", FAST)
def test_limbs_of_other_kinds_are_chains_too(name: str, tmp_path: Path) -> None:
    robot = pk.load(name)
    chained = loaded(as_chains(robot), tmp_path)
    random = np.random.default_rng(0)
    prefixes = ("base", "platform", "rod", "crank") + ("offset",) * (name != "linear-delta-6")
    moved = [n for n in robot.geometry.names if n.startswith(prefixes)]
    moved = [n for n in moved if not (robot.model.map == "planar" and n.endswith(".z"))]
    units = dict(zip(robot.geometry.names, robot.geometry.units, strict=True))
    errors = {n: random.normal(0, 0.3 if units[n] == "mm" else 1e-3) for n in moved}
    wrong = robot.replace({n: robot.geometry[n] + e for n, e in errors.items()})
    joints = {n: e for n, e in same_errors(robot, errors).items() if n in chained.geometry}
    same = chained.replace(joints)
    q = commands(robot, 100, share=0.5)
    for one, other in ((robot, chained), (wrong, same)):
        a, b = one.forward(q), other.forward(q)
        assert a.ok.all() and b.ok.all()
        assert np.abs(a.pose - b.pose).max() < 1e-10
    a, b = (each.forward(q[:5]).pose for each in (wrong, same))
    by_numbers, by_joints = wrong.error_jacobian(a, q[:5]), same.error_jacobian(b, q[:5])
    for n in moved:
        effect = sum(
            value * by_joints[..., same.geometry.names.index(joint)]
            for joint, value in same_errors(robot, {n: 1.0}).items()
            if joint in same.geometry
        )
        at = by_numbers[..., wrong.geometry.names.index(n)]
        assert np.abs(effect - at).max() < 1e-9 * max(1.0, np.abs(at).max()), n


@pytest.mark.parametrize("reach", (20.0, 30.0))
def test_no_row_is_lost_beside_cranks_in_closed_form(reach: float, tmp_path: Path) -> None:
    """Cold from home to where cranks are nearly stretched: plain Newton loses some rows there."""
    robot = pk.load("6-rus")
    chained = loaded(as_chains(robot), tmp_path)
    random = np.random.default_rng(0)
    pose = robot.home + np.hstack([random.uniform(-reach, reach, (1500, 3)), np.zeros((1500, 3))])
    q = robot.inverse(pose)
    q = q[np.isfinite(q).all(axis=1)]
    one, other = robot.forward(q), chained.forward(q)
    assert len(q) > 1200 and one.ok.mean() > 0.95
    assert other.ok[one.ok].all()
    assert (other.iterations - 1)[one.ok].mean() < 5.0  # the first is the prediction
    assert np.abs(one.pose - other.pose)[one.ok].max() < 1e-8


def test_rods_of_a_delta_keep_it_parallel() -> None:
    """The six rods of a rotary delta against one closure an arm, which takes it not to turn."""
    robot, plain = pk.load("delta-parallelograms"), pk.load("rotary-delta")
    q = commands(plain, 60, share=2.0)
    found, exact = robot.forward(q), plain.forward(q)
    assert plain.model.map == "translation" and found.ok.all() and exact.ok.all()
    assert np.abs(found.pose - exact.pose).max() < 1e-9
    assert np.abs(found.pose[:, 3:]).max() < 1e-12


def test_the_paper_s_poses_come_out_of_joints(tmp_path: Path) -> None:
    """Paper A's forward kinematics, with d = 292.4: no constraint of it is assumed."""
    text = robot_file.located("2tpr2tps-chains")[0].decode().replace("294.2", "292.4")
    legs = {"home_value = 454.9": np.sqrt(152.4**2 + 152.35**2 + 400.0**2)}
    for old, new in legs.items():
        text = re.sub(re.escape(old) + r"\d*", f"home_value = {float(new)!r}", text)
    robot = loaded(text, tmp_path)
    found = robot.forward([450.0, 452.0, 400.0, 405.0])
    x, y, z, alpha, beta, gamma = found.pose
    printed = [6.000920020714, -6.205857532186, 400.479518293888, -0.031217451630, 0.014983215564]
    assert np.abs(np.array([x, y, z, alpha, beta]) - printed).max() < 2e-12 * 400
    assert abs(gamma) < 1e-13
    assert abs(x - z * np.tan(beta)) < 1e-10


@pytest.mark.parametrize("name", (*SQUARE, *OVER))
def test_errors_act_as_solving_again_says(name: str) -> None:
    """Also where chains contradict each other, and the pose goes where what they miss bends."""
    robot = disturbed(pk.load(name), 0.5 if name in OVER else 1.0)
    q = commands(robot, 4)
    found = robot.forward(q)
    assert found.ok.all() and (found.residual.min() > 0.02) == (name in OVER)
    arcs = np.repeat([robot.length, 1.0], 3)[:, None]
    columns = robot.geometry.slot_index.astype(np.int32)
    exact = robot.machine.error_jacobian(robot.slots, found.pose, q, columns, twists=True)
    solved = solved_again.by_numbers(robot, found.pose, q)
    assert np.abs((exact - solved) * arcs).max() < 1e-9 * np.abs(solved * arcs).max()
    exact = robot.machine.forward_jacobian(robot.slots, found.pose, q, twists=True)
    solved = solved_again.by_actuators(robot, found.pose, q)
    assert np.abs((exact - solved) * arcs).max() < 1e-9 * np.abs(solved * arcs).max()


@pytest.mark.parametrize("name", (*SQUARE, *OVER))
def test_commands_come_back(name: str) -> None:
    robot = pk.load(name)
    q = commands(robot, 50)
    found = robot.forward(q)
    assert found.ok.all()
    assert found.iterations.mean() < 5.5
    again = robot.forward(q, guess=found.pose)  # one step, and the first, of which nothing is left
    assert again.iterations.max() == 2 and np.abs(again.pose - found.pose).max() < 1e-9
    assert np.abs(robot.inverse(found.pose) - q).max() < 1e-8
    assert robot.violation(found.pose).max() < 1e-9
    step = 1e-5
    for k in range(robot.n_actuators):
        side = [
            robot.forward(q[:5] + s * step * np.eye(robot.n_actuators)[k]).pose for s in (1, -1)
        ]
        slope = (side[0] - side[1]) / (2 * step)
        exact = robot.machine.forward_jacobian(robot.slots, found.pose[:5], q[:5])[..., k]
        assert np.abs(exact - slope).max() < 1e-5


@pytest.mark.parametrize("name", ("tricept", "exechon", "agile-eye", "five-bar"))
def test_every_isa_gives_the_same_bits(name: str) -> None:
    robot = disturbed(pk.load(name), 0.3)
    layout = robot.machine.layout
    q = commands(robot, 37)
    found = []
    for isa in range(len(ISAS)):
        try:
            machine = ChainMachine(layout, isa=isa)
            poses = machine.forward(robot.slots, q, robot.own_home, None)[0]
        except ValueError:
            continue  # this processor has it not
        columns = robot.geometry.slot_index.astype(np.int32)
        by = machine.error_jacobian(robot.slots, poses, q, columns)
        looked = (*machine.closure(robot.slots, poses, q), *machine.frames(robot.slots, poses, q))
        found.append((poses, machine.inverse(robot.slots, poses), by, *looked))
    assert len(found) > 1
    for other in found[1:]:
        for a, b in zip(found[0], other, strict=True):
            assert np.array_equal(a, b)


@pytest.mark.parametrize("name", (*SQUARE, *OVER))
def test_closures_of_chains_are_known_as_a_whole_or_not_at_all(name: str) -> None:
    robot = pk.load(name)
    poses = np.tile(robot.own_home, (6, 1))
    q = robot.machine.inverse(robot.slots, poses)
    q[[1, 4], 0] = np.nan, np.inf
    poses[2, POSE.index(robot.coordinates[0])] = np.nan
    found = robot.machine.closure(robot.slots, poses, q)
    looked = robot.machine.frames(robot.slots, poses, q)
    for each in (found.residual, found.by_step, found.by_free, found.by_q, *looked):
        assert np.isnan(each[[1, 2, 4]]).all() and np.isfinite(each[[0, 3, 5]]).all()
        np.testing.assert_array_equal(each[[3, 5]], each[[0, 0]])


@pytest.mark.parametrize("name", ("tricept", "tripteron"))
def test_an_effect_does_not_depend_on_what_else_is_asked_for(name: str) -> None:
    """The column of a number is the same wherever it comes, the first one too."""
    robot = disturbed(pk.load(name), 0.1)
    q = commands(robot, 2, share=0.3)
    pose, columns = robot.forward(q).pose, np.arange(robot.machine.layout.numbers, dtype=np.int32)
    every = robot.machine.error_jacobian(robot.slots, pose, q, columns)
    assert np.isfinite(every).all()
    for column in columns:
        alone = robot.machine.error_jacobian(robot.slots, pose, q, columns[[column]])
        np.testing.assert_array_equal(alone[..., 0], every[..., column])


def test_rows_fail_alone_and_say_why() -> None:
    robot = pk.load("tricept")
    q = commands(robot, 6)
    q[1], q[3, 0], q[4] = np.nan, np.inf, [2000.0, -3000.0, 0.0]
    found = robot.forward(q)
    assert found.status.tolist()[:4] == [0, 4, 0, 4]
    assert found.status[4] in (1, 2) and found.status[5] == 0
    assert np.isnan(found.pose[[1, 3, 4]]).all()
    assert np.isfinite(found.pose[[0, 2, 5]]).all()
    far = robot.home + np.array([1e6, 0, 0, 0, 0, 0])
    assert not robot.feasible([robot.home, far]).ok.all()
    turned = pk.load("eclipse")
    assert np.isnan(turned.inverse([5000.0, 0, 0, 0, 0, 0])).all()


def test_a_geometry_for_each_row_is_as_one_by_one() -> None:
    robot = pk.load("tricept")
    machines = [disturbed(robot, seed=k) for k in range(11)]
    q = commands(robot, 11)
    slots = np.stack([m.slots for m in machines])
    together = robot.machine.forward(slots, q, robot.own_home, 1)[0]
    alone = np.array([m.forward(each).pose for m, each in zip(machines, q, strict=True)])
    assert np.abs(together - alone).max() < 1e-11


@pytest.mark.parametrize(("name", "modes"), (("five-bar", 2), ("agile-eye", 8), ("tripteron", 1)))
def test_assembly_modes_are_counted(name: str, modes: int) -> None:
    robot = pk.load(name)
    found = robot.forward_all(commands(robot, 1)[0])
    assert len(found) == modes
    assert found.complete == found.certified.all() == (name != "tripteron")


def test_moves_follow_the_platform() -> None:
    robot = pk.load("tricept")
    random = np.random.default_rng(0)
    q, q1, q2 = commands(robot, 5), random.normal(0, 20, (5, 3)), random.normal(0, 50, (5, 3))
    own = robot.forward(q).pose
    motion, velocity, _ = robot.machine.motion(robot.slots, own, q, q1, q2)
    jacobian = robot.machine.forward_jacobian(robot.slots, own, q)
    assert np.abs(velocity - (jacobian @ q1[..., None])[..., 0]).max() < 1e-7
    back, bent = robot.rates(motion)
    assert np.abs(back - q1).max() < 1e-7
    assert np.abs(bent - q2).max() < 1e-4


@pytest.mark.parametrize("name", OVER)
def test_surplus_closures_settle_where_elastic_joints_would(name: str) -> None:
    robot = pk.load(name)
    assert robot.machine.rows - robot.machine.m == OVER[name]
    wrong = disturbed(robot, 1 / 3)
    q = commands(robot, 1)[0]
    rest, found = Twin(wrong).settled(q), wrong.forward(q)
    assert found.residual > 0.05
    off = np.abs(from_pose(found.pose) - rest)
    assert off[:3, 3].max() < max(1e-4, 3e-3 * found.residual)
    assert off[:3, :3].max() < 3e-6


def test_a_soft_joint_takes_more_of_what_is_missed(tmp_path: Path) -> None:
    robot = pk.load("tripteron")
    wrong = {"limb1.joint1.dpsi": 1e-3}
    stiff = robot.replace(wrong).forward(robot.inverse(robot.home)).pose
    robot.save(tmp_path / "saved.toml")
    saved = (tmp_path / "saved.toml").read_text(encoding="utf-8")
    head, one, two, three = saved.split("[[limb]]")
    one = one.replace("gain = 1.0", "gain = 1.0, soft = 1000.0")
    soft = loaded("[[limb]]".join([head, one, two, three]), tmp_path)
    found = soft.replace(wrong).forward(soft.inverse(soft.home)).pose
    assert 0.0 < found[5] < 0.1 * stiff[5]
    again = tmp_path / "again.toml"
    soft.save(again)
    assert "soft = 1000.0" in again.read_text(encoding="utf-8")


def test_modes_of_chains_are_those_that_are_proven_of_legs(tmp_path: Path) -> None:
    """3-RPS: all sixteen, each on its side of the singularities, by two other closures."""
    robot = pk.load("3rps")
    chained = loaded(as_chains(robot), tmp_path)
    q = robot.inverse(robot.home) + np.array([5.0, -3.0, 2.0])
    proven, found = robot.forward_all(q, starts=0), chained.forward_all(q)
    assert len(proven) == len(found) == 16 and proven.complete
    assert np.abs(proven.poses[:, :3] - found.poses[:, :3]).max() < 1e-7
    assert np.abs(proven.sign - proven.sign[0] * found.sign[0] * found.sign).max() == 0


@pytest.mark.parametrize("name", ("tricept", "eclipse", "agile-eye", "exechon"))
def test_what_a_row_comes_to_does_not_depend_on_its_neighbours(name: str) -> None:
    """Near and far rows side by side: one keeps its matrix where another needs a new one."""
    robot = disturbed(pk.load(name))
    q = np.concatenate([commands(robot, 12, share=s) for s in (0.01, 0.3, 2.0)])
    q = q.reshape(3, 12, -1).swapaxes(0, 1).reshape(36, -1)
    together = robot.forward(q)
    alone = [robot.forward(row) for row in q]
    assert np.array_equal(together.pose, [each.pose for each in alone], equal_nan=True)
    assert np.array_equal(together.iterations, [each.iterations for each in alone])
    assert len(set(together.iterations)) > 1


@pytest.mark.parametrize("boom", BOOMS)
def test_forward_undoes_inverse_where_a_chain_is_held_by_another(boom: str, tmp_path: Path) -> None:
    """The leg on the boom alone would be assembled in as many ways as the boom can turn."""
    robot = loaded(leg_on_leg(boom), tmp_path)
    rng = np.random.default_rng(3)
    poses = robot.home + rng.uniform(-1, 1, (50, 6)) * [40, 40, 0, 0, 0, 0.2]
    q = robot.inverse(poses)
    found = robot.forward(q, guess=poses)
    assert (found.status == 0).all()
    np.testing.assert_allclose(found.pose, poses, atol=1e-8)
    cos, sin = np.cos(poses[:, 5]), np.sin(poses[:, 5])
    x, y = poses[:, 0] - 30 * cos + 20 * sin, poses[:, 1] - 30 * sin - 20 * cos
    first = np.hypot(x, y) if boom == "passive" else np.arctan2(-x, y)
    np.testing.assert_allclose(np.ptp(q[:, 0] - first), 0, atol=1e-8)
