"""Readings that are late, and rows of two machines in one calibration."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.diagnostics.late import late

from ..simulated import hexapod_poses, said_by, with_errors
from ..sweeps import sweep

Read = Callable[[np.ndarray], np.ndarray]  # actuators to what is read there, of a true machine
Simulated = tuple[Any, np.ndarray, Callable[[np.random.Generator], Read]]
COUNT, SIZE = 60, 0.1
EXAMPLES = Path(__file__).parents[2] / "examples"
NOISE = np.array([0.02, 0.02, 0.02, 5e-5, 5e-5, 5e-5])  # mm, rad


def hexapod(rng: np.random.Generator) -> Simulated:
    """A machine, actuators, and what draws a true machine."""
    robot = pk.load("hexapod")
    q = robot.inverse(hexapod_poses(robot, COUNT, rng))
    return robot, q, lambda r: _poses(with_errors(robot, SIZE, r), 6)


def delta(rng: np.random.Generator) -> Simulated:
    robot = pk.load("rotary-delta")
    q = robot.inverse(pk.sample_poses(robot, COUNT, seed=int(rng.integers(1000)), share=0.5))
    return robot, q, lambda r: _poses(with_errors(robot, SIZE, r), 3)


def arm(rng: np.random.Generator) -> Simulated:
    machine = pk.SerialArm.from_dh(
        a=[0, 300, 50, 0, 0, 0], d=[400, 0, 0, 350, 0, 80],
        alpha=[-np.pi / 2, 0, -np.pi / 2, np.pi / 2, -np.pi / 2, 0], theta=np.zeros(6),
    )  # fmt: skip
    q = rng.uniform(-1.0, 1.0, (COUNT, 6))

    def true(r: np.random.Generator) -> Read:
        arm = machine.replace(SIZE * r.normal(size=(6, 6)) * [1, 1, 1, 2e-3, 2e-3, 2e-3])
        return lambda at: pk.screw.to_pose(arm.forward(at))

    return machine, q, true


def _poses(robot: pk.Robot, width: int) -> Read:
    return lambda at: robot.forward(at).pose[:, :width]


EVERY = [hexapod, delta, arm]
MACHINES = sweep("machine", EVERY, quick=[delta])


def noisy(exact: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return exact + rng.normal(size=exact.shape) * NOISE[: exact.shape[1]]


def measured(q: np.ndarray, read: np.ndarray, file: str = "") -> pk.Measurements:
    return pk.Measurements(q, read, "pose" if read.shape[1] == 6 else "position", file=file)


NEW = {"late-readings", "two-machines", "nothing-measured", "coarse-readings", "at-stop"}


def doubts(robot: Any, *data: pk.Measurements, **options: Any) -> dict[str, Any]:
    found = pk.identify(robot, data, holdout=0.25, **options)
    said = said_by(found, *NEW, "copies", "near-copies")
    return {name: each for name, each in said.items() if each.level == "doubt"}


@MACHINES
def test_sound_rows_are_not_accused(machine: Callable[..., Simulated]) -> None:
    for seed in range(4):
        rng = np.random.default_rng(seed)
        robot, q, true = machine(rng)
        assert not NEW & doubts(robot, measured(q, noisy(true(rng)(q), rng))).keys()


@sweep(
    "machine, leaving, share",
    product(EVERY, [False, True], [0.002, -0.002]),
    quick=[*product([delta], [False, True], [0.002, -0.002]), (arm, False, 0.002)],
)
def test_readings_off_where_the_machine_stops_are_named(
    machine: Callable[..., Simulated], leaving: bool, share: float
) -> None:
    """Read, or logged, 0.2 % of the way from the pose before or to the next; rows are held out."""
    rng = np.random.default_rng(1)
    robot, q, true = machine(rng)
    there = np.concatenate([q[1:], q[-1:]]) if leaving else np.concatenate([q[:1], q[:-1]])
    moved = q + abs(share) * (there - q)
    at, log = (moved, q) if share > 0 else (q, moved)
    said = doubts(robot, measured(log, noisy(true(rng)(at), rng)))["late-readings"]
    assert said.finding.leaving == leaving
    assert said.finding.share == pytest.approx(share, abs=5 * said.finding.stderr)
    wanted = (
        ("to the next pose" if leaving else "settle") if share > 0 else "log both at one moment"
    )
    assert wanted in said.text


@pytest.mark.filterwarnings("ignore:.*copied, not measured again")
@MACHINES
def test_copied_rows_are_not_those_of_two_machines(machine: Callable[..., Simulated]) -> None:
    rng = np.random.default_rng(5)
    robot, q, true = machine(rng)
    read, twice = noisy(true(rng)(q), rng), np.tile(np.arange(COUNT), 2)
    said = doubts(robot, measured(q[twice], read[twice]))
    assert "copies" in said
    assert "two-machines" not in said


@MACHINES
@pytest.mark.parametrize("group", ["every second", "second half"])
def test_rows_of_two_machines_are_told_apart(machine: Callable[..., Simulated], group: str) -> None:
    rng = np.random.default_rng(2)
    robot, q, true = machine(rng)
    place = np.arange(COUNT)
    other = place % 2 == 1 if group == "every second" else place >= COUNT // 2
    mixed = noisy(np.where(other[:, None], true(rng)(q), true(rng)(q)), rng)
    assert group in doubts(robot, measured(q, mixed))["two-machines"].text


@MACHINES
@sweep("turn", ["random", "every third"], quick=["random"])
def test_rows_of_two_machines_in_no_order_that_is_known_are_told_apart(
    machine: Callable[..., Simulated], turn: str
) -> None:
    rng = np.random.default_rng(6)
    robot, q, true = machine(rng)
    other = rng.random(COUNT) < 0.5 if turn == "random" else np.arange(COUNT) % 3 == 0
    mixed = noisy(np.where(other[:, None], true(rng)(q), true(rng)(q)), rng)
    assert "two-machines" in doubts(robot, measured(q, mixed))


@MACHINES
def test_two_files_of_two_machines_are_told_apart(machine: Callable[..., Simulated]) -> None:
    rng = np.random.default_rng(3)
    robot, q, true = machine(rng)
    halves = [
        measured(q[rows], noisy(true(rng)(q[rows]), rng), file)
        for rows, file in ((slice(0, 30), "one.csv"), (slice(30, 60), "other.csv"))
    ]
    assert ".csv" in doubts(robot, *halves)["two-machines"].text


@pytest.mark.filterwarnings("ignore:.*(further than errors|determined to no better)")
@sweep("seed", range(4), quick=[0])
def test_a_file_of_another_machine_is_not_taken_for_one_of_more_noise(seed: int) -> None:
    """One file is met to its noise, and all that the other is off was called its noise."""
    rng, robot = np.random.default_rng(13 + seed), pk.load("3rps")
    at = pk.sample_poses(robot, 45, seed=seed, share=0.5)
    q, halves = robot.inverse(at, match=True), (slice(0, 22), slice(22, 45))
    data = [
        measured(q[rows], noisy(_poses(with_errors(robot, 0.2, rng), 6)(q[rows]), rng), f)
        for rows, f in zip(halves, ("one.csv", "other.csv"), strict=True)
    ]
    assert "two-machines" in doubts(robot, *data)


@MACHINES
def test_files_of_unlike_noise_are_not_those_of_two_machines(
    machine: Callable[..., Simulated],
) -> None:
    for seed in range(2):
        rng = np.random.default_rng(seed)
        robot, q, true = machine(rng)
        read = noisy(true(rng)(q), rng)
        read[:30] += 10.0 * (noisy(read[:30], rng) - read[:30])
        halves = [measured(q[:30], read[:30], "one.csv"), measured(q[30:], read[30:], "other.csv")]
        assert "two-machines" not in doubts(robot, *halves)


def test_numbers_that_are_considered_do_not_hide_a_file_of_another_machine() -> None:
    """Nor make one of what they explain; the files are of unlike noise."""
    robot = pk.load("hexapod")
    q = robot.inverse(pk.sample_poses(robot, COUNT, seed=1, share=0.5))
    sizes = {"offset*": 0.1, "base?.x": 0.02}
    options = {"free": "offset*", "uncertainty": {"consider": {"base?.x": sizes["base?.x"]}}}
    said = []
    for other in (False, True):
        rng = np.random.default_rng(0)
        wrong = {name: size for kind, size in sizes.items() for name in robot.geometry.match(kind)}
        true = [
            _poses(
                robot.replace(
                    {
                        name: robot.geometry[name] + size * rng.normal()
                        for name, size in wrong.items()
                    }
                ),
                6,
            )
            for _ in range(2)
        ]
        exact = true[other](q[30:])
        noisier = exact + 3.0 * (noisy(exact, rng) - exact)
        halves = [
            measured(q[:30], noisy(true[0](q[:30]), rng), "one.csv"),
            measured(q[30:], noisier, "other.csv"),
        ]
        said.append("two-machines" in doubts(robot, *halves, **options))
    assert said == [False, True]


def sides(q: np.ndarray, rng: np.random.Generator, lean: float) -> np.ndarray:
    """Half of the rows, the more on one side of the workspace the larger `lean`."""
    place = lean * q[:, 0] / q[:, 0].std() + rng.normal(size=len(q))
    return place > np.median(place)


@MACHINES
@sweep("files", [False, True], quick=[True])
def test_two_machines_that_were_measured_at_places_of_their_own_are_told_apart(
    machine: Callable[..., Simulated], files: bool
) -> None:
    rng = np.random.default_rng(11)
    robot, q, true = machine(rng)
    other = sides(q, rng, lean=4.0)
    mixed = noisy(np.where(other[:, None], true(rng)(q), true(rng)(q)), rng)
    data = [
        measured(q[rows], mixed[rows], f"{name}.csv" if files else "")
        for name, rows in (("one", ~other), ("other", other))
    ]
    assert "two-machines" in doubts(robot, *data)


@MACHINES
def test_rows_whose_places_differ_by_chance_are_not_elsewhere(
    machine: Callable[..., Simulated],
) -> None:
    """Of few rows in no order, six actuators explain a third of any division into two groups."""
    rng = np.random.default_rng(12)
    robot, q, true = machine(rng)
    q = q[: COUNT // 2] if q.shape[1] == 3 else q[: 2 * COUNT // 3]
    other = sides(q, rng, lean=1.0)
    mixed = noisy(np.where(other[:, None], true(rng)(q), true(rng)(q)), rng)
    said = said_by(pk.identify(robot, measured(q, mixed)), "two-machines")["two-machines"]
    assert not said.finding.elsewhere and said.level == "doubt"


def tips(read: Read, q: np.ndarray) -> np.ndarray:
    there = pk.screw.from_pose(read(q))
    return there[:, :3, :3] @ TIP + there[:, :3, 3]


def touching(read: Read, q: np.ndarray, sockets: np.ndarray) -> np.ndarray:
    """Actuators near `q` (N, n) that hold the tip in sockets (N, 3), by Newton's method."""
    step = 1e-4 * np.ptp(q, axis=0).max()
    for _ in range(30):
        slopes = [(tips(read, q + e) - tips(read, q - e)) / (2 * step) for e in step * np.eye(6)]
        off = sockets - tips(read, q)
        q = q + (np.linalg.pinv(np.stack(slopes, axis=-1)) @ off[..., None])[..., 0]
    return q


TIP = np.array([10.0, 0.0, 90.0])


def turned(rng: np.random.Generator) -> Simulated:
    """Six cranks: as an arm, of a size that its angles do not show."""
    robot = pk.load("6-rus")
    q = robot.inverse(pk.sample_poses(robot, COUNT, seed=int(rng.integers(1000)), share=0.5))
    return robot, q, lambda r: _poses(with_errors(robot, SIZE, r), 6)


@pytest.mark.filterwarnings("ignore:.*determined to no better")
@sweep("machine, deviation", product([turned, arm], [0.001, 0.5]), [(turned, 0.001), (arm, 0.5)])
def test_touches_of_two_sockets_are_not_those_of_two_machines(
    machine: Callable[..., Simulated], deviation: float
) -> None:
    """Only their distance keeps the size of the machine, and touches of one do not know it."""
    rng = np.random.default_rng(7)
    robot, q, true = machine(rng)
    read, second = true(rng), np.arange(COUNT) >= COUNT // 2
    middle = tips(read, 0.5 * q[:1] + 0.5 * q.mean(axis=0))[0]
    at = np.where(second[:, None], middle + np.array([0.0, 50.0, 0.0]), middle)
    q = touching(read, q, at + 0.05 * rng.normal(size=at.shape))
    touch = pk.readings.Touch(np.where(second, "B", "A"), distances={("A", "B"): (50.0, deviation)})
    data = pk.Measurements(q, None, touch, target=TIP)
    assert not said_by(pk.identify(robot, data), "two-machines", "other-reading")


@MACHINES
@pytest.mark.parametrize("jitter", [1e-4, 1e-7])
def test_copies_with_other_digits_are_not_believed(
    machine: Callable[..., Simulated], jitter: float
) -> None:
    rng = np.random.default_rng(8)
    robot, q, true = machine(rng)
    twice = np.tile(np.arange(COUNT // 2), 2)
    q, read = q[twice], noisy(true(rng)(q[: COUNT // 2]), rng)[twice]
    copied = slice(COUNT // 2, COUNT)
    q[copied] += 0.1 * jitter * np.ptp(q) * rng.normal(size=(COUNT // 2, q.shape[1]))
    read[copied] += jitter * rng.normal(size=(COUNT // 2, read.shape[1]))
    assert "near-copies" in doubts(robot, measured(q, read))


@MACHINES
def test_poses_that_were_measured_twice_are_no_copies(machine: Callable[..., Simulated]) -> None:
    """The drives do not come back to the last digit."""
    rng = np.random.default_rng(9)
    robot, q, true = machine(rng)
    q = np.tile(q[: COUNT // 2], (2, 1)) + 1e-5 * np.ptp(q) * rng.normal(size=q.shape)
    found = pk.identify(robot, measured(q, noisy(true(rng)(q), rng)))
    assert not said_by(found, "near-copies")


@sweep("machine", EVERY, quick=[hexapod])
@pytest.mark.parametrize("digits", [2, 4])
def test_nominal_poses_that_were_rounded_are_no_measurements(
    machine: Callable[..., Simulated], digits: int
) -> None:
    """All angles of a pose are rounded, and each turns it about more than one axis."""
    rng = np.random.default_rng(10)
    robot, q, _ = machine(rng)
    there = robot.forward(q)
    exact = there.pose if isinstance(robot, pk.Robot) else pk.screw.to_pose(there)
    read = np.round(exact[:, : 3 if machine is delta else 6], digits)
    found = pk.identify(robot, measured(q, read), holdout=0.25)
    assert said_by(found, "nothing-measured")


def cables(rng: np.random.Generator, count: int = 40) -> tuple[Any, np.ndarray, Any]:
    """Eight cables on six ways to move: poses, and what draws the lengths of a true machine."""
    robot = pk.load(str(EXAMPLES / "cable-robot" / "robot.toml"))
    at = pk.sample_poses(robot, count, seed=int(rng.integers(1000)), share=0.5)
    return robot, at, lambda r: with_errors(robot, 0.5, r).inverse(at)


@pytest.mark.filterwarnings("ignore:.*longer than the others allow")
@sweep("wrong", ["nothing", "late", "two machines"], quick=["two machines"])
def test_rows_are_tested_where_actuators_are_more_than_the_ways_to_move(wrong: str) -> None:
    rng = np.random.default_rng(15)
    robot, at, true = cables(rng)
    q, read = true(rng) + 0.02 * rng.normal(size=(len(at), 8)), noisy(at, rng)
    if wrong == "late":
        q[1:] += 2e-4 * (q[:-1] - q[1:])
    if wrong == "two machines":
        q[1::2] = true(rng)[1::2]
    said = doubts(robot, measured(q, read)).keys()
    wanted = {"nothing": set(), "late": {"late-readings"}, "two machines": {"two-machines"}}
    assert wanted[wrong] == NEW & said


@MACHINES
@pytest.mark.parametrize("wrong", ["nothing", "late", "two machines"])
def test_rows_are_tested_where_actuators_have_noise(
    machine: Callable[..., Simulated], wrong: str
) -> None:
    rng = np.random.default_rng(16)
    robot, q, true = machine(rng)
    turning = robot.actuator_units[0] == "rad" if isinstance(robot, pk.Robot) else True
    deviation = 1e-5 if turning else 0.005
    one, other = true(rng), true(rng)
    driven = q + deviation * rng.normal(size=q.shape)
    read = noisy(one(driven), rng)
    if wrong == "late":
        read[1:] += 3e-3 * (read[:-1] - read[1:])
    if wrong == "two machines":
        read[1::2] = noisy(other(driven), rng)[1::2]
    kind = "pose" if read.shape[1] == 6 else "position"
    data = pk.Measurements(q, read, kind, actuator_sigma=deviation)
    wanted = {"nothing": set(), "late": {"late-readings"}, "two machines": {"two-machines"}}
    assert wanted[wrong] == NEW & doubts(robot, data).keys()


@pytest.mark.filterwarnings("ignore::pkmcal.CalibrationWarning")
def test_a_share_of_many_ways_is_not_said() -> None:
    """Where the machine's own derivatives say nothing of the way, a share of it is no number.

    No position moves of a positioner whose axes meet in its tool: 1e27 ways were named.
    """
    positioner = pk.SerialArm([[0, 1, 0], [0, 0, 1]], np.zeros((2, 3)), np.eye(4))
    rng = np.random.default_rng(5)
    q = rng.uniform(-2, 2, (205, 2))
    off = rng.normal(size=(2, 6)) * [0.3, 0.3, 0.3, 2e-3, 2e-3, 2e-3]
    frame = pk.screw.exp(np.r_[rng.normal(size=3), rng.normal(size=3) * 500])
    tool = pk.screw.exp(np.r_[rng.normal(size=3) * 0.3, rng.normal(size=3) * 100])
    seen = pk.screw.to_pose(frame @ positioner.forward(q, off) @ tool)
    seen += rng.normal(size=seen.shape) * [0.2, 0.2, 0.2, 3e-4, 3e-4, 3e-4]
    found = pk.identify(positioner, measured(q, seen[:, :3]), unknown="frame")
    said = late(found)
    assert said is None or abs(said.share) <= 2.0
