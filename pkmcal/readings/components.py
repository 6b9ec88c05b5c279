"""Components of a reading: the name and unit of each number of a value, and families by unit."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

Components = tuple[tuple[str, str], ...]


class Family(NamedTuple):
    """Components of a reading that have one unit.

    Attributes
    ----------
    unit : str
        Their unit.
    columns : tuple of int
        Which they are.
    """

    unit: str
    columns: tuple[int, ...] = ()

    @property
    def noun(self) -> str:
        """Noun for these readings."""
        return {"mm": "lengths", "rad": "angles"}.get(self.unit, f"readings in {self.unit}")


@cache
def names_of(components: Components) -> tuple[str, ...]:
    """Names of components."""
    return tuple(name for name, _ in components)


@cache
def units_of(components: Components) -> tuple[str, ...]:
    """Units of components."""
    return tuple(unit for _, unit in components)


@cache
def families_by_unit(units: tuple[str, ...]) -> tuple[Family, ...]:
    """Group components by their units into families."""
    return tuple(
        Family(unit, tuple(k for k, each in enumerate(units) if each == unit))
        for unit in dict.fromkeys(units)
    )
