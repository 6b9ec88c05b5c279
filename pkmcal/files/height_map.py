"""The height map of RepRapFirmware, heightmap.csv, as points of the bed.

A line says what it is, one names its numbers, one states the grid, and then each line has a row of
it, along the first axis. An entry is the height error there: where the nozzle would touch the bed,
with the trigger height and the offsets of the probe taken in. What was not probed is a bare 0.
"""

from __future__ import annotations

from pathlib import Path

from pkmcal.exceptions import FileError

TITLE = "RepRapFirmware height map file"
_ROUNDED = 0.006  # mm: of a spacing that is written with two decimals
_ABOVE = 3  # lines

Row = tuple[int, list[str]]


def is_height_map(text: str) -> bool:
    """Return whether a text begins as one does."""
    return text.lstrip().startswith(TITLE)


def bed_points(path: Path, lines: list[tuple[int, str]]) -> list[Row]:
    """Cells x, y and height of each point that was probed, with the number of its line.

    Raises
    ------
    ValueError
        The grid is not stated, is not of x and y, or has other rows than it says.
    """
    rows = [(number, [cell.strip() for cell in line.split(",")]) for number, line in lines]
    if len(rows) < _ABOVE:
        raise FileError(f"{path}: the height map ends before its grid is stated")
    (at, names), (_, cells) = rows[1], rows[2]
    stated = dict(zip(names, cells, strict=False))
    if (axes := stated.get("axis0", "X") + stated.get("axis1", "Y")) != "XY":
        raise FileError(f"{path}, line {at}: a height map of the axes {axes}, not of X and Y")
    try:
        x, y = (_axis(stated, axis, number) for axis, number in (("x", 0), ("y", 1)))
    except (ValueError, OverflowError):
        raise FileError(
            f"{path}, line {at}: this line and the next state no grid of a height map"
        ) from None
    grid = rows[_ABOVE:]
    if [len(row) for _, row in grid] != [len(x)] * len(y):
        raise FileError(
            f"{path}: the grid should have {len(y)} rows of {len(x)} points below line {at + 1}"
        )
    return [
        (number, [f"{across!r}", f"{along!r}", cell])
        for (number, row), along in zip(grid, y, strict=True)
        for across, cell in zip(x, row, strict=True)
        if cell != "0"
    ]


def _axis(stated: dict[str, str], axis: str, number: int) -> list[float]:
    """The places along an axis, by the names of newer files, `min0`, or of older ones, `xmin`."""

    def cell(name: str) -> str:
        known = (f"{name}{number}", f"{axis}{name}")
        return next((stated[each] for each in known if each in stated), stated.get(name, ""))

    first, last, n = float(cell("min")), float(cell("max")), int(cell("num"))
    spacing = float(cell("spacing"))  # the oldest files have one for both
    if n > 1 and abs((last - first) / (n - 1) - spacing) < _ROUNDED:
        spacing = (last - first) / (n - 1)
    return [first + i * spacing for i in range(n)]
