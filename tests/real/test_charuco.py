"""Real pictures: a ChArUco board on the flange of an arm, a camera that stands, 16 pictures.

`../shared/data/charuco`, ROS-Industrial industrial_calibration, commit fe62b7c, examples/data
(Apache-2.0): the poses of the flange are known and no joints, so that the arm is six axes that are
the pose itself. Reference figures were found with another implementation, in which each picture of
6 corners and more is a term of one sum of squares.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pkmcal as pk
from pkmcal.readings import Board, Camera

DATA = Path(__file__).parents[3] / "shared" / "data" / "charuco"
BOARD = "charuco:5x7,36.195,18.256,6X6_250"
pytestmark = pytest.mark.skipif(
    not DATA.is_dir(), reason="the pictures are not beside this checkout (../shared/data)"
)


@pytest.fixture(scope="module")
def flange(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the arm, flange.toml, and the log of its joints, joints.csv."""
    folder = tmp_path_factory.mktemp("charuco")
    table = np.genfromtxt(
        DATA / "poses.csv", delimiter=",", skip_header=1, dtype=None, encoding="utf-8"
    )
    rows = ["image,q1 [mm],q2 [mm],q3 [mm],q4 [deg],q5 [deg],q6 [deg]"]
    for name, x, y, z, *quaternion in table:
        angles = Rotation.from_quat(quaternion, scalar_first=True).as_euler("XYZ", degrees=True)
        rows.append(",".join([name, *map(repr, map(float, (x, y, z, *angles)))]))
    (folder / "joints.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    arm = pk.SerialArm(
        np.vstack([np.eye(3)] * 2),
        np.repeat([[600.0, 600.0, 600.0], [0.0, 0.0, 0.0]], 3, axis=0),  # how large it is
        np.eye(4),
        kinds=["prismatic"] * 3 + ["revolute"] * 3,
    )
    arm.save(folder / "flange.toml")
    return folder


def read(flange: Path, **lens: Any) -> tuple[Any, pk.Measurements]:
    """The arm and the corners of pictures with 6 and more, as independent rows."""
    arm = pk.load(flange / "flange.toml")
    camera = Camera.from_file(DATA / "lens.yaml", board=Board.parse(BOARD), **lens)
    m = pk.read_measurements(
        DATA / "pixels.csv", arm, controller=flange / "joints.csv", kind=camera
    )
    many = np.bincount(m.group)[m.group] >= 6
    return arm, replace(m.select(np.flatnonzero(many)), actuator_sigma=0.0)


def off(found: pk.Identification) -> float:
    """Root mean square distance of a corner, px."""
    (residual,) = found.residuals
    return float(np.sqrt((residual**2).sum(axis=1).mean()))


@pytest.mark.parametrize(
    ("lens", "expected"), [({}, 2.655), ({"lens": "focal"}, 1.726), ({"lens": "all"}, 1.097)]
)
def test_the_arm_and_its_camera_are_fitted_as_well_as_by_another_implementation(
    flange: Path, lens: dict[str, str], expected: float
) -> None:
    arm, measured = read(flange, **lens)
    assert len(measured) == 290
    found = pk.identify(arm, measured, free=[])
    assert off(found) == pytest.approx(expected, abs=0.05)
    assert set(found.free) >= {"frame.x", "tool.board.gamma"}
    assert not any(name.startswith("joint") for name in found.free)


def test_pictures_tell_the_noise_of_the_corners_from_that_of_the_arm(flange: Path) -> None:
    """Corners are good to 0.6 px, the median of pictures whose board is placed by itself."""
    arm, measured = read(flange)
    found = pk.identify(arm, replace(measured, actuator_sigma=None), free=[])
    assert found.component_units == (("px", "px"),)
    assert found.component_noise[0] == pytest.approx((0.6, 0.6), abs=0.1)
    assert found.actuator_noise > 2.0  # mm
    assert "px or" in str(found)


def test_a_folder_of_corners_and_a_log_are_calibrated_in_one_command(
    run: Callable[..., Any], refused: Callable[..., str], flange: Path
) -> None:
    files = [flange / "flange.toml", DATA / "pixels.csv", "--controller", flange / "joints.csv"]
    lens = ["--camera", DATA / "lens.yaml"]
    result = run("calibrate", *files, *lens, "--board", BOARD, "--free", "none", "--holdout", 0.2)
    assert result.exit_code in (0, 1), result.stderr
    assert "flange.toml" not in result.stdout and "12 parameters" in result.stdout
    assert "tool.board.x" in result.stdout and "joint1" not in result.stdout
    assert "--board BOARD" in refused("calibrate", *files, *lens)
    assert "--camera FILE" in refused("calibrate", *files, "--board", BOARD)
    assert "chessboard:" in refused("calibrate", *files, *lens, "--board", "charuco:5x7")


def test_the_board_is_found_in_15_of_16_pictures(flange: Path) -> None:
    """Corners are those of the file, which holds what OpenCV found without refining it again."""
    pytest.importorskip("cv2", reason="OpenCV is not installed (the extra vision)")
    found = pk.detect(DATA / "images", Board.parse(BOARD), Camera.from_file(DATA / "lens.yaml"))
    assert len(found.taken) == 15 and len(found.corner) == 290
    assert dict(found.bad) == {"2.png": "4 corners, 6 are needed"}
    table = np.genfromtxt(DATA / "pixels.csv", delimiter=",", skip_header=1, dtype=str)
    there = {(name, int(i)): (float(u), float(v)) for name, i, u, v in table}
    names = [found.taken[i].path.name for i in found.image]
    other = np.array([there[each] for each in zip(names, found.corner.tolist(), strict=True)])
    assert np.abs(np.median(found.pixel - other, axis=0)).max() < 0.05
    assert np.median(np.linalg.norm(found.pixel - other, axis=1)) < 0.3


def test_mirrors_are_said_and_mirrored_numbers_fit_as_well(flange: Path) -> None:
    arm, measured = read(flange)
    camera = measured.instrument
    assert not list(camera.doubts(measured))
    values = measured.values.copy()
    values[:, 0] = 1599 - values[:, 0]
    mirrored = replace(measured, values=values, instrument=replace(camera, cx=1599 - camera.cx))
    assert "mirrored" in " ".join(mirrored.instrument.doubts(mirrored))
    behind = replace(camera, corner=np.asarray(camera.corner) * [-1, 1, 1])
    numbers = replace(measured, instrument=behind)
    assert "seen from behind" in " ".join(behind.doubts(numbers))
    fits = [pk.identify(arm, each, free=[]) for each in (measured, numbers)]
    assert off(fits[1]) == pytest.approx(off(fits[0]), abs=1e-6)
    assert "doubtful-readings" in {each.check for each in fits[1].verdict.said}
