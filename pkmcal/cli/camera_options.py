"""Options of a camera and the board that it sees."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pkmcal.cli.measured import READING

Lens = Annotated[
    Path | None,
    typer.Option(
        "--camera",
        rich_help_panel=READING,
        metavar="FILE",
        help="Of pixels u and v: the lens, a YAML or JSON file of OpenCV or camera_info of ROS.",
    ),
]
Lenses = Annotated[
    list[str] | None,
    typer.Option(
        "--camera",
        rich_help_panel=READING,
        metavar="FILE",
        help="Of pixels u and v: the lens, a YAML or JSON file of OpenCV or camera_info of ROS. Of"
        " several cameras NAME=FILE each, as the column camera has them; repeatable.",
    ),
]
CameraOn = Annotated[
    str,
    typer.Option(
        rich_help_panel=READING,
        metavar="WORD",
        help="What the camera is fixed to: base or platform.",
    ),
]
BoardSeen = Annotated[
    str | None,
    typer.Option(
        "--board",
        rich_help_panel=READING,
        metavar="BOARD",
        help="What it sees, on the other: charuco:8x6,20,15,5X5_100 (squares, side and marker mm,"
        " dictionary), chessboard:10x7,20 (inner corners), apriltags:6x4,30,9,APRILTAG_36h11"
        " (tag and gap), or a CSV file of corner, x, y, z.",
    ),
]
BoardsSeen = Annotated[
    list[str] | None,
    typer.Option(
        "--board",
        rich_help_panel=READING,
        metavar="BOARD",
        help="What it sees, on the other: charuco:8x6,20,15,5X5_100 (squares, side and marker mm,"
        " dictionary), chessboard:10x7,20 (inner corners), apriltags:6x4,30,9,APRILTAG_36h11"
        " (tag and gap), or a CSV file of corner, x, y, z. Of several boards NAME=BOARD each, as"
        " the column board has them; repeatable.",
    ),
]
LensFound = Annotated[
    str,
    typer.Option(
        "--lens",
        rich_help_panel=READING,
        metavar="WORD",
        help="What of the lens to identify, too: none, focal (focal lengths and principal point)"
        " or all (distortion as well).",
    ),
]
BoardSize = Annotated[
    bool,
    typer.Option(
        "--find-size",
        rich_help_panel=READING,
        help="Identify by how much the board is larger than stated, too.",
    ),
]
BoardSizeKnown = Annotated[
    float,
    typer.Option(
        "--size-sigma",
        rich_help_panel=READING,
        metavar="SHARE",
        help="Standard deviation of the board's size as a share, such as 0.0005 where 500 mm of it"
        " were measured to 0.25: every ± then contains it.",
    ),
]


CameraAt = Annotated[
    str | None,
    typer.Option(
        metavar="X,Y,Z[,A,B,C]",
        help="Where it will be, mm: on the base its place; on the platform its pose there, whose z"
        " is the line of sight.",
    ),
]
LookAt = Annotated[
    str | None,
    typer.Option(
        metavar="X,Y,Z",
        help="A point of the base: on the base the camera looks at it; on the platform the board"
        " lies there, facing up.",
    ),
]
