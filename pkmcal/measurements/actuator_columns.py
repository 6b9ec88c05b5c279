"""Columns q1, q2 … of a table: the actuators of the machine, as lengths, angles or steps."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.files.csv_table import Table
from pkmcal.kinematics.reading_units import Actuated, gain_of

_WITHOUT = (
    "; the actuators at each row are needed: of a log of the controller with --controller LOG; of"
    " where a printer's probe triggered, column probe beside x and y"
)
_QUANTITIES: dict[str | None, tuple[str, ...]] = {  # the one that is meant where two have a unit
    "mm": ("mm", "count", "rad"),
    "rad": ("rad", "mm", "count"),
    None: ("mm", "rad", "count"),
}
_ACTUATOR = re.compile(r"q[1-9][0-9]*")


def actuators_in(table: Table) -> list[str]:
    """The columns of actuators, as they stand."""
    return [name for name in table.columns if _ACTUATOR.fullmatch(name)]


def columns_of_actuators(table: Table, what: str, count: int) -> list[str]:
    """The columns that state something of the actuators: one for all, or one of each; or none."""
    given = [name for name in table.columns if name == what or name.startswith(f"{what}.")]
    if not given or given == [what]:
        return given
    each = [f"{what}.q{i + 1}" for i in range(count)]
    table.require(each)
    if what in given:
        raise table.header_error(f"column {what!r} does not go with those of actuators")
    more = [name for name in given if name not in each]
    if more:
        raise table.header_error(f"column {more[0]!r} goes with no actuator: the last is q{count}")
    return each


def read_of_actuators(
    table: Table, what: str, count: int, read: Callable[[str], IntArray | FloatArray]
) -> FloatArray | None:
    """Columns of each actuator or one for all, (rows, n); None without any."""
    names = columns_of_actuators(table, what, count)
    if not names:
        return None
    columns = np.stack([read(name) for name in names], axis=1).astype(np.float64)
    return np.broadcast_to(columns, (len(table), count))


def read_actuators(table: Table, robot: Actuated | None) -> tuple[FloatArray, tuple[str, ...]]:
    """Actuator coordinates (N, n), and the unit of each, "mm" or "rad"."""
    count = max((int(name[1:]) for name in actuators_in(table)), default=0)
    if not count:
        raise table.missing("q1", _WITHOUT)
    expected = () if robot is None else tuple(robot.actuator_units)
    columns, units = [], []
    for i in range(count):
        of_robot = expected[i] if i < len(expected) else None
        values, unit = _read(table, f"q{i + 1}", i, of_robot, robot)
        columns.append(values)
        units.append(unit)
    return np.stack(columns, axis=1), tuple(units)


def _read(
    table: Table, name: str, i: int, expected: str | None, robot: Actuated | None
) -> tuple[FloatArray, str]:
    """A column of actuator i, counted from 0, and its unit."""
    values, unit = table.numbers(name, *_QUANTITIES[expected], expected=expected)
    return values, _counted(table, name, i, expected, robot) if unit == "count" else unit


def _counted(table: Table, name: str, i: int, of_robot: str | None, robot: Actuated | None) -> str:
    """The unit of an actuator that counts steps: its limb's gain says how much one is."""
    column = table.columns[name]
    if of_robot is None:
        raise table.header_error(
            f"column {column.name!r} has unit [{column.unit}]: give the robot, whose gain says"
            " how much one is"
        )
    gain, winds = (None, False) if robot is None else gain_of(robot, i)
    if gain is None or abs(gain) == 1.0:
        raise table.header_error(
            f"column {column.name!r} has unit [{column.unit}], and the robot does not state how"
            f" much one is: set the gain of the limb, in {of_robot} each"
        )
    turns = "rad of the spool" if winds else of_robot
    note = f"actuators in {column.unit}, converted by the robot's gain ({gain:.6g} {turns} each)"
    if column.unit != "counts" and note not in table.notes:  # as pkmcal itself writes them
        table.notes.append(note)
    return of_robot


def compare(table: Table, units: tuple[str, ...], robot: Actuated | None) -> None:
    """Raise where the robot has other actuators: as many, each with its unit."""
    expected = units if robot is None else tuple(robot.actuator_units)
    if len(expected) != len(units):
        raise table.header_error(
            f"{len(units)} actuator columns, q1 to q{len(units)}; the robot has {len(expected)}"
        )
    for i, (unit, robots) in enumerate(zip(units, expected, strict=True)):
        if unit != robots:
            what = {"mm": "a length", "rad": "an angle"}
            raise table.header_error(
                f"column 'q{i + 1}' is {what[unit]}; the robot's actuator is {what[robots]}"
            )
