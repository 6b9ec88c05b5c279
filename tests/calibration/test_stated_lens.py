"""A lens with the uncertainty of its own calibration: fitted along, counted in the ±."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.readings import Camera
from pkmcal.readings.lens import covariance_of_lens

from ..diagnostics.test_pictures import LENS, fitted, pictures, with_lens

SIGMA = np.array([3, 3, 2, 2, 5e-3, 1e-2, 2e-4, 2e-4, 0])
YAML = """%YAML:1.0
---
cameraResolution: [ 1280, 800 ]
cameraMatrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 1500., 0., 640., 0., 1500., 400., 0., 0., 1. ]
dist_coeffs: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -0.15, 0.1, 0., 0., 0. ]
"""
DEVIATIONS = """cameraMatrix_std_dev: !!opencv-matrix
   rows: 4
   cols: 1
   dt: d
   data: [ {fx}, 4., 2., 3. ]
dist_coeffs_std_dev: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ 0.01, 0.02, 0., 0., 0. ]
"""


def by_itself(found: pk.Identification) -> float:
    return float(np.sqrt(np.mean(found._by_itself() ** 2)))


@pytest.fixture(scope="module")
def sound() -> pk.Measurements:
    return pictures()


@pytest.fixture(scope="module")
def exact(sound: pk.Measurements) -> pk.Identification:
    """With the lens as it is, held."""
    return fitted(sound)


@pytest.fixture(scope="module")
def apart(sound: pk.Measurements) -> pk.Identification:
    """With a stated deviation of each number of the lens."""
    return fitted(with_lens(sound, lens_sigma=SIGMA))


def test_a_stated_lens_that_is_off_is_pulled_back_and_a_held_one_is_not(
    sound: pk.Measurements, exact: pk.Identification
) -> None:
    wrong = {"fx": LENS["fx"] + 12.0, "fy": LENS["fy"] + 12.0, "cx": LENS["cx"] - 12.0}
    stated = fitted(with_lens(sound, **wrong, lens_sigma=4 * SIGMA))
    held = fitted(with_lens(sound, **wrong))
    camera = stated.instruments[0]
    assert isinstance(camera, Camera)
    assert abs(camera.cx - LENS["cx"]) < 5.0 and abs(camera.fx - LENS["fx"]) < 12.0
    assert stated.actuator_noise < 1.3 * exact.actuator_noise
    assert held.actuator_noise > 1.5 * stated.actuator_noise
    assert not any(name.startswith("lens") for name in stated.free) or stated.nuisances


def test_the_surer_the_lens_the_surer_the_numbers_between_held_and_free(
    sound: pk.Measurements, exact: pk.Identification, apart: pk.Identification
) -> None:
    free = fitted(with_lens(sound, lens="all"))
    ends, at = (
        [each.parameters["frame.z"]["stderr"] for each in several]
        for several in (
            (exact, free),
            (
                fitted(with_lens(sound, lens_sigma=1e-4 * SIGMA)),
                apart,
                fitted(with_lens(sound, lens_sigma=1e4 * SIGMA)),
            ),
        )
    )
    assert at == sorted(at)
    np.testing.assert_allclose([at[0], at[2]], ends, rtol=0.02)


def test_deviations_and_their_covariance_are_one_statement(
    sound: pk.Measurements, apart: pk.Identification
) -> None:
    other = fitted(with_lens(sound, lens_sigma=np.diag(SIGMA**2)))
    np.testing.assert_array_equal(apart.values, other.values)


def test_correlations_of_a_lens_count(sound: pk.Measurements, apart: pk.Identification) -> None:
    covariance = np.diag(SIGMA**2)
    covariance[0, 1] = covariance[1, 0] = (1.0 - 1e-6) * SIGMA[0] * SIGMA[1]
    together = fitted(with_lens(sound, lens_sigma=covariance)).instruments[0]
    alone = apart.instruments[0]
    assert isinstance(together, Camera) and isinstance(alone, Camera)
    moved = together.fx - LENS["fx"], together.fy - LENS["fy"]
    assert moved[0] == pytest.approx(moved[1], abs=0.02)
    assert abs((alone.fx - LENS["fx"]) - (alone.fy - LENS["fy"])) > 0.02


def test_what_is_no_covariance_of_a_lens_is_refused() -> None:
    for given in (np.ones(8), -SIGMA, np.ones((9, 9)), np.triu(np.ones((9, 9)))):
        with pytest.raises(pk.ArgumentError, match="lens_sigma"):
            covariance_of_lens(given)
    assert not covariance_of_lens(np.zeros(9)).any()


def test_deviations_of_opencvs_interactive_calibration_are_read(tmp_path: Path) -> None:
    path = tmp_path / "lens.yaml"
    path.write_text(YAML + DEVIATIONS.format(fx="4."))
    camera = Camera.from_file(path)
    assert (camera.width, camera.height) == (1280, 800)
    sigma = np.sqrt(np.diagonal(np.asarray(camera.lens_sigma)))
    np.testing.assert_allclose(sigma, [4, 4, 2, 3, 0.01, 0.02, 0, 0, 0])


def test_a_focal_length_in_proportion_to_the_other_is_wrong_with_it(tmp_path: Path) -> None:
    path = tmp_path / "lens.yaml"
    path.write_text(YAML + DEVIATIONS.format(fx="0."))
    covariance = np.asarray(Camera.from_file(path).lens_sigma)
    assert covariance[0, 0] == covariance[1, 1] == 16.0
    assert covariance[0, 1] == pytest.approx(16.0, rel=1e-5)
    assert not np.isnan(covariance_of_lens(covariance)).any()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("stdDeviationsIntrinsics: [ -1, 1, 1, 1 ]\n", "0 or above"),
        ("lens_covariance: [ 1, 2, 3 ]\n", "3 numbers, 9 x 9"),
        ("cameraMatrix_std_dev: [ 1, 2 ]\n", "2 numbers, 4 are needed"),
        ("stdDeviationsIntrinsics: see sheet 3\n", "expected a list of finite numbers"),
        ('lens_covariance: "9 x 9, in another file"\n', "expected a list of finite numbers"),
        ("standard_deviations:\n  fx: 1.0\n  fy: 1.0\n", "expected a list of finite numbers"),
        ("dist_coeffs_std_dev: [ .nan, 1, 1, 1, 1 ]\n", "expected a list of finite numbers"),
    ],
)
def test_deviations_that_do_not_fit_name_file_and_line(
    tmp_path: Path, text: str, message: Any
) -> None:
    path = tmp_path / "lens.yaml"
    path.write_text(YAML + text)
    with pytest.raises(pk.FileError, match=f"lens.yaml, line 14: .*{message}"):
        Camera.from_file(path)
