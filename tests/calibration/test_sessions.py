"""Sessions: some numbers are found anew in each, all others are common."""

from __future__ import annotations

import dataclasses
import itertools
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.optimize import least_squares

import pkmcal as pk
from pkmcal.arrays import FloatArray
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.measurements import Measurements

from .. import workspaces
from ..simulated import hexapod_poses

NOISE = 0.02
FREE = ["base*.[xy]", "offset*"]
DAYS = ("monday", "thursday", "friday")


def moved(robot: Robot, by: float, rng: np.random.Generator, pattern: str = "offset*") -> Robot:
    """The robot with other numbers of a pattern."""
    names = robot.geometry.match(pattern)
    return robot.replace({n: robot.geometry[n] + rng.normal(0.0, by) for n in names})


def sessions_of(
    trues: list[Robot], robot: Robot, counts: tuple[int, ...], seed: int, kind: str = "position"
) -> list[Measurements]:
    """Measurements of a machine that is another one in each session."""
    rng = np.random.default_rng(1000 + seed)
    sets = []
    for day, true, count in zip(DAYS, trues, counts, strict=False):
        q = robot.inverse(hexapod_poses(robot, count, rng))
        seen = pk.VirtualMachine(true, NOISE, int(rng.integers(2**31))).measure(q, kind)
        sets.append(dataclasses.replace(seen, session=day))
    return sets


def in_one(sets: list[Measurements]) -> Measurements:
    """Sets of one kind as one, with a session a row."""
    return Measurements(
        np.concatenate([m.actuators for m in sets]),
        np.concatenate([m.values for m in sets]),
        sets[0].kind,
        sigma=np.concatenate([m.sigma for m in sets]),
        session=np.concatenate([m.session for m in sets]),
    )


@pytest.fixture(scope="module")
def two(hexapod: Robot) -> tuple[list[Robot], list[Measurements]]:
    rng = np.random.default_rng(4)
    common = moved(hexapod, 0.3, rng, "base*.[xy]")
    trues = [moved(common, 1.0, rng) for _ in range(2)]
    return trues, sessions_of(trues, hexapod, (25, 18), 4)


def test_everything_anew_is_two_calibrations(
    hexapod: Robot, two: tuple[list[Robot], list[Measurements]]
) -> None:
    """No number in common: each session is calibrated as if it were alone."""
    _, sets = two
    free = FREE
    both = pk.identify(hexapod, sets, free, per_session="*")
    for day, measured in zip(DAYS, sets, strict=False):
        alone = pk.identify(hexapod, measured, free)
        mine = [both.free.index(f"{name}@{day}") for name in alone.free]
        np.testing.assert_allclose(both.values[mine], alone.values, atol=1e-6)
        np.testing.assert_allclose(both.stderr[mine], alone.stderr, rtol=1e-5)
        assert both.robot_of(day).geometry["offset2"] == pytest.approx(
            alone.robot.geometry["offset2"], abs=1e-6
        )


def test_a_least_squares_that_knows_no_sessions_agrees(
    hexapod: Robot, two: tuple[list[Robot], list[Measurements]]
) -> None:
    """All numbers in one vector, written out by hand; scipy finds the same."""
    _, sets = two
    found = pk.identify(hexapod, sets, FREE, per_session="offset*")
    base = hexapod.geometry.match("base*.[xy]")
    offsets = hexapod.geometry.match("offset*")
    start = [hexapod.geometry[n] for n in base] + [hexapod.geometry[n] for n in offsets] * 2

    def residual(x: FloatArray) -> FloatArray:
        parts = []
        for s, measured in enumerate(sets):
            own = dict(zip(base, x[:12], strict=True))
            own |= dict(zip(offsets, x[12 + 6 * s : 18 + 6 * s], strict=True))
            seen = hexapod.replace(own).forward(measured.actuators, measured_poses(measured)).pose
            parts.append(((measured.values - seen[:, :3]) / NOISE).ravel())
        return np.concatenate(parts)

    def measured_poses(measured: Measurements) -> FloatArray:
        return hexapod.forward(measured.actuators).pose

    referee = least_squares(residual, start, x_scale=0.1, xtol=1e-12, ftol=1e-14)
    expected = dict(zip(base, referee.x[:12], strict=True))
    for s, day in enumerate(DAYS[:2]):
        own = referee.x[12 + 6 * s : 18 + 6 * s]
        expected |= {f"{n}@{day}": v for n, v in zip(offsets, own, strict=True)}
    assert set(expected) == set(found.free)
    np.testing.assert_allclose(found.values, [expected[n] for n in found.free], atol=2e-5)


def test_a_column_of_sessions_is_the_same_as_several_sets(
    hexapod: Robot, two: tuple[list[Robot], list[Measurements]]
) -> None:
    _, sets = two
    free = FREE
    apart = pk.identify(hexapod, sets, free, per_session="offset*")
    mixed = in_one(sets).select(np.random.default_rng(0).permutation(43))
    together = pk.identify(hexapod, mixed, free, per_session=["offset*"])
    assert set(together.sessions) == set(apart.sessions) == {"monday", "thursday"}
    for name in apart.free:
        i, j = apart.free.index(name), together.free.index(name)
        assert together.values[j] == pytest.approx(apart.values[i], abs=1e-6)


def test_the_robot_is_that_of_the_last_session(
    hexapod: Robot, two: tuple[list[Robot], list[Measurements]]
) -> None:
    trues, sets = two
    found = pk.identify(hexapod, sets, FREE, per_session="offset*")
    assert found.sessions == ("monday", "thursday") and list(found.robots) == [*found.sessions]
    assert found.robot is found.robot_of("thursday")
    for day, true in zip(found.sessions, trues, strict=True):
        mine, place = found.robot_of(day), found.free.index(f"offset5@{day}")
        assert mine.geometry["offset5"] == found.values[place]
        off = found.values[place] - true.geometry["offset5"]
        assert abs(off) < 4.0 * found.stderr[place] < 0.4
        accuracy = found.accuracy(hexapod.home, session=day)
        assert 0 < accuracy < 0.1
    assert found.accuracy(hexapod.home) == found.accuracy(hexapod.home, session="thursday")
    with pytest.raises(ValueError, match="session: expected one of 'monday', 'thursday'; found"):
        found.robot_of("sunday")
    with pytest.raises(ValueError, match="session: expected one of 'monday', 'thursday'; found"):
        found.accuracy(hexapod.home, session="sunday")


def test_rows_at_the_same_actuators_are_other_poses_in_another_session(hexapod: Robot) -> None:
    """The same commands in both sessions; the zeros, an end of 1 mm apart, are found exactly."""
    rng = np.random.default_rng(7)
    q = hexapod.inverse(hexapod_poses(hexapod, 12, rng))
    trues = [hexapod, moved(hexapod, 1.0, rng)]
    sets = [
        Measurements(q, true.forward(q).pose, "pose", session=day)
        for day, true in zip(DAYS, trues, strict=False)
    ]
    found = pk.identify(hexapod, sets, "offset*", per_session="offset*")
    expected = [true.geometry[f"offset{i}"] for true in trues for i in range(1, 7)]
    np.testing.assert_allclose(found.values, expected, atol=1e-6)
    assert found.rms < 1e-6


def test_priors_and_bounds_hold_for_each_sessions_number(
    hexapod: Robot, two: tuple[list[Robot], list[Measurements]]
) -> None:
    _, sets = two
    prior = {"offset*": 2.0, "offset3": 3.0, "offset5@thursday": 4.0}
    bounds = {"offset1": (-9.0, 9.0), "offset2@monday": (-8.0, 8.0)}
    found = pk.identify(hexapod, sets, FREE, per_session="offset*", prior=prior, bounds=bounds)
    sigma = dict(zip(found.free, found.fit.parameters.prior, strict=True))
    assert sigma["offset2@monday"] == sigma["offset2@thursday"] == 2.0
    assert sigma["offset3@monday"] == sigma["offset3@thursday"] == 3.0
    assert (sigma["offset5@monday"], sigma["offset5@thursday"]) == (2.0, 4.0)
    upper = dict(zip(found.free, found.fit.parameters.upper, strict=True))
    assert upper["offset1@monday"] == upper["offset1@thursday"] == 9.0
    assert (upper["offset2@monday"], upper["offset2@thursday"]) == (8.0, np.inf)
    every = pk.identify(hexapod, sets, FREE, per_session="offset*", prior=2.0)
    np.testing.assert_array_equal(every.fit.parameters.prior, 2.0)


def test_sets_without_sessions_are_sessions_of_their_own(
    hexapod: Robot, two: tuple[list[Robot], list[Measurements]]
) -> None:
    _, sets = two
    plain = [dataclasses.replace(m, session=None) for m in sets]
    assert pk.identify(hexapod, plain, FREE, per_session="offset*").sessions == ("1", "2")
    files = [dataclasses.replace(m, file=f"day {k}.csv") for k, m in enumerate(plain)]
    found = pk.identify(hexapod, files, FREE, per_session="offset*")
    assert found.sessions == ("day 0", "day 1") and "offset1@day 1" in found.free
    alike = [dataclasses.replace(m, file="log.csv") for m in plain]
    assert pk.identify(hexapod, alike, FREE, per_session="offset*").sessions == ("1", "2")


@pytest.mark.parametrize(
    ("per_session", "message"),
    [
        ("ofset*", "per_session: no free parameter matches 'ofset\\*'"),
        ("frame.z", "per_session: the numbers of frame are found anew together: 'frame\\.\\*'"),
        (3, "per_session must be a name or several, found 3"),
    ],
)
def test_what_cannot_be_found_anew_is_refused(
    hexapod: Robot,
    two: tuple[list[Robot], list[Measurements]],
    per_session: object,
    message: str,
) -> None:
    with pytest.raises((ValueError, TypeError), match=message):
        pk.identify(
            hexapod, two[1], "offset*", unknown="frame",
            per_session=per_session,  # type: ignore[arg-type]
        )  # fmt: skip


# frames and targets ------------------------------------------------------------------------------


def seen_from(measured: Measurements, frame: FloatArray) -> Measurements:
    """Positions as an instrument reads them in whose frame the base stands at `frame`."""
    motion = pk.screw.from_pose(frame)
    values = measured.values @ motion[:3, :3].T + motion[:3, 3]
    return dataclasses.replace(measured, values=values)


STANDS = np.array([
    [1000.0, -200.0, 300.0, 0.1, -0.2, 2.0],
    [-500.0, 900.0, 100.0, 3.0, 0.3, -1.0],
    [20.0, 30.0, -40.0, -0.4, 1.2, 0.2],
])  # fmt: skip


def three(hexapod: Robot, target: FloatArray) -> tuple[Robot, list[Measurements]]:
    """One machine, an instrument that stood elsewhere on each of three days."""
    rng = np.random.default_rng(2)
    true = moved(hexapod, 0.5, rng)
    sets = []
    for day, frame in zip(DAYS, STANDS, strict=True):
        q = hexapod.inverse(hexapod_poses(hexapod, 15, rng))
        seen = pk.VirtualMachine(true, NOISE, int(rng.integers(2**31))).measure(q, target=target)
        sets.append(seen_from(dataclasses.replace(seen, session=day), frame))
    return true, sets


@pytest.mark.parametrize("how", ["session", "set"])
def test_the_instrument_stood_elsewhere_each_time(hexapod: Robot, how: str) -> None:
    """Frames and a target that all have in common are found without a start near them."""
    place = np.array([30.0, -20.0, 50.0])
    true, sets = three(hexapod, place)
    unplaced = [dataclasses.replace(m, target=[0.0, 0.0, 0.0]) for m in sets]
    held = {"offset1": 0.0}  # a height that frame and target share with the zeros
    free = [f"offset{i}" for i in range(1, 7)]
    found = pk.identify(
        hexapod.replace({n: true.geometry[n] for n in held}), unplaced, free[1:],
        unknown={"frame": "unknown" if how == "session" else ["unknown"] * 3, "target": "unknown"},
        per_session="frame*" if how == "session" else (),
    )  # fmt: skip
    frames = [[f"frame.{c}@{day}" for c in pk_pose()] for day in DAYS]
    assert [*free[1:], *itertools.chain(*frames), "target1.x", "target1.y", "target1.z"] == [
        *found.free
    ]
    for names, frame in zip(frames, STANDS, strict=True):
        mine = [found.free.index(n) for n in names]
        off = (found.values[mine] - frame) / found.stderr[mine]
        assert np.abs(off).max() < 4.0 and (found.stderr[mine] < 0.3).all()
    at = [found.free.index(f"target1.{c}") for c in "xyz"]
    assert np.abs((found.values[at] - place) / found.stderr[at]).max() < 4.0
    assert 0.9 < found.chi2_per_dof < 1.1


def pk_pose() -> tuple[str, ...]:
    return "x", "y", "z", "alpha", "beta", "gamma"


def test_one_word_for_all_frames_is_one_frame(hexapod: Robot) -> None:
    rng = np.random.default_rng(3)
    q = hexapod.inverse(hexapod_poses(hexapod, 20, rng))
    whole = seen_from(pk.VirtualMachine(hexapod, NOISE).measure(q), STANDS[0])
    sets = [whole.select(slice(0, 10)), whole.select(slice(10, 20))]
    found = pk.identify(hexapod, sets, "offset1", unknown="frame")
    assert found.free[1] == "frame.x" and len(found.free) == 7
    apart = pk.identify(hexapod, sets, "offset1", unknown={"frame": ["unknown", "unknown"]})
    assert apart.free[1] == "frame.x@1" and apart.free[7] == "frame.x@2" and len(apart.free) == 13
    one = pk.identify(hexapod, [sets[0], pk.VirtualMachine(hexapod).measure(q)], "offset1",
                      unknown={"frame": ["unknown", "known"]})  # fmt: skip
    assert one.free[1] == "frame.x" and len(one.free) == 7
    with pytest.raises(ValueError, match="frame: one for each set, or per_session one for each"):
        pk.identify(
            hexapod, sets, "offset1", unknown={"frame": ["unknown"] * 2}, per_session="frame*"
        )


def test_a_reflector_that_was_set_down_anew(hexapod: Robot) -> None:
    """The target of each session is found, zeros are common."""
    rng = np.random.default_rng(5)
    places = [np.array([30.0, -20.0, 50.0]), np.array([31.0, -22.0, 50.5])]
    sets = []
    for day, place in zip(DAYS, places, strict=False):
        q = hexapod.inverse(hexapod_poses(hexapod, 15, rng))
        seen = pk.VirtualMachine(hexapod, NOISE, int(rng.integers(2**31))).measure(q, target=place)
        sets.append(dataclasses.replace(seen, session=day, target=[0.0, 0.0, 0.0]))
    for given in (sets, in_one(sets)):
        found = pk.identify(hexapod, given, "offset1", unknown="target", per_session="target*")
        for day, place in zip(DAYS, places, strict=False):
            mine = [found.free.index(f"target1.{c}@{day}") for c in "xyz"]
            assert np.abs((found.values[mine] - place) / found.stderr[mine]).max() < 4.0


def test_the_bootstrap_scatters_each_sessions_numbers(
    hexapod: Robot, two: tuple[list[Robot], list[Measurements]]
) -> None:
    _, sets = two
    found = pk.identify(hexapod, sets, FREE, per_session="offset*")
    drawn = pk.bootstrap(found, 60)
    assert drawn.free == found.free and not drawn.n_failed
    assert (np.abs(drawn.stderr / found.stderr - 1.0) < 0.6).all()


# hold-outs ---------------------------------------------------------------------------------------


def test_a_held_out_session_finds_its_own_zeros_first(
    hexapod: Robot, two: tuple[list[Robot], list[Measurements]]
) -> None:
    trues, (first, second) = two
    free = FREE
    without = pk.identify(hexapod, first, free, holdout=second)
    assert without.holdout_contradicts and without.verdict.state == "doubtful"
    assert "(per_session='offset*') finds such numbers anew" in without.verdict.reasons[1]
    found = pk.identify(hexapod, first, free, holdout=second, per_session="offset*")
    assert not found.holdout_contradicts and found.verdict.state == "calibrated"
    assert found.moved == ()
    assert set(found.holdout_parameters) == {f"offset{i}@thursday" for i in range(1, 7)}
    for i in range(1, 7):
        own = found.holdout_parameters[f"offset{i}@thursday"]
        assert abs(own["value"] - trues[1].geometry[f"offset{i}"]) < 4.0 * own["stderr"]
        assert found.robot_of("thursday").geometry[f"offset{i}"] == own["value"]
    assert found.robot is found.robot_of("monday")
    # the fit itself does not know of the rows held out
    alone = pk.identify(hexapod, first, free, per_session="offset*")
    np.testing.assert_array_equal(found.values, alone.values)


@pytest.mark.filterwarnings("ignore:residuals are")
def test_a_sigma_that_is_too_small_makes_no_number_of_a_held_out_session_surer(
    hexapod: Robot, two: tuple[list[Robot], list[Measurements]]
) -> None:
    """The residuals widen all deviations, those of numbers that the fit has not too."""
    own = []
    for smaller in (1.0, 4.0):
        first, second = (dataclasses.replace(m, sigma=NOISE / smaller) for m in two[1])
        found = pk.identify(hexapod, first, FREE, holdout=second, per_session="offset*")
        own.append([each["stderr"] for each in found.holdout_parameters.values()])
    np.testing.assert_allclose(own[1], own[0], rtol=0.2)


def test_rows_of_a_fitted_session_are_compared_with_its_numbers(
    hexapod: Robot, two: tuple[list[Robot], list[Measurements]]
) -> None:
    _, sets = two
    kept, held = sets[1].split(0.3)
    found = pk.identify(hexapod, [sets[0], kept], FREE, holdout=held, per_session="offset*")
    assert found.holdout_parameters == {} and not found.holdout_contradicts
    drawn = pk.identify(hexapod, sets, FREE, holdout=0.25, per_session="offset*")
    assert drawn.holdout_parameters == {} and not drawn.holdout_contradicts


def test_its_frame_is_found_without_a_start_near_it(hexapod: Robot) -> None:
    true, sets = three(hexapod, np.zeros(3))
    near = hexapod.replace({"offset1": true.geometry["offset1"]})
    free = [f"offset{i}" for i in range(2, 7)]
    found = pk.identify(
        near, sets[:2], free, unknown="frame", per_session="frame*", holdout=sets[2]
    )
    own = found.holdout_parameters
    assert [*own] == [f"frame.{c}@friday" for c in pk_pose()]
    off = [(own[f"frame.{c}@friday"]["value"] - v) / own[f"frame.{c}@friday"]["stderr"]
           for c, v in zip(pk_pose(), STANDS[2], strict=True)]  # fmt: skip
    assert np.abs(off).max() < 4.0 and not found.holdout_contradicts
    assert found.holdout_rms < 2.0 * found.holdout_expected


@pytest.mark.parametrize("prior", [None, {"offset*": 5.0}])
def test_what_moved_is_told_beside_numbers_that_each_session_has_of_its_own(
    hexapod: Robot, prior: dict[str, float] | None
) -> None:
    """The instrument stood elsewhere, which its frame of that day says; and one zero moved."""
    _, sets = three(hexapod, np.zeros(3))
    rng = np.random.default_rng(2)
    later = moved(hexapod, 0.5, rng)  # the same machine
    later = later.replace({"offset3": later.geometry["offset3"] + 1.0})
    q = hexapod.inverse(hexapod_poses(hexapod, 40, rng))
    seen = pk.VirtualMachine(later, NOISE, 7).measure(q)
    held = seen_from(dataclasses.replace(seen, session="friday"), STANDS[2])
    found = pk.identify(
        hexapod, sets[:2], "offset*", unknown="frame", per_session="frame*", holdout=held,
        prior=prior,
    )  # fmt: skip
    assert found.holdout_contradicts and found.moved
    assert found.moved[0].names == ("offset3",)
    assert found.moved[0].shift[0] == pytest.approx(1.0, abs=5 * found.moved[0].stderr[0])


def test_numbers_that_took_every_reading_leave_nothing_to_compare(
    hexapod: Robot, two: tuple[list[Robot], list[Measurements]]
) -> None:
    """Two positions held out, six zeros of their own."""
    _, (first, second) = two
    with pytest.warns(pk.CalibrationWarning, match="nothing is left to compare"):
        found = pk.identify(
            hexapod, first, FREE, holdout=second.select(slice(0, 2)), per_session="offset*"
        )
    assert not found.holdout_contradicts and np.isnan(found.holdout_chance)
    assert np.isnan(found.holdout_expected) and found.verdict.state == "doubtful"


def held_out_runs(hexapod: Robot, runs: int) -> tuple[FloatArray, FloatArray, list[bool]]:
    actual, expected, alarms = [], [], []
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        common = moved(hexapod, 0.3, rng, "base*.[xy]")
        trues = [moved(common, 1.0, rng) for _ in range(2)]
        first, second = sessions_of(trues, hexapod, (30, 8), seed)
        found = pk.identify(hexapod, first, FREE, holdout=second, per_session="offset*")
        actual.append(found.holdout_rms**2)
        expected.append(found.holdout_expected**2)
        alarms.append(found.holdout_contradicts)
    return np.array(actual), np.array(expected), alarms


@pytest.mark.parametrize(
    ("runs", "within"),
    [pytest.param(25, 0.12, id="quick"), pytest.param(300, 0.03, marks=pytest.mark.slow)],
)
def test_they_are_off_by_what_is_expected_beside_their_own_zeros(
    hexapod: Robot, runs: int, within: float
) -> None:
    """Eight positions, six zeros: a quarter of the equations is taken, and counted."""
    actual, expected, alarms = held_out_runs(hexapod, runs)
    assert np.sqrt(actual.mean() / expected.mean()) == pytest.approx(1.0, abs=within)
    assert np.mean(alarms) <= 0.04


# machines whose rows have poses of their own, and arms --------------------------------------------


def a_hexapod_with_noisy_legs(seed: int) -> tuple[Robot, list[Measurements], list[str]]:
    robot, rng = pk.load("hexapod"), np.random.default_rng(seed)
    sets = []
    for day in DAYS[:2]:
        true = moved(robot, 1.0, rng)
        q = robot.inverse(hexapod_poses(robot, 20, rng))
        seen = pk.VirtualMachine(true, NOISE, int(rng.integers(2**31))).measure(q, "pose")
        read = q + rng.normal(0.0, 0.01, q.shape)
        sets.append(dataclasses.replace(seen, actuators=read, actuator_sigma=0.01, session=day))
    return robot, sets, ["offset*", "platform*"]


def an_arm(seed: int) -> tuple[pk.SerialArm, list[Measurements], list[str]]:
    arm, rng = pk.load("3r"), np.random.default_rng(seed)
    assert isinstance(arm, pk.SerialArm)
    sets = []
    for day in DAYS[:2]:
        errors = np.zeros((arm.n_joints, 6))
        errors[[0, 2], 5] = rng.normal(0.0, 1e-3, 2)  # axes 1 and 2 turn alike
        q = rng.uniform(-1.5, 1.5, (15, arm.n_joints))
        machine = pk.VirtualMachine(arm.replace(errors), NOISE, int(rng.integers(2**31)))
        sets.append(dataclasses.replace(machine.measure(q), session=day))
    return arm, sets, ["joint[13].dpsi", "joint2.dx"]


CABLES = np.array([[0, -1597, -120.0], [1550, 900, -120], [-1370, 790, -120], [0, 0, 2355.0]])


@pytest.fixture(scope="module")
def cables(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """A point hung on four cables: one closure more than it has coordinates."""
    path = tmp_path_factory.mktemp("cables") / "cables.toml"
    limbs = "".join(
        f'[[limb]]\nkind = "cable"\nbase = {anchor}\nplatform = [0.0, 0.0, 0.0]\n'
        for anchor in CABLES.tolist()
    )
    path.write_text(
        'name = "cables"\nunits = { length = "mm", angle = "deg" }\n[pose]\n'
        'map = "translation"\nhome = { z = 600.0 }\n' + limbs
    )
    return pk.load(path)


def on_cables(
    robot: Robot, seed: int, rows: tuple[int, ...], unread: int = 0
) -> list[Measurements]:
    """Sessions of a machine whose anchors are its own and whose zeros change; some rows unread."""
    rng = np.random.default_rng(seed)
    anchors, sets = CABLES + rng.normal(0.0, 5.0, (4, 3)), []
    for day, count in zip(DAYS, rows, strict=False):
        zeros = rng.normal(0.0, 5.0, 4)
        at = np.c_[rng.uniform(-500, 500, (count, 2)), rng.uniform(0, 1200, count)]
        lengths = np.linalg.norm(at[:, None] - anchors, axis=2) - zeros
        seen = at + rng.normal(0.0, 0.2, at.shape)
        seen[:unread] = np.nan
        sets.append(Measurements(lengths + rng.normal(0.0, 0.2, lengths.shape), seen, sigma=0.2,
                                 actuator_sigma=0.2, session=day))  # fmt: skip
    return sets


@pytest.mark.parametrize("name", ["noisy legs", "arm", "cables"])
def test_on_every_sort_of_machine_everything_anew_is_two_calibrations(
    name: str, cables: Robot
) -> None:
    robot: Robot | pk.SerialArm
    if name == "cables":
        robot, sets, free = cables, on_cables(cables, 1, (25, 20), unread=5), ["base*", "offset*"]
    else:
        robot, sets, free = (an_arm if name == "arm" else a_hexapod_with_noisy_legs)(1)
    both = pk.identify(robot, sets, free, per_session="*")
    for day, measured in zip(DAYS, sets, strict=False):
        alone = pk.identify(robot, measured, free)
        mine = [both.free.index(f"{n}@{day}") for n in alone.free]
        np.testing.assert_allclose(both.values[mine], alone.values, atol=2e-5 * alone.stderr.max())
        np.testing.assert_allclose(both.stderr[mine], alone.stderr, rtol=0.05)


@pytest.mark.parametrize("name", ["noisy legs", "arm", "cables"])
def test_common_numbers_are_known_better_by_all_sessions(name: str, cables: Robot) -> None:
    """And what is of a session is that of the whole: each is in its interval."""
    robot: Robot | pk.SerialArm
    if name == "cables":
        robot, sets, free = cables, on_cables(cables, 2, (25, 20), unread=5), ["base*", "offset*"]
        own, common = "offset*", "base2.x"
    else:
        robot, sets, free = (an_arm if name == "arm" else a_hexapod_with_noisy_legs)(2)
        own, common = (
            ("joint[13].dpsi", "joint2.dx") if name == "arm" else ("offset*", "platform2.x")
        )
    found = pk.identify(robot, sets, free, per_session=own)
    alone = [pk.identify(robot, measured, free) for measured in sets]
    known = found.parameters[common]["stderr"]
    assert all(known < each.parameters[common]["stderr"] for each in alone)
    assert 0.7 < found.chi2_per_dof < 1.3
    shared = pk.identify(robot, sets[0], free, holdout=sets[1], per_session=own)
    assert not shared.holdout_contradicts and shared.holdout_parameters
    for number, value in shared.holdout_parameters.items():
        together = found.parameters[number]
        assert abs(value["value"] - together["value"]) < 4.0 * value["stderr"]


@pytest.mark.parametrize("anew", ["offset*", "offset2"])
@pytest.mark.parametrize("kind", ["closure", "position"])
def test_rows_that_tell_nothing_leave_a_sessions_numbers_as_they_were(
    tmp_path: Path, anew: str, kind: str
) -> None:
    """Three lengths to a point, nothing else read: any zeros would do."""
    head = 'name = "point"\nunits = { length = "mm", angle = "deg" }\n[pose]\nmap = "translation"\n'
    limbs = "".join(
        f'[[limb]]\nkind = "UPS"\nbase = {anchor}\nplatform = [0, 0, 0]\n'
        for anchor in ([0, -1600, -120], [1550, 900, -120], [-1370, 790, 2350])
    )
    path = tmp_path / "point.toml"
    path.write_text(f"{head}home = {{ z = 600 }}\n{limbs}")
    robot, rng = pk.load(path), np.random.default_rng(0)
    places = np.zeros((30, 6))
    places[:, :3] = rng.uniform([-500, -500, 300], [500, 500, 900], (30, 3))
    q = robot.inverse(places)
    seen = places[:20, :3] + rng.normal(0, NOISE, (20, 3))
    first = Measurements(q[:20], seen, "position", sigma=NOISE, session="monday")
    nothing = None if kind == "closure" else np.full((10, 3), np.nan)
    blind = Measurements(q[20:], nothing, kind, session="friday")  # type: ignore[arg-type]
    found = pk.identify(robot, first, "offset*", per_session=anew, holdout=blind)
    names = robot.geometry.match(anew)
    assert [*found.holdout_parameters] == [f"{name}@friday" for name in names]
    for name in names:
        own = found.holdout_parameters[f"{name}@friday"]
        assert own["value"] == robot.geometry[name] and np.isinf(own["stderr"])


def test_closures_alone_tell_a_session_its_zeros(cables: Robot) -> None:
    """Nothing was read of the second session but the actuators; its zeros follow, in part."""
    first, second = on_cables(cables, 3, (40, 30))
    blind = dataclasses.replace(second, values=np.full_like(second.values, np.nan))
    found = pk.identify(cables, first, ["base*", "offset*"], holdout=blind, per_session="offset*")
    seen = pk.identify(cables, [first, second], ["base*", "offset*"], per_session="offset*")
    assert np.isnan(found.holdout_rms) and len(found.holdout_parameters) == 4
    for name, own in found.holdout_parameters.items():
        assert abs(own["value"] - seen.parameters[name]["value"]) < 4.0 * own["stderr"] < 20.0


# as good as the Cramér-Rao bound -----------------------------------------------------------------

SIGMA = 0.5  # mm: errors of the numbers, and the prior
LIMIT = {  # what is measured, and at how many poses in each of three sessions
    "rotary-delta": ("position", (25, 20, 15)),
    "hexapod": ("pose", (20, 15, 12)),
}
QUICK = pytest.param(12, 0.12, (0.91, 0.98), id="quick")
FULL = pytest.param(200, 0.05, (0.93, 0.97), id="200 runs", marks=pytest.mark.slow)


def bound(trues: list[Robot], robot: Robot, sets: list[Measurements]) -> FloatArray:
    """Least variances that measurements and prior allow: common numbers, then offsets by session.

    In mm; angles as their arc.
    """
    names = robot.geometry.match(robot.model.free)
    common = [n for n in names if not n.startswith("offset")]
    own = [n for n in names if n.startswith("offset")]

    def jacobian(true: Robot, measured: Measurements, chosen: list[str]) -> FloatArray:
        places = [true.geometry.names.index(n) for n in chosen]
        units = np.array([str(true.geometry.units[i]) for i in places])
        pose = true.forward(measured.actuators).pose
        twists = true.error_jacobian(pose, measured.actuators)[:, : len(measured.components)]
        weights = 1.0 / np.asarray(measured.sigma)
        scaled = twists[:, :, places] * np.where(units == "rad", 1.0 / true.length, 1.0)
        return (weights[:, :, None] * scaled).reshape(-1, len(chosen))

    pairs = list(zip(trues, sets, strict=True))
    rows = np.hstack([
        np.vstack([jacobian(true, measured, common) for true, measured in pairs]),
        block_diag(*[jacobian(true, measured, own) for true, measured in pairs]),
    ])  # fmt: skip
    return np.diagonal(np.linalg.inv(rows.T @ rows + np.eye(rows.shape[1]) / SIGMA**2))


@pytest.mark.filterwarnings("ignore:the measurements contradict the prior")  # by chance
@pytest.mark.parametrize(("runs", "within", "covered"), [QUICK, FULL])
@pytest.mark.parametrize("name", LIMIT)
def test_as_good_as_the_cramer_rao_bound_in_each_session_and_honest(
    name: str, runs: int, within: float, covered: tuple[float, float]
) -> None:
    robot = pk.load(name)
    kind, counts = LIMIT[name]
    of_common, of_own, inside = [], [], []
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        names = robot.geometry.match(robot.model.free)
        units = {n: str(robot.geometry.units[robot.geometry.names.index(n)]) for n in names}
        arc = {n: robot.length if units[n] == "rad" else 1.0 for n in names}
        zeros = [n for n in names if n.startswith("offset")]
        base = {n: robot.geometry[n] + rng.normal(0.0, SIGMA) / arc[n] for n in names}
        trues = [
            robot.replace(
                base | {n: robot.geometry[n] + rng.normal(0.0, SIGMA) / arc[n] for n in zeros}
            )
            for _ in counts
        ]
        sets = []
        for day, true, count in zip(DAYS, trues, counts, strict=True):
            at = workspaces.poses(name, count, int(rng.integers(2**32)))
            machine = pk.VirtualMachine(true, NOISE, int(rng.integers(2**31)))
            seen = machine.measure(robot.inverse(at), kind)
            sets.append(dataclasses.replace(seen, session=day))
        found = pk.identify(robot, sets, prior=SIGMA, per_session="offset*")
        least = bound(trues, robot, sets)
        common = [n for n in names if n not in zeros]
        order = [*common, *(f"{n}@{day}" for day in DAYS for n in zeros)]
        truth = [base[n] for n in common] + [t.geometry[n] for t in trues for n in zeros]
        mine = [found.free.index(n) for n in order]
        scale = np.array([arc[n.partition("@")[0]] for n in order])
        off = (found.values[mine] - truth) * scale
        ratio = off**2 / least
        of_common.append(ratio[: len(common)].mean())
        of_own.append(ratio[len(common) :].mean())
        inside.append(np.abs(off) < 1.96 * found.stderr[mine] * scale)
    assert np.sqrt(np.mean(of_common)) == pytest.approx(1.0, abs=within)
    assert np.sqrt(np.mean(of_own)) == pytest.approx(1.0, abs=within)
    assert covered[0] <= np.mean(inside) <= covered[1]


def test_sizes_of_what_moved_allow_for_smaller_shifts_beside_it(hexapod: pk.Robot) -> None:
    """One leg slipped far, all the others a little: each interval holds what that leg did."""
    names = hexapod.geometry.match("offset*")
    inside = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        sets = []
        for slips in (np.zeros(6), np.array([0.06, -0.05, 0.04, -0.06, 1.5, 0.4])):
            true = hexapod.replace(dict(zip(names, slips, strict=True)))
            q = hexapod.inverse(hexapod_poses(hexapod, 60, rng))
            seen = true.forward(q).pose[:, :3]
            sets.append(pk.Measurements(q, seen + rng.normal(0, 0.02, seen.shape), sigma=0.02))
        found = pk.identify(hexapod, sets[0], "offset*", holdout=sets[1])
        moved = {each.names[0]: each for each in found.moved if len(each.names) == 1}
        for name, size in (("offset5", 1.5), ("offset6", 0.4)):
            assert name in moved
            inside.append(abs(moved[name].shift[0] - size) < 2.0 * moved[name].stderr[0])
    assert np.mean(inside) > 0.8
