"""A kind of reading: all that the package knows of it stands in its one class.

What a calibration asks of a reading is here: the numbers of one value, what it predicts at a pose
with all derivatives, which numbers beside the pose it depends on, where the search for those
starts, what a simulated instrument reads, and which columns of a table hold it. An instrument is
an object of the class; its fields are what is particular to it: how a sensor is mounted, what each
row touches.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from os import PathLike
from typing import Any, ClassVar, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arrays import FloatArray, IntArray, lots, mm_per_unit
from pkmcal.exceptions import ArgumentError, of_the_package
from pkmcal.files.csv_table import Table
from pkmcal.files.csv_writer import WrittenColumn
from pkmcal.readings import orientation, rows
from pkmcal.readings.alignment import Laid, Sighting
from pkmcal.readings.components import Components, Family, families_by_unit, units_of
from pkmcal.readings.measured import InFit, Measured
from pkmcal.readings.own_methods import watch
from pkmcal.readings.predicted import (
    At,
    Lots,
    Predicted,
    Shared,
    require_arguments,
    require_predicted,
)
from pkmcal.readings.unknowns import Body, Dependence, Found

Sets = Sequence[tuple[InFit, FloatArray]]  # rows of a calibration, and their nominal poses
Own = TypeVar("Own", bound="Reading")


class Solve(Protocol):
    """A simulated machine's forward kinematics."""

    @property
    def machine(self) -> Any:
        """The machine."""

    def __call__(self, actuators: FloatArray, argument: str) -> Any:
        """Solve rows of actuators; what cannot be solved is refused as this argument's fault."""


class HeldNumbers(NamedTuple):
    """Numbers of an instrument that a calibration holds and that may be wrong.

    Attributes
    ----------
    name : str
        What is wrong then, as messages say it.
    cure : str
        What helps.
    argument : str
        The argument of `Reading.predict` that has them.
    slots : tuple of int
        Which of its numbers they are.
    """

    name: str
    cure: str
    argument: str
    slots: tuple[int, ...]


class StatedBeside(NamedTuple):
    """What instruments state beside their rows, as readings of another kind.

    Attributes
    ----------
    instrument : Reading
        That kind.
    values, sigma : sequence of float
        A value of each, and its standard deviation.
    places : sequence of (int, int)
        A set and a row of it for each: where the machine then stands; nothing follows from it.
    """

    instrument: Reading
    values: Sequence[float]
    sigma: Sequence[float]
    places: Sequence[tuple[int, int]]


class ShownPoints(NamedTuple):
    """Points that readings show, each of them in several.

    Attributes
    ----------
    places : ndarray (3,) or (N, 3)
        The point of each row where it is stated, mm.
    on_frame : bool
        Whether they stand with the frame; else they are on the platform.
    noun : str
        What they are.
    """

    places: FloatArray
    on_frame: bool
    noun: str


class Reading:
    """A kind of reading. A subclass is a frozen dataclass; its fields are the instrument's own.

    Attributes
    ----------
    name : str
        As `Measurements.kind` has it.
    components : tuple of (str, str)
        Name and unit of each number of a value.
    turning : int or None
        The first of three components that are an orientation and differ by a rotation vector.
    framed : bool
        Whether the readings are in the frame of an instrument.
    placed : bool
        Whether it may be known where the instrument stands and what is mounted on the platform for
        it; if not, frame and tool are always found.
    tells_actuators : bool
        Whether readings of one pose are so many and so precise that they tell how well the
        actuators were read, which is then estimated where it is not stated.
    scaled_by : str
        Something whose stated size is the only length in its readings, in a word; "" where the
        readings are lengths themselves or have none.
    frame_order : int
        Of readings in one frame, whose place that frame where a search begins: the least number's.
    is_place : bool
        Whether its first components are x, y and z of the platform, or of a point of it.
    point : str
        Which body `Measurements.target` is a point of: the "platform", the "base", or "", neither.
    unknown_with_target, unknown_with_attachment : tuple of str
        The roles in `dependences` of what is unknown where `identify` is told that targets, or
        attachments, are: each set may then have its own, and their uncertainty may be stated.
    by_contact : bool
        Whether the machine was driven until it touched: a value is then no length that was read.
    told_apart_by : str
        What to state of instruments that stand apart, so that each has a frame of its own.
    stated_by : mapping of str to str
        What states how well numbers of the instrument are known, by wildcards of their names: a
        prior or an uncertainty of these is refused in these words.
    nouns : (str, str) or None
        What one and several are called, where not as the kind and with an s.
    shrinks : bool
        Whether misfits fall where the machine gets smaller: readings that tell no length but have
        one.
    more : str
        The advice where there are too few of them.
    argument : str
        The argument that states them, where they are no measurements of their own.
    by_firmware : bool
        Whether a firmware's own numbers may be mistaken for these readings.
    planned : bool
        Whether poses can be planned for the object that its word stands for.
    starts_by_pose : bool
        Whether `starts` needs the poses of the nominal machine.
    held : tuple of HeldNumbers
        Numbers of the instrument that are held unless asked otherwise, and may be wrong.
    by_rows : tuple of str
        Arguments of `shared` that rows depend on by themselves, not through their lot's motion.
    per_row : tuple of str
        Fields with an entry for every row.
    labels : tuple of str
        Fields that name something for every row, each with a column of its own; they are needed.
    anew : str
        The label that names another thing in another file or session, whatever its name.
    own_points : tuple of str
        Fields that are points, as `Measurements.target` is: (3,), (N, 3), or (k, 3) one for each of
        several targets. Their columns are ``NAME.x``, ``.y`` and ``.z``.
    truth : tuple of str
        Fields that a simulation is told and nobody who measures knows.
    stated : tuple of str
        Other fields that its own columns or their headings state. What is in none of these lists
        is one number or word for all rows, and has a column ``KIND.FIELD`` in files.
    """

    name: ClassVar[str] = ""
    components: ClassVar[Components] = ()
    turning: ClassVar[int | None] = None
    framed: ClassVar[bool] = False
    placed: ClassVar[bool] = True
    tells_actuators: ClassVar[bool] = False
    scaled_by: ClassVar[str] = ""
    frame_order: ClassVar[int] = 9
    is_place: ClassVar[bool] = False
    point: ClassVar[Body] = ""
    unknown_with_target: ClassVar[tuple[str, ...]] = ("target",)
    unknown_with_attachment: ClassVar[tuple[str, ...]] = ()
    by_contact: ClassVar[bool] = False
    told_apart_by: ClassVar[str] = ""
    stated_by: ClassVar[Mapping[str, str]] = {}
    nouns: ClassVar[tuple[str, str] | None] = None
    shrinks: ClassVar[bool] = False
    more: ClassVar[str] = "measure more poses"
    argument: ClassVar[str] = ""
    by_firmware: ClassVar[bool] = False
    planned: ClassVar[bool] = True
    starts_by_pose: ClassVar[bool] = False
    held: ClassVar[tuple[HeldNumbers, ...]] = ()
    by_rows: ClassVar[tuple[str, ...]] = ()
    per_row: ClassVar[tuple[str, ...]] = ()
    labels: ClassVar[tuple[str, ...]] = ()
    anew: ClassVar[str] = ""
    own_points: ClassVar[tuple[str, ...]] = ()
    truth: ClassVar[tuple[str, ...]] = ()
    stated: ClassVar[tuple[str, ...]] = ()

    @property
    def shown_points(self) -> ShownPoints | None:
        """Points that are stated and that several rows show; None of readings without them."""
        return None

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if not of_the_package(cls):
            watch(cls, Reading, "kind")

    # the model ------------------------------------------------------------------------------------

    def predict(self, at: At, **numbers: FloatArray) -> Predicted:
        """Compute the readings there, with their derivatives.

        Parameters
        ----------
        at : At
            Where the machine is.
        **numbers : ndarray (w,) or (N, w)
            The arguments that `dependences` names.
        """
        raise NotImplementedError

    @property
    def frame_name(self) -> str:
        """The name of the frame that readings are in, where there may be several; else ""."""
        return ""

    @property
    def stands_by(self) -> str:
        """The thing that stands in that frame, "" of instruments that may be placed anywhere.

        Readings of one frame have to agree on it.
        """
        return ""

    def lots(self, m: Measured) -> IntArray | None:
        """The lot of each row (N,) by rows alone, of readings that `shared` can compute.

        None: rows have nothing in common, and `predict` is all there is.
        """
        return None

    def not_apart(self, m: Measured, fitted: Measured) -> str:
        """The reason why rows tell nothing that is held out of others; "" where they do."""
        return ""

    def shared(self, at: At, lots: Lots, **numbers: FloatArray) -> Shared:
        """Compute `predict` through the motions of lots of rows at one place each.

        The result stands for many rows by few equations, without a loss.
        """
        raise NotImplementedError

    def by_geometry(self, at: At, places: IntArray) -> FloatArray | None:
        """Derivative (N, k, g) to numbers of the geometry at a held pose; None: it is 0."""
        return None

    def dependences(self, data: InFit) -> Iterator[Dependence]:
        """State what the readings depend on beside pose and frame."""
        return iter(())

    def starts(self, machine: Any, sets: Sets, found: Found) -> None:
        """Add to `found` where the search starts for unknowns that have no present value."""

    def axis(self, data: InFit) -> IntArray | None:
        """The axis, 0, 1 or 2, from which the numbers of each row's thing count, for `At.axis`."""
        return None

    def reach(self, pose: FloatArray, numbers: Mapping[str, FloatArray]) -> FloatArray | None:
        """Vectors (N, 3), mm, in the base's axes, whose lengths are read; by numbers of `predict`.

        None: lengths are read of the place of the platform, or of a point of it, from a fixed one.
        """
        return None

    def stated_beside(self, sets: Sequence[Measured]) -> StatedBeside | None:
        """What the instruments of all sets of this kind state beside their rows; None: nothing."""
        return None

    def frame(self, seen: Sighting) -> Laid:
        """Place the frame where its search begins: the base in it, and shifts of unknown targets.

        By default where the base is, with its axes.
        """
        return np.zeros(6), {}

    def places_seen(self, m: Measured, pose: FloatArray) -> FloatArray:
        """Pose (N, 6) of a tool in the instrument's frame, of rows that show it; else NaN.

        `pose` (N, 6) are those of the nominal machine. Of readings that depend on a tool.
        """
        return m.values

    def as_found(self: Own, numbers: Mapping[str, float]) -> Own:
        """The instrument with what a calibration found of it, by the names of its numbers.

        By default itself.
        """
        return self

    @property
    def file_name(self) -> str:
        """The name of the file of an instrument as it was found; "" of those that have none."""
        return ""

    def drawn(self) -> dict[str, Any] | None:
        """Tell a page where an instrument as it was found stands and what it sees, or None."""
        return None

    @property
    def motions(self) -> Mapping[str, FloatArray]:
        """Motions (4, 4), mm, of an instrument as it was found, by the frames they lead between."""
        return {}

    def write(self, path: str | PathLike[str], comment: str = "") -> None:
        """Write the instrument as it was found; `comment` are lines for the head of the file."""
        raise NotImplementedError

    def pictures(self, m: Measured, pose: FloatArray, off: FloatArray) -> Sequence[Any]:
        """Tell what each picture shows, of readings that are taken in pictures; else nothing.

        Of an instrument as it was found. `pose` (N, 6) are those of the machine where its actuators
        say that it is, `off` (N, k) measured less predicted there.
        """
        return ()

    def follows_pose(self, machine: Any) -> bool:
        """Return whether it follows from one pose of the platform, wherever the actuators are."""
        return True

    def arguments(self, m: Measured) -> dict[str, FloatArray]:
        """Give the arguments of `predict` for an instrument whose truth is stated."""
        return {}

    def of_poses(self: Own, q: FloatArray) -> tuple[FloatArray, Own]:
        """Actuators of the rows, pose by pose, that it reads at each of (N, n); and it, of these.

        By default one row at each.
        """
        return q, self

    def required(self: Own, q: FloatArray) -> tuple[FloatArray, Own]:
        """As `of_poses`, of what has to be read where a pose of a plan is to be measured."""
        return self.of_poses(q)

    def simulated(self, m: Measured, solve: Solve) -> FloatArray:
        """Compute what the instrument would read without noise, (N, k)."""
        at, given = At(solve(m.actuators, "q").pose, axis=np.full(len(m), 2)), self.arguments(m)
        require_arguments(self, at, given, "arguments")
        found = self.predict(at, **given)
        require_predicted(self, len(m), found)
        return found.values

    def doubts(self, m: Measured) -> Iterator[str]:
        """Say what the readings themselves show to be wrong with them, a sentence each."""
        return iter(())

    # differences ----------------------------------------------------------------------------------

    def difference(self, values: FloatArray, predicted: FloatArray) -> FloatArray:
        """Measured less predicted, (N, k); of orientations the rotation vector between them."""
        residual: FloatArray = values.reshape(predicted.shape) - predicted
        if (first := self.turning) is not None:
            residual[:, first:] = orientation.between(values[:, first:], predicted[:, first:])
        return residual

    def corrected(self, predicted: FloatArray, residual: FloatArray) -> FloatArray:
        """Values (N, k) that differ from the predicted ones by a residual: inverts `difference`."""
        values: FloatArray = predicted + residual
        if (first := self.turning) is not None:
            values[:, first:] = orientation.turned(predicted[:, first:], residual[:, first:])
        return values

    def by_difference(self, derivative: FloatArray, residual: FloatArray) -> FloatArray:
        """Return how `difference` shrinks, (N, k, n), for a derivative of `Predicted`."""
        if (first := self.turning) is not None:
            for part in lots(len(residual)):
                by_turning = orientation.by_turning(residual[part, first:])
                derivative[part, first:] = by_turning @ derivative[part, first:]
        return derivative

    # units ----------------------------------------------------------------------------------------

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the components."""
        return units_of(self.components)

    def mm(self, m: Measured, length: float) -> FloatArray:
        """Return the worth of one unit of each component at the machine, mm, (k,) or (N, k).

        Raises
        ------
        ValueError
            A unit beside mm and rad, of which only the reading's own class can say this.
        """
        for unit in self.units:
            if unit not in ("mm", "rad"):
                raise ArgumentError(
                    f"kind: the class of {self.name!r} has to state in its method mm what one"
                    f" {unit} is in mm at the machine"
                )
        return mm_per_unit(self.units, length)

    def with_sizes(self: Own, m: Measured, poses: Callable[[], FloatArray]) -> Own:
        """The reading as `mm` needs it, which is asked beside its class alone.

        Parameters
        ----------
        m : Measurements
            What was read.
        poses : callable
            Returns the nominal machine's poses (N, 6) at these rows.
        """
        return self

    @property
    def families(self) -> tuple[Family, ...]:
        """Return the components by unit: lengths or angles, say, may be wrong by themselves."""
        return families_by_unit(self.units)

    def arcs(self, m: Measured, length: float) -> FloatArray:
        """Return factors from each component's residual to mm (k,): one number for all rows."""
        each = self.mm(m, length)
        return np.asarray(np.median(each, axis=0) if each.ndim > 1 else each, dtype=np.float64)

    # rows -----------------------------------------------------------------------------------------

    def of_rows(
        self: Own, values: Any, actuators: FloatArray, targets: int | None
    ) -> tuple[Own, ArrayLike | None]:
        """Check the fields against the rows.

        Parameters
        ----------
        values : array_like or None
            As the caller gave them.
        actuators : ndarray (N, n)
            Of the rows.
        targets : int or None
            How many places are stated for several targets that rows choose from.

        Returns
        -------
        reading, values
            With arrays, one entry a row where `per_row` says so; and the values as numbers.
        """
        many, found = targets or len(actuators), dict[str, Any]()
        for name in self.labels:
            if (given := getattr(self, name)) is None:
                raise ArgumentError(f"{name}: {self.noun()} need one for each row, by its name")
            found[name] = rows.names(name, given, len(actuators))
        for name in self.per_row:
            if (given := getattr(self, name)) is None:
                continue
            found[name] = rows.each(name, given, len(actuators))
        for name in self.own_points:
            if (given := getattr(self, name)) is None:
                continue
            found[name] = rows.numbers(name, given)
            if found[name].shape not in ((3,), (many, 3)):
                raise ArgumentError(
                    f"{name} must have shape (3,) or ({many}, 3); found {found[name].shape}"
                )
        return self.with_fields(found), values

    def select(self: Own, picked: IntArray, indexed: bool) -> Own:
        """The instrument of some rows; `indexed`: rows choose from several targets."""
        names = [n for n in (*self.per_row, *self.labels) if getattr(self, n) is not None]
        if not indexed:
            names += [name for name in self.own_points if np.ndim(getattr(self, name)) == 2]
        return self.with_fields({name: getattr(self, name)[picked] for name in names})

    def measured(self: Own) -> Own:
        """The instrument as somebody knows it who measures: without its truth."""
        if not self.truth:
            return self
        defaults = {each.name: each.default for each in dataclasses.fields(self)}  # type: ignore[arg-type]
        return self.with_fields({name: defaults[name] for name in self.truth})

    def subject(self, rows: int) -> IntArray:
        """Return the subject of each of `rows` rows beside its target, (N,), from 0.

        Rows differ where a field with an entry for every row does, a second place, an attachment:
        they repeat no other then.
        """
        points = [name for name in self.own_points if np.ndim(getattr(self, name)) == 2]
        found = np.zeros(rows, dtype=np.intp)
        if not (self.per_row or points):
            return found
        for name in (*self.per_row, *points):
            given = getattr(self, name)
            if given is not None and len(given) == rows:
                own = np.unique(np.asarray(given), axis=0, return_inverse=True)[1].reshape(-1)
                found = found * (int(own.max(initial=0)) + 1) + own
        return np.unique(found, return_inverse=True)[1].reshape(-1)

    def with_fields(self: Own, changes: Mapping[str, Any]) -> Own:
        """The instrument with other fields; arrays become read-only."""
        if not changes:
            return self
        for value in changes.values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
        return dataclasses.replace(self, **changes)  # type: ignore[type-var]

    def approached(self, actuators: FloatArray, first: FloatArray | None) -> FloatArray | None:
        """Return the approach of actuators (N, n) to the second place of each row, (N, n).

        `first` is from where they came to the first; None: not known.
        """
        return first

    # words ----------------------------------------------------------------------------------------

    def noun(self, count: int = 2) -> str:
        """Return the noun for one, or for several."""
        one, several = self.nouns or (self.name, f"{self.name}s")
        return one if count == 1 else several

    def title(self, m: Measured) -> str:
        """Return a title: how many readings of which noun, and how many are missing."""
        what = f"{len(m)} measured {self.noun(len(m))}"
        missing = int(np.isnan(m.values.reshape(len(m), -1)).all(axis=1).sum())
        return what + (f" ({missing} not read)" if missing else "")

    # tables ---------------------------------------------------------------------------------------

    def found_in(self, table: Table) -> list[str]:
        """Columns of this kind that a table has, each title for another reading; none: it has none.

        By default the components under their names.
        """
        names = [name for name, _ in self.components]
        return [", ".join(names)] if any(name in table.columns for name in names) else []

    def rows_of(self, table: Table) -> IntArray | None:
        """Rows of a table that it reads; None: all."""
        return None

    def names(self, table: Table) -> set[str]:
        """Names of all columns of a table that this kind reads."""
        return {name for name, _ in self.components}.union(self.labels)

    def read(self: Own, table: Table, units: Sequence[str]) -> Own:
        """The instrument with the fields that columns hold; `units` are those of the actuators."""
        return self.with_fields({name: np.array(table.texts(name)) for name in self.labels})

    def columns_read(self, table: Table) -> Components:
        """Names and units of the columns of a table that hold the values."""
        return self.components

    def value_columns(self, values: FloatArray) -> Iterator[WrittenColumn]:
        """Columns that hold the values (N, k)."""
        for (name, unit), column in zip(self.components, values.T, strict=True):
            yield WrittenColumn(name, unit, column)

    def columns(self, units: Sequence[str]) -> Iterator[WrittenColumn]:
        """Columns that hold the fields with an entry for every row."""
        for name in self.per_row:
            if getattr(self, name) is not None:
                raise ArgumentError(
                    f"kind: {name} of {self.name!r} has an entry for every row and no column: its"
                    " class has to state in methods columns, names and read how it is written"
                )
        for name in self.labels:
            yield WrittenColumn(name, "", getattr(self, name))

    def columns_in_file(self, units: Sequence[str]) -> Iterator[WrittenColumn]:
        """The columns of a file that hold the fields, from which `read` has them back."""
        return self.columns(units)

    def points(self, m: Measured) -> dict[str, FloatArray]:
        """Return the reading's own points of every row (N, 3), mm, as far as stated, by name."""
        own = {name: getattr(self, name) for name in self.own_points}
        return {name: m.of_points(place) for name, place in own.items() if place is not None}
