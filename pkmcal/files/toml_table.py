"""One table of a TOML file, read with care: each mistake is one line that says where it is."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

from pkmcal.arguments import did_you_mean
from pkmcal.arrays import Unit
from pkmcal.exceptions import FileError
from pkmcal.files.reading import LONGEST_NAME
from pkmcal.files.toml_lines import KeyPath, Source

LENGTH_UNITS: dict[str, float] = {"mm": 1.0, "m": 1000.0, "in": 25.4}
ANGLE_UNITS: dict[str, float] = {"rad": 1.0, "deg": math.pi / 180.0}
LARGEST = 1e15  # of a number: beside it a double has no room for a mm
SHOWN = 60  # so many characters of what was found


@dataclass(frozen=True)
class Units:
    """The units of a file, as factors to mm and rad."""

    length: float = 1.0
    angle: float = 1.0

    def factor(self, unit: Unit) -> float:
        """Factor from the file's unit to `unit`."""
        return {
            "mm": self.length,
            "rad": self.angle,
            "1": 1.0,
            "1/mm": 1.0 / self.length,
            "1/rad": 1.0 / self.angle,
            "1/mm2": 1.0 / self.length**2,
        }.get(unit, 1.0)  # forces, masses and what yields have their units whatever the file's


def shown(value: object) -> str:
    """Shorten a text for a message."""
    if isinstance(value, bool):
        return str(value).lower()
    text = repr(dict(value) if isinstance(value, Mapping) else value)
    return text if len(text) <= SHOWN else text[: SHOWN - 3] + "..."


class Table:
    """A table of a file, with the words that say where it stands.

    Parameters
    ----------
    data : mapping
        The table as the TOML reader gives it.
    source : Source
        The file.
    path : tuple of str and int
        Where the table stands in it; () for all of it.
    units : Units
        The file's units.
    """

    def __init__(
        self,
        data: Mapping[str, Any],
        source: Source,
        path: KeyPath = (),
        units: Units | None = None,
    ) -> None:
        self.data = data
        self.source = source
        self.path = path
        self.units = units or Units()

    def name(self, key: str = "") -> str:
        """Table and key as messages call them, such as ``[[limb]] 2: base.radius``."""
        heading, *below = *self.path, key
        if not self.path:
            return key
        if below and isinstance(below[0], int):
            heading = f"[[{heading}]] {below.pop(0) + 1}"
        else:
            heading = f"[{heading}]"
        words = [f"{each + 1}" if isinstance(each, int) else each for each in below if each != ""]
        return ": ".join(filter(None, (heading, ".".join(words))))

    def fail(self, key: str, message: str, at: str = "") -> NoReturn:
        """Raise ValueError about the value of `key`; about the table itself where it is empty.

        The message begins with the file and the line of the key, or of the key `at`.
        """
        place = self.source.where(*self.path, *filter(None, (key or at,)))
        raise FileError(": ".join(filter(None, (place, self.name(key), message))))

    def only(self, known: Iterable[str], owner: str = "") -> None:
        """Refuse every key that is not in `known`; `owner` says whose keys those are."""
        known = tuple(known)
        for key in self.data:
            if key not in known:
                of = f" of {owner}" if owner else ""
                self.fail("", f"unknown key {key!r}{of}{did_you_mean(key, known)}", at=key)

    def __contains__(self, key: str) -> bool:
        return key in self.data

    def __getitem__(self, key: str) -> Any:
        if key not in self.data:
            self.fail("", f"the key {key!r} is missing")
        return self.data[key]

    def flat(self) -> Iterator[tuple[str, Any]]:
        """Pairs of dotted name and value: an unquoted ``base1.x`` is a table within a table."""
        yield from _flat(self.data)

    # values -----------------------------------------------------------------------------------

    def table(self, key: str) -> Table:
        """The table under `key`."""
        value = self[key]
        if not isinstance(value, Mapping):
            self.fail(key, f"must be a table, found {shown(value)}")
        return Table(value, self.source, (*self.path, key), self.units)

    def tables(self, key: str, owner: str) -> list[Table]:
        """The tables headed ``[[key]]``, of which `owner` has at least one."""
        found = self[key]
        if not isinstance(found, list) or not all(isinstance(each, Mapping) for each in found):
            how = f"every {key} is a table of its own, headed [[{key}]] in double brackets"
            self.fail(key, how)
        if not found:
            self.fail(key, f"{owner} has at least one {key}")
        return [
            Table(each, self.source, (*self.path, key, i), self.units)
            for i, each in enumerate(found)
        ]

    def text(self, key: str) -> str:
        """A text that is not empty."""
        value = self[key]
        if not isinstance(value, str) or not value.strip():
            self.fail(key, f"must be a text, found {shown(value)}")
        if len(value) > LONGEST_NAME:
            self.fail(key, f"has {len(value)} characters, at most {LONGEST_NAME} are taken")
        return value

    def choice(self, key: str, known: Iterable[str], what: str) -> str:
        """Read one of the `known` words; `what` names what it stands for."""
        value = self.text(key)
        if value not in (known := tuple(known)):
            self.fail(key, f"{value!r} is no {what}{did_you_mean(value, known)}")
        return value

    def texts(self, key: str) -> list[str]:
        """A list of texts."""
        value = self[key]
        if not isinstance(value, list) or not all(isinstance(each, str) for each in value):
            self.fail(key, f"must be a list of names, found {shown(value)}")
        return value

    def as_number(self, key: str, value: object, unit: Unit, what: str = "a number") -> float:
        """Check that `value` is a finite number, and convert it from the file's unit."""
        if isinstance(value, str):
            quoted = "; numbers are written without quotes" if _reads_as_number(value) else ""
            self.fail(key, f"must be {what}, found the text {shown(value)}{quoted}")
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.fail(key, f"must be {what}, found {shown(value)}")
        try:
            number = float(value) * self.units.factor(unit)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            self.fail(key, f"must be finite, found {shown(value)}")
        if abs(number) > LARGEST:
            self.fail(key, f"must be at most {LARGEST:g} in mm and rad, found {shown(value)}")
        return number

    def number(self, key: str, unit: Unit, default: float | None = None) -> float:
        """A finite number in `unit`."""
        if key not in self and default is not None:
            return default
        return self.as_number(key, self[key], unit)

    def list_of(self, key: str, count: int, what: str) -> Sequence[Any]:
        """A list of `count` entries, which messages call `what`."""
        value = self[key]
        if not isinstance(value, list) or len(value) != count:
            self.fail(key, f"must be {what}, found {shown(value)}")
        return value

    def vector(self, key: str) -> tuple[float, float, float]:
        """A direction: three numbers, not all zero, returned as a unit vector."""
        found = self.list_of(key, 3, "a direction of three numbers")
        x, y, z = (self.as_number(key, each, "1") for each in found)
        if x == y == z == 0.0:
            self.fail(key, "must be a direction, found the zero vector")
        return unit_vector(x, y, z)

    def integer(self, key: str, default: int | None = None) -> int:
        """A whole number."""
        if key not in self and default is not None:
            return default
        value = self[key]
        if isinstance(value, bool) or not isinstance(value, int):
            self.fail(key, f"must be a whole number, found {shown(value)}")
        return value


def unit_vector(x: float, y: float, z: float) -> tuple[float, float, float]:
    """Divide by the length; what is already a unit vector keeps its last bits."""
    largest = max(abs(x), abs(y), abs(z))
    if abs(math.hypot(x, y, z) - 1.0) <= 1e-15:
        return x, y, z
    x, y, z = x / largest, y / largest, z / largest  # no overflow, no underflow
    length = math.hypot(x, y, z)
    return x / length, y / length, z / length


def _reads_as_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _flat(data: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in data.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value
