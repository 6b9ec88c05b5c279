"""`pkmcal export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

import pkmcal as pk
from pkmcal.arguments import word
from pkmcal.cli.options import Force, Json, ParallelRobot
from pkmcal.cli.output import say
from pkmcal.controllers.linuxcnc import contents
from pkmcal.controllers.loss import laws
from pkmcal.exceptions import ArgumentError
from pkmcal.files.reading import Input
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.output import Output
from pkmcal.loading import load_parallel
from pkmcal.report.as_json import as_json

_OF_ARMS = ("urdf", "sdf", "dh", "dh-modified", "ur")
_FIRMWARE = ("klipper", "reprap", "marlin", "hangprinter", "maslow")
TARGETS = ("c", *_FIRMWARE, "linuxcnc", "mjcf", "fmu", *_OF_ARMS)
_IN_A_FILE = ("klipper", "maslow", "reprap", "hangprinter")  # of the user's


def export(
    robot: ParallelRobot,
    target: Annotated[
        str, typer.Option("--as", metavar="TARGET", help=f"What for: {', '.join(TARGETS)}.")
    ],
    out: Annotated[
        Path, typer.Option(metavar="PATH", help="Where to write: a file; of LinuxCNC a folder.")
    ],
    number: Annotated[
        str | None,
        typer.Option(metavar="TYPE", help="Of a C header: double, the default, or float."),
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Of Klipper, RepRapFirmware, a Maslow: your printer.cfg, config.g or maslow.yaml,"
            " written with the changed numbers and otherwise as it is; by default the lines alone.",
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
    linear or rotary delta for Klipper or Kalico; reprap, marlin: its M665 and M666, or M669;
    hangprinter: M669 and M666. maslow: the anchors of a maslow.yaml. linuxcnc: a kinematics
    component, and a simulation that runs it. mjcf: a model for MuJoCo. fmu: an FMU for
    co-simulation. Of serial arms: urdf and sdf, a tree of links; dh and dh-modified, a table of
    Denavit-Hartenberg numbers; ur, the lists of a calibration.conf of Universal Robots.

    What a controller cannot hold is refused with the reason, and nothing is written.

    Example: pkmcal export hexapod --as c --out hexapod.h
    """
    word("--as", target, TARGETS)
    _only(target, ("c",), number=number)
    _only(target, _IN_A_FILE, config=config)
    _only(target, _FIRMWARE, project=project or None)
    read = Inputs()
    if target in _OF_ARMS:
        return _export_arm(read.robot(robot), target, out, read, force, json)
    machine = load_parallel(read.robot(robot))
    loss = None
    if target == "linuxcnc":
        files, loss = contents(machine, out.resolve().name)
        with Output(out, list(files), read, force).draft() as draft:
            for name, text in files.items():
                (draft / name).write_bytes(text.encode())  # line ends as they are
    else:
        given = None if config is None else read.file(config)
        with Output(out.parent, [out.name], read, force).draft() as draft:
            loss = _write(target, machine, draft / out.name, number, given, project)
    if json:
        say(
            as_json(
                {"robot": machine.name, "as": target, "file": str(out), "loss": loss},
                schema="export",
            )
        )
    else:
        own = "LinuxCNC's own module for it is " if target == "linuxcnc" else ""
        say(f"{out}: {machine.name}" + (f"; {own}{loss}" if loss and not loss.exact else ""))
    return 0


def _export_arm(
    robot: str | Input, target: str, out: Path, read: Inputs, force: bool, json: bool
) -> int:
    """Write a serial arm."""
    arm: object = pk.load(robot)
    if not isinstance(arm, pk.SerialArm):
        raise ArgumentError(f"{robot}: --as {target} is for serial arms")
    lost = None if arm.laws is None else laws(arm)
    arm = arm.rigid
    with Output(out.parent, [out.name], read, force).draft() as draft:
        if target == "urdf":
            pk.export.urdf(arm, draft / out.name)
        elif target == "sdf":
            pk.export.sdf(arm, draft / out.name)
        elif target == "ur":
            pk.export.universal_robots(arm, draft / out.name)
        else:
            pk.export.dh(arm, draft / out.name, "standard" if target == "dh" else "modified")
    if json:
        say(
            as_json(
                {"robot": arm.name, "as": target, "file": str(out), "loss": lost}, schema="export"
            )
        )
    else:
        say(f"{out}: {arm.name}" + (f"; {lost}" if lost and not lost.exact else ""))
    return 0


def _write(
    target: str,
    machine: pk.Robot,
    path: Path,
    number: str | None,
    config: Input | None,
    project: bool,
) -> pk.export.Loss | None:
    """Write one file, and say what is lost."""
    match target:
        case "c":
            return pk.export.c_header(machine, path, _number(number))
        case "mjcf":
            return pk.export.mjcf(machine, path)
        case "fmu":
            return pk.export.fmu(machine, path)
        case "klipper":
            return pk.export.klipper(machine, path, config, project)
        case "maslow":
            return pk.export.maslow(machine, path, config, project)
        case "reprap":
            return pk.export.reprap(machine, path, project, config)
        case "marlin":
            return pk.export.marlin(machine, path, project)
        case "hangprinter":
            return pk.export.hangprinter(machine, path, project, config)
    return None


def _only(target: str, targets: tuple[str, ...], **options: object) -> None:
    """Refuse options of other targets."""
    for name, value in options.items():
        if value is not None and target not in targets:
            raise ArgumentError(f"--{name} says nothing of --as {target}")


def _number(given: str | None) -> Literal["double", "float"]:
    if given is None or given == "double":
        return "double"
    if given == "float":
        return "float"
    raise ArgumentError(f"--number must be double or float, found {given!r}")
