"""Maslow 4, a sled on four belts, with FluidNC: anchors as numbers of its maslow.yaml, and its log.

The firmware states a belt by what it is in the plane, from the anchor to the middle of the sled:
‖p - anchor‖, after it has taken off the height of the belt's end and has added what is fixed to it,
the belt's end and the sled's arm. In its log of a calibration each place has four of these lengths.
It counts x and y of a program from where the diagonals of the frame meet, a robot file from where
its anchors do.
"""

from __future__ import annotations

import re
from functools import partial
from os import PathLike

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.controllers import robot_files
from pkmcal.controllers.gcode_words import SAME
from pkmcal.controllers.laws import require_plain_limbs
from pkmcal.controllers.loss import Loss, fitted, require_held
from pkmcal.controllers.own_file import Wanted, write_for
from pkmcal.controllers.robot_files import About
from pkmcal.exceptions import ArgumentError, FileError
from pkmcal.files.text_lines import text_in
from pkmcal.files.toml_table import LARGEST
from pkmcal.kinematics.robot import Robot, require_parallel

CORNERS = ("tl", "tr", "bl", "br")  # in the order of the motors
_NAMES = [f"{corner}{axis}" for corner in CORNERS for axis in "XY"]
_ZERO = ("blX", "blY", "brY")  # where the frame begins; the log does not print them
_NUMBER = r"[-+]?\d*\.?\d+(?:[eE][-+]?\d+)?"
_ANCHOR = re.compile(
    r"^(?P<start>[^#\n]*?(?<![A-Za-z])(?P<name>[tb][lr][XY])[ \t]*[:=][ \t]*)"
    rf"(?P<value>{_NUMBER})(?![\w.]|,\d)",
    re.MULTILINE,
)
_ROW = re.compile(r"\{([^{}]*)\}")
_BELT = re.compile(rf"\b([tb][lr])\s*:\s*({_NUMBER})\s*(?=,|$)")
_FREE = ["base1.x", "base1.y", "base2.x", "base2.y", "base4.x"]
_HOLDS = 0.15  # share of the frame that poses of the workspace stay away from its edge
_SIDE = 15  # poses along a side of it


def maslow(
    robot: Robot,
    path: str | PathLike[str],
    config: str | PathLike[str] | None = None,
    project: bool = False,
) -> Loss:
    """Write the anchors of a Maslow 4 for FluidNC.

    Parameters
    ----------
    robot : Robot
        A point in the plane (map xy) on four cables, one in each corner; q is the length in the
        plane from the anchor to the middle of the sled, mm.
    path : str or path
        Where to write; an existing file is replaced, whole or not at all.
    config : str or path, optional
        The machine's own maslow.yaml: it is written with the changed anchors, and not a character
        else of it. By default the eight lines alone are written.
    project : bool, optional
        Write the nearest anchors where the firmware cannot hold the robot: it has no offset and
        no gain of a belt.

    Returns
    -------
    Loss
        How far off the firmware's model is then; near 0 without projection.

    Raises
    ------
    ValueError
        The firmware cannot hold the robot, or the file has not all eight numbers; nothing is
        written.
    OSError
        A file that cannot be read or written.

    Examples
    --------
    >>> import pkmcal as pk
    >>> import pathlib, tempfile
    >>> belts = pk.load("examples/belts/robot.toml")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     loss = pk.export.maslow(belts, f"{folder}/lines.yaml")
    ...     print(pathlib.Path(folder, "lines.yaml").read_text()[:51])
    kinematics:
      MaslowKinematics:
        tlX: 0.000000
    """
    return write_for(path, project, config, text_in, partial(_made, robot))


def _made(robot: Robot, wanted: Wanted, there: str | None) -> tuple[str, Loss]:
    """The eight lines, or the machine's file with the changed anchors."""
    require_parallel(robot)
    corner = _corners(robot)
    built = (robot.slots[:, 0:2] - robot.slots[:, 3:5])[corner]
    poses = _workspace(built)
    q = robot.inverse(poses)[:, corner]
    anchors, lost = fitted(
        lambda x: as_robot(x.reshape(4, 2)), built.ravel(), q, poses, "between the anchors"
    )
    lacks = "the firmware has anchors alone, no offset and no gain of a belt as this robot has"
    require_held(robot, lost, wanted.project, lacks)
    values = dict(zip(_NAMES, (anchors + 0.0).tolist(), strict=True))
    if there is not None:
        return _changed(there, wanted.place, values), lost
    numbers = "".join(f"    {name}: {value:.6f}\n" for name, value in values.items())
    return "kinematics:\n  MaslowKinematics:\n" + numbers, lost


def of_text(text: str, place: str) -> tuple[FloatArray, FloatArray]:
    """Anchors (4, 2) of a maslow.yaml or a log, and the belts (N, 4) of the log's last set.

    Both in the order of the motors: top left, top right, bottom left, bottom right.

    Raises
    ------
    ValueError
        Anchors are missing, or a place of the log has not four belts.
    """
    values = dict.fromkeys(_ZERO, 0.0)
    values |= {found["name"]: float(found["value"]) for found in _ANCHOR.finditer(text)}
    if missing := [name for name in _NAMES if name not in values]:
        raise FileError(
            f"{place}: no number for {', '.join(missing)}: anchors of a Maslow; they are in its"
            " maslow.yaml, with which its log goes as log (--log)"
        )
    if far := [name for name in _NAMES if not abs(values[name]) <= LARGEST]:
        raise FileError(
            f"{place}: {far[0]} must be at most {LARGEST:g} mm, found {values[far[0]]:g}"
        )
    anchors = np.array([values[name] for name in _NAMES]).reshape(4, 2)
    start = text.rfind("CLBM:")  # each set repeats the places of those before
    rows = _ROW.findall(text, start) if start >= 0 else []
    belts = np.empty((len(rows), 4))
    for i, row in enumerate(rows):
        lengths = dict(_BELT.findall(row.strip()))
        if sorted(lengths) != sorted(CORNERS):
            raise FileError(
                f"{place}: place {i + 1} of CLBM must have bl, br, tr and tl: {{{row}}}"
            )
        belts[i] = [float(lengths[corner]) for corner in CORNERS]
    return anchors, belts


def as_robot(anchors: FloatArray) -> Robot:
    """The robot with these anchors (4, 2)."""
    return robot_files.robot_of(robot_text(anchors, About("maslow")), "maslow.yaml")


def robot_text(anchors: FloatArray, about: About) -> str:
    """A robot file with these anchors; home is in their middle."""
    home = dict(zip("xy", np.round(anchors.mean(axis=0), 3).tolist(), strict=True))
    limbs = [
        {"kind": "cable", "base": [x, y, 0.0], "platform": [0.0, 0.0, 0.0]}
        for x, y in anchors.tolist()
    ]
    return robot_files.text_of(about, {"map": "xy", "home": home}, _FREE, limbs)


def _corners(robot: Robot) -> list[int]:
    """Return the limb in each corner, in the order of the motors."""
    limbs = [(limb.kind, limb.actuator) for limb in robot.model.limbs]
    if robot.model.map != "xy" or limbs != [("cable", i) for i in range(4)]:
        raise ArgumentError(f"robot: {robot.name} is no point in the plane (map xy) on four cables")
    if not robot.frames.trivial:
        raise ArgumentError(f"robot: {robot.name} has base and tool frames, the firmware has none")
    require_plain_limbs(robot, "a firmware")
    anchors = robot.slots[:, 0:2]
    left, low = (anchors < anchors.mean(axis=0)).T.tolist()
    corners = [("b" if low[i] else "t") + ("l" if left[i] else "r") for i in range(4)]
    if sorted(corners) != sorted(CORNERS):
        raise ArgumentError(
            f"robot: {robot.name} must have an anchor in each corner, found {', '.join(corners)}"
        )
    return [corners.index(corner) for corner in CORNERS]


def _workspace(anchors: FloatArray) -> FloatArray:
    """Poses between the anchors."""
    u, v = (
        grid.ravel()[:, None] for grid in np.meshgrid(*[np.linspace(_HOLDS, 1 - _HOLDS, _SIDE)] * 2)
    )
    top_left, top_right, low_left, low_right = anchors
    poses = np.zeros((len(u), 6))
    poses[:, :2] = v * ((1 - u) * top_left + u * top_right)
    poses[:, :2] += (1 - v) * ((1 - u) * low_left + u * low_right)
    return poses


def _changed(text: str, place: str, values: dict[str, float]) -> str:
    """Write anchors that differ into the user's file."""
    there = [found["name"] for found in _ANCHOR.finditer(text)]
    for name in values:
        if there.count(name) != 1:
            times = f"stands {there.count(name)} times" if name in there else "is missing"
            raise FileError(f"{place}: {name} {times}; a maslow.yaml has each anchor once")

    def new(found: re.Match[str]) -> str:
        value = values[found["name"]]
        same = abs(float(found["value"]) - value) <= SAME
        return found[0] if same else f"{found['start']}{value:.6f}"

    return _ANCHOR.sub(new, text)
