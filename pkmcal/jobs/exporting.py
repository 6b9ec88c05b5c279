"""Writes a machine for a controller, as an `Exporting` says."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pkmcal.arguments import word
from pkmcal.arms.arm import SerialArm
from pkmcal.controllers.loss import Loss
from pkmcal.controllers.target import OPTIONS, Target
from pkmcal.controllers.targets import targets
from pkmcal.exceptions import ArgumentError
from pkmcal.jobs.configuration import Exporting
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.output import Output
from pkmcal.kinematics.robot import Robot
from pkmcal.loading import load


@dataclass(frozen=True)
class Exported:
    """The files that were written.

    Attributes
    ----------
    name : str
        The machine.
    loss : Loss or None
        What the controller does not hold.
    said : str
        Words before the loss where it is not that of what was written.
    """

    name: str
    loss: Loss | None
    said: str = ""

    def __str__(self) -> str:
        return self.name + (
            f"; {self.said}{self.loss}" if self.loss and not self.loss.exact else ""
        )


def run(job: Exporting, inputs: Inputs, force: bool) -> Exported:
    """Write the machine.

    Raises
    ------
    ValueError
        What the controller cannot hold, an option of another target, a file that would be lost.
    """
    known = targets()
    target = known[word("--as", job.target, known)]
    given = {name: getattr(job, name) for name in OPTIONS if getattr(job, name)}
    for name in given:
        if name not in target.options:
            raise ArgumentError(f"--{name} says nothing of --as {target.name}")
    if job.out is None:
        raise ArgumentError("--out: where to write is missing")
    out = Path(job.out)
    machine = load(inputs.robot(job.robot))
    if job.config is not None:
        given["config"] = inputs.file(job.config)
    if given.get("number") not in (None, "double", "float"):
        raise ArgumentError(f"--number must be double or float, found {job.number!r}")
    write = _folder if target.folder else _file
    return Exported(machine.name, write(target, machine, out, given, inputs, force), target.said)


def _file(
    target: Target,
    machine: Robot | SerialArm,
    out: Path,
    given: Mapping[str, Any],
    inputs: Inputs,
    force: bool,
) -> Loss | None:
    with Output(out.parent, [out.name], inputs, force).draft() as draft:
        return target.export(machine, draft / out.name, given)


def _folder(
    target: Target,
    machine: Robot | SerialArm,
    out: Path,
    given: Mapping[str, Any],
    inputs: Inputs,
    force: bool,
) -> Loss | None:
    """Write a folder; only then it is known which files it has."""
    with tempfile.TemporaryDirectory(prefix="pkmcal-") as made:
        written = Path(made) / out.resolve().name
        loss = target.export(machine, written, given)
        names = sorted(each.name for each in written.iterdir())
        with Output(out, names, inputs, force).draft() as draft:
            shutil.copytree(written, draft, dirs_exist_ok=True)
    return loss
