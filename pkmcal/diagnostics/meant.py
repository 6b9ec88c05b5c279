"""What may have been meant by measurements, and the options that read their file so."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pkmcal.files.understood import Understood
from pkmcal.measurements.measurements import Measurements

Options = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Meant:
    """Another reading of measurements.

    Attributes
    ----------
    words : str
        What would be so: "q1 and q2 are exchanged".
    options : tuple of (str, str) or None
        The options of the command line that read the file so, each with its value; None where none
        do, or nothing was read from a file.

    Examples
    --------
    >>> late = Meant("the log is a row late", (("--join", "row+1"),))
    >>> other = Meant("q1 and q2 are exchanged", (("--rename", "Strut 1=q2"),))
    >>> print(other.and_also(late).typed)
    q1 and q2 are exchanged and the log is a row late: --rename 'Strut 1=q2' --join row+1
    >>> print(other.and_also(Meant("q3 counts the other way")).typed)
    q1 and q2 are exchanged and q3 counts the other way
    """

    words: str
    options: Options | None = None

    def and_also(self, other: Meant) -> Meant:
        """Return both together; options only where all of it can be typed."""
        both = None
        if self.options is not None and other.options is not None:
            both = (*self.options, *other.options)
        return Meant(f"{self.words} and {other.words}", both)

    def among(self, sets: Sequence[Measurements]) -> str:
        """Return the words, with what to type where all sets are of one file, which that is for."""
        return self.typed if len({each.file for each in sets}) == 1 else self.words

    @property
    def typed(self) -> str:
        """The words, and behind them what to type."""
        if not self.options:
            return self.words
        typed = " ".join(f"{option} {shlex.quote(value)}" for option, value in self.options)
        return f"{self.words}: {typed}"


def joined_later(measured: Measurements, rows: int) -> Options | None:
    """Take the actuators that stand `rows` after; None where nothing was read from a file."""
    if not _columns(measured):
        return None
    return (("--join", f"row{rows:+d}"),)


def renamed(measured: Measurements, names: Mapping[str, str]) -> Options | None:
    """Read columns by other names; None where one of them is no column of its own in the file.

    Parameters
    ----------
    measured : Measurements
        As read.
    names : mapping of str to str
        From what columns are read as to what they should be, units with it if they are others.
    """
    found = []
    for name, other in names.items():
        own = column(measured, name)
        if own is None:
            return None
        found.append(("--rename", f"{own.heading}={other}"))
    return tuple(found)


def in_unit(measured: Measurements, names: Sequence[str], unit: str) -> Options | None:
    """Read columns in another unit; None where one of them is no column of its own in the file."""
    return renamed(measured, {name: f"{name} [{unit}]" for name in names})


def _columns(measured: Measurements) -> list[Understood]:
    return [each for each in measured.understood if each.meaning is not None]


def column(measured: Measurements, name: str) -> Understood | None:
    """Return the column of a file that was read as this; None where none was."""
    return next((each for each in _columns(measured) if each.meaning == name), None)
