"""Plans of pictures: what is in the picture, how it is tilted, and what the plan promises."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.readings import Board, Camera

BOARD = Board.chessboard(5, 4, 30)
FREE = ["base*", "platform*", "offset*"]


@pytest.fixture(scope="module")
def camera() -> Camera:
    middle = BOARD.places.mean(axis=0)
    return Camera(
        fx=1500, fy=1500, cx=600, cy=450, width=1201, height=901, board=BOARD,
        stands=[0, 0, 1900, np.pi, 0, 0], carried=[-middle[0], middle[1], 20, np.pi, 0, 0],
    )  # fmt: skip


def test_poses_are_those_at_which_the_whole_board_is_seen(
    hexapod: pk.Robot, camera: Camera
) -> None:
    candidates = pk.sample_poses(hexapod, 120, seed=2, share=0.9)
    plan = pk.plan_poses(
        hexapod, candidates, count=20, kind=camera, noise=0.1, free=FREE, criterion="D"
    )
    at, seeing = camera.seeing(plan.actuators, BOARD)
    assert np.isfinite(pk.VirtualMachine(hexapod, 0.0).measure(at, seeing).values).all()
    assert plan.left_out > 0 and len(plan) == 20
    level = candidates * [1, 1, 1, 0, 0, 0]
    tilted = np.degrees(np.abs(plan.poses[:, 3:5]).max(axis=1))
    assert np.median(tilted) > 5.0
    flat = pk.plan_poses(
        hexapod, level, count=20, kind=camera, noise=0.1, free=FREE, prior=1.0, criterion="D"
    )
    tilts = pk.plan_poses(
        hexapod, candidates, count=20, kind=camera, noise=0.1, free=FREE, prior=1.0, criterion="D"
    )
    # what level pictures tell of the platform is a part only
    assert np.median(flat.stderr / tilts.stderr) > 1.3
    behind = camera.with_fields({"carried": [0, 0, 0, 0, 0, 0]})
    with pytest.raises(ValueError, match="in the picture"):
        pk.plan_poses(hexapod, candidates, count=20, kind=behind, noise=0.1, free=FREE)


@pytest.mark.parametrize(
    "board",
    [
        Board.chessboard(5, 4, 30), Board.charuco(6, 5, 30, 22, "4X4_50"),
        Board.apriltags(4, 3, 30, 8), Board.circles(5, 4, 30),
    ],
    ids=lambda board: board.kind,
)  # fmt: skip
def test_what_is_printed_is_in_planned_pictures_whole(board: Board) -> None:
    """By the formula of a pinhole: detectors need the squares around the outer corners, too."""
    square, ends = board.sizes[0], board.places.max(axis=0)
    margin = board.sizes[1] if board.kind == "apriltags" else square
    inner = np.where(board.kind == "charuco", square, 0.0)
    left, right = inner - margin, ends[:2] + margin
    sheet = np.array([[x, y, 0] for x in (left, right[0]) for y in (left, right[1])])
    robot, away, focal = pk.load("rotary-delta"), 900.0, 900.0
    x, y, z = robot.home[:3]
    carried = pk.screw.from_pose(np.array([20.0, -10, -30, np.pi, 0.05, 0.4]))
    lying = pk.screw.from_pose(np.array([x - 60, y - 40, z - away, np.pi, 0, 0]))
    camera = Camera(
        fx=focal, fy=focal, cx=480, cy=360, width=960, height=720, board=board, on="platform",
        stands=pk.screw.to_pose(np.linalg.inv(lying)), carried=pk.screw.to_pose(carried),
    )  # fmt: skip
    candidates = pk.sample_poses(robot, 150, seed=2, share=0.9)
    plan = pk.plan_poses(robot, candidates, count=10, kind=camera, noise=0.1, prior=0.5)
    motion = np.linalg.inv(pk.screw.from_pose(plan.poses) @ carried) @ lying
    at = sheet @ motion[:, :3, :3].transpose(0, 2, 1) + motion[:, None, :3, 3]
    pixel = focal * at[..., :2] / at[..., 2:] + [480, 360]
    assert (at[..., 2] > 0).all() and (pixel >= 0).all() and (pixel <= [959, 719]).all()
    assert plan.left_out > 0


def test_a_plan_promises_what_a_calibration_by_its_pictures_gives(
    hexapod: pk.Robot, camera: Camera
) -> None:
    """Deviations of the plan against those of the fit, of numbers that a prior holds as well."""
    candidates = pk.sample_poses(hexapod, 60, seed=3, share=0.6)
    plan = pk.plan_poses(
        hexapod, candidates, count=12, kind=camera, noise=0.1, free=FREE, prior=0.5, criterion="A"
    )
    at, seeing = camera.seeing(plan.actuators, BOARD)
    measured = pk.VirtualMachine(hexapod, 0.1, 1).measure(at, seeing)
    group = np.repeat(np.arange(12), len(BOARD.ids))
    measured = pk.Measurements(
        at, measured.values, measured.instrument, sigma=0.1, actuator_sigma=0.0, group=group
    )
    found = pk.identify(hexapod, measured, FREE, prior=0.5, loss=("linear", "classical"))
    own = dict(zip(found.free, found.stderr, strict=True))
    shared = [name for name in plan.parameters if name in own and not name.startswith(("f", "t"))]
    assert len(shared) == 42
    promised = dict(zip(plan.parameters, plan.stderr, strict=True))
    ratio = np.array([own[name] / promised[name] for name in shared])
    np.testing.assert_allclose(ratio, 1.0, atol=0.1)


def test_pictures_are_planned_on_the_command_line(
    run: Callable[..., Any], refused: Callable[..., str], tmp_path: Path
) -> None:
    lens = tmp_path / "lens.yaml"
    lens.write_text(
        "image_width: 1200\nimage_height: 900\n"
        "camera_matrix: {rows: 3, cols: 3, data: [1700, 0, 600, 0, 1700, 450, 0, 0, 1]}\n"
    )
    seen = ["--camera", lens, "--board", "chessboard:6x5,30"]
    where = ["--camera-at", "450,-500,2000", "--look-at", "60,40,800"]
    out = tmp_path / "plan"
    plan = ["plan", "hexapod", "--count", 15, "--kind", "pixel", "--noise", 0.1]
    result = run(*plan, *seen, *where, "--out", out)
    assert result.exit_code == 0 and "measure 15 poses" in result.stdout, result.output
    assert len(np.genfromtxt(out / "commands.csv", delimiter=",", skip_header=3)) >= 14
    assert "--look-at" in refused(*plan, *seen)
    assert "--kind pixel" in refused("plan", "hexapod", *seen)
    assert "--look-at" in refused(*plan, *seen, *where[:3], "60,40")
    assert "in the picture" in refused(*plan, *seen, *where[:2], "--look-at", "60,40,8000")
