"""`pkmcal board`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pkmcal.cli.options import Force, Json
from pkmcal.cli.output import say
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.output import Output
from pkmcal.readings.boards import Board
from pkmcal.report.as_json import as_json


def board(
    board: Annotated[
        str,
        typer.Argument(
            metavar="BOARD", help="Such as charuco:8x6,20,15,5X5_100: squares, side and marker mm."
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(metavar="FILE", help="A PDF, SVG or PNG file, in true size."),
    ] = Path("board.pdf"),
    force: Force = False,
    json: Json = False,
) -> int:
    """Draw a board to print, for calibrations by a camera.

    Print it at 100 %, glue it on a flat plate, and measure some of its squares with a caliper: what
    the printer made of them is the length that the calibration rests on.

    Example: pkmcal board charuco:8x6,20,15,5X5_100 --out board.pdf
    """
    from pkmcal.vision.printed import print_board

    seen = Board.parse(board)
    with Output(out.parent, [out.name], Inputs(), force).draft() as draft:
        print_board(seen, draft / out.name)
    if json:
        say(as_json({"board": board, "file": str(out)}, schema="board"))
    else:
        say(f"{out}: {board}; print it at 100 %, on something flat, and measure its squares")
    return 0
