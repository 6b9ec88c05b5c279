"""Several cameras and boards in one calibration: a frame and a lens, a tool and a size each."""

from __future__ import annotations

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

FREE = ["base*", "platform*", "offset*"]
PLATE, DISC = Board.chessboard(5, 4, 30), Board.chessboard(4, 3, 40)
LENS: dict[str, Any] = {"fx": 1500.0, "fy": 1500.0, "cx": 640.0, "cy": 400.0, "k1": -0.1}
STANDS = {"left": [-150, 120, 1950, 3.0, 0.1, 0.2], "right": [260, -80, 1800, -3.0, 0.05, 1.7]}
CARRIED = {"plate": [-60, -45, 20, np.pi, 0, 0.3], "disc": [40, 70, 25, np.pi, 0.05, -0.8]}
SCATTER, NOISE = 0.01, 0.1  # mm of legs, px


def camera(name: str, board: str, **options: Any) -> Camera:
    return Camera(
        **LENS, camera_name=name, board_name=board, stands=STANDS[name], carried=CARRIED[board],
        **options,
    )  # fmt: skip


def drawn(
    pairs: list[tuple[str, str]], seed: int = 0, count: int = 24, **options: Any
) -> tuple[pk.Robot, list[pk.Measurements]]:
    """A hexapod with errors, and pictures of each board by each camera, at the same poses."""
    random, robot = np.random.default_rng(seed), pk.load("hexapod")
    names = robot.geometry.match(FREE)
    true = robot.replace({n: robot.geometry[n] + random.normal(0.0, 0.3) for n in names})
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
        return pk.identify(pk.load("hexapod"), sets, FREE, **options)


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
    _, sets = drawn([("left", "plate"), ("right", "plate")])
    checks = [each.check for each in fitted(sets).verdict.said]
    assert "at-odds" not in checks
    other = replace(sets[1].instrument, fx=1000.0, fy=1000.0)
    found = fitted([sets[0], replace(sets[1], instrument=other)])
    (said,) = (each for each in found.verdict.said if each.check == "at-odds")
    assert found.verdict.state == "doubtful" and said.text.startswith("pictures of right")


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


def test_a_file_of_several_cameras_and_boards_is_calibrated_as_its_sets(
    tmp_path: Path, run: Callable[..., Any], refused: Callable[..., str]
) -> None:
    _, sets = drawn(EVERY, count=18)
    written(tmp_path / "pixels.csv", sets, EVERY)
    matrix = "camera_matrix: !!opencv-matrix\n  rows: 3\n  cols: 3\n  dt: d\n"
    lens = f"%YAML:1.0\n---\n{matrix}  data: [1500, 0, 640, 0, 1500, 400, 0, 0, 1]\n"
    (tmp_path / "lens.yaml").write_text(
        lens + "distortion_coefficients: [-0.1, 0, 0, 0, 0]\n", encoding="utf-8"
    )
    free = [word for each in FREE for word in ("--free", each)]
    told = ["calibrate", "hexapod", tmp_path / "pixels.csv", *free]
    cameras = [w for name in STANDS for w in ("--camera", f"{name}={tmp_path / 'lens.yaml'}")]
    boards = ["--board", "plate=chessboard:5x4,30", "--board", "disc=chessboard:4x3,40"]
    result = run(*told, "--json", *cameras, *boards)
    assert result.exit_code in (0, 1), result.output
    report = json.loads(result.stdout)
    direct = fitted(sets)
    assert {*report["parameters"]} == {*direct.free}
    for name in ("frame.left.x", "frame.right.gamma", "tool.board.disc.y"):
        value = direct.values[direct.free.index(name)]
        assert report["parameters"][name]["value"] == pytest.approx(value, abs=1e-3)
    alone = ["--camera", tmp_path / "lens.yaml", "--board", "plate=chessboard:5x4,30"]
    assert "column 'camera': there are several, left, right" in refused(*told, *alone)
    assert "name each of several" in refused(*told, *cameras[:2], *alone)
    other = ["--camera", f"top={tmp_path / 'lens.yaml'}", *boards[:2]]
    assert "no row of 'top'" in refused(*told, *other)
