"""Every row has a pose of its own: against all poses as unknowns, and what is stated of it."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import scipy.stats
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import pkmcal as pk

ANCHORS = np.array([[0, -1597, -120.0], [1550, 900, -120], [-1370, 790, -120], [0, 0, 2355.0]])
NOISE = 0.5  # mm, of cables and of the camera
Kind = str  # which of the positions were read


@pytest.fixture(scope="module")
def cables(tmp_path_factory: pytest.TempPathFactory) -> pk.Robot:
    """A point hung on four cables: one more than it has coordinates."""
    limbs = "".join(
        f'[[limb]]\nkind = "UPS"\nbase = {anchor.tolist()}\nplatform = [0.0, 0.0, 0.0]\n'
        for anchor in ANCHORS
    )
    path: Path = tmp_path_factory.mktemp("cables") / "cables.toml"
    path.write_text(
        'name = "cables"\nunits = { length = "mm", angle = "deg" }\n'
        '[pose]\nmap = "translation"\nhome = { z = 600.0 }\n'
        '[calibration]\nfree = ["base*", "offset*"]\n' + limbs
    )
    return pk.load(path)


class Simulated(NamedTuple):
    lengths: np.ndarray
    read: np.ndarray  # positions, NaN where nobody looked
    true: dict[str, float]
    elsewhere: tuple[np.ndarray, np.ndarray]  # positions and the lengths that lead there


def simulated(seed: int, rows: int, kind: Kind) -> Simulated:
    rng = np.random.default_rng(seed)
    anchors, offset = ANCHORS + rng.normal(0, 20, (4, 3)), rng.normal(0, 20, 4)
    at = np.c_[rng.uniform(-500, 500, (rows, 2)), rng.uniform(0, 1200, rows)]
    lengths = np.linalg.norm(at[:, None] - anchors, axis=2) - offset
    lengths += rng.normal(0, NOISE, lengths.shape)
    seen = at + rng.normal(0, NOISE, at.shape)
    has = np.zeros((rows, 3), dtype=bool)
    third = rows // 3
    if kind == "all":
        has[:] = True
    if kind in ("third", "mixed"):
        has[:third] = True
    if kind == "mixed":
        has[third : 2 * third, 2] = True
    if kind == "heights":
        has[:, 2] = True
    true = {f"base{i + 1}.{c}": anchors[i, k] for i in range(4) for k, c in enumerate("xyz")}
    true |= {f"offset{i + 1}": offset[i] for i in range(4)}
    there = np.c_[rng.uniform(-500, 500, (200, 2)), rng.uniform(0, 1200, 200)]
    needed = np.linalg.norm(there[:, None] - anchors, axis=2) - offset
    return Simulated(lengths, np.where(has, seen, np.nan), true, (there, needed))


def measured(drawn: Simulated, **changes: object) -> pk.Measurements:
    given: dict[str, object] = {"sigma": NOISE, "actuator_sigma": NOISE} | changes
    return pk.Measurements(drawn.lengths, drawn.read, "position", **given)  # type: ignore[arg-type]


def dense(
    drawn: Simulated, sigma_lengths: float | np.ndarray
) -> tuple[np.ndarray, float, np.ndarray]:
    """Parameters, χ² and covariance with all positions among the unknowns of one least squares."""
    rows = len(drawn.lengths)
    has = np.isfinite(drawn.read)

    def residual(unknowns: np.ndarray) -> np.ndarray:
        anchors, offset = unknowns[:12].reshape(4, 3), unknowns[12:16]
        at = unknowns[16:].reshape(rows, 3)
        closed = np.linalg.norm(at[:, None] - anchors, axis=2) - offset - drawn.lengths
        return np.concatenate([closed.ravel() / sigma_lengths, (at - drawn.read)[has] / NOISE])

    start = np.concatenate([ANCHORS.ravel(), np.zeros(4), np.zeros(3 * rows)])
    there = least_squares(
        lambda x: (
            np.linalg.norm(x.reshape(rows, 1, 3) - ANCHORS, axis=2).ravel() - drawn.lengths.ravel()
        ),
        np.tile([0.0, 0.0, 600.0], rows),
    ).x
    start[16:] = there
    found = least_squares(
        residual, start, "3-point", x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15
    )
    covariance = np.linalg.pinv(found.jac.T @ found.jac)[:16, :16]
    return found.x[:16], 2.0 * found.cost, covariance


ORDER = tuple(f"base{i}.{c}" for i in range(1, 5) for c in "xyz") + tuple(
    f"offset{i}" for i in range(1, 5)
)


@pytest.mark.filterwarnings("ignore:residuals are")  # 0.05 mm is less than they scatter
@pytest.mark.parametrize("kind", ["all", "third", "mixed"])
@pytest.mark.parametrize("sigma", [NOISE, 0.05])
def test_it_is_the_least_squares_with_all_poses_among_the_unknowns(
    cables: pk.Robot, kind: Kind, sigma: float
) -> None:
    drawn = simulated(3, 24, kind)
    found = pk.identify(cables, measured(drawn, actuator_sigma=sigma), ORDER)
    values, chi2, covariance = dense(drawn, sigma)
    deviation = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose((found.values - values) / deviation, 0.0, atol=1e-4)
    # a stated deviation that the residuals refute is scaled by the Birge ratio
    refuted = scipy.stats.chi2.sf(chi2, found.dof) < 0.1
    birge = np.sqrt(chi2 / found.dof) if refuted else 1.0
    assert refuted or sigma == NOISE
    np.testing.assert_allclose(found.stderr, birge * deviation, rtol=1e-4)
    assert found.chi2_per_dof * found.dof == pytest.approx(chi2, rel=1e-8)
    assert found.dof == 4 * 24 + np.isfinite(drawn.read).sum() - 3 * 24 - 16


@pytest.mark.parametrize(
    ("kind", "rank", "cost"),
    [("third", 16, 47.04958164), ("heights", 13, 39.94758765), ("none", 10, 20.55276245)],
)
def test_rank_and_cost_of_a_reference_computed_elsewhere(
    cables: pk.Robot, kind: Kind, rank: int, cost: float
) -> None:
    """An independent elimination in NumPy gave these digits for the same draws."""
    found = pk.identify(cables, measured(simulated(0, 60, kind)))
    assert found.rank == rank
    assert 0.5 * found.chi2_per_dof * found.dof == pytest.approx(cost, abs=2e-8)


READ = pytest.mark.parametrize(("kind", "rows"), [("all", 30), ("third", 60), ("mixed", 60)])


@READ
def test_intervals_of_a_redundant_machine_cover_and_it_goes_where_it_says(
    cables: pk.Robot, kind: Kind, rows: int
) -> None:
    off, covered = compared(cables, kind, rows, 12)
    assert off <= 0.29  # mm; from the readings alone it is 0.60
    assert 0.90 <= covered <= 0.99  # of 192 that are not independent


@pytest.mark.slow
@READ
def test_intervals_of_many_machines_cover_what_they_say(
    cables: pk.Robot, kind: Kind, rows: int
) -> None:
    off, covered = compared(cables, kind, rows, 200)
    print(f"{kind}: cables elsewhere {off:.3f} mm off, 95 % intervals hold {covered:.3f}")
    assert off <= 0.29 and 0.93 <= covered <= 0.97


def compared(cables: pk.Robot, kind: Kind, rows: int, machines: int) -> tuple[float, float]:
    """How far cables are off at other poses, rms in mm, and the share of intervals that hold."""
    off, covered = [], []
    for seed in range(machines):
        drawn = simulated(seed, rows, kind)
        found = pk.identify(cables, measured(drawn))
        true = np.array([drawn.true[name] for name in found.free])
        low, high = found.interval95.T
        covered.append((low < true) & (true < high))
        at, needed = drawn.elsewhere
        asked = found.robot.inverse(np.c_[at, np.zeros((len(at), 3))])
        off.append(np.sqrt(np.mean((asked - needed) ** 2)))
    return float(np.mean(off)), float(np.mean(covered))


def test_noise_of_cables_and_of_the_camera_is_told_apart(cables: pk.Robot) -> None:
    """Variances estimated from residuals are unbiased: their mean over machines is the truth."""
    estimated = []
    for seed in range(12):
        drawn = simulated(seed, 60, "all")
        more = np.random.default_rng(100 + seed).normal(0, 0.5, drawn.lengths.shape)
        drawn = drawn._replace(lengths=drawn.lengths + more)
        found = pk.identify(cables, measured(drawn, sigma=None, actuator_sigma=None))
        assert found.converged and np.isnan(found.chi2_per_dof)
        assert sum(found.redundancy) == pytest.approx(found.dof)
        estimated.append([found.noise[0], found.actuator_noise])
    camera, actuators = np.sqrt(np.mean(np.square(estimated), axis=0))
    assert camera == pytest.approx(NOISE, rel=0.15)
    assert actuators == pytest.approx(np.hypot(NOISE, 0.5), rel=0.1)


# machines with as many closures as coordinates ----------------------------------------------------


def hexapod_drawn(robot: pk.Robot, noise: float) -> tuple[np.ndarray, pk.Measurements]:
    rng = np.random.default_rng(7)
    values = robot.geometry.values.copy()
    lengths = np.array([unit == "mm" for unit in robot.geometry.units])
    values[lengths] += rng.normal(0, 0.3, int(lengths.sum()))
    true = robot.replace(values)
    q = robot.inverse(pk.sample_poses(robot, 16))
    read = pk.VirtualMachine(true, noise=0.02, seed=1).measure(
        q + rng.normal(0, noise, q.shape), "pose"
    )
    return q, pk.Measurements(q, read.values, "pose", sigma=read.sigma)


FREE = ("offset*", "base1.x", "base3.y", "platform2.z")


@pytest.mark.parametrize("name", ["hexapod", "linear-delta-6", "3rps", "2tpr2tps-spatial"])
def test_actuators_without_noise_are_what_they_were(name: str) -> None:
    robot = pk.load(name)
    q = robot.inverse(robot.complete(pk.sample_poses(robot, 30)) if robot.model.match else
                      pk.sample_poses(robot, 30))  # fmt: skip
    free = "offset*"
    true = robot.replace({"offset1": robot.geometry["offset1"] + 0.4})
    q = q[true.forward(q).ok & robot.forward(q).ok]
    m = pk.VirtualMachine(true, noise=0.02, seed=2).measure(q, "position", target=[50, 20, 30])
    plain = pk.identify(robot, m, free)
    given = {name: getattr(m, name) for name in ("sigma", "target")}
    zero = pk.identify(robot, pk.Measurements(q, m.values, **given, actuator_sigma=0.0), free)
    tiny = pk.identify(robot, pk.Measurements(q, m.values, **given, actuator_sigma=1e-7), free)
    np.testing.assert_array_equal(zero.values, plain.values)
    np.testing.assert_array_equal(zero.stderr, plain.stderr)
    np.testing.assert_allclose(tiny.values, plain.values, atol=1e-7)
    np.testing.assert_allclose(tiny.stderr, plain.stderr, rtol=1e-8)
    assert tiny.dof == plain.dof


def test_noisy_actuators_of_a_hexapod_are_unknowns_like_its_poses() -> None:
    robot = pk.load("hexapod")
    q, m = hexapod_drawn(robot, 0.05)
    found = pk.identify(robot, pk.Measurements(q, m.values, "pose", sigma=m.sigma,
                                               actuator_sigma=0.05), FREE)  # fmt: skip
    names = found.free
    start = robot.geometry.values.copy()
    places = [robot.geometry.names.index(name) for name in names]
    base = [[robot.geometry.names.index(f"base{i}.{c}") for c in "xyz"] for i in range(1, 7)]
    plate = [[robot.geometry.names.index(f"platform{i}.{c}") for c in "xyz"] for i in range(1, 7)]
    offset = [robot.geometry.names.index(f"offset{i}") for i in range(1, 7)]
    turned = Rotation.from_euler("ZYX", m.values[:, [5, 4, 3]])

    def residual(unknowns: np.ndarray) -> np.ndarray:
        values = start.copy()
        values[places] = unknowns[: len(places)]
        own = unknowns[len(places) :].reshape(-1, 6)
        turn = Rotation.from_rotvec(own[:, 3:]) * turned
        joints = np.einsum("nij,kj->nki", turn.as_matrix(), values[plate]) + own[:, None, :3]
        legs = np.linalg.norm(joints - values[base], axis=2) - values[offset]
        read = np.hstack([own[:, :3] - m.values[:, :3], own[:, 3:]]) / m.sigma
        return np.concatenate([((legs - q) / 0.05).ravel(), read.ravel()])

    first = np.concatenate([
        start[places],
        np.hstack([m.values[:, :3], np.zeros((len(q), 3))]).ravel(),
    ])  # fmt: skip
    best = least_squares(
        residual, first, "3-point", x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15
    )
    deviation = np.sqrt(np.diag(np.linalg.pinv(best.jac.T @ best.jac)))[: len(places)]
    np.testing.assert_allclose((found.values - best.x[: len(places)]) / deviation, 0.0, atol=1e-3)
    widened = found.fit.uncertainty.covariance.scale
    if scipy.stats.chi2.sf(2.0 * best.cost, found.dof) > 0.1:
        assert widened == 1.0
    np.testing.assert_allclose(found.stderr, widened * deviation, rtol=1e-3)
    assert found.chi2_per_dof * found.dof == pytest.approx(2.0 * best.cost, rel=1e-6)
    assert found.dof == 6 * 16 - len(names)


@pytest.mark.filterwarnings(
    "ignore:residuals are"
)  # where the noise of the actuators is not stated
def test_stated_actuator_noise_makes_the_stated_deviations_true() -> None:
    robot = pk.load("hexapod")
    z: dict[bool, list[np.ndarray]] = {True: [], False: []}
    rng = np.random.default_rng(11)
    q = robot.inverse(pk.sample_poses(robot, 30))
    for _ in range(8):
        shifts = {f"offset{i}": float(x) for i, x in enumerate(rng.normal(0, 0.3, 6), 1)}
        true = robot.replace(shifts)
        there = true.forward(q + rng.normal(0, 0.05, q.shape))
        values = there.pose[:, :3] + rng.normal(0, 0.01, (len(q), 3))
        for stated in z:
            m = pk.Measurements(q, values, sigma=0.01, actuator_sigma=0.05 if stated else None)
            found = pk.identify(robot, m, "offset*")
            want = np.array([shifts[name] for name in found.free])
            widened = found.fit.uncertainty.covariance.scale  # where sigma alone is refuted
            z[stated].append((found.values - want) / found.stderr * widened)
    assert 0.75 <= np.sqrt(np.mean(np.square(z[True]))) <= 1.3
    assert np.sqrt(np.mean(np.square(z[False]))) > 2.0  # their noise taken for the camera's


def test_arms_with_noisy_joints_state_true_deviations() -> None:
    arm = pk.load("3r")
    rng = np.random.default_rng(5)
    theta = rng.uniform(-1.2, 1.2, (40, 3))
    noise = np.array([2e-4, 1e-4, 0.0])  # the third joint's encoder is perfect
    free = ("joint2.dx", "joint2.dy", "joint3.dphi")
    z = []
    for _ in range(10):
        errors = arm.joint_errors.copy()
        errors[1, :2] += rng.normal(0, 0.3, 2)
        errors[2, 3] += rng.normal(0, 1e-3)
        true = arm.replace(errors)
        there = pk.VirtualMachine(true, noise=0).measure(theta + rng.normal(0, 1, (40, 3)) * noise)
        read = there.values + rng.normal(0, 0.01, (40, 3))
        m = pk.Measurements(theta, read, sigma=0.01, actuator_sigma=noise)
        found = pk.identify(arm, m, free)
        z.append((found.values - [errors[1, 0], errors[1, 1], errors[2, 3]]) / found.stderr)
        assert found.dof == 3 * 40 - 3
    assert 0.6 <= np.sqrt(np.mean(np.square(z))) <= 1.5


# what was read, and what was not ------------------------------------------------------------------


def test_rows_that_say_nothing_are_counted_and_change_nothing() -> None:
    robot = pk.load("linear-delta")
    true = robot.replace({"offset1": robot.geometry["offset1"] + 0.3})
    q = robot.inverse(pk.sample_poses(robot, 20))
    whole = pk.VirtualMachine(true, noise=0.02, seed=3).measure(q, "position")
    values = whole.values.copy()
    values[[2, 5, 11]] = np.nan
    values[[3, 4], :2] = np.nan  # heights alone
    some = pk.Measurements(q, values, sigma=0.02)
    found = pk.identify(robot, some, "offset*")
    assert found.idle == 3 and "3 poses add nothing" in str(found)
    assert found.rows.tolist() == [i for i in range(20) if i not in (2, 5, 11)]
    assert found.dof == 3 * 17 - 4 - 3
    read = [i for i in range(20) if i not in (2, 3, 4, 5, 11)]
    heights = pk.Measurements(q[[3, 4]], values[[3, 4], 2], "height", sigma=0.02)
    apart = pk.identify(
        robot, [pk.Measurements(q[read], values[read], sigma=0.02), heights], "offset*"
    )
    np.testing.assert_allclose(found.values, apart.values, atol=1e-9)
    np.testing.assert_allclose(found.stderr, apart.stderr, rtol=1e-9)


def test_actuators_alone_say_nothing_of_a_machine_whose_closures_always_hold() -> None:
    robot = pk.load("hexapod")
    alone = pk.Measurements(robot.inverse(pk.sample_poses(robot, 9)), None, "closure")
    with pytest.raises(ValueError, match="nothing was read but the actuators"):
        pk.identify(robot, alone, "offset*")


def test_an_actuator_that_is_never_wrong_is_met_exactly(cables: pk.Robot) -> None:
    drawn = simulated(5, 24, "third")
    sigma = np.array([NOISE, NOISE, 0.0, NOISE])
    found = pk.identify(cables, measured(drawn, actuator_sigma=sigma), ORDER)
    heavy = np.tile(np.where(sigma > 0, sigma, 1e-5 * NOISE), len(drawn.lengths))
    values, _, covariance = dense(drawn, heavy)
    deviation = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose((found.values - values) / deviation, 0.0, atol=1e-3)
    at = found.fit.estimate.evaluation
    assert isinstance(found.robot, pk.Robot)
    needed = found.robot.inverse(at.pose) - at.actuators
    assert np.abs(needed[:, 2]).max() < 1e-9 < 0.1 < np.abs(needed[:, 3]).max()


@pytest.mark.parametrize(
    ("rows", "whose"), [(4, "measurements 1"), (8, "measurements 1 and of the actuators")]
)
@pytest.mark.filterwarnings("ignore:14 equations for 16 parameters")
def test_whose_noise_too_little_is_left_over_to_tell_is_named(
    cables: pk.Robot, rows: int, whose: str
) -> None:
    """One of four positions, whose point is a pose's; with all anchors free nothing at all."""
    log = measured(simulated(0, rows, "third"), sigma=None, actuator_sigma=None)
    with pytest.warns(pk.CalibrationWarning, match=f"estimate the noise of {whose}: state sigma"):
        found = pk.identify(cables, log, "offset*" if rows == 4 else None)
    assert np.isinf(found.stderr).all() and found.verdict.state == "doubtful"


def test_actuators_that_are_never_wrong_cannot_be_as_many_as_the_ways_to_move(
    cables: pk.Robot,
) -> None:
    for sigma in (0.0, np.array([0.0, 0.0, 0.0, NOISE])):
        with pytest.raises(ValueError, match="at most 2 actuators that are never wrong"):
            pk.identify(cables, measured(simulated(0, 12, "all"), actuator_sigma=sigma))
    with pytest.raises(ValueError, match="actuator_sigma must be positive, or None"):
        pk.identify(cables, measured(simulated(0, 12, "all"), actuator_sigma=0.0))
    at_some = [NOISE, 0.0, NOISE, NOISE], NOISE  # in one set and not in the other
    sets = [measured(simulated(i, 12, "all"), actuator_sigma=at_some[i]) for i in (0, 1)]
    with pytest.raises(ValueError, match="0 at all rows for"):
        pk.identify(cables, sets)
    stated = measured(simulated(0, 12, "all"))
    with pytest.raises(ValueError, match="state actuator_sigma of all sets, or of none"):
        pk.identify(cables, [stated, measured(simulated(1, 12, "all"), actuator_sigma=None)])


@pytest.mark.parametrize(
    ("kind", "free", "told"),
    [
        (
            "none",
            ("base*", "offset*"),
            ["moved along x, y and z and turned about x, y and z", "mirror"],
        ),
        ("heights", ("base*", "offset*"), ["moved along x and y and turned about z", "mirror"]),
        ("none", ("base*", "offset*", "gain*"), ["moved along", "common scale", "mirror"]),
        ("third", ("base*", "offset*"), []),
    ],
)
def test_what_self_calibration_leaves_open_is_named(
    cables: pk.Robot, kind: Kind, free: tuple[str, ...], told: list[str]
) -> None:
    found = pk.identify(cables, measured(simulated(2, 60, kind)), free)
    assert len(found.gauges) == len(told)
    for text, words in zip(found.gauges, told, strict=True):
        assert words in text and words in str(found)
    assert found.unidentifiable == ()  # nothing else is
    assert (found.rank < len(found.free)) == bool(told)


@pytest.mark.parametrize(("kind", "said"), [
    ("all", "from 60 measured points\n"),
    ("third", "from 20 measured points and 40 rows where only actuators were read\n"),
    ("mixed", "from 40 measured points and 20 rows where only actuators were read\n"),
    ("none", "from 60 rows\n"),
])  # fmt: skip
def test_points_are_counted_where_something_was_read(
    cables: pk.Robot, kind: Kind, said: str
) -> None:
    found = pk.identify(cables, measured(simulated(0, 60, kind)))
    assert said in found.summary()
    if kind != "none":
        points = said.split()[1]
        fitted = [*found.verdict.reasons, str(found.verdict)]
        assert all(f"{points} fitted" in text for text in fitted if " fitted point" in text)
        assert sum(" fitted point" in text for text in fitted) > 0


def test_points_held_out_are_missed_as_expected(cables: pk.Robot) -> None:
    off, expected = [], []
    for seed in range(6):
        found = pk.identify(cables, measured(simulated(seed, 60, "all")), holdout=0.4)
        off.append(found.holdout_rms)
        expected.append(found.holdout_expected)
    assert np.mean(off) == pytest.approx(np.mean(expected), rel=0.1)


@pytest.mark.parametrize("repeats", [1, 6])
def test_what_actuators_add_to_points_held_out_is_shared_by_repeats(
    cables: pk.Robot, repeats: int
) -> None:
    """An instrument ten times as good as the lengths: 3 errors a pose, read however often."""
    drawn, rng = simulated(0, 60, "all"), np.random.default_rng(0)
    places, needed = drawn.elsewhere
    lengths = np.repeat(needed[:8] + rng.normal(0, NOISE, (8, 4)), repeats, axis=0)
    seen = np.repeat(places[:8], repeats, axis=0)
    seen += rng.normal(0, NOISE / 10, seen.shape)
    held = measured(drawn._replace(lengths=lengths, read=seen), sigma=NOISE / 10)
    test = pk.identify(cables, measured(drawn), holdout=held).holdout_test
    assert test is not None
    assert 0.9 * 24 < test.freedom[0] <= 24


def test_spoilt_cables_are_named_row_by_row(cables: pk.Robot) -> None:
    drawn = simulated(4, 60, "all")
    lengths = drawn.lengths.copy()
    lengths[[7, 30, 51], [0, 2, 1]] += [25.0, -18.0, 30.0]
    for loss in ("huber", "cauchy"):
        found = pk.identify(cables, measured(drawn._replace(lengths=lengths)), loss=loss)
        assert found.outliers == (7, 30, 51)
        true = np.array([drawn.true[name] for name in found.free])
        assert np.sqrt(np.mean(((found.values - true) / found.stderr) ** 2)) < 2.0


def test_limbs_are_fitted_beyond_twelve(tmp_path: Path) -> None:
    rng = np.random.default_rng(8)
    anchors = rng.normal([0, 0, 500], 1000, (24, 3))
    limbs = "".join(
        f'[[limb]]\nkind = "cable"\nbase = {anchor.tolist()}\nplatform = [0.0, 0.0, 0.0]\n'
        for anchor in anchors
    )
    path = tmp_path / "many.toml"
    path.write_text(
        'name = "many"\nunits = { length = "mm", angle = "deg" }\n'
        '[pose]\nmap = "translation"\nhome = { z = 10.0 }\n'
        '[calibration]\nfree = ["offset*"]\n' + limbs
    )
    robot = pk.load(path)
    offset = rng.normal(0, 5, 24)
    at = rng.uniform(-300, 300, (30, 3))
    lengths = np.linalg.norm(at[:, None] - anchors, axis=2) - offset + rng.normal(0, 0.1, (30, 24))
    found = pk.identify(robot, pk.Measurements(lengths, None, "closure", actuator_sigma=0.1))
    assert found.rank == 24 and found.dof == 30 * 21 - 24
    assert np.sqrt(np.mean(((found.values - offset) / found.stderr) ** 2)) < 1.6


@pytest.mark.parametrize(("kind", "stated"), [("third", False), ("mixed", True), ("none", True)])
def test_replicates_scatter_as_the_covariance_says(
    cables: pk.Robot, kind: Kind, stated: bool
) -> None:
    drawn = simulated(6, 60, kind)
    free = ORDER if kind != "none" else ("base*", "offset4")
    noise = NOISE if stated else None
    found = pk.identify(cables, measured(drawn, sigma=noise, actuator_sigma=noise), free)
    again = pk.bootstrap(found, 60)
    finite = np.isfinite(found.stderr)
    assert again.n_failed == 0 and (finite.all() or kind == "none")
    if finite.any():
        ratio = again.stderr[finite] / found.stderr[finite]
        assert np.sqrt(np.mean(ratio**2)) == pytest.approx(1.0, abs=0.2)
    assert np.isinf(again.stderr[~finite]).all()


def test_replicates_of_a_machine_with_noisy_actuators_scatter_as_the_covariance_says() -> None:
    robot = pk.load("hexapod")
    q, m = hexapod_drawn(robot, 0.05)
    noisy = pk.Measurements(q, m.values, "pose", sigma=m.sigma, actuator_sigma=0.05)
    found = pk.identify(robot, noisy, FREE)
    again = pk.bootstrap(found, 60)
    ratio = again.stderr / found.stderr
    assert again.n_failed == 0
    assert np.sqrt(np.mean(ratio**2)) == pytest.approx(1.0, abs=0.2)
