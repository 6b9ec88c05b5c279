"""Makes a robot file and measurements of a configuration, as an `Importing` says."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

from pkmcal.arguments import word
from pkmcal.controllers.firmwares import Firmware
from pkmcal.controllers.import_printer import Printer, import_printer
from pkmcal.jobs.configuration import Importing
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.output import Output
from pkmcal.kinematics.reading_units import reading_units
from pkmcal.measurements.measurement_writer import write_measurements
from pkmcal.measurements.measurements import Measurements


def run(job: Importing, inputs: Inputs) -> Printer:
    """Read the configuration.

    Raises
    ------
    ValueError
        A firmware that is not known, or what the configuration cannot hold.
    """
    whose = None if job.firmware is None else word("--from", job.firmware, get_args(Firmware))
    log = None if job.log is None else inputs.file(job.log)
    return import_printer(inputs.file(job.file), whose, log=log)


def write(job: Importing, printer: Printer, inputs: Inputs, force: bool) -> list[Path]:
    """Write robot file and measurements, and return where they are.

    Raises
    ------
    ValueError
        A file that would be lost.
    """
    measured = tables(printer)
    output = Output(Path(job.out), files(printer), inputs, force)
    with output.draft() as draft:
        (draft / "robot.toml").write_bytes((inputs.comment() + printer.text).encode())
        for name, each in measured.items():
            units = reading_units(printer.robot)
            write_measurements(each, draft / name, inputs.comment(), units)
    return output.paths


def files(printer: Printer) -> list[str]:
    """Names of the files that are written: the robot file first."""
    return ["robot.toml", *tables(printer)]


def tables(printer: Printer) -> dict[str, Measurements]:
    """Return the measurements by the file to which they are written."""
    stored = printer.measurements
    places = stored is not None and not stored.components
    found = {"belts.csv" if places else "probe.csv": stored, "distances.csv": printer.distances}
    return {name: measured for name, measured in found.items() if measured is not None}
