"""`pkmcal machines`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import typer

from pkmcal import digits, loading
from pkmcal.arm_machine import ArmMachine
from pkmcal.cli_output import as_json
from pkmcal.core import POSE
from pkmcal.serial import SerialArm


def machines(
    json: Annotated[bool, typer.Option("--json", help="Print JSON alone.")] = False,
) -> int:
    """List the built-in machines.

    Their names stand wherever a command takes a robot file.

    Example: pkmcal machines
    """
    rows: dict[str, dict[str, Sequence[str]]] = {}
    for name in loading.machines():
        machine = loading.load(name)
        if isinstance(machine, SerialArm):
            free = ArmMachine(machine).model.free
            rows[name] = {"limbs": list(machine.kinds), "coordinates": POSE, "free": free}
            continue
        rows[name] = {
            "limbs": [limb.kind for limb in machine.model.limbs],
            "coordinates": machine.coordinates,
            "free": machine.model.free,
        }
    if json:
        typer.echo(as_json(rows))
        return 0
    table = (
        [
            name,
            ", ".join(f"{list(row['limbs']).count(k)} {k}" for k in dict.fromkeys(row["limbs"])),
            " ".join(row["coordinates"]),
            str(len(row["free"])),
        ]
        for name, row in rows.items()
    )
    typer.echo(digits.table(["machine", "limbs", "moves in", "free"], table, left=3))
    return 0
