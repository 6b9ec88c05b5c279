"""A program that is corrected piece by piece, so that long ones need little memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.compensation.chord_errors import ChordErrors, counted, slices
from pkmcal.compensation.commanded_machine import CommandedMachine
from pkmcal.compensation.gcode import Program
from pkmcal.compensation.gcode_move import Move
from pkmcal.compensation.gcode_writer import Writer

_LINES = 4096  # that are in memory
_Lines = Sequence[tuple[str, Move | None]]


class Pieces:
    """The pieces of a corrected program, in turn, and what is known when all are out.

    Attributes
    ----------
    moves, segments : int
        Moves that were read, and written.
    correction : float
        The largest correction of a position, mm; of joint moves, NaN.
    lowest_meant, lowest : float
        The lowest Z of the program and of the commands, mm; of joint moves, and without Z, NaN.
    beyond : int
        Ends of segments at which the calibrated machine breaks a limit that its file states.
    beyond_line : int or None
        The line of the first, counted from 1.
    chord_error : float
        The largest distance from a straight line that was found, mm.
    """

    def __init__(self, program: Program, machine: CommandedMachine, chord: float) -> None:
        self.moves = self.segments = 0
        self.correction = np.nan if machine.joints else 0.0
        self.lowest_meant = self.lowest = np.nan
        self.beyond = 0
        self.beyond_line: int | None = None
        self.chord_error = 0.0
        self._program, self._machine = program, machine
        self._errors = ChordErrors(program, machine, chord)
        self._writer = Writer(program, machine)
        self._last: FloatArray | None = None  # the command before

    def __iter__(self) -> Iterator[str]:
        lines = self._program.read()
        while some := list(islice(lines, _LINES)):
            moves = [move for _, move in some if move is not None]
            parts, chord_error = self._errors.parts(moves)
            self.chord_error = max(self.chord_error, chord_error)
            at = 0
            for rows in slices(parts):
                last = rows.stop == len(moves)
                size = len(some) if last else _lines_of(some, at, rows.stop - rows.start)
                yield self._piece(some[at:size], moves[rows], parts[rows])
                at = size
            if not moves:
                yield "".join(line for line, _ in some)

    def _piece(self, lines: _Lines, moves: Sequence[Move], parts: IntArray) -> str:
        """Lines, their moves in so many parts."""
        share = (counted(parts) + 1.0) / np.repeat(parts, parts)
        which = np.repeat(np.arange(len(moves)), parts)
        starts = np.array([move.start for move in moves])
        targets = np.array([move.target for move in moves])
        points = starts[which] + share[:, None] * (targets - starts)[which]
        points[np.cumsum(parts) - 1] = targets
        commands = self._commands(moves, which, points)
        self.moves, self.segments = self.moves + len(moves), self.segments + len(points)
        self._compare(points, commands)
        broken = which[~self._machine.keeps_limits(points)]
        self.beyond += len(broken)
        if len(broken) and self.beyond_line is None:
            self.beyond_line = moves[int(broken[0])].line + 1
        text, at, told = [], 0, commands.tolist()
        meant, shares = points.tolist(), share.tolist()
        counts = iter(parts.tolist())
        for line, move in lines:
            if move is not None:
                rows = slice(at, at + next(counts))
                at = rows.stop
                line = self._writer.lines(line, move, meant[rows], told[rows], shares[rows])
            text.append(line)
        return "".join(text)

    def _commands(self, moves: Sequence[Move], which: IntArray, points: FloatArray) -> FloatArray:
        """Return the commands for points, continuing from the command before."""
        carried = np.array([move.carried for move in moves], dtype=np.intp)
        commands = self._machine.command(points, carried[which])
        unreached = which[~np.isfinite(commands).all(axis=1)]
        if len(unreached):
            raise self._errors.unreached(moves[int(unreached[0])])
        before = [] if self._last is None else [self._last]
        commands = self._machine.continuous(np.vstack([*before, commands]))[len(before) :]
        self._last = commands[-1]
        return commands

    def _compare(self, points: FloatArray, commands: FloatArray) -> None:
        """Note the largest correction of a position, and the lowest ones."""
        if self._machine.joints:
            return
        lengths = [k for k, letter in enumerate(self._machine.letters) if letter in "XYZ"]
        off = np.linalg.norm((points - commands)[:, lengths], axis=1)
        self.correction = max(self.correction, float(off.max()))
        if "Z" in self._machine.letters:
            k = self._machine.letters.index("Z")
            self.lowest_meant = float(np.fmin(self.lowest_meant, points[:, k].min()))
            self.lowest = float(np.fmin(self.lowest, commands[:, k].min()))


def _lines_of(lines: _Lines, at: int, moves: int) -> int:
    """Return the line behind which so many moves are complete."""
    while moves:
        moves -= lines[at][1] is not None
        at += 1
    return at
