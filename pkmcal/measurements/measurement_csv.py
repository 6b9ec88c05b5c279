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
``KIND.FIELD``                        what an instrument of a class of your own has for all rows
``beside.NAME``                       numbers of the rows for readings and effects of your own
``group``                             a whole number, the same for repeats of one pose
``session``                           when the row was measured, by a name
``time``                              when, in seconds or as a time-stamp
``temperature [°C]``                  of the machine; or ``temperature.base``, ``.platform``,
                                      ``.q1`` …, of what that actuator drives
``approach.q1`` …                     1 or -1: the reading had grown or fallen; 0: not known
``tension.q1`` …                      of what the actuator drives, N, or one ``tension`` for all
``payload [kg]``                      what the platform carried; its centre in the frame of the tool
                                      ``payload.x [mm]`` ``.y`` ``.z``, 0 without
``force.x [N]``, ``moment.x [N mm]``  what pulled at the tool, with ``.y`` and ``.z``
``tension_sigma.q1`` …                standard deviation of what load cells read, N, or one for all
``target``                            name of the target that the row measured
``target.x [mm]`` ``.y`` ``.z``       its place on the platform (the fixed point of a distance)
``attachment.x [mm]`` ``.y`` ``.z``   where on the platform a distance ends; its origin by default
====================================  =============================================================

============================  =====================================================================
columns of single kinds       meaning
============================  =====================================================================
``to.q1 [mm]`` …              of a ``distance``: between where ``q1`` … and where these lead
``run``                       of a ``distance``: it counts from a zero of this run
``tilt1 [deg], tilt2``        how far x and y of a sensor point up
``angle:limb1.joint2 [deg]``  the angle of a passive joint
``touch``                     the name of the point that is touched; ``touch:line``, ``touch:plane``
                              and ``touch:sphere`` where it is another artefact
``touch.to`` …                known distances: `pkmcal.readings.known_distances`
============================  =====================================================================

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

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from os import PathLike
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from pkmcal import arguments
from pkmcal.arrays import FloatArray
from pkmcal.exceptions import ArgumentTypeError, FileError
from pkmcal.files.column_names import ANGLES, SYNONYMS, orientation_in
from pkmcal.files.csv_table import Table
from pkmcal.kinematics.calibratable import as_machine
from pkmcal.kinematics.reading_units import Actuated
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.actuator_columns import actuators_in, compare, read_actuators
from pkmcal.measurements.inverted import inverted, turned_round
from pkmcal.measurements.join import join as joined
from pkmcal.measurements.join import rows_after, way_and_shift
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.plane_columns import fill_in
from pkmcal.measurements.probe import (
    agreement,
    is_of_a_flat,
)
from pkmcal.measurements.probe_table import read_probe
from pkmcal.measurements.table_fields import FIELDS, notes_of, read_fields
from pkmcal.measurements.table_layout import (
    OWN_ORDER,
    Layout,
    checked_rotation,
    layout,
    leave_out_unknown,
    number_groups,
    open_table,
    split_names,
)
from pkmcal.measurements.targets import read_several, read_targets, several_targets
from pkmcal.readings.closure import Closure
from pkmcal.readings.constants import headings_of_constants, with_constants
from pkmcal.readings.points import Position
from pkmcal.readings.reading import Reading
from pkmcal.readings.registry import KINDS

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
    invert_poses: bool = False,
    on: str = "base",
    probe_offset: ArrayLike | None = None,
    kind: Reading | None = None,
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
        name, time and row. With "row+1" also of a file that has its own actuators: those of each
        row are the ones that stand a row after it.
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
        each about the turned axis; "xyz", about fixed axes; "rotvec"; "wxyz" or "xyzw". Angles of
        columns alpha, beta, gamma are "xyz" unless another order is stated.
    invert_poses : bool
        Poses, or orientations, are those of the base in the platform's frame, as a camera on the
        platform sees a board on the base: they are turned round, a stated sigma with them.
    on : {"base", "platform"}
        Of poses for `from_pnp`: what the camera is fixed to that saw the board. Those of a camera
        on the platform are of the board in its axes, and stay so; where they are those of the
        camera in axes of the board, `invert_poses` turns them round.
    probe_offset : (3,) array
        Of a column ``probe``: the firmware's offsets of the probe, mm, as in `probed`; by default
        those of the robot file.
    kind : Reading, optional
        A reading of your own that the file may hold.

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
    from_platform = arguments.word("on", on, ("base", "platform")) == "platform"
    how = layout(ignore, rename, header, units)
    joints: Sequence[str] = getattr(robot, "actuator_names", None) or ()
    table = _table(path, controller, join, how, joints)
    split_names(table)
    number_groups(table)
    if kind is not None:
        arguments.instance("kind", kind, Reading, ", an object of a class of your own")
        if (own := kind.rows_of(table)) is not None:
            table.take(own.tolist())
    readings = [*KINDS.values(), *(() if kind is None else (kind,))]
    points = {name for each in readings for name in each.own_points}
    several = several_targets(table, points)
    leave_out_unknown(table, _known(table, several, readings, points), SYNONYMS)
    if not table.columns.keys().isdisjoint(("probe", "contact")):
        return read_probe(table, robot, probe_offset)
    if probe_offset is not None:
        table.note("the offset of the probe counts where a column is called probe, and not here")
    actuators, units = read_actuators(table, robot)
    compare(table, units, robot)
    fill_in(table, robot, several)
    read = with_constants(_reading(table, several, readings, kind), table).read(table, units)
    fields = read_fields(table, read, units)
    values: FloatArray | None
    if several:
        actuators, values, fields = read_several(table, several, actuators, fields, points)
    else:
        nominal = partial(_nominal, robot, actuators, invert_poses is not from_platform)
        values = _read_values(table, read, checked_rotation(rotation), nominal, invert_poses)
        read, targets = read_targets(table, read, readings)
        fields |= targets
    try:
        measured = Measurements(
            actuators,
            values,
            read,
            actuator_units=units,
            notes=notes_of(table),
            understood=table.understood(),
            file=table.path.name,
            **fields,
        )
        if invert_poses:
            measured = inverted(measured)
    except ValueError as error:
        raise FileError(f"{table.path}: {error}") from None
    if read.by_firmware and isinstance(robot, Robot):
        if said := agreement(robot, measured, str(table.path)):
            table.notes.append(said)
        if is_of_a_flat(robot, measured):
            table.notes.append(
                "z taken as the measured height of the nozzle, up; what a firmware reported when"
                " its probe triggered has the opposite sign and is called probe"
            )
        measured = replace(measured, notes=notes_of(table))
    return measured


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
        table = open_table(path, columns, joints)
        if shift:
            rows_after(table, shift)
        return table
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
    joined(table, log, way, shift, FIELDS)
    return table


def _has(table: Table, name: str) -> bool:
    return any(column.name == name for column in table.columns.values())


def _known(
    table: Table, several: tuple[str, ...], readings: Sequence[Reading], points: set[str]
) -> set[str]:
    """Names of columns that are read."""
    actuators = {f"q{i + 1}" for i in range(len(table.columns))} | {*actuators_in(table)}
    components = {name for each in readings for name, _ in each.components}
    names = {*actuators, "probe", "contact", *ANGLES, *orientation_in(table.columns)}
    names |= {f"{point}.{axis}" for point in (*points, *several) for axis in _AXES}
    for reading in readings:
        names |= {*reading.names(table)} | headings_of_constants(reading)
    for field in FIELDS:
        names |= field.names(actuators, components)
    named = {field.name for field in FIELDS if field.named}
    return names | {name for name in table.columns if name.partition(".")[0] in named}


def _reading(
    table: Table, several: tuple[str, ...], readings: Sequence[Reading], own: Reading | None
) -> Reading:
    """Read the measured quantity, by the columns that are there; `own` has its columns first."""
    found: dict[str, Reading] = {}
    if own is not None and (titles := own.found_in(table)):
        found = dict.fromkeys(titles, own)
        table = table.without(own.names(table))
        readings = [each for each in readings if type(each) is not type(own)]
    for each in readings:
        for title in each.found_in(table):
            if title in found:
                raise table.header_error(f"{title}: {found[title].noun()} or {each.noun()}?")
            found[title] = each
    if several:
        found[f"several targets ({', '.join(several)})"] = Position()
    if len(found) > 1:
        raise table.header_error(f"more than one thing measured: {' and '.join(found)}")
    if not found:
        _require_nothing_measured(table)
    return next(iter(found.values()), Closure())


def _require_nothing_measured(table: Table) -> None:
    """Refuse a table whose unknown columns have units: they were measured, by something."""
    if measured := [name for name, unit in table.left_out.items() if unit is not None]:
        raise table.header_error(
            f"no column of a known reading; column {measured[0]!r} is unknown. If a class of your"
            " own reads it, name the class: kind=…, as kind=Loop(). If it does not matter, leave it"
            f" out: --ignore {measured[0]!r} (ignore=)"
        )


def _read_values(
    table: Table,
    read: Reading,
    rotation: str | None,
    nominal: Callable[[], FloatArray | None],
    inverts: bool,
) -> FloatArray | None:
    """Read the values, (N, k) or (N,); None without their columns."""
    form = orientation_in(table.columns)
    own = form == ANGLES and rotation in (None, OWN_ORDER)
    if read.turning is not None and form and not own:
        places = [table.numbers(*each)[0] for each in read.components[: read.turning]]
        from pkmcal.measurements import orientation_forms  # imports SciPy

        turned = orientation_forms.read(table, rotation, nominal(), inverts)
        return np.column_stack([*places, turned])
    columns = [table.numbers(*each, blank=True)[0] for each in read.columns_read(table)]
    if not columns:
        return None
    return columns[0] if len(columns) == 1 else np.stack(columns, axis=1)


def _nominal(robot: Actuated | None, actuators: FloatArray, invert: bool) -> FloatArray | None:
    """Angles (N, 3) of the machine as described, of some rows; NaN for the others.

    Or those of its base in the platform's frame.
    """
    if robot is None:
        return None
    machine = as_machine(cast(Robot, robot))
    if machine.n_actuators != actuators.shape[1]:
        return None
    angles = np.full((len(actuators), 3), np.nan)
    some = np.unique(np.linspace(0, len(actuators) - 1, _TRIED).astype(int))
    angles[some] = machine.forward(actuators[some]).pose[:, 3:]
    return turned_round(angles, 0) if invert else angles
