"""The lines of moves with other numbers in them, and those of their further parts."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.compensation.commanded_machine import CommandedMachine
from pkmcal.compensation.gcode import Program
from pkmcal.compensation.gcode_line import Unclear, require_short
from pkmcal.compensation.gcode_move import Feed, Move

_DECIMALS = 5  # 10 nm, 0.04 arc seconds
_FIGURES = 7  # of a feed
_SLOWER = 0.02  # share by which the speed of a turning machine may differ
_HALF = 0.5 * 10.0**-_DECIMALS
_LINE_ENDS = re.compile("[\r\n]+")
_Rows = Sequence[Sequence[float]]


class Writer:
    """Writes moves one after the other: it knows which numbers the controller has."""

    def __init__(self, program: Program, machine: CommandedMachine) -> None:
        self._program, self._machine = program, machine
        self._last: list[float | None] = [None] * len(machine.written)
        self._lengths = np.array([letter in "XYZ" for letter in machine.letters])
        self._only_lengths = bool(self._lengths.all())

    def lines(
        self, line: str, move: Move, points: _Rows, commands: _Rows, share: Sequence[float]
    ) -> str:
        """Return the line of a move, and lines for its further parts.

        Parameters
        ----------
        line : str
            The line of the program.
        move : Move
            What is in it.
        points, commands : sequence of sequence of float
            Where its parts end, as meant and as the controller is told.
        share : sequence of float
            The shares of the move that they end.
        """
        kept = line.rstrip("\r\n")
        end = line[len(kept) :] or "\n"
        self._require(move, len(points))
        if move.fresh is not None:
            known = list(move.fresh) if not self._machine.joints else []
            self._last = known or [None] * len(self._last)
        pieces = []
        before: Sequence[float] = move.start
        done, in_force = 0.0, move.feed
        for k, (point, command, part) in enumerate(zip(points, commands, share, strict=True)):
            last = list(self._last)
            words = self._words(move, command, first=k == 0)
            extra = self._extruded(move, done, part, len(points))
            feed, in_force = self._feed(move, before, point, last, in_force)
            pieces.append((words, extra, feed))
            before, done = point, part
        text = _first(kept, move, *pieces[0]) + end
        if move.begins_times:
            text = "G93" + end + text
        for words, extra, feed in pieces[1:]:
            named = [letter + value for letter, value in words.items()]
            text += " ".join([move.code, *named, *filter(None, [extra, feed])])
            text += move.repeated + end
        if in_force != move.feed:
            if move.behind:  # it would act before the feed that is written again: G20
                raise self._program.wrong(
                    move.line,
                    f"{move.behind} acts behind a move whose feed changes: give it another line",
                )
            head = "" if self._program.dialect.block else "G1 "
            text += f"{head}F{_figures(move.feed.turns)}" + end
        self._require_short(move, text)
        return text if len(kept) < len(line) else text[: -len(end)]

    def _require_short(self, move: Move, text: str) -> None:
        """Refuse lines that became longer than the firmware reads."""
        try:
            for each in _LINE_ENDS.split(text):
                require_short(each, self._program.dialect)
        except Unclear as error:
            raise self._program.wrong(move.line, f"as corrected: {error}") from None

    def _require(self, move: Move, parts: int) -> None:
        """Refuse what cannot be written."""
        odd = move.relative or move.scale != 1.0
        if self._machine.joints and odd:
            raise self._program.wrong(
                move.line, "joint moves are made of absolute coordinates in mm"
            )
        if self._machine.joints and move.straight and (move.per_turn or move.feed.turns <= 0.0):
            raise self._program.wrong(
                move.line, "a joint move needs the feed F of its G1, in mm a minute"
            )
        if self._machine.joints and move.straight and not move.known:
            raise self._program.wrong(
                move.line,
                "where this move begins is not known, nor how long it takes as a joint move: state"
                " the pose at the start, or make it a rapid move, G0",
            )
        if parts > 1 and move.behind:
            raise self._program.wrong(
                move.line,
                f"{move.behind} acts behind a move that is made in parts: give it another line",
            )

    def _words(self, move: Move, command: Sequence[float], first: bool) -> dict[str, str]:
        """The words of a point: those that the line has, and those that change."""
        words = {}
        joints = self._machine.joints
        for k, letter in enumerate(self._machine.written):
            scale = move.scale if letter in "XYZ" and not joints else 1.0
            value, last = round(command[k] / scale, _DECIMALS), self._last[k]
            if (
                last is not None
                and abs(last / scale - value) < _HALF
                and (joints or not first or letter not in move.words)
            ):
                continue
            if move.relative and not joints:
                shown = value - (0.0 if last is None else last / scale)
                words[letter] = number(shown, _DECIMALS)
                value = (0.0 if last is None else last / scale) + round(shown, _DECIMALS)
            else:
                words[letter] = number(value, _DECIMALS)
            self._last[k] = value * scale
        if not words:  # of a joint move that stays: no move is without
            words[self._machine.written[0]] = number(command[0], _DECIMALS)
        return words

    def _extruded(self, move: Move, done: float, part: float, count: int) -> str:
        """The E word of a part; of a move in one none, which has its own."""
        if move.extrusion is None or count == 1:
            return ""
        word, before, relative = move.extrusion
        if relative is None:
            raise self._program.wrong(
                move.line,
                "this move is made in parts, and whether E is relative is not certain: state M82 or"
                " M83 behind the last G90 or G91",
            )
        if relative:
            one, other = (number(word.value * each, _DECIMALS) for each in (part, done))
            return f"E{number(float(one) - float(other), _DECIMALS)}"
        if before is None:
            raise self._program.wrong(
                move.line,
                "this move is made in parts, and where E is before it is not known: state G92 E0",
            )
        return f"E{number(before + (word.value - before) * part, _DECIMALS)}"

    def _feed(
        self,
        move: Move,
        before: Sequence[float],
        point: Sequence[float],
        last: Sequence[float | None],
        in_force: Feed,
    ) -> tuple[str, Feed]:
        """Return the word F, the feed, of a part of a move, and the feed that is then in force.

        Of a joint move, the reciprocal of its minutes. Else none, unless the controller would take
        another time: it takes F along X, Y and Z, and along angles where none of these moves. An F
        that was written for the part before is in force like one of the program.
        """
        joints = self._machine.joints
        if not move.straight or (not joints and (self._only_lengths or None in last)):
            return "", in_force
        meant, way = self._way(np.subtract(point, before))
        rate = move.feed.lengths if meant else move.feed.turns
        if joints:
            return f"F{_figures(rate / way)}" if way else "F1000000", in_force
        step = np.array(self._last, dtype=float) - np.array(last, dtype=float)
        written, longer = self._way(step)
        taken = in_force.lengths if written else in_force.turns
        if not taken:  # at a speed of the firmware's own
            rate = taken = 1.0
        if not way or not longer or abs(longer * rate - way * taken) <= _SLOWER * way * taken:
            return "", in_force
        if move.feed.turns <= 0.0:
            raise self._program.wrong(move.line, "needs a feed F: corrected, its length changes")
        if not np.isclose(move.feed.lengths, move.feed.turns * move.scale, rtol=1e-9, atol=0.0):
            raise self._program.wrong(
                move.line,
                "its feed F was stated in other units, which changes it along X Y Z and not along"
                " angles: state F again behind G20 or G21",
            )
        stated = _figures(longer / (move.scale if written else 1.0) * rate / way)
        return f"F{stated}", Feed(float(stated) * move.scale, float(stated))

    def _way(self, step: FloatArray) -> tuple[bool, float]:
        """Tell whether a step has lengths, and its length for a feed: mm, or deg without any."""
        way = float(np.linalg.norm(step[self._lengths]))
        return way > 0.0, way or float(np.linalg.norm(step[~self._lengths]))


def _first(line: str, move: Move, words: dict[str, str], extra: str, feed: str) -> str:
    """The line of the program with other numbers in it."""
    edits = []
    end = 0
    for letter, word in move.words.items():
        end = max(end, word.end)
        new = words.get(letter)
        if new is None:  # joint moves have words of their own
            edits.append((word.at, word.end, ""))
        elif abs(float(new) - word.value) >= _HALF:  # else as it was written
            edits.append((word.start, word.end, new))
    if extra and move.extrusion is not None:
        edits.append((move.extrusion.word.start, move.extrusion.word.end, extra[1:]))
    if feed and move.feed_word is not None:
        edits.append((move.feed_word.start, move.feed_word.end, feed[1:]))
    added = "".join(f" {letter}{new}" for letter, new in words.items() if letter not in move.words)
    if feed and move.feed_word is None:
        added += " " + feed
    if added:
        edits.append((end, end, added))
    edits.sort()
    text, at = "", 0
    for start, end, new in edits:
        text += line[at:start] + new
        at = end
    return text + line[at:]


def number(value: float, decimals: int) -> str:
    """A number of G-code: no more decimals than it needs."""
    text = f"{value:.{decimals}f}"
    if decimals:
        text = text.rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _figures(value: float) -> str:
    """A number of G-code, which knows no exponent, with as many figures as a feed needs."""
    text = np.format_float_positional(
        value, precision=_FIGURES, unique=False, fractional=False, trim="-"
    )
    return str(text)
