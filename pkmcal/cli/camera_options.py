"""Options of a camera and the board that it sees."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, get_args

import typer

from pkmcal.arguments import word
from pkmcal.exceptions import ArgumentError
from pkmcal.readings.boards import Board
from pkmcal.readings.camera import Camera, Found, Mount

Lens = Annotated[
    Path | None,
    typer.Option(
        "--camera",
        metavar="FILE",
        help="Of pixels u and v: the lens, a YAML or JSON file of OpenCV or camera_info of ROS.",
    ),
]
CameraOn = Annotated[
    str, typer.Option(metavar="WORD", help="What the camera is fixed to: base or platform.")
]
BoardSeen = Annotated[
    str | None,
    typer.Option(
        "--board",
        metavar="BOARD",
        help="What it sees, on the other: charuco:8x6,20,15,5X5_100 (squares, side and marker mm,"
        " dictionary), chessboard:10x7,20 (inner corners), apriltags:6x4,30,9,APRILTAG_36h11"
        " (tag and gap), or a CSV file of corner, x, y, z.",
    ),
]
LensFound = Annotated[
    str,
    typer.Option(
        "--lens",
        metavar="WORD",
        help="What of the lens to identify, too: none, focal (focal lengths and principal point)"
        " or all (distortion as well).",
    ),
]
BoardSize = Annotated[
    bool,
    typer.Option("--find-size", help="Identify by how much the board is larger than stated, too."),
]


def camera(
    lens: Path | None, on: str, board: str | None, found: str, find_size: bool
) -> Camera | None:
    """The camera that options state; None without a lens.

    Raises
    ------
    ValueError
        A word that is none, a board without a camera, a lens file that cannot be read.
    """
    chosen, mount = word("--lens", found, get_args(Found)), word("--camera-on", on, get_args(Mount))
    if lens is None:
        if board is not None:
            raise ArgumentError("--board: it is what a camera sees; state its lens, --camera FILE")
        return None
    seen = None if board is None else Board.parse(board)
    return Camera.from_file(lens, on=mount, board=seen, lens=chosen, find_size=find_size)
