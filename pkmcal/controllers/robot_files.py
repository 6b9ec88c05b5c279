"""Robot files made of a controller's numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from pkmcal.files.toml_lines import Source
from pkmcal.geometry import robot_file
from pkmcal.geometry.controller import Controller, controller_table
from pkmcal.geometry.probe_offset import probe_table
from pkmcal.geometry.robot_file_writer import lines
from pkmcal.kinematics.robot import Robot

_PROBE_REMARK = """\
# The firmware's bed probe: it touches beside the nozzle by x and y, which is then z above the bed.
"""


_UNCERTAIN = """\
# How wrong numbers may be that are not free, one standard deviation: they are fitted within that.
# [uncertainty]
# "gain*" = 1e-3
"""


@dataclass(frozen=True)
class About:
    """Statements of a robot file beside the machine.

    Attributes
    ----------
    name : str
        The robot's name.
    head : str
        Lines of comment.
    probe : sequence of float or None
        Offset of the firmware's bed probe, mm.
    controller : Controller or None
        The firmware.
    """

    name: str
    head: str = ""
    probe: Sequence[float] | None = None
    controller: Controller | None = None


def text_of(
    about: About,
    pose: Mapping[str, object],
    free: Sequence[str],
    limbs: Iterable[Mapping[str, object]],
    parameters: Mapping[str, object] | None = None,
    remark: str = "",
    workspace: Mapping[str, object] | None = None,
) -> str:
    """The text of a robot file in mm and degrees.

    Parameters
    ----------
    about : About
        Its name and where it comes from.
    pose, free, limbs, parameters
        What the file's keys of these names say.
    remark : str
        A line of comment on what is free.
    workspace : mapping, optional
        Ends of coordinates.
    """
    top = {"name": about.name, "units": {"length": "mm", "angle": "deg"}}
    blocks = [about.head, lines(top)]
    blocks.append("[pose]\n" + lines(pose))
    if workspace:
        blocks.append("[workspace]\n" + lines(workspace))
    if about.controller is not None:
        blocks.append("[controller]\n" + lines(controller_table(about.controller)))
    if about.probe is not None:
        blocks.append(_PROBE_REMARK + "[probe]\n" + lines(probe_table(about.probe)))
    if parameters:
        blocks.append("[parameters]\n" + lines(parameters))
    blocks.append(remark + "[calibration]\n" + lines({"free": free}) + _UNCERTAIN)
    blocks += ["[[limb]]\n" + lines(limb) for limb in limbs]
    return "\n".join(block for block in blocks if block)


def robot_of(text: str, place: str) -> Robot:
    """The robot of such a text; `place` is what messages call it."""
    return Robot(robot_file.parse(Source(text.encode(), place), None))
