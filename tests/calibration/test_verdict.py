"""The verdict: whether a calibration can be believed, and the first reason why not."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arrays import FloatArray
from pkmcal.calibration.identification import Identification
from pkmcal.measurements.measurements import Measurements

from ..simulated import hexapod_poses
from ..statistics.designs import UNKNOWN, seen_by_tracker, six_joints

PRINTER = Path(__file__).parents[2] / "examples" / "linear-delta"


def fitted(robot: Any, measured: Any, **options: Any) -> Identification:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return pk.identify(robot, measured, **options)


def session(
    robot: pk.Robot, true: pk.Robot, count: int, seed: int, noise: float = 0.02
) -> Measurements:
    """Positions of a hexapod's platform, without sigma."""
    rng = np.random.default_rng(seed)
    q = robot.inverse(hexapod_poses(robot, count, rng))
    values = true.forward(q).pose[:, :3] + rng.normal(0, noise, (count, 3))
    return Measurements(q, values, "position")


@pytest.fixture(scope="module")
def true(hexapod: pk.Robot) -> pk.Robot:
    return hexapod.replace({"offset1": 0.3, "offset4": -0.4})


# --- held out ------------------------------------------------------------------------------------


def test_a_sound_calibration_is_calibrated(hexapod: pk.Robot, true: pk.Robot) -> None:
    found = fitted(hexapod, session(hexapod, true, 40, 0), free="offset*", holdout=0.25)
    assert found.verdict.state == "calibrated" and not found.verdict.remarks
    assert str(found).startswith("Calibrated: the error of 10 held-out points falls")
    assert not found.holdout_contradicts and found.moved == ()


def test_points_that_contradict_the_fit_are_the_first_line(
    hexapod: pk.Robot, true: pk.Robot
) -> None:
    later = true.replace({"offset5": true.geometry["offset5"] + 0.5})
    found = fitted(
        hexapod, session(hexapod, true, 40, 0), free="offset*",
        holdout=session(hexapod, later, 30, 1),
    )  # fmt: skip
    assert found.holdout_contradicts and found.verdict.state == "doubtful"
    assert str(found).startswith("Doubtful: the held-out points contradict the fit: ")
    (moved,) = found.moved
    assert moved.names == ("offset5",) and abs(moved.shift[0] - 0.5) < 3 * moved.stderr[0]
    assert "moved, or the model is wrong there: offset5 by +0.5" in found.verdict.reasons[1]


def test_a_table_says_in_words_that_all_held_out_points_are_outliers(
    hexapod: pk.Robot, true: pk.Robot
) -> None:
    later = session(hexapod, true.replace({"offset5": 3.0}), 12, 1)
    found = fitted(hexapod, session(hexapod, true, 40, 0), free="offset*", holdout=later)
    assert len(found.holdout_outliers) == 12
    assert "none is left (12)" in str(found) and "nan" not in str(found)


@pytest.mark.parametrize(
    ("free", "said"),
    [("offset*", "offset1 … offset6 alike"), ("offset[25]", "offset2, offset5 alike")],
)
def test_all_offsets_that_move_alike_are_named_together(
    hexapod: pk.Robot, true: pk.Robot, free: str, said: str
) -> None:
    names = hexapod.geometry.match(free)
    first = true if len(names) == 6 else hexapod
    later = first.replace({name: first.geometry[name] + 0.4 for name in names})
    found = fitted(
        hexapod, session(hexapod, first, 40, 0), free=free, holdout=session(hexapod, later, 40, 1)
    )
    assert str(found.moved[0]) == said
    assert found.moved[0].shift[0] == pytest.approx(0.4, abs=0.05)


def test_a_holdout_without_sigma_has_the_noise_of_the_fit(
    hexapod: pk.Robot, true: pk.Robot
) -> None:
    first, other = session(hexapod, true, 40, 0), session(hexapod, true, 30, 1)
    stated = fitted(hexapod, replace(first, sigma=0.02), free="offset*", holdout=other)
    assert stated.holdout_expected == pytest.approx(0.02 * np.sqrt(3), rel=0.2)
    alone = fitted(hexapod, first, free="offset*", holdout=other)  # x, y and z may be told apart
    assert stated.holdout_expected == pytest.approx(alone.holdout_expected, rel=1e-2)
    both = replace(first, sigma=0.02), replace(other, sigma=0.02)
    twice = fitted(hexapod, both[0], free="offset*", holdout=both[1])
    assert twice.holdout_expected == pytest.approx(stated.holdout_expected, rel=1e-6)
    rough = fitted(hexapod, both[0], free="offset*", holdout=replace(other, sigma=0.06))
    assert rough.holdout_expected == pytest.approx(3.0 * twice.holdout_expected, rel=0.03)


def test_gross_rows_among_few_held_out_points_do_not_contradict_a_sound_fit(
    hexapod: pk.Robot, true: pk.Robot
) -> None:
    """The median of six points is 1.2 times the usual by chance, in one session of five."""
    high = 0
    for seed in range(30):
        few = session(hexapod, true, 6, 100 + seed)
        values = few.values.copy()
        values[2] += 3.0
        first = session(hexapod, true, 30, seed)
        found = fitted(hexapod, first, free="offset*", holdout=replace(few, values=values))
        assert found.holdout_test is not None and 2 in found.holdout_outliers
        high += found.holdout_test.contradicts
        rest = found.holdout_distances.rms_without_outliers / found.holdout_expected
        assert not found.holdout_contradicts or rest > 1.2
    assert high  # else nothing was tested


def test_a_few_held_out_points_that_are_off_are_named(hexapod: pk.Robot, true: pk.Robot) -> None:
    other = session(hexapod, true, 60, 1)
    values = other.values.copy()
    values[[7, 9]] += 3.0
    found = fitted(
        hexapod, session(hexapod, true, 60, 0), free="offset*",
        holdout=replace(other, values=values),
    )  # fmt: skip
    assert found.holdout_outliers == (7, 9) and not found.holdout_contradicts
    assert found.verdict.state == "calibrated"  # by the other points
    assert found.verdict.remarks[0].startswith("2 held-out points are off: row 7, row 9; without")
    assert found.holdout_distances.rms_without_outliers < 0.1 < found.holdout_distances.rms


# --- what repeats and reflectors share -----------------------------------------------------------


@pytest.mark.parametrize("lack", [0.0, 0.05])
@pytest.mark.parametrize("times", [1, 5, 20])
def test_what_is_expected_of_a_holdout_does_not_grow_with_repeats(
    hexapod: pk.Robot, times: int, lack: float
) -> None:
    actual, expected = [], []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        q = hexapod.inverse(pk.sample_poses(hexapod, 60, seed=seed, share=0.5))
        missed = hexapod.forward(q).pose[:, :3] + rng.normal(0, lack, (60, 3))
        values = np.repeat(missed, times, axis=0) + rng.normal(0, 0.02, (60 * times, 3))
        whole = Measurements(np.repeat(q, times, axis=0), values, "position")
        first = np.arange(60 * times) < 45 * times
        found = fitted(hexapod, whole.select(first), free="offset*", holdout=whole.select(~first))
        actual.append(found.holdout_rms**2)
        expected.append(found.holdout_expected**2)
    assert np.sqrt(np.mean(actual) / np.mean(expected)) == pytest.approx(1.0, abs=0.12)


# --- rows that disagree --------------------------------------------------------------------------


def of_arm(
    count: int, seed: int, noise: float = 0.05
) -> tuple[pk.SerialArm, FloatArray, Measurements]:
    rng, arm = np.random.default_rng(seed), six_joints()
    q = rng.uniform(-1.5, 1.5, (count, 6))
    return arm, q, seen_by_tracker(arm, q, rng.normal(0, noise, (count, 3, 3)))


def test_one_pose_that_is_wrong_by_far_is_found_beside_a_linear_fit() -> None:
    """It carries least squares off, which then name no outlier at all."""
    arm, _, measured = of_arm(27, 3)
    values = measured.values.copy()
    values[30:33] += [400.0, -350.0, 250.0]
    found = fitted(arm, replace(measured, values=values), **UNKNOWN)
    assert found.rms > 20.0
    assert found.verdict.state == "not calibrated"
    first = found.verdict.reasons[0]
    assert first.startswith("3 rows disagree with the rest: row 30 (1), row 31 (2), row 32 (3);")
    assert first.endswith("or fit with --loss cauchy (loss='cauchy')")
    robust = fitted(arm, replace(measured, values=values), loss="cauchy", **UNKNOWN)
    assert robust.outliers == (30, 31, 32)
    assert robust.distances.rms_without_outliers < 0.15 < robust.rms
    assert robust.verdict.state == "calibrated"
    assert "78 fitted points besides 3 outliers falls from" in robust.verdict.reasons[0]


def test_clean_calibrations_agree_with_a_robust_fit(hexapod: pk.Robot, true: pk.Robot) -> None:
    for seed in range(12):
        found = fitted(hexapod, session(hexapod, true, 20, seed), free="offset*")
        assert not found.verdict.remarks, found.verdict


def test_outliers_are_named_by_line_and_target(tmp_path: Path) -> None:
    arm, q, measured = of_arm(30, 4)
    values = measured.values.copy()
    values[3 * 12 + 1] += [0.0, 2.0, 0.0]
    lines = ["# a log", ",".join([f"q{i + 1} [rad]" for i in range(6)] + [
        f"{t}.{c} [mm]" for t in "ABC" for c in "xyz"])]  # fmt: skip
    for row, seen in zip(q, values.reshape(-1, 9), strict=True):
        lines.append(",".join(f"{number:.17g}" for number in (*row, *seen)))
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    found = fitted(arm, pk.read_measurements(path), **UNKNOWN)
    assert found.outliers == (37,)
    assert "outliers: row 37: log.csv line 15 (B)" in str(found)


def said_of(robot: pk.Robot, wrong: pk.Measurements, **options: Any) -> str:
    """Reasons of the verdict, or why there is none."""
    try:
        return "; ".join(fitted(robot, wrong, free="offset*", **options, **UNKNOWN).verdict.reasons)
    except ValueError as error:
        return str(error)


@pytest.mark.parametrize("by", [1, -1, 2])
def test_readings_beside_the_wrong_rows_are_found(
    hexapod: pk.Robot, true: pk.Robot, by: int
) -> None:
    """The machine then fits nothing, or cannot reach what it reads."""
    measured = session(hexapod, true, 40, 5)
    wrong = replace(measured, values=np.roll(measured.values, by, axis=0))
    text = said_of(hexapod, wrong)
    where = "before" if by > 0 else "after"
    assert f"each reading belongs to the row {abs(by)} {where} it" in text


@pytest.mark.parametrize("by", [2, -2])
def test_they_are_found_although_every_other_row_was_left_out(
    hexapod: pk.Robot, true: pk.Robot, by: int
) -> None:
    measured = session(hexapod, true, 40, 5)
    wrong = replace(measured, values=np.roll(measured.values, by, axis=0))
    text = said_of(hexapod, wrong, drop=list(range(1, 40, 2)))
    where = "before" if by > 0 else "after"
    assert f"each reading belongs to the row 2 {where} it" in text


def test_readings_that_nothing_makes_fit_have_no_such_cause(hexapod: pk.Robot) -> None:
    """The machine reaches none of these rows, whichever of them a reading belongs to."""
    q = 1e5 * (1.0 + np.random.default_rng(0).random((20, 6)))
    with pytest.raises(ValueError) as said:
        fitted(hexapod, Measurements(q, np.zeros((20, 3)), "position"), free="offset*")
    assert "if " not in str(said.value)


@pytest.mark.parametrize("holdout", [0.2, 0.5])
def test_they_are_found_although_rows_are_missing(
    hexapod: pk.Robot, true: pk.Robot, holdout: float
) -> None:
    """Rows that are held out leave gaps, over which rows are no neighbours."""
    measured = session(hexapod, true, 40, 5)
    wrong = replace(measured, values=np.roll(measured.values, 1, axis=0))
    try:
        found = fitted(hexapod, wrong, free="offset*", holdout=holdout, **UNKNOWN)
        text = "; ".join(found.verdict.reasons)
    except ValueError as error:
        text = str(error)
    assert "each reading belongs to the row 1 before it" in text


def test_they_are_found_although_a_target_was_not_seen() -> None:
    """The rows after it have another place among the targets."""
    arm, _, measured = of_arm(30, 6)
    late = replace(measured, values=np.roll(measured.values, 3, axis=0))
    seen = np.delete(np.arange(len(late)), [16, 40])
    try:
        text = "; ".join(fitted(arm, late.select(seen), **UNKNOWN).verdict.reasons)
    except ValueError as error:
        text = str(error)
    assert "each reading belongs to the pose 1 before it" in text


def test_exchanged_targets_are_found() -> None:
    arm, _, measured = of_arm(30, 6)
    assert measured.target_index is not None
    index = np.array([1, 0, 2])[measured.target_index]
    found = fitted(arm, replace(measured, target_index=index), unknown="frame")
    assert found.verdict.state == "not calibrated"
    assert "if target 1 is 2, 2 is 1" in found.verdict.reasons[0]


# --- few degrees of freedom ----------------------------------------------------------------------


@pytest.fixture(scope="module")
def printer() -> pk.Robot:
    return pk.load(PRINTER / "robot.toml")


def probed(printer: pk.Robot, count: int) -> Measurements:
    whole = pk.read_measurements(PRINTER / "probe.csv", printer)
    return replace(whole, sigma=None).select(np.linspace(0, len(whole) - 1, count).astype(int))


def test_one_spare_equation_is_doubtful_and_has_wide_intervals(printer: pk.Robot) -> None:
    found = fitted(printer, probed(printer, 7))
    assert found.verdict.state == "doubtful"
    assert found.verdict.reasons[0].startswith(
        "only 1 spare equation shows the noise, which may be 0.45 to 32 times what is estimated;"
        " probe 20 points or more"
    )
    assert found.parameter_dof == pytest.approx(np.ones(6))
    half = (found.interval95[:, 1] - found.interval95[:, 0]) / 2
    assert half == pytest.approx(12.706 * found.stderr, rel=1e-4)
    assert "value ± 95 %" in str(found) and "as few as 1 degree" in str(found)


def test_no_spare_equation_has_no_noise_and_no_deviations(printer: pk.Robot) -> None:
    found = fitted(printer, probed(printer, 6), holdout=probed(printer, 12))
    assert found.verdict.state == "doubtful"
    assert np.isnan(found.noise[0]) and np.isnan(found.holdout_expected)
    assert not np.isfinite(found.stderr).any() and not found.parameter_dof.any()
    assert np.isinf(found.interval95).all()
    text = str(found)
    assert "noise" not in text.split("O1")[0].split("\n", 3)[3] and "expected" not in text
    stated = fitted(printer, replace(probed(printer, 6), sigma=0.03))
    assert np.isfinite(stated.stderr).all()


@pytest.mark.parametrize("spare", [0, 1, 2])
def test_chi_squared_is_told_from_one_spare_equation_on(printer: pk.Robot, spare: int) -> None:
    measured = replace(probed(printer, 6 + spare), sigma=0.03)
    found = fitted(printer, measured)
    assert found.dof == spare
    if not spare:
        assert np.isnan(found.chi2_per_dof)
    else:
        squares = float((found.residuals[0] ** 2).sum()) / 0.03**2
        assert found.chi2_per_dof == pytest.approx(squares / spare)


def test_enough_points_are_calibrated(printer: pk.Robot) -> None:
    assert fitted(printer, probed(printer, 25)).verdict.state == "calibrated"


# --- bounds, warnings, little gained -------------------------------------------------------------


def test_a_bound_that_is_reached_is_doubtful(hexapod: pk.Robot, true: pk.Robot) -> None:
    found = fitted(
        hexapod, session(hexapod, true, 40, 0), free="offset*", bounds={"offset4": (-0.1, 0.1)}
    )
    assert found.verdict.state == "doubtful"
    assert found.verdict.reasons[0].startswith("offset4 ended at a bound")


def test_numbers_that_do_not_help_are_doubtful(hexapod: pk.Robot, true: pk.Robot) -> None:
    moved = hexapod.replace({"base3.z": 0.5})
    found = fitted(hexapod, session(hexapod, moved, 40, 0), free="offset1")
    assert found.verdict.state == "doubtful"
    (cause, *_) = [each for each in found.verdict.said if each.check == "causes"]
    assert cause.finding.gain > 0.5  # which says more than that little was gained
    others = [check for check in pk.CHECKS if check.name not in ("causes", "instrument", "sides")]
    (reason, *_) = pk.diagnose(found, others).reasons
    assert reason.startswith("little was gained, the misfit of 40 fitted points")


def test_a_machine_that_was_right_is_calibrated_where_sigma_says_so(hexapod: pk.Robot) -> None:
    measured = replace(session(hexapod, hexapod, 40, 0), sigma=0.02)
    assert fitted(hexapod, measured, free="offset*").verdict.state == "calibrated"


# --- a stated sigma that the residuals refute -----------------------------------------------------


@pytest.mark.parametrize("rule", ["classical", "cluster"])
@pytest.mark.parametrize("loss", ["linear", "huber", "cauchy"])
def test_a_sigma_too_small_by_two_and_a_half_is_always_noted(
    hexapod: pk.Robot, true: pk.Robot, loss: str, rule: str
) -> None:
    """Whichever covariance makes ± right, the reader learns that sigma or the model is not."""
    measured = replace(session(hexapod, true, 40, 0), sigma=0.02 / 2.5)
    found = fitted(hexapod, measured, free="offset*", loss=(loss, rule))
    assert found.verdict.state == "calibrated"
    (note,) = found.verdict.remarks
    assert note.endswith(": sigma is too small, or numbers that are not free are wrong")
    sound = replace(session(hexapod, true, 40, 0), sigma=0.02)
    right = fitted(hexapod, sound, free="offset*", loss=(loss, rule))
    assert not any("sigma is too small" in text for text in right.verdict.remarks)


def test_errors_that_poses_share_do_not_hide_that_sigma_is_too_small() -> None:
    """Their covariance needs no sigma, so nothing was widened, and nothing was said."""
    arm, q, _ = of_arm(24, 5)
    rng = np.random.default_rng(5)
    errors = rng.normal(0, 0.02, (24, 3, 3)) + rng.normal(0, 0.05, (24, 1, 3))
    measured = replace(seen_by_tracker(arm, q, errors), sigma=0.02)
    found = fitted(arm, measured, **UNKNOWN)
    assert found.covariance_rule == "cluster" and found.verdict.state == "calibrated"
    assert any("times what sigma says" in text for text in found.verdict.remarks)


@pytest.mark.parametrize("loss", ["huber", "cauchy"])
@pytest.mark.parametrize("seed", range(4))
def test_rows_that_a_robust_loss_weighs_down_say_nothing_about_sigma(
    hexapod: pk.Robot, true: pk.Robot, loss: str, seed: int
) -> None:
    measured = session(hexapod, true, 30, seed)
    values = measured.values.copy()
    values[[4, 17]] += 5.0  # 250 times sigma
    gross = replace(measured, values=values, sigma=0.02)
    found = fitted(hexapod, gross, free="offset*", loss=loss)
    assert {4, 17} <= set(found.outliers)
    assert found.verdict.state == "calibrated" and not found.verdict.remarks


@pytest.mark.parametrize("loss", ["linear", "huber", "cauchy"])
def test_a_sigma_that_no_slip_explains_is_doubtful(
    hexapod: pk.Robot, true: pk.Robot, loss: str
) -> None:
    measured = replace(session(hexapod, true, 40, 0), sigma=0.02 / 6)
    found = fitted(hexapod, measured, free="offset*", loss=loss)
    assert found.verdict.state == "doubtful"
    assert "times what sigma says" in found.verdict.reasons[0]
    assert loss != "cauchy" or "cauchy" not in found.verdict.reasons[0]  # it was fitted with it


# --- a prior that is contradicted ----------------------------------------------------------------


def test_a_contradicted_prior_neither_wins_nor_is_silent() -> None:
    """Noise and prior do not excuse each other: the noise is what the data alone show."""
    rng, arm = np.random.default_rng(5), six_joints()
    true = arm.replace(3.4 * rng.normal(size=(6, 6)) * [1, 1, 1, 1e-3, 1e-3, 1e-3])
    q = rng.uniform(-1.5, 1.5, (60, 6))
    measured = seen_by_tracker(true, q, rng.normal(0, 0.15, (60, 3, 3)))
    fit, out = measured.select(np.arange(108)), measured.select(np.arange(108, 180))
    noises, held = [], []
    for prior in (0.35, 1.0, 10.0):
        found = fitted(arm, fit, prior=prior, holdout=out, **UNKNOWN)
        noises.append(found.noise[0])
        held.append(found.holdout_rms)
        contradicted = found.prior_test is not None and found.prior_test.contradicted
        assert contradicted is (prior < 3)
        said = any("contradict the prior" in text for text in found.verdict.reasons)
        assert said is contradicted
        assert (found.verdict.state == "calibrated") is not contradicted
    assert noises == pytest.approx([0.155] * 3, rel=0.02)
    assert held[0] < 0.40


def test_a_deviation_that_nothing_shows_is_infinite_not_small(hexapod: pk.Robot) -> None:
    """Two poses meet six numbers exactly, however often they are read: clusters show nothing."""
    rng = np.random.default_rng(0)
    q = np.repeat(hexapod.inverse(hexapod_poses(hexapod, 2, rng)), 20, axis=0)
    values = hexapod.forward(q).pose[:, :3] + rng.normal(0, 0.02, (40, 3))
    measured = Measurements(q, values, "position")
    found = fitted(hexapod, measured, free="offset*", loss="cluster")
    assert np.isinf(found.stderr).all() and np.isinf(found.interval95).all()
    assert np.isfinite(fitted(hexapod, measured, free="offset*").stderr).all()
