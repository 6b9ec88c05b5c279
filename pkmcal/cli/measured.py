"""Options of how files of measurements are read."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

READING = "How the files are read"  # the panel of these options

Controller = Annotated[
    Path | None,
    typer.Option(
        rich_help_panel=READING,
        metavar="LOG",
        help="A log with the actuators, where the instrument's file has none.",
    ),
]
JoinBy = Annotated[
    str,
    typer.Option(
        "--join",
        rich_help_panel=READING,
        metavar="WORD",
        help="How rows of the log are found: name, row, time; or auto. row+1: of a log that is a"
        " row late, the row after, also within one file.",
    ),
]
Ignore = Annotated[
    list[str] | None,
    typer.Option(
        rich_help_panel=READING,
        metavar="COLUMN",
        help="Leave this column out. Repeat it for others.",
    ),
]
Rename = Annotated[
    list[str] | None,
    typer.Option(
        rich_help_panel=READING,
        metavar="OLD=NEW",
        help="Read column OLD as NEW, such as 'Lg=q1 \\[mm]'.",
    ),
]
Columns = Annotated[
    Path | None,
    typer.Option(
        rich_help_panel=READING,
        metavar="FILE",
        help="A TOML file with header, ignore, rename, units and rotation of the columns.",
    ),
]
Units = Annotated[
    str | None,
    typer.Option(
        rich_help_panel=READING,
        metavar="UNITS",
        help="Of columns without a unit: 'mm', or 'mm,deg'.",
    ),
]
Rotation = Annotated[
    str | None,
    typer.Option(
        rich_help_panel=READING,
        metavar="ORDER",
        help="How orientations are stated where headings do not say: ZYX or another order, each"
        " about the turned axis; xyz, about fixed axes; rotvec; wxyz or xyzw.",
    ),
]
InvertPoses = Annotated[
    bool,
    typer.Option(
        "--invert-poses",
        rich_help_panel=READING,
        help="Poses are those of the base in the platform's frame: a camera on the platform saw a"
        " board on the base. With --from-pnp: they are those of the camera in axes of the board.",
    ),
]
FromPnp = Annotated[
    str | None,
    typer.Option(
        "--from-pnp",
        rich_help_panel=READING,
        metavar="f=PX,board=WxH",
        help="The file has poses of a board in axes of a camera, as other software found them in"
        " pictures (PnP). The focal length in px and the size of the board in mm tell how accurate"
        " a pose is in each direction. middle=XxY is the middle of the board on it: half the size"
        " where poses are of its corner, 0x0 where they are of its middle; a camera that was"
        " pointed at it tells that. noise=PX is the noise of a corner, of which corners=N were"
        " seen, or 25 where nothing says it; without a noise it is estimated. --camera-on says what"
        " the camera is fixed to.",
    ),
]
ProbeOffset = Annotated[
    str | None,
    typer.Option(
        rich_help_panel=READING,
        metavar="X,Y,Z",
        help="Of a column probe: the firmware's offsets of the probe from the nozzle, mm; by"
        " default those of the robot file.",
    ),
]
