"""Mistaken measurements are suspected aloud, and mistaken arguments named."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pkmcal as pk
from pkmcal.calibration.identify import identify
from pkmcal.core import instruments
from pkmcal.diagnostics.other_readings import other_readings
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.virtual_machine import VirtualMachine

from .. import workspaces
from ..simulated import hexapod_poses, tilted_poses, with_errors

Change = Callable[[Measurements], dict[str, Any]]


@pytest.fixture(scope="module")
def points(paper: Robot) -> Measurements:
    rng = np.random.default_rng(1)
    machine = VirtualMachine(with_errors(paper, 0.5, rng))
    return machine.measure(paper.inverse(tilted_poses(paper, 30, rng)))


MISREAD: list[tuple[str, Change]] = [
    ("the measured lengths are in metres", lambda m: {"values": m.values / 1000}),
    ("the actuators are in metres", lambda m: {"actuators": m.actuators / 1000}),
    ("the actuators are in inches", lambda m: {"actuators": m.actuators / 25.4}),
    ("the actuators count the other way", lambda m: {"actuators": -m.actuators}),
    ("q1 and q2 are exchanged", lambda m: {"actuators": m.actuators[:, [1, 0, 2, 3]]}),
    ("x and y are exchanged", lambda m: {"values": m.values[:, [1, 0, 2]]}),
    ("the actuators are in centimetres", lambda m: {"actuators": m.actuators / 10}),
    ("q3 is in inches", lambda m: {"actuators": m.actuators / [1, 1, 25.4, 1]}),
    ("z is in centimetres", lambda m: {"values": m.values / [1, 1, 10]}),
    ("y counts the other way", lambda m: {"values": m.values * [1, -1, 1]}),
]


SIGNS: list[tuple[str, Change]] = [
    ("q2 counts the other way", lambda m: {"actuators": m.actuators * [1, -1, 1, 1]}),
    ("q4 is in metres", lambda m: {"actuators": m.actuators / [1, 1, 1, 1e3]}),
    ("x is in micrometres", lambda m: {"values": m.values * [1e3, 1, 1]}),
]


def said(robot: Robot, measured: Measurements, **options: Any) -> list[str]:
    """What `identify` says aloud: its error, or else its warnings."""
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        try:
            found = identify(robot, measured, **options)
        except ValueError as error:
            return [str(error)]
    texts = [str(warning.message) for warning in heard]
    assert found.warnings == tuple(texts)
    assert all(text[:40] in found.summary() for text in texts)
    return texts


@pytest.mark.parametrize(("words", "change"), MISREAD + SIGNS)
def test_a_reading_of_a_mistakes_name_undoes_it(
    paper: Robot, points: Measurements, words: str, change: Change
) -> None:
    wrong = dataclasses.replace(points, **change(points))
    readings = other_readings(wrong, paper.actuator_units)
    undone = {meant.words: other for meant, other in readings}[words]
    np.testing.assert_allclose(undone.actuators, points.actuators, rtol=1e-12)
    np.testing.assert_allclose(undone.values, points.values, rtol=1e-12)


@pytest.mark.parametrize("prior", [None, 0.5])
@pytest.mark.parametrize(("words", "change"), MISREAD, ids=[words for words, _ in MISREAD])
def test_a_misreading_is_named(
    paper: Robot, points: Measurements, words: str, change: Change, prior: float | None
) -> None:
    texts = said(paper, dataclasses.replace(points, **change(points)), prior=prior)
    assert any(words in text for text in texts)


@pytest.mark.parametrize("seed", range(2, 8))
def test_angles_in_degrees_are_named(seed: int) -> None:
    """Also where a fit of them cannot be weighed as its components call for."""
    robot = pk.load("hexapod")
    rng = np.random.default_rng(seed)
    true = with_errors(robot, 0.5, rng)
    q = robot.inverse(hexapod_poses(robot, 20 if seed == 2 else 45, rng))
    measured = VirtualMachine(true, noise=0.0).measure(q, kind="pose")
    wrong = measured.values.copy()
    wrong[:, 3:] = np.degrees(wrong[:, 3:])
    texts = said(robot, dataclasses.replace(measured, values=wrong))
    assert any("the angles are in degrees" in text for text in texts)


def test_actuators_in_degrees_are_named() -> None:
    robot = pk.load("rotary-delta")
    q = robot.inverse(workspaces.poses("rotary-delta", 20))
    measured = VirtualMachine(with_errors(robot, 0.5, np.random.default_rng(6))).measure(q)
    for factor, words in ((180 / np.pi, "in degrees"), (np.pi / 180, "taken for degrees")):
        wrong = dataclasses.replace(measured, actuators=factor * measured.actuators)
        assert any(words in text for text in said(robot, wrong))


def test_exchanged_angles_are_named() -> None:
    robot = pk.load("hexapod")
    q = robot.inverse(hexapod_poses(robot, 20, np.random.default_rng(7)))
    measured = VirtualMachine(robot).measure(q, kind="pose")
    wrong = dataclasses.replace(measured, values=measured.values[:, [0, 1, 2, 4, 3, 5]])
    assert any("alpha and beta are exchanged" in text for text in said(robot, wrong))


def test_exchanged_targets_are_named_and_no_other(hexapod: pk.Robot) -> None:
    places = np.array([[80.0, 0.0, 30.0], [-60.0, 50.0, 30.0], [-20.0, -70.0, 30.0]])
    q = np.repeat(hexapod.inverse(hexapod_poses(hexapod, 20, np.random.default_rng(9))), 3, axis=0)
    read = VirtualMachine(hexapod).measure(q, target=np.tile(places, (20, 1))).values
    wrong = Measurements(
        q, read, target=places, target_index=np.tile([0, 2, 1], 20), target_names=("A", "B", "C")
    )
    verdict = identify(hexapod, wrong, free="offset*").verdict
    assert verdict.state == "not calibrated"
    assert verdict.reasons[0].endswith(" if target B is C, C is B")


@pytest.mark.parametrize(
    ("read_as", "words"),
    [
        ([1, 2, 3, 0], "the scalar of the quaternions is their last number"),
        ([3, 0, 1, 2], "the scalar of the quaternions is their first number"),
        (None, "orientations are those of the base in the platform's frame"),
    ],
)
def test_quaternions_under_wrong_headings_are_named(read_as: list[int] | None, words: str) -> None:
    """A 3-RPS tilts about axes of one plane: a frame and a tool would hide it, but none is free."""
    robot = pk.load("3rps")
    q = np.random.default_rng(3).uniform(1500, 1700, (20, 3))
    measured = VirtualMachine(robot).measure(q, kind="pose")
    turned = Rotation.from_euler("xyz", measured.values[:, 3:])
    other = turned.inv() if read_as is None else Rotation.from_quat(turned.as_quat()[:, read_as])
    values = np.hstack([measured.values[:, :3], other.as_euler("xyz")])
    wrong = dataclasses.replace(measured, values=values)
    assert any(words in text for text in said(robot, wrong))


def test_actuators_out_of_their_strokes_are_named(paper: Robot) -> None:
    poses = tilted_poses(paper, 20, np.random.default_rng(8))
    poses[[3, 7], 2] += 150.0
    poses[:, 0] = poses[:, 2] * np.tan(poses[:, 4])
    (text,) = said(paper, VirtualMachine(paper).measure(paper.inverse(poses)), prior=0.5)
    assert "actuators out of stroke in 2 of 20 rows (rows 3, 7): limb" in text
    assert "its stroke is 300 to 520" in text and "check units, signs and columns" in text


def test_a_machine_that_cannot_be_the_drawn_one_is_named() -> None:
    robot = pk.load("hexapod")
    q = robot.inverse(hexapod_poses(robot, 20, np.random.default_rng(9)))
    measured = VirtualMachine(robot).measure(q, kind="pose")
    longer = dataclasses.replace(measured, actuators=q - 400.0)
    (text,) = said(robot, longer, free="offset*")
    assert text.startswith("offset1 … offset6 moved by up to 400 mm, further than")


def test_a_pose_that_no_geometry_reaches_is_an_error_that_says_what_to_do() -> None:
    robot = pk.load("hexapod")
    q = robot.inverse(hexapod_poses(robot, 20, np.random.default_rng(10)))
    measured = VirtualMachine(robot).measure(q, kind="pose")
    q[3] = [300, 1100, 300, 1100, 300, 1100]
    (text,) = said(robot, dataclasses.replace(measured, actuators=q))
    assert "1 of 20 rows" in text and "(rows 3); check units" in text and "leave these rows" in text


def test_a_point_that_no_geometry_reaches_is_an_outlier() -> None:
    robot = pk.load("hexapod")
    q = robot.inverse(hexapod_poses(robot, 30, np.random.default_rng(11)))
    measured = VirtualMachine(robot).measure(q, kind="pose")
    values = measured.values.copy()
    values[3, 0] += 5000.0
    wrong = dataclasses.replace(measured, values=values)
    assert any("look at the outliers" in text for text in said(robot, wrong))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = identify(robot, wrong, loss="cauchy")
    assert found.outliers == (3,)
    truth = [robot.geometry[name] for name in found.free]
    off, half = np.abs(found.values - truth), found.interval95[:, 1] - found.values
    assert np.mean(off < half) > 0.9 and (off < 3 * half).all()


def test_residuals_far_above_sigma_are_named(paper: Robot, points: Measurements) -> None:
    (text,) = said(paper, points, free="offset*")
    assert "times what sigma says: free more parameters" in text
    wrong = points.values.copy()
    wrong[5] += [0.0, 0.0, 2.0]
    first, second = said(paper, dataclasses.replace(points, values=wrong), prior=0.5)
    assert "look at the outliers" in first
    assert "contradict the prior" in second and second.endswith("or leave the outliers out")


def test_repeats_decide_whether_sigma_or_numbers_that_are_not_free_are_to_blame(
    paper: Robot,
) -> None:
    rng = np.random.default_rng(5)
    q = np.repeat(paper.inverse(tilted_poses(paper, 20, rng)), 2, axis=0)
    wrong = with_errors(paper, 0.5, rng)
    repeated = VirtualMachine(wrong, 0.05).measure(q)
    once = repeated.select(slice(0, None, 2))
    boasted = dataclasses.replace(VirtualMachine(paper, 0.05).measure(q), sigma=0.01)
    for measured, free_more, state_sigma in (
        (repeated, True, False),
        (once, True, True),
        (boasted, False, True),
    ):
        texts = said(paper, measured, free="offset*")
        (text,) = [text for text in texts if "times what sigma says" in text]
        assert ("free more parameters" in text) == free_more
        assert ("state the true sigma" in text) == state_sigma


def test_good_measurements_raise_no_suspicion(paper: Robot, points: Measurements) -> None:
    assert said(paper, points, prior=0.5) == []
    large = with_errors(paper, 5.0, np.random.default_rng(3))
    q = paper.inverse(tilted_poses(paper, 30, np.random.default_rng(4)))
    assert said(paper, VirtualMachine(large).measure(q), prior=5.0) == []


def test_rows_out_of_reach_are_named(paper: Robot, points: Measurements) -> None:
    q = points.actuators.copy()
    q[[4, 7], :2] = [[50, 900], [50, 900]]
    with pytest.raises(ValueError, match=r"2 of 30 rows .* \(rows 4, 7\)"):
        identify(paper, dataclasses.replace(points, actuators=q))


def test_one_pose_only_is_named(paper: Robot) -> None:
    one = VirtualMachine(paper).measure(np.tile(paper.inverse(paper.home), (10, 1)))
    assert any("same actuators" in text for text in said(paper, one))


def test_fewer_equations_than_parameters_are_named(paper: Robot, points: Measurements) -> None:
    texts = said(paper, points.select(slice(0, 5)))
    assert any("15 equations for 28 parameters" in text for text in texts)


def test_no_equation_left_over_is_named(paper: Robot, points: Measurements) -> None:
    two = points.select(slice(0, 2))
    texts = said(paper, two, free=["offset*", "base1.x", "base2.y"])
    assert any("no degrees of freedom are left" in text for text in texts)


def test_no_equation_left_over_is_named_with_a_prior_that_leaves_the_frame_out(
    paper: Robot, points: Measurements
) -> None:
    three = points.select(slice(0, 3))
    (text,) = said(paper, three, prior=0.5, unknown=["frame", "target"])
    assert "9 equations for 9 identifiable combinations: no degrees of freedom are left" in text


@pytest.mark.parametrize(
    ("words", "change"),
    [
        ("the measured lengths are in metres", lambda v: v / 1000),
        ("are exchanged", lambda v: v * [1, -1, 1]),  # a left-handed instrument
    ],
)
def test_a_misreading_is_named_wherever_the_instrument_stands(
    paper: Robot, points: Measurements, words: str, change: Callable[[np.ndarray], np.ndarray]
) -> None:
    values = instruments.seen_points(np.array([5e3, -8e3, 1e3, 2.9, 0.3, -2.8]), points.values)[0]
    wrong = dataclasses.replace(points, values=change(values))
    texts = said(paper, wrong, prior=0.5, unknown=["frame", "target"])
    assert any(words in text for text in texts)


def test_without_sigma_and_nothing_left_over_nothing_is_certain(
    paper: Robot, points: Measurements
) -> None:
    two = dataclasses.replace(points.select(slice(0, 2)), sigma=None)
    with pytest.warns(UserWarning, match="no degrees of freedom"):
        found = identify(paper, two, free=["offset*", "base1.x", "base2.y"])
    assert np.isinf(found.stderr).all()


def test_copied_rows_are_named_but_repeats_are_not(paper: Robot, points: Measurements) -> None:
    texts = said(paper, points.select([*range(30), 3, 4]), prior=0.5)
    assert texts == ["2 rows equal others to the last digit (row 30 of 3, 31 of 4): copied, not"
                     " measured again?"]  # fmt: skip
    (many,) = said(paper, points.select([*range(30), *range(7)]), prior=0.5)
    named = ", ".join(["30 of 0", *(f"{30 + i} of {i}" for i in range(1, 5))])
    assert many.startswith(f"7 rows equal others to the last digit (row {named}, …): copied")
    (five,) = said(paper, points.select([*range(30), *range(5)]), prior=0.5)
    assert five.startswith(f"5 rows equal others to the last digit (row {named}): copied")
    repeats = VirtualMachine(paper).measure(np.repeat(points.actuators, 2, axis=0))
    assert said(paper, repeats, prior=0.5) == []


def test_measurements_that_are_given_twice_are_named(paper: Robot, points: Measurements) -> None:
    """In another order, too; readings of another day are no copies, whatever rows are equal."""
    again = points.select([*range(29, -1, -1)])
    with pytest.warns(pk.CalibrationWarning, match="all 30 rows from row 30 equal rows from row 0"):
        found = identify(paper, [points, again], prior=0.5)
    assert "the same measurements twice?" in str(found.verdict)
    values = points.values + np.where(np.arange(30) < 20, 0.0, 0.01)[:, None]
    found = identify(paper, [points, dataclasses.replace(points, values=values)], prior=0.5)
    assert "twice" not in str(found.verdict)


def test_no_identifiable_parameter_is_an_error(paper: Robot, points: Measurements) -> None:
    with pytest.raises(ValueError, match=r"they depend on none of platform3.x, platform4.x"):
        identify(paper, points, free=["platform3.x", "platform4.x"])


BAD: list[tuple[dict[str, Any], str]] = [
    ({"free": "ofset1"}, "did you mean 'offset1'"),
    ({"free": []}, "free: name at least one"),
    (
        {"prior": {"bse1.x": 0.5}},
        "prior: no free parameter matches 'bse1.x'; did you mean 'base1.x'",
    ),
    ({"prior": -1}, "prior must be positive"),
    ({"prior": {"base*": 0}}, r"prior of base\* must be positive"),
    ({"loss": "hubr"}, "loss must be one of linear, huber, cauchy"),
    ({"unknown": "frme"}, "unknown must be .* did you mean 'frame'"),
    ({"unknown": {"frame": "unkown"}}, "frame must be .* did you mean 'unknown'"),
    ({"unknown": {"target": ["known", "known"]}}, "target: one word for each of 1 sets"),
    ({"holdout": 1.5}, "holdout must be a fraction"),
    ({"bounds": {"base1.x": (295, 296)}}, "bounds of base1.x must enclose its present value 294.2"),
    ({"bounds": {"base1.x": 3}}, "bounds of base1.x must be"),
]


@pytest.mark.parametrize(("options", "words"), BAD)
def test_bad_arguments_are_named(
    paper: Robot, points: Measurements, options: dict[str, Any], words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        identify(paper, points, **options)


def test_tied_numbers_are_refused_with_their_parameter() -> None:
    robot = pk.load("examples/linear-delta/robot.toml")
    heights = Measurements(np.tile(robot.inverse(robot.home), (3, 1)), np.zeros(3), "height")
    with pytest.raises(ValueError, match=r"base1.x is driven by .*radius"):
        identify(robot, heights, free="base1.x")


def test_measurements_of_another_machine_are_refused(points: Measurements) -> None:
    with pytest.raises(ValueError, match="hexapod has 6 actuators, found 4"):
        identify(pk.load("hexapod"), points)
    with pytest.raises(TypeError, match="must be a Measurements, found list"):
        identify(pk.load("hexapod"), [[1, 2, 3]])  # type: ignore[list-item]
    with pytest.raises(ValueError, match="none given"):
        identify(pk.load("hexapod"), [])
    radians = dataclasses.replace(points, actuator_units=("rad",) * 4)
    with pytest.raises(ValueError, match="are in mm, mm, mm, mm, found rad"):
        identify(pk.load("2tpr2tps"), radians)


def test_points_alone_have_no_attachment(paper: Robot, points: Measurements) -> None:
    with pytest.raises(ValueError, match="attachment: positions have none, it cannot be unknown"):
        identify(paper, points, unknown="attachment")


def test_distances_alone_have_no_frame(paper: Robot) -> None:
    q = paper.inverse(tilted_poses(paper, 5, np.random.default_rng(5)))
    far = VirtualMachine(paper).measure(q, kind="distance", target=[500, 0, 0])
    with pytest.raises(ValueError, match="distances do not depend on it"):
        identify(paper, far, unknown="frame")


def test_struts_exchanged_in_a_log_that_is_a_row_late_are_both_named(hexapod: pk.Robot) -> None:
    """Either alone explains nothing."""
    rng = np.random.default_rng(2)
    q = hexapod.inverse(hexapod_poses(hexapod, 30, rng))
    true = hexapod.replace({"offset1": 0.4, "offset5": -0.3})
    points = true.forward(q).pose[:, :3] + rng.normal(0, 0.01, (30, 3))
    wrong = np.roll(q, -1, axis=0)[:, [0, 1, 3, 2, 4, 5]]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        try:
            said = "; ".join(pk.identify(hexapod, pk.Measurements(wrong, points)).verdict.reasons)
        except pk.ArgumentError as error:
            said = str(error)
    assert "if q3 and q4 are exchanged and each reading belongs to the row 1 before it" in said


def test_rows_out_of_reach_do_not_make_another_reading_likely_that_fits_the_others_worse() -> None:
    robot = pk.load("3rrr-planar")
    poses = pk.sample_poses(robot, 200, seed=1, share=0.9)
    q = robot.inverse(poses)
    exchanged = q[:, [1, 0, 2]]
    there, other_way = robot.forward(q).ok, robot.forward(exchanged).ok
    good, bad = np.flatnonzero(there & other_way)[:20], np.flatnonzero(there & ~other_way)[:2]
    values = np.vstack([robot.forward(q[good]).pose, poses[bad]])[:, :3]
    mixed = pk.Measurements(np.vstack([q[good], exchanged[bad]]), values, sigma=0.02)
    with pytest.raises(ValueError, match="rows 21") as told:
        pk.identify(robot, mixed, "offset*")
    assert "exchanged" not in str(told.value)  # by which twenty rows that fit would be 50 mm off
    wrong = pk.Measurements(exchanged, poses[:, :3], sigma=0.02)
    assert not robot.forward(exchanged).ok.all()
    with pytest.raises(ValueError, match=r"but by .* mm if q1 and q2 are exchanged"):
        pk.identify(robot, wrong.select(there), "offset*")
