"""Limbs that share passive joints: alone each has such a joint in several places, all have one.

Passive joints, derivatives and the inverse of a row are those of the posture in which all limbs
close together, which Newton's method found; compared with a twin in NumPy and with differences of
`forward`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from tests.chain_files import delta_of_hinges, leg_on_leg
from tests.chain_twin import Twin, posed
from tests.kinematics.test_chains import loaded
from tests.sweeps import sweep

MACHINES = {
    "H4": (delta_of_hinges((95, 180, 225, 305)), 30.0),
    "H4 near a singularity": (delta_of_hinges((0, 100, 175, 280)), 20.0),
    "leg on leg": (leg_on_leg("passive"), 60.0),
}
CLOSED = 1e-7  # mm
WELL = 5e-3  # conditioning of rows beside which another assembly mode is not


def solved(name: str, folder: Path) -> tuple[pk.Robot, pk.Forward, np.ndarray]:
    text, way = MACHINES[name]
    robot = loaded(text, folder)
    rng = np.random.default_rng(0)
    scale = np.where(np.array(robot.actuator_units) == "mm", way, way / 300.0)
    q = robot.inverse(robot.home) + scale * rng.uniform(-1, 1, (150, robot.n_actuators))
    found = robot.forward(q)
    assert found.ok.mean() > 0.7
    return robot, robot.forward(q[found.ok]), q[found.ok]


@pytest.mark.parametrize("name", MACHINES)
def test_passive_joints_close_all_limbs_at_once(name: str, tmp_path: Path) -> None:
    robot, found, q = solved(name, tmp_path)
    twin = Twin(robot)
    order = [robot.passive_names.index(joint) for joint in twin.passive]
    for pose, row, passive in zip(found.pose, q, found.passive, strict=True):
        assert np.abs(twin.misses(posed(pose), row, passive[order])).max() < CLOSED


@pytest.mark.parametrize("name", MACHINES)
def test_errors_move_a_pose_as_differences_of_forward_say(name: str, tmp_path: Path) -> None:
    robot, found, q = solved(name, tmp_path)
    well = found.conditioning > WELL
    pose, q = found.pose[well], q[well]
    rates, step = robot.error_jacobian(pose, q), 1e-4
    assert np.isfinite(rates).all()
    names = [n for n in robot.geometry.names if n.rpartition(".")[2] in ("dx", "dy")]
    for name in names[::7]:
        ends = [
            robot.replace({name: robot.geometry[name] + way}).forward(q, guess=pose)
            for way in (step, -step)
        ]
        assert all(end.ok.all() for end in ends)
        by_steps = (ends[0].pose - ends[1].pose) / (2 * step)
        column = rates[:, :, robot.geometry.names.index(name)]
        assert (np.abs(column - by_steps) <= 1e-5 * (1.0 + np.abs(by_steps))).all()


@pytest.mark.parametrize("name", MACHINES)
def test_forward_stays_at_its_pose_and_the_inverse_leads_there(name: str, tmp_path: Path) -> None:
    robot, found, q = solved(name, tmp_path)
    well = found.conditioning > WELL
    pose, q = found.pose[well], q[well]
    assert np.abs(robot.forward(q, guess=pose).pose - pose).max() < 1e-6
    back = robot.inverse(pose)
    known = np.isfinite(back).all(axis=1)
    assert known.mean() > 0.97
    assert np.abs(robot.forward(back[known], guess=pose[known]).pose - pose[known]).max() < 1e-6


@sweep("seed", range(4), quick=[0])
def test_errors_move_a_pose_so_also_beside_a_singularity(seed: int, tmp_path: Path) -> None:
    """Other H4s, their rows of the least conditioning, with steps as small as that.

    There the pose bends with each number: differences of a step of 1e-3 mm are off by 16 % at a
    conditioning of 1.5e-3, though the derivative is right.
    """
    rng = np.random.default_rng([34, seed])
    angles = np.arange(4) * 90.0 + rng.uniform(-25.0, 25.0, 4)
    robot = loaded(delta_of_hinges(tuple(angles.round(1).tolist())), tmp_path)
    q = rng.uniform(-30.0, 30.0, (80, 4))
    found = robot.forward(q)
    worst = np.flatnonzero(found.ok)[np.argsort(found.conditioning[found.ok])]
    worst = worst[found.conditioning[worst] > 1e-4][:12]
    assert len(worst) == 12
    assert found.conditioning[worst[0]] < 2e-2
    pose, q, conditioning = found.pose[worst], q[worst], found.conditioning[worst]
    rates = robot.error_jacobian(pose, q)
    for name in robot.geometry.names[::37]:
        column = rates[:, :, robot.geometry.names.index(name)]
        unit = 1.0 if name.rpartition(".")[2] in ("dx", "dy", "dz") else 1.0 / robot.length
        for row, good in enumerate(conditioning):
            step = 2e-3 * good * unit
            ends = {
                way: robot.replace({name: robot.geometry[name] + way * step})
                .forward(q[row], guess=pose[row])
                .pose
                for way in (-2, -1, 1, 2)
            }
            by_steps = (8.0 * (ends[1] - ends[-1]) - (ends[2] - ends[-2])) / (12.0 * step)
            assert np.abs(column[row] - by_steps).max() * unit < 1e-6 / good
