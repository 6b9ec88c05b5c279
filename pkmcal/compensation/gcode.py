"""Plain G-code: moves of a program, and the program with other numbers in them.

Own code, for what is not a move has to stay to the character, and what cannot be followed has to be
refused with its line: readers of G-code that are published lose one or the other.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.exceptions import FileError
from pkmcal.files.text_lines import MARK, lines_of

_WORD = re.compile(r"([A-Za-z])[ \t]*([-+]?(?:\d+\.?\d*|\.\d+))")
_REMARK = re.compile(r"\([^)]*\)|;.*")
_PLAIN = re.compile(rf"\s*(?:{_WORD.pattern}\s*)*")
_NUMBERED = r"\s*(?:N\s*\d+\s*)?"
_SETTING = re.compile(_NUMBERED + r"M\s*\d\d", re.IGNORECASE)  # its X, Y, Z are no axes
_MESSAGE = re.compile(_NUMBERED + r"M\s*(?:0*23|28|30|32|36|117|118|291|928)\b.*", re.IGNORECASE)
_OFFSET = re.compile(
    _NUMBERED + r"(M\s*(?:206|218|290|428|556|579)\b|SET_GCODE_OFFSET\b)", re.IGNORECASE
)
_RESTORED = re.compile(
    _NUMBERED + r"(RESTORE_GCODE_STATE\b|M\s*(?:72|121)\b|M\s*73\s*$)", re.IGNORECASE
)
_BLOCK = re.compile(r"\s*(if|elif|else|while)\b", re.IGNORECASE)
# what may move the machine: macros, all but those that set something, and changes of tools
_MACRO = re.compile(
    r"\s*(?!SET_|EXCLUDE_OBJECT|echo\b|global\b|set\b|var\b)([A-Za-z_]{2,}\w*)", re.IGNORECASE
)
_CHANGE = re.compile(_NUMBERED + r"(T\s*\d+|M\s*(?:0*6|9[6-9]|125|600|701|702))\b", re.IGNORECASE)
_GEOMETRY = re.compile(_NUMBERED + r"(M\s*66[569])\b(?=.*[A-Z])", re.IGNORECASE)
_HOMED = re.compile(_NUMBERED + r"G\s*28(?:\s*[A-Z])*\s*", re.IGNORECASE)  # axes without numbers
_CHECKSUM = re.compile(r".*\*\s*\d+\s*")
_NAMED = re.compile(r"\s*[A-Za-z_]{2,}")  # a macro, such as PRINT_START BED=60
_INCH = 25.4
_LOST = {28.0, 28.1, 29.0, 30.0, 30.1, 32.0}  # homing and probing: the machine is elsewhere then
_PASSED = {4.0, 10.0, 11.0, 17.0, 18.0, 19.0, 40.0, 49.0, 54.0, 61.0, 61.1, 64.0, 69.0, 80.0}
_PASSED |= {94.0, 98.0, 99.0}
_MODES = {20.0, 21.0, 90.0, 91.0}


class Word(NamedTuple):
    """Where a word begins in its line, and its number begins and ends."""

    at: int
    start: int
    end: int
    value: float


class Extrusion(NamedTuple):
    """The E word of a move: its value, the one before it, and whether it counts from there."""

    word: Word
    before: float
    relative: bool


@dataclass
class Move:
    """A G0 or G1 with axis words.

    Attributes
    ----------
    line : int
        Its line, counted from 0.
    straight : bool
        G1.
    start, target : ndarray (axes,)
        In mm and deg, absolute.
    known : bool
        Whether it is known where the move begins.
    fresh : bool
        The first one, and the first after homing: the controller is not where a move ended.
    words : dict
        Its axis words by their letters.
    end : int
        Where further words go in its line.
    relative : bool
        G91.
    scale : float
        Mm of a unit of length.
    extrusion : Extrusion or None
        Its E word.
    feed : float
        Mm or deg a minute; 0 where none was stated.
    feed_word : Word or None
        Its F word.
    """

    line: int
    straight: bool
    start: FloatArray
    target: FloatArray
    known: bool
    fresh: bool
    words: dict[str, Word]
    end: int
    relative: bool
    scale: float
    extrusion: Extrusion | None
    feed: float
    feed_word: Word | None


@dataclass
class _State:
    """What a controller remembers from line to line."""

    at: FloatArray
    fresh: bool = True
    motion: float | None = None
    relative: bool = False
    scale: float = 1.0
    feed: float = 0.0
    extruded: float = 0.0
    extrusion_relative: bool | None = None
    named: set[str] = field(default_factory=set)  # lengths that were stated since it was lost


class Program:
    """The lines of a program, and its moves.

    Parameters
    ----------
    text : str
        The program.
    letters : sequence of str
        The axes that it moves, such as ``"XYZ"``.
    start : ndarray (axes,)
        Where they are at first and after homing, mm and deg.
    stated : bool
        Whether that is known of the lengths; else a program has to begin with all of them.
    place : str
        What messages call it.

    Attributes
    ----------
    lines : list of str
        Its lines with their ends.
    moves : list of Move
        Its moves.
    left : dict
        Macros and changes of tools, which may move the machine, by the line where each is first.

    Raises
    ------
    FileError
        What cannot be followed, with its line: arcs, cycles, offsets, parameters.
    """

    def __init__(
        self, text: str, letters: Sequence[str], start: FloatArray, stated: bool, place: str
    ) -> None:
        self.lines = lines_of(text)
        self.moves: list[Move] = []
        self.left: dict[str, int] = {}
        self._letters = letters
        self._start = start
        self._stated = stated
        self._lengths = set() if stated else set("XYZ") & set(letters)
        self._place = place
        state = _State(start.copy())
        for i, line in enumerate(self.lines):
            self._read(i, line, state)

    def wrong(self, line: int, message: str) -> FileError:
        """What is wrong with a line, counted from 0."""
        return FileError(f"{self._place}, line {line + 1}: {message}")

    def _read(self, i: int, line: str, state: _State) -> None:
        code = _REMARK.sub(lambda found: " " * len(found[0]), line.rstrip("\r\n"))
        code = code.replace(MARK, " ", 1) if i == 0 else code
        if _MESSAGE.match(code):
            return
        if offset := _OFFSET.match(code):
            raise self.wrong(
                i, f"{offset[1]} moves the origin, or skews axes, which cannot be followed"
            )
        if restored := _RESTORED.match(code):
            raise self.wrong(i, f"{restored[1]} restores modes, which cannot be followed")
        if block := _BLOCK.match(code):
            raise self.wrong(i, f"{block[1]}: conditions and loops cannot be followed")
        if geometry := _GEOMETRY.match(code):
            raise self.wrong(i, f"{geometry[1]} gives the controller other numbers than ROBOT has")
        if _HOMED.fullmatch(code):
            code = ""
            self._lose(state)
        if left := _MACRO.match(code) or _CHANGE.match(code):
            self.left.setdefault(left[1], i)
        if _NAMED.match(code) or not code.strip() or code.strip() == "%":
            return
        plain = _PLAIN.fullmatch(code)
        if _SETTING.match(code) and not (plain and re.search("[Gg]", code)):
            code = code if plain else ""  # a text, such as that of M117
            words = self._words(code)
            self._modes(words, state)
            return
        if _CHECKSUM.fullmatch(code):
            raise self.wrong(i, "the checksum would no longer be right: take checksums out")
        if not plain:
            raise self.wrong(i, f"{line.strip()!r:.40} is no plain G-code: words and numbers alone")
        words = self._words(code)
        axes = {letter: word for letter, word in words if letter in "XYZABCUVW"}
        self._require_one_meaning(i, words)
        codes = [word.value for letter, word in words if letter == "G"]
        for value in codes:
            self._code(i, value, axes, words, state)
        self._modes(words, state)
        if any(value in _LOST for value in codes):
            self._lose(state)
        elif 92.0 not in codes and 4.0 not in codes:
            self._move(i, axes, words, state)

    def _require_one_meaning(self, i: int, words: list[tuple[str, Word]]) -> None:
        """Refuse lines of which controllers make different things."""
        seen: set[str] = set()
        for letter, word in words:
            motion = letter == "G" and word.value in (0.0, 1.0)
            name = "G0 or G1" if motion else letter
            if name in seen and name not in ("G", "M"):
                raise self.wrong(i, f"{name} stands twice in it")
            if letter == "G" and word.value in _MODES and seen & set("XYZABCUVW"):
                raise self.wrong(i, f"G{word.value:g} stands behind axis words")
            seen.add(name)

    def _lose(self, state: _State) -> None:
        """The machine was homed or probed."""
        state.at, state.fresh, state.named = self._start.copy(), True, set()

    @staticmethod
    def _words(code: str) -> list[tuple[str, Word]]:
        return [
            (found[1].upper(), Word(found.start(), *found.span(2), float(found[2])))
            for found in _WORD.finditer(code)
        ]

    @staticmethod
    def _modes(words: list[tuple[str, Word]], state: _State) -> None:
        for letter, word in words:
            if letter == "M" and word.value in (82.0, 83.0):
                state.extrusion_relative = word.value == 83.0
            if letter == "F":
                state.feed = word.value * state.scale

    def _code(
        self,
        i: int,
        value: float,
        axes: dict[str, Word],
        words: list[tuple[str, Word]],
        state: _State,
    ) -> None:
        letters = {letter for letter, _ in words}
        if value in (0.0, 1.0):
            state.motion = value
        elif value in (20.0, 21.0):
            state.scale = _INCH if value == 20.0 else 1.0
        elif value in (90.0, 91.0):
            state.relative = value == 91.0
        elif value == 92.0:
            if axes or "E" not in letters:
                raise self.wrong(i, "G92 moves the origin, which cannot be followed")
            state.extruded = next(word.value for letter, word in words if letter == "E")
        elif value not in _PASSED | _LOST:
            raise self.wrong(i, f"G{value:g} cannot be followed: lines and rapid moves alone are")
        elif value == 10.0 and letters & {"L", *axes}:
            raise self.wrong(i, "G10 sets offsets, which cannot be followed")
        elif value == 80.0:
            state.motion = None

    def _move(
        self, i: int, axes: dict[str, Word], words: list[tuple[str, Word]], state: _State
    ) -> None:
        extrusion = self._extrusion(words, state)
        if not axes:
            return
        foreign = set(axes) - set(self._letters)
        if foreign:
            letters = "".join(self._letters)
            raise self.wrong(i, f"{min(foreign)} is no axis of the robot, which has {letters}")
        if state.motion is None:
            raise self.wrong(i, "axis words without G0 or G1 before them")
        target = state.at.copy()
        for letter, word in axes.items():
            k = self._letters.index(letter)
            value = word.value * (state.scale if letter in "XYZ" else 1.0)
            target[k] = state.at[k] + value if state.relative else value
        state.named |= set(axes) if not state.relative else set()
        unknown = sorted(self._lengths - state.named)
        if unknown:
            raise self.wrong(
                i,
                f"where {' and '.join(unknown)} is, is not known here: state the pose at the start,"
                " or let the first move name X, Y and Z",
            )
        feed = next((word for letter, word in words if letter == "F"), None)
        self.moves.append(
            Move(
                line=i,
                straight=state.motion == 1.0,
                start=state.at,
                target=target,
                known=self._stated or not state.fresh,
                fresh=state.fresh,
                words=axes,
                end=max(word.end for word in axes.values()),
                relative=state.relative,
                scale=state.scale,
                extrusion=extrusion,
                feed=state.feed,
                feed_word=feed,
            )
        )
        state.at, state.fresh = target, False

    def _extrusion(self, words: list[tuple[str, Word]], state: _State) -> Extrusion | None:
        """The E word of a move; G91 makes E relative in some firmware and not in other."""
        word = next((word for letter, word in words if letter == "E"), None)
        if word is None:
            return None
        relative = bool(state.extrusion_relative)
        before = state.extruded
        if not relative:
            state.extruded = word.value
        if state.relative and state.extrusion_relative is None:
            before = np.nan  # not to be divided
        return Extrusion(word, before, relative)


def number(value: float, decimals: int) -> str:
    """A number of G-code: no more decimals than it needs."""
    text = f"{value:.{decimals}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text in ("-0", "") else text
