"""Measurements of a machine: actuator readings and, beside them, poses, points or lengths."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import checked_seed, shown, words
from pkmcal.arrays import FloatArray, Int64Array, TextArray
from pkmcal.display import Table
from pkmcal.exceptions import ArgumentError
from pkmcal.files.csv_writer import with_cells
from pkmcal.files.understood import Understood
from pkmcal.kinematics.drive_state import DriveState
from pkmcal.kinematics.reading_units import Actuated
from pkmcal.measurements.field import (
    declared,
    require_other_columns,
    row_fields,
    units_of_actuators,
    values_array,
)
from pkmcal.measurements.former import OF_MEASUREMENTS, adapted
from pkmcal.measurements.listing import table, title
from pkmcal.measurements.measurement_writer import write_measurements
from pkmcal.measurements.poses import pose_index
from pkmcal.measurements.targets import checked_target, names_of_targets
from pkmcal.measurements.tension import filled_tension
from pkmcal.measurements.tracker import Tracker
from pkmcal.readings.components import names_of
from pkmcal.readings.constants import columns_of_constants
from pkmcal.readings.reading import Reading
from pkmcal.readings.registry import Kind, as_reading, stated
from pkmcal.readings.rows import numbers
from pkmcal.result import Result


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Measurements(Result):
    """Actuator readings with what an instrument measured there. Arrays are copied and read-only.

    Parameters
    ----------
    actuators : (N, n) array
        Actuator coordinates as commanded or read, mm or rad as the limbs say.
    values : (N, 6), (N, 3), (N, 2) or (N,) array
        What was measured, in mm and rad, in the base frame (or the instrument's, where
        `identify` is given ``unknown="frame"``); see `kind`. NaN: not read there.
        One row is taken as it is: actuators (n,) with values (6,), (3,) or a number, and what else
        has one entry a row likewise.
    kind : str or Reading, optional
        What was read, by default as `instrument` has it, or a position: a word, or an object of
        `pkmcal.readings` with what its rows have of their own.
        "pose": x y z alpha beta gamma of the platform, (N, 6). "position": x y z of the
        target, (N, 3). "height": z of the target, (N,). "distance", `Distance(attachment)`: from
        the target, which here is a fixed point of the base frame, to a point of the platform, (N,).
        "closure": nothing, `values` is None; what the actuators read is all that is known.
        `Between(other)`: from where the target is in one row to where it is at the actuators
        `other`, (N,). `RelativeDistance(attachment, run)`: a distance less the zero of its run,
        (N,). "orientation": alpha beta gamma of the platform, (N, 3). "tilt": how far the x and y
        axes of a sensor on the platform, whose mounting is not known, point up, (N, 2).
        `Angle(joint)`: of a passive joint, (N,). "touch", `Touch(touched, artefact, distances)`:
        names of what the target touches, (N,); kept as how far off it is, which is 0.
    sigma : scalar, (k,), (N, 1), (N, k) or (N, k, k) array, or Tracker, optional
        Standard deviation of the values in their own units; k is the number of components of the
        kind. (N, k, k) are covariance matrices. One number for poses counts as mm and as rad.
        Deviations of α β γ are those of turnings about the axes at right angles nearest to
        theirs: equal ones say that the instrument is as sure about every axis.
        For heights and distances (N,) will do. A `Tracker` gives each position the covariance
        that follows from where it stands. None: not known. Kept as (N, k) or (N, k, k).
    target : (3,), (N, 3) or (k, 3) array, optional
        The measured point in the platform frame, mm: one for all rows, one per row, or several
        with `target_index`. None: the platform's origin. For distances: the fixed point of the
        base frame, and required.
    target_index : (N,) array of int, optional
        Which of several targets each row measured, counted from 0. With `target=None` the
        targets' places on the platform are not known.
    target_names : sequence of str, optional
        Names of the several targets; "1", "2", … by default.
    actuator_units : str or sequence of str, optional
        "mm" or "rad", one for all or one per actuator. None: not stated; written as mm.
    instrument : Reading, optional
        As `kind` has it; `dataclasses.replace` hands it on. An object as `kind` is taken in its
        place, a word has to be its kind.
    file : str
        The name of that file.
    notes : sequence of str
        What was assumed when they were read, a line each.
    understood : sequence of Understood
        What was made of each column of the file, and of the log that it was joined with.
    **fields : array_like
        One entry a row, of these:
    group : (N,) array of int, optional
        Rows with the same number are repeats of one pose, as rows with the same actuator readings
        are.
    pose_name : (N,) sequence of str, optional
        Names of these poses, such as those of pictures: messages call them by these.
    actuator_sigma : scalar, (n,) or (N, n) array, optional
        Standard deviation of what the actuators read, mm or rad. None: they are where they read on
        a machine with as many closures as free coordinates; on one with more, and with rows that
        contradict each other, it is estimated from them. Kept as (N, n).
    session : str or (N,) sequence of str, optional
        When the rows were measured, one word for all or one a row: `identify` may find some
        numbers anew in each session. None: not stated. Kept as (N,).
    approach : scalar, (n,) or (N, n) array, or "order", optional
        From where each actuator came, for drives with backlash: 1 where its reading had grown, -1
        where it had fallen, 0 where that is not known. "order": the machine was driven from row to
        row as they stand. Kept as (N, n).
    tension : scalar, (n,) or (N, n) array, optional
        Of what each actuator drives, N: what load cells read, or `pkmcal.tensions` says. A drive
        law with `stretch` is longer by it. NaN: not read there; see `tension_sigma`.
    tension_sigma : scalar, (n,) or (N, n) array, optional
        Standard deviation of `tension`, N: it is then a reading, and the true tensions of a row are
        unknown. None: it is exact, or, of a robot whose file says that tensions balance its load,
        estimated from the rows. Kept as (N, n).
    load : Load, or (10,) or (N, 10) array, optional
        What the platform carried, in place of the payload that the robot file states: one load for
        all rows or one a row. Kept as (N, 10): mass in kg, centre in the frame of the tool in mm,
        force at the tool in N and moment in N mm, in the axes of the base.
    temperature : scalar, (N,) or (N, 2 + n) array, optional
        °C, of the whole machine, or of base, platform and what each actuator drives; NaN: not read.
        `identify` refers numbers to 20 °C where it is told how the machine expands. Kept as
        (N, 2 + n).
    time : (N,) array, optional
        When each row was measured, in seconds from any start: for the test of drift.
    beside : mapping of str to (N,) array, optional
        Other numbers of the rows by name, for readings and effects of your own; NaN: not read.
        Kept as a structured array (N,): ``beside["current"]``.
    lines : (N,) array of int, optional
        The line of each row in the file it was read from, to name it by.

    Raises
    ------
    ValueError, TypeError
        A shape, a number or a name that does not fit; the message names the argument.

    Examples
    --------
    >>> m = Measurements([[450, 452, 400, 405]], [[6.0, -6.2, 400.5]], sigma=0.02)
    >>> print(m)
    1 measured position, 4 actuators, sigma 0.020 mm
    row        q1        q2        q3        q4  x [mm]  y [mm]   z [mm]
      0  450.0000  452.0000  400.0000  405.0000   6.000  -6.200  400.500
    """

    actuators: FloatArray
    values: FloatArray
    kind: Kind = "position"
    instrument: Reading = dataclasses.field(default_factory=lambda: as_reading("position"))
    actuator_units: tuple[str, ...] | None = None
    target: FloatArray | None = None
    target_names: tuple[str, ...] | None = None
    file: str = ""
    notes: tuple[str, ...] = ()
    understood: tuple[Understood, ...] = ()
    # fields of the rows, in the order of their columns in files
    actuator_sigma: FloatArray | None = declared("actuator_sigma:ActuatorSigma")
    sigma: FloatArray | None = declared("sigma:Sigma")
    target_index: Int64Array | None = declared("targets:TargetIndex")
    group: Int64Array | None = declared("numbering:Group")
    pose_name: TextArray | None = declared("numbering:PoseName")
    session: TextArray | None = declared("session:Session")
    temperature: FloatArray | None = declared("temperature:Temperature")
    time: FloatArray | None = declared("time_stamps:Time")
    approach: FloatArray | None = declared("approach:Approach")
    tension: FloatArray | None = declared("tension:Tension")
    tension_sigma: FloatArray | None = declared("tension:TensionSigma")
    load: FloatArray | None = declared("carried_load:CarriedLoad")
    beside: Any = declared("beside:Beside")
    lines: Int64Array | None = declared("numbering:Lines")

    # The types above are those of the attributes; anything array-like is taken.
    def __init__(
        self,
        actuators: ArrayLike,
        values: ArrayLike | None,
        kind: Kind | Reading | None = None,
        *,
        sigma: ArrayLike | Tracker | None = None,
        target: ArrayLike | None = None,
        target_index: ArrayLike | None = None,
        target_names: Sequence[str] | None = None,
        actuator_units: str | Sequence[str] | None = None,
        instrument: Reading | None = None,
        file: str = "",
        notes: Sequence[str] = (),
        understood: Sequence[Understood] = (),
        **fields: Any,
    ) -> None:
        of_rows = row_fields(type(self))
        rowwise = {each.name: fields.pop(each.name, None) for each in of_rows}
        rowwise |= {"sigma": sigma, "target_index": target_index}
        present = (*rowwise, *_ARGUMENTS)
        instrument = adapted(
            "Measurements", stated(kind, instrument), fields, OF_MEASUREMENTS, present
        )
        require_other_columns(type(instrument), of_rows)  # type: ignore[arg-type]
        q = numbers("actuators", actuators)
        if q.ndim not in (1, 2) or 0 in q.shape:
            raise ArgumentError(
                f"actuators must have shape (N, n), or (n,) for one row, not empty; found {q.shape}"
            )
        alone, q = q.ndim == 1, np.atleast_2d(q)
        place = None if target is None else numbers("target", target)
        targets = None if place is None or target_index is None else len(np.atleast_1d(place))
        own, read = instrument.of_rows(values, q, targets)
        self.__setstate__({
            "actuators": q,
            "values": values_array(read, own, q.shape, alone and read is values),
            "kind": own.name,
            "instrument": own,
            "actuator_units": units_of_actuators(actuator_units, q.shape[1]),
            "file": file,
            "notes": words("notes", notes),
            "understood": tuple(understood),
        })  # fmt: skip
        for each in of_rows:
            self.__setstate__({each.name: each.checked(rowwise[each.name], self)})
        self.__setstate__({"target": checked_target(place, self)})
        self.__setstate__({"target_names": names_of_targets(target_names, self)})

    def __setstate__(self, fields: dict[str, Any]) -> None:
        for name, value in fields.items():
            for part in vars(value).values() if isinstance(value, Reading) else (value,):
                if isinstance(part, np.ndarray):
                    part.setflags(write=False)
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.actuators)

    @property
    def components(self) -> tuple[str, ...]:
        """Names of the components of one value: ("x", "y", "z") for a position."""
        return names_of(self.instrument.components)

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the components: "mm", "rad" or those of a reading of your own."""
        return self.instrument.units

    @property
    def targets(self) -> FloatArray:
        """The target of every row, (N, 3) in mm; zeros where none was given.

        Raises
        ------
        ValueError
            Several targets whose places were not given.
        """
        if self.target is None and self.target_names is not None:
            raise ArgumentError(
                f"target: the places of {', '.join(self.target_names)} on the platform are not"
                " known; give them as an array, or identify them with --target unknown"
                ' (unknown="target")'
            )
        return self.of_points(self.target)

    @property
    def attachments(self) -> FloatArray:
        """The attachment of every row, (N, 3) in mm; zeros where none was given."""
        return self.of_points(self.attachment)

    def of_points(self, place: FloatArray | None) -> FloatArray:
        """A point of every row (N, 3), of one, one a row or one for each target; zeros of None."""
        place = np.zeros(3) if place is None else place
        if self.target_index is not None and place.ndim == 2:
            place = place[self.target_index]
        return np.array(np.broadcast_to(place, (len(self), 3)), order="C")

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of the instrument: `run`, `touched`, …; None where it has none."""
        if name in OF_MEASUREMENTS and "instrument" in vars(self):
            none = () if name == "touch_distances" else None
            return getattr(self.instrument, OF_MEASUREMENTS[name], none)
        raise AttributeError(f"{type(self).__name__} has no attribute {name!r}")

    @property
    def pose_index(self) -> Int64Array:
        """Pose of each row, (N,), counted from 0.

        Rows of one `group` are of one pose, and rows at the same actuators.
        """
        return pose_index(self.actuators, self.drive_state, self.group)

    @property
    def drive_state(self) -> DriveState:
        """Return actuators' approaches, tensions as far as they were read, and the load."""
        tension = None if self.tension is None else filled_tension(self.tension)
        return DriveState(self.approach, tension, self.load)

    @property
    def other_drive_state(self) -> DriveState:
        """`drive_state` at the second place, of distances between two."""
        state = self.drive_state
        approach = self.instrument.approached(self.actuators, state.approach)
        return state._replace(approach=approach)

    @property
    def sessions(self) -> tuple[str, ...]:
        """The different sessions, in the order of their first rows; empty where none is stated."""
        return () if self.session is None else tuple(dict.fromkeys(self.session.tolist()))

    def select(self, rows: ArrayLike | slice) -> Measurements:
        """Some of the rows, as measurements: a slice, row numbers or a mask of N booleans.

        Raises
        ------
        ValueError
            No row is left, or a row number is out of range.
        """
        try:
            chosen = rows if isinstance(rows, slice) else np.asarray(rows)
            picked = np.atleast_1d(np.arange(len(self))[chosen])
        except (IndexError, ValueError) as error:
            raise ArgumentError(
                f"rows do not fit {len(self)} measurements: found {shown(rows)}, {error}"
            ) from None
        if picked.ndim != 1 or len(picked) == 0:
            raise ArgumentError(f"rows must choose at least one of {len(self)} measurements")
        fields = {each.name: each.of(self) for each in row_fields(type(self))}
        parts: dict[str, Any] = {k: None if of is None else of[picked] for k, of in fields.items()}
        parts["instrument"] = self.instrument.select(picked, self.target_index is not None)
        if self.target is not None and self.target.ndim == 2 and self.target_index is None:
            parts["target"] = self.target[picked]
        q, values = self.actuators[picked], self.values[picked]
        return dataclasses.replace(self, actuators=q, values=values, **parts)

    def split(self, holdout: float, seed: int = 0) -> tuple[Measurements, Measurements]:
        """Measurements to fit and measurements to hold out, drawn at random by whole poses.

        Parameters
        ----------
        holdout : float or int
            A fraction of the poses between 0 and 1, or a number of poses.
        seed : int
            Of the draw.

        Returns
        -------
        fit, held_out : Measurements
            In the order of the rows. Repeats of one pose (see `pose_index`) stay together.

        Raises
        ------
        ValueError
            Nothing would be left on one of the two sides.
        """
        pose = self.pose_index
        poses = int(pose.max()) + 1
        if poses < 2:
            raise ArgumentError(
                f"holdout: the {len(self)} rows are of one pose, and stay together: nothing would"
                " be left to fit; measure more poses, or hold none out"
            )
        fraction = isinstance(holdout, float) and 0 < holdout < 1
        count = max(1, round(holdout * poses)) if fraction else holdout
        whole = isinstance(count, (int, np.integer)) and not isinstance(count, bool)
        if not whole or not 0 < count < poses:
            raise ArgumentError(
                f"holdout must be a fraction between 0 and 1, or a number of poses below {poses};"
                f" found {holdout!r}"
            )
        drawn = np.random.default_rng(checked_seed(seed)).permutation(poses)[: int(count)]
        held = np.isin(pose, drawn)
        return self.select(~held), self.select(held)

    def write(
        self, path: str | PathLike[str], comment: str = "", *, robot: Actuated | None = None
    ) -> None:
        """Write a CSV file that `read_measurements` reads back to the last bit, or nothing.

        Parameters
        ----------
        path : str or path
            The file; replaced as a whole or not at all.
        comment : str, optional
            Lines for its head, each with its ``#``.
        robot : Robot or SerialArm, optional
            The machine that was measured: its actuators' units are those of measurements that
            state no `actuator_units`. Without it, these are written as mm.

        Raises
        ------
        OSError
            The file cannot be written; one that was there before is untouched.
        ValueError
            The machine has other actuators.
        """
        if robot is None or self.actuator_units is not None:
            write_measurements(self, path, comment)
            return
        if len(robot.actuator_units) != self.actuators.shape[1]:
            raise ArgumentError(
                f"robot has {len(robot.actuator_units)} actuators, the measurements have"
                f" {self.actuators.shape[1]}"
            )
        known = dataclasses.replace(self, actuator_units=robot.actuator_units)
        write_measurements(known, path, comment)

    @staticmethod
    def from_pandas(frame: Any, robot: Any = None, **options: Any) -> Measurements:
        """Read a pandas data frame with the columns of a file; mm and rad where none is said.

        Parameters
        ----------
        frame : pandas.DataFrame
            Columns named as in files: ``q1``, ``z``, ``"z [um]"`` …; the index is left out.
        robot : Robot, optional
            The machine that was measured.
        **options
            Those of `read_measurements`: `rename`, `units`, `kind` …

        Raises
        ------
        ValueError, TypeError
            As `read_measurements`; line 1 is that of the headings.

        Examples
        --------
        >>> frame = pandas.DataFrame({"q1": [450.0], "q2": [451.0], "z [um]": [120.0]})
        ... # doctest: +SKIP
        >>> Measurements.from_pandas(frame).values  # doctest: +SKIP
        array([0.12])
        """
        from pkmcal.measurements.data_frame import measurements_of_frame

        return measurements_of_frame(frame, robot, **options)

    def _columns(self) -> dict[str, Any]:
        """Columns as of a file, but for the units, which are mm and rad."""
        columns: dict[str, Any] = {f"q{i + 1}": q for i, q in enumerate(self.actuators.T)}
        values = self.values.reshape(len(self), -1)
        columns |= dict(zip(self.components, values.T, strict=True))
        units = self.actuator_units or ("",) * self.actuators.shape[1]
        of_instrument = (
            *with_cells(self.instrument.columns(units), len(self), self.instrument),
            *columns_of_constants(self.instrument, len(self)),
        )
        columns |= {each.name: each.values for each in of_instrument}
        fields = (column for each in row_fields(type(self)) for column in each.framed(self))
        return columns | {column.name: column.values for column in fields}

    def _parts(self) -> Iterator[str | Table]:
        yield title(self)
        yield table(self)


_ARGUMENTS = (
    "kind",
    "target",
    "target_names",
    "actuator_units",
    "instrument",
    "file",
    "notes",
    "understood",
)
