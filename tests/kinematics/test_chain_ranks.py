"""How many errors of chains can be told apart: as many as counted, and as nominal axes leave."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk

from ..chain_files import all_errors, described
from .test_chains import commands, loaded, reference

# With axes that intersect, are parallel or at right angles, many errors act to second order only.
NOMINAL = {
    "five-bar (2-DOF)": 13, "3-RRR planar": 21, "3-RRR spherical (agile eye)": 21,
    "3-PRS (Sprint Z3)": 42, "Tricept 3-UPS/UP": 45, "4-UPS/PS": 54, "Delta 3-R(SS)2, U-S rods": 54,
    "6-UPS (hexapod)": 66, "TriVariant UP&2-UPS": 36,
}  # fmt: skip


def strengths(robot: pk.Robot, q: np.ndarray) -> np.ndarray:
    """Singular values of all effects on poses, of the largest; the gains apart."""
    found = robot.forward(q)
    good = np.asarray(found.ok)
    assert good.mean() > 0.8
    own = [i for i, name in enumerate(robot.geometry.names) if not name.startswith("gain")]
    effects = robot.error_twists(found.pose[good], q[good])[..., own]
    effects[:, :3] *= robot.length
    sigma = np.array([0.1 if robot.geometry.units[i] == "mm" else 1e-3 for i in own])
    values = np.linalg.svd((effects * sigma).reshape(-1, len(own)), compute_uv=False)
    return np.asarray(values / values[0])


def counted(machine: dict[str, Any]) -> int:
    """3 R + P + actuators + 6 limbs; in the plane and about a point R + actuators + 3 limbs."""
    kinds = [joint["kind"] for joint in machine["joints"]]
    actuators = 1 + max(joint["actuator"] for joint in machine["joints"])
    if machine["group"] == "spatial":
        return 3 * kinds.count("R") + kinds.count("P") + actuators + 6 * len(machine["limbs"])
    return kinds.count("R") + actuators + 3 * len(machine["limbs"])


@pytest.mark.parametrize("machine", reference())
def test_ranks_are_those_counted(machine: dict[str, Any], tmp_path: Path) -> None:
    if machine["over"]:
        pytest.skip("counted for machines that are not over-constrained")
    robot = loaded(described(machine), tmp_path)
    share = np.abs(machine["q"]).max() * 1.5 / (30.0 if robot.actuator_units[0] == "mm" else 0.2)
    q = commands(robot, 70, share=min(share, 3.0))
    if machine["name"] in NOMINAL:
        values = strengths(robot, q)
        rank = NOMINAL[machine["name"]]
        assert values[rank - 1] > 1e-8 and (values[rank:] < 1e-12).all()
        assert len(robot.model.free) == rank
    errors = {name: 8 * value for name, value in all_errors(machine, robot).items()}
    values = strengths(robot.replace(errors), q)
    assert int((values > 1e-13).sum()) == counted(machine)


def test_a_tricept_s_errors_are_found(tmp_path: Path) -> None:
    """All 153 joint errors at once, of which poses determine 45: to what noise leaves of them."""
    machines = [case.values[0] for case in reference()]
    machine = next((m for m in machines if m and m["name"].startswith("Tricept")), None)
    if machine is None:
        pytest.skip("no reference machine here")
    text = described(machine).replace("[[limb]]", 'match = ["x", "y", "z"]\n[[limb]]', 1)
    robot = loaded(text, tmp_path)
    names = [name for name in robot.geometry.names if not name.startswith("gain")]
    random = np.random.default_rng(3)
    units = dict(zip(robot.geometry.names, robot.geometry.units, strict=True))
    sigma = {name: {"mm": 0.1, "rad": 5e-4}[units[name]] for name in names}
    true = robot.replace({name: random.normal(0, sigma[name]) for name in names})
    q = commands(robot, 160, share=5.0)
    there = true.forward(q).pose
    noise = np.repeat([0.01, 1e-5], 3)  # mm, rad
    read = there[:60] + random.normal(0, noise, (60, 6))
    measured = pk.Measurements(q[:60], read, "pose", sigma=noise)
    found = pk.identify(robot, measured, free=names, prior=sigma)
    assert len(names) == 153 and found.rank == 45

    def off(other: pk.Robot) -> float:
        miss = (other.forward(q[60:]).pose - there[60:])[:, :3]
        return float(np.sqrt((miss**2).sum(axis=1).mean()))

    # of 45 numbers from 60 poses noise leaves this much, if all six of a pose weighed alike
    left = 0.01 * np.sqrt(3 * 45 / (6 * 60))
    assert off(robot) > 0.3
    assert off(found.robot) < 1.5 * left
