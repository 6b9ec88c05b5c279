"""A sheet of planned poses, with a box for each reading: what somebody takes to the machine."""

from __future__ import annotations

from typing import Any

import numpy as np

from pkmcal.display import displayed, fixed
from pkmcal.kinematics.calibratable import as_machine
from pkmcal.planning.plan_poses import Plan
from pkmcal.readings.registry import KINDS

_DECIMALS = 3


def sheet(made: Plan) -> dict[str, Any]:
    """Return title, headings and cells of the poses, and headings of what is to be written there.

    Coordinates that are 0 at every pose are left out; of an arm it has joints.
    """
    machine = as_machine(made.robot)
    given = machine.as_commands(made.poses, made.actuators)
    names, units = list(machine.commands), list(machine.commands.values())
    cells = [
        [fixed(displayed(float(value), unit)[0], _DECIMALS) for value in column]
        for column, unit in zip(given.T, units, strict=True)
    ]
    kept = [k for k, column in enumerate(cells) if any(float(cell) for cell in column)]
    head = [f"{names[k]} [{displayed(0.0, units[k])[1]}]" for k in kept]
    rows = [[str(i + 1), *(cells[k][i] for k in kept)] for i in range(len(given))]
    kinds = list(dict.fromkeys(made.kinds))
    if len(kinds) > 1:
        head.append("measure")
        rows = [[*row, kind] for row, kind in zip(rows, made.kinds, strict=True)]
    if made.load is not None:
        head.append("payload [kg]")
        masses = np.asarray(made.load.mass).tolist()
        rows = [[*row, f"{mass:g}"] for row, mass in zip(rows, masses, strict=True)]
    read = [heading for kind in kinds for heading in _read(made, kind)]
    return {
        "title": str(made).splitlines()[0], "head": ["pose", *head], "rows": rows,
        "read": list(dict.fromkeys(read)),
    }  # fmt: skip


def _read(made: Plan, kind: str) -> list[str]:
    """Headings of a kind's readings, of each point that is measured."""
    if kind not in KINDS:
        return []
    points = len(made.target.get(kind, ())) or 1
    heads = [f"{name} [{displayed(0.0, unit)[1]}]" for name, unit in KINDS[kind].components]
    if points == 1:
        return heads
    return [f"{k + 1}: {heading}" for k in range(points) for heading in heads]
