"""The load on the platform of a machine on cables, and limits of the cables' tensions."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from pkmcal.arrays import Unit
from pkmcal.files.toml_table import Table, shown

FORCE, AT, CELL = "load.force", "load.at", "load.cell"  # begin names of its numbers

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class CableLoad:
    """A force on the platform, and the tensions that its cables may have.

    Attributes
    ----------
    force : tuple of float
        N, in the axes of the base.
    at : tuple of float
        Where it acts, in the platform's frame, mm.
    least, most : float
        Tension that every cable must have, and may have, N.
    balance : bool
        Whether the tensions of a calibration's rows balance it. Its numbers are then some of the
        geometry: ``load.force.x`` …, ``load.at.x`` …, ``load.cell1`` ….
    cells : tuple of float
        What the load cell of each actuator reads per N; where the load is balanced.
    """

    force: Vector = (0.0, 0.0, 0.0)
    at: Vector = (0.0, 0.0, 0.0)
    least: float = 0.0
    most: float = math.inf
    balance: bool = False
    cells: tuple[float, ...] = ()

    @property
    def units(self) -> dict[str, Unit]:
        """Names and units of its numbers; none where it need not be balanced."""
        if not self.balance:
            return {}
        cells = range(1, len(self.cells) + 1)
        return {
            **{f"{FORCE}.{axis}": "N" for axis in "xyz"},
            **{f"{AT}.{axis}": "mm" for axis in "xyz"},
            **{f"{CELL}{i}": "1" for i in cells},
        }

    @property
    def numbers(self) -> dict[str, float]:
        """Values of the load's numbers, N and mm."""
        values = (*self.force, *self.at, *self.cells)
        return dict(zip(self.units, values, strict=False))

    def with_numbers(self, numbers: Mapping[str, float]) -> CableLoad:
        """Return the load with the numbers of a geometry."""
        if not self.balance:
            return self
        fx, fy, fz, x, y, z, *cells = (numbers[name] for name in self.units)
        return replace(self, force=(fx, fy, fz), at=(x, y, z), cells=tuple(cells))


def is_of_load(name: str) -> bool:
    """Return whether a number of the geometry is one of the load."""
    return name.startswith("load.")


def read_load(table: Table, actuators: int) -> CableLoad:
    """The load of a table ``[load]``, of a robot with so many actuators."""
    table.only(("force", "at", "least", "most", "balance", "cells"))
    balance = table.data.get("balance", False)
    if not isinstance(balance, bool):
        table.fail("balance", f"must be true or false, found {shown(balance)}")
    if "cells" in table and not balance:
        table.fail("cells", "are gains of load cells of a load with balance = true")
    found = CableLoad(
        _vector(table, "force", "1"),
        _vector(table, "at", "mm"),
        table.number("least", "1", 0.0),
        table.number("most", "1", math.inf),
        balance,
        _cells(table, actuators) if balance else (),
    )
    if balance and not any(found.force):
        table.fail("force", "must be stated: there is nothing to balance")
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


def _cells(table: Table, actuators: int) -> tuple[float, ...]:
    if "cells" not in table:
        return (1.0,) * actuators
    each = table.list_of("cells", actuators, f"{actuators} numbers, one for each actuator")
    return tuple(table.as_number("cells", value, "1") for value in each)


def load_table(load: CableLoad) -> dict[str, object]:
    """The table that `read_load` reads, in mm and N."""
    table: dict[str, object] = {
        "force": list(load.force),
        "at": list(load.at),
        "least": load.least,
    }
    if math.isfinite(load.most):
        table["most"] = load.most
    return table | ({"balance": True, "cells": list(load.cells)} if load.balance else {})
