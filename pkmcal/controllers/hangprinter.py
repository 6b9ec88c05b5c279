"""Hangprinters of RepRapFirmware: the anchors of the lines as M669, their spools as M666.

The firmware's line i is let out by ‖p - anchor_i‖ - ‖anchor_i‖ from where it is at the origin; so
`offset` of a limb has to be the length at the origin. Without spools q is that way. With them it is
turns of the motor: of the spool, whose radius is R at the origin, gain · q radians with gain =
2π L / (U H), and the line has gone ((R + u)² - R²)/c, u = c gain q / 2, c = -U O Q. That is the law
of a spool. What M666 W and S say of stretch is not among these numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from os import PathLike
from typing import NamedTuple

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.controllers import robot_files
from pkmcal.controllers.gcode_words import (
    Commands,
    Settings,
    changed,
    number,
    numbers,
    settings,
    written,
)
from pkmcal.controllers.laws import require_no_laws, require_no_pulleys
from pkmcal.controllers.loss import COMPARED, Loss, cylinder, fitted, require_held
from pkmcal.controllers.own_file import Wanted, write_for
from pkmcal.controllers.reprap_files import own_config
from pkmcal.controllers.robot_files import About
from pkmcal.exceptions import ArgumentError, FileError
from pkmcal.geometry.laws import Law
from pkmcal.kinematics.robot import Robot, require_parallel

_LETTERS = "ABCD"
_LINES = len(_LETTERS)
_KIND = 6  # K
_SPOOL = Law(spool=True)


class Spools(NamedTuple):
    """The settings of the spools by M666.

    Attributes
    ----------
    buildup : float
        Q, mm² per mm: how the squared radius grows with the line on the spool.
    radii : ndarray (4,)
        R, mm, at the origin.
    lines : ndarray (4,)
        U · O: lines that each spool winds up for a line to the mover.
    turn : ndarray (4,)
        2π L / (U H): radians of the spool for a turn of the motor and a line to the mover.
    """

    buildup: float
    radii: FloatArray
    lines: FloatArray
    turn: FloatArray


class Hangprinter(NamedTuple):
    """The settings of a config.g: anchors (4, 3), spools where it has M666, what is left out."""

    anchors: FloatArray
    spools: Spools | None
    notes: tuple[str, ...] = ()


def hangprinter(
    robot: Robot,
    path: str | PathLike[str],
    project: bool = False,
    config: str | PathLike[str] | None = None,
) -> Loss:
    """Write the anchors and spools of a Hangprinter for RepRapFirmware 3: M669 and M666.

    Parameters
    ----------
    robot : Robot
        Four UPS limbs from anchors to one point, which only translates; q is the line let out
        since the origin, mm, or with the drive law of a spool in each limb turns of the motor.
    path : str or path
        Where to write; an existing file is replaced, whole or not at all.
    project : bool, optional
        Write the nearest numbers where the firmware cannot hold the robot: lengths at the origin
        that are not the distances of the anchors, gains that its gears have not, more than one
        build-up.
    config : str or path, optional
        The printer's own config.g: it is written with the changed numbers, and not a character
        else of it. A robot with spools needs it, for M666 states their gears. By default M669
        alone is written.

    Returns
    -------
    Loss
        How far off the firmware's model is then; near 0 without projection.

    Raises
    ------
    ValueError
        The firmware cannot hold the robot; nothing is written.
    OSError
        A file that cannot be read or written.
    """
    return write_for(path, project, config, own_config, partial(_made, robot))


def _made(robot: Robot, wanted: Wanted, text: str | None) -> tuple[str, Loss]:
    """The line for the anchors, or the printer's file with the changed numbers."""
    require_parallel(robot)
    spooled = _require(robot)
    there = None if text is None else _of_text(text, wanted.place)
    geared = None if there is None else there.spools
    if spooled and geared is None:
        raise ArgumentError(
            f"robot: {robot.name} has spools; config must be a config.g whose M666 states their"
            " gears, U O L H"
        )
    built, model = _model(robot, geared if spooled else None)
    poses, over = _workspace(robot, built[: 3 * _LINES].reshape(_LINES, 3))
    x, lost = fitted(lambda x: as_robot(model(x)), built, robot.inverse(poses), poses, over)
    lacks = (
        "the firmware takes the length of a line at the origin for the distance of its anchor, and"
        + (" one build-up and its gears for the spools" if spooled else " 1 for its gain")
        + ", this robot has others"
    )
    require_held(robot, lost, wanted.project, lacks)
    found = model(x)
    new = text_of(found) if text is None else changed(text, wanted.place, _commands(found))
    return new, lost


def text_of(machine: Hangprinter) -> str:
    """The line for the anchors."""
    anchors = " ".join(
        letter + written(*anchor)
        for letter, anchor in zip(_LETTERS, machine.anchors.tolist(), strict=True)
    )
    return f"M669 K{_KIND} N{_LINES} {anchors}\n"


def of_text(text: str, place: str = "M669") -> Hangprinter:
    """The anchors of a config.g, and its spools where it has M666.

    Raises
    ------
    ValueError
        M669 is missing, is not of a Hangprinter of four lines, or has no three numbers for each;
        a number of M666 is missing.
    """
    found = _of_text(text, place)
    if number(settings(text, "M666", place, missing=True), "W", "M666", place, 0.0):
        return found._replace(notes=("the stretch of the lines, M666 W and S, is left out",))
    return found


def _of_text(text: str, place: str) -> Hangprinter:
    size, wound = settings(text, "M669", place), settings(text, "M666", place, missing=True)
    lines = number(size, "N", "M669", place, _LINES)
    if number(size, "K", "M669", place, _KIND) != _KIND or lines != _LINES:
        raise FileError(f"{place}: M669 must be K{_KIND}, a Hangprinter, with N{_LINES} lines")
    anchors = [_anchor(size, letter, place) for letter in _LETTERS]
    return Hangprinter(np.array(anchors), _spools(wound, place) if _winds(wound) else None)


def _anchor(size: Settings, letter: str, place: str) -> list[float]:
    try:
        return numbers(size, letter, "M669", place, counts=(3,))
    except FileError as error:
        value = size[letter].value if letter in size else None
        raise FileError(
            f"{place}: {letter} of M669 must be an anchor x:y:z, found {value!r}"
        ) from error


def _winds(wound: Settings) -> bool:
    """Return whether M666 says anything of spools."""
    return bool(set("QRUOLH") & set(wound))


def _spools(wound: Settings, place: str) -> Spools:
    def four(letter: str) -> FloatArray:
        found = np.array(numbers(wound, letter, "M666", place, counts=(_LINES,)))
        if not (found > 0.0).all():
            value = wound[letter].value
            raise FileError(f"{place}: {letter} of M666 must be above 0, found {value}")
        return found

    advantage, lines, motor, spool = (four(letter) for letter in "UOLH")
    return Spools(
        number(wound, "Q", "M666", place),
        four("R"),
        advantage * lines,
        2.0 * np.pi * motor / (advantage * spool),
    )


def _commands(found: Hangprinter) -> Commands:
    """The settings that hold it, by command and letter."""
    anchors = found.anchors.tolist()
    commands = {"M669": dict(zip(_LETTERS, anchors, strict=True))}
    if found.spools is not None:
        commands["M666"] = {"Q": [found.spools.buildup], "R": found.spools.radii.tolist()}
    return commands


def as_robot(machine: Hangprinter) -> Robot:
    """The robot with these numbers."""
    return robot_files.robot_of(robot_text(machine, About("hangprinter")), "M669")


def robot_text(machine: Hangprinter, about: About) -> str:
    """A robot file with these numbers; home is below the highest anchor."""
    home = round(0.2 * float(machine.anchors[:, 2].max()), 3)
    pose = {"map": "translation", "home": {"z": home}}
    limbs: list[dict[str, object]] = [
        {
            "kind": "UPS",
            "base": anchor,
            "platform": [0.0, 0.0, 0.0],
            "offset": float(np.linalg.norm(anchor)),
        }
        for anchor in machine.anchors.tolist()
    ]
    free = ["base*", "offset*"]
    if machine.spools is not None:
        spools = machine.spools
        free.append("drive*.spool")
        for limb, radius, lines, turn in zip(
            limbs, spools.radii.tolist(), spools.lines.tolist(), spools.turn.tolist(), strict=True
        ):
            limb["gain"] = turn
            limb["drive"] = {"spool": radius, "buildup": -lines * spools.buildup}
    return robot_files.text_of(about, pose, free, limbs)


def _model(
    robot: Robot, geared: Spools | None
) -> tuple[FloatArray, Callable[[FloatArray], Hangprinter]]:
    """The robot's numbers as the firmware has them, and what they make."""
    anchors = (robot.slots[:, 0:3] - robot.slots[:, 3:6]).ravel()
    if geared is None:
        return anchors, lambda x: Hangprinter(x.reshape(_LINES, 3), None)
    g = robot.geometry
    radii = np.array([g[f"drive{i}.spool"] for i in range(1, _LINES + 1)])
    built_up = np.array([g[f"drive{i}.buildup"] for i in range(1, _LINES + 1)])
    buildup = -float((built_up / geared.lines).mean())

    def machine(x: FloatArray) -> Hangprinter:
        at, radii, (buildup,) = np.split(x, [3 * _LINES, 4 * _LINES])
        return Hangprinter(
            at.reshape(_LINES, 3), geared._replace(radii=radii, buildup=float(buildup))
        )

    return np.concatenate([anchors, radii, [buildup]]), machine


def _require(robot: Robot) -> bool:
    """Refuse what is no Hangprinter; whether it has spools."""
    require_no_pulleys(robot, "M669")
    limbs = [(limb.kind, limb.actuator) for limb in robot.model.limbs]
    lines_of_its_own = limbs == [("UPS", i) for i in range(_LINES)]
    if robot.model.map != "translation" or not lines_of_its_own or not robot.frames.trivial:
        raise ArgumentError(
            f"robot: {robot.name} is no point that only translates on four UPS limbs, without"
            " base and tool frames"
        )
    spooled = all(law == _SPOOL for law in robot.model.laws)
    if not spooled:
        require_no_laws(robot, "M666")
    return spooled


def _workspace(robot: Robot, anchors: FloatArray) -> tuple[FloatArray, str]:
    """Poses inside the anchors, and what to call them."""
    across = 0.5 * float(np.sort(np.hypot(anchors[:, 0], anchors[:, 1]))[1])
    high = 0.5 * float(anchors[:, 2].max())
    if not (across > 0.0 and high > 0.0):
        raise ArgumentError(f"robot: {robot.name}: one anchor at least must be above the origin")
    over = f"within {across:.0f} mm of the origin and {high:.0f} mm above it"
    return cylinder(across, high, COMPARED), over
