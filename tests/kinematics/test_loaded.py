"""Machines that yield: what pulls at them, where they come to rest, and what reaches a pose."""

from __future__ import annotations

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.core.library import POSE
from pkmcal.files.toml_lines import Source
from pkmcal.geometry import robot_file, robot_file_writer
from tests.robots import hexapod

G = 9.80665
SHIFT, SPAN = np.array([0, 0, 50, 0, 0, 0]), np.array([150, 150, 100, 0.3, 0.3, 0.3])
# machines of every kind of limb and map, and what yields of them
CASES = [
    ("hexapod", {"offset*": 1e-4}),
    ("hexapod", {"base*": 4e-5, "platform*": 3e-5, "offset*": 1e-4}),
    ("linear-delta", {"offset*": 1e-3, "rod*": 5e-4}),
    ("rotary-delta", {"offset*": 2e-8, "rod*": 1e-5}),
    ("6-rus", {"offset*": 2e-7, "crank*": 1e-5, "axis*": 1e-8}),
    ("rbt-6t03p", {"rod*": 1e-4, "slider*": 1e-7}),
    ("2tpr2tps", {"offset*": 1e-4}),
    ("3rps", {"offset*": 1e-4, "normal*": 1e-9}),
    ("tricept", {"offset*": 1e-4}),
    ("five-bar", {"offset*": 1e-8}),
]
IDS = [f"{name}-{'-'.join(each)}" for name, each in CASES]


def poses_of(robot: pk.Robot, count: int, seed: int = 1) -> np.ndarray:
    rigid = robot.rigid
    return rigid.forward(rigid.inverse(pk.sample_poses(rigid, count, seed=seed))).pose


def load_at(count: int) -> pk.Load:
    rng = np.random.default_rng(5)
    return pk.Load(
        mass=rng.uniform(0, 20, count),
        centre=rng.uniform(-30, 30, (count, 3)),
        force=rng.uniform(-50, 50, (count, 3)),
        moment=rng.uniform(-2000, 2000, (count, 3)),
    )


def energy_of_load(load: pk.Load, i: int, pose: np.ndarray, turn: np.ndarray) -> float:
    """What a load gives as the platform goes to a pose; `turn` is the rotation vector from it."""
    mass, centre = np.asarray(load.mass)[i], np.asarray(load.centre)[i]
    place = pk.screw.from_pose(pose)[..., :3, 3] + pk.screw.from_pose(pose)[..., :3, :3] @ centre
    force, moment = np.asarray(load.force)[i], np.asarray(load.moment)[i]
    return float(-mass * G * place[2] + force @ pose[:3] + moment @ turn)


@pytest.mark.parametrize(("name", "compliance"), CASES, ids=IDS)
def test_a_loaded_machine_rests_where_its_energy_is_stationary(
    name: str, compliance: dict[str, float]
) -> None:
    """Σ e²/2c less what the load gives does not change with any number e: by differences."""
    robot = pk.load(name).yielding(compliance)
    poses, load = poses_of(robot, 4), load_at(4)
    rigid = robot.rigid
    q = rigid.inverse(poses)
    found = robot.under(load).forward(q, guess=poses)
    assert found.ok.all()
    machine = robot.under(load).machine
    springs = [spring.number for spring in robot.model.elastic.springs]
    own = np.ascontiguousarray(robot.frames.inward(found.pose))
    force = machine.forces(robot.slots, own, q)
    c = np.array([robot.geometry[f"compliance.{name}"] for name in springs])
    for i in range(4):
        given = dict(zip(springs, c * force[i], strict=True))
        at = rigid.replace({name: rigid.geometry[name] + e for name, e in given.items()})
        again = at.forward(q[i], guess=found.pose[i]).pose
        size = float(robot.machine.struct.size)
        assert np.abs(again - found.pose[i])[:3].max() < 1e-12 * size
        for name, e in list(given.items())[:7]:
            step = 1e-3 if robot.geometry.units[robot.geometry.names.index(name)] == "mm" else 1e-6
            ends = []
            for sign in (1, -1):
                number = rigid.geometry[name] + e + sign * step
                pose = at.replace({name: number}).forward(q[i], guess=found.pose[i]).pose
                way = pk.screw.from_pose(pose)[:3, :3] @ pk.screw.from_pose(again)[:3, :3].T
                turn = np.array(
                    [way[2, 1] - way[1, 2], way[0, 2] - way[2, 0], way[1, 0] - way[0, 1]]
                )
                ends.append(energy_of_load(load, i, pose, turn / 2))
            by_difference = (ends[0] - ends[1]) / (2 * step)
            scale = np.abs(force[i]).max() + 1.0
            assert by_difference == pytest.approx(e / (c[springs.index(name)]), abs=1e-5 * scale)


@pytest.mark.parametrize(("name", "compliance"), CASES, ids=IDS)
def test_forward_and_inverse_of_a_loaded_machine_are_inverse(
    name: str, compliance: dict[str, float]
) -> None:
    robot = pk.load(name).yielding(compliance)
    poses, load = poses_of(robot, 20), load_at(20)
    q = robot.inverse(poses, match=True if name == "3rps" else None, load=load)
    found = robot.forward(q, guess=poses, load=load)
    assert found.ok.all()
    kept = [POSE.index(each) for each in robot.moved]
    assert np.abs(found.pose - poses)[:, kept].max() < 1e-9
    sag = robot.forward(robot.rigid.inverse(poses), guess=poses, load=load).pose - poses
    assert np.abs(sag).max() > 1e-6  # so that there is something to invert


def heavy_hexapod() -> pk.Robot:
    """Leaning frames, weights on everything, two balancers, gravity that is not vertical."""
    keys = {"stiffness": 4e3, "mass": 6.0}
    grows = {"stiffness": {"value": 3e3, "at": 700.0, "per_length": 2e-7}, "mass": 4.0}
    return hexapod(
        *([keys] * 3 + [grows] * 3),
        gravity=[0.4, -0.2, -9.7],
        gravity_tilt=[0.02, -0.03],
        compliance={"base*": 2e-5, "platform*": 3e-5},
        platform={"mass": 30.0, "centre": [10.0, -5.0, 40.0]},
        payload={"mass": 5.0, "centre": [0.0, 20.0, 60.0], "force": [40.0, 0.0, -90.0]},
        balancer=[
            {"base": [0.0, 0.0, 1400.0], "platform": [0.0, 10.0, 5.0], "rate": 0.6, "free": 300.0},
            {"base": [300.0, 0.0, 900.0], "platform": [60.0, 0.0, 0.0], "rate": 0.3, "free": 0.0},
        ],
        frames={
            "base": {"x": 30.0, "y": -10.0, "z": 5.0, "alpha": 0.2, "beta": -0.1, "gamma": 0.3},
            "tool": {"x": 0.0, "y": 4.0, "z": 50.0, "alpha": 0.1, "beta": 0.05, "gamma": -0.2},
        },
    )


def heavy_slider() -> pk.Robot:
    """Rods on carriages with weights, and what may yield of them."""
    keys = {"stiffness": 2e3, "rod_stiffness": 4e3, "mass": 0.5, "anchor_mass": 2.0}
    return _with_limbs("rbt-6t03p", keys, {"slider*": 1e-7, "base*": 1e-5})


def heavy_crank() -> pk.Robot:
    """Rods on cranks with weights, and what may yield of them."""
    keys = {"stiffness": 5e3, "rod_stiffness": 8e3, "mass": 0.4, "anchor_mass": 1.5}
    return _with_limbs("6-rus", keys, {"axis*": 1e-8, "crank*": 1e-5})


def _with_limbs(name: str, keys: dict[str, float], compliance: dict[str, float]) -> pk.Robot:
    text = robot_file_writer.text_of(pk.load(name).model)
    lines = "".join(f"{key} = {value}\n" for key, value in keys.items())
    text = text.replace("[[limb]]\n", "[[limb]]\n" + lines)
    table = "".join(f'"{key}" = {value}\n' for key, value in compliance.items())
    text += f"[compliance]\n{table}[platform]\nmass = 12.0\ncentre = [5.0, 3.0, 20.0]\n"
    return pk.Robot(robot_file.parse(Source(text.encode(), "heavy.toml"), None))


def potential(robot: pk.Robot, rigid: pk.Robot, q: np.ndarray, pose: np.ndarray) -> float:
    """What weights, forces and balancers have, N mm, of a robot whose numbers are those of `rigid`.

    By the places of all masses alone, which the spheres of the limbs and the frames give.
    """
    g, numbers = rigid.geometry, robot.geometry
    base = pk.screw.from_pose(_frame(robot.model.base_frame))
    tool = pk.screw.from_pose(pose)
    own = (
        np.linalg.inv(base)
        @ tool
        @ np.linalg.inv(pk.screw.from_pose(_frame(robot.model.tool_frame)))
    )
    down = np.array(robot.model.elastic.gravity)
    down = _tilted(down, numbers["gravity.tilt1"], numbers["gravity.tilt2"])

    def of(mass: float, place: np.ndarray) -> float:  # in own axes
        return -mass * float(down @ (base @ np.append(place, 1.0))[:3])

    def at(name: str) -> np.ndarray:
        return np.array([numbers[f"{name}.{axis}"] for axis in "xyz"])

    def carried(point: np.ndarray) -> np.ndarray:
        return (own @ np.append(point, 1.0))[:3]

    total = 0.0
    spheres = rigid.machine.spheres(rigid.slots, q[None])[0]
    for i in range(len(robot.model.limbs)):
        rod = numbers[f"mass.limb{i + 1}"]
        anchor = dict(numbers.items()).get(f"mass.anchor{i + 1}", 0.0)
        joint = np.array([g[f"platform{i + 1}.{axis}"] for axis in "xyz"])
        total += of(0.5 * rod, carried(joint)) + of(0.5 * rod + anchor, spheres[i, 3:6])
    total += of(numbers["mass.platform"], carried(at("centre.platform")))
    if robot.model.elastic.payload:
        centre = tool @ np.append(at("payload.centre"), 1.0)
        total -= numbers["payload.mass"] * float(down @ centre[:3])
        total -= float(at("payload.force") @ tool[:3, 3])
    for j in range(1, robot.model.elastic.balancers + 1):
        length = np.linalg.norm(carried(at(f"balancer{j}.platform")) - at(f"balancer{j}.base"))
        rate, free = numbers[f"balancer{j}.rate"], numbers[f"balancer{j}.free"]
        total += 0.5 * rate * (length - free) ** 2
    return total


def _frame(frame: np.ndarray | None) -> np.ndarray:
    return np.zeros(6) if frame is None else frame


def _tilted(down: np.ndarray, tilt1: float, tilt2: float) -> np.ndarray:
    """Gravity after its tilts, about directions across it that are found again."""
    size = np.linalg.norm(down)
    e3 = down / size
    e1 = np.eye(3)[np.argmin(np.abs(e3))]
    e1 = e1 - (e1 @ e3) * e3
    e1 /= np.linalg.norm(e1)
    frame = np.column_stack([e1, np.cross(e3, e1), e3])
    c1, s1, c2, s2 = np.cos(tilt1), np.sin(tilt1), np.cos(tilt2), np.sin(tilt2)
    x = np.array([[1, 0, 0], [0, c1, -s1], [0, s1, c1]])
    y = np.array([[c2, 0, s2], [0, 1, 0], [-s2, 0, c2]])
    return size * (frame @ x @ y @ [0.0, 0.0, 1.0])


@pytest.mark.parametrize("made", [heavy_hexapod, heavy_slider, heavy_crank])
def test_weights_of_everything_come_to_rest(made) -> None:
    """Differences of the energy of all masses and springs by each number are what it gives."""
    robot = made()
    rigid = robot.rigid
    pose = robot.frames.outward(robot.own_home[None] + 0.01)[0]
    q = rigid.inverse(pose)
    found = robot.forward(q, guess=pose)
    assert found.ok
    own = np.ascontiguousarray(robot.frames.inward(found.pose[None]))
    force = robot.machine.forces(robot.slots, own, q[None])[0]
    c = robot.machine.compliances(robot.slots, q[None])[0]
    names = [spring.number for spring in robot.model.elastic.springs]
    at = rigid.replace({n: rigid.geometry[n] + e for n, e in zip(names, c * force, strict=True)})
    assert np.abs(at.forward(q, guess=pose).pose - found.pose).max() < 1e-9
    for k in range(0, len(names), 3):
        unit = robot.geometry.units[robot.geometry.names.index(names[k])]
        step, ends = 1e-2 if unit == "mm" else 1e-5, []
        for sign in (1, -1):
            there = at.replace({names[k]: at.geometry[names[k]] + sign * step})
            ends.append(potential(robot, there, q, there.forward(q, guess=found.pose).pose))
        by_difference = -(ends[0] - ends[1]) / (2 * step)
        assert by_difference == pytest.approx(force[k], rel=1e-6, abs=1e-6 * np.abs(force).max())


def test_legs_of_a_hexapod_give_as_tendons_of_mujoco() -> None:
    """Springs between sites of another engine, balanced by Newton's method (A2)."""
    engine = pytest.importorskip("mujoco")
    robot = pk.load("hexapod")
    rng = np.random.default_rng(0)
    poses = robot.home + SHIFT + rng.uniform(-1, 1, (6, 6)) * SPAN
    q, at = robot.inverse(poses), np.array([20.0, -10.0, 50.0])
    load = pk.Load(mass=1000.0 / G, centre=at)
    for stiffness in (2e4, 1e3, 300.0):
        found = robot.yielding({"offset*": 1.0 / stiffness}).forward(q, guess=poses, load=load)
        assert found.ok.all()
        for i in range(6):
            there = _tendons_at_rest(engine, robot, stiffness, q[i], poses[i], at)
            assert np.abs(there - found.pose[i, :3]).max() < 1e-10
    soft = robot.yielding({"offset*": 1.0 / 100.0}).forward(q, guess=poses, load=load)
    assert soft.status.tolist() == [0, 6, 6, 0, 0, 0]  # two give more than a hundredth of the size
    assert np.isnan(soft.pose[[1, 2]]).all() and "gives way" in soft.failures()
    for i in (0, 3, 4, 5):
        there = _tendons_at_rest(engine, robot, 100.0, q[i], poses[i], at)
        assert np.abs(there - soft.pose[i, :3]).max() < 1e-9
    none = robot.yielding({"offset*": 1.0 / 30.0}).forward(q, guess=poses, load=load)
    assert (none.status == 6).all() and np.isnan(none.pose).all()


def _tendons_at_rest(engine, robot, stiffness, q, pose, at) -> np.ndarray:
    spec = engine.MjSpec()
    spec.option.gravity = [0.0, 0.0, 0.0]
    body = spec.worldbody.add_body(name="platform")
    body.add_freejoint()
    body.mass, body.inertia, body.explicitinertial = 1.0, [1.0, 1.0, 1.0], True
    for i in range(1, 7):
        base = [robot.geometry[f"base{i}.{axis}"] for axis in "xyz"]
        end = [robot.geometry[f"platform{i}.{axis}"] for axis in "xyz"]
        spec.worldbody.add_site(name=f"base{i}", pos=base)
        body.add_site(name=f"end{i}", pos=end)
        length = float(q[i - 1])
        tendon = spec.add_tendon(name=f"leg{i}", stiffness=stiffness, springlength=[length] * 2)
        tendon.wrap_site(f"base{i}")
        tendon.wrap_site(f"end{i}")
    body.add_site(name="load", pos=at)
    model = spec.compile()
    data = engine.MjData(model)
    frame = pk.screw.from_pose(pose)
    data.qpos[:3] = frame[:3, 3]
    engine.mju_mat2Quat(data.qpos[3:], np.ascontiguousarray(frame[:3, :3]).ravel())

    def off() -> np.ndarray:
        engine.mj_fwdPosition(model, data)
        engine.mj_fwdVelocity(model, data)
        by_place = np.zeros((3, 6))
        site = model.site("load").id
        engine.mj_jac(model, data, by_place, None, data.site_xpos[site], 1)
        return data.qfrc_passive + by_place.T @ [0.0, 0.0, -1000.0]

    def step(start: np.ndarray, way: np.ndarray) -> None:
        there = start.copy()
        engine.mj_integratePos(model, there, way, 1.0)
        data.qpos[:] = there

    for _ in range(30):
        here, force = data.qpos.copy(), off()
        slopes = np.zeros((6, 6))
        for j in range(6):
            way = np.zeros(6)
            way[j] = 1e-5 if j < 3 else 1e-7
            ends = []
            for sign in (1, -1):
                step(here, sign * way)
                ends.append(off())
            slopes[:, j] = (ends[0] - ends[1]) / (2 * way[j])
        change = -np.linalg.solve(slopes, force)
        step(here, change)
        if np.abs(change).max() < 1e-12:
            break
    return data.qpos[:3].copy()


@pytest.mark.parametrize(("name", "compliance"), CASES, ids=IDS)
def test_what_first_order_misses_grows_with_the_square_of_the_sag(
    name: str, compliance: dict[str, float]
) -> None:
    """First order is off by κ sag², κ at most 0.05 per mm (A3)."""
    robot = pk.load(name).yielding(compliance)
    poses = poses_of(robot, 6)
    q, load = robot.rigid.inverse(poses), pk.Load(mass=10.0, force=(50.0, -30.0, 0.0))
    exact = robot.forward(q, guess=poses, load=load).pose - poses
    at = robot.under(load)
    names = [f"compliance.{spring.number}" for spring in robot.model.elastic.springs]
    columns = [robot.geometry.names.index(each) for each in names]
    values = np.array([robot.geometry[each] for each in names])
    # with the forces at the poses without load, where compliances are none
    stiff = at.replace(dict.fromkeys(names, 0.0)).under(load)
    first = stiff.error_jacobian(poses, q)[:, :, columns] @ values
    sag = np.linalg.norm(exact[:, :3], axis=1)
    assert (sag > 1e-6).any()
    missed = np.linalg.norm((exact - first)[:, :3], axis=1)
    assert (missed <= 0.05 * sag**2 + 1e-9).all()


def test_first_order_of_a_hexapod_on_soft_legs_is_off_as_stated() -> None:
    robot = pk.load("hexapod").yielding({"offset*": 1.0 / 5e3})
    rng = np.random.default_rng(0)
    poses = robot.home + SHIFT + rng.uniform(-1, 1, (30, 6)) * SPAN
    load = pk.Load(mass=1000.0 / G, centre=(20.0, -10.0, 50.0))
    q = robot.rigid.inverse(poses)
    exact = robot.forward(q, guess=poses, load=load).pose - poses
    stiff = robot.replace({f"compliance.offset{i}": 0.0 for i in range(1, 7)}).under(load)
    columns = [robot.geometry.names.index(f"compliance.offset{i}") for i in range(1, 7)]
    first = stiff.error_jacobian(poses, q)[:, :, columns].sum(axis=2) / 5e3
    sag = np.linalg.norm(exact[:, :3], axis=1).max()
    missed = np.linalg.norm((exact - first)[:, :3], axis=1).max()
    assert sag == pytest.approx(1.1009, rel=1e-3)
    assert missed / sag**2 == pytest.approx(0.0078, rel=0.1)


@pytest.mark.parametrize("made", [heavy_hexapod, heavy_slider, heavy_crank])
def test_the_error_jacobian_of_a_loaded_machine_is_its_change(made) -> None:
    """By every number of what yields and pulls, to first order in sag over size."""
    robot = made()
    pose = robot.frames.outward(robot.own_home[None] + 0.01)[0]
    q = robot.inverse(pose)
    jacobian = robot.error_jacobian(pose, q)
    steps = {"mm": 1e-2, "rad": 1e-4, "1": 1e-5, "mm/N": 1e-6, "rad/(N mm)": 1e-10, "1/N": 1e-9}
    units = np.array(robot.geometry.units)
    for k, name in list(enumerate(robot.geometry.names))[::3]:
        value, step = robot.geometry[name], steps.get(units[k], 0.1)
        ends = [
            robot.replace({name: value + sign * step}).forward(q, guess=pose).pose
            for sign in (1, -1)
        ]
        change = (ends[0] - ends[1]) / (2 * step)
        largest = np.abs(jacobian[:, units == units[k]]).max()
        assert np.abs(change - jacobian[:, k]).max() <= 1e-2 * largest, name


@pytest.mark.parametrize(("name", "compliance"), CASES, ids=IDS)
def test_without_load_and_compliance_all_bits_are_those_of_the_rigid_machine(
    name: str, compliance: dict[str, float]
) -> None:
    rigid = pk.load(name)
    poses = poses_of(rigid, 30)
    q = rigid.inverse(poses)
    for robot in (rigid.yielding(compliance), rigid.yielding(dict.fromkeys(compliance, 0.0))):
        assert np.array_equal(robot.inverse(poses), q)
        for field in ("pose", "status", "iterations", "residual"):
            mine, other = getattr(robot.forward(q), field), getattr(rigid.forward(q), field)
            assert np.array_equal(mine, other)


def test_rows_of_a_load_are_those_of_the_call() -> None:
    robot = pk.load("hexapod").yielding({"offset*": 1e-4})
    poses = poses_of(robot, 5)
    q, load = robot.rigid.inverse(poses), load_at(5)
    together = robot.forward(q, guess=poses, load=load)
    for i in range(5):
        alone = pk.Load(*(np.asarray(each)[i] for each in
                          (load.mass, load.centre, load.force, load.moment)))  # fmt: skip
        assert np.abs(robot.forward(q[i], guess=poses[i], load=alone).pose
                      - together.pose[i]).max() < 1e-12  # fmt: skip
    with pytest.raises(pk.ArgumentError, match="load is of 5 rows, but 3"):
        robot.forward(q[:3], load=load)
    with pytest.raises(pk.ArgumentError, match="nothing of hexapod yields"):
        robot.rigid.forward(q, load=load)


def test_stiffness_of_a_hexapod_is_that_of_its_legs() -> None:
    """Closed forms at home, and k JᵀJ with the directions of the legs at a hundred poses (A1)."""
    robot = pk.load("hexapod").yielding({"offset*": 1.0 / 2e4})
    at_home = pk.stiffness(robot, robot.home).matrix
    assert at_home[5, 5] == pytest.approx(111923.20397244202, rel=1e-12)
    assert at_home[3, 3] == pytest.approx(4038.3976951053, rel=1e-12)
    assert at_home[2, 2] == pytest.approx(42267531.0704, rel=1e-11)
    poses = poses_of(robot, 100)
    found = pk.stiffness(robot, poses)
    base, platform = (
        np.array([[robot.geometry[f"{end}{i}.{axis}"] for axis in "xyz"] for i in range(1, 7)])
        for end in ("base", "platform")
    )
    for pose, matrix in zip(poses, found.matrix, strict=True):
        motion = pk.screw.from_pose(pose)
        arm = platform @ motion[:3, :3].T
        leg = arm + pose[:3] - base
        unit = leg / np.linalg.norm(leg, axis=1)[:, None]
        rows = np.hstack([np.cross(arm, unit), unit])
        closed = 2e4 * rows.T @ rows
        scale = np.sqrt(np.outer(np.diagonal(closed), np.diagonal(closed)))
        assert (np.abs(matrix - closed) <= 1e-12 * scale).all()


def test_the_softest_direction_gives_most() -> None:
    robot = pk.load("hexapod").yielding({"offset*": 1e-4, "base*": 1e-5})
    found = pk.stiffness(robot, poses_of(robot, 5), at=(0.0, 10.0, 80.0))
    direction, least = found.softest
    rng = np.random.default_rng(0)
    for way in rng.normal(size=(200, 3)):
        assert (found.along(way) <= 1.0 / least * (1 + 1e-12)).all()
    for i in range(5):
        assert found.along(direction[i])[i] == pytest.approx(1.0 / least[i], rel=1e-12)


def test_stiffness_at_a_point_is_what_a_small_force_there_does() -> None:
    robot = heavy_hexapod()
    pose, at = robot.frames.outward(robot.own_home[None])[0], np.array([5.0, -10.0, 30.0])
    q, found = robot.inverse(pose), pk.stiffness(robot, pose, at=at)
    frame = pk.screw.from_pose(pose)
    stated = {n: robot.geometry[f"payload.{n}"] for n in ("force.x", "moment.x")}
    assert stated["moment.x"] == 0.0
    arm = frame[:3, :3] @ at
    for axis, way in enumerate(np.eye(3)):
        ends = []
        for sign in (1, -1):
            push, turn = sign * way, np.cross(arm, sign * way)
            numbers = {f"payload.force.{x}": robot.geometry[f"payload.force.{x}"] + f
                       for x, f in zip("xyz", push, strict=True)}  # fmt: skip
            numbers |= {f"payload.moment.{x}": m for x, m in zip("xyz", turn, strict=True)}
            there = pk.screw.from_pose(robot.replace(numbers).forward(q, guess=pose).pose)
            ends.append((there @ np.append(at, 1.0))[:3])
        change = (ends[0] - ends[1]) / 2.0
        assert np.abs(change - found.compliance[3:, 3 + axis]).max() < 2e-2 * np.abs(change).max()


def test_a_compliance_table_of_a_stiff_machine_is_its_matrix() -> None:
    robot = pk.load("linear-delta").yielding({"offset*": 1e-7})
    table = pk.compliance_table(robot, robot.home, rated=100.0)
    diagonal = np.diagonal(pk.stiffness(robot, robot.home).compliance)[3:]
    assert table.compliance == pytest.approx(
        np.repeat(diagonal, 2)[:, None].repeat(10, 1), rel=1e-4
    )
    assert np.isinf(np.diagonal(pk.stiffness(robot, robot.home).matrix)[:3]).all()
    assert "static compliance up to 100 N" in str(table)


def test_what_does_not_yield_has_no_stiffness() -> None:
    robot = pk.load("hexapod")
    with pytest.raises(pk.ArgumentError, match="nothing of hexapod yields"):
        pk.stiffness(robot, robot.home)
    with pytest.raises(pk.ArgumentError, match="closures for 6 coordinates"):
        pk.load("exechon").yielding({"offset*": 1e-4})
    with pytest.raises(pk.ArgumentError, match="gain1 is no length"):
        robot.yielding({"gain*": 1e-4})
    with pytest.raises(pk.ArgumentError, match="compliance of offset1"):
        robot.yielding({"offset1": -1e-4})
    yields = robot.yielding({"offset*": 1e-4})
    with pytest.raises(pk.ArgumentError, match="ask its `rigid`"):
        yields.forward_all(robot.inverse(robot.home))


def test_actuators_of_a_moving_machine_follow_its_sag() -> None:
    """Velocities under load are the differences of the loaded inverse."""
    robot = pk.load("hexapod").yielding({"offset*": 1e-4}).carrying(pk.Load(mass=50.0))
    way, motion = np.array([10.0, 0.0, 5.0, 0.0, 0.0, 0.0]), np.zeros((3, 4, 4))
    motion[0], motion[1, :3, 3] = pk.screw.from_pose(robot.home), way[:3]
    velocity, _ = robot.rates(motion)
    ends = [robot.inverse(robot.home + sign * 1e-3 * way) for sign in (1, -1)]
    assert np.abs(velocity - (ends[0] - ends[1]) / 2e-3).max() < 1e-8
    assert np.abs(velocity - robot.rigid.rates(motion)[0]).max() > 1e-4


def test_a_carried_load_is_that_of_a_call_and_is_kept() -> None:
    robot = pk.load("hexapod").yielding({"offset*": 1e-4})
    load = pk.Load(mass=20.0, centre=(5.0, 0.0, 40.0), force=(0.0, 30.0, 0.0))
    carrying = robot.carrying(load).replace({"base1.x": robot.geometry["base1.x"] + 0.1})
    other = robot.replace({"base1.x": robot.geometry["base1.x"] + 0.1})
    assert np.array_equal(carrying.inverse(robot.home), other.inverse(robot.home, load=load))
    assert carrying.geometry["payload.force.y"] == 30.0
    with pytest.raises(pk.ArgumentError):
        robot.carrying(pk.Load(mass=[1.0, 2.0]))
