"""Boards in pictures with a known truth: where corners are put, and which pictures are bad."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.readings import Board, Camera

cv2 = pytest.importorskip("cv2", reason="OpenCV is not installed (the extra vision)")

from pkmcal.examples.camera.render import Photographer  # noqa: E402

from ..sweeps import sweep  # noqa: E402

LENS = {
    "fx": 1150.0, "fy": 1152.0, "cx": 402.3, "cy": 296.1, "k1": -0.12, "k2": 0.09, "p1": 5e-4,
    "p2": -3e-4, "k3": 0.0, "width": 800, "height": 600,
}  # fmt: skip
CHARUCO = "charuco:8x6,20,15,5X5_100"
BOARDS = {  # and how far corners scatter, px, at most
    CHARUCO: 0.06,
    "charuco:6x8,20,15,4X4_50,legacy": 0.06,
    "chessboard:9x6,20": 0.05,
    "apriltags:4x3,30,10,APRILTAG_36h11": 0.25,
    "circles:8x6,20": 0.1,
}


def poses(count: int, board: Board, seed: int = 0, tilt: float = 35.0) -> np.ndarray:
    """Boards (count, 4, 4) before the camera, tilted by up to so many degrees, turned by any."""
    random, middle = np.random.default_rng(seed), board.places.mean(axis=0)
    found = []
    for _ in range(count):
        axis = np.append(random.normal(size=2), 0.0)
        axis *= np.radians(random.uniform(5, tilt)) / np.linalg.norm(axis)
        motion = pk.screw.exp(np.append(axis, np.zeros(3)))
        motion = motion @ pk.screw.exp(np.array([0, 0, random.uniform(-3, 3), 0, 0, 0]))
        place = [*random.uniform(-15, 15, 2), random.uniform(400, 550)]
        motion[:3, 3] = place - motion[:3, :3] @ middle
        found.append(motion)
    return np.array(found)


def seen_by_opencv(board: Board, motion: np.ndarray) -> np.ndarray:
    """Pixels of all corners, (n, 2), by OpenCV's own projection."""
    matrix = np.array([[LENS["fx"], 0, LENS["cx"]], [0, LENS["fy"], LENS["cy"]], [0, 0, 1]])
    bent = np.array([LENS[name] for name in ("k1", "k2", "p1", "p2", "k3")])
    turn = cv2.Rodrigues(motion[:3, :3])[0]
    return cv2.projectPoints(board.places, turn, motion[:3, 3], matrix, bent)[0][:, 0]


def taken(folder: Path, board: Board, motions: np.ndarray, **changes: float) -> Path:
    """A folder with a picture of each."""
    folder.mkdir()
    photographer = Photographer(board, {**LENS, **changes})
    for k, motion in enumerate(motions):
        cv2.imwrite(str(folder / f"{k}.png"), photographer.take(motion))
    return folder


def off(found: pk.Detection, motions: np.ndarray) -> np.ndarray:
    """How far corners are from where OpenCV projects them, (N, 2)."""
    truth = {f"{k}.png": seen_by_opencv(found.board, m) for k, m in enumerate(motions)}
    return np.concatenate([p.seen.pixel - truth[p.path.name][p.seen.ids] for p in found.taken])


@pytest.fixture(autouse=True)
def tags_by_opencv(monkeypatch: pytest.MonkeyPatch) -> None:
    """pupil-apriltags, where it is installed, stays out of the process of the tests."""
    monkeypatch.setitem(sys.modules, "pupil_apriltags", None)


@pytest.fixture(scope="module")
def charuco(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, np.ndarray]:
    board = Board.parse(CHARUCO)
    motions = poses(6, board, seed=5)
    return taken(tmp_path_factory.mktemp("charuco") / "pictures", board, motions), motions


@sweep("word", BOARDS, quick=[word for word in BOARDS if word != CHARUCO])
def test_corners_are_where_opencv_projects_them(tmp_path: Path, word: str) -> None:
    """Without bias: (0, 0) is the centre of a pixel; every corner has its own number."""
    board = Board.parse(word)
    motions = poses(3, board, tilt=20.0 if board.kind == "circles" else 35.0)
    found = pk.detect(taken(tmp_path / "p", board, motions), board)
    wrong = off(found, motions)
    if board.kind == "circles":  # a dot's middle is no projection of its centre
        assert len(found.taken) >= 2 and np.abs(wrong).max() < 0.5  # 4.8 misses one
        return
    assert len(found.taken) == 3 and len(wrong) >= 0.9 * 3 * len(board.ids)
    spread = wrong.std(axis=0)
    assert spread.max() < BOARDS[word]
    assert np.abs(wrong.mean(axis=0)).max() < 0.01 + 3 * spread.max() / np.sqrt(len(wrong))


DETECT = """
import sys
if sys.argv[1] == "opencv":
    sys.modules["pupil_apriltags"] = None
import pkmcal as pk
pk.detect(sys.argv[2], pk.readings.Board.parse(sys.argv[3])).write(sys.argv[4])
"""


@sweep("library", ["pupil_apriltags", "opencv"], quick=["pupil_apriltags"])
def test_either_finder_of_tags_puts_them_in_the_same_place(tmp_path: Path, library: str) -> None:
    """In a process of its own: a fault of the library must not end all other tests."""
    if library != "opencv" and PathFinder.find_spec("pupil_apriltags") is None:
        pytest.skip("pupil-apriltags is not installed")
    word = "apriltags:4x3,30,10,APRILTAG_36h11"
    board = Board.parse(word)
    motions = poses(3, board, seed=2)
    folder, table = taken(tmp_path / "p", board, motions), tmp_path / "found.csv"
    command = [sys.executable, "-c", DETECT, library, str(folder), word, str(table)]
    subprocess.run(command, check=True, timeout=120)
    rows = [line.split(",") for line in table.read_text().splitlines() if line[0].isdigit()]
    truth = [seen_by_opencv(board, motion) for motion in motions]
    right = [truth[int(image.partition(".")[0])][int(corner)] for image, corner, *_ in rows]
    wrong = np.array([row[2:4] for row in rows], dtype=float) - right
    assert len(wrong) >= 100
    assert np.abs(wrong.mean(axis=0)).max() < (0.015 if library == "pupil_apriltags" else 0.06)


def test_a_chessboard_upside_down_keeps_the_numbers_of_its_corners(tmp_path: Path) -> None:
    board = Board.chessboard(8, 5, 20)
    first = poses(1, board)[0]
    middle = np.append(board.places.mean(axis=0), 1.0)
    half = np.diag([-1.0, -1, 1, 1])
    half[:2, 3] = 2 * middle[:2]
    motions = np.stack([first, first @ half])
    assert np.abs(off(pk.detect(taken(tmp_path / "p", board, motions), board), motions)).max() < 0.3
    alike = Board.chessboard(7, 5, 5)
    pk.print_board(alike, tmp_path / "alike.png")
    assert "turned by 180" in str(pk.detect(tmp_path / "alike.png", alike))


@pytest.mark.parametrize("times", [1.0, 1.4])
def test_dots_of_which_none_is_seen_to_be_larger_are_said_to_be_numbered_from_either_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, times: float
) -> None:
    """One that is 1.4 times as large as the others tells; pkmcal prints it 1.7 times as large."""
    board = Board.circles(8, 5, 20)
    (first,) = poses(1, board, tilt=20.0)
    half = np.diag([-1.0, -1, 1, 1])
    half[:2, 3] = 2 * board.places.mean(axis=0)[:2]
    motions = np.stack([first, first @ half])
    monkeypatch.setattr("pkmcal.vision.printed._LARGE", times)
    found = pk.detect(taken(tmp_path / "p", board, motions), board)
    said = "in 2 of 2 pictures no dot at the lower left" in str(found)
    assert said == (times == 1.0) and len(found.taken) == 2
    assert said or np.abs(off(found, motions)).max() < 0.5


def test_bad_pictures_are_named_with_the_reason(
    tmp_path: Path, charuco: tuple[Path, np.ndarray]
) -> None:
    board, folder = Board.parse(CHARUCO), tmp_path / "p"
    folder.mkdir()
    images = [cv2.imread(str(charuco[0] / f"{k}.png"), cv2.IMREAD_GRAYSCALE) for k in range(6)]
    for k, image in enumerate(images):
        cv2.imwrite(str(folder / f"{k}.png"), image)
    seen = pk.detect([folder / "0.png"], board).pixel
    visible = np.zeros_like(images[0])
    side = np.linalg.norm(seen[17] - seen[16])
    cv2.circle(visible, seen[16].round().astype(int).tolist(), int(1.75 * side), 1, -1)
    covered = np.where(visible, images[0], 128).astype(np.uint8)
    bent = images[1].copy()  # a picture of two halves: the machine moved between its lines
    bent[300:] = np.roll(bent[300:], 8, axis=1)
    other = Photographer(Board.charuco(8, 6, 20, 15, "4X4_50"), LENS).take(charuco[1][0])
    cv2.imwrite(str(folder / "grey.png"), np.full_like(images[0], 128))
    cv2.imwrite(str(folder / "few.png"), covered)
    cv2.imwrite(str(folder / "moved.png"), bent)
    cv2.imwrite(str(folder / "small.png"), cv2.resize(images[2], (640, 480)))
    cv2.imwrite(str(folder / "blurred.png"), cv2.GaussianBlur(images[4], (0, 0), 2.0))
    cv2.imwrite(str(folder / "other.png"), other)
    (folder / "twice.png").write_bytes((folder / "2.png").read_bytes())
    found = pk.detect(folder, board)
    assert [p.path.name for p in found.taken] == [f"{k}.png" for k in (0, 1, 3, 4, 5)]
    words = {
        "grey.png": "no board found", "few.png": "corners, 6 are needed", "moved.png": "moved",
        "small.png": "640 x 480, the others 800 x 600", "blurred.png": "blurred",
        "twice.png": "the same picture as 2.png", "2.png": "the same picture as twice.png",
        "other.png": "no board found",
    }  # fmt: skip
    assert {*found.bad} == {*words}
    for name, word in words.items():
        assert word in found.bad[name], (name, found.bad[name])


def test_mirrored_pictures_are_said_to_be_mirrored(
    tmp_path: Path, charuco: tuple[Path, np.ndarray]
) -> None:
    folder = tmp_path / "p"
    folder.mkdir()
    for k in range(2):
        image = cv2.imread(str(charuco[0] / f"{k}.png"), cv2.IMREAD_GRAYSCALE)
        cv2.imwrite(str(folder / f"{k}.png"), image[:, ::-1])
    found = pk.detect(folder, Board.parse(CHARUCO))
    assert not found.taken and "mirrored" in str(found)


def test_a_board_whose_rows_are_stated_before_its_columns_is_said(
    charuco: tuple[Path, np.ndarray],
) -> None:
    kind, _, rest = CHARUCO.partition(":")
    shape, *others = rest.split(",")
    exchanged = f"{kind}:{'x'.join(shape.split('x')[::-1])},{','.join(others)}"
    found = pk.detect(charuco[0] / "0.png", Board.parse(exchanged))
    assert not found.taken and f"a board of {shape} is found" in str(found)


@pytest.mark.slow
def test_a_board_of_other_markers_or_another_shape_is_said(
    charuco: tuple[Path, np.ndarray],
) -> None:
    strange = pk.detect(charuco[0] / "0.png", Board.charuco(6, 8, 20, 15, "4X4_50"))
    assert not strange.taken and "is found" not in str(strange)
    assert "markers of 5X5_1000 are found" in str(strange) and "dictionary that" in str(strange)
    wide = pk.detect(charuco[0] / "0.png", Board.charuco(9, 6, 20, 15, "5X5_100"))
    assert not wide.taken and "state the shape" in str(wide)


def test_boards_that_are_all_tilted_alike_are_said(tmp_path: Path) -> None:
    board = Board.parse(CHARUCO)
    level = poses(3, board)
    level[:, :3, 3] += (level[:, :3, :3] - level[0, :3, :3]) @ board.places.mean(axis=0)
    level[:, :3, :3] = level[0, :3, :3]
    folder = taken(tmp_path / "p", board, level)
    assert "tilted alike" in str(pk.detect(folder, board, Camera(**LENS)))
    assert "tilted alike" not in str(pk.detect(folder, board))  # nobody knows without a lens


def test_the_same_corners_are_found_by_opencv_4_and_5(charuco: tuple[Path, np.ndarray]) -> None:
    """The other version is in a folder of its own, which `make test` installs."""
    other = Path(sys.prefix) / "opencv4"
    if not other.is_dir():
        pytest.skip(f"OpenCV 4 is not installed in {other.name} of the environment (make test)")
    program = (
        "import json, sys, cv2, pkmcal as pk\n"
        "from pkmcal.readings import Board\n"
        "found = pk.detect(sys.argv[1], Board.parse(sys.argv[2]))\n"
        "print(json.dumps([cv2.__version__, found.corner.tolist(), found.pixel.tolist()]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, charuco[0], CHARUCO],
        env={**os.environ, "PYTHONPATH": str(other)}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    version, corner, pixel = json.loads(done.stdout)
    here = pk.detect(charuco[0], Board.parse(CHARUCO))
    assert version.split(".")[0] == "4" != cv2.__version__.split(".")[0]
    assert here.corner.tolist() == corner
    np.testing.assert_allclose(here.pixel, pixel, atol=0.05)


def test_a_folder_becomes_a_file_and_a_picture(
    run: Callable[..., Any], refused: Callable[..., str], tmp_path: Path, charuco: tuple[Path, Any]
) -> None:
    result = run("detect", charuco[0], "--board", CHARUCO, "--out", tmp_path / "found")
    assert result.exit_code == 0, result.stderr
    assert "6 of 6 pictures" in result.stdout
    table = pk.detect(charuco[0], Board.parse(CHARUCO))
    lines = (tmp_path / "found" / "pixels.csv").read_text().splitlines()
    rows = [line.split(",") for line in lines if not line.startswith("#")]
    assert rows[0] == ["image", "corner", "u [px]", "v [px]"]
    assert np.array_equal(np.array(rows[1:])[:, 2:].astype(float), table.pixel)
    sheet = cv2.imread(str(tmp_path / "found" / "found.png"))
    assert sheet.shape[2] == 3 and (sheet[..., 1] != sheet[..., 0]).any()  # marks are coloured
    said = json.loads(
        run("detect", charuco[0], "--board", CHARUCO, "--out", tmp_path / "f2", "--json").stdout
    )
    assert said["corners"] == [len(p.seen.ids) for p in table.taken] and said["bad"] == {}
    (tmp_path / "none").mkdir()
    assert "no pictures" in refused("detect", tmp_path / "none", "--board", CHARUCO)
    assert "dictionary" in refused("detect", charuco[0], "--board", "charuco:8x6,20,15,5X5_10")
    (tmp_path / "points.csv").write_text("corner,x,y,z\n0,0,0,0\n")
    assert "points" in refused("detect", charuco[0], "--board", tmp_path / "points.csv")
    (tmp_path / "text.png").write_text("no picture")
    assert "text.png" in refused("detect", tmp_path / "text.png", "--board", CHARUCO)


def test_a_file_without_a_byte_is_named_as_no_picture(
    refused: Callable[..., str], tmp_path: Path
) -> None:
    (tmp_path / "nothing.png").write_bytes(b"")
    assert "nothing.png: this file is empty" in refused("detect", tmp_path, "--board", CHARUCO)


def test_dark_pictures_that_show_nothing_are_said_to_be_dark(
    tmp_path: Path, charuco: tuple[Path, np.ndarray]
) -> None:
    """Levels of 12 bits in a file of 16 are black for who reads the upper eight."""
    file = tmp_path / "0.png"
    levels = cv2.imread(str(charuco[0] / "0.png"), cv2.IMREAD_GRAYSCALE).astype(np.uint16)
    cv2.imwrite(str(file), levels // 16)
    board = Board.parse(CHARUCO)
    found = pk.detect(file, board)
    most = levels.max() // 16
    assert not found.taken and f"0.png is dark, with levels up to {most} of 65535" in str(found)
    cv2.imwrite(str(file), np.full_like(levels, 30000))
    assert "dark" not in str(pk.detect(file, board))


def test_without_opencv_the_extra_is_named(
    monkeypatch: pytest.MonkeyPatch, refused: Callable[..., str], charuco: tuple[Path, Any]
) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)
    assert "pip install opencv-python-headless" in refused("detect", charuco[0], "--board", CHARUCO)


PRINTED = (
    "charuco:5x4,8,6,4X4_50", "chessboard:5x4,8", "apriltags:2x2,15,5,APRILTAG_36h11",
    "circles:7x5,8",
)  # fmt: skip


@sweep("word", PRINTED, quick=PRINTED[:2])
def test_a_board_is_printed_in_its_true_size(
    run: Callable[..., Any], tmp_path: Path, word: str
) -> None:
    """What is printed at 508 dots an inch is found where the board has its corners."""
    board, file = Board.parse(word), tmp_path / "board.png"
    assert run("board", word, "--out", file).exit_code == 0
    found = pk.detect([file], board)
    per_mm = 508 / 25.4
    (picture,) = found.taken
    at = picture.seen.pixel / per_mm
    wanted = board.at(picture.seen.ids)[:, :2]
    np.testing.assert_allclose(at - at.mean(axis=0), wanted - wanted.mean(axis=0), atol=0.06)
    pdf = tmp_path / "board.pdf"
    run("board", word, "--out", pdf)
    height, width = cv2.imread(str(file)).shape[:2]
    box = np.array(pdf.read_bytes().split(b"/MediaBox [ ")[1].split(b" ]")[0].split(), dtype=float)
    np.testing.assert_allclose(box[2:] / 72 * 25.4, [width / per_mm, height / per_mm], rtol=1e-4)
