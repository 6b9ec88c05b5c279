"""`pkmcal machines`."""

from __future__ import annotations

from collections.abc import Sequence

from pkmcal import display, loading
from pkmcal.arms.arm import SerialArm
from pkmcal.cli.options import Json
from pkmcal.cli.output import say
from pkmcal.core.library import POSE
from pkmcal.kinematics.arm_machine import ArmMachine
from pkmcal.report.as_json import as_json


def machines(json: Json = False) -> int:
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
        say(as_json(rows))
        return 0
    table = [
        [
            name,
            ", ".join(f"{list(row['limbs']).count(k)} {k}" for k in dict.fromkeys(row["limbs"])),
            " ".join(row["coordinates"]),
            str(len(row["free"])),
        ]
        for name, row in rows.items()
    ]
    say(str(display.Table(["machine", "limbs", "moves in", "free"], table, left=3)))
    return 0
