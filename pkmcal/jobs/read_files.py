"""Files of measurements, read as a `Reading` says, and their rows by file and line."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, get_args

import numpy as np

from pkmcal.arguments import word
from pkmcal.exceptions import ArgumentError, FileError
from pkmcal.files.number_text import typed
from pkmcal.files.reading import MOST_ROBOT
from pkmcal.files.toml_lines import Source
from pkmcal.files.toml_table import Table
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.reading import Reading
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.measurements.measurement_csv import read_measurements
from pkmcal.measurements.measurements import Measurements
from pkmcal.readings.boards import Board
from pkmcal.readings.camera import Camera, Found, Mount

_KEYS = ("header", "ignore", "rename", "units", "rotation")


def read_file(
    path: str, robot: Calibratable, reading: Reading, inputs: Inputs, tell: Callable[[str], object]
) -> Measurements:
    """Read the measurements of a file; what was assumed is told, a line each."""
    if Path(path).suffix.lower() in (".toml", ".urdf"):
        raise FileError(f"{path}: a robot file, where measurements are needed")
    stated: dict[str, Any] = {} if reading.columns is None else _columns(reading.columns, inputs)
    stated["ignore"] = [*stated.get("ignore", ()), *reading.ignore]
    stated["rename"] = stated.get("rename", {}) | reading.names
    if reading.units is not None:
        stated["units"] = [unit.strip() for unit in reading.units.split(",")]
    if reading.rotation is not None:
        stated["rotation"] = reading.rotation
    if reading.invert_poses:
        stated["invert_poses"] = True
    if reading.probe_offset is not None:
        stated["probe_offset"] = _offset(reading.probe_offset)
    log = None if reading.controller is None else inputs.file(reading.controller)
    measured = read_measurements(
        inputs.file(path), robot, controller=log, join=reading.join, kind=camera(reading), **stated
    )
    for note in measured.notes:
        tell(note)
    return measured


def camera(reading: Reading) -> Camera | None:
    """The camera that is stated; None without a lens.

    Raises
    ------
    ValueError
        A word that is none, a board without a camera, a lens file that cannot be read.
    """
    chosen = word("--lens", reading.lens, get_args(Found))
    mount = word("--camera-on", reading.camera_on, get_args(Mount))
    if reading.camera is None:
        if reading.board is not None:
            raise ArgumentError("--board: it is what a camera sees; state its lens, --camera FILE")
        return None
    seen = None if reading.board is None else Board.parse(reading.board)
    return Camera.from_file(
        reading.camera, on=mount, board=seen, lens=chosen, find_size=reading.find_size
    )


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
    given: Sequence[str],
    held: Measurements,
    rest: Sequence[Measurements],
    tell: Callable[[str], object],
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
        tell(f"{held.file}: {many} {shown} left out of the hold-out, as asked")
    return others, held


def _offset(text: str) -> list[float]:
    try:
        numbers = [typed(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != 3:
        raise ArgumentError(f"--probe-offset {text}: expected X,Y,Z in mm")
    return numbers


def _columns(path: str, inputs: Inputs) -> dict[str, Any]:
    """Read the file of ``--columns``.

    Raises
    ------
    ValueError
        No TOML, an unknown key, a value that is no text.
    """
    table = Table((source := Source(inputs.file(path).content(MOST_ROBOT), path)).data, source)
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
