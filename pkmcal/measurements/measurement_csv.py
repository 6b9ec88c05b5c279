"""Read measurements from CSV files: columns by name, in any order, with their units in brackets.

====================================  =============================================================
columns                               meaning
====================================  =============================================================
``q1 [mm]`` … ``qn [mm]``             actuator coordinates, lengths or angles
``x [mm], y [mm], z [mm]``            a position; with ``alpha``, ``beta``, ``gamma [deg]`` a pose;
                                      of a machine in a plane across z, ``z`` may be missing
``z [mm]`` alone                      a height
``x [mm], y [mm], probe [mm]``        where a printer's probe triggered; or ``q1`` … and ``probe``
``distance [mm]``                     from the fixed point ``target`` to the ``attachment``
``alpha``, ``beta``, ``gamma [deg]``  an orientation, where there is no position
``to.q1``, ``run``, ``tilt1``,        distances between two places and relative ones, tilts, angles
``angle:…``, ``touch`` …              of joints, touches: `pkmcal.measurements.kind_columns`
``A.x [mm], A.y [mm], A.z [mm]`` …    positions of several targets A, B, … in one row
``sigma [mm]``                        standard deviation of the row, of every component
``sigma.x [mm]``, ``sigma.alpha``…    … or of each component
``cov.x.y [mm*mm]`` …                 … or their covariances, all on and above the diagonal
``actuator_sigma [mm]``               standard deviation of what every actuator read
``actuator_sigma.q1 [mm]`` …          … or of each of them
``group``                             a whole number, the same for repeats of one pose
``session``                           when the row was measured, by a name
``time``                              when, in seconds or as a time-stamp
``temperature [°C]``                  of the machine; or ``temperature.base``, ``.platform``,
                                      ``.q1`` …, of what that actuator drives
``approach.q1`` …                     1 or -1: the reading had grown or fallen; 0: not known
``tension.q1`` …                      of what the actuator drives, N, or one ``tension`` for all
``tension_sigma.q1`` …                standard deviation of what load cells read, N, or one for all
``target``                            name of the target that the row measured
``target.x [mm]`` ``.y`` ``.z``       its place on the platform (the fixed point of a distance)
``attachment.x [mm]`` ``.y`` ``.z``   where on the platform a distance ends; its origin by default
====================================  =============================================================

An empty cell of what was measured says that it was not read there; without any measured column the
actuators are all that is known.

A pose may also be stated by ``qw qx qy qz``, by a matrix ``r11`` … ``r33``, by ``Rx Ry Rz``, ``A B
C`` or ``W P R`` where the order of the angles is stated. ``group`` may hold names of poses, and a
point's name both, as in ``P01_SMR1``. `pkmcal.files.column_names` matches headings, as instruments
and controllers write them; `pkmcal.files.csv_table` says what separates the columns and which lines
are skipped. Lengths are in mm, cm, m, um or in; angles in rad, mrad, deg, arcmin, arcsec or rev;
covariances in products of mm and rad; actuators also in steps where the robot has a gain.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from os import PathLike
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from pkmcal import arguments
from pkmcal.arrays import FloatArray, TextArray
from pkmcal.exceptions import ArgumentTypeError, FileError
from pkmcal.files.column_names import SYNONYMS
from pkmcal.files.csv_table import Table
from pkmcal.kinematics.reading_units import Actuated
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.actuator_columns import (
    actuators_in,
    compare,
    read_actuators,
    read_of_actuators,
)
from pkmcal.measurements.calibratable import as_machine
from pkmcal.measurements.components import KINDS, Kind
from pkmcal.measurements.join import join as joined
from pkmcal.measurements.join import way_and_shift
from pkmcal.measurements.kind_columns import (
    component_names,
    kinds_in,
    names_of_kinds,
    read_kind_fields,
    value_columns,
)
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.orientation_columns import ANGLES, checked, names_in
from pkmcal.measurements.plane_columns import fill_in
from pkmcal.measurements.probe import (
    agreement,
    apart_from,
    is_of_a_flat,
    is_of_trigger,
    offset_of,
    probed,
)
from pkmcal.measurements.sigma_columns import read_actuator_sigma, read_sigma
from pkmcal.measurements.table_layout import (
    Layout,
    layout,
    leave_out_unknown,
    number_groups,
    open_table,
    split_names,
)
from pkmcal.measurements.target_columns import read_several, read_targets, several_targets
from pkmcal.measurements.temperature_columns import WHOLE, parts_of, read_temperature
from pkmcal.measurements.time_stamps import times_of

_AXES = ("x", "y", "z")
_TRIED = 200  # rows by which an order of angles is told


def read_measurements(
    path: str | PathLike[str],
    robot: Actuated | None = None,
    *,
    controller: str | PathLike[str] | None = None,
    join: str = "auto",
    ignore: str | Sequence[str] = (),
    rename: Mapping[str, str] | None = None,
    header: Sequence[str] = (),
    units: str | Sequence[str] = (),
    rotation: str | None = None,
    probe_offset: ArrayLike | None = None,
) -> Measurements:
    r"""Read measurements from a CSV file; its module lists the columns.

    A row with several targets (``A.x``, ``B.x`` …) yields one measurement per target, in the order
    of the columns, with the same actuators: `target_index` says which, `target_names` the names.
    Where a target was not seen, its three cells are empty and the measurement is left out.
    Unknown columns are left out. What was assumed is in `Measurements.notes`, a line each.

    Parameters
    ----------
    path : str or path
        The file.
    robot : Robot, optional
        The machine that was measured; its number of actuators and their units are compared. It
        tells orders of quaternions apart, and its gains say what a step is.
    controller : str or path, optional
        A log of the controller that has the actuators where the file has none.
    join : {"auto", "name", "row", "time", "row+1", "row-1", ...}
        How a row of the log is found: by the name of the point or of its pose, by the order of
        the rows, by time-stamp (the last row at or before it). By default the first that works of
        name, time and row.
    ignore : str or sequence of str
        Headings of columns to leave out, or wildcards.
    rename : mapping of str to str, optional
        Other headings for columns, ``{"Lg": "q1 [mm]"}``.
    header : sequence of str
        The headings of a file without a line of them.
    units : str or sequence of str
        Of columns without one: of lengths, of angles, or both, ``("mm", "deg")``.
    rotation : str, optional
        How orientations are stated where headings do not say: "ZYX" or another order of axes,
        each about the turned axis; "xyz", about fixed axes; "rotvec"; "wxyz" or "xyzw".
    probe_offset : (3,) array
        Of a column ``probe``: the firmware's offsets of the probe, mm, as in `probed`; by default
        those of the robot file.

    Returns
    -------
    Measurements
        In mm and rad.

    Raises
    ------
    ValueError
        Naming the file and, as far as there is one, line and column: what is missing, mistyped,
        given twice, without unit or not a number; tables that cannot be joined.
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
    if robot is not None and not hasattr(robot, "actuator_units"):
        raise ArgumentTypeError(
            f"robot must be a Robot or SerialArm, found {arguments.shown(robot)}"
        )
    how = layout(ignore, rename, header, units)
    joints: Sequence[str] = getattr(robot, "joint_names", None) or ()
    table = _table(path, controller, join, how, joints)
    split_names(table)
    number_groups(table)
    several = several_targets(table)
    times = times_of(table)
    leave_out_unknown(table, _known(table, several), SYNONYMS)
    if not table.columns.keys().isdisjoint(("probe", "contact")):
        return _read_probe(table, robot, probe_offset, times)
    actuators, actuator_units = read_actuators(table, robot)
    compare(table, actuator_units, robot)
    fill_in(table, robot, several)
    kind = _kind(table, several)
    fields: dict[str, Any] = {"sigma": read_sigma(table, kind), "lines": np.array(table.lines)}
    fields["actuator_sigma"] = read_actuator_sigma(table, actuator_units)
    fields |= read_kind_fields(table, kind, actuator_units, robot)
    if "group" in table.columns:
        fields["group"] = table.integers("group")
    fields["session"] = _read_session(table)
    fields["time"] = times
    fields["temperature"] = read_temperature(table, len(actuator_units))
    fields["approach"] = _read_approach(table, len(actuator_units))
    fields["tension"] = _read_tension(table, len(actuator_units))
    fields["tension_sigma"] = _read_tension_sigma(table, len(actuator_units))
    values: FloatArray | None
    if several:
        actuators, values, fields = read_several(table, several, actuators, fields)
    else:
        values = _read_values(table, kind, checked(rotation), actuators, robot)
        fields |= read_targets(table, kind)
    try:
        measured = Measurements(
            actuators,
            values,
            kind,
            actuator_units=actuator_units,
            notes=_notes(table),
            file=table.path.name,
            **fields,
        )
    except ValueError as error:
        raise FileError(f"{table.path}: {error}") from None
    if kind == "height" and isinstance(robot, Robot):
        if said := agreement(robot, measured, str(table.path)):
            table.notes.append(said)
        if is_of_a_flat(robot, measured):
            table.notes.append(
                "z taken as the measured height of the nozzle, up; what a firmware reported when"
                " its probe triggered has the opposite sign and is called probe"
            )
        measured = replace(measured, notes=_notes(table))
    return measured


def _notes(table: Table) -> tuple[str, ...]:
    return (*table.elsewhere, *(f"{table.path}: {note}" for note in table.notes))


def _read_probe(
    table: Table, robot: Actuated | None, offset: ArrayLike | None, times: FloatArray | None
) -> Measurements:
    """Heights of a probe's tip where it triggered: 0, on the bed."""
    what = "probe" if "probe" in table.columns else "contact"
    if not isinstance(robot, Robot):
        raise table.header_error(
            f"column {table.columns[what].name!r}: give the robot, as the firmware had it when"
            " it probed"
        )
    try:
        found = offset_of(robot, offset, "probe_offset")
    except ValueError as error:
        raise FileError(f"{table.path}: {error}") from None
    shown = ", ".join(f"{value:g}" for value in found)
    source = "the robot file" if offset is None else "--probe-offset"
    used = f"its offset is {shown} mm, of {source}"
    if what == "contact":
        table.notes.append(f"the firmware says where the nozzle would touch the bed; {used}")
        places = table.stacked(["x", "y", "contact"], ["mm", "mm", "mm"])
        return _probed(table, robot, places - found * [1.0, 1.0, -1.0], found, times)
    z = table.numbers("probe", "mm")[0]
    if actuators_in(table):
        actuators, units = read_actuators(table, robot)
        compare(table, units, robot)
        if not is_of_trigger(robot, actuators, z):
            row = int(np.argmax(apart_from(robot, actuators, z)))
            at = robot.forward(actuators[row]).pose[2]
            raise table.cell_error(
                "probe",
                row,
                f"the robot file gives z = {at:.4g} mm at the actuators of this row, found"
                f" {z[row]:.4g}: they have to be those at which the probe triggered",
            )
        poses = robot.forward(actuators).pose[:, :3]
    else:
        poses = np.column_stack([table.stacked(["x", "y"], ["mm", "mm"]), z])
    table.notes.append(
        f"{table.columns['probe'].name!r} taken as the firmware's z when the probe triggered: the"
        f" actuators are those that the robot file has there, and the probe's tip is at 0; {used}"
    )
    return _probed(table, robot, poses, found, times)


def _probed(
    table: Table, robot: Robot, points: FloatArray, offset: FloatArray, times: FloatArray | None
) -> Measurements:
    try:
        measured = probed(robot, points, offset=offset, sigma=read_sigma(table, "height"))
    except ValueError as error:
        raise FileError(f"{table.path}: {error}") from None
    return replace(
        measured,
        notes=_notes(table),
        lines=np.array(table.lines),
        file=table.path.name,
        session=_read_session(table),
        time=times,
        temperature=read_temperature(table, measured.actuators.shape[1]),
        approach=_read_approach(table, measured.actuators.shape[1]),
        tension=_read_tension(table, measured.actuators.shape[1]),
        tension_sigma=_read_tension_sigma(table, measured.actuators.shape[1]),
    )


def _table(
    path: str | PathLike[str],
    controller: str | PathLike[str] | None,
    join: str,
    columns: Layout,
    joints: Sequence[str],
) -> Table:
    """The table of a file, with the actuators of a controller's log."""
    way, shift = way_and_shift(join)
    if controller is None:
        return open_table(path, columns, joints)
    log_columns = replace(columns, header=())
    seen = (*columns.ignore, *columns.rename)
    table = open_table(path, columns, joints, seen, elsewhere=True)
    log = open_table(controller, log_columns, joints, seen)
    if actuators_in(table):
        table.notes.append(f"has actuators of its own; {log.path} is not used")
        return table
    for name in seen:
        if not any(_has(each, name) for each in (table, log)) and name not in columns.ignore:
            raise table.header_error(f"no column {name!r} to rename, nor in {log.path}")
    joined(table, log, way, shift)
    return table


def _has(table: Table, name: str) -> bool:
    return any(column.name == name for column in table.columns.values())


def _known(table: Table, several: tuple[str, ...]) -> set[str]:
    """Names of columns that are read."""
    components = _AXES + ANGLES
    actuators = {f"q{i + 1}" for i in range(len(table.columns))} | {*actuators_in(table)}
    names = actuators | {
        *components,
        "distance",
        "sigma",
        "group",
        "session",
        "target",
        "probe",
        "contact",
    }
    names |= {"actuator_sigma", "approach", "tension", "tension_sigma", *parts_of(0), WHOLE}
    whats = ("actuator_sigma", "approach", "tension", "tension_sigma", WHOLE)
    names |= {f"{what}.{q}" for what in whats for q in actuators}
    names |= {f"{point}.{axis}" for point in ("target", "attachment") for axis in _AXES}
    names |= {f"{target}.{axis}" for target in several for axis in _AXES}
    names |= {f"sigma.{name}" for name in component_names()} | names_of_kinds(table)
    pairs = itertools.product(component_names(), repeat=2)
    return names | {f"cov.{a}.{b}" for a, b in pairs} | set(names_in(table))


def _kind(table: Table, several: tuple[str, ...]) -> Kind:
    """What was measured, by the columns that are there."""
    names = table.columns.keys()
    turned = set(names_in(table)) | (set(ANGLES) & names)
    own = kinds_in(table)
    groups = {
        **{title: {title} for title in own},
        "x, y, z": ({*_AXES} & names) | turned,
        f"several targets ({', '.join(several)})": set(several),
    }
    there = [title for title, columns in groups.items() if columns]
    if len(there) > 1:
        raise table.header_error(f"more than one thing measured: {' and '.join(there)}")
    if not there:
        return "closure"
    if own:
        return next(iter(own.values()))
    if several:
        return "position"
    if turned and names.isdisjoint(_AXES):
        return "orientation"
    if names.isdisjoint(("x", "y", *turned)):
        return "height"
    return "pose" if turned else "position"


def _read_values(
    table: Table,
    kind: Kind,
    rotation: str | None,
    actuators: FloatArray,
    robot: Actuated | None,
) -> FloatArray | None:
    """What was measured, (N, k) or (N,); None without columns of it."""
    if KINDS[kind].turning is not None and names_in(table) not in ((), ANGLES):
        places = [table.numbers(axis, "mm")[0] for axis in _AXES] if kind == "pose" else []
        nominal = _nominal(robot, actuators)
        from pkmcal.measurements import orientation_forms  # imports SciPy

        return np.column_stack([*places, orientation_forms.read(table, rotation, nominal)])
    columns = [table.numbers(*component, blank=True)[0] for component in value_columns(table, kind)]
    if not columns:
        return None
    return columns[0] if len(columns) == 1 else np.stack(columns, axis=1)


def _nominal(robot: Actuated | None, actuators: FloatArray) -> FloatArray | None:
    """Angles (N, 3) of the machine as described, of some rows; NaN for the others."""
    if robot is None:
        return None
    machine = as_machine(cast(Robot, robot))
    if machine.n_actuators != actuators.shape[1]:
        return None
    angles = np.full((len(actuators), 3), np.nan)
    some = np.unique(np.linspace(0, len(actuators) - 1, _TRIED).astype(int))
    angles[some] = machine.forward(actuators[some]).pose[:, 3:]
    return angles


def _read_approach(table: Table, count: int) -> FloatArray | None:
    """From where each actuator came (rows, n)."""
    return read_of_actuators(table, "approach", count, table.integers)


def _read_tension(table: Table, count: int) -> FloatArray | None:
    """Tension of what each actuator drives (rows, n), N."""
    return read_of_actuators(
        table, "tension", count, lambda name: table.numbers(name, "N", blank=True)[0]
    )


def _read_tension_sigma(table: Table, count: int) -> FloatArray | None:
    """Standard deviation of that (rows, n), N."""
    return read_of_actuators(
        table, "tension_sigma", count, lambda name: table.numbers(name, "N")[0]
    )


def _read_session(table: Table) -> TextArray | None:
    return np.array(table.texts("session")) if "session" in table.columns else None
