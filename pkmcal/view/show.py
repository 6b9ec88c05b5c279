"""`show`: a machine as a page to look at."""

from __future__ import annotations

import tempfile
import webbrowser
from os import PathLike
from pathlib import Path

from numpy.typing import ArrayLike

from pkmcal import arguments
from pkmcal.arguments import instance
from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import as_rows
from pkmcal.files.atomic import write_whole
from pkmcal.files.seal import sealed
from pkmcal.kinematics.robot import Robot
from pkmcal.view.page import html


def show(
    robot: Robot | SerialArm,
    path: str | PathLike[str] | None = None,
    *,
    poses: ArrayLike | None = None,
) -> Path:
    """Write a machine as one HTML file, to move it and look at it from all sides.

    Sliders move the platform, or the actuators one by one; the kinematics in the file are those of
    the package, compiled to WebAssembly. It shows strokes and joint cones and what breaks them,
    how near a singularity is, where the machine gets to, and every assembly mode at home. It needs
    a browser of 2023 or later, and no network.

    Parameters
    ----------
    robot : Robot or SerialArm
        The machine.
    path : str or path, optional
        Where to write; an existing file is replaced, whole or not at all. By default a temporary
        file, which is opened in the browser.
    poses : array_like (N, 6), of an arm (N, n), optional
        To be shown and gone to one by one, mm and rad; of an arm joint coordinates. Those of
        `plan_poses`, for example.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ValueError, TypeError
        Poses of a wrong shape, or no machine.
    OSError
        The file cannot be written.

    Examples
    --------
    >>> import pkmcal as pk
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     page = pk.show(pk.load("hexapod"), f"{folder}/hexapod.html")
    ...     page.stat().st_size < 60_000
    True
    """
    if not isinstance(robot, SerialArm):
        instance("robot", robot, Robot, " or a SerialArm")
    rows = None
    if poses is not None:
        rows = as_rows("poses", poses, robot.n_actuators if isinstance(robot, SerialArm) else 6)[0]
    content = sealed(html(robot, rows).encode(), ".html")
    if path is not None:
        place = Path(arguments.path("path", path))
        write_whole(place, content)
        return place
    with tempfile.NamedTemporaryFile(prefix="pkmcal-", suffix=".html", delete=False) as file:
        file.write(content)
    webbrowser.open(Path(file.name).as_uri())
    return Path(file.name)
