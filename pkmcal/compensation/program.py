"""Programs in G-code for a controller that does not know the calibrated geometry."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import flag, instance, whole, word, words
from pkmcal.arguments import number as as_number
from pkmcal.arguments import path as as_path
from pkmcal.arrays import as_rows
from pkmcal.compensation.commanded_machine import CommandedMachine
from pkmcal.compensation.gcode import Program
from pkmcal.compensation.gcode_dialect import Dialect
from pkmcal.compensation.program_pieces import Pieces
from pkmcal.compensation.words_of_klipper import KLIPPER
from pkmcal.compensation.words_of_linuxcnc import LINUXCNC
from pkmcal.compensation.words_of_marlin import MARLIN
from pkmcal.compensation.words_of_reprap import REPRAP
from pkmcal.exceptions import ArgumentError
from pkmcal.files.atomic import write_pieces
from pkmcal.files.reading import MOST_TEXT, content
from pkmcal.geometry.carried import Load
from pkmcal.kinematics.robot import Robot, require_parallel
from pkmcal.result import Result

GcodeFirmware = Literal["linuxcnc", "marlin", "reprap", "klipper"]

_DIALECTS: dict[GcodeFirmware, Dialect] = {
    "linuxcnc": LINUXCNC,
    "marlin": MARLIN,
    "reprap": REPRAP,
    "klipper": KLIPPER,
}
_MOST_LEFT = 5  # of macros that are named


@dataclass(frozen=True, eq=False, repr=False)
class CorrectedProgram(Result):
    """A program whose numbers bring the calibrated machine to the poses that were meant.

    Attributes
    ----------
    text : str
        The program; empty if it was written to a file.
    moves, segments : int
        Moves that were read, and written: long ones in parts.
    correction : float
        The largest correction of a position, mm; of joint moves, NaN.
    chord_error : float
        How far the calibrated machine leaves the straight lines between the points: the largest
        found at quarters of every segment, and where it passes a node of a drive's table. No bound:
        beside these places it may be a sixteenth more. mm, an angle as its arc at ``robot.length``.
    lowest_meant, lowest : float
        The lowest Z of the program and of the commands, mm; of joint moves, and without Z, NaN. A
        firmware that keeps to limits of its own, as Marlin and RepRapFirmware do without a word,
        has to allow the latter.
    beyond : int
        Ends of segments at which the calibrated machine breaks a limit that its file states, such
        as the stroke of a limb.
    beyond_line : int or None
        The line of the first of them.
    left : tuple of str
        Macros, changes of tools and words that the firmware's table has not, with the line where
        each is first. They stay as they are. What they move is not known: the next move behind each
        names all axes.
    """

    text: str
    moves: int
    segments: int
    correction: float
    chord_error: float
    lowest_meant: float
    lowest: float
    beyond: int = 0
    beyond_line: int | None = None
    left: tuple[str, ...] = ()

    def _parts(self) -> Iterator[str]:
        parts = f"{self.moves} moves in {self.segments} segments"
        if np.isfinite(self.correction):
            parts += f"; corrections up to {self.correction:.3g} mm"
        yield f"{parts}; found off the straight lines by up to {self.chord_error:.2g} mm"
        if self.lowest < 0.0 <= self.lowest_meant:
            yield (
                f"commands go down to Z{self.lowest:.5f}, the program to Z{self.lowest_meant:.5f}:"
                " the controller's limit has to be below"
            )
        if self.beyond:
            yield (
                f"{self.beyond} ends of segments are beyond limits of the calibrated machine, the"
                f" first in line {self.beyond_line}"
            )
        if self.left:
            named = ", ".join(self.left[:_MOST_LEFT])
            more = len(self.left) - _MOST_LEFT
            named += f" and {more} more" if more > 0 else ""
            yield f"left as they are, and may move the machine: {named}"


def compensate_program(
    controller: Robot,
    calibrated: Robot,
    path: str | PathLike[str],
    *,
    firmware: GcodeFirmware,
    chord: float = 0.01,
    joints: bool = False,
    start: ArrayLike | None = None,
    passed: Sequence[str] = (),
    loads: Mapping[int, Load] | None = None,
    out: str | PathLike[str] | None = None,
) -> CorrectedProgram:
    r"""Correct a program in plain G-code for a controller that has other numbers than the machine.

    The poses of its G0 and G1 become those at which the controller drives the actuators to where
    the calibrated machine has the pose that was meant. Long G1 moves, and G0 of printers, are split
    so that the machine keeps to straight lines. Feed, comments, macros and all else stay.

    Parameters
    ----------
    controller : Robot
        The machine as the controller computes it.
    calibrated : Robot
        The machine as it is.
    path : str or path
        The program: absolute or relative lines and rapid moves in mm or inches, X Y Z A B C as
        poses of the robot, A B C in degrees.
    firmware : {"linuxcnc", "marlin", "reprap", "klipper"}
        What reads the program: words mean different things to different controllers.
    chord : float
        How far the machine may be found off the straight line of a move, as `chord_error` is, mm.
    joints : bool
        Write actuator coordinates in place of poses, as X Y Z A B C in the order of the actuators,
        mm and deg, for a LinuxCNC without kinematics; feed as inverse time, G93.
    start : array_like (6,), optional
        The controller's pose when the program starts, mm and rad. By default the first move has to
        name X, Y and Z, as has the first behind homing; angles begin with those of home. Behind
        homing a move has to name angles that did not begin so.
    passed : sequence of str
        Macros and other words, such as ``"PARK"``, that move nothing and change no mode; or
        refused words, such as ``"M420"``, that here do not what they are refused for: the next move
        behind each names all axes.
    loads : mapping of int to Load, optional
        What a calibrated machine that yields carries with each tool, by the number behind T, in
        place of the payload that its file states and that it carries before the first change of
        tool. Behind each change the next move names all axes. A macro is taken to change no tool.
    out : str or path, optional
        Where to write the program, piece by piece, in place of `text`; it is there as a whole or
        not at all.

    Returns
    -------
    CorrectedProgram
        ``.text``, ``.moves``, ``.segments``, ``.correction``, ``.chord_error``, ``.lowest``.

    Raises
    ------
    ValueError
        Two machines that are not alike; what cannot be followed, such as arcs and offsets, or
        a pose that the machine does not reach, with its line.
    OSError
        The program cannot be read, or `out` not be written.

    Examples
    --------
    >>> import pkmcal as pk
    >>> import pathlib, tempfile
    >>> robot = pk.load("linear-delta")
    >>> machine = robot.replace({"rod1": 215.2})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "part.gcode")
    ...     _ = path.write_text("G1 X0 Y0 Z50 F3000 ; down\nM106 S255\n")
    ...     print(pk.compensate_program(robot, machine, path, firmware="marlin").text)
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
    dialect = _DIALECTS[word("firmware", firmware, get_args(GcodeFirmware))]
    chord = as_number("chord", chord, above=0.0)
    place = as_path("path", path)
    if flag("joints", joints) and not dialect.inverse_time:
        raise ArgumentError(f"joints: {dialect.title} has no inverse time feed, G93")
    carried = _loads(calibrated, loads)
    begin, shape = as_rows("start", controller.home if start is None else start, 6)
    if shape != ():
        raise ArgumentError(f"start must have shape (6,), found {(*shape, 6)}")
    machine = CommandedMachine(controller, calibrated, joints, list(carried.values()))
    program = Program(
        content(path, MOST_TEXT),
        str(place),
        dialect,
        machine.letters,
        machine.shown(begin[0]),
        machine.shown(controller.home),
        stated=start is not None,
        passed=words("passed", passed),
        times=joints,
        tools={tool: k for k, tool in enumerate(carried) if tool is not None},
    )
    pieces = Pieces(program, machine, chord)
    if out is None:
        text = "".join(pieces)
    else:
        text = ""
        write_pieces(out, (piece.encode("utf-8", errors="surrogateescape") for piece in pieces))
    left = tuple(f"{name} (line {line + 1})" for name, line in program.left.items())
    return CorrectedProgram(
        text,
        pieces.moves,
        pieces.segments,
        pieces.correction,
        pieces.chord_error,
        pieces.lowest_meant,
        pieces.lowest,
        pieces.beyond,
        pieces.beyond_line,
        left,
    )


def _loads(robot: Robot, loads: Mapping[int, Load] | None) -> dict[int | None, Load]:
    """The loads of a program's tools, behind what is carried before; none where none is stated."""
    if not loads:
        return {}
    found: dict[int | None, Load] = {None: Load.stated(dict(robot.geometry.items()))}
    for tool, load in loads.items():
        whole("loads: the number of a tool", tool, 0)
        robot.under(instance(f"loads: that of tool {tool}", load, Load))  # refuses
        load.rows(())
        found[tool] = load
    return found
