"""`pkmcal new`: a built-in machine as a robot file to start from, every key explained."""

from __future__ import annotations

import fnmatch
import os
import shlex
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated

import typer

from pkmcal.arguments import did_you_mean
from pkmcal.arms.arm_file import is_arm
from pkmcal.cli.options import BuiltIn, Json
from pkmcal.cli.output import say
from pkmcal.exceptions import ArgumentError
from pkmcal.files.atomic import write_whole
from pkmcal.files.toml_lines import Source
from pkmcal.geometry import robot_file
from pkmcal.geometry.limb_kinds import ALIASES, KEYS, KINDS
from pkmcal.geometry.limbs import CHAIN
from pkmcal.loading import load_parallel
from pkmcal.report.as_json import as_json

_HEAD = """\
# Made by `pkmcal new {name}`. Change what differs on your machine, measure it, run
#     pkmcal calibrate {file} measured.csv --report report
#
"""
_PARALLEL = """\
# units         of every number below; mm, m or in; deg or rad
# [pose]        map: the coordinates it moves in; home: a pose in the middle of the workspace
# [parameters]  names for numbers that limbs share: `radius = 160.0` here, "radius" there
# [calibration] free: what is found unless --free says otherwise; wildcards are allowed
# [uncertainty] how wrong numbers may be that are not found, one standard deviation:
#               `%s`; common = { "gain*" = 1e-3 }: all alike
# [frames]      base, tool: poses of the machine's frames in yours, if they differ
# [stated]      what a data sheet claims, to compare: `rod = 340.0`
# [[limb]]      one for each, counted from 1 in the names of its numbers (base1.x, offset1 …)
"""
_CHAINS = """\
#   kind           chain: the joints of a limb in a row, from the base to the platform
#   joints         each with its place at home, in the base frame:
#                  kind R, P, U, S, C · at: a point; left out, that of the joint before
#                  axis or axes: left out, across the line to the next point (U) or along it (P)
#                  actuator: which q moves it; passive without · home_value: what q reads at home
#                  offset, gain, drive: of its q · stroke, cone: its limits · soft: how it yields
#                  share: a name, of a joint that several limbs have
#   copies, about  so many of this limb, turned about z or { axis = …, at = … }
#   group          limbs that are copied together
#   errors         of its joints by name: { "joint1.dx" = 0.12, "platform.dz" = -0.03 }
# [[tail]]         below the limbs: a joint behind the platform; kind R or P, at, axis, actuator
"""
_ARM = """\
# units         of every number below; mm, m or in; deg or rad
# [tool]        home: pose of the tool with all joints at zero
# [uncertainty] how wrong numbers may be that are not found, one standard deviation:
#               `"joint1.d?" = 0.05`, `"target*" = 0.1`; common = { "target*" = 0.1 }: all alike
# [[joint]]     one for each, from the base: kind, axis and a point on it with all joints at zero;
#               error (optional): dx dy dz dphi dtheta dpsi, what a calibration finds
"""


def new(
    machine: BuiltIn,
    file: Annotated[
        Path | None, typer.Argument(metavar="FILE", help="MACHINE.toml by default.")
    ] = None,
    json: Json = False,
) -> int:
    """Write a robot file to start from, with every key explained.

    An existing file is never overwritten.

    Example: pkmcal new linear-delta my-printer.toml
    """
    path = Path(f"{machine}.toml") if file is None else file
    text = template(machine, path.name)
    if os.path.lexists(path):  # a link that leads nowhere, too
        raise ArgumentError(f"{path} exists already; name another file")
    write_whole(path, text)
    if json:
        say(as_json({"machine": machine, "file": str(path)}, schema="new"))
    else:
        say(f"{path}: {machine}; change what differs on your machine")
    return 0


def template(machine: str, file: str = "robot.toml") -> str:
    """The text of a robot file that loads as the built-in machine.

    Parameters
    ----------
    machine : str
        A name of `pkmcal.machines`.
    file : str
        What the file is called, for the command in its first lines.

    Raises
    ------
    ValueError
        No such machine.

    Examples
    --------
    >>> print(template("hexapod").splitlines()[0])
    # Made by `pkmcal new hexapod`. Change what differs on your machine, measure it, run
    """
    known = [*robot_file.builtin_names(), *robot_file.builtin_names("arms")]
    if machine not in known:
        raise ArgumentError(f"unknown machine {machine!r}{did_you_mean(machine, known)}")
    content, place, _ = robot_file.located(machine)
    text, data = content.decode(), Source(content, place).data
    keys = _ARM if is_arm(data) else _PARALLEL % _uncertain(machine) + _of_limbs(data["limb"])
    called = shlex.quote(file) if file.isprintable() else "FILE"  # a line stays a line
    return f"{_HEAD.format(name=machine, file=called)}{keys}#\n{text}"


def _uncertain(machine: str) -> str:
    """Return an example of lengths of this machine: points on the base, or joints of a chain."""
    names = load_parallel(machine).geometry.names
    kinds = [f'"{kind}" = 0.05' for kind in ("base*", "limb*.d?") if fnmatch.filter(names, kind)]
    return ", ".join(['"gain*" = 1e-3', *kinds])


def _of_limbs(limbs: Sequence[dict[str, object]]) -> str:
    """Return the comments that explain the keys of these limbs."""
    if any(limb["kind"] == CHAIN for limb in limbs):
        return _CHAINS
    return "".join(_limb_keys(limbs))


def _limb_keys(limbs: Iterable[dict[str, object]]) -> Iterable[str]:
    """A line for each key that limbs of these kinds may have."""
    named = dict.fromkeys(str(limb["kind"]) for limb in limbs)
    kinds = {kind: ALIASES.get(kind, kind) for kind in named}
    used = {key for kind in kinds.values() for key in KINDS[kind].keys()}  # noqa: SIM118
    explained = ("\n#" + 18 * " ").join(
        f"{name}: {KINDS[kind].what}" for name, kind in kinds.items()
    )
    for names, words in KEYS.items():
        if names.split(",")[0] in used:
            yield f"#   {names:13}  {words.format(kinds=explained)}\n"
