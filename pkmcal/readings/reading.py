"""A kind of reading: all that the package knows of it stands in its one class.

What a calibration asks of a reading is here: the numbers of one value, what it predicts at a pose
with all derivatives, which numbers beside the pose it depends on, where the search for those
starts, and which columns of a table hold it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np

from pkmcal.arrays import FloatArray, IntArray, Unit, mm_per_unit
from pkmcal.readings.unknowns import Dependence, Found

Components = tuple[tuple[str, Unit], ...]
NOWHERE = np.zeros(6)


@dataclass(frozen=True)
class Predicted:
    """Readings of one kind and their derivatives.

    Attributes
    ----------
    values : ndarray (N, k)
        In mm and rad, as `Measurements` of the kind have them. Derivatives of the three angles of
        orientations are those of the turning in the instrument's axes.
    by_twist : ndarray (N, k, 6)
        Derivative to the twist of the platform: ω, then the velocity of its origin, in base axes.
    by : mapping of str to ndarray (N, k, w)
        Derivative to each argument of `predict` that the kind depends on, by its name.
    by_frame : ndarray (N, k, 6) or None
        Derivative to the pose of the base, counted from the origin; None where there is no frame.
    by_other : ndarray (N, k, 6) or None
        Derivative to the twist of the platform at the second place; None where there is none.
    """

    values: FloatArray
    by_twist: FloatArray
    by: Mapping[str, FloatArray] = field(default_factory=dict)
    by_frame: FloatArray | None = None
    by_other: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class At:
    """Where a machine is when something is read.

    Attributes
    ----------
    pose : ndarray (N, 6)
        Of the platform in the base frame.
    other : ndarray (N, 6) or None
        At the second place.
    frame, origin : ndarray (6,)
        Pose of the base in the instrument's frame, counted from `origin`; None: they are one.
    along : ndarray of int (N,) or None
        Of touched lines and planes, which axis of its own each row's has.
    artefact : str or None
        What is touched.
    machines : callable or None
        Gives pairs of a machine and its rows; for what the pose alone does not determine.
    measured : Measurements or None
        The rows.
    """

    pose: FloatArray
    other: FloatArray | None = None
    frame: FloatArray | None = None
    origin: FloatArray = field(default_factory=lambda: NOWHERE)
    along: IntArray | None = None
    artefact: str | None = None
    machines: Callable[[], Iterator[tuple[Any, IntArray]]] | None = None
    measured: Any = None


@dataclass(frozen=True)
class Reading:
    """A kind of reading.

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
    point : str
        Whose place `Measurements.target` is: of the "platform", of the "base", or "" of neither.
    nouns : (str, str) or None
        What one and several are called, where not as the kind and with an s.
    by_machine : bool
        Whether the machine's numbers change a reading at one pose.
    """

    name: str = ""
    components: Components = ()
    turning: int | None = None
    framed: bool = False
    point: Literal["platform", "base", ""] = ""
    nouns: tuple[str, str] | None = None
    by_machine: bool = False

    def predict(self, at: At, **numbers: FloatArray) -> Predicted:
        """What is read there, with its derivatives."""
        raise NotImplementedError

    def by_geometry(self, at: At, places: IntArray) -> FloatArray | None:
        """How readings follow the geometry not by the pose alone, (N, k, g)."""
        return None

    def dependences(self, data: Any) -> Iterator[Dependence]:
        """What the readings depend on beside pose and frame."""
        return iter(())

    starts_by_pose = False  # whether `starts` needs the poses of the nominal machine

    def starts(self, machine: Any, sets: Sequence[tuple[Any, FloatArray]], found: Found) -> None:
        """Add where the search starts for what has no present value."""

    def simulated(self, m: Any, truth: Mapping[str, Any]) -> dict[str, FloatArray]:
        """The arguments of `predict` of a machine whose truth is stated."""
        return {}

    def mm(self, m: Any, length: float) -> FloatArray:
        """What one unit of each component is in mm at the machine."""
        return mm_per_unit(m.units, length)

    def arc(self, m: Any, length: float) -> float:
        """What takes its misfit to mm: where angles alone are read, the machine's length."""
        return 1.0 if "mm" in m.units else length

    # tables ---------------------------------------------------------------------------------------

    headings: ClassVar[tuple[str, ...]] = ()  # columns that are of this kind alone
    besides: ClassVar[tuple[str, ...]] = ()  # columns that go with them

    def read(self, table: Any) -> dict[str, Any]:
        """Fields of `Measurements` that its columns hold."""
        return {}

    def cells(self, m: Any) -> Iterator[tuple[str, Sequence[str]]]:
        """Headings and cells of these fields."""
        return iter(())
