"""Machines that yield: what pulls at them, where they come to rest, and what reaches a pose."""

from __future__ import annotations

import numpy as np
import pytest

import pkmcal as pk

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
