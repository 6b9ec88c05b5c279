"""`pkmcal import`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, get_args

import typer

import pkmcal as pk
from pkmcal.arguments import word
from pkmcal.cli.inputs import Inputs
from pkmcal.cli.options import Force, Json
from pkmcal.cli.output import Output, say
from pkmcal.controllers.import_printer import Firmware
from pkmcal.report.as_json import as_json


def import_file(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A printer.cfg; M665 and M666.")],
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Where to write; made if it is not there.")
    ] = Path("."),
    firmware: Annotated[
        str,
        typer.Option("--from", metavar="FIRMWARE", help="klipper, reprap, marlin or hangprinter."),
    ] = "klipper",
    force: Force = False,
    json: Json = False,
) -> int:
    """Make a robot file and measurements out of a printer's configuration.

    Of a linear or rotary delta with Klipper or Kalico, of a linear one with the M665 and M666 of
    RepRapFirmware or Marlin, or of a Hangprinter with M669.
    robot.toml has the firmware's numbers; probe.csv the heights that a DELTA_CALIBRATE stored, if
    there are any.

    Example: pkmcal import examples/linear-delta/printer.cfg
    """
    read = Inputs()
    printer = pk.import_printer(read.file(file), word("--from", firmware, get_args(Firmware)))
    names = ["robot.toml"] if printer.measurements is None else ["robot.toml", "probe.csv"]
    output = Output(out, names, read, force)
    with output.draft() as draft:
        (draft / "robot.toml").write_text(read.comment() + printer.text, encoding="utf-8")
        if printer.measurements is not None:
            printer.measurements.write(draft / "probe.csv", comment=read.comment())
    if json:
        heights = 0 if printer.measurements is None else len(printer.measurements)
        parts = {"files": [str(path) for path in output.paths], "heights": heights}
        say(
            as_json(
                {"robot": printer.robot.name, **parts, "distances": printer.distances},
                schema="import",
            )
        )
    else:
        say(printer)
        say("written: " + ", ".join(map(str, output.paths)))
    return 0
