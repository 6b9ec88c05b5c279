"""`pkmcal import`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, get_args

import typer

from pkmcal.cli.options import Force, Json
from pkmcal.cli.output import say
from pkmcal.controllers.firmwares import Firmware
from pkmcal.jobs import importing
from pkmcal.jobs.configuration import Importing
from pkmcal.jobs.inputs import Inputs
from pkmcal.report.as_json import as_json

# What is counted in which file.
_TABLES = {"probe.csv": "heights", "distances.csv": "distances", "belts.csv": "places"}


def import_file(
    context: typer.Context,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A printer.cfg; M665 and M666.")],
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Where to write; made if it is not there.")
    ] = Path("."),
    firmware: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="FIRMWARE",
            help=f"Whose file it is, where it does not show it: {', '.join(get_args(Firmware))}.",
        ),
    ] = None,
    log: Annotated[
        Path | None,
        typer.Option(
            metavar="LOG", help="Of a Maslow: the log of its calibration, beside its maslow.yaml."
        ),
    ] = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Make a robot file and measurements out of a printer's configuration.

    Whose it is stands in it, or is said by --from. Of a linear or rotary delta with Klipper or
    Kalico, of a linear one with the M665 and M666 of RepRapFirmware or Marlin, of a Hangprinter
    with M669 and M666, or of a Maslow with its maslow.yaml, the log of its calibration, or both.
    robot.toml has the firmware's numbers and the offset of its bed probe; probe.csv the heights
    that a DELTA_CALIBRATE stored, distances.csv the distances of a DELTA_ANALYZE, if there are any;
    belts.csv the belts of a Maslow's log.

    Example: pkmcal import examples/linear-delta/printer.cfg
    """
    read = Inputs()
    job = Importing.of_options(context.params)
    printer = importing.run(job, read)
    paths = importing.write(job, printer, read, force)
    if json:
        tables = importing.tables(printer)
        counts = {what: len(tables.get(name, ())) for name, what in _TABLES.items()}
        probe = printer.robot.model.probe
        found = {
            "robot": printer.robot.name,
            "files": [str(path) for path in paths],
            **counts,
            "probe_offset": None if probe is None else probe.tolist(),
            "notes": list(printer.notes),
        }
        say(as_json(found, schema="import"))
    else:
        say(printer)
        say("written: " + ", ".join(map(str, paths)))
    return 0
