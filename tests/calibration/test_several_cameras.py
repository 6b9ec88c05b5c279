"""Several cameras and boards in one calibration: a frame and a lens, a tool and a size each."""

from __future__ import annotations

import itertools
import json
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.readings import Board, Camera

from ..simulated import said_by

FREE = ["base*", "platform*", "offset*"]
PLATE, DISC = Board.chessboard(5, 4, 30), Board.chessboard(4, 3, 40)
LENS: dict[str, Any] = {
    "fx": 1500.0, "fy": 1500.0, "cx": 640.0, "cy": 400.0, "k1": -0.1, "width": 1280, "height": 800,
}  # fmt: skip
STANDS = {"left": [-150, 120, 1950, 3.0, 0.1, 0.2], "right": [260, -80, 1800, -3.0, 0.05, 1.7]}
CARRIED = {"plate": [-60, -45, 20, np.pi, 0, 0.3], "disc": [40, 70, 25, np.pi, 0.05, -0.8]}
SCATTER, NOISE = 0.01, 0.1  # mm of legs, px


def camera(name: str, board: str, **options: Any) -> Camera:
    return Camera(
        **LENS, camera_name=name, board_name=board, stands=STANDS[name], carried=CARRIED[board],
        **options,
    )  # fmt: skip


def drawn(
    pairs: list[tuple[str, str]], seed: int = 0, count: int = 24, of: Any = FREE, **options: Any
) -> tuple[pk.Robot, list[pk.Measurements]]:
    """A hexapod with errors, and pictures of each board by each camera, at the same poses."""
    random, robot = np.random.default_rng(seed), pk.load("hexapod")
    true = robot.replace(
        {n: robot.geometry[n] + random.normal(0.0, 0.3) for n in robot.geometry.match(of)}
    )
    told = robot.inverse(pk.sample_poses(robot, count, seed=1, share=0.25))
    where = told + random.normal(0.0, SCATTER, told.shape)
    sets = []
    for name, board in pairs:
        places = {"plate": PLATE, "disc": DISC}[board]
        at, seeing = camera(name, board, **options).seeing(where, places)
        seen = pk.VirtualMachine(true, NOISE, int(random.integers(99))).measure(at, seeing)
        group = np.repeat(np.arange(count), len(places.ids))
        rows = np.repeat(told, len(places.ids), axis=0)
        sets.append(pk.Measurements(rows, seen.values, seen.instrument, group=group))
    return true, sets


def fitted(sets: list[pk.Measurements], **options: Any) -> pk.Identification:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pk.CalibrationWarning)
        return pk.identify(pk.load("hexapod"), sets, **{"free": FREE, **options})


EVERY = [("left", "plate"), ("left", "disc"), ("right", "plate"), ("right", "disc")]


def test_each_camera_and_each_board_is_found_where_it_is() -> None:
    _, sets = drawn(EVERY, lens="focal", find_size=True)
    found = fitted(sets)
    named = dict(zip(found.free, zip(found.values, found.stderr, strict=True), strict=True))
    expected = {f"lens.{name}.fx": 1500.0 for name in STANDS}
    expected |= {f"board.{board}.size": 0.0 for board in CARRIED}
    for name, right in expected.items():
        value, stderr = named[name]
        assert abs(value - right) < 4.0 * stderr < np.inf, name
    for name in STANDS:
        assert named[f"frame.{name}.x"][0] == pytest.approx(STANDS[name][0], abs=20.0)
    for board in CARRIED:
        assert named[f"tool.board.{board}.x"][0] == pytest.approx(CARRIED[board][0], abs=5.0)
    assert found.actuator_noise == pytest.approx(SCATTER, rel=0.4)
    for noise in found.component_noise:
        assert noise[0] == pytest.approx(NOISE, rel=0.15)


@pytest.mark.slow
def test_two_cameras_and_two_boards_tell_more_than_one() -> None:
    """Of the same machine; beside it they tell a frame and a tool more."""
    true, sets = drawn(EVERY, seed=2)
    one, several = fitted(sets[:1]), fitted(sets)
    robot = pk.load("hexapod")
    assert several.rank == one.rank + 12
    poses = pk.sample_poses(robot, 20, seed=9, share=0.2)
    q = robot.inverse(poses)
    pulled = []
    for found in (one, several):
        off = found.robot.forward(q).pose - true.forward(q).pose
        pulled.append(off)
    assert np.std(pulled[1], axis=0)[:3].max() < np.std(pulled[0], axis=0)[:3].max()


def test_a_camera_with_the_lens_of_another_is_named_beside_one_that_is_sound() -> None:
    """Its pictures are taken for bad ones: the fit weighs them little, and ends at the other's."""
    _, sets = drawn([("left", "plate"), ("right", "plate")], count=14, of="offset*")
    assert not said_by(fitted(sets, free="offset*"), "at-odds")
    other = replace(sets[1].instrument, fx=1000.0, fy=1000.0)
    found = fitted([sets[0], replace(sets[1], instrument=other)], free="offset*")
    (said,) = said_by(found, "at-odds").values()
    assert said.level == "doubt" and said.text.startswith("pictures of right")


def test_a_camera_on_the_platform_and_one_on_the_base_are_told_apart() -> None:
    _, sets = drawn([("left", "plate")])
    unnamed = [replace(each, instrument=replace(each.instrument, camera_name="")) for each in sets]
    rides = replace(unnamed[0].instrument, on="platform", board_name="")
    both = [unnamed[0], replace(unnamed[0], instrument=rides)]
    with pytest.raises(pk.ArgumentError, match="camera and board stand each in a place"):
        fitted(both)
    heights = pk.VirtualMachine(pk.load("hexapod"), 0.01).measure(
        pk.load("hexapod").inverse(pk.sample_poses(pk.load("hexapod"), 12, seed=5)), "position"
    )
    with pytest.raises(pk.ArgumentError, match="camera_name"):
        fitted([unnamed[0], heights], unknown={"frame": "unknown"})
    found = fitted([sets[0], heights], unknown={"frame": "unknown"})
    assert {"frame.left.x", "frame.x"} <= {*found.free}


def written(path: Path, sets: list[pk.Measurements], pairs: list[tuple[str, str]]) -> None:
    """One file of all rows, with columns camera and board."""
    lines = [
        "camera,board,image,corner,u [px],v [px]," + ",".join(f"q{i} [mm]" for i in range(1, 7))
    ]
    for measured, (name, board) in zip(sets, pairs, strict=True):
        ids = {"plate": PLATE, "disc": DISC}[board].ids
        each = zip(
            measured.group, np.tile(ids, 99), measured.values, measured.actuators, strict=False
        )
        for picture, corner, pixel, q in each:
            if np.isfinite(pixel).all():
                cells = [
                    name,
                    board,
                    f"{picture}.png",
                    corner,
                    *map(repr, map(float, [*pixel, *q])),
                ]
                lines.append(",".join(map(str, cells)))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


LENS_FILE = """%YAML:1.0
---
camera_matrix: !!opencv-matrix
  rows: 3
  cols: 3
  dt: d
  data: [1500, 0, 640, 0, 1500, 400, 0, 0, 1]
distortion_coefficients: [-0.1, 0, 0, 0, 0]
"""


def test_a_file_of_several_cameras_and_boards_is_calibrated_as_its_sets(
    tmp_path: Path, run: Callable[..., Any], refused: Callable[..., str]
) -> None:
    pairs = [("left", "plate"), ("right", "disc")]
    _, sets = drawn(pairs, count=8, of="offset*")
    written(tmp_path / "pixels.csv", sets, pairs)
    (tmp_path / "lens.yaml").write_text(LENS_FILE, encoding="utf-8")
    told = ["calibrate", "hexapod", tmp_path / "pixels.csv", "--free", "offset*"]
    cameras = [w for name in STANDS for w in ("--camera", f"{name}={tmp_path / 'lens.yaml'}")]
    boards = ["--board", "plate=chessboard:5x4,30", "--board", "disc=chessboard:4x3,40"]
    result = run(*told, "--json", *cameras, *boards)
    assert result.exit_code in (0, 1), result.output
    report = json.loads(result.stdout)
    direct = fitted(sets, free="offset*")
    assert {*report["parameters"]} == {*direct.free}
    for name in ("frame.left.x", "frame.right.gamma", "tool.board.disc.y"):
        value = direct.values[direct.free.index(name)]
        assert report["parameters"][name]["value"] == pytest.approx(value, abs=1e-3)
    assert "rows, those of camera 'left' and board 'plate'" in result.stderr
    alone = ["--camera", tmp_path / "lens.yaml", "--board", "chessboard:5x4,30"]
    assert "column 'camera': there are several, left, right" in refused(*told, *alone)
    assert "name each of several" in refused(*told, *cameras[:2], *alone)
    other = ["--camera", f"top={tmp_path / 'lens.yaml'}", *boards[:2]]
    assert "rows are of 'left', 'right', and --camera names top" in refused(*told, *other)


def test_rows_of_a_camera_or_a_board_that_no_option_names_are_refused_with_their_number(
    tmp_path: Path, refused: Callable[..., str]
) -> None:
    """Half of the pictures had been left out without a word."""
    pixels = tmp_path / "pixels.csv"
    names = [("left", "plate"), ("left", "disc"), ("right", "plate"), ("right", "disc")]
    heading = "Camera,BOARD,image,corner,u [px],v [px]," + ",".join(
        f"q{i} [mm]" for i in range(1, 7)
    )
    rows = [f"{camera},{board},1.png,0,600,400" + ",800" * 6 for camera, board in names]
    pixels.write_text("\n".join([heading, *rows]) + "\n", encoding="utf-8")
    lens = tmp_path / "lens.yaml"
    lens.write_text(LENS_FILE, encoding="utf-8")

    def said(cameras: list[str], boards: list[str]) -> str:
        options = [w for name in cameras for w in ("--camera", f"{name}={lens}")]
        options += [w for name in boards for w in ("--board", f"{name}=chessboard:5x4,30")]
        return " ".join(refused("calibrate", "hexapod", pixels, *options).split())

    both = ["plate", "disc"]
    assert "2 of 4 rows are of 'left', and --camera names links, right." in said(
        ["links", "right"], both
    )
    assert "2 of 4 rows are of 'right', and --camera names left. State --camera right=…" in said(
        ["left"], both
    )
    assert "names LEFT, RIGHT; did you mean 'LEFT'?" in said(["LEFT", "RIGHT"], both)
    assert "'board': 2 of 4 rows are of 'disc', and --board names plate" in said(
        ["left", "right"], ["plate"]
    )
    pixels.write_text(pixels.read_text(encoding="utf-8").replace("Camera", "Photo"))
    assert "there are several cameras, left, right, and no column 'camera'" in said(
        ["left", "right"], both
    )


def test_pictures_at_the_same_actuators_are_of_one_pose_whatever_they_are_called() -> None:
    """But of one camera two pictures are not, wherever the actuators read."""
    _, (left, right) = drawn([("left", "plate"), ("right", "plate")], count=12, of="offset*")
    assert right.group is not None
    named = replace(right, group=7 * right.group + 500)
    one, other = (fitted([left, each], free="offset*") for each in (right, named))
    assert one.actuator_noise == other.actuator_noise and one.dof == other.dof
    np.testing.assert_array_equal(one.covariance, other.covariance)
    assert named.group is not None
    first, second = (np.flatnonzero(named.group == each) for each in (500, 507))
    q, values = named.actuators.copy(), named.values.copy()
    q[second], values[second] = q[first], values[first] + 0.01
    moved = fitted([left, replace(named, actuators=q, values=values)], free=[])
    ours, theirs = moved.fit.equations.table.pose_of
    assert len(np.unique(theirs)) == 12 and len(np.unique(ours)) == 12
    assert len(np.intersect1d(ours, theirs)) == 10


MARKERS = {  # on the platform, mm
    "a": [120, 40, 20, np.pi, 0, 0.3], "b": [-90, 100, 25, np.pi, 0.05, 1.2],
    "c": [-40, -110, 15, np.pi, -0.04, 2.0], "d": [70, -80, 30, np.pi, 0.02, 0.8],
}  # fmt: skip


def markers(
    board: Board, scatter: float, poses: int = 12
) -> tuple[pk.Robot, list[pk.Measurements]]:
    """Pictures of four small boards on a hexapod with errors, by two cameras."""
    random, robot = np.random.default_rng(4), pk.load("hexapod")
    names = robot.geometry.match("offset*")
    true = robot.replace({n: robot.geometry[n] + random.normal(0.0, 0.3) for n in names})
    told = robot.inverse(pk.sample_poses(robot, poses, seed=1, share=0.25))
    where, count, sets = told + random.normal(0.0, scatter, told.shape), len(board.ids), []
    for (name, stands), (mark, carried) in itertools.product(STANDS.items(), MARKERS.items()):
        own = Camera(
            **LENS, camera_name=name, board_name=mark, stands=stands, carried=carried
        )  # fmt: skip
        at, seeing = own.seeing(where, board)
        seen = pk.VirtualMachine(true, NOISE, int(random.integers(99))).measure(at, seeing)
        group = np.repeat(np.arange(poses), count)
        sets.append(
            pk.Measurements(
                np.repeat(told, count, axis=0), seen.values, seen.instrument, group=group
            )
        )
    return true, sets


def test_single_markers_whose_corners_are_known_share_the_pose_of_their_picture() -> None:
    """Their errors are of one machine: a noise of its legs is found, as of one large board."""
    _, sets = markers(Board.apriltags(1, 1, 50, 10), SCATTER)
    found = fitted(sets[:4], free="offset*")
    assert found.actuator_noise == pytest.approx(SCATTER, rel=0.5)
    assert found.verdict.state == "calibrated" and found.rank == 6 + 6 + 4 * 6
    assert len(np.unique(found.fit.uncertainty.blocks.pose_of_row)) == 12


def test_markers_of_one_point_each_are_found_on_the_platform() -> None:
    """Three numbers each: how a point is turned nothing tells, and nothing depends on it."""
    _, sets = markers(Board.points([0], [[0, 0, 0]]), 0.0)
    found = fitted(sets, free="offset*")
    assert found.verdict.state == "calibrated" and found.rank == 6 + 2 * 6 + 4 * 3
    assert found.rms < 0.1
    away = [stands[2] - pk.load("hexapod").home[2] for stands in STANDS.values()]  # they look down
    at_points = np.repeat(away, len(MARKERS)) / LENS["fx"]  # mm, of a pixel
    shown = np.array(found.noise) / np.array(found.component_noise)[:, 0]
    np.testing.assert_allclose(shown, at_points, rtol=0.25)
    named = dict(zip(found.free, found.values, strict=True))
    places = np.array([[named[f"tool.board.{mark}.{axis}"] for axis in "xyz"] for mark in MARKERS])
    right = np.array([each[:3] for each in MARKERS.values()])
    spans, wanted = (np.linalg.norm(each[:, None] - each, axis=2) for each in (places, right))
    np.testing.assert_allclose(spans, wanted, atol=1.0)


def test_single_points_that_tell_no_camera_are_refused() -> None:
    _, sets = markers(Board.points([0], [[0, 0, 0]]), 0.0)
    with pytest.raises(pk.ArgumentError, match="state the corners of a marker as a board"):
        fitted([sets[0].select(np.arange(5))])


def test_a_small_session_of_single_points_is_laid_by_the_pictures_of_all() -> None:
    """Three places tell no camera; it stands where it stood, the marker was fastened anew."""
    _, sets = markers(Board.points([0], [[0, 0, 0]]), 0.0, poses=14)
    session = np.where(np.arange(14) >= 11, "b", "a")
    found = fitted(
        [replace(each, session=session) for each in sets], free="offset*", per_session="tool*"
    )
    assert "tool.board.a.x@b" in found.free and found.rms < 0.1


def test_pictures_of_two_cameras_in_sessions_have_a_verdict_and_a_table() -> None:
    _, sets = drawn([("left", "plate"), ("right", "plate")], count=14, of="offset*")
    named = [
        replace(each, session=np.where(each.group % 14 >= 7, "b", "a"))  # type: ignore[operator]
        for each in sets
    ]
    found = fitted(named, free="offset*", per_session="frame*")
    assert found.verdict.state == "calibrated" and len(found.pictures) == 28
