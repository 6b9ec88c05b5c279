"""The demonstration: a machine with 28 unknown errors goes where it should after calibration."""

from __future__ import annotations

import csv
import hashlib
import struct
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.calibration.identify import identify
from pkmcal.cli import demonstration as demo
from pkmcal.cli.demonstration import NOISE, SIGMA, Demonstration, demonstrate


@pytest.fixture(scope="module")
def result() -> Demonstration:
    return demonstrate()


@pytest.fixture(scope="module")
def files(result: Demonstration, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("demo")
    result.write(folder)
    return folder


def rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(error**2)))


def test_error_falls_from_a_millimetre_to_what_the_noise_allows(result: Demonstration) -> None:
    assert 0.5 < rms(result.before) < 2.0
    assert rms(result.after) < 2 * result.expected
    assert result.expected < NOISE * np.sqrt(3)
    assert result.after.max() < 0.1 * result.before.min()


def test_machine_has_28_errors_of_half_a_millimetre_of_which_two_reflectors_tell_26(
    result: Demonstration,
) -> None:
    nominal = pk.load("2tpr2tps")
    off = result.true_robot.geometry.values - nominal.geometry.values
    assert np.count_nonzero(off) == len(result.identification.free) == 28
    assert 0.5 * SIGMA < rms(off[off != 0]) < 1.5 * SIGMA
    assert result.identification.rank == 26


def test_errors_found_are_as_far_off_as_their_standard_deviations_say() -> None:
    """Over eight machines: errors of one are correlated, and all large or all small together."""
    squares = []
    for seed in range(1, 9):
        other = demonstrate(seed)
        found = other.identification
        truth = np.array([other.true_robot.geometry[name] for name in found.free])
        squares.append(np.mean(((found.values - truth) / found.stderr) ** 2))
    assert np.sqrt(np.mean(squares)) == pytest.approx(1.0, abs=0.3)


def test_poses_are_tilted_and_within_the_strokes(result: Demonstration) -> None:
    strokes = np.array([limb.stroke for limb in pk.load("2tpr2tps").model.limbs])
    for q in (result.measured.actuators, result.ideal, result.corrected):
        assert (q > strokes[:, 0]).all() and (q < strokes[:, 1]).all()
    tilts = np.degrees(np.abs(result.true_robot.forward(result.measured.actuators).pose[:, 3:5]))
    assert (tilts.max(axis=0) > 15).all()


def test_no_pose_that_is_checked_was_measured(result: Demonstration) -> None:
    assert (len(result.measured), len(result.poses)) == (2 * 30, 100)
    measured = {tuple(row) for row in result.measured.actuators.tolist()}
    assert not measured & {tuple(row) for row in result.ideal.tolist()}


def test_before_and_after_are_where_the_true_machine_goes(result: Demonstration) -> None:
    for q, distance in ((result.ideal, result.before), (result.corrected, result.after)):
        reached = result.true_robot.forward(q)
        assert reached.ok.all()
        off = np.linalg.norm((reached.pose - result.poses)[:, :3], axis=1)
        np.testing.assert_array_equal(distance, off)


def test_same_seed_gives_the_same_numbers_and_another_seed_others(result: Demonstration) -> None:
    again, other = demonstrate(1), demonstrate(2)
    for name in ("poses", "ideal", "corrected", "before", "after"):
        np.testing.assert_array_equal(getattr(again, name), getattr(result, name))
        assert (getattr(other, name) != getattr(result, name)).any()


@pytest.mark.parametrize("seed", range(2, 8))
def test_other_machines_are_calibrated_as_well(seed: int) -> None:
    other = demonstrate(seed)
    assert other.trusted
    assert rms(other.after) < 2 * other.expected


def test_two_reflectors_tell_the_tilt_that_one_does_not(result: Demonstration) -> None:
    assert rms(result.tilt_after) < 0.1 * rms(result.tilt_before)
    one = result.measured.select(slice(0, None, 2))
    assert len(np.unique(one.target, axis=0)) == 1
    found = identify(pk.load("2tpr2tps"), one, prior=SIGMA)
    reached = result.true_robot.forward(found.robot.inverse(result.poses)).pose
    tilt = np.linalg.norm((reached - result.poses)[:, 3:], axis=1)
    assert rms(tilt) > 5 * rms(result.tilt_after)


# --- files ---------------------------------------------------------------------------------------


def test_measurements_written_lead_to_the_same_machine(result: Demonstration, files: Path) -> None:
    nominal = pk.load("2tpr2tps")
    found = identify(nominal, pk.read_measurements(files / "measured.csv", nominal), prior=SIGMA)
    written = pk.load(files / "robot.toml").geometry
    np.testing.assert_array_equal(written.values, result.identification.robot.geometry.values)
    np.testing.assert_array_equal(found.robot.geometry.values, written.values)


def test_leg_lengths_written_are_the_corrected_ones(result: Demonstration, files: Path) -> None:
    with open(files / "corrected.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    assert len(rows) == 100
    for i in range(4):
        q = np.array([float(row[f"q{i + 1} [mm]"]) for row in rows])
        dq = np.array([float(row[f"dq{i + 1} [mm]"]) for row in rows])
        np.testing.assert_allclose(q, result.corrected[:, i], rtol=0, atol=0.51e-4)
        np.testing.assert_allclose(q - dq, result.ideal[:, i], rtol=0, atol=1.01e-4)
    tilt = np.radians([[float(row["alpha [deg]"]), float(row["beta [deg]"])] for row in rows])
    np.testing.assert_allclose(tilt, result.poses[:, 3:5], rtol=0, atol=1e-12)


def test_tables_say_what_they_were_made_of(files: Path) -> None:
    head = f"# Written by pkmcal {pk.__version__} from\n#   built-in machine 2tpr2tps, sha256 "
    for name in ("measured.csv", "checked.csv", "corrected.csv"):
        assert head in (files / name).read_text(encoding="utf-8")
    digest = hashlib.sha256((files / "measured.csv").read_bytes()).hexdigest()
    assert f"#   measured.csv, sha256 {digest}\n" in (files / "corrected.csv").read_text("utf-8")


def test_figure_is_a_picture_of_a_size_to_read(files: Path) -> None:
    content = (files / "error.png").read_bytes()
    assert content.startswith(b"\x89PNG\r\n\x1a\n")
    width, height = struct.unpack(">II", content[16:24])
    assert 600 <= width <= 1600
    assert 300 <= height <= 1200


def test_figure_shows_every_pose_with_units_and_legend(
    result: Demonstration, monkeypatch: pytest.MonkeyPatch
) -> None:
    from matplotlib.figure import Figure

    drawn: list[Figure] = []
    monkeypatch.setattr(Figure, "savefig", lambda self, *a, **k: drawn.append(self))
    demo._figure(result)
    (axes,) = drawn[0].axes
    before, after, noise = axes.lines
    np.testing.assert_array_equal(before.get_ydata(), result.before)
    np.testing.assert_array_equal(after.get_ydata(), result.after)
    np.testing.assert_allclose(noise.get_ydata(), NOISE * np.sqrt(3))
    assert axes.get_ylabel().endswith("[mm]") and axes.get_yscale() == "log"
    (legend,) = drawn[0].legends
    assert [text.get_text() for text in legend.get_texts()] == [
        line.get_label() for line in axes.lines
    ]
    low, high = axes.get_ylim()
    assert low < result.after.min() and high > result.before.max()
