"""Draw the pictures of the tutorial with a camera, from rendered pictures of a board.

python docs/camera/draw.py
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import cv2
import numpy as np
from pkmcal.examples.camera.render import BOARD, main

import pkmcal as pk
from pkmcal.readings import Board
from pkmcal.vision.printed import board_image

HERE = Path(__file__).parent


def draw() -> None:
    """Write board.png, hexapod.png and arm.png: a board, and what is found in six pictures."""
    board = Board.parse(BOARD)
    cv2.imwrite(str(HERE / "board.png"), board_image(board, 2, 10))
    with tempfile.TemporaryDirectory() as made:
        for name in ("hexapod", "arm"):
            folder = Path(made) / name
            main([name, str(folder), "6"])
            found = pk.detect(folder / "pictures", board)
            found.draw(folder / "found.png")
            sheet = cv2.imread(str(folder / "found.png"))
            small = cv2.resize(sheet, None, fx=0.75, fy=0.75, interpolation=cv2.INTER_AREA)
            palette = np.round(small / 16.0).clip(0, 15).astype(np.uint8) * 16
            cv2.imwrite(str(HERE / f"{name}.png"), palette, [cv2.IMWRITE_PNG_COMPRESSION, 9])


if __name__ == "__main__":
    draw()
