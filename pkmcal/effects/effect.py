"""An effect: what moves a machine off the pose that geometry alone gives, in one class.

To first order: it turns and shifts the platform by a twist, which readings then follow. Its
coefficients are given, or found along with the geometry.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, Protocol

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.readings.unknowns import Dependence


class Moved(NamedTuple):
    """Twists (N, 6) of the platform, and their derivatives (N, 6, w) by each argument."""

    twist: FloatArray
    by: Mapping[str, FloatArray] = {}


class EffectOfRows(Protocol):
    """An effect in the rows of one set of measurements."""

    def moved(
        self, machine: Any, pose: FloatArray, actuators: FloatArray, rows: IntArray,
        numbers: Mapping[str, FloatArray],
    ) -> Moved:  # fmt: skip
        """How the platform moves at poses (N, 6) of some rows."""

    def growth_of_targets(self) -> FloatArray | None:
        """Relative growth of places on the platform (N,)."""


class Effect(Protocol):
    """What moves a machine off the pose that geometry alone gives."""

    def of_rows(self, measured: Any) -> EffectOfRows:
        """The effect in these rows; an error where what it needs was not read."""

    def dependences(self, measured: Any) -> Iterator[Dependence]:
        """Its coefficients."""
