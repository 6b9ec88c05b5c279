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
                turn = np.array([way[2, 1] - way[1, 2], way[0, 2] - way[2, 0], way[1, 0] - way[0, 1]])
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
    return _with_limbs("rbt-6t03p", {"stiffness": 2e3, "rod_stiffness": 4e3, "mass": 0.5,
                                     "anchor_mass": 2.0}, {"slider*": 1e-7, "base*": 1e-5})  # fmt: skip


def heavy_crank() -> pk.Robot:
    """Rods on cranks with weights, and what may yield of them."""
    return _with_limbs("6-rus", {"stiffness": 5e3, "rod_stiffness": 8e3, "mass": 0.4,
                                 "anchor_mass": 1.5}, {"axis*": 1e-8, "crank*": 1e-5})  # fmt: skip


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
    own = np.linalg.inv(base) @ tool @ np.linalg.inv(
        pk.screw.from_pose(_frame(robot.model.tool_frame))
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
        anchor = numbers[f"mass.anchor{i + 1}"] if f"mass.anchor{i + 1}" in numbers else 0.0
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
    poses = robot.home + [0, 0, 50, 0, 0, 0] + rng.uniform(-1, 1, (6, 6)) * [150, 150, 100, .3, .3, .3]  # fmt: skip
    q, at = robot.inverse(poses), np.array([20.0, -10.0, 50.0])
    load = pk.Load(mass=1000.0 / G, centre=at)
    for stiffness in (2e4, 1e3, 300.0):
        found = robot.yielding({"offset*": 1.0 / stiffness}).forward(q, guess=poses, load=load)
        assert found.ok.all()
        for i in range(6):
            there = _tendons_at_rest(engine, robot, stiffness, q[i], poses[i], at)
            assert np.abs(there - found.pose[i, :3]).max() < 1e-10
    soft = robot.yielding({"offset*": 1.0 / 100.0}).forward(q, guess=poses, load=load)
    assert (soft.status == 6).all() and np.isnan(soft.pose).all()
    assert "gives way" in soft.failures()


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
