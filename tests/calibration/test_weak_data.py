"""What is said where data say little: few rows, weak combinations, a machine that was good."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import f as f_distribution

import pkmcal as pk
from pkmcal.calibration.identification import Identification
from pkmcal.diagnostics.robust_check import robust_check
from pkmcal.measurements.measurements import Measurements
from pkmcal.statistics.linear_fit import column_basis
from pkmcal.statistics.robust_scale import ratio_by_chance, robust_ratio

from ..robots import linear_delta
from ..simulated import hexapod_poses

RUNS = [pytest.param(20, id="quick"), pytest.param(500, id="500 runs", marks=pytest.mark.slow)]


def fitted(robot: Any, measured: Any, free: Any = "offset*", **options: Any) -> Identification:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return pk.identify(robot, measured, free, **options)


def positions(
    robot: pk.Robot, true: pk.Robot, count: int, seed: int, repeats: int = 1
) -> Measurements:
    rng = np.random.default_rng(seed)
    q = np.repeat(robot.inverse(hexapod_poses(robot, count, rng)), repeats, axis=0)
    seen = true.forward(q).pose[:, :3]
    return Measurements(q, seen + rng.normal(0, 0.02, seen.shape), "position")


def heights(count: int, seed: int) -> tuple[pk.Robot, Measurements]:
    """What a delta's probe reads of a flat bed, its arms as drawn."""
    rng, robot = np.random.default_rng(seed), linear_delta()
    true = robot.replace({f"offset{i}": rng.normal(0, 0.3) for i in (1, 2, 3)})
    radius, angle = 110 * np.sqrt(rng.random(count)), rng.uniform(0, 2 * np.pi, count)
    poses = np.zeros((count, 6))
    poses[:, :2] = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    return robot, Measurements(true.inverse(poses), rng.normal(0, 0.02, count), "height")


SIX = ["offset*", "base1.x", "base2.x", "base3.y"]


# --- a robust fit beside few rows ----------------------------------------------------------------


@pytest.mark.parametrize("runs", RUNS)
def test_good_heights_hardly_ever_disagree_with_each_other(runs: int) -> None:
    """Of twelve rows, six of which a robust fit meets exactly, the median says little."""
    said = grave = 0
    for seed in range(runs):
        robot, measured = heights(12 + seed % 9, seed)
        verdict = fitted(robot, measured, SIX).verdict
        said += any("disagree" in text for text in verdict.remarks)
        grave += verdict.state == "not calibrated"
    assert said <= 1 + 0.03 * runs and grave <= 0.005 * runs


def test_what_chance_does_to_the_ratio_depends_on_the_rows() -> None:
    rng = np.random.default_rng(0)
    for rows, least, most in ((12, 3.0, 60.0), (40, 1.2, 2.0)):
        design = column_basis(rng.normal(size=(rows, 6)))
        ones = np.ones(rows, dtype=np.intp)
        by_chance = ratio_by_chance(design, ones)
        assert least < by_chance < most
        others = rng.normal(size=(50, rows))
        left = others - (others @ design) @ design.T
        beyond = sum(robust_ratio(design, each, ones) > by_chance for each in left)
        assert beyond <= 3
    assert ratio_by_chance(column_basis(rng.normal(size=(400, 6))), np.ones(400, np.intp)) == 1.0


def test_a_row_far_off_is_still_found_among_few() -> None:
    robot, measured = heights(25, 3)
    values = measured.values.copy()
    values[7] += 3.0
    verdict = fitted(robot, replace(measured, values=values), SIX).verdict
    assert verdict.state == "not calibrated"
    assert verdict.reasons[0].startswith("1 row disagrees with the rest: row 7;")


def test_the_ratio_of_both_noises_is_that_of_the_least_squares_over_the_true_one(
    hexapod: pk.Robot,
) -> None:
    """24 numbers of 20 positions, two of them far off: the robust fit leaves the noise there is."""
    noise = []
    for seed in range(8):
        measured = positions(hexapod, hexapod.replace({"offset1": 0.4}), 20, seed)
        values = measured.values.copy()
        values[3] += [5.0, 0.0, 0.0]
        values[11] += [0.0, -4.0, 3.0]
        found = fitted(hexapod, replace(measured, values=values), ["offset*", "base*"])
        check = robust_check(found.fit)
        assert found.rank == 24 and check is not None and check.rows == (3, 11)
        plain = np.sqrt((found.residuals[0] ** 2).sum() / (60 - 24))
        noise.append(plain / check.ratio)
    assert np.mean(noise) == pytest.approx(0.02, rel=0.15)  # within 3.4 deviations


def test_a_length_far_off_among_belts_is_said_with_the_misfit_of_the_closures() -> None:
    robot = pk.load("examples/belts/robot.toml")
    log = pk.read_measurements("examples/belts/belts.csv", robot)
    good = pk.identify(robot, log)
    actuators = log.actuators.copy()
    actuators[7, 2] += 30.0
    with pytest.warns(pk.CalibrationWarning):
        found = pk.identify(robot, replace(log, actuators=actuators))
    said = re.search(
        r"line 9; a robust fit leaves ([\d.]+) mm in the others, this one ([\d.]+) mm in all",
        found.verdict.reasons[0],
    )
    assert said is not None
    assert float(said[1]) == pytest.approx(good.closure_rms, rel=0.2)
    assert float(said[2]) == pytest.approx(found.closure_rms, rel=5e-3)


# --- rows held out -------------------------------------------------------------------------------


@pytest.mark.parametrize("runs", RUNS)
def test_held_out_rows_are_named_falsely_in_one_fit_of_a_hundred(
    hexapod: pk.Robot, runs: int
) -> None:
    """Also where the noise is estimated from few equations and readings differ in direction."""
    named = 0
    for seed in range(runs):
        measured = positions(hexapod, hexapod.replace({"offset1": 0.4}), 14, seed)
        named += bool(fitted(hexapod, measured, holdout=0.3).holdout_outliers)
    assert named <= 2 + 0.02 * runs


def test_repeats_of_fitted_poses_are_no_proof_elsewhere(hexapod: pk.Robot) -> None:
    whole = positions(hexapod, hexapod.replace({"offset1": 0.4}), 20, 4, repeats=2)
    first = np.arange(40) % 2 == 0
    first[-6:] = [True] * 4 + [False] * 2  # two poses are fitted alone, one is held out alone
    found = fitted(hexapod, whole.select(first), holdout=whole.select(~first))
    assert found.verdict.remarks[-1].startswith("17 of the held-out points are at poses that were")
    drawn = fitted(hexapod, whole, holdout=0.3)
    assert not any("fitted as well" in text for text in drawn.verdict.remarks)


def test_a_reading_of_minus_zero_is_a_reading_of_zero(hexapod: pk.Robot) -> None:
    """One repeat of a pose at -0.0 mm, the other at 0.0: it is the same pose."""
    poses = hexapod_poses(hexapod, 12, np.random.default_rng(7))
    robot = hexapod.replace({"offset1": float(hexapod.inverse(poses[:1])[0, 0])})
    q = robot.inverse(poses)
    assert abs(q[0, 0]) < 1e-9
    q[0, 0] = 0.0
    seen = robot.forward(q).pose[:, :3] + np.random.default_rng(8).normal(0, 0.02, (12, 3))
    again = q[:1].copy()
    again[0, 0] = -0.0
    held = Measurements(again, seen[:1] + 0.01, "position")
    found = fitted(robot, Measurements(q, seen, "position"), holdout=held)
    assert found.verdict.remarks[-1].startswith("1 of the held-out points are at poses that were")


@pytest.mark.parametrize("spare", [1, 2, 4])
def test_how_far_off_points_must_be_to_contradict_few_equations(spare: int) -> None:
    robot, whole = heights(18 + spare, 1)
    rows = np.arange(len(whole))
    told = fitted(
        robot, whole.select(rows < 6 + spare), SIX, holdout=whole.select(rows >= 6 + spare)
    )
    assert told.holdout_test is not None
    limit = told.holdout_test.least_ratio
    assert f"contradict the fit only from {limit:.2g} times what is" in str(told.verdict.reasons)
    first, second = told.holdout_test.freedom
    # squares of points that share errors are more skew than those of F, whose tail is then lower
    assert 0.0045 < f_distribution.sf(limit**2, first, second) < 0.005 * (1.0 + 1e-6)


def test_five_spare_equations_are_five_whatever_the_last_bit_says() -> None:
    for seed in range(8):
        robot, measured = heights(11, seed)
        assert fitted(robot, measured, SIX).verdict.state == "calibrated"


# --- combinations that are hardly determined -----------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_heights_of_a_planar_machine_calibrate_nothing(seed: int) -> None:
    """The noise in how the frame is tilted would seem to show the machine; see its ±."""
    robot = pk.load("3rrr-planar")
    q = robot.inverse(pk.sample_poses(robot, 60, seed=1))
    values = 10 + np.random.default_rng(seed).normal(0, 0.02, 60)
    measured = Measurements(q, values, "height", sigma=0.02, target=[30, -20, 10])
    for options in ({"unknown": "frame"}, {"unknown": "target"}, {}):
        try:
            verdict = fitted(robot, measured, **options).verdict
        except ValueError as error:
            assert not options and "depend on none of offset1" in str(error)
            continue
        assert verdict.state != "calibrated"
        if options["unknown"] == "target":
            assert verdict.reasons[0].startswith("these measurements determine no number of the")


def test_deviations_that_the_machine_cannot_take_are_said_to_say_little() -> None:
    robot = pk.load("3rrr-planar")
    q = robot.inverse(pk.sample_poses(robot, 60, seed=1))
    values = 10 + np.random.default_rng(0).normal(0, 0.02, 60)
    measured = Measurements(q, values, "height", sigma=0.02, target=[30, -20, 10])
    reasons = fitted(robot, measured, unknown="frame").verdict.reasons
    assert "offset1 … offset3 are hardly determined: the machine could not even be" in reasons[0]


def test_a_prior_that_holds_a_weak_combination_is_no_reason(hexapod: pk.Robot) -> None:
    measured = positions(hexapod, hexapod.replace({"offset1": 0.4}), 30, 0)
    reasons = fitted(hexapod, measured, None, prior=10.0).verdict.reasons
    assert not any("hardly determined" in text for text in reasons)


# --- a machine that was good, and a sigma that is not ---------------------------------------------


def test_a_good_machine_is_not_said_to_have_other_errors(hexapod: pk.Robot) -> None:
    once = fitted(hexapod, positions(hexapod, hexapod, 20, 1)).verdict
    assert once.state == "doubtful"
    assert "the noise of a machine that was good already" in once.reasons[0]
    repeated = fitted(hexapod, positions(hexapod, hexapod, 20, 1, repeats=3))
    assert repeated.lack_of_fit_chance > 0.01 and repeated.verdict.state == "calibrated"
    stated = replace(positions(hexapod, hexapod, 20, 1), sigma=np.full((20, 3), 0.02))
    assert fitted(hexapod, stated).verdict.state == "calibrated"


@pytest.mark.parametrize("off", [0.0, 0.5])
def test_what_the_model_misses_beyond_repeats_is_in_the_summary(
    hexapod: pk.Robot, off: float
) -> None:
    """A joint that is not free is elsewhere, or nothing is."""
    true = hexapod.replace({"base6.z": hexapod.geometry["base6.z"] + off, "offset1": 0.3})
    found = fitted(hexapod, positions(hexapod, true, 20, 1, repeats=3), "offset1")
    said = " ".join(str(found).split())
    assert f"repeats scatter by {found.repeatability:.3g} mm, " in said
    beyond = f"lack of fit beyond that {found.lack_of_fit:.3g} mm"
    assert (beyond in said) == bool(off) and ("no lack of fit beyond that" in said) != bool(off)


def test_the_prior_of_a_robust_fit_is_not_tested(hexapod: pk.Robot) -> None:
    measured = positions(hexapod, hexapod.replace({"offset1": 0.4}), 30, 0)
    assert fitted(hexapod, measured, prior=1.0).prior_test is not None
    assert fitted(hexapod, measured, prior=1.0, loss="huber").prior_test is None


def test_little_gained_counts_also_where_sigma_says_that_much_is_left(hexapod: pk.Robot) -> None:
    true = hexapod.replace({"base6.z": hexapod.geometry["base6.z"] + 0.03})
    measured = replace(positions(hexapod, true, 20, 2), sigma=np.full((20, 3), 0.02))
    found = fitted(hexapod, measured, "offset1")
    assert 2.0 < found.chi2_per_dof < 9.0
    assert found.verdict.state == "doubtful"
    naming = ("causes", "instrument", "sides")  # these name numbers
    others = [check for check in pk.CHECKS if check.name not in naming]
    (reason,) = pk.diagnose(found, others).reasons
    assert reason.startswith("little was gained")
    assert "numbers that are not free are wrong, or sigma is" in reason


def test_a_sigma_that_is_far_too_large_is_said(hexapod: pk.Robot) -> None:
    measured = positions(hexapod, hexapod.replace({"offset1": 0.4}), 20, 3)
    for sigma, said in ((0.02, False), (0.03, False), (0.2, True)):
        found = fitted(hexapod, replace(measured, sigma=np.full((20, 3), sigma)))
        assert found.verdict.state == "calibrated"
        assert any("times what sigma says" in text for text in found.verdict.remarks) is said


# --- numbers whose squares are none --------------------------------------------------------------


@pytest.mark.parametrize("value", [1e308, 1e-308, 1e200, 1e-200, 10**400])
def test_priors_and_sigmas_whose_squares_are_no_numbers_are_refused_by_name(
    hexapod: pk.Robot, value: float
) -> None:
    measured = positions(hexapod, hexapod, 10, 0)
    for prior in (value, {"offset1": value}):
        with pytest.raises(ValueError, match=r"prior.* must lie between 1e-15 and 1e\+15"):
            pk.identify(hexapod, measured, "offset*", prior=prior)
    if isinstance(value, float):
        with pytest.raises(ValueError, match=r"sigma must lie between 1e-100 and 1e\+100"):
            replace(measured, sigma=np.full((10, 3), value))


def test_the_widest_and_narrowest_priors_are_taken(hexapod: pk.Robot) -> None:
    measured = positions(hexapod, hexapod.replace({"offset1": 0.4}), 20, 0)
    free = fitted(hexapod, measured)
    for wide in (1e15, np.inf):
        assert fitted(hexapod, measured, prior=wide).values == pytest.approx(free.values, abs=1e-6)
    narrow = fitted(hexapod, measured, prior=1e-15)
    assert narrow.values == pytest.approx(narrow.start, abs=1e-12)
