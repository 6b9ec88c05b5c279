"""Tables of screws and their backlash as LinuxCNC has them: the COMP_FILE of a joint, and back.

A row of such a file is a position of the joint and what the motor has to be driven by beside it,
forwards and backwards (COMP_FILE_TYPE = 1), or where the joint was when it had been sent there from
below and from above (COMP_FILE_TYPE = 0).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from os import PathLike
from typing import Literal

import numpy as np

from pkmcal.arguments import path as as_path
from pkmcal.arguments import word
from pkmcal.arrays import FloatArray
from pkmcal.controllers.laws import require_plain_limbs
from pkmcal.display import Table
from pkmcal.exceptions import ArgumentError, FileError
from pkmcal.files import reading
from pkmcal.files.text_lines import lines_of
from pkmcal.geometry.geometry import Geometry
from pkmcal.geometry.limbs import Limb
from pkmcal.kinematics.robot import Robot
from pkmcal.result import Result

MOST_ROWS = 256  # EMCMOT_COMP_SIZE
Meaning = Literal["positions", "trims"]
MEANINGS: tuple[Meaning, ...] = ("positions", "trims")  # of COMP_FILE_TYPE 0 and 1


@dataclass(frozen=True, eq=False, repr=False)
class ScrewTable(Result):
    """The content of a file about a screw, as a drive law has it.

    Attributes
    ----------
    readings : ndarray (K,)
        Of the motor, in the file's unit: mm or degrees.
    corrections : ndarray (K,)
        How far the joint is ahead of them, on the mean of both directions.
    backlash : float
        The mean of both directions' difference.
    backlash_spread : float
        By how much it differs from row to row, at most; a law has one for all.
    """

    readings: FloatArray
    corrections: FloatArray
    backlash: float
    backlash_spread: float

    @property
    def drive(self) -> dict[str, object]:
        """The key ``drive`` of a robot file in the same unit."""
        pairs = np.column_stack([self.readings, self.corrections]).tolist()
        return {"table": pairs, "backlash": self.backlash}

    def _parts(self) -> Iterator[str | Table]:
        yield (
            f"{len(self.readings)} rows, {self.readings[0]:.6g} to {self.readings[-1]:.6g};"
            f" backlash {self.backlash:.4g}, in single rows off by {self.backlash_spread:.2g}"
        )


def import_comp_file(path: str | PathLike[str], rows: Meaning = "positions") -> ScrewTable:
    r"""Read the table of a screw from a COMP_FILE of LinuxCNC.

    Parameters
    ----------
    path : str or path
        Three numbers a line; the first line that has not ends the table, as for LinuxCNC.
    rows : {"positions", "trims"}
        What they are: COMP_FILE_TYPE 0, LinuxCNC's default, or 1.

    Returns
    -------
    ScrewTable
        ``.drive`` goes into a robot file.

    Raises
    ------
    ValueError
        Fewer than two rows, positions that do not rise, no numbers.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import pkmcal as pk
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "x.comp")
    ...     _ = file.write_text("0 -0.01 0.01\n100 100.04 100.06\n")
    ...     table = pk.import_comp_file(file)
    >>> table.readings, table.corrections.round(6), round(table.backlash, 6)
    (array([  0., 100.]), array([0.  , 0.05]), 0.02)
    """
    word("rows", rows, MEANINGS)
    place = as_path("path", path)
    text = reading.content(place, reading.MOST_ROBOT).decode("utf-8", "replace")
    found: list[list[float]] = []
    for line in lines_of(text):
        try:
            found.append([float(cell) for cell in line.split()[:3]])
        except ValueError:
            break
        if len(found[-1]) < 3:
            found.pop()
            break
    if len(found) < 2:
        raise FileError(f"{place}: a table has two or more lines of three numbers")
    nominal, forward, reverse = np.array(found).T
    if not (np.isfinite(found).all() and (np.diff(nominal) > 0.0).all()):
        raise FileError(f"{place}: its positions must be numbers, and rise")
    if rows == "trims":  # the motor is ahead of the joint by them
        middle = 0.5 * (forward + reverse)
        readings, corrections, between = nominal + middle, -middle, forward - reverse
    else:
        readings, corrections = nominal, 0.5 * (forward + reverse) - nominal
        between = reverse - forward
    backlash = float(between.mean())
    return ScrewTable(readings, corrections, backlash, float(abs(between - backlash).max()))


def comp_texts(robot: Robot, least: FloatArray, most: FloatArray) -> dict[int, str]:
    """The COMP_FILE of each joint that has a table or backlash, by its number from 0.

    `least` and `most` (n,) are the joints' limits.

    Positions are those of the joint without its law, gain and offset taken off, as a kinematics
    module has it; rows are trims.

    Raises
    ------
    ValueError
        A law that is neither, several limbs on an actuator, too many rows.
    """
    found = {}
    for d, (law, drive) in enumerate(zip(robot.model.laws, robot.model.drives, strict=True)):
        if law is None:
            continue
        several = [each for each in robot.model.drives if each.actuator == drive.actuator]
        if law.quadratic or law.spool or law.harmonics or len(several) > 1:
            require_plain_limbs(robot, "a COMP_FILE, which is for a table or backlash,")
        numbers = robot.slots.ravel()
        gain, offset = numbers[drive.gain], numbers[drive.offset]
        ends = [least[drive.actuator], most[drive.actuator]]
        q = np.union1d(ends, ends if drive.table is None else drive.table)
        if len(q) > MOST_ROWS:
            raise ArgumentError(f"robot: joint {d}: a COMP_FILE has at most {MOST_ROWS} rows")
        every = np.repeat(q[:, None], robot.n_actuators, axis=1)
        joint = (robot.machine.drives(robot.slots, every)[:, d] - offset) / gain
        half = 0.0 if drive.backlash is None else 0.5 * numbers[drive.backlash] / gain
        shown = np.degrees(1.0) if drive.angle else 1.0
        rows = np.column_stack([joint, q - joint + half, q - joint - half]) * shown
        found[drive.actuator] = "".join(
            " ".join(repr(value) for value in row) + "\n" for row in rows.tolist()
        )
    return found


def without_laws(robot: Robot) -> Robot:
    """The robot with gains and offsets alone."""
    model, geometry = robot.model, robot.geometry
    numbers = [n for n in geometry.numbers if not n.slot.startswith("drive.")]
    used = {name for n in numbers if n.tie is not None for name in n.tie.drivers}
    units = dict(zip(geometry.names, geometry.units, strict=True))
    parameters = {name: units[name] for name in geometry.parameters if name in used}
    plain = Geometry(numbers, parameters, dict(geometry.items()))
    limbs: tuple[Limb, ...] = tuple(replace(limb, law=None) for limb in model.limbs)
    free = tuple(name for name in model.free if name in plain)
    stated = {name: value for name, value in model.stated.items() if "drive" not in name}
    return Robot(replace(model, geometry=plain, limbs=limbs, free=free, stated=stated))
