"""Read measurements from CSV files: columns by name, in any order, with their units in brackets.

====================================  =============================================================
columns                               meaning
====================================  =============================================================
``q1 [mm]`` … ``qn [mm]``             actuator coordinates, lengths or angles
``x [mm], y [mm], z [mm]``            a position; with ``alpha``, ``beta``, ``gamma [deg]`` a pose
``z [mm]`` alone                      a height
``distance [mm]``                     from the fixed point ``target`` to the ``attachment``
``A.x [mm], A.y [mm], A.z [mm]`` …    positions of several targets A, B, … in one row
``sigma [mm]``                        standard deviation of the row, of every component
``sigma.x [mm]``, ``sigma.alpha``…    … or of each component
``cov.x.y [mm*mm]`` …                 … or their covariances, all on and above the diagonal
``actuator_sigma [mm]``               standard deviation of what every actuator read
``actuator_sigma.q1 [mm]`` …          … or of each of them
``group``                             a whole number, the same for repeats of one pose
``target``                            name of the target that the row measured
``target.x [mm]`` ``.y`` ``.z``       its place on the platform (the fixed point of a distance)
``attachment.x [mm]`` ``.y`` ``.z``   where on the platform a distance ends; its origin by default
====================================  =============================================================

An empty cell of what was measured says that it was not read there; without any measured column the
actuators are all that is known.

`pkmcal.files.column_names` matches headings, also as instruments and controllers write them:
capitals, ``Joint 1``, ``J1``, ``Axis 1``, ``Leg 1`` for q1, ``Height`` for z, ``Roll``, ``Pitch``,
``Yaw`` for alpha, beta, gamma, ``Std`` for sigma, ``Reflector`` or ``SMR`` for target, ``Pose`` for
group. ``Index``, ``Time``, ``Date`` and ``Comment`` are left out. ``Rx`` and the like are not
taken: makers differ in what they mean. Lengths are in mm, cm, m, um or in; angles in rad, mrad or
deg; covariances in products of mm and rad. `pkmcal.files.csv_table` says what separates the columns
and which lines are skipped.
"""

from __future__ import annotations

import itertools
import re
from os import PathLike
from typing import Any, Protocol

import numpy as np

from pkmcal import arguments
from pkmcal.arrays import FloatArray
from pkmcal.exceptions import ArgumentTypeError, FileError
from pkmcal.files.column_names import BESIDE, RESERVED, known_as
from pkmcal.files.csv_table import Table
from pkmcal.files.reading import LONGEST_NAME
from pkmcal.measurements.components import COMPONENTS, Kind
from pkmcal.measurements.measurements import Measurements

_AXES = ("x", "y", "z")
_ANGLES = ("alpha", "beta", "gamma")
_ACTUATOR = re.compile(r"q[1-9][0-9]*")
_OF_A_TARGET = re.compile(r"(?P<target>[^.]+)\.[xyz]")


class Actuated(Protocol):
    """A machine whose actuators have units: `Robot`, `SerialArm`."""

    @property
    def actuator_units(self) -> tuple[str, ...]:
        """Unit of each actuator, "mm" or "rad"."""


def read_measurements(path: str | PathLike[str], robot: Actuated | None = None) -> Measurements:
    r"""Read measurements from a CSV file; its module lists the columns.

    A row with several targets (``A.x``, ``B.x`` …) yields one measurement per target, in the order
    of the columns, with the same actuators: `target_index` says which, `target_names` the names.
    Where a target was not seen, its three cells are empty and the measurement is left out.

    Parameters
    ----------
    path : str or path
        The file.
    robot : Robot, optional
        The machine that was measured; its number of actuators and their units are compared.

    Returns
    -------
    Measurements
        In mm and rad.

    Raises
    ------
    ValueError
        Naming the file and, as far as there is one, line and column: what is missing, unknown,
        given twice, without unit or not a number.
    OSError
        The file cannot be read.

    Examples
    --------
    >>> import os, tempfile
    >>> path = os.path.join(tempfile.mkdtemp(), "probe.csv")
    >>> with open(path, "w") as file:
    ...     _ = file.write("q1 [deg],q2 [deg],z [um]\n90,-90,1500\n")
    >>> m = read_measurements(path)
    >>> m.kind, m.actuator_units, m.values
    ('height', ('rad', 'rad'), array([1.5]))
    """
    table = Table(path)
    table.rename(known_as)
    table.leave_out(BESIDE)
    several = _several_targets(table)
    values: FloatArray | None
    _refuse_unknown(table, several)
    actuators, units = _read_actuators(table)
    _compare(table, units, robot)
    kind = _kind(table, several)
    fields: dict[str, Any] = {"sigma": _read_sigma(table, kind), "lines": np.array(table.lines)}
    fields["actuator_sigma"] = _read_actuator_sigma(table, units)
    if "group" in table.columns:
        fields["group"] = table.integers("group")
    if several:
        actuators, values, fields = _read_several(table, several, actuators, fields)
    else:
        columns = [_read(table, *component, blank=True)[0] for component in COMPONENTS[kind]]
        values = np.stack(columns, axis=1) if columns else None
        if len(columns) == 1:
            values = columns[0]
        fields |= _read_targets(table, kind)
    try:
        return Measurements(
            actuators, values, kind, actuator_units=units, file=table.path.name, **fields
        )
    except ValueError as error:
        raise FileError(f"{table.path}: {error}") from None


def _several_targets(table: Table) -> tuple[str, ...]:
    """Names of the targets that have columns of their own, in the order of the columns."""
    matches = (_OF_A_TARGET.fullmatch(name) for name in table.columns)
    found = dict.fromkeys(match["target"] for match in matches if match)
    return tuple(name for name in found if name not in RESERVED)


def _refuse_unknown(table: Table, several: tuple[str, ...]) -> None:
    components = _AXES + _ANGLES
    names = [*(f"q{i + 1}" for i in range(len(table.columns))), *components, "distance"]
    names += ["sigma", "group", "target", "actuator_sigma"]
    names += [f"actuator_sigma.q{i + 1}" for i in range(len(table.columns))]
    names += [f"{point}.{axis}" for point in ("target", "attachment") for axis in _AXES]
    names += [f"{target}.{axis}" for target in several for axis in _AXES]
    deviations = [f"sigma.{name}" for name in components]
    pairs = itertools.combinations_with_replacement(components, 2)
    known = {*names, *deviations, *(f"cov.{a}.{b}" for a, b in pairs)}
    table.refuse_unknown(lambda name: name in known or bool(_ACTUATOR.fullmatch(name)), names)


def _read(table: Table, name: str, *quantities: str, blank: bool = False) -> tuple[Any, str]:
    table.require([name])
    return table.numbers(name, *quantities, blank=blank)


def _read_actuators(table: Table) -> tuple[FloatArray, tuple[str, ...]]:
    count = max((int(n[1:]) for n in table.columns if _ACTUATOR.fullmatch(n)), default=1)
    read = [_read(table, f"q{i + 1}", "mm", "rad") for i in range(count)]
    return np.stack([values for values, _ in read], axis=1), tuple(unit for _, unit in read)


def _compare(table: Table, units: tuple[str, ...], robot: Actuated | None) -> None:
    if robot is not None and not hasattr(robot, "actuator_units"):
        raise ArgumentTypeError(
            f"robot must be a Robot or SerialArm, found {arguments.shown(robot)}"
        )
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


def _kind(table: Table, several: tuple[str, ...]) -> Kind:
    """What was measured, by the columns that are there."""
    names = table.columns.keys()
    groups = {
        "distance": {"distance"} & names,
        "x, y, z": {*_AXES, *_ANGLES} & names,
        f"several targets ({', '.join(several)})": set(several),
    }
    there = [title for title, columns in groups.items() if columns]
    if len(there) > 1:
        raise table.header_error(f"more than one thing measured: {' and '.join(there)}")
    if not there:
        return "closure"
    if "distance" in names:
        return "distance"
    if several:
        return "position"
    if names.isdisjoint(("x", "y", *_ANGLES)):
        return "height"
    return "position" if names.isdisjoint(_ANGLES) else "pose"


def _read_sigma(table: Table, kind: Kind) -> FloatArray | None:
    """Deviations (rows, 1) or (rows, k), or covariances (rows, k, k)."""
    given = [name for name in table.columns if name.partition(".")[0] in ("sigma", "cov")]
    if not given:
        return None
    names, units = zip(*COMPONENTS[kind], strict=True)
    pairs = list(itertools.combinations_with_replacement(range(len(names)), 2))
    forms = {
        "one": ["sigma"],
        "each": [f"sigma.{name}" for name in names],
        "covariance": [f"cov.{names[i]}.{names[j]}" for i, j in pairs],
    }
    form = "covariance" if given[0].startswith("cov") else "each" if "." in given[0] else "one"
    if form == "one" and kind == "pose":
        raise table.header_error(
            f"column 'sigma' for poses: expected {forms['each'][0]!r} to {forms['each'][-1]!r}"
        )
    table.require(forms[form])
    for name in given:
        if name not in forms[form]:
            raise table.header_error(f"column {name!r} does not go with {given[0]!r} and {kind}s")
    if form == "covariance":
        sigma = np.empty((len(table), len(names), len(names)))
        for name, (i, j) in zip(forms[form], pairs, strict=True):
            sigma[:, i, j] = sigma[:, j, i] = table.numbers(name, f"{units[i]}*{units[j]}")[0]
        return sigma
    of = units if form == "each" else units[:1]
    columns = [table.numbers(n, unit)[0] for n, unit in zip(forms[form], of, strict=True)]
    for name, column in zip(forms[form], columns, strict=True):
        if not (column > 0).all():
            row = int(np.argmin(column > 0))
            raise table.cell_error(name, row, f"must be positive, found {column[row]:g}")
    return np.stack(columns, axis=1)


def _read_actuator_sigma(table: Table, units: tuple[str, ...]) -> FloatArray | None:
    """Deviations (rows, n) of what the actuators read."""
    each = [f"actuator_sigma.q{i + 1}" for i in range(len(units))]
    given = [name for name in table.columns if name.startswith("actuator_sigma")]
    if not given:
        return None
    if given == ["actuator_sigma"]:
        if len(set(units)) > 1:
            raise table.header_error(
                "column 'actuator_sigma' for lengths and angles: expected"
                f" {each[0]!r} to {each[-1]!r}"
            )
        columns = [table.numbers("actuator_sigma", units[0])[0]] * len(units)
    else:
        table.require(each)
        if len(given) > len(each):
            raise table.header_error("column 'actuator_sigma' does not go with those of actuators")
        columns = [table.numbers(name, unit)[0] for name, unit in zip(each, units, strict=True)]
    return np.stack(columns, axis=1)


def _read_several(
    table: Table, targets: tuple[str, ...], actuators: FloatArray, fields: dict[str, Any]
) -> tuple[FloatArray, FloatArray, dict[str, Any]]:
    """One measurement per row and target that was seen there, row by row."""
    for name in table.columns:
        if name.partition(".")[0] in ("target", "attachment"):
            raise table.header_error(f"column {name!r} does not go with '{targets[0]}.x'")
    values = np.empty((len(table), len(targets), 3))
    for t, target in enumerate(targets):
        names = [f"{target}.{axis}" for axis in _AXES]
        table.require(names)
        for axis, name in enumerate(names):
            values[:, t, axis] = table.numbers(name, "mm", blank=True)[0]
        part = np.isnan(values[:, t]).any(axis=1) & ~np.isnan(values[:, t]).all(axis=1)
        if part.any():
            row = int(np.argmax(part))
            name = names[int(np.argmax(np.isnan(values[row, t])))]
            raise table.cell_error(name, row, "found an empty cell beside ones with numbers")
    rows, index = np.nonzero(~np.isnan(values).any(axis=2))
    chosen = {name: None if value is None else value[rows] for name, value in fields.items()}
    chosen |= {"target_index": index, "target_names": targets}
    return actuators[rows], values[rows, index], chosen


def _read_targets(table: Table, kind: Kind) -> dict[str, Any]:
    """The target of each row, by name, by place or both."""
    points = {name: _read_point(table, name) for name in ("target", "attachment")}
    fields: dict[str, Any] = {name: place for name, place in points.items() if place is not None}
    named = "target" in table.columns
    if kind == "pose" and (named or "target" in fields):
        raise table.header_error("columns of a target do not go with poses")
    if kind == "distance" and "target" not in fields:
        raise table.header_error("missing column 'target.x': a distance is measured to a point")
    if kind != "distance" and "attachment" in fields:
        raise table.header_error(f"column 'attachment.x' goes with distances, not with {kind}s")
    if not named:
        return {name: _one(place) for name, place in fields.items()}
    names = table.texts("target")
    long = next((row for row, name in enumerate(names) if len(name) > LONGEST_NAME), None)
    if long is not None:
        message = f"a name has at most {LONGEST_NAME} characters, found {len(names[long])}"
        raise table.cell_error("target", long, message)
    places_of: dict[str, int] = {}
    index = np.array([places_of.setdefault(name, len(places_of)) for name in names])
    order = list(places_of)
    first = np.unique(index, return_index=True)[1].tolist()
    for name, places in fields.items():
        moved = (places != places[first][index]).any(axis=1)
        if moved.any():
            row = int(np.argmax(moved))
            line = table.lines[first[index[row]]]
            what = "place" if name == "target" else name
            raise table.cell_error(
                "target", row, f"{names[row]!r} has another {what} here than in line {line}"
            )
    chosen = {name: places[first] for name, places in fields.items()}
    if "attachment" in chosen:
        chosen["attachment"] = _one(chosen["attachment"])
    return chosen | {"target_index": index, "target_names": order}


def _read_point(table: Table, name: str) -> FloatArray | None:
    """A point of each row (rows, 3); None where it has no columns."""
    columns = [f"{name}.{axis}" for axis in _AXES]
    if not any(column in table.columns for column in columns):
        return None
    return np.stack([_read(table, column, "mm")[0] for column in columns], axis=1)


def _one(places: FloatArray) -> FloatArray:
    """One point (3,) where all rows have the same, to the last bit: 0.0 is not -0.0."""
    bits = places.view(np.int64)
    one: FloatArray = places[0] if (bits == bits[0]).all() else places
    return one
