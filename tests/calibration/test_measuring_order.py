"""Residuals that follow the order of measuring: a tracker that moved, a machine that drifts."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arrays import FloatArray
from pkmcal.calibration.identification import Identification
from pkmcal.diagnostics.measuring_order import MeasuringOrder
from pkmcal.statistics.order_test import Series

from ..simulated import hexapod_poses, tilted_poses, with_errors

NOISE, COUNT = 0.02, 40


def of_offsets(robot: pk.Robot, rng: np.random.Generator) -> pk.Robot:
    """The robot with other offsets, which alone are sought."""
    errors = rng.normal(0, 0.3, 6)
    return robot.replace({f"offset{i + 1}": robot.geometry[f"offset{i + 1}"] + e
                          for i, e in enumerate(errors)})  # fmt: skip


def measured(
    robot: pk.Robot,
    seed: int,
    moved: Callable[[FloatArray], FloatArray],
    along_x: bool = False,
    time: FloatArray | None = None,
) -> pk.Measurements:
    """Positions at random poses, `moved` from 0 to 1 in the course of measuring."""
    rng = np.random.default_rng(seed)
    true, poses = of_offsets(robot, rng), hexapod_poses(robot, COUNT, rng)
    if along_x:
        poses = poses[np.argsort(poses[:, 0])]
    q = robot.inverse(poses)
    course = np.linspace(0, 1, COUNT) if time is None else np.argsort(np.argsort(time)) / COUNT
    places = true.forward(q).pose[:, :3]
    places += rng.normal(0, NOISE, places.shape) + NOISE * moved(course)
    return pk.Measurements(q, places, time=time)


def still(course: FloatArray) -> FloatArray:
    return np.zeros((len(course), 3))


def step(size: float) -> Callable[[FloatArray], FloatArray]:
    return lambda course: np.outer(course >= 0.5, size * np.array([0.6, 0.8, 0.0]))


def drift(size: float) -> Callable[[FloatArray], FloatArray]:
    return lambda course: np.outer(course, size * np.array([0.0, 0.6, 0.8]))


def found_of(robot: pk.Robot, data: pk.Measurements, **words: object) -> Identification:
    return pk.identify(robot, data, "offset*", **words)  # type: ignore[arg-type]


def test_a_tracker_that_moved_is_doubtful_and_the_row_is_named(hexapod: pk.Robot) -> None:
    found = found_of(hexapod, measured(hexapod, 1, step(50)), holdout=0.25)
    order = found.measuring_order
    assert order is not None and order.large and found.verdict.state == "doubtful"
    assert order.shift[0] == pytest.approx(30 * NOISE, abs=2 * NOISE)
    assert order.shift[1] == pytest.approx(40 * NOISE, abs=2 * NOISE)
    first = min(row for row in found.rows.tolist() if row >= COUNT // 2)
    assert order.jump == f"row {first}"
    told = found.verdict.reasons[0]
    assert f"from row {first} on, most of it y" in told
    assert "moved meanwhile, or the model is wrong where the machine was then" in told


def test_a_drift_of_ten_deviations_without_repeats_is_found(hexapod: pk.Robot) -> None:
    for seed in range(5):
        found = found_of(hexapod, measured(hexapod, seed, drift(10)), holdout=0.25)
        assert found.drift is None and found.verdict.state == "doubtful"
        order = found.measuring_order
        assert order is not None and "in the course of measuring" in str(order)
        assert order.shift[2] == pytest.approx(8 * NOISE, rel=0.35)


def test_the_column_time_says_the_order(hexapod: pk.Robot) -> None:
    """A file that was sorted afterwards: by its rows nothing would show."""
    time = np.random.default_rng(5).permutation(COUNT) * 30.0
    data = measured(hexapod, 3, drift(10), time=time)
    timed = found_of(hexapod, data).measuring_order
    untimed = pk.Measurements(data.actuators, data.values)
    by_rows = found_of(hexapod, untimed).measuring_order
    assert timed is not None and timed.found
    assert by_rows is not None and not by_rows.found


def test_each_file_is_a_series_of_its_own(hexapod: pk.Robot) -> None:
    """Two files between which all moved: hold-outs and frames of their own are for that."""
    parts = [measured(hexapod, 3, still), measured(hexapod, 3, step(50))]
    order = found_of(hexapod, parts).measuring_order  # type: ignore[arg-type]
    assert order is not None and order.large and order.series == "measurements 2"
    apart = [parts[0], pk.Measurements(parts[0].actuators, parts[0].values + 50 * NOISE)]
    between = found_of(hexapod, apart).measuring_order  # type: ignore[arg-type]
    assert between is not None and not between.found


def test_readings_of_one_visit_are_one_witness(hexapod: pk.Robot) -> None:
    """Five readings of each pose share its error: 40 visits, and no course of theirs."""
    chances = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        true, poses = of_offsets(hexapod, rng), hexapod_poses(hexapod, 24, rng)
        q = hexapod.inverse(poses)
        places = true.forward(q).pose[:, :3] + rng.normal(0, 5 * NOISE, (24, 3))
        values = np.repeat(places, 5, axis=0) + rng.normal(0, NOISE, (120, 3))
        order = found_of(hexapod, pk.Measurements(np.repeat(q, 5, axis=0), values)).measuring_order
        assert order is not None and order.visits == 24
        chances.append(order.chance)
    assert np.mean(np.array(chances) < 0.1) < 0.3 and np.mean(np.array(chances) < 0.01) < 0.1


def test_a_slightly_wrong_model_sorted_by_place_is_no_doubt(hexapod: pk.Robot) -> None:
    """The course is there, but most of the residuals are not: at most a note, true of both."""
    said = 0
    for seed in range(8):
        data = measured(hexapod, seed, still, along_x=True)
        x = data.values[:, 0]
        bent = data.values.copy()
        bent[:, 2] += 1.3 * NOISE * np.sin(2 * np.pi * (x - x.min()) / np.ptp(x))
        found = found_of(hexapod, pk.Measurements(data.actuators, bent))
        order = found.measuring_order
        assert order is not None and not order.large
        assert str(order) not in found.verdict.reasons
        notes = [each.text for each in found.verdict.said if each.check == "measuring-order"]
        said += len(notes)
        assert len(notes) == order.found and all("the model" in text for text in notes)
    assert said


def test_too_few_rows_say_nothing(hexapod: pk.Robot) -> None:
    data = measured(hexapod, 1, still)
    assert found_of(hexapod, data.select(np.arange(7))).measuring_order is None


def test_rounding_errors_have_no_order(hexapod: pk.Robot) -> None:
    q = hexapod.inverse(hexapod_poses(hexapod, 20, np.random.default_rng(0)))
    exact = pk.Measurements(q, hexapod.forward(q).pose[:, :3])
    assert found_of(hexapod, exact).measuring_order is None


def test_the_test_has_the_chance_it_states() -> None:
    """Exact beside a fit with few spare equations: 1 % at 1 % of 2000 series of 12 visits."""
    rng = np.random.default_rng(0)
    chances = []
    for _ in range(2000):
        design, noise = rng.normal(size=(36, 8)), rng.normal(size=36)
        course = Series(design, noise, np.tile(np.eye(3), (12, 1)), np.repeat(np.arange(12), 3))
        tested = course.course()
        assert tested is not None
        chances.append(tested.chance)
    assert 0.005 < np.mean(np.array(chances) < 0.01) < 0.015


def test_a_course_is_what_least_squares_with_it_finds() -> None:
    """The jump of one fit with the step as a column of the design, by NumPy alone."""
    rng = np.random.default_rng(1)
    design, when = rng.normal(size=(30, 4)), np.arange(30)
    y = 3.0 * (when >= 11) + rng.normal(0, 0.5, 30)
    left = y - design @ np.linalg.lstsq(design, y, rcond=None)[0]
    series = Series(design, left, np.full((30, 1), 2.0), when)
    course = series.course()
    assert course is not None
    course = series.jumped(course)
    assert course.jump == 11
    whole = np.column_stack([design, np.ones(30), 2.0 * (when >= 11)])
    assert course.shift[0] == pytest.approx(np.linalg.lstsq(whole, y, rcond=None)[0][-1])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::pkmcal.CalibrationWarning")  # at their own small chance
@pytest.mark.parametrize("machine", ["hexapod", "2tpr2tps", "delta"])
def test_one_of_a_hundred_sound_calibrations_is_said_to_follow_the_order(machine: str) -> None:
    delta = pk.load(Path(__file__).parents[2] / "examples" / "linear-delta" / "robot.toml")
    robot = delta if machine == "delta" else pk.load(machine)
    runs, found = 500, 0
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        if machine == "hexapod":
            true, poses = of_offsets(robot, rng), hexapod_poses(robot, 30, rng)
            words: dict[str, object] = {"free": "offset*"}
        elif machine == "2tpr2tps":
            true, poses = with_errors(robot, 0.5, rng), tilted_poses(robot, 30, rng)
            words = {"prior": 0.5}
        else:
            true = with_errors(robot, 0.3, rng)
            radius, turn = 90 * np.sqrt(rng.uniform(0, 1, 24)), rng.uniform(0, 2 * np.pi, 24)
            poses = np.tile(robot.home, (24, 1))
            poses[:, :2] = (radius * [np.cos(turn), np.sin(turn)]).T
            words = {}
        q = robot.inverse(poses)
        places = true.forward(q).pose[:, :3] + rng.normal(0, NOISE, (len(q), 3))
        kind = "height" if machine == "delta" else "position"
        data = pk.Measurements(q, places[:, 2] if machine == "delta" else places, kind)
        order = pk.identify(robot, data, **words).measuring_order  # type: ignore[arg-type]
        found += order is not None and order.found
    assert found <= 12  # of 5 expected, exceeded once in 500 times


@pytest.mark.parametrize(("units", "said"), [
    (("mm", "mm", "rad", "rad"), "shifted by 0.5 mm in the course of measuring, most of it b"),
    (("rad", "rad", "rad", "rad"), "shifted by 11.5 deg in the course of measuring, most of it d"),
])  # fmt: skip
def test_a_shift_is_that_of_lengths_or_of_angles_where_no_length_was_read(
    units: tuple[str, ...], said: str
) -> None:
    shift = (0.3, -0.4, 0.01, 0.02) if "mm" in units else (0.0, 0.12, 0.0, -0.16)
    order = MeasuringOrder(
        ("a", "b", "c", "d"), shift, (0.1,) * 4, units, 1e-6, 0.9, jump="", visits=20, series=""
    )
    assert said in str(order)


def of_raster(robot: pk.Robot, seed: int, course: Callable[[FloatArray], FloatArray]) -> str:
    """What is said of the order of poses line after line of a raster, where z misses a bowl."""
    rng = np.random.default_rng(seed)
    true = of_offsets(robot, rng)
    x, y = (each.ravel() for each in np.meshgrid(np.linspace(-90, 90, 8), np.linspace(-90, 90, 8)))
    poses = np.tile(robot.home, (64, 1))
    poses[:, 0] += x
    poses[:, 1] += y
    poses[:, 2:] += rng.uniform(-1, 1, (64, 4)) * [40, 0.1, 0.1, 0.1]
    q = robot.inverse(poses)
    places = true.forward(q).pose[:, :3] + rng.normal(0, NOISE, (64, 3))
    places += course(np.linspace(0, 1, 64))
    places[:, 2] += 0.06 * (y / 90.0) ** 2
    found = pk.identify(robot, pk.Measurements(q, places), "offset*")
    (said,) = [each for each in found.verdict.said if each.check == "measuring-order"]
    return said.text


def test_what_a_raster_misses_by_place_is_not_said_to_have_shifted(hexapod: pk.Robot) -> None:
    text = of_raster(hexapod, 1, still)
    assert "follow where the machine was" in text and "shifted" not in text
    jumped = of_raster(hexapod, 1, step(0.5))
    assert "as if readings had shifted" in jumped
