"""Files of measurements, read as a `Reading` says, and their rows by file and line."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, get_args

import numpy as np

from pkmcal.arguments import word
from pkmcal.exceptions import ArgumentError, FileError
from pkmcal.files.number_text import typed
from pkmcal.files.reading import MOST_ROBOT
from pkmcal.files.toml_lines import Source
from pkmcal.files.toml_table import Table
from pkmcal.jobs.cameras import cameras, with_rows
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.reading import Reading, named
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.measurements.measurement_csv import read_measurements
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.pnp import from_pnp
from pkmcal.measurements.table_layout import layout, open_table
from pkmcal.readings.camera import Camera, Mount

COLUMNS = ("header", "ignore", "rename", "units", "rotation")  # keys of a file of --columns
_DIGITS = 19  # that no number of a row has


def read_files(
    path: str, robot: Calibratable, reading: Reading, inputs: Inputs, tell: Callable[[str], object]
) -> list[Measurements]:
    """Read the measurements of a file: of several cameras or boards those of each that it has.

    What was assumed is told, a line each.
    """
    used = cameras(reading)
    if any(each.camera_name or each.board_name for each in used):
        _require_table(path)
        how = _how(reading, inputs)
        columns = layout(*(how.get(key, ()) for key in ("ignore", "rename", "header", "units")))
        table = open_table(inputs.file(path), columns, also=(*columns.ignore, *columns.rename))
        used = with_rows(used, table)
    if not used:
        return [read_file(path, robot, reading, inputs, tell)]
    return [read_file(path, robot, reading, inputs, tell, each) for each in used]


def read_file(
    path: str,
    robot: Calibratable,
    reading: Reading,
    inputs: Inputs,
    tell: Callable[[str], object],
    camera: Camera | None = None,
) -> Measurements:
    """Read the measurements of a file; what was assumed is told, a line each."""
    _require_table(path)
    stated = _how(reading, inputs)
    if reading.rotation is not None:
        stated["rotation"] = reading.rotation
    if reading.invert_poses:
        stated["invert_poses"] = True
    pnp = None if reading.from_pnp is None else read_pnp(reading.from_pnp)
    mount = word("--camera-on", reading.camera_on, get_args(Mount))
    if pnp is not None:
        stated["on"] = mount
    if reading.probe_offset is not None:
        stated["probe_offset"] = _offset(reading.probe_offset)
    log = None if reading.controller is None else inputs.file(reading.controller)
    measured = read_measurements(
        inputs.file(path), robot, controller=log, join=reading.join, kind=camera, **stated
    )
    for note in measured.notes:
        tell(note)
    if reading.units and all(each.unit_from != "options" for each in measured.understood):
        tell(f"{path}: --units {reading.units} has no effect: every column that is read has a unit")
    if pnp is None:
        return measured
    try:
        return from_pnp(
            measured, pnp.focal, pnp.board, on=mount, noise=pnp.noise or 1.0, corners=pnp.corners
        )
    except ArgumentError as error:
        raise ArgumentError(f"--from-pnp: {path}: {error}") from None


def _require_table(path: str) -> None:
    if Path(path).suffix.lower() in (".toml", ".urdf"):
        raise FileError(f"{path}: a robot file, where measurements are needed")


def _how(reading: Reading, inputs: Inputs) -> dict[str, Any]:
    """Arguments of `read_measurements` that say what columns are."""
    stated: dict[str, Any] = {} if reading.columns is None else _columns(reading.columns, inputs)
    stated["ignore"] = [*stated.get("ignore", ()), *reading.ignore]
    stated["rename"] = stated.get("rename", {}) | reading.names
    if reading.units is not None:
        stated["units"] = [unit.strip() for unit in reading.units.split(",")]
    return stated


class Pnp(NamedTuple):
    """The statement of ``--from-pnp``.

    Attributes
    ----------
    focal : float
        Focal length, px.
    board : tuple of float
        Width and height, mm; then x and y of its middle, where they are stated.
    noise : float or None
        Of corners, px; None: to be estimated.
    corners : int or None
        How many the board has; None: nobody says.
    """

    focal: float
    board: tuple[float, ...]
    noise: float | None
    corners: int | None


def read_pnp(text: str) -> Pnp:
    """Read ``f=640,board=160x120[,middle=80x60][,corners=35][,noise=0.3]``.

    Raises
    ------
    ValueError
        Anything else.
    """
    expected = ArgumentError(
        f"--from-pnp {text}: expected f=FOCAL,board=WIDTHxHEIGHT[,middle=XxY][,corners=N]"
        "[,noise=PX], as f=640,board=160x120,middle=80x60: px and mm"
    )
    parts = dict(map(named, text.split(",")))
    if not {"f", "board"} <= parts.keys() <= {"f", "board", "middle", "corners", "noise"}:
        raise expected
    try:
        width, height = map(typed, parts["board"].lower().split("x"))
        middle = [*map(typed, parts["middle"].lower().split("x"))] if "middle" in parts else []
        focal, noise = typed(parts["f"]), typed(parts["noise"]) if "noise" in parts else None
        corners = int(parts["corners"]) if "corners" in parts else None
    except ValueError:
        raise expected from None
    if len(middle) not in (0, 2):
        raise expected
    if not min(width, height, focal, 1.0 if noise is None else noise) > 0.0:
        raise ArgumentError(f"--from-pnp {text}: focal length, size and noise must be above 0")
    return Pnp(focal, (width, height, *middle), noise, corners)


def rows_to_drop(given: Sequence[str], measured: Sequence[Measurements]) -> list[int]:
    """Numbers, through all files, of the rows that ``--drop`` names.

    Raises
    ------
    ValueError
        No such row, file or line.
    """
    rows: list[int] = []
    for text in (part.strip() for each in given for part in each.split(",")):
        if _is_count(text):
            rows.append(int(text))
            continue
        file, colon, line = text.rpartition(":")
        if not colon or not _is_count(line):
            raise ArgumentError(f"--drop {text:.80}: expected the number of a row, or FILE:LINE")
        first, found = 0, list[int]()
        for each in measured:
            if each.lines is not None and Path(each.file).name == Path(file).name:
                found += [first + int(i) for i in np.flatnonzero(each.lines == int(line))]
            first += len(each)
        if not found:
            raise ArgumentError(f"--drop {text}: no row was read from there")
        rows += found
    return rows


def _is_count(text: str) -> bool:
    return text.isdecimal() and len(text) < _DIGITS


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
        if own and _is_count(line) and held.lines is not None and int(line) in held.lines:
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
    table.only(COLUMNS, "columns")
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
