"""Drive laws: their formulas, their inverses, and every call of every machine with them."""

from __future__ import annotations

from itertools import count

import mpmath as mp
import numpy as np
import pytest

import pkmcal as pk
from pkmcal.core.laws import Drive, Laws

from .. import generated
from ..driven import content, parsed, with_laws
from ..robots import hexapod, made, ring
from ..workspaces import CHAINS, WORKSPACE, poses

ALL = (*sorted(WORKSPACE), *generated.KINDS)
NAMES = ("x", "y", "z", "alpha", "beta", "gamma")


def full_law(stroke: tuple[float, float] | None = (-60.0, 60.0)) -> tuple[Laws, np.ndarray]:
    """A law with everything, and its numbers as a geometry of one row."""
    place = count()
    names = ("offset", "gain", "quadratic", "spool", "buildup", "backlash")
    drive = Drive(
        0, False, **{name: next(place) for name in names},
        harmonics=((0.7, next(place), next(place)), (2.1, next(place), next(place))),
        table=np.array([-30.0, -5.0, 12.0, 40.0]),
        corrections=tuple(next(place) for _ in range(4)),
        stroke=stroke,
    )  # fmt: skip
    numbers = [3.0, 0.031, 2e-5, 41.0, 0.9, 0.12, 0.05, -0.08, 0.02, 0.01, 0.1, -0.2, 0.15, 0.3]
    return Laws([drive], len(numbers)), np.array([numbers])


def exact(numbers: list[mp.mpf], q: mp.mpf, direction: int) -> mp.mpf:
    """The law in many digits, as it is defined: the spool by its radii, not multiplied out."""
    offset, gain, quadratic, R, c, backlash, a1, b1, a2, b2, *table = map(mp.mpf, numbers)
    q = mp.mpf(q)
    u = c * (gain * q + quadratic * q**2) / 2
    way = offset + ((u + R) ** 2 - R**2) / c - direction * backlash / 2
    for k, a, b in ((0.7, a1, b1), (2.1, a2, b2)):
        way += a * mp.cos(mp.mpf(k) * q) + b * mp.sin(mp.mpf(k) * q)
    knots = [mp.mpf(x) for x in (-30, -5, 12, 40)]
    at = min(max(q, knots[0]), knots[-1])
    j = max(i for i in range(3) if knots[i] <= at)
    return way + table[j] + (table[j + 1] - table[j]) * (at - knots[j]) / (knots[j + 1] - knots[j])


def test_laws_and_their_derivatives_agree_with_fifty_digits() -> None:
    laws, numbers = full_law()
    q = np.array([-41.3, -29.0, -5.5, 0.0, 3.3, 12.5, 39.0, 44.0])
    for direction in (-1, 0, 1):
        approach = np.full((len(q), 1), float(direction))
        found = laws.ways(numbers, q[:, None], approach)
        by_number = laws.by_number(numbers, q[:, None], range(numbers.size), approach)
        with mp.workdps(50):
            step = mp.mpf(10) ** -15
            for i, at in enumerate(q.tolist()):

                def way(
                    x: float, j: int = -1, at: float = at, direction: int = direction
                ) -> mp.mpf:
                    """By the j-th number, or by q."""
                    changed = numbers.ravel().tolist()
                    if j >= 0:
                        changed = [mp.mpf(v) for v in changed]
                        changed[j] += x
                        return exact(changed, at, direction)
                    return exact([mp.mpf(v) for v in changed], mp.mpf(at) + x, direction)

                assert abs(found.way[i, 0] - way(0)) < 1e-13 * 50
                slope = (way(step) - way(-step)) / (2 * step)
                bend = (way(step) - 2 * way(0) + way(-step)) / step**2
                assert abs(found.slope[i, 0] - slope) < 1e-12
                assert abs(found.bend[i, 0] - bend) < 1e-12
                for j in range(numbers.size):
                    rate = (way(step, j=j) - way(-step, j=j)) / (2 * step)
                    assert abs(by_number[i, j] - rate) < 1e-12 * (1 + abs(rate)), j


@pytest.mark.parametrize("direction", [-1.0, 0.0, 1.0])
def test_a_law_with_everything_is_inverted(direction: float) -> None:
    laws, numbers = full_law()
    q = np.linspace(-43.0, 42.0, 501)[:, None]
    approach = np.array([direction])
    way = laws.ways(numbers, q, approach).way
    assert (np.diff(way[:, 0]) > 0).all()
    found = laws.readings(numbers, way, approach)
    assert abs(found - q).max() < 1e-11


def test_what_is_beyond_the_turning_point_has_no_reading() -> None:
    laws = Laws([Drive(0, False, 0, 1, quadratic=2)], 3)
    numbers = np.array([[5.0, 2.0, -0.01]])  # turns at q = 100, where the way is 105
    way = np.array([[5.0], [104.9], [105.1], [-300.0]])
    q = laws.readings(numbers, way)
    assert np.isnan(q[2, 0]) and np.isfinite(q[[0, 1, 3]]).all()
    assert (q[[0, 1, 3]] < 100.0).all()
    assert abs(laws.ways(numbers, q[[0, 1, 3]]).way - way[[0, 1, 3]]).max() < 1e-12


def test_a_law_that_turns_back_has_no_reading_anywhere_rather_than_one_of_several() -> None:
    laws, numbers = full_law()
    numbers[0, 6] = 3.0  # a wave of 3 mm on the way: steeper than the drive
    assert laws.doubts(numbers) == {0: "it turns back within its stroke, -60 to 60"}
    assert np.isnan(laws.readings(numbers, np.array([[10.0]]))).all()
    laws, numbers = full_law(stroke=None)
    assert "state a stroke" in laws.doubts(numbers)[0]


@pytest.mark.parametrize("seed", range(20))
def test_a_law_is_called_monotone_only_where_it_is(seed: int) -> None:
    """Against the signs of its slopes on a fine grid."""
    rng = np.random.default_rng(seed)
    laws, numbers = full_law()
    numbers[0, 6:] *= 10.0 ** rng.uniform(0.0, 1.2)
    q = np.linspace(-60, 60, 200_001)[:, None]
    found = laws.ways(numbers, q)
    inside = abs(found.way[:, 0]) < 60.0
    assert laws.doubts(numbers) or (found.slope[inside, 0] > 0).all()


# every call of every machine ----------------------------------------------------------------------


def driven(name: str, seed: int) -> tuple[pk.Robot, np.ndarray]:
    """A machine with laws at random, and poses that it reaches: those that it did without laws."""
    rng = np.random.default_rng([seed, 3])
    if name in generated.KINDS:
        plain = generated.machine(name, rng)
        own = generated.poses(name, plain, 20, rng)
        at = plain.frames.outward(own)
    else:
        plain, at = pk.load(name), poses(name, 20, seed)
    robot = with_laws(plain, rng)
    if len(robot.moved) < 6:
        at = plain.complete(at)
    known = np.isfinite(plain.inverse(at)).all(axis=1)
    assert (np.isfinite(robot.inverse(at)).all(axis=1) == known).all() and known.sum() > 5
    return robot, at[known]


def size_of(robot: pk.Robot, poses: np.ndarray) -> np.ndarray:
    """Differences of poses with angles as arcs, mm."""
    poses = poses.copy()
    poses[..., 3:] = robot.length * np.angle(np.exp(1j * poses[..., 3:]))
    return poses


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", ALL)
def test_forward_finds_what_inverse_commands(name: str, seed: int) -> None:
    robot, at = driven(name, seed)
    q = robot.inverse(at)
    found = robot.forward(q, guess=at)
    assert found.ok.all()
    own, wanted = robot.own_rows(found.pose)[0], robot.own_rows(at)[0]
    if len(robot.moved) == 6:
        assert abs(own[:, :3] - wanted[:, :3]).max() < 1e-8
    again = robot.inverse(found.pose, near=q)
    assert abs(again - q).max() < 1e-8


@pytest.mark.parametrize("name", ALL)
def test_derivatives_are_those_of_the_calls(name: str) -> None:
    """By readings and by every number, against central differences."""
    for seed in count():
        robot, at = driven(name, seed)
        q = robot.inverse(at)
        solved = robot.forward(q, guess=at)
        at = solved.pose
        plain = solved.conditioning > 0.05
        plain &= np.abs(np.cos(at[:, 4])) > 0.3  # where α β γ are fit to be differentiated
        if plain.sum() > 5:
            break
    q, at = q[plain], at[plain]
    scale = np.array([1.0] * 3 + [robot.length] * 3)[:, None]

    def moved(one: pk.Robot, readings: np.ndarray) -> np.ndarray:
        return one.forward(readings, guess=at).pose

    square = robot.machine.rows == robot.machine.m
    by_q = robot.forward_jacobian(at) if robot.frames.trivial and square else None
    by_number = robot.error_jacobian(at, q)
    free = [NAMES.index(name) for name in robot.coordinates]
    for a, unit in enumerate(robot.actuator_units if by_q is not None else ()):
        step = 1e-3 if unit == "mm" else 1e-5
        change = np.zeros(robot.n_actuators)
        change[a] = step
        off = size_of(robot, moved(robot, q + change) - moved(robot, q - change)) / (2 * step)
        assert abs(off[:, free] - (by_q[..., a] * scale[free, 0])).max() < 1e-5 * abs(off).max()
    geometry = robot.geometry
    steps = {"mm": 1e-4, "rad": 1e-6, "1": 1e-6, "1/mm": 1e-9, "1/rad": 1e-6, "1/mm2": 1e-11}
    for number in geometry.numbers:
        if not number.slot.startswith(("drive", "gain", "offset")):
            continue
        i, step = geometry.names.index(number.name), steps[number.unit]
        ends = [
            moved(robot.replace({number.name: geometry[number.name] + e}), q) for e in (-step, step)
        ]
        off = size_of(robot, ends[1] - ends[0]) / (2 * step)
        expected = by_number[..., i] * scale[:, 0]
        assert abs(off - expected).max() <= 2e-5 * max(abs(off).max(), 1.0), number.name


@pytest.mark.parametrize("name", [n for n in ALL if n not in ("pairs", "redundant", "tripod")])
def test_rates_of_actuators_are_those_of_their_positions(name: str) -> None:
    """Velocity and acceleration along a screw, against differences of the inverse."""
    robot, at = driven(name, 7)
    if len(robot.coordinates) < 6 or not robot.frames.trivial:
        pytest.skip("the way would leave the machine's manifold")
    rng = np.random.default_rng(0)
    twist = np.concatenate([rng.normal(size=3) * 1e-3, rng.normal(size=3)])
    start = pk.screw.from_pose(at[:1])[0]
    step = 1e-2

    def q(t: float) -> np.ndarray:
        pose = pk.screw.to_pose((pk.screw.exp(twist, t) @ start)[None])
        return robot.inverse(pose, near=robot.inverse(at[:1])[0])[0]

    W = np.zeros((4, 4))
    W[:3, :3] = np.cross(np.eye(3), twist[:3])
    W[:3, 3] = twist[3:]
    velocity, acceleration = robot.rates(np.stack([start, W @ start, W @ W @ start]))
    ends = [q(k * step) for k in (-2, -1, 0, 1, 2)]
    first = (ends[0] - 8 * ends[1] + 8 * ends[3] - ends[4]) / (12 * step)
    second = (-ends[0] + 16 * ends[1] - 30 * ends[2] + 16 * ends[3] - ends[4]) / (12 * step**2)
    assert abs(velocity - first).max() < 1e-7 * (1 + abs(first).max())
    smooth = not any(law is not None and law.table for law in robot.model.laws)
    if smooth:  # at a place of a table the velocity jumps
        assert abs(acceleration - second).max() < 1e-5 * (1 + abs(second).max())


def test_the_moving_platform_follows_its_law() -> None:
    """`motion` is the inverse of `rates`: the platform moves as the actuators that follow it."""
    robot = with_laws(pk.load("hexapod"), np.random.default_rng(2))
    there = robot.home + np.array([30, -20, 40, 0.1, 0.05, -0.1])
    times, step = np.array([0.3, 0.9, 1.7]), 1e-4
    for space in ("pose", "joint"):
        way = pk.trajectory.move(robot, robot.home, there, duration=2.0, space=space)
        at, before, behind = (way.sample(times + e) for e in (0.0, -step, step))
        moved = (behind.actuators - before.actuators) / (2 * step)
        assert abs(moved - at.velocities).max() < 1e-4
        moved = (behind.pose - before.pose)[:, :3] / (2 * step)
        assert abs(moved - at.twist[:, 3:]).max() < 1e-4


@pytest.mark.parametrize("name", ["hexapod", "rotary-delta", "3rps", "3rrr-planar"])
def test_every_assembly_mode_has_the_same_readings(name: str) -> None:
    robot, at = driven(name, 1)
    q = robot.inverse(at[0])
    modes = robot.forward_all(q)
    assert modes.complete and modes.certified.all()
    assert np.nanmin(abs(size_of(robot, modes.poses - at[0])).max(axis=1)) < 1e-7
    for pose in modes.poses:
        solved = robot.forward(q, guess=pose)
        assert solved.ok and abs(size_of(robot, solved.pose - pose)).max() < 1e-6


@pytest.mark.parametrize("name", ["rotary-delta", "6-rus", "3rrr-planar"])
def test_a_turn_of_a_drive_is_one_whatever_its_law(name: str) -> None:
    """A reading is given on the turn nearest to what was asked for, and it is the same pose."""
    robot = with_laws(pk.load(name), np.random.default_rng(2), ("quadratic", "backlash"))
    at = robot.complete(poses(name, 20, 2)) if len(robot.moved) < 6 else poses(name, 20, 2)
    q = robot.inverse(at)
    ways = robot.drives(q)
    assert np.isinf(robot.turns).any()  # of a drive with a quadratic number no two turns are alike
    for turn in (-1, 1):
        near = robot.machine.at_drives(robot.slots, ways + 2 * np.pi * turn)
        far = robot.inverse(at, near=near)
        assert abs(robot.drives(far) - ways - 2 * np.pi * turn).max() < 1e-9
        assert abs(robot.forward(far, guess=at).pose - at).max() < 1e-8
        assert abs(robot.nearest_turns(far, near=q) - q).max() < 1e-9


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", ["rotary-delta", "6-rus", "3rrr-planar", *generated.KINDS])
def test_whatever_turn_is_asked_for_a_reading_is_given_that_leads_to_the_pose(
    name: str, seed: int
) -> None:
    """Also where a law ends before that turn, or limbs that share a crank agree at one turn."""
    robot, at = driven(name, seed)
    if robot.machine.rows > robot.n_actuators:  # as the limbs that share an actuator stand
        at = robot.forward(robot.inverse(at), guess=at).pose
        at = at[np.isfinite(at).all(axis=1)]
        at = at[robot.violation(at) < 1e-7]
    q = robot.inverse(at)
    rng = np.random.default_rng(seed)
    for turns in (0.5, 1.0, 3.0):
        near = q + 2 * np.pi * turns * rng.uniform(-1, 1, q.shape)
        far = robot.inverse(at, near=near)
        assert np.isfinite(far).all()
        found = robot.forward(far, guess=at)
        assert found.ok.all()
        off = pk.screw.from_pose(found.pose) - pk.screw.from_pose(at)
        assert abs(off).max(initial=0.0) < 1e-6


@pytest.mark.parametrize("name", ["rotary-delta", "hexapod", *generated.KINDS])
def test_a_row_does_not_depend_on_the_rows_beside_it(name: str) -> None:
    robot, at = driven(name, 1)
    q = robot.inverse(at)
    alone = np.stack([robot.inverse(pose) for pose in at])
    assert (alone == q).all()
    poses = robot.forward(q).pose
    alone = np.stack([robot.forward(row).pose for row in q])
    assert np.array_equal(alone, poses, equal_nan=True)


def test_errors_that_return_with_every_turn_leave_turns_as_they_are() -> None:
    plain = pk.load("6-rus")
    rng = np.random.default_rng(3)
    waves = [
        {"k": float(k), "cos": a, "sin": b}
        for k, (a, b) in zip((1, 3, 20), rng.normal(size=(3, 2)).tolist(), strict=True)
    ]
    for wave in waves:
        wave["cos"] *= 0.02 / wave["k"]
        wave["sin"] *= 0.02 / wave["k"]
    data = content(plain)
    for limb in data["limb"]:
        limb["drive"] = {"harmonics": waves}
    robot = parsed(data)
    assert np.allclose(robot.turns, plain.turns) and np.isfinite(robot.turns).all()
    q = robot.inverse(poses("6-rus", 20, 1))
    far = q + robot.turns * rng.integers(-3, 4, q.shape)
    assert abs(robot.forward(far).pose - robot.forward(q).pose).max() < 1e-9
    assert abs(robot.nearest_turns(far, near=q) - q).max() < 1e-12


@pytest.mark.parametrize("name", CHAINS)
def test_chains_have_laws_too(name: str) -> None:
    robot = with_laws(pk.load(name), np.random.default_rng(4))
    home = robot.inverse(robot.home)
    assert np.isfinite(home).all()
    rng = np.random.default_rng(5)
    way = np.array([0.03 * (robot.length if u == "mm" else 1.0) for u in robot.actuator_units])
    if any(law is not None and law.spool for law in robot.model.laws):
        slopes = abs(robot.machine.slopes(robot.slots, home[None])[0])
        way = way / slopes
    q = home + way * rng.uniform(-1, 1, (20, robot.n_actuators))
    solved = robot.forward(q)
    good = np.asarray(solved.ok)
    assert good.sum() >= 10
    if robot.machine.rows == robot.machine.m:
        again = robot.inverse(solved.pose[good], near=q[good])
        assert abs(again - q[good]).max() < 1e-6
    by_number = robot.error_jacobian(solved.pose[good], q[good])
    geometry = robot.geometry
    for number in geometry.numbers:
        if number.slot in ("drive.cos", "drive.quadratic", "drive.table", "gain"):
            i = geometry.names.index(number.name)
            step = {"mm": 1e-3, "rad": 1e-6, "1": 1e-6, "1/mm": 1e-8, "1/rad": 1e-6, "1/mm2": 1e-10}
            e = step[number.unit]
            ends = [
                robot.replace({number.name: geometry[number.name] + s})
                .forward(q[good], guess=solved.pose[good])
                .pose
                for s in (-e, e)
            ]
            off = size_of(robot, ends[1] - ends[0]) / (2 * e)
            expected = by_number[..., i] * ([1.0] * 3 + [robot.length] * 3)
            assert abs(off - expected).max() < 1e-4 * max(abs(off).max(), 1.0), number.name


def test_numbers_that_are_0_are_no_law() -> None:
    law = {
        "quadratic": 0.0, "harmonics": [{"k": 0.1}], "table": [[0.0, 0.0], [900.0, 0.0]],
        "backlash": 0.0,
    }  # fmt: skip
    plain, robot = hexapod(), hexapod(*[{"drive": law}] * 6)
    at = plain.home + 20.0 * np.eye(6)[:3]
    q = plain.inverse(at)
    assert abs(robot.inverse(at) - q).max() < 1e-11
    assert abs(robot.forward(q).pose - plain.forward(q).pose).max() < 1e-11
    assert abs(robot.jacobian(at) - plain.jacobian(at)).max() < 1e-12


def test_limbs_that_share_an_actuator_have_its_law_each() -> None:
    """Two rods on a carriage with one screw: as many readings as carriages."""
    limbs = []
    for tower in (90, 210, 330):
        for side in (-30.0, 30.0):
            across = np.array([-np.sin(np.radians(tower)), np.cos(np.radians(tower)), 0.0]) * side
            limbs.append({
                "kind": "PUS", "base": ring(160.0, tower) + across,
                "platform": ring(40.0, tower) + across, "slider": [0, 0, 1], "rod": 300.0,
                "offset": 250.0, "branch": -1, "actuator": 1 + (90, 210, 330).index(tower),
                "drive": {"quadratic": 2e-5, "harmonics": [{"k": 0.5, "cos": 0.03}]},
                "stroke": [200.0, 600.0],
            })  # fmt: skip
    robot = made("translation", {"z": 100.0}, limbs)
    at = robot.home + 25.0 * np.random.default_rng(0).uniform(-1, 1, (9, 6)) * [1, 1, 1, 0, 0, 0]
    q = robot.inverse(at)
    assert q.shape == (9, 3)
    assert abs(robot.forward(q, guess=at).pose - at).max() < 1e-9
    single = made("translation", {"z": 100.0}, [
        limb | {"actuator": i + 1} for i, limb in enumerate(limbs[::2])
    ])  # fmt: skip
    assert abs(single.inverse(at) - q).max() < 1e-9


@pytest.mark.parametrize("name", ["redundant", "six", "2tpr2tps-spatial"])
def test_what_actuators_would_read_follows_poses_and_numbers(name: str) -> None:
    """Readings that poses need, less those read, and their derivatives, against differences."""
    robot, at = driven(name, 1)
    machine, slots = robot.machine, robot.slots
    assert not robot.geometry.tied.any()
    own = np.ascontiguousarray(robot.own_rows(at)[0])
    own = own[np.isfinite(machine.inverse(slots, own)).all(axis=1)]
    rng = np.random.default_rng(0)
    step = np.array([1.0] * 3 + [1e-2] * 3)[: machine.m] * rng.uniform(-1, 1, (len(own), machine.m))
    read = machine.inverse(slots, own)
    there = machine.moved(own, step)
    reached = np.isfinite(machine.inverse(slots, there)).all(axis=1)
    assert reached.sum() > 5
    there, read, step = there[reached].copy(), read[reached].copy(), step[reached]
    columns = robot.geometry.slot_index.astype(np.int32)
    residual, by_step, by_number = machine.readings(slots, there, read, columns)
    exact = [i for i, limb in enumerate(robot.model.limbs)]
    rows = np.cumsum([0, *(int(r).bit_count() + 1 for r in machine.struct.rows[0 : len(exact)])])
    needed = machine.inverse(slots, there, read)
    alone = [i for i in exact if sum(o.actuator == robot.model.limbs[i].actuator
                                     for o in robot.model.limbs) == 1]  # fmt: skip
    for i in alone:
        a = robot.model.limbs[i].actuator
        assert abs(residual[:, rows[i]] - (needed - read)[:, a]).max() < 1e-9
    small = 1e-5
    for k in range(machine.m):
        change = np.zeros_like(step)
        change[:, k] = small
        ends = [machine.readings(slots, machine.moved(there, e * change), read) for e in (-1, 1)]
        slope = (ends[1][0] - ends[0][0]) / (2 * small)
        assert abs(slope - by_step[:, :, k]).max() < 1e-4 * (1 + abs(by_step).max())
    steps = {"mm": 1e-4, "rad": 1e-6, "1": 1e-7, "1/mm": 1e-10, "1/rad": 1e-7, "1/mm2": 1e-12}
    for j, number in enumerate(robot.geometry.numbers):
        e = steps[number.unit]
        ends = []
        for sign in (-1, 1):
            changed = slots.copy()
            changed.flat[columns[j]] += sign * e
            ends.append(machine.readings(changed, there, read)[0])
        slope = (ends[1] - ends[0]) / (2 * e)
        size = 1.0 + abs(by_number[:, :, j]).max()
        assert abs(slope - by_number[:, :, j]).max() < 1e-4 * size, number.name


@pytest.mark.parametrize("kind", ("six", "pairs", "planar"))
def test_each_row_may_be_approached_from_its_own_side(kind: str) -> None:
    rng = np.random.default_rng(4)
    robot = with_laws(generated.machine(kind, rng), rng)
    pose = robot.frames.outward(generated.poses(kind, robot, 4, rng))
    approach = rng.choice([-1.0, 0.0, 1.0], (4, robot.n_actuators))
    together = robot.approaching(approach).inverse(pose)
    alone = [robot.approaching(a).inverse(p) for a, p in zip(approach, pose, strict=True)]
    np.testing.assert_array_equal(together, alone)
    assert np.nanmax(np.abs(together - robot.inverse(pose))) > 0.0
