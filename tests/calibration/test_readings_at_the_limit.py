"""Each kind of reading is used as well as the Cramér-Rao bound allows, and says how well.

What instruments read is written here a second time, in plain NumPy, and differentiated numerically.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pkmcal as pk
from pkmcal.arrays import FloatArray
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.measurements import Measurements

from ..simulated import hexapod_poses, with_errors

SIGMA, NOISE, ARM = 0.5, 0.02, 200.0  # mm; angles are read as well as an arm of so many mm shows
TIP = np.array([40.0, -30.0, 120.0])
# Runs, and how far the root mean square may be from the bound: its own scatter is 0.1/√runs.
QUICK = pytest.param(8, 0.1, (0.91, 0.99), id="quick")
FULL = pytest.param(200, 0.05, (0.93, 0.97), id="200 runs", marks=pytest.mark.slow)

Numbers = dict[str, float]
Read = Callable[[Robot, Numbers], FloatArray]


@dataclass
class Case:
    """What was measured, what else was sought, and the reading a second time."""

    measured: Measurements
    read: Read  # in standard deviations
    truth: Numbers = field(default_factory=dict)
    target: str = "known"


def turned(pose: FloatArray) -> Rotation:
    return Rotation.from_euler("xyz", pose[:, 3:])


def tips(robot: Robot, q: FloatArray) -> FloatArray:
    pose = robot.forward(q).pose
    return pose[:, :3] + turned(pose).apply(TIP)


def between(true: Robot, rng: np.random.Generator, machine: pk.VirtualMachine) -> Case:
    q, other = (true.inverse(hexapod_poses(true, 80, rng)) for _ in range(2))

    def read(robot: Robot, _: Numbers) -> FloatArray:
        return np.linalg.norm(tips(robot, other) - tips(robot, q), axis=1) / NOISE

    return Case(machine.measure(q, pk.readings.Between(other), TIP), read)


def relative(true: Robot, rng: np.random.Generator, machine: pk.VirtualMachine) -> Case:
    q = true.inverse(hexapod_poses(true, 90, rng))
    run = np.arange(90) // 30
    stands = np.array([[1500.0, 200, 100], [-300, -1200, 900], [100, 300, -1500]])[run]

    def distances(robot: Robot) -> FloatArray:
        return np.linalg.norm(tips(robot, q) - stands, axis=1)

    def read(robot: Robot, at: Numbers) -> FloatArray:
        zeros = np.array([at["run.A.zero"], at["run.B.zero"], at["run.C.zero"]])
        return (distances(robot) - zeros[run]) / NOISE

    zeros = distances(true)[[0, 30, 60]]
    truth = dict(zip(("run.A.zero", "run.B.zero", "run.C.zero"), zeros.tolist(), strict=True))
    names = ["ABC"[i] for i in run]
    measured = machine.measure(q, pk.readings.RelativeDistance(TIP, names), stands)
    return Case(measured, read, truth)


MOUNTING = {"mounting.alpha": 0.1, "mounting.beta": -0.05, "mounting.gamma": 1.3}


def sensor(robot: Robot, q: FloatArray, at: Numbers) -> Rotation:
    mounted = Rotation.from_euler("xyz", [at[name] for name in MOUNTING])
    return turned(robot.forward(q).pose) * mounted


def orientation(true: Robot, rng: np.random.Generator, machine: pk.VirtualMachine) -> Case:
    q = true.inverse(hexapod_poses(true, 40, rng))
    about = sensor(true, q, MOUNTING).inv()

    def read(robot: Robot, at: Numbers) -> FloatArray:
        return (sensor(robot, q, at) * about).as_rotvec().ravel() * ARM / NOISE

    measured = machine.measure(q, pk.readings.Orientation(list(MOUNTING.values())))
    return Case(measured, read, MOUNTING, target="unknown")


def tilt(true: Robot, rng: np.random.Generator, machine: pk.VirtualMachine) -> Case:
    q = true.inverse(hexapod_poses(true, 60, rng))

    def read(robot: Robot, at: Numbers) -> FloatArray:
        axes = sensor(robot, q, at).as_matrix()
        return np.arcsin(axes[:, 2, :2]).ravel() * ARM / NOISE

    return Case(machine.measure(q, pk.readings.Tilt(list(MOUNTING.values()))), read, MOUNTING)


def angle(true: Robot, rng: np.random.Generator, machine: pk.VirtualMachine) -> Case:
    q = true.inverse(pk.sample_poses(true, 40, seed=int(rng.integers(2**32))))
    place = true.passive_names.index("limb1.joint2")

    def read(robot: Robot, at: Numbers) -> FloatArray:
        angles = robot.forward(q).passive[:, place] - at["angle.limb1.joint2.zero"]
        return angles * ARM / NOISE

    measured = machine.measure(q, pk.readings.Angle("limb1.joint2"))
    return Case(measured, read, {"angle.limb1.joint2.zero": 0.0})


# What is touched, around where the tip is at home (0, 0, 920).
HIGH = 920.0
TOUCHED: dict[str, dict[str, Numbers]] = {
    "point": {
        "A": {"x": 60.0, "y": -40.0, "z": HIGH - 30.0},
        "B": {"x": -50.0, "y": 70.0, "z": HIGH + 20.0},
        "C": {"x": -70.0, "y": -60.0, "z": HIGH},
    },
    "sphere": {
        "A": {"x": 40.0, "y": -40.0, "z": HIGH - 30.0, "radius": 60.0},
        "B": {"x": -30.0, "y": 50.0, "z": HIGH + 20.0, "radius": 45.0},
    },
    "line": {
        "A": {"y": 30.0, "z": HIGH, "beta": 0.05, "gamma": -0.1},
        "B": {"x": -20.0, "z": HIGH + 20.0, "alpha": 0.1, "gamma": 0.2},
        "C": {"x": 10.0, "y": -20.0, "alpha": 0.02, "beta": -0.03},
    },
    "plane": {
        "A": {"x": 20.0, "beta": 0.05, "gamma": -0.1},
        "B": {"y": -20.0, "alpha": 0.02, "gamma": 0.3},
        "C": {"z": HIGH, "alpha": 0.1, "beta": 0.02},
    },
}


def named(artefact: str) -> Numbers:
    return {
        f"touch.{name}.{number}": value
        for name, numbers in TOUCHED[artefact].items()
        for number, value in numbers.items()
    }


def off(artefact: str, at: Numbers, name: str, x: FloatArray) -> FloatArray:
    """How far points (N, 3) are off what is touched, across it."""
    mine = {key.rpartition(".")[2]: v for key, v in at.items() if key.startswith(f"touch.{name}.")}
    near = x - [mine.get(axis, 0.0) for axis in "xyz"]
    if artefact == "point":
        return near
    if artefact == "sphere":
        length = np.linalg.norm(near, axis=1)
        return near * (1.0 - mine["radius"] / length)[:, None]
    turn = Rotation.from_euler(
        "xyz", [mine.get(angle, 0.0) for angle in ("alpha", "beta", "gamma")]
    )
    inside = turn.inv().apply(near)
    along = [axis not in mine for axis in "xyz"]  # a line or a plane may be anywhere along these
    inside[:, along] = 0.0
    return turn.apply(inside)


def read_off(artefact: str, at: Numbers, name: str, x: FloatArray) -> FloatArray:
    """The same as it is counted: with a sign where it is one number, along axes of its own."""
    if artefact == "sphere":
        centre = [at[f"touch.{name}.{axis}"] for axis in "xyz"]
        return np.linalg.norm(x - centre, axis=1) - at[f"touch.{name}.radius"]
    return off(artefact, at, name, x).ravel()


def touching(true: Robot, places: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Actuators with which the true machine's tip is at places, but for the noise."""
    angles = rng.uniform(-0.25, 0.25, (len(places), 3))
    at = places + NOISE * rng.normal(size=places.shape)
    return true.inverse(np.hstack([at - Rotation.from_euler("xyz", angles).apply(TIP), angles]))


def touches(artefact: str, true: Robot, rng: np.random.Generator) -> Case:
    """Of each of a kind 30 touches; the distance of two is known."""
    truth, each = named(artefact), list(TOUCHED[artefact])
    names = np.repeat(each, 30)
    about = np.array([0, 0, HIGH]) + rng.uniform(-1, 1, (len(names), 3)) * [90, 90, 50]
    for name in each:
        mine = names == name
        about[mine] -= off(artefact, truth, name, about[mine])
    q = touching(true, about, rng)
    known = {("A", "B"): (gap(truth), 0.001)} if artefact in ("point", "sphere") else {}

    def read(robot: Robot, at: Numbers) -> FloatArray:
        x = tips(robot, q)
        rows = [read_off(artefact, at, name, x[names == name]) / NOISE for name in each]
        return np.concatenate([*rows, [gap(at) / 0.001]] if known else rows)

    touch = pk.readings.Touch(names, artefact, known)
    measured = Measurements(q, None, touch, sigma=NOISE, target=TIP)
    return Case(measured, read, truth)


def gap(at: Numbers) -> float:
    """From A to B."""
    return float(np.linalg.norm([at[f"touch.A.{axis}"] - at[f"touch.B.{axis}"] for axis in "xyz"]))


CASES: dict[str, Callable[[Robot, np.random.Generator, pk.VirtualMachine], Case]] = {
    "between": between,
    "relative-distance": relative,
    "orientation": orientation,
    "tilt": tilt,
    "angle": angle,
    "touch a point": lambda true, rng, _: touches("point", true, rng),
    "touch a line": lambda true, rng, _: touches("line", true, rng),
    "touch a plane": lambda true, rng, _: touches("plane", true, rng),
    "touch a sphere": lambda true, rng, _: touches("sphere", true, rng),
}


def information(case: Case, true: Robot, names: tuple[str, ...]) -> FloatArray:
    """Fisher's, of the readings and of the prior: the inverse of the bound."""
    geometry = true.geometry
    units = dict(zip(geometry.names, geometry.units, strict=True))
    columns, prior = [], []
    for name in names:
        per_mm = 1 / true.length if units.get(name) == "rad" else 1.0
        step = 1e-3 * per_mm
        ends = []
        for sign in (1, -1):
            numbers, robot = dict(case.truth), true
            if name in numbers:
                numbers[name] += sign * step
            else:
                robot = true.replace({name: geometry[name] + sign * step})
            ends.append(case.read(robot, numbers))
        columns.append((ends[0] - ends[1]) / (2 * step))
        prior.append(0.0 if name in case.truth else 1 / (SIGMA * per_mm) ** 2)
    rows = np.stack(columns, axis=-1)
    return rows.T @ rows + np.diag(prior)


@pytest.mark.filterwarnings("ignore:the measurements contradict the prior")  # by chance
@pytest.mark.parametrize(("runs", "within", "covered"), [QUICK, FULL])
@pytest.mark.parametrize("kind", CASES)
def test_each_kind_reaches_the_cramer_rao_bound_and_is_honest(
    kind: str, runs: int, within: float, covered: tuple[float, float]
) -> None:
    """Errors in units of the bound, over all parameters: 1 where all of it is attained."""
    robot = pk.load("agile-eye" if kind == "angle" else "hexapod")
    squares, inside = [], []
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        true = with_errors(robot, SIGMA, rng)
        case = CASES[kind](true, rng, pk.VirtualMachine(true, NOISE, seed))
        found = pk.identify(robot, case.measured, prior=SIGMA, unknown={"target": case.target})
        off = found.values - [
            case.truth[name] if name in case.truth else true.geometry[name] for name in found.free
        ]
        squares.append(off @ information(case, true, found.free) @ off / len(off))
        inside.append(np.abs(off) < 1.96 * found.stderr)
    ratio, share = np.sqrt(np.mean(squares)), np.mean(inside)
    print(f"{kind}: {ratio:.3f} of the bound, {share:.1%} within 95 % intervals")
    assert ratio == pytest.approx(1.0, abs=within)
    assert covered[0] <= share <= covered[1]
