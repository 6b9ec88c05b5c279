"""Poses from somebody's PnP: with the covariance of their pictures nothing of these is lost."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pkmcal as pk
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.read_files import read_file
from pkmcal.jobs.reading import Reading
from pkmcal.measurements.inverted import inverted
from pkmcal.readings import Board, Camera
from pkmcal.readings.board_poses import board_poses

BOARD = Board.chessboard(10, 5, 20)
FREE = ["base*", "platform*", "offset*"]
FOCAL, NOISE = 3478.0, 0.1


def pictures(seed: int, count: int = 30) -> tuple[pk.Robot, pk.Measurements]:
    """A hexapod with errors, and pictures of a board on it, whole."""
    random, drawn = np.random.default_rng(seed), pk.load("hexapod")
    names = drawn.geometry.match(FREE)
    true = drawn.replace({n: drawn.geometry[n] + random.normal(0.0, 0.3) for n in names})
    board = pk.screw.from_pose(np.array([0, 0, 20, np.pi + 0.02, 0.03, 0.3]))
    board[:3, 3] -= board[:3, :3] @ BOARD.places.mean(axis=0)
    camera = Camera(
        fx=FOCAL, fy=FOCAL, cx=1223.5, cy=1023.5, stands=[-150, 120, 1950, 3.0, 0.1, 0.2],
        carried=pk.screw.to_pose(board),
    )  # fmt: skip
    q = drawn.inverse(pk.sample_poses(drawn, count, seed=1, share=0.3))
    at, seeing = camera.seeing(q, BOARD)
    seen = pk.VirtualMachine(true, NOISE, seed).measure(at, seeing)
    whole = np.isfinite(seen.values).all(axis=1).reshape(len(q), -1).all(axis=1)
    rows = np.flatnonzero(np.repeat(whole, len(BOARD.ids)))
    group = np.repeat(np.arange(len(q)), len(BOARD.ids))[rows]
    own = seen.select(rows)
    return true, pk.Measurements(own.actuators, own.values, own.instrument, group=group)


def of_pictures(measured: pk.Measurements) -> pk.Measurements:
    """The board in axes of the camera, picture by picture."""
    camera = measured.instrument
    first, number = np.unique(measured.group, return_index=True, return_inverse=True)[1:]
    found = board_poses(
        np.asarray(camera.corner), measured.values, camera.lens_numbers(), number.reshape(-1)
    )
    return pk.Measurements(measured.actuators[first], found.pose[:, 0], "pose")


def fitted(measured: pk.Measurements, **options: Any) -> pk.Identification:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pk.CalibrationWarning)
        return pk.identify(pk.load("hexapod"), measured, FREE, **options)


def off(found: pk.Identification, true: pk.Robot) -> float:
    """Distances elsewhere, rms, after the best motions of base and platform."""
    from ..calibration.test_found_cameras import _apart

    q = pk.load("hexapod").inverse(pk.sample_poses(true, 40, seed=77, share=0.3))
    away = _apart(true.forward(q).pose, found.robot.forward(q).pose)
    return float(np.sqrt(np.mean(away**2)))


UNKNOWN = {"unknown": ["frame", "target"]}


def test_rows_with_their_covariance_are_worth_the_pictures_and_alike_they_are_not() -> None:
    tried = [pictures(seed) for seed in range(2)]
    each = []
    for true, measured in tried:
        poses = of_pictures(measured)
        stated = pk.from_pnp(poses, FOCAL, BOARD, noise=NOISE)
        several = (
            fitted(measured), fitted(stated, **UNKNOWN), fitted(poses, **UNKNOWN)
        )  # fmt: skip
        each.append([off(found, true) for found in several])
        assert several[1].chi2_per_dof == pytest.approx(1.0, abs=0.4)
    pixels, covariances, alike = np.sqrt(np.mean(np.square(each), axis=0))
    assert covariances == pytest.approx(pixels, rel=0.05)
    assert alike > 2.5 * pixels


def test_covariances_are_the_scatter_of_poses_from_pictures_that_are_drawn() -> None:
    pose = np.array([[60.0, -40, 1200, 0.35, -0.25, 0.4]])
    lens = np.array([FOCAL, FOCAL, 0, 0, 0, 0, 0, 0, 0])
    corner, random = np.tile(BOARD.places, (400, 1)), np.random.default_rng(1)
    from pkmcal.core import instruments

    number = np.repeat(np.arange(400), len(BOARD.ids))
    seen, *_ = instruments.pixels(np.repeat(pose, len(corner), axis=0), corner, lens)
    drawn = board_poses(corner, seen + random.normal(0.0, NOISE, seen.shape), lens, number)
    scatter = np.cov(drawn.pose[:, 0].T)
    m = pk.Measurements([[500.0] * 6], pose, "pose")
    stated = pk.from_pnp(m, FOCAL, BOARD, noise=NOISE).sigma
    assert stated is not None
    size = np.sqrt(np.diagonal(scatter))
    np.testing.assert_allclose(
        stated[0] / np.outer(size, size), scatter / np.outer(size, size), atol=0.2
    )


def test_a_camera_on_the_platform_has_the_poses_turned_round() -> None:
    _, measured = pictures(0, 8)
    poses = of_pictures(measured)
    here = pk.from_pnp(poses, FOCAL, BOARD, on="platform")
    there = inverted(pk.from_pnp(poses, FOCAL, BOARD))
    np.testing.assert_array_equal(here.values, there.values)
    np.testing.assert_array_equal(here.sigma, there.sigma)


HEADINGS = {
    "rotvec": ["Rx [rad]", "Ry [rad]", "Rz [rad]"],
    "quaternion": ["qw", "qx", "qy", "qz"],
    "matrix": [f"r{i}{j}" for i in "123" for j in "123"],
}


def file_of(form: str, poses: pk.Measurements, path: Path) -> Path:
    """A file with the orientations of poses in a form."""
    turns = Rotation.from_euler("xyz", poses.values[:, 3:])
    columns = {
        "rotvec": turns.as_rotvec(),
        "quaternion": turns.as_quat()[:, [3, 0, 1, 2]],
        "matrix": turns.as_matrix().reshape(-1, 9),
    }[form]
    head = [*(f"q{i} [mm]" for i in range(1, 7)), "x [mm]", "y [mm]", "z [mm]", *HEADINGS[form]]
    table = np.hstack([poses.actuators, poses.values[:, :3], columns])
    np.savetxt(path, table, delimiter=",", header=",".join(head), comments="")
    return path


@pytest.mark.parametrize("on", ["base", "platform"])
@pytest.mark.parametrize("form", HEADINGS)
def test_a_file_of_either_camera_is_read_and_one_that_is_turned_round_is_named(
    form: str, on: Literal["base", "platform"], tmp_path: Path
) -> None:
    """A camera on the platform sees the inverse of what a machine does, and so its file says."""
    robot = pk.load("hexapod")
    q = robot.inverse(pk.sample_poses(robot, 30, seed=2))
    board = pk.screw.from_pose(np.array([0, 0, 1800, 3.0, 0.1, 0.2]))
    at = pk.screw.from_pose(robot.forward(q).pose)
    seen = pk.screw.to_pose(board @ (at if on == "base" else np.linalg.inv(at)))
    poses = pk.Measurements(q, seen, "pose")
    pnp = Reading(
        from_pnp="f=1000,board=160x120,middle=0x0", camera_on=on,
        rotation="rotvec" if form == "rotvec" else None,
    )  # fmt: skip
    round_ = replace(pnp, invert_poses=True)
    as_it_is = file_of(form, poses, tmp_path / "seen.csv")
    other = file_of(form, inverted(poses), tmp_path / "other.csv")

    def read(path: Path, reading: Reading) -> pk.Measurements:
        return read_file(str(path), robot, reading, Inputs(), lambda line: None)

    expected = pk.from_pnp(poses, 1000, (160, 120, 0, 0), on=on)
    for path, reading in ((as_it_is, pnp), (other, round_)):
        found = read(path, reading)
        np.testing.assert_allclose(found.values, expected.values, atol=1e-6)
        np.testing.assert_allclose(found.sigma, expected.sigma, rtol=1e-4, atol=1e-9)
    with pytest.raises(pk.FileError, match=r"turned round \(--invert-poses\)"):
        read(other, pnp)
    with pytest.raises(pk.FileError, match=r"turned round \(without --invert-poses\)"):
        read(as_it_is, round_)
    if form == "rotvec":
        with pytest.raises(pk.FileError, match="--rotation rotvec --invert-poses"):
            read(other, replace(pnp, rotation=None))


def test_a_stand_in_of_the_same_size_weighs_as_the_board_does() -> None:
    _, measured = pictures(0, 8)
    poses = of_pictures(measured)
    board = pk.from_pnp(poses, FOCAL, BOARD).sigma
    size = pk.from_pnp(poses, FOCAL, (180.0, 80.0, 90.0, 40.0)).sigma
    assert board is not None and size is not None
    ratio = np.sqrt(np.linalg.det(size) / np.linalg.det(board)) ** (1 / 6)
    np.testing.assert_allclose(ratio, ratio[0], rtol=0.3)
    assert 1.0 < ratio[0] < 2.0  # it has half as many corners


@pytest.mark.parametrize(
    "board", [BOARD, Board.points([0, 1, 2, 3], [[0, 0, 0], [90, 0, 0], [90, 80, 0], [0, 80, 0]])]
)
def test_a_size_with_the_number_of_corners_is_as_good_as_the_board(board: Board) -> None:
    poses = of_pictures(pictures(0, 8)[1])
    size = np.ptp(board.places[:, :2], axis=0)
    whole = pk.from_pnp(poses, FOCAL, board).sigma
    stated = pk.from_pnp(poses, FOCAL, (*size, *size / 2), corners=len(board.ids)).sigma
    np.testing.assert_allclose(stated, whole, rtol=1e-6, atol=1e-9)
    many = pk.from_pnp(poses, FOCAL, (*size, *size / 2), corners=4000).sigma
    assert whole is not None and many is not None
    deviations = [np.sqrt(np.diagonal(s, axis1=1, axis2=2)) for s in (whole, many)]
    ratio = np.median(deviations[0] / deviations[1]) / np.sqrt(4000 / len(board.ids))
    assert 0.5 < ratio < 1.1  # corners at the edge alone tell more, each


def test_the_middle_of_a_stand_in_counts_and_is_asked_for_where_nothing_tells_it() -> None:
    """A camera beside the machine is pointed at no point of the board: it says so."""
    true, measured = pictures(2)
    poses = of_pictures(measured)
    told = pk.from_pnp(poses, FOCAL, (180.0, 80.0, 90.0, 40.0), noise=NOISE)
    with pytest.warns(pk.CalibrationWarning, match="where its middle is nobody knows"):
        guessed = pk.from_pnp(poses, FOCAL, (180.0, 80.0), noise=NOISE)
    several = [
        fitted(each, **UNKNOWN)
        for each in (told, guessed, pk.from_pnp(poses, FOCAL, BOARD, noise=NOISE))
    ]
    known, elsewhere, board = (off(each, true) for each in several)
    assert known < 1.2 * board < 0.8 * elsewhere
    assert "measuring-order" not in {each.check for each in several[0].verdict.said}


def test_a_camera_that_is_pointed_at_the_board_tells_its_middle() -> None:
    """From all around: the lines of sight meet where the camera looks."""
    at = np.array([90.0, 40.0, 0.0])
    motions = []
    for turn in np.linspace(0.0, 6.0, 9):
        eye = at + np.array(
            [200 * np.cos(turn), 150 * np.sin(turn), -500.0]
        )  # z of a board is into it
        ahead = (at - eye) / np.linalg.norm(at - eye)
        right = np.cross([0.0, 1.0, 0.0], ahead)
        right /= np.linalg.norm(right)
        camera = np.eye(4)
        camera[:3, :3], camera[:3, 3] = np.array([right, np.cross(ahead, right), ahead]).T, eye
        motions.append(np.linalg.inv(camera))
    poses = pk.Measurements(np.zeros((9, 6)), pk.screw.to_pose(np.array(motions)), "pose")
    with warnings.catch_warnings():
        warnings.simplefilter("error", pk.CalibrationWarning)
        guessed = pk.from_pnp(poses, FOCAL, (180.0, 80.0)).sigma
    told = pk.from_pnp(poses, FOCAL, (180.0, 80.0, *at[:2])).sigma
    assert guessed is not None and told is not None
    np.testing.assert_allclose(guessed, told, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize(("seed", "one", "other"), [(0, 19, 23), (1, 1, 27)])
def test_rows_that_are_exchanged_are_named_where_the_search_runs_astray(
    seed: int, one: int, other: int
) -> None:
    """It had ended at a type-2 singular pose, and no row was named."""
    _, measured = pictures(seed)
    poses = of_pictures(measured)
    values = poses.values.copy()
    values[[one, other]] = values[[other, one]]
    exchanged = pk.from_pnp(replace(poses, values=values), FOCAL, BOARD, noise=NOISE)
    try:
        said = str(fitted(exchanged, **UNKNOWN).verdict)
    except pk.ArgumentError as error:
        said = str(error)
    said = " ".join(said.split())
    assert f"row {one}, row {other}" in said and "--drop-outliers" in said
    assert fitted(exchanged, drop="outliers", **UNKNOWN).dropped == (one, other)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"focal": 0.0}, "focal must be above 0"),
        ({"noise": -1.0}, "noise must be above 0"),
        ({"board": (10.0, 0.0)}, "width and height"),
        ({"on": "table"}, "on"),
        ({"corners": 3}, "corners must be a whole number from 4"),
        ({"corners": 50, "board": BOARD}, "a Board has its own"),
    ],
)
def test_what_does_not_fit_is_refused(change: dict[str, Any], message: str) -> None:
    m = pk.Measurements([[500.0] * 6], [[0, 0, 900, 0, 0, 0]], "pose")
    given: dict[str, Any] = {"focal": 1000.0, "board": (100.0, 80.0), **change}
    with pytest.raises(pk.ArgumentError, match=message):
        pk.from_pnp(m, given.pop("focal"), given.pop("board"), **given)


def test_poses_of_the_camera_in_axes_of_the_board_are_named() -> None:
    camera_above = [[0, 0, -900, 0.1, 0, 0]]
    with pytest.raises(pk.ArgumentError, match=r"1 of 1 rows.*z -900 mm.*--invert-poses"):
        pk.from_pnp(pk.Measurements([[500.0] * 6], camera_above, "pose"), 1000, (100, 80))
    with pytest.raises(pk.ArgumentError, match="kind 'position'"):
        pk.from_pnp(pk.Measurements([[500.0] * 6], [[0, 0, 900.0]]), 1000, (100, 80))


def test_a_table_of_poses_is_calibrated_by_one_command(
    run: Callable[..., Any], tmp_path: Path
) -> None:
    _, measured = pictures(1)
    poses = of_pictures(measured)
    poses.write(tmp_path / "pnp.csv")
    command = ("calibrate", "hexapod", tmp_path / "pnp.csv", "--free", ",".join(FREE))
    result = run(
        *command,
        "--datum",
        "auto",
        "--from-pnp",
        f"f={FOCAL:g},board=180x80,middle=90x40,corners=50",
    )
    assert result.exit_code == 0, result.output
    assert "chi²/dof 1.0" in result.stdout and "tool.alpha" in result.stdout
    for text in (
        "f=0,board=10x10",
        "board=10x10",
        "f=100,board=10",
        "f=1,board=1x1,size=3",
        "f=1,board=1x1,middle=3",
        "f=1,board=1x1,corners=3.5",
    ):
        assert run(*command, "--from-pnp", text).exit_code == 2
