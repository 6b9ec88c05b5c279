"""`pkmcal import`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, get_args

import typer

import pkmcal as pk
from pkmcal.arguments import word
from pkmcal.cli.options import Json
from pkmcal.cli.output import say
from pkmcal.exceptions import ArgumentError
from pkmcal.export.import_printer import Firmware
from pkmcal.files.atomic import write_whole
from pkmcal.report.as_json import as_json


def import_file(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A printer.cfg; M665 and M666.")],
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Where to write; made if it is not there.")
    ] = Path("."),
    firmware: Annotated[
        str, typer.Option("--from", metavar="FIRMWARE", help="klipper, reprap or marlin.")
    ] = "klipper",
    json: Json = False,
) -> int:
    """Make a robot file and measurements out of a printer's configuration.

    Of a linear delta with Klipper or Kalico, or with the M665 and M666 of RepRapFirmware or Marlin.
    robot.toml has the firmware's numbers; probe.csv the heights that a DELTA_CALIBRATE stored, if
    there are any. Existing files are never overwritten.

    Example: pkmcal import examples/linear-delta/printer.cfg
    """
    printer = pk.import_printer(file, word("--from", firmware, get_args(Firmware)))
    robot, probe = out / "robot.toml", out / "probe.csv"
    written = [robot] if printer.measurements is None else [robot, probe]
    for path in written:
        if path.exists():
            raise ArgumentError(f"{path} exists already; name another folder with --out")
    out.mkdir(parents=True, exist_ok=True)
    write_whole(robot, printer.text)
    if printer.measurements is not None:
        printer.measurements.write(probe)
    if json:
        heights = 0 if printer.measurements is None else len(printer.measurements)
        parts = {"files": [str(path) for path in written], "heights": heights}
        say(
            as_json(
                {"robot": printer.robot.name, **parts, "distances": printer.distances},
                schema="import",
            )
        )
    else:
        say(printer)
        say("written: " + ", ".join(map(str, written)))
    return 0
