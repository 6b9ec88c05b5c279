"""Angles of actuators are on a circle: shared cranks, turns, strokes, over machines nobody drew."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.compensation.compensate import about_their_mean

from .. import generated, twin_rows
from ..robots import made, ring, rotary_delta

CLOSED = 1e-8  # mm
SEEDS = range(6)
every = pytest.mark.parametrize("kind", generated.KINDS)


def drawn(kind: str, seed: int, errors: float = 0.0) -> tuple[pk.Robot, np.random.Generator]:
    rng = np.random.default_rng([seed, generated.KINDS.index(kind)])
    return generated.machine(kind, rng, errors=errors), rng


def reached(kind: str, robot: pk.Robot, rng: np.random.Generator, count: int = 200) -> np.ndarray:
    """Poses in the user's frames that every limb reaches, on the closures."""
    own = generated.poses(kind, robot, count, rng)
    at = robot.frames.outward(own)
    if kind in generated.CONSTRAINED:
        at = robot.complete(at)
    return at[np.isfinite(robot.inverse(at)).all(axis=1)]


def missed(robot: pk.Robot, at: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Largest closure of each row, mm, by the twin."""
    return np.abs(twin_rows.closures(robot.model, robot.frames.inward(at), q)).max(axis=1)


def off(one: np.ndarray, other: np.ndarray, arm: float = 1.0) -> np.ndarray:
    """How far poses (N, 6) are from others: positions, and rotations as arcs on an arm of mm."""
    turned = np.abs(twin_rows.rotations(one) - twin_rows.rotations(other)).max(axis=(1, 2))
    return np.maximum(np.abs(one - other)[:, :3].max(axis=1), arm * turned)


def is_angle(robot: pk.Robot) -> np.ndarray:
    return np.array([unit == "rad" for unit in robot.actuator_units])


# the inverse --------------------------------------------------------------------------------------


@every
@pytest.mark.parametrize("seed", SEEDS)
def test_the_inverse_meets_the_closures_at_the_turn_nearest_to_the_stroke(
    kind: str, seed: int
) -> None:
    robot, rng = drawn(kind, seed)
    at = reached(kind, robot, rng)
    q = robot.inverse(at)
    assert len(at) > 20 and missed(robot, at, q).max() < CLOSED
    off = np.abs(q - generated.references(robot))[:, is_angle(robot)]
    half = np.pi / np.abs(robot.geometry.slots[:, 7])
    actuators = [limb.actuator for limb in robot.model.limbs]
    half = np.array([half[actuators.index(a)] for a in np.flatnonzero(is_angle(robot))])
    assert not (off > half + 1e-9).any()


@every
@pytest.mark.parametrize("seed", SEEDS)
def test_turns_of_actuators_are_one_position(kind: str, seed: int) -> None:
    robot, rng = drawn(kind, seed)
    at = reached(kind, robot, rng)
    q = robot.inverse(at)
    turns = np.where(np.isfinite(robot.turns), robot.turns, 0.0)
    assert ((turns > 0) == is_angle(robot)).all()
    turned = q + turns * rng.integers(-3, 4, q.shape)
    np.testing.assert_allclose(robot.inverse(at, near=turned), turned, rtol=0, atol=1e-9)
    np.testing.assert_allclose(robot.nearest_turns(q, near=turned), turned, rtol=0, atol=1e-9)
    np.testing.assert_allclose(robot.nearest_turns(turned), q, rtol=0, atol=1e-9)
    for guess in (None, at):
        one, other = robot.forward(q, guess), robot.forward(turned, guess)
        both = one.ok & other.ok
        assert both.sum() > 0.98 * (one.ok | other.ok).sum()
        apart = off(one.pose[both], other.pose[both]) > 1e-7
        # near a singularity two starts that differ by rounding may end in two modes
        assert apart.mean() < 0.01
        assert missed(robot, other.pose[both], turned[both]).max() < CLOSED


@every
@pytest.mark.parametrize("seed", SEEDS)
def test_a_machine_goes_where_it_was_sent(kind: str, seed: int) -> None:
    robot, rng = drawn(kind, seed, errors=0.3)
    at = reached(kind, robot, rng)
    q = robot.inverse(at)
    found = robot.forward(q, guess=at)
    assert found.ok.mean() > 0.98
    worst = off(found.pose[found.ok], at[found.ok], 100.0).max()
    assert worst < (20.0 if kind in generated.CONSTRAINED else 1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_limbs_of_one_crank_are_averaged_on_the_circle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = generated.machine("pairs", rng, errors=0.5)
    slots, limbs = robot.geometry.slots, robot.model.limbs
    at = robot.frames.outward(generated.poses("pairs", robot, 300, rng))
    at = at[np.isfinite(robot.inverse(at)).all(axis=1)]
    drive = robot.feasible(at).drive
    q = robot.inverse(at)
    for a in np.flatnonzero(is_angle(robot)):
        mine = [i for i, limb in enumerate(limbs) if limb.actuator == a]
        gain, offset = slots[mine, 7], slots[mine, 6]
        directions = np.exp(1j * np.sign(gain) * (drive[:, mine] - offset))
        sent = np.exp(1j * np.abs(gain[0]) * q[:, a])
        mean = directions.sum(axis=1) / np.abs(directions.sum(axis=1))
        assert np.abs(sent - mean).max() < 1e-3  # exact but for the difference of two means


# strokes ------------------------------------------------------------------------------------------


@every
@pytest.mark.parametrize("seed", SEEDS)
def test_a_stroke_is_kept_when_some_turn_of_the_crank_is_in_it(kind: str, seed: int) -> None:
    robot, rng = drawn(kind, seed)
    at = robot.frames.outward(generated.poses(kind, robot, 200, rng))
    found = robot.feasible(at)
    for i, limb in enumerate(robot.model.limbs):
        if limb.stroke is None or limb.kind != "RUS":
            continue
        turns = found.drive[:, i, None] + 2 * np.pi * np.arange(-6, 7)
        inside = ((turns >= limb.stroke[0]) & (turns <= limb.stroke[1])).any(axis=1)
        assert (found.stroke[:, i] == inside).all()


def across_half_a_turn(**limb: object) -> pk.Robot:
    """A rotary delta whose cranks are at 180° when the platform is at z = -357.07."""
    change = {"branch": -1, "base": None, "platform": None, "zero": None, **limb}
    limbs = []
    for angle in (0.0, 120.0, 240.0):
        out = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle)), 0.0])
        limbs.append(
            {"kind": "RUS"} | change | {"base": 200 * out, "platform": 50 * out, "zero": -out}
            | {"axis": np.cross(out, [0, 0, 1.0]), "crank": 200.0, "rod": 500.0}
        )  # fmt: skip
    return made("translation", {"z": -450.0}, limbs)


LIFT = [[0, 0, -377.07, 0, 0, 0], [0, 0, -337.07, 0, 0, 0]]


def test_a_stroke_across_half_a_turn_is_kept_all_along() -> None:
    robot = across_half_a_turn(stroke=np.radians([100.0, 300.0]))
    at = np.zeros((5, 6))
    at[:, 2] = [-620, -450, -380, -340, -300]
    q = np.degrees(robot.inverse(at))
    assert robot.feasible(at).ok.all() and (q > 100).all() and (q < 300).all()
    assert (q > 180).any() and (q < 180).any()


# corrections and moves ----------------------------------------------------------------------------


@pytest.mark.parametrize("common", [False, True])
@pytest.mark.parametrize("method", ["exact", "pso"])
def test_corrections_of_cranks_are_as_small_as_their_errors(common: bool, method: str) -> None:
    robot = across_half_a_turn()
    errors = {"offset1": 0.01, "offset2": -0.008, "offset3": 0.004}
    real = robot.replace(errors)
    at = np.zeros((9, 6))
    at[:, 2], at[:, 0] = np.linspace(-360, -354, 9), np.linspace(-5, 5, 9)
    found = pk.compensate(
        robot, at, lambda q: real.forward(q, guess=at).pose, common=common, method=method
    )
    near = 1e-9 if method == "exact" else 1e-4
    expected = np.tile([-value for value in errors.values()], (9, 1))
    np.testing.assert_allclose(found.correction, expected, rtol=0, atol=near)
    assert np.abs(real.forward(found.actuators, guess=at).pose - at).max() < 1e3 * near


@pytest.mark.parametrize("half", [0.0, 1.0, np.pi])
def test_a_mean_of_differences_is_one_on_the_circle(half: float) -> None:
    scatter = np.random.default_rng(0).uniform(-0.1, 0.1, (40, 2))
    turns = np.array([2 * np.pi / 1.5, np.inf])
    off = scatter + half
    off[:, 0] -= turns[0] * np.rint(off[:, 0] / turns[0])
    mean = about_their_mean(turns, off).mean(axis=0)
    expected = scatter.mean(axis=0) + half
    around = np.exp(2j * np.pi * (mean - expected)[0] / turns[0])
    assert abs(around - 1) < 1e-12 and abs(mean - expected)[1] < 1e-12


def test_a_table_of_corrections_has_no_turns_in_it() -> None:
    robot = across_half_a_turn()
    real = robot.replace({"offset1": 0.01, "offset2": -0.008, "offset3": 0.004})
    grid = {"x": np.linspace(-40, 40, 9), "y": np.linspace(-40, 40, 9), "z": [-367, -357, -347]}
    found = pk.correction_grid(robot, real, grid)
    assert np.abs(found.corrections).max() < 0.011 and found.position_error < 1e-6


@pytest.mark.parametrize("space", ["pose", "coordinates", "joint"])
def test_a_move_across_half_a_turn_neither_jumps_nor_goes_the_long_way(space: str) -> None:
    robot = across_half_a_turn()
    way = pk.trajectory.move(robot, *LIFT, duration=1.0, space=space)
    at = way.sample(np.linspace(0.0, 1.0, 401))
    assert np.abs(np.diff(at.actuators, axis=0)).max() < 0.01
    assert np.abs(at.actuators[-1] - at.actuators[0]).max() < 0.3
    assert at.pose[:, 2].min() > -378 and at.pose[:, 2].max() < -336
    np.testing.assert_allclose(way.sample(0.5).actuators, at.actuators[200], rtol=0, atol=1e-12)
    assert way.events() == []


@every
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("space", ["pose", "joint"])
def test_moves_of_any_machine_are_continuous(kind: str, seed: int, space: str) -> None:
    if space == "pose" and kind in generated.CONSTRAINED:
        pytest.skip("such machines do not follow straight lines")
    robot, rng = drawn(kind, seed)
    at = reached(kind, robot, rng)
    if kind == "planar":  # a straight way keeps to the plane
        assert robot.violation(at).max() < 1e-6
    for start, end in pairwise(at):
        try:
            way = pk.trajectory.move(robot, start, end, duration=1.0, space=space)
            break
        except pk.ArgumentError as refused:  # such actuators lead out of the mode on the way
            assert space == "joint" and "assembly mode" in str(refused)
    times = np.linspace(0.0, 1.0, 1001)
    found = way.sample(times)
    known = np.isfinite(found.actuators).all(axis=1)
    step = 0.5 * (found.velocities[1:] + found.velocities[:-1]) * 1e-3
    off = np.abs(np.diff(found.actuators, axis=0) - step)[known[1:] & known[:-1]]
    assert off.max() < 1e-3 * max(1.0, np.abs(found.velocities[known]).max())


def test_a_joint_move_goes_the_long_way_where_a_stroke_forbids_the_short_one() -> None:
    robot = across_half_a_turn(stroke=np.radians([-175.0, 175.0]))
    q = robot.inverse(LIFT)
    way = pk.trajectory.move(robot, *LIFT, duration=1.0, space="joint")
    np.testing.assert_allclose(way.law.end - way.law.start, q[1] - q[0], rtol=0, atol=0)
    assert np.abs(q[1] - q[0]).min() > 5.0
    straight = pk.trajectory.move(robot, *LIFT, duration=1.0)
    events = [each for each in straight.events() if each.what == "stroke"]
    assert len(events) == 3 and all(each.until == 1.0 for each in events)  # it cannot jump back


def test_a_wide_stroke_is_used_beyond_half_a_turn() -> None:
    robot = across_half_a_turn(stroke=np.radians([-250.0, 250.0]))
    for space in ("pose", "joint"):
        way = pk.trajectory.move(robot, *LIFT, duration=1.0, space=space)
        assert np.abs(way.sample(1.0).actuators - way.sample(0.0).actuators).max() < 0.3
        assert way.events() == []


def test_measurements_within_a_stroke_across_half_a_turn_are_not_suspected(
    recwarn: pytest.WarningsRecorder,
) -> None:
    robot = across_half_a_turn(stroke=np.radians([100.0, 300.0]))
    rng = np.random.default_rng(0)
    q = np.radians(np.full((6, 3), 190.0)) + rng.uniform(-0.1, 0.1, (6, 3))
    at = robot.forward(q, guess=[0, 0, -350, 0, 0, 0]).pose[:, :3]
    measured = pk.Measurements(q, at + 0.01 * rng.normal(size=(6, 3)), "position", sigma=0.01)
    pk.identify(robot, measured, free="offset*")
    assert [str(each.message) for each in recwarn] == []


def test_the_way_to_a_mode_is_the_short_one() -> None:
    robot = across_half_a_turn()
    begin, end = np.array(LIFT, float)
    modes = robot.forward_all(robot.inverse(end))
    best = modes.nearest(end)
    assert modes.reached_from(begin) == best
    assert modes.reached_from(end) == best


def test_homes_at_half_a_turn_do_not_hang_on_rounding() -> None:
    signs = set()
    for shift in (-1e-13, -1e-9, 0.0, 1e-9, 1e-13):
        robot = rotary_delta(*[{"offset": shift}] * 3)
        robot = pk.Robot(robot.model)
        zero = robot.inverse(robot.home)
        turned = rotary_delta(*[{"offset": np.pi - z} for z in zero])
        signs.add(tuple(np.sign(turned.inverse(turned.home) + turned.geometry.slots[:, 6])))
    assert len(signs) == 1


ratios = pytest.mark.parametrize("ratio", [0.5, 2.0, -0.5, 1.5, 3.0])
homes = pytest.mark.parametrize("at_home", [30.0, 170.0, 190.0])


def geared(at_home: float, ratio: float) -> pk.Robot:
    """A delta with two cranks to an actuator, one of them geared to it."""
    home, limbs = np.radians(at_home), []
    for angle in (0.0, 120.0, 240.0):
        out, side = ring(1.0, angle), ring(1.0, angle + 90.0)
        zero = np.cos(home) * out - np.sin(home) * np.cross(side, out)  # out when at home
        for y, gain in ((-40.0, 1.0), (40.0, ratio)):
            limbs.append({
                "kind": "RUS", "base": 160 * out + y * side, "platform": 40 * out + y * side,
                "axis": side, "zero": zero, "crank": 200.0, "rod": 500.0, "branch": 1,
                "actuator": int(angle) // 120 + 1, "gain": gain, "offset": home * (1 - gain),
            })  # fmt: skip
    return made("spatial", {"z": -435.0}, limbs, match=["x", "y", "z"])


ABOUT_HOME = np.array([[0, 0, 0], [0.1, 0.12, 0.11], [-0.1, 0.0, 0.03]])


@ratios
@homes
def test_limbs_geared_to_one_actuator_stand_where_they_agree(at_home: float, ratio: float) -> None:
    """A whole turn of one crank is none of the other: only some turns of the first do."""
    robot, q = geared(at_home, ratio), np.radians(at_home) + ABOUT_HOME
    found = robot.forward(q)
    assert found.ok.all()
    np.testing.assert_allclose(robot.inverse(found.pose, near=q), q, rtol=0, atol=1e-9)
    back = robot.inverse(found.pose)
    assert missed(robot, found.pose, back).max() < CLOSED
    np.testing.assert_allclose(robot.nearest_turns(back, near=q), q, rtol=0, atol=1e-9)
    assert missed(robot, found.pose, back + robot.turns).max() < CLOSED


@ratios
@homes
def test_geared_limbs_that_nearly_agree_stay_at_their_turn(at_home: float, ratio: float) -> None:
    """At poses that the machine misses a little no turn is one where they agree."""
    robot, q = geared(at_home, ratio), np.radians(at_home) + ABOUT_HOME
    beside = robot.forward(q).pose
    beside[:, 5] += 1e-4
    assert missed(robot, beside, q).max() > 1e-4
    np.testing.assert_allclose(robot.inverse(beside, near=q), q, rtol=0, atol=1e-3)


@pytest.mark.parametrize("home_value", [0.0, 200.0, -170.0])
@pytest.mark.parametrize("name", ["five-bar", "agile-eye", "eclipse"])
def test_turning_joints_of_chains_stay_in_their_strokes_whatever_gain_and_offset(
    name: str, home_value: float, tmp_path: Path
) -> None:
    text = Path(pk.__file__).with_name("builtin").joinpath("machines", f"{name}.toml").read_text()
    turned = re.sub(
        r'kind = "R",(.*)stroke = \[-(\d+).0, (\d+).0\]',
        lambda m: (
            f'kind = "R",{m[1]}home_value = {home_value}, stroke = '
            f"[{home_value - float(m[2])}, {home_value + float(m[3])}]"
        ),
        text,
    )
    file = tmp_path / "robot.toml"
    file.write_text(turned)
    robot = pk.load(file)
    rng = np.random.default_rng(0)
    for gains in ((-1.0,) * 6, rng.choice([-1, 1], 6) * rng.uniform(0.5, 2, 6)):
        count = range(1, robot.n_actuators + 1)
        changes = {f"gain{i}": float(gains[i - 1]) for i in count}
        changes |= {
            f"offset{i}": float(rng.uniform(-4, 4)) for i in count if is_angle(robot)[i - 1]
        }
        other = robot.replace(changes)
        q = other.inverse(other.home, match=True)
        assert other.feasible(other.home).ok
        assert other.feasible(other.home, q).ok
        np.testing.assert_allclose(
            other.drives(q[None])[0], robot.drives(robot.inverse(robot.home)[None])[0], atol=1e-9
        )
        assert other.forward(q).ok


@pytest.mark.parametrize(
    "name", ["rotary-delta", "3rrr-planar", "five-bar", "eclipse", "agile-eye"]
)
def test_an_angle_that_has_lost_its_digits_is_infeasible(name: str) -> None:
    """Whole turns are taken off up to 1e5 rad, of limbs and chains; beyond, none is known."""
    robot = pk.load(name)
    q = robot.inverse(robot.home)
    turning = int(np.flatnonzero(np.isfinite(robot.turns))[0])
    for size in (1e3, 9e4, 1.1e5, 1e9, 1e12, 1e18, 1e300):
        sent = q.copy()
        sent[turning] += robot.turns[turning] * np.round(size / robot.turns[turning])
        found = robot.forward(sent)
        if size < 1e5:
            assert found.ok and np.abs(found.pose - robot.home).max() < 1e-7
        else:
            assert found.status == 3 and np.isnan(found.pose).all()
