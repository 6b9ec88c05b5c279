"""Writes a machine for a controller, as an `Exporting` says."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pkmcal import export
from pkmcal.arguments import word
from pkmcal.arms.arm import SerialArm
from pkmcal.controllers.linuxcnc import contents
from pkmcal.controllers.loss import Loss, laws
from pkmcal.exceptions import ArgumentError
from pkmcal.files.reading import Input
from pkmcal.jobs.configuration import Exporting
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.output import Output
from pkmcal.kinematics.robot import Robot
from pkmcal.loading import load, load_parallel

_OF_ARMS = ("urdf", "sdf", "dh", "dh-modified", "ur")
_FIRMWARE = ("klipper", "reprap", "marlin", "hangprinter", "maslow")
TARGETS = ("c", *_FIRMWARE, "linuxcnc", "mjcf", "fmu", *_OF_ARMS)
_IN_A_FILE = ("klipper", "maslow", "reprap", "hangprinter")  # of the user's


@dataclass(frozen=True)
class Exported:
    """The files that were written.

    Attributes
    ----------
    name : str
        The machine.
    loss : Loss or None
        What the controller does not hold.
    own_module : bool
        Whether the loss is that of LinuxCNC's own module, which is not what was written.
    """

    name: str
    loss: Loss | None
    own_module: bool = False

    def __str__(self) -> str:
        own = "LinuxCNC's own module for it is " if self.own_module else ""
        return self.name + (f"; {own}{self.loss}" if self.loss and not self.loss.exact else "")


def run(job: Exporting, inputs: Inputs, force: bool) -> Exported:
    """Write the machine.

    Raises
    ------
    ValueError
        What the controller cannot hold, an option of another target, a file that would be lost.
    """
    target = word("--as", job.target, TARGETS)
    _only(target, ("c",), number=job.number)
    _only(target, _IN_A_FILE, config=job.config)
    _only(target, _FIRMWARE, project=job.project or None)
    if job.out is None:
        raise ArgumentError("--out: where to write is missing")
    out = Path(job.out)
    if target in _OF_ARMS:
        return _export_arm(inputs.robot(job.robot), target, out, inputs, force)
    machine = load_parallel(inputs.robot(job.robot))
    if target == "linuxcnc":
        files, loss = contents(machine, out.resolve().name)
        with Output(out, list(files), inputs, force).draft() as draft:
            for name, text in files.items():
                (draft / name).write_bytes(text.encode())  # line ends as they are
        return Exported(machine.name, loss, own_module=True)
    given = None if job.config is None else inputs.file(job.config)
    with Output(out.parent, [out.name], inputs, force).draft() as draft:
        written = _write(target, machine, draft / out.name, job.number, given, job.project)
    return Exported(machine.name, written)


def _export_arm(
    robot: str | Input, target: str, out: Path, inputs: Inputs, force: bool
) -> Exported:
    """Write a serial arm."""
    arm: object = load(robot)
    if not isinstance(arm, SerialArm):
        raise ArgumentError(f"{robot}: --as {target} is for serial arms")
    lost = None if arm.laws is None else laws(arm)
    arm = arm.rigid
    with Output(out.parent, [out.name], inputs, force).draft() as draft:
        if target == "urdf":
            export.urdf(arm, draft / out.name)
        elif target == "sdf":
            export.sdf(arm, draft / out.name)
        elif target == "ur":
            export.universal_robots(arm, draft / out.name)
        else:
            export.dh(arm, draft / out.name, "standard" if target == "dh" else "modified")
    return Exported(arm.name, lost)


def _write(
    target: str,
    machine: Robot,
    path: Path,
    number: str | None,
    config: Input | None,
    project: bool,
) -> Loss | None:
    """Write one file, and say what is lost."""
    match target:
        case "c":
            return export.c_header(machine, path, _number(number))
        case "mjcf":
            return export.mjcf(machine, path)
        case "fmu":
            return export.fmu(machine, path)
        case "klipper":
            return export.klipper(machine, path, config, project)
        case "maslow":
            return export.maslow(machine, path, config, project)
        case "reprap":
            return export.reprap(machine, path, project, config)
        case "marlin":
            return export.marlin(machine, path, project)
        case "hangprinter":
            return export.hangprinter(machine, path, project, config)
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
