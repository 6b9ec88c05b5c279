"""Deviations of a machine from the straight lines of a program, and division of its moves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.compensation.commanded_machine import CommandedMachine
from pkmcal.compensation.gcode import Program
from pkmcal.compensation.gcode_move import Move
from pkmcal.exceptions import FileError

_ROUNDS = 12
_MOST_PARTS = 10_000
_POINTS = 50_000  # that are in memory
_INSIDE = (0.25, 0.5, 0.75)


class ChordErrors:
    """Parts of moves that keep within a chord of their lines."""

    def __init__(self, program: Program, machine: CommandedMachine, chord: float) -> None:
        self._program, self._machine, self._chord = program, machine, chord

    def unreached(self, move: Move) -> FileError:
        """Describe why a move has no command."""
        return self._program.wrong(move.line, "the machine does not reach a pose of this move")

    def parts(self, moves: Sequence[Move]) -> tuple[IntArray, float]:
        """Into how many parts each move goes, and how far the machine leaves the lines then.

        Raises
        ------
        FileError
            A pose out of reach, or a line that no number of parts keeps, with its line.
        """
        parts = np.ones(len(moves), dtype=int)
        worst = np.zeros(len(moves))
        unsettled = np.array(
            [each.straight and each.known and each.start != each.target for each in moves],
            dtype=bool,
        )
        for _ in range(_ROUNDS):
            rows = np.flatnonzero(unsettled)
            if not len(rows):
                return parts, float(worst.max(initial=0.0))
            for some in slices(parts[rows]):
                each = rows[some]
                worst[each] = self._of([moves[k] for k in each], parts[each])
            unsettled[rows] = worst[rows] > self._chord
            rows = np.flatnonzero(unsettled)
            more = np.sqrt(worst[rows] / self._chord) * 1.05
            parts[rows] = np.maximum(parts[rows] + 1, np.ceil(parts[rows] * more)).astype(int)
            if (parts > _MOST_PARTS).any():
                raise self._program.wrong(
                    moves[int(np.argmax(parts))].line,
                    f"needs more than {_MOST_PARTS} parts for a chord of {self._chord:g} mm",
                )
        raise self._program.wrong(
            moves[int(np.flatnonzero(unsettled)[0])].line,
            f"no number of parts keeps this move within {self._chord:g} mm of its line",
        )

    def _of(self, moves: Sequence[Move], parts: IntArray) -> FloatArray:
        """The largest distance (moves,) from the line, at quarters and bends of every part."""
        machine = self._machine
        starts = np.array([move.start for move in moves])
        ways = np.array([move.target for move in moves]) - starts
        which = np.repeat(np.arange(len(parts)), parts)
        first = counted(parts)
        carried = np.array([move.carried for move in moves], dtype=np.intp)[which]

        def at(share: FloatArray) -> FloatArray:
            found: FloatArray = starts[which] + share[:, None] * ways[which]
            return found

        ends = [at((first + k) / parts[which]) for k in (0, 1)]
        commands = [machine.command(end, carried) for end in ends]
        for found in commands:
            self._require(moves, which, found)
        begin, end = machine.continuous(np.stack(commands, axis=1)).swapaxes(0, 1)
        rows, shares = machine.bends(begin, end)
        rows = np.concatenate([np.tile(np.arange(len(which)), len(_INSIDE)), rows])
        shares = np.concatenate([np.repeat(_INSIDE, len(which)), shares])
        of = which[rows]
        meant = starts[of] + ((first[rows] + shares) / parts[of])[:, None] * ways[of]
        reached = machine.reached(
            begin[rows] + shares[:, None] * (end - begin)[rows], meant, carried[rows]
        )
        off = machine.distance(reached, meant)
        self._require(moves, of, off[:, None])
        worst = np.zeros(len(parts))
        np.maximum.at(worst, of, off)
        return worst

    def _require(self, moves: Sequence[Move], which: IntArray, found: FloatArray) -> None:
        """Refuse poses that are not reached."""
        unreached = which[~np.isfinite(found).all(axis=1)]
        if len(unreached):
            raise self.unreached(moves[int(unreached[0])])


def counted(parts: IntArray) -> IntArray:
    """0, 1, … of each move, one for each of its parts."""
    found: IntArray = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    return found


def slices(parts: IntArray) -> Iterator[slice]:
    """Moves in turn, as many at once as have not too many parts."""
    begin = total = 0
    for k, count in enumerate(parts.tolist()):
        if k > begin and total + count > _POINTS:
            yield slice(begin, k)
            begin, total = k, 0
        total += count
    if len(parts):
        yield slice(begin, len(parts))
