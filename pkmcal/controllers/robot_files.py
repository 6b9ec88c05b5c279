"""Robot files made of a controller's numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from pkmcal.files.toml_lines import Source
from pkmcal.geometry import robot_file
from pkmcal.geometry.probe_offset import probe_table
from pkmcal.geometry.robot_file_writer import lines
from pkmcal.kinematics.robot import Robot

_PROBE_REMARK = """\
# The firmware's bed probe: it touches beside the nozzle by x and y, which is then z above the bed.
"""


def text_of(
    name: str,
    head: str,
    pose: Mapping[str, object],
    free: Sequence[str],
    limbs: Iterable[Mapping[str, object]],
    parameters: Mapping[str, object] | None = None,
    remark: str = "",
    workspace: Mapping[str, object] | None = None,
    probe: Sequence[float] | None = None,
) -> str:
    """The text of a robot file in mm and degrees.

    Parameters
    ----------
    name, head : str
        The robot's name; lines of comment.
    pose, free, limbs, parameters
        What the file's keys of these names say.
    remark : str
        A line of comment on what is free.
    workspace : mapping, optional
        Ends of coordinates.
    probe : sequence of float, optional
        Offset of the firmware's bed probe, mm.
    """
    blocks = [head, lines({"name": name, "units": {"length": "mm", "angle": "deg"}})]
    blocks.append("[pose]\n" + lines(pose))
    if workspace:
        blocks.append("[workspace]\n" + lines(workspace))
    if probe is not None:
        blocks.append(_PROBE_REMARK + "[probe]\n" + lines(probe_table(probe)))
    if parameters:
        blocks.append("[parameters]\n" + lines(parameters))
    blocks.append(remark + "[calibration]\n" + lines({"free": free}))
    blocks += ["[[limb]]\n" + lines(limb) for limb in limbs]
    return "\n".join(block for block in blocks if block)


def robot_of(text: str, place: str) -> Robot:
    """The robot of such a text; `place` is what messages call it."""
    return Robot(robot_file.parse(Source(text.encode(), place), None))
