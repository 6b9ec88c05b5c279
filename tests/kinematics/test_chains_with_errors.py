"""Machines of chains with random errors: solved in the posture of the machine without them.

A universal joint can be turned over: the limb is then at the same pose with the same actuator as
long as there are no errors, and elsewhere with them. A machine whose errors grow goes through no
such posture, and its pose is where a continuation from the ideal geometry leads.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from tests.chain_twin import Twin, posed
from tests.kinematics.test_chains import loaded

CLOSED = 1e-7  # mm
MODEST = {"mm": 0.05, "rad": 2e-4}
LARGE = {"mm": 3.0, "rad": 0.03}
JOINTS = {
    "UPU": """\
  {{ kind = "U", at = [{base}, 0, 0], axes = [[0, 1, 0], [{height}, 0, {out}]] }},
  {{ kind = "P", actuator = 1 }},
  {{ kind = "U", at = [{end}, 0, {height}], axes = [[{height}, 0, {out}], [0, 1, 0]] }},
""",
    "PUU": """\
  {{ kind = "P", at = [{base}, 0, {top}], axis = [0, 0, 1], actuator = 1 }},
  {{ kind = "U", at = [{base}, 0, {top}], axes = [[0, 1, 0], [{rise}, 0, -{out}]] }},
  {{ kind = "U", at = [{end}, 0, {height}], axes = [[{rise}, 0, -{out}], [0, 1, 0]] }},
""",
    "RUU": """\
  {{ kind = "R", at = [{base}, 0, {top}], axis = [0, 1, 0], actuator = 1 }},
  {{ kind = "U", at = [{elbow}, 0, {top}], axes = [[0, 1, 0], [{rise}, 0, {elbow_out}]] }},
  {{ kind = "U", at = [{end}, 0, {height}], axes = [[{rise}, 0, {elbow_out}], [0, 1, 0]] }},
""",
}


def machine(limb: str, seed: int, folder: Path) -> tuple[pk.Robot, np.random.Generator]:
    """Three limbs that keep the platform parallel, of random sizes."""
    rng = np.random.default_rng([seed, len(limb), ord(limb[0])])
    base, end = rng.uniform(220, 300), rng.uniform(50, 110)
    height, rise = rng.uniform(300, 450), rng.uniform(300, 400)
    elbow = base + rng.uniform(90, 140)
    text = JOINTS[limb].format(
        base=base, end=end, height=height, top=height + rise, rise=rise, elbow=elbow,
        out=base - end, elbow_out=end - elbow,
    )  # fmt: skip
    head = (
        'name = "3-limbs"\nunits = { length = "mm", angle = "deg" }\n[pose]\nmap = "spatial"\n'
        f'home = {{ z = {height} }}\nmatch = ["x", "y", "z"]\n'
    )
    limbs = f'[[limb]]\nkind = "chain"\ncopies = 3\njoints = [\n{text}]\n'
    return loaded(head + limbs, folder), rng


def drawn(
    robot: pk.Robot, rng: np.random.Generator, sigma: dict[str, float]
) -> tuple[dict[str, float], np.ndarray, np.ndarray]:
    """Errors of all joints, a pose of the ideal machine, and its actuators."""
    names = [n for n in robot.geometry.names if n.rpartition(".")[2].startswith("d")]
    units = dict(zip(robot.geometry.names, robot.geometry.units, strict=True))
    errors = {name: rng.normal() * sigma[units[name]] for name in names}
    pose = robot.home + rng.uniform(-1, 1, 6) * [40, 40, 30, 0, 0, 0]
    return errors, pose, robot.inverse(pose)


def with_share(robot: pk.Robot, errors: dict[str, float], share: float) -> pk.Robot:
    return robot.replace({name: robot.geometry[name] + share * e for name, e in errors.items()})


@pytest.mark.parametrize("limb", JOINTS)
@pytest.mark.parametrize("seed", range(3))
def test_a_machine_with_errors_is_where_growing_errors_lead(
    limb: str, seed: int, tmp_path: Path
) -> None:
    robot, rng = machine(limb, seed, tmp_path)
    assert pk.dexterity(robot, robot.home).conditioning > 0.02
    for _ in range(6):
        errors, pose, q = drawn(robot, rng, MODEST)
        followed = pose
        for share in (0.1, 0.4, 0.7, 1.0):
            followed = with_share(robot, errors, share).forward(q, guess=followed).pose
        found = with_share(robot, errors, 1.0).forward(q, guess=pose)
        assert found.ok
        assert np.abs(found.pose - followed).max() < 1e-9


@pytest.mark.parametrize("limb", JOINTS)
def test_what_is_solved_closes_at_large_errors(limb: str, tmp_path: Path) -> None:
    robot, rng = machine(limb, 0, tmp_path)
    solved = 0
    for _ in range(12):
        errors, pose, q = drawn(robot, rng, LARGE)
        wrong = with_share(robot, errors, 1.0)
        found, twin = wrong.forward(q, guess=pose), Twin(wrong)
        solved += bool(found.ok)
        if found.ok:
            theta = np.array([found.passive[wrong.passive_names.index(n)] for n in twin.passive])
            assert np.abs(twin.misses(posed(found.pose), q, theta)).max() < CLOSED
        else:
            assert np.isnan(found.pose).all()
    assert solved > 6


@pytest.mark.parametrize("limb", JOINTS)
def test_random_errors_spread_as_linear_propagation_says(limb: str, tmp_path: Path) -> None:
    """Modest errors of machines far from singularities are linear: an independent reference."""
    robot, rng = machine(limb, 1, tmp_path)
    sigma = {"*.d[xyz]": MODEST["mm"], "*.dphi": MODEST["rad"], "*.dtheta": MODEST["rad"]}
    poses = robot.home + rng.uniform(-1, 1, (2, 6)) * [40, 40, 30, 0, 0, 0]
    found = pk.tolerance(robot, poses, sigma, samples=400)
    assert not found.n_failed.any()
    ratio = found.std / found.linear_std
    assert (np.abs(ratio - 1.0) < 0.12).all()  # of 400: four times 1/sqrt(800) is 0.14
