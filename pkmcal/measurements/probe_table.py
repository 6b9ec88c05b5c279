"""Tables of what a printer's probe reported: its tip is at height 0 where it triggered."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arrays import FloatArray
from pkmcal.exceptions import FileError
from pkmcal.files.csv_table import Table
from pkmcal.kinematics.reading_units import Actuated
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.actuator_columns import actuators_in, compare, read_actuators
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.probe import (
    apart_from,
    is_of_trigger,
    offset_of,
    probed,
)
from pkmcal.measurements.table_fields import notes_of, read_fields


def read_probe(table: Table, robot: Actuated | None, offset: ArrayLike | None) -> Measurements:
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
        return _probed(table, robot, places - found * [1.0, 1.0, -1.0], found)
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
    return _probed(table, robot, poses, found)


def _probed(table: Table, robot: Robot, points: FloatArray, offset: FloatArray) -> Measurements:
    try:
        measured = probed(robot, points, offset=offset)
        fields = read_fields(table, measured.instrument, robot.actuator_units)
        given = {name: value for name, value in fields.items() if value is not None}
        measured = replace(measured, notes=notes_of(table), understood=table.understood())
        return replace(measured, file=table.path.name, **given)
    except FileError:
        raise
    except ValueError as error:
        raise FileError(f"{table.path}: {error}") from None
