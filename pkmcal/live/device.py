"""Interfaces of a machine and of an instrument with which a measurement can be made.

A kind of machine or instrument is one file with one class, named in `registry`. One that asks a
person has ``ASKS = True`` and takes a third argument: what asks, a terminal or a page.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import ClassVar, NamedTuple, Protocol

from pkmcal.arrays import FloatArray
from pkmcal.exceptions import Error
from pkmcal.kinematics.robot import Robot

FARTHEST = 1e5  # mm, rad; a reading beyond it is a mistake of who sent or typed it

RESTS = 20  # looks at rest after which a move that has not arrived has ended elsewhere


class DeviceError(Error):
    """A machine or an instrument does not answer, or refuses; says which and why."""


@contextmanager
def understood(what: str) -> Iterator[None]:
    """Refuse an answer of another form than its maker documents.

    Raises
    ------
    DeviceError
        In place of what Python says of an entry that is missing or of another type.
    """
    try:
        yield
    except Error:
        raise
    except (LookupError, TypeError, AttributeError, ValueError) as error:
        raise DeviceError(f"{what}: an answer that is not understood: {error!r}") from None


class Where(NamedTuple):
    """Place of a machine, as its controller reports it.

    Attributes
    ----------
    pose : ndarray (6,) or None
        By its own numbers, mm and rad; NaN of what it does not say. None: it says nothing.
    actuators : ndarray (n,) or None
        Of its drives, as the robot file counts them. None: it says nothing.
    """

    pose: FloatArray | None = None
    actuators: FloatArray | None = None


class Machine(Protocol):
    """A machine that is driven. Poses are those of the robot file, mm and rad.

    Attributes
    ----------
    ADDRESS : str
        What stands behind its word and a colon, for help; empty: nothing.
    """

    ADDRESS: ClassVar[str]

    def require_ready(self) -> None:
        """Raise a `DeviceError` that says why it cannot be driven; return where it can."""

    def go(self, pose: FloatArray, feed: float) -> None:
        """Drive straight to a pose (6,), at a feed in mm/min, and return when it stands still."""

    def where(self) -> Where:
        """Place of the machine, as its controller reports it."""

    def stop(self) -> None:
        """Stop at once, whatever it does; called from any thread, also while `go` waits."""

    def close(self) -> None:
        """Leave it as it is, and free what was opened."""


class Instrument(Protocol):
    """An instrument that is read.

    Attributes
    ----------
    ADDRESS : str
        What stands behind its word and a colon, for help; empty: nothing.
    """

    ADDRESS: ClassVar[str]

    def read(self, wanted: str) -> FloatArray:
        """One reading (k,), mm and rad; NaN: nothing was seen. `wanted` says where and what."""

    def close(self) -> None:
        """Close connections and files of the device."""


def require_translations(robot: Robot, what: str) -> None:
    """Refuse a machine whose poses are more than x, y, z: these words of G-code say no more.

    Raises
    ------
    ValueError
        The machine turns its platform.
    """
    if not set(robot.coordinates) <= {"x", "y", "z"}:
        raise DeviceError(
            f"{what}: drives x, y and z alone, and {robot.name} has {', '.join(robot.coordinates)}"
        )
