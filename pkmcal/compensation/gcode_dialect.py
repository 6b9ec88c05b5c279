"""The form of a firmware's table: what each word of G-code means to it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cache
from typing import Literal

AXES = frozenset("XYZABCUVW")
Rule = Literal["M82 M83", "either", "last"]


class Meaning(Enum):
    """The effect of a word on the poses of a program; of refused words the reason."""

    FOLLOWED = "moves and modes"
    HARMLESS = "moves nothing and changes no coordinate"
    HOMES = "the machine is where it is after homing"
    MOVES = "may move the machine"
    CURVE = "cannot be followed: lines and rapid moves alone are"
    ORIGIN = "moves the origin, or skews or scales axes, which cannot be followed"
    BED = "adds a map of the bed, which holds errors that the program corrects"
    NUMBERS = "gives the controller other numbers than ROBOT has"
    MODES = "restores modes, which cannot be followed"
    FLOW = "is a condition, a loop or a call, which cannot be followed"
    PROGRAM = "runs another program, which is not corrected"
    MOTOR = "drives motors or parts of the machine, not poses"
    TIMES = "states the time of a move, which each of its parts would take"

    @property
    def refused(self) -> bool:
        """True if a program with such a word is refused."""
        return self not in _TAKEN


_TAKEN = (Meaning.FOLLOWED, Meaning.HARMLESS, Meaning.HOMES, Meaning.MOVES)
OFFSETS = (AXES | {"L"}, Meaning.ORIGIN)  # of G10, by its letters
NEVER_PASSED = (
    Meaning.FOLLOWED,
    Meaning.CURVE,
    Meaning.TIMES,
    Meaning.FLOW,
    Meaning.PROGRAM,
)


@dataclass(frozen=True)
class Dialect:
    """The dialect of a firmware: how it reads G-code.

    Attributes
    ----------
    title : str
        Its name.
    words : dict
        What its words mean, by name: ``"G1"``, ``"M104"``, ``"T"``, ``"SET_PIN"``.
    texts : frozenset of str
        Words behind which the rest of the line is a text; of several commands, if not in quotes.
    unquoted : frozenset of str
        Words that may take the rest of the line for a text where that is not in quotes.
    letters : frozenset of str
        Words that G0 and G1 may have beside axes.
    remark : str
        The pattern of a comment, and of texts in which none begins.
    several : bool
        Whether a line may have several commands, one after the other; else the first alone counts.
    block : bool
        Whether the words of a line act together, in an order of their own.
    newlines : bool
        Whether a carriage return alone ends no line.
    behind : frozenset of str
        Words of a block that act behind its move.
    by_letters : dict
        Words that mean something else where they have one of these letters, and what.
    extrusion : tuple of str
        How its versions tell whether E is relative: by M82 and M83 alone, by G91 or M83
        (``"either"``), by the last of G90, G91, M82 and M83.
    adds_relative : bool
        Whether an absolute E counts what was extruded relatively before.
    exact : bool
        Whether G01 is another word than G1.
    capitals : bool
        Whether some of its versions do not read lower case.
    inverse_time : bool
        Whether it has G93.
    rapid_lines : bool
        Whether a G0 goes along a line with its feed, as a G1 does.
    repeated : frozenset of str
        Words of a move that each of its parts has to state.
    takes : str
        The word that takes the tool that T selects; empty where T itself does.
    takes_unseen : frozenset of str
        Words that may change the tool in another way.
    unclear : dict
        Patterns of lines that versions of it read differently or that act unseen, and why each is
        refused.
    longest : int or None
        How many characters, in bytes, of a line it reads, those of a comment behind it left out
        but in a block.
    """

    title: str
    words: dict[str, Meaning]
    texts: frozenset[str] = frozenset()
    unquoted: frozenset[str] = frozenset()
    letters: frozenset[str] = frozenset("F")
    remark: str = r";.*"
    several: bool = False
    block: bool = False
    newlines: bool = False
    behind: frozenset[str] = frozenset()
    by_letters: dict[str, tuple[frozenset[str], Meaning]] = field(
        default_factory=lambda: {"G10": OFFSETS}
    )
    extrusion: tuple[Rule, ...] = ()
    adds_relative: bool = True
    exact: bool = False
    capitals: bool = False
    inverse_time: bool = False
    rapid_lines: bool = False
    repeated: frozenset[str] = frozenset()
    takes: str = ""
    takes_unseen: frozenset[str] = frozenset()
    unclear: dict[str, str] = field(default_factory=dict)
    longest: int | None = None

    def name(self, letter: str, number: str) -> str:
        """A word as its table has it."""
        letter = letter.upper()
        if letter == "T":
            return letter
        return letter + (number if self.exact or not number else _shortest(number))

    def meaning(self, name: str, letters: frozenset[str]) -> Meaning | None:
        """Return the meaning of a word with these letters; None if the table lacks it."""
        of_these = self.by_letters.get(name)
        if of_these is not None and not of_these[0].isdisjoint(letters):
            return of_these[1]
        return self.words.get(name)

    def e_is_relative(self, own: bool | None, axes: bool, last: bool | None) -> bool | None:
        """Tell whether E is relative; None where that is not stated, or versions differ.

        Parameters
        ----------
        own : bool or None
            M83; None before any of M82 and M83.
        axes : bool
            G91.
        last : bool or None
            Whether the last of G90, G91, M82 and M83 was G91 or M83.
        """
        return _agreed(self.extrusion, own, axes, last)


@cache
def _agreed(
    rules: tuple[Rule, ...], own: bool | None, axes: bool, last: bool | None
) -> bool | None:
    """Return the answer on which all rules agree."""
    said = {"M82 M83": own, "either": True if axes else own, "last": last}
    found = {said[rule] for rule in rules}
    return found.pop() if len(found) == 1 else None


@cache
def _shortest(number: str) -> str:
    """A number without zeros that say nothing."""
    return f"{float(number):g}"


def table(*also: Mapping[str, Meaning], **names: str) -> dict[str, Meaning]:
    """A table from names in a text, by meaning in lower case; ``M3-M5`` stands for all between.

    With `also` its words stand beside those of other tables.
    """
    words = [word for each in also for word in each.items()]
    for meaning, text in names.items():
        words += [
            (each, Meaning[meaning.upper()]) for name in text.split() for each in _between(name)
        ]
    found = dict(words)
    if len(found) < len(words):
        twice = sorted(name for name, _ in words if [each for each, _ in words].count(name) > 1)
        raise ValueError(f"{twice[0]} stands twice in the table")
    return found


def _between(name: str) -> list[str]:
    """Return the names of codes from a first to a last number."""
    ends = re.fullmatch(r"([GM])(\d+)-\1(\d+)", name)
    if ends is None:
        return [name]
    return [f"{ends[1]}{number}" for number in range(int(ends[2]), int(ends[3]) + 1)]
