"""Hangprinters of RepRapFirmware: anchors of the lines as M669.

The firmware's line i is let out by ‖p - anchor_i‖ - ‖anchor_i‖ from where it is at the origin. So
`offset` of a limb has to be the length at the origin. Build-up on the spools, and the stretch that
M666 corrects, come after that; they are not among these numbers.
"""

from __future__ import annotations

import re
from os import PathLike

import numpy as np

from pkmcal.arguments import flag
from pkmcal.arguments import path as as_path
from pkmcal.arrays import FloatArray
from pkmcal.controllers import robot_files
from pkmcal.controllers.laws import require_plain_limbs
from pkmcal.controllers.loss import Loss, cylinder, fitted, require_held
from pkmcal.exceptions import ArgumentError, FileError
from pkmcal.files.atomic import write_whole
from pkmcal.kinematics.robot import Robot, require_parallel

_LETTERS = "ABCD"
_POSES = 200


def hangprinter(robot: Robot, path: str | PathLike[str], project: bool = False) -> Loss:
    """Write the anchors of a Hangprinter for RepRapFirmware 3: M669 for config.g.

    Parameters
    ----------
    robot : Robot
        Four UPS limbs from anchors to one point, which only translates; q is the line let out
        since the origin, mm.
    path : str or path
        Where to write; an existing file is replaced, whole or not at all.
    project : bool, optional
        Write the nearest numbers where the firmware cannot hold the robot: lengths at the origin
        that are not the distances of the anchors, gains.

    Returns
    -------
    Loss
        How far off the firmware's model is then; near 0 without projection.

    Raises
    ------
    ValueError
        The firmware cannot hold the robot; nothing is written.
    """
    path, project = as_path("path", path), flag("project", project)
    require_parallel(robot)
    _require(robot)
    built = robot.slots[:, 0:3] - robot.slots[:, 3:6]
    poses, over = _workspace(robot, built)
    anchors, lost = fitted(
        lambda x: as_robot(x.reshape(-1, 3)), built.ravel(), robot.inverse(poses), poses, over
    )
    lacks = (
        "the firmware takes the length of a line at the origin for the distance of its anchor, and"
        " 1 for its gain, this robot has others"
    )
    require_held(robot, lost, project, lacks)
    write_whole(path, text_of(anchors.reshape(-1, 3)))
    return lost


def text_of(anchors: FloatArray) -> str:
    """The line for anchors (4, 3)."""
    words = [
        letter + ":".join(f"{value:.6f}" for value in anchor)
        for letter, anchor in zip(_LETTERS, anchors + 0.0, strict=True)
    ]
    return f"M669 K6 N{len(anchors)} {' '.join(words)}\n"


def of_text(text: str, place: str = "M669") -> FloatArray:
    """The anchors (4, 3) of the last M669 of a config.g.

    Raises
    ------
    ValueError
        It is missing, is not of a Hangprinter of four lines, or has no three numbers for each.
    """
    found = re.findall(r"^\s*M669\b([^;\n]*)", text, re.MULTILINE)
    if not found:
        raise FileError(f"{place}: M669 is missing")
    words = dict(re.findall(r"([A-Z])\s*([-+.\d:]+)", found[-1]))
    if float(words.get("K", 6)) != 6 or float(words.get("N", 4)) != len(_LETTERS):
        raise FileError(f"{place}: M669 must be K6, a Hangprinter, with N4 lines")
    anchors = []
    for letter in _LETTERS:
        try:
            anchor = [float(each) for each in words.get(letter, "").split(":")]
        except ValueError:
            anchor = []
        if len(anchor) != 3:
            raise FileError(
                f"{place}: {letter} of M669 must be an anchor x:y:z, found {words.get(letter)!r}"
            )
        anchors.append(anchor)
    return np.array(anchors)


def as_robot(anchors: FloatArray, name: str = "hangprinter", head: str = "") -> Robot:
    """The robot with these anchors."""
    return robot_files.robot_of(robot_text(anchors, name, head), "M669")


def robot_text(anchors: FloatArray, name: str, head: str) -> str:
    """A robot file with these anchors; home is below the highest one."""
    home = round(0.2 * float(anchors[:, 2].max()), 3)
    pose = {"map": "translation", "home": {"z": home}}
    limbs = [
        {
            "kind": "UPS",
            "base": anchor,
            "platform": [0.0, 0.0, 0.0],
            "offset": float(np.linalg.norm(anchor)),
        }
        for anchor in anchors.tolist()
    ]
    return robot_files.text_of(name, head, pose, ["base*", "offset*"], limbs)


def _require(robot: Robot) -> None:
    require_plain_limbs(robot, "M669")
    limbs = [(limb.kind, limb.actuator) for limb in robot.model.limbs]
    lines_of_its_own = limbs == [("UPS", i) for i in range(len(_LETTERS))]
    if robot.model.map != "translation" or not lines_of_its_own or not robot.frames.trivial:
        raise ArgumentError(
            f"robot: {robot.name} is no point that only translates on four UPS limbs, without"
            " base and tool frames"
        )


def _workspace(robot: Robot, anchors: FloatArray) -> tuple[FloatArray, str]:
    """Poses inside the anchors, and what to call them."""
    across = 0.5 * float(np.sort(np.hypot(anchors[:, 0], anchors[:, 1]))[1])
    high = 0.5 * float(anchors[:, 2].max())
    if not (across > 0.0 and high > 0.0):
        raise ArgumentError(f"robot: {robot.name}: one anchor at least must be above the origin")
    over = f"within {across:.0f} mm of the origin and {high:.0f} mm above it"
    return cylinder(across, high, _POSES), over
