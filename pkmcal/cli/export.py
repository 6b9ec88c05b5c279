"""`pkmcal export`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Literal

import typer

import pkmcal as pk
from pkmcal.arguments import word
from pkmcal.cli.options import Force, Json, ParallelRobot
from pkmcal.cli.output import say
from pkmcal.exceptions import ArgumentError
from pkmcal.loading import load_parallel
from pkmcal.report.as_json import as_json

TARGETS = ("c", "klipper", "reprap", "marlin", "mjcf", "dh", "dh-modified", "ur")


def export(
    robot: ParallelRobot,
    target: Annotated[
        str, typer.Option("--as", metavar="TARGET", help=f"What for: {', '.join(TARGETS)}.")
    ],
    out: Annotated[Path, typer.Option(metavar="FILE", help="Where to write.")],
    number: Annotated[
        str | None,
        typer.Option(metavar="TYPE", help="Of a C header: double, the default, or float."),
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Of Klipper: your printer.cfg, which is written with the changed numbers and"
            " otherwise as it is; by default the lines alone.",
        ),
    ] = None,
    project: Annotated[
        bool,
        typer.Option(
            "--project", help="Where a firmware cannot hold the robot: the nearest that it can."
        ),
    ] = False,
    force: Force = False,
    json: Json = False,
) -> int:
    """Write a robot for a controller.

    c: a C99 header with its inverse and forward kinematics and Jacobian. klipper: the numbers of a
    linear delta for Klipper or Kalico; reprap, marlin: its M665 and M666.
    mjcf: a model for MuJoCo. Of serial arms: dh and dh-modified, a table of Denavit-Hartenberg
    numbers; ur, the lists of a calibration.conf of Universal Robots.

    What a controller cannot hold is refused with the reason, and nothing is written.

    Example: pkmcal export hexapod --as c --out hexapod.h
    """
    word("--as", target, TARGETS)
    if os.path.lexists(out) and not force:
        raise ArgumentError(f"{out}: would be replaced; name another file, or give --force")
    if target in ("dh", "dh-modified", "ur"):
        _only(target, number=number, config=config, project=project or None)
        return _export_arm(robot, target, out, json)
    machine = load_parallel(robot)
    loss = None
    if target == "c":
        _only(target, config=config, project=project or None)
        pk.export.c_header(machine, out, _number(number))
    elif target == "mjcf":
        _only(target, number=number, config=config, project=project or None)
        pk.export.mjcf(machine, out)
    elif target == "klipper":
        _only(target, number=number)
        loss = pk.export.klipper(machine, out, config, project)
    else:
        _only(target, number=number, config=config)
        write = pk.export.reprap if target == "reprap" else pk.export.marlin
        loss = write(machine, out, project)
    if json:
        say(
            as_json(
                {"robot": machine.name, "as": target, "file": str(out), "loss": loss},
                schema="export",
            )
        )
    else:
        say(f"{out}: {machine.name}" + (f"; {loss}" if loss and not loss.exact else ""))
    return 0


def _export_arm(robot: str, target: str, out: Path, json: bool) -> int:
    """Write the Denavit–Hartenberg numbers of a serial arm."""
    arm: object = pk.load(robot)
    if not isinstance(arm, pk.SerialArm):
        raise ArgumentError(f"{robot}: --as {target} is for serial arms")
    if target == "ur":
        pk.export.universal_robots(arm, out)
    else:
        pk.export.dh(arm, out, "standard" if target == "dh" else "modified")
    if json:
        say(
            as_json(
                {"robot": arm.name, "as": target, "file": str(out), "loss": None}, schema="export"
            )
        )
    else:
        say(f"{out}: {arm.name}")
    return 0


def _only(target: str, **options: object) -> None:
    """Refuse options of another target."""
    for name, value in options.items():
        if value is not None:
            raise ArgumentError(f"--{name} says nothing of --as {target}")


def _number(given: str | None) -> Literal["double", "float"]:
    if given is None or given == "double":
        return "double"
    if given == "float":
        return "float"
    raise ArgumentError(f"--number must be double or float, found {given!r}")
