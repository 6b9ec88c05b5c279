"""A measurement file as a table of known columns: what to ignore, rename, split and leave out."""

from __future__ import annotations

import difflib
import fnmatch
import itertools
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike

from pkmcal.arguments import did_you_mean
from pkmcal.arguments import words as as_words
from pkmcal.exceptions import ArgumentError
from pkmcal.files import units
from pkmcal.files.column_names import BESIDE, canonical
from pkmcal.files.csv_table import SHOWN, Table
from pkmcal.files.header import parted
from pkmcal.measurements.actuator_columns import actuators_in
from pkmcal.readings.rows import is_name

_SLIP = 0.8  # how like a known name a mistyped one is, as difflib counts
_LAST_NUMBER = re.compile(r"([0-9]{1,9})\D*$")
_OF_NUMBERS = re.compile(r"[+-]?[0-9.,]+")
_PARTING = r"[\s_\-.:/]+"
_FORMS = (
    re.compile(rf"(?P<first>.*?[0-9]+){_PARTING}(?P<last>\S.*)"),  # P01_SMR1
    re.compile(rf"(?P<first>.*[^\s_\-.:/]){_PARTING}(?P<last>\S*[0-9]+)"),  # SMR-A_P01
)
_TARGET = re.compile(r"smr|target|tgt|refl|marker|prism|nest|ball", re.IGNORECASE)
ORDERS = [  # of axes; capitals: each about the turned axis
    "".join(order)
    for letters in ("xyz", "XYZ")
    for order in itertools.product(letters, repeat=3)
    if order[0] != order[1] != order[2]
]
OWN_ORDER = "xyz"  # of alpha, beta, gamma
QUATERNIONS = ("wxyz", "xyzw")
ROTATIONS = (*QUATERNIONS, "rotvec")


@dataclass(frozen=True)
class Layout:
    """Layout of a file: what it does not say about its columns.

    Attributes
    ----------
    ignore : tuple of str
        Headings of columns to leave out, or wildcards.
    rename : mapping of str to str
        Headings here, by those of the file; with a unit in brackets where the file has none.
    header : tuple of str
        Headings of a file without a line of them.
    units : mapping of str to str
        Units of "mm" and "rad" for columns without one.
    """

    ignore: tuple[str, ...] = ()
    rename: Mapping[str, str] = field(default_factory=dict)
    header: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)


def layout(
    ignore: str | Sequence[str] = (),
    rename: Mapping[str, str] | None = None,
    header: Sequence[str] = (),
    default_units: str | Sequence[str] = (),
) -> Layout:
    """A layout from the arguments of `read_measurements`.

    Raises
    ------
    ValueError
        A word that is no unit, or two units of one quantity.
    """
    stated: dict[str, str] = {}
    for unit in as_words("units", default_units):
        quantity = units.quantity_of(unit)
        if quantity is None or quantity in stated:
            raise ArgumentError(
                f"units: one of lengths and one of angles, such as mm and deg; found {unit!r}"
            )
        stated[quantity] = unit
    return Layout(
        as_words("ignore", ignore), dict(rename or {}), as_words("header", header), stated
    )


def checked_rotation(rotation: str | None) -> str | None:
    """One of the words for how orientations are stated.

    Raises
    ------
    ValueError
        Another word.
    """
    if rotation is not None and rotation not in (*ORDERS, *ROTATIONS):
        raise ArgumentError(
            f"rotation must be an order of axes such as ZYX (each about the turned axis) or xyz"
            f" (about fixed axes), rotvec, wxyz or xyzw; found {rotation!r}"
        )
    return rotation


def open_table(
    path: str | PathLike[str],
    how: Layout,
    joints: Sequence[str] = (),
    also: Collection[str] = (),
    elsewhere: bool = False,
) -> Table:
    """The table of a file, its columns by the names they have here.

    Parameters
    ----------
    path : str or path
        The file.
    how : Layout
        What it does not say.
    joints : sequence of str
        Names of the machine's actuators.
    also : collection of str
        Headings of other files that `how` may name.
    elsewhere : bool
        Whether another file has the actuators: four numbered Q are then a quaternion.

    Raises
    ------
    ValueError
        Naming file and line: what `Table` refuses, two columns by one name, a heading that is to
        be renamed or ignored and is not there.
    """
    table = Table(path, how.header or None, how.units)
    for name in (*how.ignore, *how.rename):
        if not fnmatch.filter(table.columns, name) and name not in also:
            raise table.header_error(
                f"no column {name!r} to ignore or rename{did_you_mean(name, table.columns)}"
            )
    table.leave_out(
        [n for n in table.columns if any(fnmatch.fnmatchcase(n, i) for i in how.ignore)]
    )
    for old, new in how.rename.items():
        if old in table.columns:
            name, unit = parted(new)
            column = table.columns[old]
            table.columns[old] = replace(column, unit=unit or column.unit)
            if name in table.columns and name not in how.rename:  # else they are exchanged
                raise table.header_error(f"column {old!r} cannot be called {name!r}: it is another")
    renamed = {old: parted(new)[0] for old, new in how.rename.items()}
    headings = [renamed.get(name, name) for name in table.columns]
    names = canonical(headings, joints, elsewhere)
    table.rename(lambda name: names[renamed.get(name, name)])
    return table


def split(names: Sequence[str]) -> tuple[list[str], list[str]] | None:
    """Poses and targets of points named after both; None where names are not made so.

    The part with fewer different words is the target: it is seen in several poses.

    Examples
    --------
    >>> split(["P01_SMR1", "P01_SMR2", "P02_SMR1"])
    (['P01', 'P01', 'P02'], ['SMR1', 'SMR2', 'SMR1'])
    >>> split(["A-1", "A-2", "B-1", "B-2", "A-3"])
    (['1', '2', '1', '2', '3'], ['A', 'A', 'B', 'B', 'A'])
    >>> split(["P01", "P02"])
    """
    for form in _FORMS:
        matches = [form.fullmatch(name) for name in names]
        if not all(matches):
            continue
        first = [match["first"] for match in matches if match]
        last = [match["last"] for match in matches if match]
        poses, targets = first, last
        by_name = len(set(filter(_TARGET.search, first))), len(set(filter(_TARGET.search, last)))
        fewer = len(set(first)) - len(set(last))
        if fewer < 0 or (fewer == 0 and by_name[0] > by_name[1]):
            poses, targets = last, first
        if len(set(poses)) > 1 and len(set(targets)) < len(names):
            return poses, targets
    return None


def split_names(table: Table) -> None:
    """Points named after pose and target, such as P01_SMR1, become a group and a target."""
    for source in ("target", "name"):
        if source not in table.columns or (source == "name" and "target" in table.columns):
            continue
        cells = table.columns[source].cells
        parts = split(cells)
        if parts is None or not _agrees(table, parts[0], cells):
            continue
        poses, targets = parts
        if "group" in table.columns and not _is_text(table.columns["group"].cells):
            continue
        written = table.columns[source].name
        table.notes.append(
            f"{written!r} such as {cells[0]!r} taken as pose {poses[0]!r}, target {targets[0]!r}:"
            f" {len(set(poses))} poses, {len(set(targets))} targets"
        )
        place = _numbers_of(poses)
        table.put("group", table.written(source, [place[pose] for pose in poses]))
        table.put("target", table.written(source, targets))
        return


def number_groups(table: Table) -> None:
    """Groups that are names become the numbers in them; one group for all says nothing."""
    if "group" not in table.columns:
        return
    column = table.columns["group"]
    if not _is_text(column.cells):
        return
    if len(set(column.cells)) == 1 and len(table) > 1:
        table.notes.append(f"column {column.name!r} left out: all rows are {column.cells[0]!r}")
        table.leave_out(["group"])
        return
    if all(map(is_name, set(column.cells))):
        table.columns.setdefault("pose_name", replace(column, also=True))
    place = _numbers_of(column.cells)
    table.columns["group"] = replace(column, cells=tuple(place[name] for name in column.cells))


def _numbers_of(names: Sequence[str]) -> dict[str, str]:
    """A number for each name: the last one in it, or if two would have the same, their order."""
    distinct = list(dict.fromkeys(names))
    matches = [_LAST_NUMBER.search(name) for name in distinct]
    own = [str(int(match[1])) for match in matches if match]
    if len(set(own)) < len(distinct):
        own = [str(i) for i in range(len(distinct))]
    return dict(zip(distinct, own, strict=True))


def leave_out_unknown(table: Table, known: Collection[str], also: Collection[str] = ()) -> None:
    """Leave out columns that are not known, and say so; refuse what looks like a slip.

    Parameters
    ----------
    table : Table
        Its columns by their names here.
    known : collection of str
        Names that are read.
    also : collection of str
        Other words that a mistyped heading may have meant.

    Raises
    ------
    ValueError
        A heading that is nearly a known one.
    """
    table.leave_out([name for name in BESIDE if name not in known])
    unknown = [name for name in table.columns if name not in known]
    for name in unknown:
        written = table.columns[name].name
        near = difflib.get_close_matches(written.lower(), [*known, *also], n=1, cutoff=_SLIP)
        if near and near[0] != written.lower() and len(written) > 2:
            raise table.header_error(
                f"unknown column {written!r}; did you mean {near[0]!r}? Else ignore it, as with"
                f" --ignore {written!r}"
            )
    if unknown:
        named = [repr(table.columns[name].name) for name in unknown]
        more = f" and {len(named) - SHOWN} more" if len(named) > SHOWN else ""
        many = "s" if len(named) > 1 else ""
        table.notes.append(f"unknown column{many} left out: {', '.join(named[:SHOWN])}{more}")
        table.left_out = {table.columns[name].name: table.columns[name].unit for name in unknown}
        table.leave_out(unknown)


def _agrees(table: Table, poses: Sequence[str], names: Sequence[str]) -> bool:
    """Return whether poses belong to actuators, and names are of points, not of targets.

    Home that is measured again has another pose's name; a log that runs on has several rows a pose.
    """
    actuators = [table.columns[name].cells for name in actuators_in(table)]
    rows = list(zip(*actuators, strict=True)) if actuators else list(poses)
    of_row: dict[object, str] = {}
    of_pose: dict[str, object] = {}
    pairs = list(zip(rows, poses, strict=True))
    return len(set(names)) > len(names) / 3 and (
        all(of_row.setdefault(row, pose) == pose for row, pose in pairs)
        or all(of_pose.setdefault(pose, row) == row for row, pose in pairs)
    )


def _is_text(cells: Sequence[str]) -> bool:
    return all(cells) and not any(_OF_NUMBERS.fullmatch(cell) for cell in cells)
