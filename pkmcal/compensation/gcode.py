"""Plain G-code: the moves of a program, line by line, as one firmware reads them.

Own code, for what is not a move has to stay to the character, and what cannot be followed has to be
refused with its line: readers of G-code that are published lose one or the other.
"""

from __future__ import annotations

import io
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from pkmcal.arrays import FloatArray
from pkmcal.compensation.gcode_dialect import AXES, NEVER_PASSED, Dialect, Meaning
from pkmcal.compensation.gcode_line import Command, Unclear, Word, bare, commands
from pkmcal.compensation.gcode_move import NO_FEED, Extrusion, Feed, Move
from pkmcal.compensation.gcode_tools import Carried, Tools
from pkmcal.exceptions import ArgumentError, FileError
from pkmcal.files.text_lines import MARK
from pkmcal.files.units import INCH

_HOMING, _TOOL = "homing", "a change of tool"  # what messages call them


@dataclass
class _State:
    """The state of a controller from line to line.

    Attributes
    ----------
    known : set of str
        Axes of which it is known where they are.
    lost_by : str
        The word behind which that is not known.
    code : str
        The last of G0 and G1; empty before them and behind G80.
    own, last : bool or None
        M83; whether the last of G90, G91, M82 and M83 was G91 or M83.
    timed : bool
        Whether moves state their times.
    carried : Carried
        The tool.
    """

    at: tuple[float, ...]
    known: set[str]
    lost_by: str = ""
    fresh: bool = True
    code: str = ""
    relative: bool = False
    scale: float = 1.0
    feed: Feed = NO_FEED
    per_turn: bool = False
    extruded: float | None = None
    own: bool | None = None
    last: bool | None = None
    timed: bool = False
    carried: Carried = field(default_factory=Carried)


class Program:
    """A program as a firmware reads it.

    Parameters
    ----------
    content : bytes
        The program.
    place : str
        What messages call it.
    dialect : Dialect
        The firmware.
    letters : sequence of str
        The axes that it moves, such as ``"XYZ"``.
    start : ndarray (axes,)
        Where they are at first, mm and deg.
    home : ndarray (axes,)
        Their angles after homing, which are taken to be known where those at first are the same.
    stated : bool
        Whether that is known of the lengths; else a program has to begin with all of them.
    passed : collection of str
        Words that move nothing and change no mode, as the user says; of refused words, that they
        do not what they are refused for.
    times : bool
        Whether moves are to state their times: G94 becomes G93.
    tools : mapping of int to int, optional
        Which load each tool is; its changes are followed where there are any.

    Attributes
    ----------
    dialect : Dialect
        The firmware.
    left : dict
        Words that may move the machine, by the line where each is first.

    Raises
    ------
    ArgumentError
        A word that cannot be passed.
    """

    def __init__(
        self,
        content: bytes,
        place: str,
        dialect: Dialect,
        letters: Sequence[str],
        start: FloatArray,
        home: FloatArray,
        stated: bool,
        passed: Collection[str] = (),
        times: bool = False,
        tools: Mapping[int, int] | None = None,
    ) -> None:
        self.left: dict[str, int] = {}
        self.dialect = dialect
        self._content, self._place = content, place
        self._letters, self._stated = tuple(letters), stated
        self._start = tuple(map(float, start))
        self._homed = {
            letter
            for letter, first, homed in zip(letters, start, home, strict=True)
            if letter in "ABC" and first == homed
        }
        self._passed = frozenset(name.upper() for name in passed)
        self._times = times
        self._tools = Tools(dialect, tools or {})
        for name in sorted(self._passed):
            if dialect.words.get(name) in NEVER_PASSED:
                raise ArgumentError(
                    f"passed: {name} is a word of {dialect.title} that cannot be passed"
                )

    def wrong(self, line: int, message: str) -> FileError:
        """Return an error about a line, counted from 0."""
        return FileError(f"{self._place}, line {line + 1}: {message}")

    def read(self) -> Iterator[tuple[str, Move | None]]:
        """Read the program's lines with their ends, each with its move.

        Raises
        ------
        FileError
            What cannot be followed, with its line: arcs, cycles, offsets, parameters.
        """
        known = {each for each in self._letters if self._stated or each in "ABC"}
        state = _State(self._start, known)
        marked: bool | None = None  # whether the program begins with %
        marks, end, ending = 0, "", "\n"
        lines = io.TextIOWrapper(
            io.BytesIO(self._content), "utf-8", errors="surrogateescape", newline=""
        )
        for i, line in enumerate(lines):
            if line.endswith("\r") and self.dialect.newlines:
                raise self.wrong(i, f"{self.dialect.title} ends no line at a carriage return alone")
            if "\0" in line:
                raise self.wrong(i, "has a zero byte, at which controllers end a line: no text")
            code = line.rstrip("\r\n")
            if code.startswith(MARK) and i == 0:
                code = code[1:]
                if bare(code, self.dialect).strip():
                    raise self.wrong(
                        i,
                        "a byte-order mark stands before it, and it may not be read: save it"
                        " without",
                    )
            marked = code.strip() == "%" if marked is None and code.strip() else marked
            if code.strip() == "%" and self.dialect.block:
                marks += bool(marked)
                yield from self._end_of_times(state, line)
            if marks < 2:  # what stands behind the second is not executed
                try:
                    line, move = self._line(i, line, code, state)
                except Unclear as error:
                    raise self.wrong(i, str(error)) from None
            yield line, move if marks < 2 else None
            end = line[len(line.rstrip("\r\n")) :]
            ending = end or ending
        if state.timed and not end:
            yield ending, None
        yield from self._end_of_times(state, ending)

    @staticmethod
    def _end_of_times(state: _State, line: str) -> Iterator[tuple[str, None]]:
        """G94 behind the last move: no controller is left in G93."""
        if state.timed:
            state.timed = False
            yield "G94" + (line[len(line.rstrip("\r\n")) :] or "\n"), None

    def _line(self, i: int, line: str, code: str, state: _State) -> tuple[str, Move | None]:
        """A line as it is to be written, and its move."""
        moves, found = [], list(commands(code, self.dialect))
        if self.dialect.block:
            self._require_feed_of_units(found, state)
        macro = ""
        for command in self._tools.in_order(found):
            meaning = self._meaning(command)
            changes = self._tools.changes(command, state.carried)
            if self._times and command.name == "G96":
                raise Unclear("G96 turns the spindle by X, which is a joint in a joint move")
            if changes:
                meaning = Meaning.MOVES
            if macro and meaning is not Meaning.HARMLESS:
                raise Unclear(
                    f"behind {macro}, {command.shown} may not be executed: break the line"
                )
            if meaning in (Meaning.HOMES, Meaning.MOVES) and not self.dialect.block:
                macro = command.shown
            if meaning is Meaning.HOMES:
                self._home(state)
            elif meaning is Meaning.MOVES:
                self.left.setdefault(command.shown.upper(), i)
                state.known, state.fresh, state.extruded = set(), True, None
                state.lost_by = _TOOL if changes else command.shown.upper()
            elif meaning is Meaning.FOLLOWED and command.name in ("", "G0", "G1"):
                moves += self._move(i, command, state)
            elif meaning is Meaning.FOLLOWED:
                self._mode(command, state)
                if self._times and command.name == "G94" and command.number is not None:
                    at = command.number.start
                    line = line[:at] + line[at:].replace("94", "93", 1)
                    state.timed = True
        if len(moves) > 1:
            raise Unclear("two moves stand in it: give each a line of its own")
        return line, moves[0] if moves else None

    @staticmethod
    def _require_feed_of_units(found: Sequence[Command], state: _State) -> None:
        """Refuse F beside a change of units, before which it acts in a block."""
        scales = {"G20": INCH, "G21": 1.0}
        changes = any(scales.get(each.name, state.scale) != state.scale for each in found)
        if changes and any("F" in (each.words or {}) for each in found):
            raise Unclear(
                "F beside a change of units is of those before: give it a line of its own"
            )

    def _meaning(self, command: Command) -> Meaning:
        """Return the meaning of a command for the poses of this program."""
        meaning = self.dialect.meaning(command.name, command.letters)
        if not command.name or meaning is Meaning.FOLLOWED:
            return Meaning.FOLLOWED
        shown = command.shown.upper()
        axes = command.letters & AXES
        if {command.name, shown} & self._passed:  # what is refused may move the machine, too
            return Meaning.MOVES if meaning is not None and meaning.refused else Meaning.HARMLESS
        if meaning is not None and meaning.refused:
            unless = "" if meaning in NEVER_PASSED else f"; if not here: --pass {shown}"
            raise Unclear(f"{command.shown} {meaning.value}{unless}")
        base = command.name.partition(".")[0]
        whole = self.dialect.words.get(base)
        if meaning is None and whole is not None and (whole.refused or whole is Meaning.FOLLOWED):
            raise Unclear(f"{shown} may be read as {base}")
        if meaning is None and axes:
            raise Unclear(
                f"{shown} has axis letters and is none of {self.dialect.title}'s listed words;"
                f" if it moves nothing and changes no mode: --pass {shown}"
            )
        if meaning is Meaning.MOVES and axes and self.dialect.block:
            raise Unclear(f"{shown} with axis words goes by a point that is not corrected")
        return meaning or Meaning.MOVES

    def _home(self, state: _State) -> None:
        """Forget the pose: but for angles, only the controller's configuration says where it is."""
        state.at, state.fresh, state.lost_by = self._start, True, _HOMING
        state.known = set(self._homed)

    @staticmethod
    def _mode(command: Command, state: _State) -> None:
        name, words = command.name, command.words or {}
        if name == "G92" and set(words) != {"E"}:
            raise Unclear("G92 moves the origin, which cannot be followed")
        if name == "G92":
            state.extruded = words["E"].value
        elif words:
            raise Unclear(f"{min(words)} is no word of {command.shown}")
        elif name in ("G20", "G21"):
            state.scale = INCH if name == "G20" else 1.0
            state.extruded = None  # it is of the units before
        elif name in ("G90", "G91"):
            state.relative = state.last = name == "G91"
        elif name in ("M82", "M83"):
            state.own = state.last = name == "M83"
        elif name in ("G94", "G95"):
            state.per_turn = name == "G95"
        elif name == "G80":
            state.code = ""
        elif name in ("M2", "M30"):
            state.timed = False

    def _move(self, i: int, command: Command, state: _State) -> list[Move]:
        """The move of a G0 or G1, or of words alone; none if no axis moves."""
        words = command.words or {}
        axes = {letter: words[letter] for letter in words if letter in AXES}
        unknown = words.keys() - axes.keys() - self.dialect.letters
        if not command.name and (axes or not self.dialect.block):
            if not state.code or not self.dialect.block:
                raise Unclear("axis words without G0 or G1 before them")
        elif command.name:
            state.code = command.name
        if unknown:
            raise Unclear(f"{min(unknown)} is no word of {command.shown} that is followed")
        feed = words.get("F")
        if feed is not None:
            state.feed = Feed(feed.value * state.scale, feed.value)
        extrusion = self._extrusion(words.get("E"), state)
        if not axes:
            if state.timed and command.name == "G1" and feed is None:
                raise Unclear("as a joint move, G1 needs axis words or F: take it out")
            return []
        start, known = state.at, state.known.issuperset(self._letters)
        fresh = self._fresh(state)
        state.at = self._target(axes, state)
        begins_times = self._times and not state.timed
        state.fresh, state.timed = False, self._times
        return [
            Move(
                line=i,
                code=state.code,
                straight=state.code == "G1" or self.dialect.rapid_lines,
                start=start,
                target=state.at,
                known=known and (self._stated or fresh is None),
                fresh=fresh,
                words=axes,
                relative=state.relative,
                scale=state.scale,
                extrusion=extrusion,
                feed=state.feed,
                feed_word=feed,
                per_turn=state.per_turn,
                begins_times=begins_times,
                behind=command.behind,
                repeated=self._repeated(words),
                carried=state.carried.load,
            )
        ]

    def _repeated(self, words: dict[str, Word]) -> str:
        """The words that each part of a move has to state."""
        if self.dialect.repeated.isdisjoint(words):
            return ""
        stated = sorted(self.dialect.repeated & words.keys())
        return "".join(f" {letter}{words[letter].value:.15g}" for letter in stated)

    def _fresh(self, state: _State) -> tuple[float | None, ...] | None:
        """Return the controller's position where it is not the end of a move."""
        if not state.fresh:
            return None
        return tuple(
            value if letter in state.known else None
            for letter, value in zip(self._letters, state.at, strict=True)
        )

    def _target(self, axes: dict[str, Word], state: _State) -> tuple[float, ...]:
        """Return the end of a move."""
        if not state.known.issuperset(self._letters):
            if not state.relative:
                state.known |= axes.keys()
            self._require_known(state)
        target = list(state.at)
        for letter, word in axes.items():
            if letter not in self._letters:
                letters = "".join(self._letters)
                raise Unclear(f"{letter} is no axis of the robot, which has {letters}")
            k = self._letters.index(letter)
            value = word.value * (state.scale if letter in "XYZ" else 1.0)
            target[k] = target[k] + value if state.relative else value
        return tuple(target)

    def _require_known(self, state: _State) -> None:
        """Refuse a move from where it is not known that an axis is."""
        unknown = [letter for letter in self._letters if letter not in state.known]
        if not unknown:
            return
        where = f"where {' and '.join(unknown)} is, is not known here"
        if state.lost_by:
            passed = f"; if it moves nothing and changes no mode: --pass {state.lost_by}"
            unless = "" if {state.lost_by} & {_HOMING, _TOOL, *self._passed} else passed
            raise Unclear(f"{where}, behind {state.lost_by}: name all axes{unless}")
        raise Unclear(
            f"{where}: state the pose at the start, or let the first move name X, Y and Z"
        )

    def _extrusion(self, word: Word | None, state: _State) -> Extrusion | None:
        """The E word of a move, as far as all versions of the firmware agree about it."""
        if word is None:
            return None
        relative = self.dialect.e_is_relative(state.own, state.relative, state.last)
        before = state.extruded
        if relative is False:
            state.extruded = word.value
        elif relative and before is not None and self.dialect.adds_relative:
            state.extruded = before + word.value
        else:
            state.extruded = None
        return Extrusion(word, before, relative)
