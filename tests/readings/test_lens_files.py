"""Files of lenses as programs write them: read in full or refused; no number is dropped."""

from __future__ import annotations

from pathlib import Path

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


def read(tmp_path: Path, text: str) -> dict[str, float]:
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
