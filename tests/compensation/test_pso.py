"""The swarm of eq. 19: the same bits everywhere, bounds kept, minima found."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arrays import FloatArray
from pkmcal.compensation.pso import pso
from pkmcal.core import library, swarm
from pkmcal.core.swarm import CONSTRICTION, PAPER, SwarmSettings, minimise_eq18
from pkmcal.kinematics.limb_residual import LimbResidual

from ..kinematics.test_closures_twin import head_with_a_leg
from ..simulated import hexapod_poses, tilted_poses, with_errors
from ..twin import closures

AIM = np.array([0.3, -0.2, 0.1, 0.5])
STABLE = {"inertia": 0.7298, "cognitive": 1.49618, "social": 1.49618}
ISAS = range(library.lib.pkm_best_isa() + 1)


def distance(x: FloatArray) -> FloatArray:
    """E of eq. 18 for one pose with L* - L = AIM."""
    off = AIM - x
    square = off[:, 0] * off[:, 0]
    for d in range(1, len(AIM)):
        square = square + off[:, d] * off[:, d]
    return np.sqrt(square)


# --- random numbers ----------------------------------------------------------------------------


def words(count: int, seed: int) -> list[float]:
    """The first numbers of the first particle, by the published generators in plain integers."""
    full = (1 << 64) - 1
    counter = seed

    def split() -> int:
        nonlocal counter
        counter = (counter + 0x9E3779B97F4A7C15) & full
        z = counter
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & full
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & full
        return z ^ (z >> 31)

    counter = split()
    counter = split()
    s = [split() for _ in range(4)]
    drawn = []
    for _ in range(count):
        drawn.append((((s[0] + s[3]) & full) >> 12) / 2.0**52)
        t = (s[1] << 17) & full
        s[2] ^= s[0]
        s[3] ^= s[1]
        s[1] ^= s[2]
        s[0] ^= s[3]
        s[2] ^= t
        s[3] = ((s[3] << 45) | (s[3] >> 19)) & full
    return drawn


@pytest.mark.parametrize("isa", ISAS)
def test_random_numbers_are_those_of_xoshiro256_plus(isa: int) -> None:
    unit = np.zeros(5), np.ones(5)
    start = swarm.Swarm(SwarmSettings(particles=3), *unit, seed=2**63 + 11, isa=isa).positions
    assert start.shape == (3, 5)
    assert start[0].tolist() == words(5, 2**63 + 11)


def test_particles_start_evenly_within_the_bounds() -> None:
    low, high = np.array([-1.0, 10.0]), np.array([1.0, 30.0])
    start = swarm.Swarm(SwarmSettings(particles=20_000), low, high, seed=0).positions
    assert ((low <= start) & (start < high)).all()
    assert (np.abs(start.mean(axis=0) - (low + high) / 2) < 0.02 * (high - low)).all()
    np.testing.assert_allclose(start.std(axis=0), (high - low) / np.sqrt(12), rtol=0.02)
    assert abs(np.corrcoef(start.T)[0, 1]) < 0.03


# --- eq. 19 ------------------------------------------------------------------------------------


def test_a_particle_moves_by_eq_19() -> None:
    # with c1 = 0 and one dimension the random factor can be told from the move: in [0, 1)
    settings = SwarmSettings(particles=50, inertia=0.6, cognitive=0.0, social=1.0)
    flock = swarm.Swarm(settings, np.array([-100.0]), np.array([100.0]), seed=4)
    flock.update_best(np.abs(flock.positions[:, 0] - 1.0))
    v = np.zeros(50)
    for _ in range(5):
        x, leader = flock.positions[:, 0], flock.best[0][0]
        flock.move()
        moved = flock.positions[:, 0]
        away = np.abs(leader - x) > 1e-9
        rand = (moved - x - 0.6 * v)[away] / (leader - x)[away]
        assert ((rand > -1e-9) & (rand < 1 + 1e-9)).all()
        assert rand.std() > 0.1
        v = moved - x
        flock.update_best(np.abs(moved - 1.0))


def test_leader_is_the_best_value_ever_seen() -> None:
    seen: list[float] = []

    def watched(x: FloatArray) -> FloatArray:
        values = distance(x)
        seen.append(float(values.min()))
        return values

    found = pso(watched, [-1] * 4, [1] * 4, iterations=30, seed=2)
    np.testing.assert_array_equal(found.history, np.minimum.accumulate(seen))
    assert found.value == distance(found.position[None])[0] == found.history[-1]
    assert found.evaluations == 31 * 100
    assert not found.stagnated


def test_of_equal_values_the_first_particle_leads() -> None:
    flock = swarm.Swarm(SwarmSettings(particles=20), np.zeros(2), np.ones(2), seed=1)
    values = np.ones(20)
    values[[6, 11, 17]] = 0.5
    flock.update_best(values)
    np.testing.assert_array_equal(flock.best[0], flock.positions[6])


def test_swarm_is_independent_of_particles_that_follow() -> None:
    # the same generator for particle 0 whether 1 or 100 fly: no draw is shared
    few = swarm.Swarm(SwarmSettings(particles=1), np.zeros(3), np.ones(3), seed=5).positions
    many = swarm.Swarm(SwarmSettings(particles=100), np.zeros(3), np.ones(3), seed=5).positions
    np.testing.assert_array_equal(few[0], many[0])


@pytest.mark.parametrize("particles", [1, 7, 8, 9, 100])
def test_bits_are_the_same_on_every_isa(particles: int) -> None:
    settings = SwarmSettings(particles=particles, iterations=40)
    off = np.random.default_rng(0).normal(0, 0.5, (5, 3, 6))
    first, *others = (minimise_eq18(settings, off, np.full(6, 2.0), 9, isa=isa) for isa in ISAS)
    for other in others:
        assert [a.tobytes() for a in other] == [a.tobytes() for a in first]


@pytest.mark.parametrize("threads", [2, 3, 9])
def test_bits_are_the_same_with_any_number_of_threads(threads: int) -> None:
    off = np.random.default_rng(1).normal(0, 0.5, (8, 2, 4))
    alone, shared = (
        minimise_eq18(SwarmSettings(iterations=20), off, np.full(4, 2.0), 9, threads=count)
        for count in (1, threads)
    )
    assert [a.tobytes() for a in shared] == [a.tobytes() for a in alone]


def test_compiled_eq_18_is_the_swarm_on_a_python_callable() -> None:
    correction, history = minimise_eq18(PAPER, AIM[None, None], np.full(4, 1.0), 0)
    slow = pso(distance, [-1] * 4, [1] * 4, seed=0)
    assert slow.position.tobytes() == correction[0].tobytes()
    assert slow.history.tobytes() == history[0].tobytes()


def test_swarms_of_one_seed_differ_by_their_number_and_seeds_differ() -> None:
    off = np.tile(AIM, (3, 1, 1))
    correction, _ = minimise_eq18(PAPER, off, np.full(4, 1.0), 0)
    again, _ = minimise_eq18(PAPER, off, np.full(4, 1.0), 0)
    other, _ = minimise_eq18(PAPER, off, np.full(4, 1.0), 1)
    np.testing.assert_array_equal(correction, again)
    assert len(np.unique(np.concatenate([correction, other]), axis=0)) == 6


def test_minima_are_found() -> None:
    def rosenbrock(x: FloatArray) -> FloatArray:
        valley = 100 * (x[:, 1:] - x[:, :-1] ** 2) ** 2 + (1 - x[:, :-1]) ** 2
        return valley.sum(axis=1)

    def rastrigin(x: FloatArray) -> FloatArray:
        return (10 + x**2 - 10 * np.cos(2 * np.pi * x)).sum(axis=1)

    cases: list[tuple[Callable[[FloatArray], FloatArray], float]] = [
        (rosenbrock, 1.0),
        (rastrigin, 0.0),
    ]
    for objective, at in cases:
        found = pso(objective, [-5.12] * 2, [5.12] * 2, iterations=300, seed=0, **STABLE)
        np.testing.assert_allclose(found.position, at, atol=1e-5)


# --- bounds, stagnation, progress ----------------------------------------------------------------


def test_particles_never_leave_the_bounds_nor_jump_across() -> None:
    low, high = np.array([-1.0, 0.0]), np.array([2.0, 0.5])
    seen: list[FloatArray] = []

    def outside(x: FloatArray) -> FloatArray:  # its minimum is beyond the corner
        seen.append(x)
        return np.asarray((x - [5.0, -5.0]) @ [-1.0, 1.0])

    found = pso(outside, low, high, seed=3)
    np.testing.assert_array_equal(found.position, [2.0, 0.0])
    flown = np.stack(seen)
    assert (flown >= low).all() and (flown <= high).all()
    arrived = (flown[:-1] == high).nonzero()
    assert len(arrived[0])
    # who stops at a bound is there, and not thrown to the other side in the next move
    jumped = (flown[1:] == low)[arrived]
    assert jumped.mean() < 0.05


def test_a_particle_at_a_bound_has_lost_its_velocity() -> None:
    settings = SwarmSettings(particles=64, inertia=1.0, cognitive=0.0, social=4.0)
    flock = swarm.Swarm(settings, np.array([0.0]), np.array([1.0]), seed=0)
    flock.update_best(-flock.positions[:, 0])
    flock.move()
    at_bound = flock.positions[:, 0] == 1.0
    assert at_bound.any()
    leader = flock.best[0][0]
    flock.update_best(np.ones(64))  # nobody leads anew
    flock.move()
    # without velocity only the pull of the leader, which is inside, is left
    pulled = flock.positions[at_bound, 0]
    assert (pulled <= 1.0).all()
    assert (pulled >= np.clip(1.0 + 4.0 * (leader - 1.0), 0, 1) - 1e-12).all()


def test_equal_bounds_hold_a_coordinate() -> None:
    found = pso(lambda x: (x**2).sum(axis=1), [-1, 0.25], [1, 0.25], seed=0, **STABLE)
    np.testing.assert_allclose(found.position, [0.0, 0.25], atol=1e-8)
    assert found.position[1] == 0.25


def test_a_swarm_that_gets_no_better_stops() -> None:
    flat = pso(lambda x: np.ones(len(x)), [-1], [1], patience=10)
    assert flat.stagnated
    assert len(flat.history) == 11
    falling = pso(distance, [-1] * 4, [1] * 4, patience=15, tolerance=1e-6, **STABLE)
    assert falling.stagnated
    assert falling.value < 1e-5
    assert falling.history[-16] - falling.history[-1] <= 1e-6


def test_progress_is_told_every_iteration() -> None:
    told: list[tuple[int, float]] = []
    found = pso(
        distance, [-1] * 4, [1] * 4, iterations=5, progress=lambda k, e: told.append((k, e))
    )
    assert told == list(enumerate(found.history))[1:]


def test_nan_is_never_the_best() -> None:
    def half(x: FloatArray) -> FloatArray:
        return np.where(x[:, 0] > 0, x[:, 0], np.nan)

    found = pso(half, [-1], [1], seed=1)
    assert 0 < found.value < 0.1
    lost = pso(lambda x: np.full(len(x), np.nan), [-1], [1], iterations=2)
    assert lost.value == np.inf


def test_before_any_value_the_first_particle_leads() -> None:
    """And it goes on to lead where no particle ever has a number."""
    low, high = np.array([-1.0, 10.0, 200.0]), np.array([1.0, 20.0, 300.0])
    flock = swarm.Swarm(SwarmSettings(particles=9), low, high, seed=7)
    first = flock.positions[0]
    for _ in range(3):
        leader, value = flock.best
        np.testing.assert_array_equal(leader, first)
        assert value == np.inf
        flock.update_best(np.full(9, np.nan))
        flock.move()


BAD: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({"lower": [0.0, 2.0]}, ValueError, r"lower\[1\] = 2.0 is above upper\[1\] = 1.0"),
    ({"lower": [0.0]}, ValueError, "lower has 1 entries, upper 2"),
    ({"lower": 0.0}, ValueError, "lower must have shape"),
    ({"upper": [1.0, np.inf]}, ValueError, "upper must be finite"),
    ({"upper": ["1", "1"]}, TypeError, "upper must be an array of numbers"),
    ({"particles": 0}, ValueError, "particles"),
    ({"iterations": -1}, ValueError, "iterations"),
    ({"inertia": np.nan}, ValueError, "inertia"),
    ({"social": "1.5"}, TypeError, "social"),
    ({"seed": -1}, ValueError, "seed"),
    ({"seed": 2**64}, ValueError, "seed"),
    ({"patience": 0}, ValueError, "patience"),
    ({"tolerance": -1.0}, ValueError, "tolerance"),
    ({"objective": lambda x: x}, ValueError, r"one value for each of 100 particles"),
    (
        {"objective": lambda x: ["a"] * len(x)},
        TypeError,
        "what objective returns must be an array of numbers",
    ),
]


@pytest.mark.parametrize(("changes", "error", "message"), BAD)
def test_bad_arguments_are_named(
    changes: dict[str, Any], error: type[Exception], message: str
) -> None:
    good = {"objective": lambda x: x.sum(axis=1), "lower": [0.0, 0.0], "upper": [1.0, 1.0]}
    with pytest.raises(error, match=message):
        pso(**{**good, **changes})


def test_the_core_refuses_what_it_cannot_take() -> None:
    struct = library.ffi.new("pkm_swarm *", {"particles": 0, "dims": 2})
    null = library.ffi.NULL
    assert library.lib.pkm_swarm_size(struct) == 0
    assert library.lib.pkm_base_swarm_update_best(struct, null) == library.lib.PKM_BAD_SWARM
    with pytest.raises(ValueError, match="the core refused the call"):
        library.call("swarm_update_best", struct, np.empty(1))
    struct.particles = 8
    state, bounds, found = np.empty(library.lib.pkm_swarm_size(struct)), np.ones(2), np.empty(9)
    for iterations, rows in ((-1, 1), (0, 0), (0, -1)):
        given = (struct, iterations, 0, 0, 1, rows, np.ones(2), -bounds, bounds, state, found, found)
        with pytest.raises(ValueError, match="the core refused the call"):
            library.call("swarm_eq18", *given)


# --- order-2 stability -------------------------------------------------------------------------


def test_constriction_settles_and_the_printed_factors_do_not() -> None:
    """With pBest and gBest held, a particle's variance stays in the one and grows in the other."""

    def spreads(settings: SwarmSettings) -> FloatArray:
        flock = swarm.Swarm(settings, np.array([-1e9]), np.array([1e9]), seed=0)
        flock._x *= 1e-9  # far from the bounds
        values = np.full(settings.particles, 1.0)
        values[0] = 0.0
        flock.update_best(values)
        worse = np.full(settings.particles, 2.0)
        spread: list[float] = []
        for _ in range(150):
            flock.move()
            flock.update_best(worse)
            spread.append(float(np.var(flock.positions)))
        return np.array(spread)

    wide = {"particles": 50_000}
    settled = spreads(SwarmSettings(**{**wide, **STABLE}))
    growing = spreads(SwarmSettings(**wide))
    assert settled[100:].mean() == pytest.approx(settled[50:100].mean(), rel=0.05)
    assert growing[100:].mean() > 1.3 * growing[50:100].mean()
    assert CONSTRICTION.spread_growth < 1 < PAPER.spread_growth


# --- limb residual -----------------------------------------------------------------------------

MACHINES = ("2tpr2tps", "2tpr2tps-spatial", "hexapod", "rbt-6t03p", "rotary-delta", "3rps")


@pytest.mark.parametrize("name", [*MACHINES, "with weights"])
def test_limb_residual_is_that_of_the_plain_twin(name: str) -> None:
    robot = pk.load(name) if name in MACHINES else head_with_a_leg()
    rng = np.random.default_rng(6)
    poses = robot.home + rng.uniform(-1, 1, (40, 6)) * [5, 5, 5, 0.02, 0.02, 0.02]
    q = robot.inverse(poses)
    assert np.isfinite(q).all()
    cost = LimbResidual(robot, poses, q, free=robot.model.free or robot.geometry.names)
    values = cost.nominal + rng.normal(0, 1e-2, (11, len(cost.free)))
    found = cost(values)
    for row in (0, 10):
        model = robot.replace(dict(zip(cost.free, values[row], strict=True))).model
        squares = [closures(model, *pair) ** 2 for pair in zip(poses, q, strict=True)]
        assert found[row] == pytest.approx(np.sqrt(np.mean(squares)), rel=1e-9)


def test_limb_residual_has_the_same_bits_on_every_isa() -> None:
    robot = pk.load("rotary-delta")
    rng = np.random.default_rng(7)
    poses = np.tile(robot.home, (50, 1))
    poses[:, :3] += rng.uniform(-20, 20, (50, 3))
    cost = LimbResidual(robot, poses, robot.inverse(poses))
    values = cost.nominal + rng.normal(0, 0.01, (21, len(cost.free)))
    found = []
    for isa in ISAS:
        robot.machine.isa = isa
        found.append(cost(values).tobytes())
    assert len(set(found)) == 1


def test_tied_numbers_follow_their_parameters() -> None:
    from ..docs.test_readme import DELTA

    robot = pk.load(DELTA / "robot.toml")
    poses = np.tile(robot.home, (5, 1))
    poses[:, 0] += np.arange(5.0)
    q = robot.inverse(poses)
    cost = LimbResidual(robot, poses, q)
    changed = cost.nominal + 0.1 * np.arange(1, 1 + len(cost.free)) / len(cost.free)
    other = robot.replace(dict(zip(cost.free, changed, strict=True)))
    (alone,) = (LimbResidual(other, poses, q, free=cost.free)(changed[None]),)
    np.testing.assert_allclose(cost(changed), alone[0], rtol=1e-12)
    assert cost(changed) > 0.01


def test_a_swarm_over_the_geometry_finds_the_errors_of_a_hexapod() -> None:
    robot = pk.load("hexapod")
    rng = np.random.default_rng(8)
    errors = dict(zip([f"offset{i}" for i in range(1, 7)], rng.normal(0, 0.5, 6), strict=True))
    true = robot.replace(errors)
    q = robot.inverse(hexapod_poses(robot, 20, rng))
    cost = LimbResidual(robot, true.forward(q).pose, q, free=["offset*"])
    found = pso(cost, cost.nominal - 2, cost.nominal + 2, **STABLE)
    np.testing.assert_allclose(found.position, list(errors.values()), atol=1e-4)


def test_limb_residual_names_what_does_not_fit() -> None:
    robot = pk.load("2tpr2tps")
    poses = tilted_poses(robot, 3, np.random.default_rng(9))
    q = with_errors(robot, 0.1, np.random.default_rng(9)).inverse(poses)
    with pytest.raises(ValueError, match="poses must have shape"):
        LimbResidual(robot, poses, q[:2])
    with pytest.raises(ValueError, match="bsae"):
        LimbResidual(robot, poses, q, free=["bsae1.x"])
    with pytest.raises(ValueError, match="values must have shape"):
        LimbResidual(robot, poses, q)(np.zeros((2, 3)))


def test_bounds_that_would_overflow_are_refused() -> None:
    with pytest.raises(ValueError, match=r"within ±1e\+150"):
        pso(distance, np.full(4, -1e308), np.full(4, 1e308))
