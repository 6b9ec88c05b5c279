"""Other readings of measurements: units, signs, columns, orders of angles that may be meant."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pkmcal.diagnostics.meant import Meant, Options, column, in_unit, renamed
from pkmcal.files.units import factors
from pkmcal.measurements.inverted import inverted
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.table_layout import ORDERS, OWN_ORDER
from pkmcal.readings.components import Family

_OWN = ("XYZ", "XZY", "YXZ", "YZX", "ZXY")  # other orders of an angle about x, y and z each
_REVERSED = "counts the other way"
_ANGLES = ("alpha", "beta", "gamma")
_LENGTHS = (  # what one is in mm
    ("metres", 1e3, "m"),
    ("centimetres", 10.0, "cm"),
    ("inches", 25.4, "in"),
    ("millimetres", 1.0, "mm"),
    ("micrometres", 1e-3, "um"),
)
_TURNS = (
    ("degrees", np.pi / 180, "deg"),
    ("milliradians", 1e-3, "mrad"),
    ("radians that were taken for degrees", 180 / np.pi, "rad"),
)


def _other_units(
    measured: Measurements, names: Sequence[str], unit: str
) -> Iterator[tuple[str, float, str]]:
    """Units that columns may have in truth: in words, what they multiply, as headings have them.

    Lengths were read in the unit that the heading of their file states.
    """
    if unit == "rad":
        yield from _TURNS
    if unit == "mm":
        columns = [column(measured, name) for name in names]
        units = {each.unit for each in columns if each is not None and each.unit is not None}
        by, over = factors("mm").get(units.pop(), (1.0, 1.0)) if len(units) == 1 else (1.0, 1.0)
        for words, size, short in _LENGTHS:
            if size != by / over:
                yield words, size * over / by, short


def other_readings(
    measured: Measurements, actuator_units: Sequence[str]
) -> Iterator[tuple[Meant, Measurements]]:
    """Read measurements in other units, with other signs and with columns exchanged."""
    for unit in dict.fromkeys(actuator_units):
        mine = np.array([unit == other for other in actuator_units])
        names = [f"q{i + 1}" for i in np.flatnonzero(mine)]
        for name, factor, short in _other_units(measured, names, unit):
            q = np.where(mine, measured.actuators * factor, measured.actuators)
            typed = in_unit(measured, names, short)
            yield Meant(f"the actuators are in {name}", typed), replace(measured, actuators=q)
    turned = replace(measured, actuators=-measured.actuators)
    yield Meant("the actuators count the other way"), turned
    yield from exchanges(measured)
    yield from other_values(measured)
    for i, unit in enumerate(actuator_units):
        trials = _other_units(measured, [f"q{i + 1}"], unit)
        for words, factor, short in (*trials, (_REVERSED, -1.0, "")):
            q = measured.actuators.copy()
            q[:, i] *= factor
            yield _of_column(measured, f"q{i + 1}", words, short), replace(measured, actuators=q)


def other_values(measured: Measurements) -> Iterator[tuple[Meant, Measurements]]:
    """Read what was measured in other units, orders and with other signs; actuators as given."""
    for unit in dict.fromkeys(measured.units):
        mine = np.array([unit == other for other in measured.units])
        what = Family(unit).noun.replace("lengths", "measured lengths")
        alike = [name for name, other in zip(measured.components, mine, strict=True) if other]
        for name, factor, short in _other_units(measured, alike, unit):
            values = measured.values * (factor if mine.all() else np.where(mine, factor, 1.0))
            typed = in_unit(measured, alike, short)
            yield Meant(f"the {what} are in {name}", typed), replace(measured, values=values)
    names = measured.components
    for one, other in itertools.combinations(range(len(names)), 2):
        if measured.units[one] != measured.units[other]:
            continue
        values = measured.values.copy()
        values[:, [one, other]] = values[:, [other, one]]
        yield _exchanged(measured, names[one], names[other]), replace(measured, values=values)
    yield from _other_turns(measured)
    yield from _single_columns(measured)


def _single_columns(measured: Measurements) -> Iterator[tuple[Meant, Measurements]]:
    """Read one column of what was measured in another unit, or with the other sign."""
    rows = measured.values.reshape(len(measured), -1)
    for k, (name, unit) in enumerate(zip(measured.components, measured.units, strict=True)):
        trials = _other_units(measured, [name], unit)
        for words, factor, short in (*trials, (_REVERSED, -1.0, "")):
            values = rows.copy()
            values[:, k] *= factor
            values = values.reshape(measured.values.shape)
            yield _of_column(measured, name, words, short), replace(measured, values=values)


def _of_column(measured: Measurements, name: str, words: str, short: str) -> Meant:
    if words == _REVERSED:
        return Meant(f"{name} {words}")
    return Meant(f"{name} is in {words}", in_unit(measured, [name], short))


def _exchanged(measured: Measurements, one: str, other: str) -> Meant:
    typed = renamed(measured, {one: other, other: one})
    return Meant(f"{one} and {other} are exchanged", typed)


def _ordered(measured: Measurements, order: str) -> Options | None:
    """Read three angles, one after the other, as those of an order."""
    own = renamed(measured, dict(zip(_ANGLES, "ABC", strict=True)))
    turned = own if own is not None else renamed(measured, {"rx": "Rx", "ry": "Ry", "rz": "Rz"})
    if turned is None:
        return None
    return (*(own or ()), ("--rotation", order))


def _other_turns(measured: Measurements) -> Iterator[tuple[Meant, Measurements]]:
    """Read orientations in other orders, from the other side, quaternions from the other end."""
    from scipy.spatial.transform import Rotation

    first = measured.instrument.turning
    if first is None or measured.values is None:
        return
    turned = measured.values[:, first : first + 3]
    good = np.isfinite(turned).all(axis=1)

    def of(turns: Any) -> Measurements:
        values = measured.values.copy()
        values[good, first : first + 3] = turns.as_euler(OWN_ORDER)
        return replace(measured, values=values)

    given = Rotation.from_euler(OWN_ORDER, turned[good])
    q = given.as_quat()  # x y z w
    for words, other in (
        ("the scalar of the quaternions is their last number", q[:, [3, 0, 1, 2]]),
        ("the scalar of the quaternions is their first number", q[:, [1, 2, 3, 0]]),
    ):
        yield Meant(words), of(Rotation.from_quat(other))
    for order in _OWN:
        angles = turned[good][:, ["XYZ".index(axis) for axis in order]]
        words = f"the angles are about turned axes in the order {order} (--rotation {order})"
        yield Meant(words, ()), of(Rotation.from_euler(order, angles))
    for order in sorted({*ORDERS} - {OWN_ORDER, "XYZ"}):
        typed = _ordered(measured, order)
        words = f"the angles are, one after the other, those of {order}"
        if typed is None:
            words += f" (columns A, B, C with --rotation {order})"
        yield Meant(words, typed), of(Rotation.from_euler(order, turned[good]))
    words = "are those of the base in the platform's frame"
    if first:
        yield Meant(f"orientations {words}"), of(given.inv())
    yield (
        Meant(f"{'poses' if first else 'orientations'} {words} (--invert-poses)", ()),
        inverted(measured),
    )


def exchanges(measured: Measurements) -> Iterator[tuple[Meant, Measurements]]:
    """Read measurements with two actuators exchanged."""
    columns = np.arange(measured.actuators.shape[1])
    for a, b in itertools.combinations(columns, 2):
        order = columns.copy()
        order[[a, b]] = b, a
        swapped = replace(measured, actuators=measured.actuators[:, order])
        yield _exchanged(measured, f"q{a + 1}", f"q{b + 1}"), swapped
