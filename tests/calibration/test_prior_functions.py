"""Priors on functions of numbers, against one dense least squares written out here."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

import pkmcal as pk
from pkmcal.jobs.geometry_options import read_prior

ANCHORS = np.array([[0.0, 0], [3000, 0], [0, 2000], [3000, 2000]])
FREE = ("base2.x", "base3.x", "base3.y", "base4.x", "base4.y", "gain1", "gain2", "gain3", "gain4")
NOISE, TAPE, ALIKE = 0.3, 1.0, 2e-4
PRIOR = {"|base2 - base3|": (3610.0, TAPE), "gain1 - gain2": (0.0, ALIKE)}


@pytest.fixture(scope="module")
def sled(tmp_path_factory: pytest.TempPathFactory) -> pk.Robot:
    limbs = "".join(
        f'[[limb]]\nkind = "cable"\nbase = [{x}, {y}, 0.0]\nplatform = [0.0, 0.0, 0.0]\n'
        for x, y in ANCHORS
    )
    path: Path = tmp_path_factory.mktemp("sled") / "sled.toml"
    path.write_text(
        'name = "sled"\nunits = { length = "mm", angle = "deg" }\n'
        '[pose]\nmap = "xy"\nhome = { x = 1500.0, y = 1000.0 }\n' + limbs
    )
    return pk.load(path)


def drawn(seed: int, rows: int, off: float = 3e-3) -> tuple[np.ndarray, np.ndarray, float]:
    """The nine true numbers, lengths of the belts, and what a tape says of the diagonal."""
    rng = np.random.default_rng(seed)
    anchors, gains = ANCHORS + rng.normal(0, 25, (4, 2)), 1 + off * rng.normal(0, 1, 4)
    anchors[0], anchors[1, 1] = 0.0, 0.0
    gains[1] = gains[0] + bool(off) * rng.normal(0, ALIKE)
    at = rng.uniform([500, 300], [2500, 1700], (rows, 2))
    lengths = np.linalg.norm(at[:, None] - anchors, axis=2) / gains
    true = np.r_[anchors[1, 0], anchors[2:].ravel(), gains]
    tape = float(np.linalg.norm(anchors[1] - anchors[2]) + rng.normal(0, TAPE))
    return true, lengths + rng.normal(0, NOISE, lengths.shape), tape


def fitted(sled: pk.Robot, lengths: np.ndarray, prior: object) -> pk.Identification:
    log = pk.Measurements(lengths, None, "closure", actuator_sigma=NOISE)
    return pk.identify(sled, log, FREE, prior=prior)  # type: ignore[arg-type]


def dense(lengths: np.ndarray, tape: float) -> tuple[np.ndarray, np.ndarray]:
    """The nine numbers and their covariance, with all places among the unknowns."""

    def residual(x: np.ndarray) -> np.ndarray:
        anchors = np.array([[0, 0], [x[0], 0], x[1:3], x[3:5]])
        there = np.linalg.norm(x[9:].reshape(-1, 1, 2) - anchors, axis=2) / x[5:9]
        of_tape = (np.linalg.norm(anchors[1] - anchors[2]) - tape) / TAPE
        return np.r_[((there - lengths) / NOISE).ravel(), of_tape, (x[5] - x[6]) / ALIKE]

    def place(row: np.ndarray) -> np.ndarray:
        away = least_squares(
            lambda p: np.linalg.norm(p - ANCHORS, axis=1) - row, np.array([1500.0, 1000.0])
        )
        return np.asarray(away.x)

    places = np.concatenate([place(row) for row in lengths])
    start = np.r_[3000.0, ANCHORS[2:].ravel(), np.ones(4), places]
    scale = np.ones(len(start))
    scale[5:9] = 1e-3
    best = least_squares(residual, start, "3-point", x_scale=scale, xtol=1e-14, ftol=1e-14)
    by = best.jac * scale
    return best.x[:9], (np.linalg.inv(by.T @ by) * np.outer(scale, scale))[:9, :9]


def test_it_is_the_least_squares_with_the_tape_as_one_more_equation(sled: pk.Robot) -> None:
    _, lengths, tape = drawn(1, 15)
    found = fitted(sled, lengths, PRIOR | {"|base2 - base3|": (tape, TAPE)})
    values, covariance = dense(lengths, tape)
    deviation = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose((found.values - values) / deviation, 0.0, atol=1e-3)
    np.testing.assert_allclose(found.stderr / deviation, found.stderr[0] / deviation[0], rtol=1e-3)
    assert 0.5 < found.stderr[0] / deviation[0] < 2.0  # a Birge ratio, common to all


def test_a_tape_ends_the_common_scale_and_equal_gains_alone_do_not(sled: pk.Robot) -> None:
    _, lengths, tape = drawn(2, 15)
    alike = {"gain1 - gain2": (0.0, ALIKE)}
    open_ended = fitted(sled, lengths, alike)
    assert any("common scale" in text for text in open_ended.gauges)
    assert np.isinf(open_ended.stderr[[0, 2, 5, 6, 7, 8]]).all()
    known = fitted(sled, lengths, alike | {"|base2 - base3|": (tape, TAPE)})
    assert known.rank == 8 and not any("scale" in text for text in known.gauges)
    assert np.isfinite(known.stderr).all()
    # nothing else says how large it is: a longer tape, a larger machine
    longer = fitted(sled, lengths, alike | {"|base2 - base3|": (1.01 * tape, TAPE)})
    np.testing.assert_allclose(longer.values[:5] / known.values[:5], 1.01, atol=1e-3)


def test_deviations_are_honest_and_no_wider_than_the_bound(sled: pk.Robot) -> None:
    z, covered = [], []
    for seed in range(40):
        true, lengths, tape = drawn(100 + seed, 12)
        found = fitted(sled, lengths, PRIOR | {"|base2 - base3|": (tape, TAPE)})
        z.append((found.values - true) / found.stderr)
        covered.append((found.interval95[:, 0] < true) & (true < found.interval95[:, 1]))
    # 40 machines: the mean square of nine correlated numbers scatters by less than a fifth
    assert 0.75 < np.mean(np.square(z)) < 1.3
    assert 0.89 < np.mean(covered) < 0.99


def test_a_pair_for_one_number_moves_the_centre_of_its_prior(sled: pk.Robot) -> None:
    _, lengths, _ = drawn(3, 15)
    tight = fitted(sled, lengths, {"base2.x": (3012.5, 1e-3)})
    assert abs(tight.values[0] - 3012.5) < 0.01
    moved = sled.replace({"base2.x": 3012.5})
    same = fitted(moved, lengths, {"base2.x": 1e-3})
    np.testing.assert_allclose(tight.values, same.values, rtol=1e-7)


def test_a_number_alone_is_a_deviation_around_the_present_function(sled: pk.Robot) -> None:
    _, lengths, _ = drawn(4, 15)
    present = float(np.linalg.norm(ANCHORS[1] - ANCHORS[2]))
    by_default = fitted(sled, lengths, {"|base2 - base3|": 0.5})
    stated = fitted(sled, lengths, {"|base2 - base3|": (present, 0.5)})
    np.testing.assert_array_equal(by_default.values, stated.values)


def test_tied_numbers_follow_their_parameters(tmp_path: Path) -> None:
    """The radius of a circle of anchors, by the length of a chord between two of them."""
    limbs = "".join(
        '[[limb]]\nkind = "cable"\nbase = { radius = "r", angle = "a' + f'{i}", z = 0 }}\n'
        "platform = [0, 0, 0]\n"
        for i in range(3)
    )
    path = tmp_path / "circle.toml"
    path.write_text(
        'name = "circle"\nunits = { length = "mm", angle = "deg" }\n'
        '[pose]\nmap = "xy"\nhome = { x = 10.0, y = 20.0 }\n'
        "[parameters]\nr = 1000.0\na0 = 0.0\na1 = 110.0\na2 = 250.0\n" + limbs
    )
    robot = pk.load(path)
    q = robot.inverse(np.array([[10.0, 20, 0, 0, 0, 0], [-200, 50, 0, 0, 0, 0]]))
    log = pk.Measurements(q, None, "closure", actuator_sigma=5.0)
    chord = 1001.0 * 2 * np.sin(np.radians(55.0))
    found = pk.identify(robot, log, ["r"], prior={"|base1 - base2|": (chord, 1e-4)})
    assert abs(found.values[0] - 1001.0) < 1e-3


@pytest.mark.filterwarnings("ignore:the measurements contradict the prior")
def test_priors_hold_in_whatever_order_they_are_given(sled: pk.Robot) -> None:
    _, lengths, tape = drawn(2, 15)
    stated = {**PRIOR, "|base2 - base3|": (tape, TAPE), "base4.x": 1e-3, "base3.y": 2.0}
    first = fitted(sled, lengths, stated)
    last = fitted(sled, lengths, dict(reversed(stated.items())))
    np.testing.assert_allclose(last.values, first.values, rtol=1e-9)
    np.testing.assert_allclose(last.stderr, first.stderr, rtol=1e-6)
    assert abs((first.values - first.start)[first.free.index("base4.x")]) < 0.01


def test_numbers_of_each_session_have_the_function_in_each(sled: pk.Robot) -> None:
    _, lengths, _ = drawn(5, 16, off=0.0)
    days = ["monday"] * 8 + ["tuesday"] * 8
    log = pk.Measurements(lengths, None, "closure", actuator_sigma=NOISE, session=days)
    found = pk.identify(
        sled, log, [*FREE[:5], "offset*"], per_session="offset*", prior={"offset1 - offset2": 1e-4}
    )
    value = dict(zip(found.free, found.values, strict=True))
    for day in ("monday", "tuesday"):
        assert abs(value[f"offset1@{day}"] - value[f"offset2@{day}"]) < 1e-3
    assert abs(value["offset1@monday"] - value["offset1@tuesday"]) > 1e-2


def test_a_replicate_of_the_bootstrap_draws_the_tape_anew(sled: pk.Robot) -> None:
    _, lengths, tape = drawn(6, 15)
    prior = {"|base2 - base3|": (tape, 20.0), "gain1 - gain2": (0.0, ALIKE)}
    found = fitted(sled, lengths, prior)
    spread = pk.bootstrap(found, 60, seed=1)
    # nothing but the tape says how large the machine is, and noise adds nothing to 20 mm
    assert 0.75 < spread.stderr[0] / found.stderr[0] < 1.3
    assert abs(found.stderr[0] / (20.0 * found.values[0] / tape) - 1.0) < 0.1


def test_a_tape_that_the_belts_contradict_is_said(sled: pk.Robot) -> None:
    _, lengths, tape = drawn(7, 15, off=0.0)
    with pytest.warns(pk.CalibrationWarning, match=r"contradict the prior .*base2 - base3"):
        log = pk.Measurements(lengths, None, "closure", actuator_sigma=NOISE)
        pk.identify(sled, log, FREE[:5], prior={"|base2 - base3|": (tape + 6.0, TAPE)})


@pytest.mark.parametrize(
    ("prior", "message"),
    [
        ({"|base1-base2|": 1.0}, "no point 'base1-base2'; did you mean 'base2'"),
        ({"|base1 - base9|": 1.0}, "no point 'base9'"),
        ({"|base2 - platform1|": 1.0}, "it adds base and platform"),
        ({"gain1 + base2.x": 1.0}, "it adds 1 and mm"),
        ({"|base1|": 1.0}, "a length without a direction"),
        ({"|base2 - base2|": 1.0}, "a length without a direction"),
        ({"base1.y - base2.y": 1.0}, "nothing that it depends on is free"),
        ({"|base2| + 1": 1.0}, "one length such as"),
        ({"two * gain1 - gain2": 1.0}, "'two' is no factor"),
        ({"nan * gain1 - gain2": 1.0}, "'nan' is no factor"),
        ({"1e400*gain1 - gain2": 1.0}, "'1e400' is no factor"),
        ({"|base2|": (-3000.0, 1.0)}, "a length must be above 0 mm, found -3000"),
        ({"|base2|": (1.0, 2.0, 3.0)}, r"must be \(value, deviation\)"),
        ({"|base2|": (3000.0, 0.0)}, "must be above 0"),
        ({"|base2|": (float("nan"), 1.0)}, "its value must be finite"),
        ({"frame.x - base2.x": 1.0}, "no number 'frame.x'"),
    ],
)
def test_what_is_no_function_is_refused(sled: pk.Robot, prior: object, message: str) -> None:
    _, lengths, _ = drawn(8, 6)
    with pytest.raises(pk.ArgumentError, match=message):
        fitted(sled, lengths, prior)


def test_a_length_whose_direction_is_rounding_is_refused(sled: pk.Robot) -> None:
    near = sled.replace({"base3.x": 3000.0 + 1e-4, "base3.y": 0.0})
    _, lengths, _ = drawn(8, 6)
    with pytest.raises(pk.ArgumentError, match=r"0\.0001 mm now, a length without a direction"):
        fitted(near, lengths, {"|base2 - base3|": 1.0})


def test_the_command_line_takes_a_tape_with_units(sled: pk.Robot) -> None:
    names = list(FREE)
    given = ["|base1 - base2|=3043±1", "gain1 - gain2 = 0 +- 1e-4", "base2.x=304.5cm±0.2cm"]
    assert read_prior(["base*=0.5", *given], sled, names) == {
        "base*": 0.5,
        "|base1 - base2|": (3043.0, 1.0),
        "gain1 - gain2": (0.0, 1e-4),
        "base2.x": (3045.0, 2.0),
    }
    assert read_prior(["|base2|=3±0.001 m"], sled, names) == {"|base2|": (3000.0, 1.0)}
    assert read_prior(["0.5"], sled, names) == 0.5 and read_prior([], sled, names) is None
    for wrong in ("|base2|=3±", "±3", "|base2|=x±1", "|base2|=3±1 deg", "gain1=1±1 mm"):
        with pytest.raises(pk.ArgumentError, match=r"^--prior "):
            read_prior([wrong], sled, names)
    with pytest.raises(pk.ArgumentError, match="stands alone"):
        read_prior(["0.5", "|base2|=3±1"], sled, names)
