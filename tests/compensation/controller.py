"""What a controller does on a program: a small machine that the interpreters of the tests drive.

The interpreters beside this file are written from the documents of each firmware, to be independent
of the tables and the reader of the package.
"""

from __future__ import annotations

from dataclasses import dataclass, field

HIDDEN = {"X": 7.0, "Y": -9.0, "Z": 33.0}  # where macros, probing and unknown commands leave it


class Odd(Exception):
    """A command by whose meaning the program cannot be corrected: it has to be refused."""


def without_mark(text: str) -> str:
    """A text without the byte-order mark that stands before a remark; before words it is odd."""
    if text[:1] != "\ufeff":
        return text
    if text[1:].lstrip(" ")[:1] not in (";", "\r", "\n", "(", ""):
        raise Odd("words behind a byte-order mark")
    return text[1:]


@dataclass(frozen=True)
class Step:
    """A straight or rapid move of a controller, or what else it did."""

    did: str  # "G1", "G0", or the text of another command
    at: tuple[float, ...] = (0.0, 0.0, 0.0)
    begin: tuple[float, ...] = (0.0, 0.0, 0.0)
    extruded: float = 0.0
    minutes: float = 0.0

    @property
    def moves(self) -> bool:
        return self.did in ("G0", "G1")


@dataclass
class Controller:
    """Position, filament and what was done."""

    at: dict[str, float]
    extruder: float = 3.25  # somewhere
    filament: float = 0.0
    shift: dict[str, float] = field(default_factory=lambda: dict.fromkeys("XYZ", 0.0))
    steps: list[Step] = field(default_factory=list)
    feed: float = 0.0

    def move(self, did: str, targets: dict[str, float], e: float, minutes: float | None) -> None:
        """Go to targets in machine coordinates; feed an amount of filament."""
        before = dict(self.at)
        self.at.update(targets)
        way = sum((self.at[axis] - before[axis]) ** 2 for axis in "XYZ") ** 0.5
        if minutes is None:
            minutes = way / self.feed if self.feed else 0.0
        self.filament += e
        begin, at = (tuple(each[axis] for axis in "XYZ") for each in (before, self.at))
        self.steps.append(Step(did, at, begin, self.filament, minutes))

    def other(self, text: str) -> None:
        """Do something else."""
        self.steps.append(Step("".join(text.upper().split())))

    def hidden(self) -> None:
        """Be somewhere that no program says."""
        self.at = dict(HIDDEN)
