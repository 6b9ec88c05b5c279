"""What acts on the platform of a machine on cables, and what these must and may pull."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pkmcal.arrays import Unit
from pkmcal.files.toml_table import Table

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Load:
    """A force on the platform, and the tensions that its cables may have.

    Attributes
    ----------
    force : tuple of float
        N, in the axes of the base.
    at : tuple of float
        Where it acts, in the platform's frame, mm.
    least, most : float
        Tension that every cable must have, and may have, N.
    """

    force: Vector = (0.0, 0.0, 0.0)
    at: Vector = (0.0, 0.0, 0.0)
    least: float = 0.0
    most: float = math.inf


def read_load(table: Table) -> Load:
    """The load of a table ``[load]``."""
    table.only(("force", "at", "least", "most"))
    found = Load(
        _vector(table, "force", "1"),
        _vector(table, "at", "mm"),
        table.number("least", "1", 0.0),
        table.number("most", "1", math.inf),
    )
    if found.least < 0.0:
        table.fail("least", f"must not be negative, found {found.least:g}")
    if not any(found.force) and found.least == 0.0:
        table.fail("", "least must be above 0 where no force acts: no tension at all balances it")
    if not found.most > found.least:
        table.fail("most", f"must be above least, {found.least:g} N, found {found.most:g}")
    return found


def _vector(table: Table, key: str, unit: Unit) -> Vector:
    if key not in table:
        return (0.0, 0.0, 0.0)
    x, y, z = (table.as_number(key, e, unit) for e in table.list_of(key, 3, "three numbers"))
    return (x, y, z)


def load_table(load: Load) -> dict[str, object]:
    """The table that `read_load` reads, in mm and N."""
    table: dict[str, object] = {
        "force": list(load.force),
        "at": list(load.at),
        "least": load.least,
    }
    return table | ({"most": load.most} if math.isfinite(load.most) else {})
