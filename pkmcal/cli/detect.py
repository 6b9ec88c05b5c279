"""`pkmcal detect`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pkmcal.cli.options import Force, Json
from pkmcal.cli.output import say
from pkmcal.cli.progress import progress
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.output import Output
from pkmcal.jobs.reading import named
from pkmcal.readings.boards import Board
from pkmcal.readings.camera import Camera
from pkmcal.report.as_json import as_json

PIXELS, SHEET = "pixels.csv", "found.png"


def detect(
    images: Annotated[
        list[Path], typer.Argument(metavar="IMAGES...", help="Pictures, or folders of pictures.")
    ],
    board: Annotated[
        str,
        typer.Option(
            metavar="BOARD",
            help="What they show, as for calibrate: charuco:8x6,20,15,5X5_100, chessboard:10x7,20,"
            " apriltags:6x4,30,9,APRILTAG_36h11 or circles:10x7,25. NAME=BOARD writes a column"
            " board, for calibrations with several.",
        ),
    ],
    camera: Annotated[
        str | None,
        typer.Option(
            "--camera",
            metavar="FILE",
            help="The lens, by which pictures are judged; not needed. NAME=FILE, or NAME= alone,"
            " writes a column camera, for calibrations with several.",
        ),
    ] = None,
    out: Annotated[
        Path,
        typer.Option(
            metavar="DIR", help="Write pixels.csv and found.png, all pictures with what was found."
        ),
    ] = Path("found"),
    force: Force = False,
    json: Json = False,
) -> int:
    """Find the corners of a printed board in pictures.

    Writes pixels.csv for calibrate, which joins the log of the joints by the names of pictures.
    It takes OpenCV, which the extra vision of pkmcal installs. Exit code 1: no picture shows the
    board.

    Example: pkmcal detect pictures --board charuco:8x6,20,15,5X5_100 --out found
    """
    from pkmcal.vision.detect import detect as find

    read = Inputs()
    output = Output(out, [PIXELS, SHEET], read, force)
    of_camera, file = named(camera or "")
    of_board, which = named(board)
    lens = Camera.from_file(file) if file else None
    seen = Board.parse(which)
    with progress("looking for boards") as step:
        found = find(images, seen, lens, step)
    written: list[Path] = []
    if found.taken:
        with output.draft() as draft:
            found.write(draft / PIXELS, camera=of_camera, board=of_board)
            found.draw(draft / SHEET)
        written = output.paths
    if json:
        said = {
            "board": board,
            "images": [each.path.name for each in found.taken],
            "corners": [len(each.seen.ids) for each in found.taken],
            "bad": dict(found.bad),
            "remarks": list(found.remarks),
            "files": [str(path) for path in written],
        }
        say(as_json(said, schema="detect"))
    else:
        say("\n".join([str(found), *map(str, written)]))
    return 0 if found.taken else 1
