"""What was measured on a machine: actuator readings and, beside them, poses, points or lengths."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import checked_seed, shown, word, words
from pkmcal.arrays import FloatArray, Int64Array, TextArray
from pkmcal.display import Table
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.drive_state import DriveState
from pkmcal.measurements.components import KINDS, Artefact, Kind, components
from pkmcal.measurements.fields import (
    actuator_sigma_array,
    approach_array,
    attachment_array,
    filled_tension,
    integers,
    names_of_targets,
    number_of_row,
    numbers,
    row_numbers,
    sessions_array,
    sigma_array,
    target_array,
    temperature_array,
    tension_array,
    tension_sigma_array,
    units_of_actuators,
    value_of_row,
    values_array,
)
from pkmcal.measurements.kind_fields import (
    KindFields,
    TouchDistances,
    kind_fields,
    kind_fields_of_row,
)
from pkmcal.measurements.listing import deviations, table, title
from pkmcal.measurements.measurement_writer import write_measurements
from pkmcal.measurements.poses import pose_index
from pkmcal.measurements.tracker import Tracker
from pkmcal.readings.reading import Reading
from pkmcal.result import Result

_PER_ROW = (
    "actuators", "values", "sigma", "group", "target_index", "actuator_sigma", "lines", "session",
    "approach", "tension", "tension_sigma", "other", "run", "touched", "temperature", "time",
)  # fmt: skip


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
    kind : {"position", "pose", "height", "distance", "closure"}
        "pose": x y z alpha beta gamma of the platform, (N, 6). "position": x y z of the target,
        (N, 3). "height": z of the target, (N,). "distance": from the target, which here is a
        fixed point of the base frame, to the attachment, a point of the platform, (N,).
        "closure": nothing, `values` is None; what the actuators read is all that is known.
        "between": from where the target is in one row to where it is at `other`, (N,).
        "relative-distance": a distance less the zero of its `run`, (N,). "orientation": alpha beta
        gamma of the platform, (N, 3). "tilt": how far the x and y axes of a sensor on the platform,
        whose mounting is not known, point up, (N, 2). "touch": names of what the target touches,
        (N,), the same where it touches the same; kept as how far off it is, which is 0.
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
    group : (N,) array of int, optional
        Rows with the same number are repeats of one pose, as rows with the same actuator readings
        are.
    target_index : (N,) array of int, optional
        Which of several targets each row measured, counted from 0. With `target=None` the
        targets' places on the platform are not known.
    target_names : sequence of str, optional
        Names of the several targets; "1", "2", … by default.
    actuator_units : str or sequence of str, optional
        "mm" or "rad", one for all or one per actuator. None: not stated; written as mm.
    attachment : (3,), (N, 3) or (k, 3) array, optional
        The point in the platform frame, mm, from which distances are measured: of a wire, a ball
        bar, a leg. One for all rows, one per row, or with `target_index` one for each target.
        None: the platform's origin.
    actuator_sigma : scalar, (n,) or (N, n) array, optional
        Standard deviation of what the actuators read, mm or rad. None: they are where they read on
        a machine with as many closures as free coordinates; on one with more, and with rows that
        contradict each other, it is estimated from them. Kept as (N, n).
    other : (N, n) array, optional
        Of kind "between": the actuators at the second place.
    run : (N,) sequence of str, optional
        Of kind "relative-distance": in which run each was read, by a name. A run has one zero.
    artefact : {"point", "line", "plane", "sphere"}, optional
        Of kind "touch": what is touched; "point" by default: a socket, a cone, a hole.
    touch_distances : mapping of (str, str) to float or (float, float), optional
        Known distances between touched points, or centres of spheres, mm, or each with its
        standard deviation, which is 1 µm by default: ``{("A", "B"): 50.0}``.
    joint : str, optional
        Of kind "angle": the passive joint that is read.
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
    temperature : scalar, (N,) or (N, 2 + n) array, optional
        °C, of the whole machine, or of base, platform and what each actuator drives; NaN: not read.
        `identify` refers numbers to 20 °C where it is told how the machine expands. Kept as
        (N, 2 + n).
    time : (N,) array, optional
        When each row was measured, in seconds from any start: for the test of drift.
    lines : (N,) array of int, optional
        The line of each row in the file it was read from, to name it by.
    file : str
        The name of that file.
    notes : sequence of str
        What was assumed when they were read, a line each.

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
    sigma: FloatArray | None = None
    target: FloatArray | None = None
    group: Int64Array | None = None
    target_index: Int64Array | None = None
    target_names: tuple[str, ...] | None = None
    actuator_units: tuple[str, ...] | None = None
    attachment: FloatArray | None = None
    actuator_sigma: FloatArray | None = None
    other: FloatArray | None = None
    run: TextArray | None = None
    touched: TextArray | None = None
    artefact: Artefact | None = None
    touch_distances: TouchDistances = ()
    joint: str | None = None
    session: TextArray | None = None
    approach: FloatArray | None = None
    tension: FloatArray | None = None
    tension_sigma: FloatArray | None = None
    temperature: FloatArray | None = None
    time: FloatArray | None = None
    lines: Int64Array | None = None
    file: str = ""
    notes: tuple[str, ...] = ()
    instrument: Reading = KINDS["position"]
    labels: Mapping[str, TextArray] = dataclasses.field(default_factory=dict)

    # The types above are those of the attributes; anything array-like is taken.
    def __init__(
        self,
        actuators: ArrayLike,
        values: ArrayLike | None,
        kind: Kind | Reading = "position",
        *,
        sigma: ArrayLike | Tracker | None = None,
        target: ArrayLike | None = None,
        group: ArrayLike | None = None,
        target_index: ArrayLike | None = None,
        target_names: Sequence[str] | None = None,
        actuator_units: str | Sequence[str] | None = None,
        attachment: ArrayLike | None = None,
        actuator_sigma: ArrayLike | None = None,
        other: ArrayLike | None = None,
        run: Sequence[str] | TextArray | None = None,
        touched: Sequence[str] | TextArray | None = None,
        artefact: Artefact | None = None,
        touch_distances: Mapping[tuple[str, str], Any] | TouchDistances = (),
        joint: str | None = None,
        session: str | Sequence[str] | TextArray | None = None,
        approach: ArrayLike | None = None,
        tension: ArrayLike | None = None,
        tension_sigma: ArrayLike | None = None,
        temperature: ArrayLike | None = None,
        time: ArrayLike | None = None,
        lines: ArrayLike | None = None,
        file: str = "",
        notes: Sequence[str] = (),
        instrument: Reading | None = None,
        labels: Mapping[str, Sequence[str]] | None = None,
    ) -> None:
        if isinstance(kind, Reading):
            kind, instrument = kind.name, kind
        word("kind", kind, KINDS)
        q = numbers("actuators", actuators)
        if q.ndim not in (1, 2) or 0 in q.shape:
            raise ArgumentError(
                f"actuators must have shape (N, n), or (n,) for one row, not empty; found {q.shape}"
            )
        alone, q = q.ndim == 1, np.atleast_2d(q)
        given = KindFields(other, run, touched, artefact, touch_distances, joint)
        if alone:
            values, given = kind_fields_of_row(kind, values, given)
        own, values = kind_fields(kind, q.shape, values, given)
        k = len(components(kind, own["artefact"]))
        if alone:
            values = value_of_row(values, kind, k, q.shape[1:])
            group, target_index, lines, time = map(
                number_of_row, (group, target_index, lines, time)
            )
            if k > 1 and not isinstance(sigma, Tracker) and np.asarray(sigma).shape == (k, k):
                sigma = np.asarray(sigma)[None]
        shape = (len(q), k)
        v = values_array(values, kind, shape)
        index = None if target_index is None else integers("target_index", target_index, len(q))
        place = target_array(target, kind, index, len(q))
        targets = None if place is None or index is None else len(place)
        fields: dict[str, Any] = {
            "actuators": q,
            "values": v,
            "kind": kind,
            "sigma": None if sigma is None else sigma_array(sigma, kind, shape, v),
            "target": place,
            "group": None if group is None else integers("group", group, len(q)),
            "target_index": index,
            "target_names": names_of_targets(target_names, index, place),
            "actuator_units": units_of_actuators(actuator_units, q.shape[1]),
            "attachment": attachment_array(attachment, kind, targets, len(q)),
            "actuator_sigma": actuator_sigma_array(actuator_sigma, q.shape),
            **own,
            "session": sessions_array(session, len(q)),
            "approach": approach_array(approach, q),
            "tension": tension_array(tension, q.shape),
            "tension_sigma": tension_sigma_array(tension_sigma, tension, q.shape),
            "temperature": temperature_array(temperature, q.shape),
            "time": None if time is None else row_numbers("time", time, len(q)),
            "lines": None if lines is None else integers("lines", lines, len(q)),
            "file": file,
            "notes": words("notes", notes),
            "instrument": instrument or KINDS[kind],
            "labels": {k: np.array(each) for k, each in (labels or {}).items()},
        }
        self.__setstate__(fields)

    def __setstate__(self, fields: dict[str, Any]) -> None:
        for name, value in fields.items():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.actuators)

    @property
    def components(self) -> tuple[str, ...]:
        """Names of the components of one value: ("x", "y", "z") for a position."""
        return tuple(name for name, _ in components(self.kind, self.artefact))

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the components, "mm" or "rad"."""
        return tuple(unit for _, unit in components(self.kind, self.artefact))

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
        return self._of_rows(self.target)

    @property
    def attachments(self) -> FloatArray:
        """The attachment of every row, (N, 3) in mm; zeros where none was given."""
        return self._of_rows(self.attachment)

    def _of_rows(self, place: FloatArray | None) -> FloatArray:
        place = np.zeros(3) if place is None else place
        if self.target_index is not None and place.ndim == 2:
            place = place[self.target_index]
        return np.array(np.broadcast_to(place, (len(self), 3)), order="C")

    @property
    def pose_index(self) -> Int64Array:
        """Which pose each row belongs to, (N,), counted from 0.

        Rows of one `group` are of one pose, and rows at the same actuators.
        """
        return pose_index(self.actuators, self.drive_state, self.group)

    @property
    def drive_state(self) -> DriveState:
        """From where actuators came, and the tension of what they drive, as far as it was read."""
        tension = None if self.tension is None else filled_tension(self.tension)
        return DriveState(self.approach, tension)

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
        per_row: dict[str, Any] = {
            name: None if value is None else value[picked]
            for name, value in vars(self).items()
            if name in _PER_ROW
        }
        per_row["labels"] = {name: each[picked] for name, each in self.labels.items()}
        for name in ("target", "attachment"):
            place = getattr(self, name)
            if place is not None and place.ndim == 2 and self.target_index is None:
                per_row[name] = place[picked]
        return dataclasses.replace(self, **per_row)

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

    def write(self, path: str | PathLike[str], comment: str = "") -> None:
        """Write a CSV file that `read_measurements` reads back to the last bit, or nothing.

        Parameters
        ----------
        path : str or path
            The file; replaced as a whole or not at all.
        comment : str, optional
            Lines for its head, each with its ``#``.

        Raises
        ------
        OSError
            The file cannot be written; one that was there before is untouched.
        """
        write_measurements(self, path, comment)

    def _columns(self) -> dict[str, Any]:
        """As the columns of a file, but for the units, which are mm and rad."""
        columns: dict[str, Any] = {f"q{i + 1}": q for i, q in enumerate(self.actuators.T)}
        values = self.values.reshape(len(self), -1)
        columns |= dict(zip(self.components, values.T, strict=True))
        sigma = deviations(self)
        if sigma is not None:
            names = (f"sigma.{name}" for name in self.components)
            columns |= dict(zip(names, sigma.T, strict=True))
        if self.other is not None:
            columns |= {f"to.q{i + 1}": q for i, q in enumerate(self.other.T)}
        columns |= {} if self.run is None else {"run": self.run}
        columns |= {} if self.touched is None else {"touch": self.touched}
        if self.target_index is not None and self.target_names is not None:
            columns["target"] = [self.target_names[i] for i in self.target_index]
        if self.group is not None:
            columns["group"] = self.group
        if self.session is not None:
            columns["session"] = self.session
        if self.approach is not None:
            columns |= {f"approach.q{i + 1}": each for i, each in enumerate(self.approach.T)}
        if self.tension is not None:
            columns |= {f"tension.q{i + 1}": each for i, each in enumerate(self.tension.T)}
        if self.tension_sigma is not None:
            pairs = enumerate(self.tension_sigma.T, 1)
            columns |= {f"tension_sigma.q{i}": each for i, each in pairs}
        return columns

    def _parts(self) -> Iterator[str | Table]:
        yield title(self)
        yield table(self)
