"""Angles of passive joints, by their own sensors."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import shown
from pkmcal.arrays import FloatArray, IntArray, wrapped
from pkmcal.exceptions import ArgumentError
from pkmcal.files.csv_table import Table
from pkmcal.files.csv_writer import WrittenColumn
from pkmcal.readings import joint_angles
from pkmcal.readings.components import Components
from pkmcal.readings.dependences import always
from pkmcal.readings.distances import ZERO
from pkmcal.readings.measured import InFit, Measured
from pkmcal.readings.predicted import At, Predicted
from pkmcal.readings.reading import Reading, Sets, Solve
from pkmcal.readings.unknowns import Dependence, Found, Nature, Start

_COLUMN = re.compile(r"angle:(.+)")


@dataclass(frozen=True, eq=False)
class Angle(Reading):
    """The angle of a passive joint less its zero, which is not known.

    Attributes
    ----------
    joint : str
        The joint, a name of ``robot.passive_names``.
    """

    joint: str | None = None

    name = "angle"
    stated = ("joint",)
    components = (("angle", "rad"),)
    planned = False  # a joint has to be named
    starts_by_pose = True

    def predict(self, at: At, zero: FloatArray = ZERO, **numbers: FloatArray) -> Predicted:
        """Angles less `zero` (1,) or (N, 1), rad.

        A passive joint of a chain is where that closes, for which the pose alone does not say
        enough: it does not follow the pose. How angles follow the machine's numbers is
        `by_geometry`.
        """
        (m, machines), joint = at.of_rows(), str(self.joint)
        found, by_twist = np.empty(len(m)), np.zeros((len(m), 1, 6))
        for machine, rows in machines:
            pose = at.pose[rows]
            if joint_angles.follows_pose(machine, joint):
                none = np.empty(0, dtype=np.intp)
                found[rows], by_twist[rows, 0], _ = joint_angles.swivels(machine, pose, joint, none)
            else:
                state = m.drive_state.at(rows)
                found[rows] = joint_angles.angles(machine, m.actuators[rows], pose, joint, state)
        values = found[:, None] - np.broadcast_to(zero, (len(m), 1))
        return Predicted(values, by_twist, {"zero": np.full((len(m), 1, 1), -1.0)})

    def follows_pose(self, machine: Any) -> bool:
        """Return True for a pulley's swivel; joints of a chain follow from its closure."""
        return joint_angles.follows_pose(machine, str(self.joint))

    def by_geometry(self, at: At, places: IntArray) -> FloatArray | None:
        """Derivative of the angle to numbers of the geometry at a held pose."""
        (m, machines), joint = at.of_rows(), str(self.joint)
        found = np.empty((len(m), 1, len(places)))
        for machine, rows in machines:
            q, pose = m.actuators[rows], at.pose[rows]
            if joint_angles.follows_pose(machine, joint):
                found[rows, 0] = joint_angles.swivels(machine, pose, joint, places)[2]
                continue
            state = m.drive_state.at(rows)
            found[rows, 0] = joint_angles.rates(machine, q, pose, joint, places, state)
        return found

    def dependences(self, data: InFit) -> Iterator[Dependence]:
        """The zero of the sensor."""
        joints = [str(self.joint)] * len(data.measured)
        zero = (("zero", "rad"),)
        yield always("zero", "angle", zero, joints, data.starts, nature=Nature(joint=True))

    def starts(self, machine: Any, sets: Sets, found: Found) -> None:
        """The zero with which the nominal machine reads the angles, as a mean direction."""
        off: dict[str, list[FloatArray]] = {}
        for data, pose in sets:
            m, joint = data.measured, str(data.measured.instrument.joint)
            off.setdefault(joint, []).append(
                joint_angles.angles(machine, m.actuators, pose, joint, m.drive_state) - m.values
            )
        for joint, parts in off.items():
            turns = np.exp(1j * np.concatenate(parts))
            found["angle", joint] = Start((0,), np.array([np.angle(np.nansum(turns))]))

    def simulated(self, m: Measured, solve: Solve) -> FloatArray:
        """The angle itself: its sensor has the zero 0."""
        which = joint_angles.place_of(solve.machine, str(self.joint))
        return np.array(solve(m.actuators, "q").passive[:, [which]])

    def difference(self, values: FloatArray, predicted: FloatArray) -> FloatArray:
        """Return differences of angles, the short way round."""
        return wrapped(super().difference(values, predicted))

    def of_rows(
        self, values: Any, actuators: FloatArray, targets: int | None
    ) -> tuple[Angle, ArrayLike | None]:
        """The joint has to be named."""
        if not (isinstance(self.joint, str) and self.joint):
            raise ArgumentError(
                f"joint: an angle is of a passive joint, by name; found {shown(self.joint)}"
            )
        return self, values

    def found_in(self, table: Table) -> list[str]:
        """Find the columns ``angle:JOINT``."""
        return [name for name in table.columns if _COLUMN.fullmatch(name)]

    def names(self, table: Table) -> set[str]:
        """Columns ``angle:JOINT``."""
        return {*self.found_in(table)}

    def read(self, table: Table, units: Sequence[str]) -> Angle:
        """The joint that the column names."""
        return replace(self, joint=self.found_in(table)[0].partition(":")[2])

    def columns_read(self, table: Table) -> Components:
        """The column ``angle:JOINT``."""
        return tuple((name, "rad") for name in self.found_in(table))

    def value_columns(self, values: FloatArray) -> Iterator[WrittenColumn]:
        """The column ``angle:JOINT``."""
        yield WrittenColumn(f"angle:{self.joint}", "rad", values[:, 0])
