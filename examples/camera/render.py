"""Take pictures of a printed board, as a camera beside a hexapod or on the wrist of an arm does.

    python examples/camera/render.py hexapod FOLDER
    python examples/camera/render.py arm FOLDER

FOLDER gets pictures/, the joints at which each was taken (joints.csv), the lens (lens.yaml), the
machine as drawn (hexapod.toml or arm.urdf), and for comparison the machine as it is (true.toml).
It takes OpenCV (the extra vision).
"""

from __future__ import annotations

import sys
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

import pkmcal as pk
from pkmcal.readings import Board, Camera
from pkmcal.vision.printed import board_image

BOARD = "charuco:8x6,25,18,5X5_100"
LENS = {
    "fx": 1700.0, "fy": 1702.0, "cx": 604.3, "cy": 447.1, "k1": -0.12, "k2": 0.09, "p1": 5e-4,
    "p2": -3e-4, "k3": 0.0, "width": 1200, "height": 900,
}  # fmt: skip
ERRORS, MRAD, SCATTER = 0.4, 1e-3, 0.005  # mm and rad of the machine; mm of its legs in a picture
PER_MM, FINE, BLUR, GREY = 6, 3, 0.6, 2.0  # pixels of the board a mm; rays a pixel and axis; px

ARM = [  # axis, place in the link before [mm], limits [deg]
    ("0 0 1", (0, 0, 260), 170), ("0 1 0", (0, 0, 120), 120), ("0 1 0", (0, 0, 420), 150),
    ("1 0 0", (180, 0, 25), 180), ("0 1 0", (230, 0, 0), 120), ("1 0 0", (90, 0, 0), 350),
]  # fmt: skip


class Photographer:
    """A camera that takes pictures of a board.

    Parameters
    ----------
    board : Board
        What is printed.
    lens : mapping
        Nine numbers, width and height.
    seed : int
        Of the noise of the pictures.
    """

    def __init__(self, board: Board, lens: dict[str, float], seed: int = 0) -> None:
        self.lens = lens
        self._margin = board.sizes[0]
        # of chessboards and dots the first corner is one square behind the edge of what is printed
        inside = board.sizes[0] if board.kind in ("chessboard", "circles") else 0.0
        self._edge = self._margin + inside
        self._print = board_image(board, PER_MM, self._margin)
        self._random = np.random.default_rng(seed)
        self._rays = _rays(tuple(lens.items()))

    def take(self, motion: np.ndarray) -> np.ndarray:
        """The picture (height, width) of a board at `motion` (4, 4) in axes of the camera."""
        to_board = np.linalg.inv(motion[:3, [0, 1, 3]])
        light = np.zeros(self._rays[0].shape[:2])
        for rays in self._rays:
            at = rays @ to_board.T
            at = ((at[..., :2] / at[..., 2:] + self._edge) * PER_MM - 0.5).astype(np.float32)
            light += cv2.remap(self._print, at, None, cv2.INTER_LINEAR, borderValue=190)
        light = cv2.GaussianBlur(light / len(self._rays), (0, 0), BLUR) * 0.75 + 25.0
        return (light + self._random.normal(0.0, GREY, light.shape)).clip(0, 255).astype(np.uint8)


@lru_cache(maxsize=1)
def _rays(numbers: tuple[tuple[str, float], ...]) -> list[np.ndarray]:
    """Rays (height, width, 3) through points all over each pixel, by a lens; kept for the next."""
    offsets, lens = (np.arange(FINE) + 0.5) / FINE - 0.5, dict(numbers)
    return [_directions(lens, du, dv) for du in offsets for dv in offsets]


def _directions(lens: dict[str, float], du: float, dv: float) -> np.ndarray:
    """Rays (height, width, 3) that end beside the centres of pixels: distortion undone."""
    v, u = np.mgrid[: lens["height"], : lens["width"]]
    bent = np.stack([(u + du - lens["cx"]) / lens["fx"], (v + dv - lens["cy"]) / lens["fy"]], 2)
    x, y = np.moveaxis(bent, 2, 0).copy()
    for _ in range(12):
        r2 = x * x + y * y
        radial = 1.0 + r2 * (lens["k1"] + r2 * (lens["k2"] + r2 * lens["k3"]))
        aside = 2 * lens["p1"] * x * y + lens["p2"] * (r2 + 2 * x * x)
        down = lens["p1"] * (r2 + 2 * y * y) + 2 * lens["p2"] * x * y
        x, y = (bent[..., 0] - aside) / radial, (bent[..., 1] - down) / radial
    return np.stack([x, y, np.ones_like(x)], axis=2)


def looking(eye: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The base (4, 4) in axes of a camera at `eye` that looks at a point, x level."""
    ahead = (at - eye) / np.linalg.norm(at - eye)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    motion = np.eye(4)
    motion[:3, :3] = [right, np.cross(ahead, right), ahead]
    motion[:3, 3] = -motion[:3, :3] @ eye
    return motion


def urdf() -> str:
    """The arm as drawn."""
    links = "".join(f'  <link name="link{i}"/>\n' for i in range(7))
    joints = "".join(
        f'  <joint name="j{i + 1}" type="revolute">\n    <parent link="link{i}"/>'
        f'<child link="link{i + 1}"/>\n    <origin xyz="{x / 1e3} {y / 1e3} {z / 1e3}"/>'
        f'<axis xyz="{axis}"/>\n    <limit lower="{-np.radians(end):.6f}"'
        f' upper="{np.radians(end):.6f}" effort="1" velocity="1"/>\n  </joint>\n'
        for i, (axis, (x, y, z), end) in enumerate(ARM)
    )
    return f'<?xml version="1.0"?>\n<robot name="arm">\n{links}{joints}</robot>\n'


def hexapod(folder: Path, random: np.random.Generator, count: int) -> None:
    """A board on the platform, a camera that stands beside the machine."""
    drawn = pk.load("hexapod")
    drawn.save(folder / "hexapod.toml")
    names = drawn.geometry.match(["base*", "platform*", "offset*"])
    true = drawn.replace({n: drawn.geometry[n] + random.normal(0.0, ERRORS) for n in names})
    stands = looking(np.array([450.0, -500, 2000]), np.array([60.0, 40, 800]))
    board = pk.screw.from_pose(np.array([-90.0, 70, 25, np.pi, 0.03, 0.2]))
    q = drawn.inverse(pk.sample_poses(drawn, 40 * count, seed=1, share=0.3))
    _photograph(folder, "base", drawn, true, q, stands, board, random, count)


def arm(folder: Path, random: np.random.Generator, count: int) -> None:
    """A camera on the wrist, a board that lies on the table."""
    (folder / "arm.urdf").write_text(urdf(), encoding="utf-8")
    drawn = pk.load(folder / "arm.urdf")
    errors = random.normal(0.0, 1.0, (6, 6)) * ([ERRORS / 2] * 3 + [MRAD] * 3)
    true = drawn.replace(errors)
    board = pk.screw.from_pose(np.array([190.0, 80, 0, np.pi, 0.02, 0.1]))
    carried = pk.screw.from_pose(np.array([40.0, 5, 30, 0.02, np.pi / 2, -0.03]))
    near = np.radians([0.0, -10, 45, 0, 55, 0])
    q = near + random.uniform(-1, 1, (60 * count, 6)) * np.radians([20, 20, 20, 30, 20, 170])
    _photograph(folder, "platform", drawn, true, q, np.linalg.inv(board), carried, random, count)


def _photograph(
    folder: Path, on: str, drawn: object, true: object, q: np.ndarray, stands: np.ndarray,
    carried: np.ndarray, random: np.random.Generator, count: int,
) -> None:  # fmt: skip
    """Take a picture at the first poses at which the whole board is in it."""
    board = Board.parse(BOARD)
    camera = Camera(
        **LENS, on=on, stands=pk.screw.to_pose(stands), carried=pk.screw.to_pose(carried)
    )
    scatter = SCATTER if on == "base" else SCATTER / 500.0  # of the joints of an arm, rad
    at = q + random.normal(0.0, scatter, q.shape)
    rows, seeing = camera.seeing(at, board)
    seen = pk.VirtualMachine(true, 0.0).measure(rows, seeing).values
    inside = np.isfinite(seen).all(axis=1).reshape(len(q), -1).all(axis=1)
    taken = np.flatnonzero(inside)[:count]
    if len(taken) < count:
        raise SystemExit(f"only {len(taken)} of {len(q)} poses show the whole board")
    true.save(folder / "true.toml")
    place = true.forward(at[taken])
    place = pk.screw.from_pose(place.pose) if hasattr(place, "pose") else place
    motion = stands @ place @ carried
    if on == "platform":
        motion = np.linalg.inv(motion)
    photographer = Photographer(board, LENS, seed=int(random.integers(2**31)))
    (folder / "pictures").mkdir(parents=True, exist_ok=True)
    units = ["mm" if on == "base" else "deg"] * q.shape[1]
    lines = ["image," + ",".join(f"q{i + 1} [{unit}]" for i, unit in enumerate(units))]
    for k, (row, where) in enumerate(zip(taken, motion, strict=True)):
        name = f"{k + 1:03d}.png"
        cv2.imwrite(str(folder / "pictures" / name), photographer.take(where))
        told = q[row] if on == "base" else np.degrees(q[row])
        lines.append(",".join([name, *(f"{each:.6f}" for each in told)]))
    (folder / "joints.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    fx, fy, cx, cy, *bent = (
        LENS[n] for n in ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
    )
    (folder / "lens.yaml").write_text(
        "%YAML:1.0\n---\n"
        f"image_width: {LENS['width']}\nimage_height: {LENS['height']}\n"
        "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
        f"   data: [ {fx}, 0., {cx}, 0., {fy}, {cy}, 0., 0., 1. ]\n"
        "distortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n"
        f"   data: [ {', '.join(map(str, bent))} ]\n",
        encoding="utf-8",
    )


def main(words: list[str]) -> None:
    """Make a folder."""
    if len(words) not in (2, 3) or words[0] not in ("hexapod", "arm"):
        raise SystemExit(__doc__)
    folder, count = Path(words[1]), int(words[2]) if len(words) == 3 else 40
    folder.mkdir(parents=True, exist_ok=True)
    make = hexapod if words[0] == "hexapod" else arm
    make(folder, np.random.default_rng(4), count)
    print(f"{folder}: {count} pictures, joints.csv, lens.yaml; the board is {BOARD}")


if __name__ == "__main__":
    main(sys.argv[1:])
