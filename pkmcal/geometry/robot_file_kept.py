"""A user's robot file with other numbers: units, order, names and comments stay as they are.

tomlkit keeps what is around the values. What is written is read again and compared: no number is
off by more than rounding to the file's units makes it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pkmcal.core.library import AXES
from pkmcal.exceptions import FileError
from pkmcal.files.toml_lines import Source
from pkmcal.files.toml_table import Table, Units
from pkmcal.geometry import robot_file
from pkmcal.geometry.geometry import Geometry
from pkmcal.geometry.laws import LawNumber
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.geometry.limbs import Limb
from pkmcal.geometry.load import AT, CELL, FORCE, is_of_load
from pkmcal.geometry.model import Model
from pkmcal.geometry.ties import LimbNumber

if TYPE_CHECKING:
    from tomlkit.items import Item

_HEAD = re.compile(r"\A(?:#[^\n]*sha256[^\n]*\n|# Written by pkmcal [^\n]*\n)+")
_DEVIATION = re.compile(r"(?:;\s*)?±.*$")
_ROUNDING = 1e-13  # share of a number by which its unit may change it
_DIGITS = 2  # of a deviation


def text_like(
    source: Source, model: Model, deviations: Mapping[str, float] | None = None, comment: str = ""
) -> str:
    """The text of a file with the numbers of a model that came from it.

    Parameters
    ----------
    source : Source
        The file.
    model : Model
        Its robot, with other numbers of the geometry.
    deviations : mapping of str to float, optional
        Standard deviations by name, mm and rad: comments beside the numbers.
    comment : str
        Lines for its head, each with its ``#``; those that a command wrote there before go.

    Raises
    ------
    ValueError
        The model is not of this file.
    """
    import tomlkit

    before = robot_file.parse(source, None)
    if before.geometry.names != model.geometry.names or len(before.limbs) != len(model.limbs):
        raise FileError(f"{source.place}: describes another robot than the one to be written")
    document = tomlkit.parse(_HEAD.sub("", source.text))
    top = Table(source.data, source)
    edit = _Edit(robot_file.read_units(top), before.geometry, model.geometry, deviations or {})
    if "parameters" in document:
        edit.parameters(document["parameters"])
    if "load" in document:
        edit.load(document["load"])
    for i, (table, limb) in enumerate(zip(document["limb"], model.limbs, strict=True)):
        edit.limb(table, limb, i)
    text = comment + tomlkit.dumps(document)
    _check(text, source.place, model.geometry)
    return text.replace("\n", source.line_end)


class _Edit:
    """Writes the changed numbers into the tables of a document."""

    def __init__(
        self, units: Units, old: Geometry, new: Geometry, deviations: Mapping[str, float]
    ) -> None:
        self._units, self._old, self._new = units, old, new
        self._deviations = deviations
        self._unit_of = dict(zip(new.names, new.units, strict=True))
        self._tied = {number.name for number in new.numbers if number.tie is not None}

    def parameters(self, table: Any) -> None:
        """The section of named parameters."""
        for name in self._new.parameters:
            if self._concerns(name) and not is_of_load(name):
                self._put(table, name, self._written(name), [name])

    def load(self, table: Any) -> None:
        """The load, where its numbers are some of the geometry."""
        names = [name for name in self._new.parameters if is_of_load(name)]
        for key, lead in (("force", FORCE), ("at", AT), ("cells", CELL)):
            mine = [name for name in names if name.startswith(lead)]
            if not any(map(self._concerns, mine)):
                continue
            if key not in table:
                table[key] = [self._old[name] for name in mine]
            for k, name in enumerate(mine):
                if self._changed(name):
                    table[key][k] = self._written(name)
            self._comment(table[key], mine)

    def limb(self, table: Any, limb: Limb, i: int) -> None:
        """Write a limb, key by key."""
        numbers = {n.slot: n for n in self._new.numbers if n.limb == i and n.tie is None}
        kind = KINDS[limb.kind]
        for point in ("base", "platform"):
            self._point(table, point, [numbers.get(f"{point}.{axis}") for axis in "xyz"])
        for j in range(1, len(limb.parts)):
            self._list(table["over"], j - 1, [numbers.get(f"over{j}.{axis}") for axis in "xyz"])
        for axis, name in kind.axes_of(limb.couple > 0.0).items():
            self._list(table, f"{name}_tilt", [numbers.get(slot) for slot in AXES[axis]])
        for key, slot in {**kind.driver.lengths, "offset": "offset", "gain": "gain"}.items():
            if slot in numbers and self._concerns(name := numbers[slot].name):
                self._put(table, key, self._written(name), [name])
        if limb.law is not None:
            of_law = limb.law.numbers(i + 1, kind.actuator_unit)
            self._law(table["drive"], [n for n in of_law if n.name not in self._tied])

    def _law(self, drive: Any, numbers: list[LawNumber]) -> None:
        for number in numbers:
            if not self._changed(number.name):
                continue
            value = self._written(number.name)
            if number.key in ("cos", "sin"):
                self._put(drive["harmonics"][number.entry], number.key, value, [])
            elif number.key == "table":
                drive["table"][number.entry][1] = value
            else:
                self._put(drive, number.key, value, [])
        names = [number.name for number in numbers]
        if any(map(self._concerns, names)):
            self._comment(drive, names)

    def _point(self, table: Any, key: str, numbers: list[LimbNumber | None]) -> None:
        polar = isinstance(table[key], Mapping)
        x, y, z = numbers
        if not polar or x is None or y is None:
            if polar and z is not None and self._concerns(z.name):
                self._put(table[key], "z", self._written(z.name), [])
                self._comment(table[key], [z.name], ["z "])
            elif not polar:
                self._list(table, key, numbers)
            return
        if not (self._changed(x.name) or self._changed(y.name) or (z and self._changed(z.name))):
            return
        found = table[key]
        at = self._new[x.name], self._new[y.name]
        if self._changed(x.name) or self._changed(y.name):
            turned = math.atan2(at[1], at[0])
            given = float(found["angle"]) * self._units.angle
            turned += 2.0 * math.pi * round((given - turned) / (2.0 * math.pi))
            self._put(found, "radius", math.hypot(*at) / self._units.length, [])
            self._put(found, "angle", turned / self._units.angle, [])
        if z is not None and self._changed(z.name):
            self._put(found, "z", self._written(z.name), [])
        self._comment(found, [n.name for n in (x, y, z) if n is not None], ("x ", "y ", "z "))

    def _list(self, table: Any, key: str | int, numbers: list[LimbNumber | None]) -> None:
        names = [number.name for number in numbers if number is not None]
        if not any(map(self._concerns, names)):
            return
        if isinstance(key, str) and key not in table:
            table[key] = [0.0] * len(numbers)
        for k, number in enumerate(numbers):
            if number is not None and self._changed(number.name):
                table[key][k] = self._written(number.name)
        self._comment(table[key], names)

    def _put(self, table: Any, key: str, value: float, names: list[str]) -> None:
        """Replace a value, its comment and its place on the line kept."""
        import tomlkit

        item = tomlkit.item(value)
        if key in table:
            if names and not any(map(self._changed, names)):
                item = table[key]
            else:
                old = table.item(key) if hasattr(table, "item") else table[key]
                trivia = getattr(old, "trivia", None)
                table[key] = item
                item = table.item(key) if hasattr(table, "item") else table[key]
                if trivia is not None:
                    for part in ("indent", "comment_ws", "comment", "trail"):
                        setattr(item.trivia, part, getattr(trivia, part))
        else:
            table[key] = item
            item = table[key]
        if names:
            self._comment(item, names)

    def _comment(self, item: Item, names: list[str], of: Sequence[str] = ()) -> None:
        """Say the deviations behind what the user says there.

        `of` says before each what it is of, where the line holds other numbers than `names`: x and
        y beside a radius and an angle.
        """
        sigmas = [self._deviations.get(name) for name in names]
        said = _DEVIATION.sub("", item.trivia.comment.lstrip("#").strip()).strip()
        if any(sigma is not None for sigma in sigmas):
            shown = ", ".join(
                what + ("fixed" if sigma is None else self._deviation(name, sigma))
                for name, sigma, what in zip(names, sigmas, of or [""] * len(names), strict=False)
            )
            said = f"{said}; ± {shown}" if said else f"± {shown}"
        if said != item.trivia.comment.lstrip("#").strip():
            item.comment(said)
            item.trivia.comment_ws = item.trivia.comment_ws or "  "

    def _deviation(self, name: str, sigma: float) -> str:
        if not math.isfinite(sigma):
            return "inf"
        return f"{sigma / self._units.factor(self._unit_of[name]):.{_DIGITS}g}"

    def _changed(self, name: str) -> bool:
        return bool(self._old[name] != self._new[name])

    def _concerns(self, name: str) -> bool:
        return self._changed(name) or name in self._deviations

    def _written(self, name: str) -> float:
        """A number in the file's unit, so that it is read back to the last bit if any is."""
        value, factor = float(self._new[name]), self._units.factor(self._unit_of[name])
        written = value / factor
        near = (written, math.nextafter(written, math.inf), math.nextafter(written, -math.inf))
        return next((each for each in near if each * factor == value), written)


def _check(text: str, place: str, geometry: Geometry) -> None:
    """Read what is to be written, and compare."""
    again = robot_file.parse(Source(text.encode(), place), None).geometry
    size = np.abs(geometry.values).max(initial=1.0)
    off = np.abs(again.values - geometry.values)
    if again.names != geometry.names or (off > _ROUNDING * size).any():
        raise FileError(f"{place}: cannot be written with other numbers")
