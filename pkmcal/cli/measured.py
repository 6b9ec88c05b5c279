"""Files of measurements as the command line gives them, and what was assumed in reading them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

import pkmcal as pk
from pkmcal.cli.inputs import Inputs
from pkmcal.cli.output import say
from pkmcal.exceptions import ArgumentError, FileError
from pkmcal.files.number_text import typed
from pkmcal.files.reading import MOST_ROBOT
from pkmcal.files.toml_lines import Source
from pkmcal.files.toml_table import Table
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.measurements.measurements import Measurements

_KEYS = ("header", "ignore", "rename", "units", "rotation")

Controller = Annotated[
    Path | None,
    typer.Option(
        metavar="LOG", help="A log with the actuators, where the instrument's file has none."
    ),
]
JoinBy = Annotated[
    str,
    typer.Option(
        "--join",
        metavar="WORD",
        help="How rows of the log are found: name, row, time; or auto. row+1: of a log that is a"
        " row late, the row after.",
    ),
]
Ignore = Annotated[
    list[str] | None,
    typer.Option(metavar="COLUMN", help="Leave this column out. Repeat it for others."),
]
Rename = Annotated[
    list[str] | None,
    typer.Option(metavar="OLD=NEW", help="Read column OLD as NEW, such as 'Lg=q1 \\[mm]'."),
]
Columns = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="A TOML file with header, ignore, rename, units and rotation of the columns.",
    ),
]
Units = Annotated[
    str | None,
    typer.Option(metavar="UNITS", help="Of columns without a unit: 'mm', or 'mm,deg'."),
]
Rotation = Annotated[
    str | None,
    typer.Option(
        metavar="ORDER",
        help="How orientations are stated where headings do not say: ZYX or another order, each"
        " about the turned axis; xyz, about fixed axes; rotvec; wxyz or xyzw.",
    ),
]


InvertPoses = Annotated[
    bool,
    typer.Option(
        "--invert-poses",
        help="Poses are those of the base in the platform's frame: a camera on the platform saw a"
        " board on the base.",
    ),
]
ProbeOffset = Annotated[
    str | None,
    typer.Option(
        metavar="X,Y,Z",
        help="Of a column probe: the firmware's offsets of the probe from the nozzle, mm; by"
        " default those of the robot file.",
    ),
]


@dataclass(frozen=True)
class Reading:
    """The options of reading: what `pkmcal.read_measurements` takes beside file and robot."""

    controller: Path | None = None
    join: str = "auto"
    ignore: Sequence[str] | None = None
    rename: Sequence[str] | None = None
    columns: Path | None = None
    units: str | None = None
    rotation: str | None = None
    probe_offset: str | None = None
    invert_poses: bool = False
    camera: pk.readings.Camera | None = None

    def measurements(self, path: str | Path, read: Inputs, robot: Calibratable) -> Measurements:
        """The measurements of a file; what was assumed is printed to stderr, a line each."""
        if Path(path).suffix.lower() in (".toml", ".urdf"):
            raise FileError(f"{path}: a robot file, where measurements are needed")
        stated: dict[str, Any] = {} if self.columns is None else _stated(self.columns, read)
        stated["ignore"] = [*stated.get("ignore", ()), *(self.ignore or ())]
        stated["rename"] = stated.get("rename", {}) | dict(map(_renamed, self.rename or ()))
        if self.units is not None:
            stated["units"] = [unit.strip() for unit in self.units.split(",")]
        if self.rotation is not None:
            stated["rotation"] = self.rotation
        if self.invert_poses:
            stated["invert_poses"] = True
        if self.probe_offset is not None:
            stated["probe_offset"] = _offset(self.probe_offset)
        log = None if self.controller is None else read.file(self.controller)
        measured = pk.read_measurements(
            read.file(path), robot, controller=log, join=self.join, kind=self.camera, **stated
        )
        for note in measured.notes:
            say(f"pkmcal: {note}", err=True)
        return measured


def rows_to_drop(given: Sequence[str], measured: Sequence[Measurements]) -> list[int]:
    """Numbers, through all files, of the rows that ``--drop`` names.

    Raises
    ------
    ValueError
        No such row, file or line.
    """
    rows: list[int] = []
    for text in (part.strip() for each in given for part in each.split(",")):
        if text.isdecimal():
            rows.append(int(text))
            continue
        file, colon, line = text.rpartition(":")
        if not colon or not line.isdecimal():
            raise ArgumentError(f"--drop {text}: expected the number of a row, or FILE:LINE")
        first, found = 0, list[int]()
        for each in measured:
            if each.lines is not None and Path(each.file).name == Path(file).name:
                found += [first + int(i) for i in np.flatnonzero(each.lines == int(line))]
            first += len(each)
        if not found:
            raise ArgumentError(f"--drop {text}: no row was read from there")
        rows += found
    return rows


def without_lines(
    given: Sequence[str], held: Measurements, rest: Sequence[Measurements]
) -> tuple[list[str], Measurements]:
    """Take lines of the file that is held out out of it; what of ``--drop`` is left for the others.

    A file that is fitted, too, loses its lines there.
    """
    names = {Path(each.file).name for each in rest}
    others, lines = [], set[int]()
    for text in (part.strip() for each in given for part in each.split(",")):
        file, _, line = text.rpartition(":")
        own = Path(file).name == Path(held.file).name and Path(file).name not in names
        if own and line.isdecimal() and held.lines is not None and int(line) in held.lines:
            lines.add(int(line))
        else:
            others.append(text)
    if lines:
        assert held.lines is not None
        held = held.select(~np.isin(held.lines, list(lines)))
        shown = ", ".join(map(str, sorted(lines)))
        many = "lines" if len(lines) > 1 else "line"
        say(f"pkmcal: {held.file}: {many} {shown} left out of the hold-out, as asked", err=True)
    return others, held


def _offset(text: str) -> list[float]:
    try:
        numbers = [typed(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != 3:
        raise ArgumentError(f"--probe-offset {text}: expected X,Y,Z in mm")
    return numbers


def _renamed(text: str) -> tuple[str, str]:
    old, equals, new = text.partition("=")
    if not equals or not old.strip() or not new.strip():
        raise ArgumentError(f"--rename {text}: expected OLD=NEW, such as 'Lg=q1 [mm]'")
    return old.strip(), new.strip()


def _stated(path: Path, read: Inputs) -> dict[str, Any]:
    """What the file of ``--columns`` says.

    Raises
    ------
    ValueError
        No TOML, an unknown key, a value that is no text.
    """
    table = Table((source := Source(read.file(path).content(MOST_ROBOT), str(path))).data, source)
    table.only(_KEYS, "columns")
    found: dict[str, Any] = {
        key: table.texts(key) for key in ("header", "ignore", "units") if key in table
    }
    if "rename" in table:
        renamed = table.table("rename")
        found["rename"] = {old: renamed.text(old) for old in renamed.data}
    if "rotation" in table:
        found["rotation"] = table.text("rotation")
    if found.get("header") == []:
        raise FileError(f"{path}: header: names of the columns, in their order")
    return found
