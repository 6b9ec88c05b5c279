"""Programs in G-code for a controller that does not know the calibrated geometry."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from os import PathLike

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import flag, instance
from pkmcal.arguments import number as as_number
from pkmcal.arguments import path as as_path
from pkmcal.arrays import FloatArray, IntArray, as_rows
from pkmcal.compensation.commanded_machine import CommandedMachine
from pkmcal.compensation.gcode import Move, Program, number
from pkmcal.exceptions import ArgumentError
from pkmcal.files.reading import MOST_TEXT, content
from pkmcal.kinematics.robot import Robot, require_parallel
from pkmcal.result import Result

_DECIMALS = 5  # 10 nm, 0.04 arc seconds
_ROUNDS = 12
_MOST_PARTS = 10_000
_MOST_LEFT = 5  # of macros that are named
_INSIDE = (0.25, 0.5, 0.75)


@dataclass(frozen=True, eq=False, repr=False)
class CorrectedProgram(Result):
    """A program whose numbers bring the calibrated machine to the poses that were meant.

    Attributes
    ----------
    text : str
        The program.
    moves, segments : int
        Moves that were read, and written: long ones in parts.
    correction : float
        The largest correction of a position, mm; of joint moves, NaN.
    chord_error : float
        How far the calibrated machine leaves the straight lines between the points: the largest
        found at quarters of every segment, and where it passes a node of a drive's table. No bound:
        beside these places it may be a sixteenth more. mm, an angle as its arc at ``robot.length``.
    left : tuple of str
        Macros and changes of tools that stay as they are, with the line where each is first. What
        they move is not known: the moves behind them are taken to begin where those before ended.
    """

    text: str
    moves: int
    segments: int
    correction: float
    chord_error: float
    left: tuple[str, ...] = ()

    def _parts(self) -> Iterator[str]:
        parts = f"{self.moves} moves in {self.segments} segments"
        if np.isfinite(self.correction):
            parts += f"; corrections up to {self.correction:.3g} mm"
        yield f"{parts}; found off the straight lines by up to {self.chord_error:.2g} mm"
        if self.left:
            named = ", ".join(self.left[:_MOST_LEFT])
            more = len(self.left) - _MOST_LEFT
            named += f" and {more} more" if more > 0 else ""
            yield f"left as they are, and taken not to move the machine: {named}"


def compensate_program(
    controller: Robot,
    calibrated: Robot,
    path: str | PathLike[str],
    *,
    chord: float = 0.01,
    joints: bool = False,
    start: ArrayLike | None = None,
) -> CorrectedProgram:
    r"""Correct a program in plain G-code for a controller that has other numbers than the machine.

    The poses of its G0 and G1 become those at which the controller drives the actuators to where
    the calibrated machine has the pose that was meant. Long G1 moves are split so that the machine
    keeps to straight lines. Feed, comments, macros and all else stay as they are.

    Parameters
    ----------
    controller : Robot
        The machine as the controller computes it.
    calibrated : Robot
        The machine as it is.
    path : str or path
        The program: absolute or relative lines and rapid moves in mm or inches, X Y Z A B C as
        poses of the robot, A B C in degrees.
    chord : float
        How far the machine may be found off the straight line of a G1, as `chord_error` is, mm.
    joints : bool
        Write actuator coordinates in place of poses, as X Y Z A B C in the order of the actuators,
        mm and deg, for a controller without kinematics; feed as inverse time, G93.
    start : array_like (6,), optional
        The controller's pose when the program starts, and after homing, mm and rad. By default the
        first move has to name X, Y and Z; angles begin with those of home.

    Returns
    -------
    CorrectedProgram
        ``.text``, ``.moves``, ``.segments``, ``.correction``, ``.chord_error``.

    Raises
    ------
    ValueError
        Two machines that are not alike; what cannot be followed, such as arcs and offsets, or
        a pose that the machine does not reach, with its line.
    OSError
        The program cannot be read.

    Examples
    --------
    >>> import pkmcal as pk
    >>> import pathlib, tempfile
    >>> robot = pk.load("linear-delta")
    >>> machine = robot.replace({"rod1": 215.2})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "part.gcode")
    ...     _ = path.write_text("G1 X0 Y0 Z50 F3000 ; down\nM106 S255\n")
    ...     print(pk.compensate_program(robot, machine, path).text)
    G1 X-0.23511 Y-0.13574 Z50.07675 F3000 ; down
    M106 S255
    <BLANKLINE>
    """
    for name, robot in (("controller", controller), ("calibrated", calibrated)):
        instance(name, robot, Robot)
        require_parallel(robot)
    if (controller.coordinates, controller.actuator_units, controller.model.match) != (
        calibrated.coordinates,
        calibrated.actuator_units,
        calibrated.model.match,
    ):
        raise ArgumentError("calibrated must be the machine of the controller with other numbers")
    chord = as_number("chord", chord, above=0.0)
    place = as_path("path", path)
    data = content(path, MOST_TEXT)
    text = data.decode("utf-8", errors="surrogateescape")
    machine = CommandedMachine(controller, calibrated, flag("joints", joints))
    begin, shape = as_rows("start", controller.home if start is None else start, 6)
    if shape != ():
        raise ArgumentError(f"start must have shape (6,), found {(*shape, 6)}")
    begin = machine.shown(begin[0])
    program = Program(text, machine.letters, begin, start is not None, str(place))
    return _corrected(program, machine, chord)


def _corrected(program: Program, machine: CommandedMachine, chord: float) -> CorrectedProgram:
    moves = program.moves
    odd = next((move for move in moves if move.relative or move.scale != 1.0), None)
    if machine.joints and odd is not None:
        raise program.wrong(odd.line, "joint moves are made of absolute coordinates in mm")
    left = tuple(f"{name} (line {line + 1})" for name, line in program.left.items())
    if not moves:
        return CorrectedProgram("".join(program.lines), 0, 0, 0.0, 0.0, left)
    starts = np.array([move.start for move in moves])
    targets = np.array([move.target for move in moves])
    parts, chord_error = _parts(program, machine, starts, targets, chord)
    which = np.repeat(np.arange(len(moves)), parts)
    share = np.concatenate([np.arange(1, count + 1) / count for count in parts])
    points = starts[which] + share[:, None] * (targets - starts)[which]
    points[np.cumsum(parts) - 1] = targets
    commands = machine.command(points)
    _require(program, which, commands)
    commands = machine.continuous(commands)
    off = points - commands if not machine.joints else np.full((1, 1), np.nan)
    lengths = [k for k, letter in enumerate(machine.letters) if letter in "XYZ"]
    largest = np.nan if machine.joints else float(np.linalg.norm(off[:, lengths], axis=1).max())
    writer = _Writer(program, machine)
    lines = list(program.lines)
    at = 0
    for move, count in zip(moves, parts.tolist(), strict=True):
        rows = slice(at, at + count)
        lines[move.line] = writer.lines(move, points[rows], commands[rows], share[rows])
        at += count
    if machine.joints:
        lines.insert(0, "G93\n")
    return CorrectedProgram("".join(lines), len(moves), len(points), largest, chord_error, left)


def _require(program: Program, which: IntArray, commands: FloatArray) -> None:
    """Refuse poses without a command."""
    unreached = which[~np.isfinite(commands).all(axis=1)]
    if len(unreached):
        line = program.moves[int(unreached[0])].line
        raise program.wrong(line, "the machine does not reach a pose of this move")


def _parts(
    program: Program,
    machine: CommandedMachine,
    starts: FloatArray,
    targets: FloatArray,
    chord: float,
) -> tuple[IntArray, float]:
    """Into how many parts each move goes, and how far the machine leaves the lines then."""
    moves = program.moves
    parts = np.ones(len(moves), dtype=int)
    lines = [move.straight and move.known for move in moves]
    unsettled = np.array(lines) & (starts != targets).any(axis=1)
    worst = np.zeros(len(moves))
    for _ in range(_ROUNDS):
        rows = np.flatnonzero(unsettled)
        if not len(rows):
            return parts, float(worst.max())
        worst[rows] = _chord_errors(
            program, machine, starts[rows], targets[rows], parts[rows], rows
        )
        unsettled[rows] = worst[rows] > chord
        rows = np.flatnonzero(unsettled)
        more = np.sqrt(worst[rows] / chord) * 1.05
        parts[rows] = np.maximum(parts[rows] + 1, np.ceil(parts[rows] * more)).astype(int)
        if (parts > _MOST_PARTS).any():
            line = moves[int(np.argmax(parts))].line
            raise program.wrong(
                line, f"needs more than {_MOST_PARTS} parts for a chord of {chord:g} mm"
            )
    line = moves[int(np.flatnonzero(unsettled)[0])].line
    raise program.wrong(line, f"no number of parts keeps this move within {chord:g} mm of its line")


def _chord_errors(
    program: Program,
    machine: CommandedMachine,
    starts: FloatArray,
    targets: FloatArray,
    parts: IntArray,
    moves: IntArray,
) -> FloatArray:
    """The largest distance (moves,) from the line, at quarters and bends of every part."""
    which = np.repeat(np.arange(len(parts)), parts)
    first = np.concatenate([np.arange(count) for count in parts])

    def at(share: FloatArray) -> FloatArray:
        found: FloatArray = starts[which] + share[:, None] * (targets - starts)[which]
        return found

    ends = [at((first + k) / parts[which]) for k in (0, 1)]
    commands = [machine.command(end) for end in ends]
    for found in commands:
        _require(program, moves[which], found)
    begin, end = machine.continuous(np.stack(commands, axis=1)).swapaxes(0, 1)
    rows, shares = machine.bends(begin, end)
    rows = np.concatenate([np.tile(np.arange(len(which)), len(_INSIDE)), rows])
    shares = np.concatenate([np.repeat(_INSIDE, len(which)), shares])
    of = which[rows]
    meant = starts[of] + ((first[rows] + shares) / parts[of])[:, None] * (targets - starts)[of]
    reached = machine.reached(begin[rows] + shares[:, None] * (end - begin)[rows], meant)
    off = machine.distance(reached, meant)
    _require(program, moves[of], off[:, None])
    worst = np.zeros(len(parts))
    np.maximum.at(worst, of, off)
    return worst


class _Writer:
    """The lines of moves, one after the other: it knows which numbers the controller has."""

    def __init__(self, program: Program, machine: CommandedMachine) -> None:
        self._program, self._machine = program, machine
        self._last: list[float | None] = [None] * len(machine.written)

    def lines(self, move: Move, points: FloatArray, commands: FloatArray, share: FloatArray) -> str:
        """A move's line, and those of its further parts."""
        line = self._program.lines[move.line]
        end = line[len(line.rstrip("\r\n")) :] or "\n"
        if move.fresh:
            self._last = [None] * len(self._last)
            if not self._machine.joints:
                self._last = [float(each) for each in move.start]
        pieces = []
        before, done = move.start, 0.0
        for k, (point, command, part) in enumerate(zip(points, commands, share, strict=True)):
            words = self._words(move, command, first=k == 0)
            extra = self._extruded(move, done, part, len(points))
            timed = self._time(move, before, point) if self._machine.joints else ""
            pieces.append((words, extra, timed))
            before, done = point, float(part)
        text = self._first(move, line.rstrip("\r\n"), *pieces[0]) + end
        head = "G1" if move.straight else "G0"
        for words, extra, timed in pieces[1:]:
            named = [letter + value for letter, value in words.items()]
            text += " ".join([head, *named, *filter(None, [extra, timed])]) + end
        return text if line.endswith(("\n", "\r")) else text[: -len(end)]

    def _words(self, move: Move, command: FloatArray, first: bool) -> dict[str, str]:
        """The words of a point: those that the line has, and those that change."""
        words = {}
        for k, letter in enumerate(self._machine.written):
            scale = move.scale if letter in "XYZ" and not self._machine.joints else 1.0
            value = round(float(command[k]) / scale, _DECIMALS)
            last = self._last[k]
            known = last is not None and abs(last / scale - value) < 0.5 * 10.0**-_DECIMALS
            if known and not (first and letter in move.words and not self._machine.joints):
                continue
            if move.relative and not self._machine.joints:
                shown = value - (0.0 if last is None else last / scale)
                words[letter] = number(shown, _DECIMALS)
                value = (0.0 if last is None else last / scale) + round(shown, _DECIMALS)
            else:
                words[letter] = number(value, _DECIMALS)
            self._last[k] = value * scale
        return words

    def _extruded(self, move: Move, done: float, part: float, count: int) -> str:
        """The E word of a part."""
        if move.extrusion is None:
            return ""
        word, before, relative = move.extrusion
        if count == 1:
            return f"E{self._program.lines[move.line][word.start : word.end]}"
        if np.isnan(before):
            raise self._program.wrong(
                move.line, "E after G91 without M82 or M83 can mean two things; state one of them"
            )
        if relative:
            one, other = (number(word.value * each, _DECIMALS) for each in (part, done))
            return f"E{number(float(one) - float(other), _DECIMALS)}"
        return f"E{number(before + (word.value - before) * part, _DECIMALS)}"

    def _time(self, move: Move, before: FloatArray, point: FloatArray) -> str:
        """The feed of a joint move: the reciprocal of its minutes."""
        if not move.straight:
            return ""
        if not move.feed:
            raise self._program.wrong(move.line, "a joint move needs the feed F of its G1")
        lengths = np.array([letter in "XYZ" for letter in self._machine.letters])
        way = float(np.linalg.norm((point - before)[lengths]))
        way = way or float(np.linalg.norm((point - before)[~lengths]))
        return f"F{number(move.feed / way, _DECIMALS)}" if way else "F1000000"

    def _first(self, move: Move, line: str, words: dict[str, str], extra: str, timed: str) -> str:
        """The line of the program with other numbers in it."""
        edits = []
        for letter, word in move.words.items():
            if letter in words and abs(float(words[letter]) - word.value) < 0.5 * 10.0**-_DECIMALS:
                continue  # as it was written
            if letter in words:
                edits.append((word.start, word.end, words[letter]))
            else:  # joint moves have words of their own
                edits.append((word.at, word.end, ""))
        if move.extrusion is not None:
            edits.append((move.extrusion.word.start, move.extrusion.word.end, extra[1:]))
        if timed and move.feed_word is not None:
            edits.append((move.feed_word.start, move.feed_word.end, timed[1:]))
        added = [letter + value for letter, value in words.items() if letter not in move.words]
        added += [timed] if timed and move.feed_word is None else []
        edits.append((move.end, move.end, "".join(" " + word for word in added)))
        for start, end, new in sorted(edits, reverse=True):
            line = line[:start] + new + line[end:]
        return line
