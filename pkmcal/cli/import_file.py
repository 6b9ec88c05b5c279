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
from pkmcal.kinematics.reading_units import reading_units
from pkmcal.measurements.measurement_writer import write_measurements
from pkmcal.report.as_json import as_json


def import_file(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A printer.cfg; M665 and M666.")],
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Where to write; made if it is not there.")
    ] = Path("."),
    firmware: Annotated[
        str,
        typer.Option("--from", metavar="FIRMWARE", help=f"{', '.join(get_args(Firmware))}."),
    ] = "klipper",
    force: Force = False,
    json: Json = False,
) -> int:
    """Make a robot file and measurements out of a printer's configuration.

    Of a linear or rotary delta with Klipper or Kalico, of a linear one with the M665 and M666 of
    RepRapFirmware or Marlin, of a Hangprinter with M669 and M666, or of a Maslow with its
    maslow.yaml or the log of its calibration.
    robot.toml has the firmware's numbers; probe.csv the heights that a DELTA_CALIBRATE stored, if
    there are any; belts.csv the belts of a Maslow's log.

    Example: pkmcal import examples/linear-delta/printer.cfg
    """
    read = Inputs()
    printer = pk.import_printer(read.file(file), word("--from", firmware, get_args(Firmware)))
    measured = printer.measurements
    table = "belts.csv" if measured is not None and measured.kind == "closure" else "probe.csv"
    names = ["robot.toml"] if measured is None else ["robot.toml", table]
    output = Output(out, names, read, force)
    with output.draft() as draft:
        (draft / "robot.toml").write_bytes((read.comment() + printer.text).encode())
        if measured is not None:
            units = reading_units(printer.robot)
            write_measurements(measured, draft / table, read.comment(), units)
    if json:
        rows = 0 if measured is None else len(measured)
        places = rows if table == "belts.csv" else 0
        counts = {"heights": rows - places, "distances": printer.distances, "places": places}
        files = [str(path) for path in output.paths]
        notes = list(printer.notes)
        found = {"robot": printer.robot.name, "files": files, **counts, "notes": notes}
        say(as_json(found, schema="import"))
    else:
        say(printer)
        say("written: " + ", ".join(map(str, output.paths)))
    return 0
