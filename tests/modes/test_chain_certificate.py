"""Certificates of chains of joints: what they state of closures, and what is proven by them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.core.chains import GROUPS, ChainMachine
from pkmcal.modes.chain_certificate import certify_chains, closures
from pkmcal.modes.find import pose_distance
from pkmcal.screw import exp, from_pose, to_pose
from tests.chain_files import as_chains
from tests.chain_twin import Twin
from tests.kinematics.test_chains import SQUARE, commands, disturbed, loaded

ROWS = {"spatial": slice(0, 6), "planar": slice(2, 5), "spherical": slice(0, 3)}


class Around:
    """The system of a machine with errors around one solution, by its unknowns y."""

    def __init__(self, name: str) -> None:
        self.robot = disturbed(pk.load(name))
        machine = self.robot.machine
        assert isinstance(machine, ChainMachine)
        self.layout = machine.layout
        self.q = commands(self.robot, 1)
        self.pose = self.robot.forward(self.q).pose
        self.theta = machine.frames(self.robot.slots, self.pose, self.q)[0]
        self.drive = machine.drives(self.robot.slots, self.q) - self.layout.zero
        turns = np.ones(self.theta.shape[1])
        passive = self.layout.coordinate >= 0
        slides = passive & (self.layout.prismatic != 0)
        turns[self.layout.coordinate[passive & ~slides]] = 1.0 / self.layout.length
        self.units, self.m = turns, GROUPS[self.layout.map]

    def __call__(self, y: np.ndarray):  # type: ignore[no-untyped-def]
        twist = np.zeros(6)
        twist[ROWS[self.layout.map]] = y[: self.m]
        at = from_pose(self.pose[0])
        at[:3, :3] = exp(np.r_[twist[:3] / self.layout.length, np.zeros(3)])[:3, :3] @ at[:3, :3]
        at[:3, 3] += twist[3:]
        theta = self.theta + self.units * y[self.m :]
        numbers = self.robot.slots.ravel()
        return closures(self.layout, numbers, to_pose(at)[None], self.drive, theta)


@pytest.mark.parametrize("name", SQUARE)
def test_the_system_is_closed_and_its_derivative_is_one(name: str) -> None:
    around = Around(name)
    count = around.m + len(around.units)
    system = around(np.zeros(count))
    assert system.df.shape == (1, count, count) and system.upright.all()
    assert np.abs(system.f).max() < 1e-9
    h = 1e-4 * around.layout.length
    for k, unit in enumerate(np.eye(count)):
        slope = (around(h * unit).f - around(-h * unit).f)[0] / (2 * h)
        assert np.abs(slope - system.df[0, :, k]).max() < 1e-6


@pytest.mark.parametrize("name", SQUARE)
def test_the_derivative_changes_no_faster_than_is_stated(name: str) -> None:
    """By the sums of rows, as joints turn and slide and the platform shifts within the ball."""
    around = Around(name)
    count, random = around.m + len(around.units), np.random.default_rng(0)
    still = np.zeros(count)
    if around.layout.map != "planar":
        still[:3] = 1.0  # a turn of the platform changes what its steps are
    else:
        still[0] = 1.0
    here = around(np.zeros(count))
    fastest = np.zeros(count)
    for _ in range(200):
        way = np.where(still, 0.0, random.choice([-1.0, 0.0, 1.0], count))
        y = way * random.uniform(0, 0.1) * around.layout.length
        if not np.abs(y).max():
            continue
        changed = np.abs(around(y).df - here.df)[0].sum(axis=1) / np.abs(y).max()
        fastest = np.maximum(fastest, changed)
    assert (fastest <= here.change[0]).all()
    assert (fastest > 0.02 * here.change[0]).any()  # nor are the bounds out of all proportion


@pytest.mark.parametrize("name", SQUARE)
def test_a_certified_pose_is_as_near_to_the_solution_as_it_says(name: str) -> None:
    robot = disturbed(pk.load(name))
    machine = robot.machine
    assert isinstance(machine, ChainMachine)
    q = commands(robot, 1)
    true = to_pose(Twin(robot).forward(q[0])[0])
    solved = robot.forward(q)
    assert solved.certificate.ok.all() and solved.certificate.error.max() < 1e-8
    random = np.random.default_rng(0)
    free = [c in robot.coordinates for c in ("x", "y", "z", "alpha", "beta", "gamma")]
    certified = []
    for off in np.geomspace(1e-7, 10.0, 25):
        way = random.choice([-1.0, 1.0], 6) * free * np.repeat([1.0, 1.0 / robot.length], 3)
        pose = true[None] + off * way
        proof = certify_chains(machine, robot.slots, pose, q)
        certified.append(bool(proof.ok[0]))
        if proof.ok[0]:
            apart = pose_distance(pose, true[None], robot.length)[0]
            assert apart - 1e-9 <= proof.error[0]
            assert proof.error[0] < 1e3 * off
    assert certified[0] and not certified[-1]


@pytest.mark.parametrize(("name", "modes"), (("five-bar", 2), ("agile-eye", 8)))
def test_as_many_modes_as_there_can_be_are_all(name: str, modes: int) -> None:
    robot = disturbed(pk.load(name), 0.3)
    found = robot.forward_all(commands(robot, 1)[0])
    assert len(found) == modes and found.certified.all() and found.complete
    assert found.reason.startswith(f"all {modes} certified, and there are no more: ")
    few = robot.forward_all(commands(robot, 1)[0], starts=1)
    assert len(few) < modes and few.certified.all() and not few.complete


@pytest.mark.parametrize("name", ("3rrr-planar", "3rps", "3prs"))
def test_chains_have_the_modes_that_are_proven_of_limbs_in_closed_form(
    name: str, tmp_path: Path
) -> None:
    robot = pk.load(name)
    chained = loaded(as_chains(robot), tmp_path)
    q = commands(robot, 1, share=0.3)[0]
    one, other = robot.forward_all(q), chained.forward_all(q)
    assert one.complete and other.certified.all()
    assert len(other) == len(one)
    for pose in other.poses:
        assert pose_distance(one.poses, pose[None], robot.length).min() < 1e-7
    assert not other.complete  # six can be, or nothing is known of how many


def test_nothing_is_certified_where_there_are_more_closures_than_coordinates() -> None:
    for name in ("exechon", "tripteron"):
        robot = pk.load(name)
        found = robot.forward_all(commands(robot, 1)[0])
        assert not found.certified.any() and not found.complete
        assert found.reason == "more closures than free coordinates"


def test_what_is_certified_shrinks_towards_a_singular_pose() -> None:
    """The outer links of a five-bar, until they are in line and part."""
    robot = pk.load("five-bar")
    q, way = robot.inverse(robot.home), np.array([1.0, -1.0])
    apart = np.arctan2(144.0, 108.0) - np.arccos(160.0 / 180.0)  # elbows 520, links 260 each
    proofs = [robot.forward(q + (apart - left) * way).certificate for left in (1e-2, 1e-4, 1e-6)]
    assert all(proof.ok for proof in proofs)
    unique = [float(proof.unique) for proof in proofs]
    assert unique[1] < 0.2 * unique[0] and unique[2] < 0.2 * unique[1]
    assert not robot.forward(q + apart * way).certificate.ok
    assert not robot.forward(q + (apart + 1e-3) * way).certificate.ok
