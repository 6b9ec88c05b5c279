"""Files of lenses as programs write them: read in full or refused; no number is dropped."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.readings.lens_files import read_lens

MATRIX = "[1000.0, 0.0, 640.0, 0.0, 1001.0, 360.0, 0.0, 0.0, 1.0]"
LENS = {
    "fx": 1000.0, "fy": 1001.0, "cx": 640.0, "cy": 360.0, "k1": 0.1, "k2": -0.2, "p1": 0.001,
    "p2": 0.002, "k3": 0.03,
}  # fmt: skip
BLOCK = (
    "- - 1000.0\n  - 0.0\n  - 640.0\n- - 0.0\n  - 1001.0\n  - 360.0\n- - 0.0\n  - 0.0\n  - 1.0\n"
)


def read(tmp_path: Path, text: str) -> dict[str, Any]:
    file = tmp_path / "lens.yaml"
    file.write_text(text)
    return read_lens(file)


@pytest.mark.parametrize(
    "text",
    [
        # yaml.dump of lists, nested and not; a topic of ROS 2; the words of ChArUco scripts
        f"camera_matrix:\n{BLOCK}dist_coeff:\n- - 0.1\n  - -0.2\n  - 0.001\n  - 0.002\n  - 0.03\n",
        f"camera_matrix: {MATRIX}\ndist_coeff:\n- [0.1, -0.2, 0.001, 0.002, 0.03]\n",
        "d:\n- 0.1\n- -0.2\n- 0.001\n- 0.002\n- 0.03\nk:\n" + BLOCK.replace("- -", "-"),
        f'{{"K": {MATRIX}, "dist": [[0.1, -0.2, 0.001, 0.002, 0.03]]}}',
        f"camera_matrix: {{rows: 3, cols: 3, data: {MATRIX}}}\n"
        "distortion_coefficients: {rows: 1, cols: 5, data: [0.1, -2e-1, 1E-3, 2.0e-3, .03]}\n",
    ],
)
def test_the_distortion_is_read_however_its_list_is_written(tmp_path: Path, text: str) -> None:
    assert read(tmp_path, text) == LENS


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        (f"# a lens\nK: {MATRIX}\nwidth: 9\nD: [0.1, nought]\n", 4, "d: expected a list"),
        ('{"width": 9,\n\n "K": [1, 0, 2]}', 3, "expected a camera matrix of 9 numbers"),
        (f"model: x\nK: {MATRIX}\ndistortion_model: equidistant\n", 3, "distortion model"),
        (f"roi: {{x_offset: -1, y_offset: 2}}\nK: {MATRIX}\n", 1, "roi: x_offset"),
    ],
)
def test_what_is_wrong_in_a_lens_file_has_its_line(
    tmp_path: Path, text: str, line: int, message: str
) -> None:
    with pytest.raises(pk.FileError, match=rf"lens\.yaml, line {line}: {message}"):
        read(tmp_path, text)


def test_a_matrix_written_column_by_column_is_turned(tmp_path: Path) -> None:
    """As Open3D does; taken row by row the middle of the lens would be 0, 0."""
    text = '{"width": 1280, "height": 720, "intrinsic_matrix": [9, 0, 0, 0, 8, 0, 6.4, 3.6, 1]}'
    assert read(tmp_path, text) == {
        "fx": 9.0, "fy": 8.0, "cx": 6.4, "cy": 3.6, "width": 1280, "height": 720
    }  # fmt: skip


@pytest.mark.parametrize("empty", ["D: []", "", "D: null"])
def test_a_lens_without_distortion_has_none(tmp_path: Path, empty: str) -> None:
    assert not read(tmp_path, f"K: {MATRIX}\n{empty}\n").keys() & {"k1", "k2", "p1", "p2", "k3"}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("fisheye_model: 1\nD: [0.1, 0.2, 0.0, 0.0]", "fisheye"),
        ("distcoef: [0.1, 0.2, 0, 0, 0]", "distcoef: distortion is read under"),
        ("distortion: {k1: 0.1, k2: 0.2}", "distortion: expected a list of finite numbers"),
        ("distortion:\n  k1: 0.1\n  k2: 0.2", "distortion: expected a list of finite numbers"),
        ("D: [.nan, 0.1, 0, 0, 0]", "d: expected a list of finite numbers"),
        (f"M1: {MATRIX}\nM2: {MATRIX}", "two cameras"),
        ("camera_matrix: [2, 0, 1.28, 0, 2, 0.72, 0, 0, 0.002]", "last row"),
    ],
)
def test_what_would_be_another_lens_is_refused(tmp_path: Path, text: str, message: str) -> None:
    own = "" if "camera_matrix" in text else f"K: {MATRIX}\n"
    with pytest.raises(pk.exceptions.FileError, match=message) as raised:
        read(tmp_path, f"{own}{text}\n")
    assert "lens.yaml" in str(raised.value)


INFO = (
    f"height: 960\nwidth: 1280\ndistortion_model: plumb_bob\nD: [0.1, -0.2, 0.001, 0.002, 0.03]\n"
    f"K: {MATRIX}\nR: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]\n"
)


@pytest.mark.parametrize(
    "text",
    [
        "binning_x: 2\nbinning_y: 3\nroi:\n  x_offset: 100\n  y_offset: 60\n  height: 600\n"
        "  width: 800\n  do_rectify: False\n",
        "binning_x: 2\nbinning_y: 3\n"
        "roi: {x_offset: 100, y_offset: 60, height: 600, width: 800, do_rectify: false}\n",
    ],
)
def test_the_lens_of_a_part_of_the_sensor_sees_what_the_whole_one_sees(
    tmp_path: Path, text: str
) -> None:
    """A point is seen by pixels put together where the mean of those of the whole sensor is."""
    whole, part = read(tmp_path, INFO), read(tmp_path, INFO + text)
    assert (part["width"], part["height"]) == (400, 200)
    for x, y in ((0.0, 0.0), (0.1, -0.07)):
        for focal, middle, at, first, together in (
            ("fx", "cx", x, 100, 2),
            ("fy", "cy", y, 60, 3),
        ):
            pixels = part[focal] * at + part[middle]  # of a point without distortion
            of_whole = first + np.mean(pixels * together + np.arange(together))
            assert whole[focal] * at + whole[middle] == pytest.approx(of_whole, abs=1e-9)
    assert all(part[name] == whole[name] for name in ("k1", "k2", "p1", "p2", "k3"))


@pytest.mark.parametrize("text", ["binning_x: 0\nbinning_y: 0\n", "roi:\n  x_offset: 0\n"])
def test_binning_and_region_of_zero_are_none(tmp_path: Path, text: str) -> None:
    assert read(tmp_path, INFO + text) == LENS | {"width": 1280, "height": 960}


def test_the_uncertainty_of_a_lens_is_that_of_its_pictures(tmp_path: Path) -> None:
    stated = "stdDeviationsIntrinsics: [4.0, 4.0, 2.0, 2.0, 0.01, 0.02, 0.001, 0.001, 0.01]\n"
    whole = np.asarray(read(tmp_path, INFO + stated)["lens_sigma"])
    part = np.asarray(read(tmp_path, INFO + stated + "binning_x: 2\n")["lens_sigma"])
    assert np.diag(part)[[0, 2]] == pytest.approx(np.diag(whole)[[0, 2]] / 4.0)
    assert np.delete(np.diag(part), [0, 2]) == pytest.approx(np.delete(np.diag(whole), [0, 2]))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("binning_x: 1.5", "binning_x: expected a whole number from 0 on; found 1.5"),
        ("binning_y: -2", "binning_y: expected a whole number from 0 on; found -2"),
        ("roi: 5", "roi: expected x_offset"),
        ("roi: {x_offset: much}", "roi: "),
        ("roi:\n  x_offset: 900\n  width: 800", "roi: pixels 900 to 1700 are not within width"),
    ],
)
def test_a_part_of_the_sensor_that_cannot_be_is_refused(
    tmp_path: Path, text: str, message: str
) -> None:
    with pytest.raises(pk.exceptions.FileError, match=message) as raised:
        read(tmp_path, f"{INFO}{text}\n")
    assert "lens.yaml" in str(raised.value)
