"""Thermal expansion: what a machine that is not at 20 °C reads, by stated coefficients.

The identified numbers are those of the machine at 20 °C, the reference temperature of ISO 1. Beside
it every length of base, platform and limbs is longer by its coefficient times the difference: what
is predicted of a row is moved by that, to first order, at each step of the search: what is left is
the square of 0.01 % and its like.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, TypeGuard

import numpy as np

from pkmcal.arguments import did_you_mean, shown
from pkmcal.arrays import FloatArray, IntArray
from pkmcal.effects.effect import Moved
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.measurements import Measurements
from pkmcal.readings.unknowns import Dependence

REFERENCE = 20.0  # °C
_LARGEST = 1e-3  # 1/K: no material; µm/m/K were meant
_PARTS = ("base", "platform", "limbs")
_LIMB = re.compile(r"limb([1-9][0-9]*)")


@dataclass(frozen=True)
class Expansion:
    """Thermal expansion, an effect that `identify` takes into account.

    With `Measurements.temperature` the numbers that are identified are those at 20 °C.

    Parameters
    ----------
    coefficients : float or mapping of str to float
        In 1/K, of steel 11.5e-6: one for all, or of "base", "platform" (with the targets on it),
        "limbs" or single ones, "limb3"; parts that are not named do not grow.

    Examples
    --------
    >>> Expansion({"base": 11.5e-6, "limb3": 23e-6})
    Expansion(coefficients={'base': 1.15e-05, 'limb3': 2.3e-05})
    """

    coefficients: float | Mapping[str, float]

    def of_machine(self, machine: Calibratable) -> MachineExpansion:
        """The coefficients of each number of a machine.

        Raises
        ------
        ValueError, TypeError
            An unknown part, no coefficient, a machine whose lengths are not among its numbers.
        """
        if not has_lengths(machine):
            raise ArgumentError(
                f"expansion: {machine.name} is an arm, or has limbs that are chains of joints or"
                " drives with laws: which of their numbers are lengths is not known; found"
                " coefficients"
            )
        limbs = machine.model.limbs
        of = {
            name: _coefficient(name, value)
            for name, value in _named(self.coefficients, len(limbs)).items()
        }
        numbers = machine.geometry.numbers
        coefficient, column = np.zeros(len(numbers)), np.zeros(len(numbers), dtype=np.intp)
        for i, number in enumerate(numbers):
            if number.limb < 0:  # of loads, and of what yields
                continue
            part = number.slot.partition(".")[0]
            part = "base" if part.startswith("over") else part
            if part in _PARTS:
                coefficient[i], column[i] = of.get(part, 0.0), _PARTS.index(part)
                continue
            actuator = limbs[number.limb].actuator
            scale = number.slot == "gain" and machine.actuator_units[actuator] == "mm"
            if number.unit == "mm" or scale:
                coefficient[i] = of.get(f"limb{number.limb + 1}", of.get("limbs", 0.0))
                column[i] = 2 + actuator
        return MachineExpansion(of, coefficient, column, of.get("platform", 0.0))


@dataclass(frozen=True, eq=False)
class MachineExpansion:
    """Growth of the numbers of a machine with temperature.

    Attributes
    ----------
    given : mapping of str to float
        The coefficients as stated.
    coefficient : ndarray (k,)
        Of each number of its limbs, 1/K; 0 of angles.
    column : ndarray of int (k,)
        Which of the temperatures of a row it has.
    platform : float
        Of the platform, with the targets on it, 1/K.
    """

    given: Mapping[str, float]
    coefficient: FloatArray
    column: IntArray
    platform: float
    name: ClassVar[str] = "expansion"

    def dependences(self, measured: Measurements) -> Iterator[Dependence]:
        """Return no coefficients to be found: those of expansion are given and exact."""
        return iter(())

    def of_rows(self, measured: Measurements) -> Growth:
        """Relative growth of each number (N, k), and of places on the platform (N,).

        Raises
        ------
        ValueError
            No temperature, or none of a part that grows.
        """
        if measured.temperature is None:
            raise ArgumentError(
                "expansion: the measurements have no temperature; the file needs a column"
                " temperature [°C]"
            )
        above = measured.temperature - REFERENCE
        by_number = above[:, self.column]
        by_number[:, self.coefficient == 0.0] = 0.0
        platform = above[:, 1] if self.platform else np.zeros(len(above))
        unread = np.isnan(by_number).any(axis=1) | np.isnan(platform)
        if unread.any():
            row = int(np.argmax(unread))
            where = f"row {row}" if measured.lines is None else f"line {measured.lines[row]}"
            file = f"{measured.file}, " if measured.file else ""
            raise ArgumentError(f"expansion: {file}{where}: a temperature is missing")
        return Growth(by_number * self.coefficient, platform * self.platform)


@dataclass(frozen=True, eq=False)
class Growth:
    """Relative growth of each number (N, k), and of places on the platform (N,)."""

    by_number: FloatArray
    of_platform: FloatArray

    def moved(
        self,
        machine: Any,
        pose: FloatArray,
        actuators: FloatArray,
        rows: IntArray,
        numbers: Mapping[str, FloatArray],
    ) -> Moved:
        """Compute the motion of the platform at poses (N, 6) of some rows."""
        k = self.by_number.shape[1]
        grown = machine.geometry.values[:k] * self.by_number[rows]
        twists = machine.error_twists(pose, actuators)[..., :k]
        twist = np.einsum("nij,nj->ni", twists, grown)
        return Moved(twist, growth=self.of_platform[rows])


def stated(effects: Sequence[object]) -> dict[str, float]:
    """The coefficients that were given, 1/K, by part; empty where the machine does not grow."""
    expansions = [each for each in effects if isinstance(each, MachineExpansion)]
    return {part: value for each in expansions for part, value in each.given.items()}


def has_lengths(robot: Calibratable) -> TypeGuard[Robot]:
    """Return whether a machine's numbers are lengths, so that their growth is known."""
    return robot.model.closed_form and not robot.model.driven


def _named(given: float | Mapping[str, float], limbs: int) -> Mapping[str, float]:
    if not isinstance(given, Mapping):
        return dict.fromkeys(_PARTS, given)
    for name in given:
        match = _LIMB.fullmatch(name) if isinstance(name, str) else None
        if name not in _PARTS and not (match and int(match[1]) <= limbs):
            known = [*_PARTS, *(f"limb{i + 1}" for i in range(limbs))]
            raise ArgumentError(
                f"expansion: of base, platform, limbs or limb1 to limb{limbs}; found"
                f" {name!r}{did_you_mean(str(name), known)}"
            )
    return given


def _coefficient(name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float | np.number):
        raise ArgumentTypeError(f"expansion: {name}: expected a number, found {shown(value)}")
    if not abs(float(value)) < _LARGEST:
        raise ArgumentError(f"expansion: {name}: in 1/K, of steel 11.5e-6; found {float(value):g}")
    return float(value)


def temperatures(sets: Iterable[Measurements]) -> tuple[float, float] | None:
    """The lowest and the highest that was read, °C; None where nothing was."""
    read = [m.temperature[np.isfinite(m.temperature)] for m in sets if m.temperature is not None]
    whole = np.concatenate(read) if read else np.empty(0)
    return (float(whole.min()), float(whole.max())) if whole.size else None


def in_words(sets: Sequence[Measurements], given: Mapping[str, float], robot: Calibratable) -> str:
    """Say how the temperatures that were read were used; "" where none were."""
    between = temperatures(sets)
    if between is None:
        return ""
    low, high = between
    span = f"{low:.4g} to {high:.4g} °C" if low < high else f"{low:.4g} °C"
    if not given:
        advice = (
            "; --expansion (effects=[pk.Expansion(…)]) states how it expands"
            if has_lengths(robot)
            else ""
        )
        return f"the machine was at {span}, which is not taken into account{advice}"
    return (
        f"numbers are those at {REFERENCE:g} °C; the machine was at {span}, expansion:"
        f" {coefficients(given)}, taken as exact: no ± contains their uncertainty"
    )


def coefficients(given: Mapping[str, float]) -> str:
    """The coefficients that were given, by part."""
    parts: dict[float, list[str]] = {}
    for name, coefficient in given.items():
        parts.setdefault(coefficient, []).append(name)
    return "; ".join(f"{', '.join(names)} {c * 1e6:.3g} µm/m/K" for c, names in parts.items())
