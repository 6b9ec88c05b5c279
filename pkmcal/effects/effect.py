"""An effect: what moves a machine off the pose that geometry alone gives, in one class.

To first order: it turns and shifts the platform by a twist, which readings then follow. Its
coefficients are given, or estimated with the geometry. An effect that is not in the package is an
object with the members of `Effect`; `identify(effects=[...])` takes it. What the kinematics of a
machine take into account is an effect, too: a `Changed` machine, with numbers that are free.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.readings.unknowns import Dependence


class Moved(NamedTuple):
    """Motion of the platform by an effect in some rows.

    Attributes
    ----------
    twist : ndarray (N, 6)
        ω in rad, then the shift of the platform's origin in mm, in base axes.
    by : mapping of str to ndarray (N, 6, w)
        Its derivative by each argument of the effect that may be estimated.
    growth : ndarray (N,) or None
        Relative growth of places on the platform.
    growth_by : mapping of str to ndarray (N, w)
        Its derivative by each argument that may be estimated.
    """

    twist: FloatArray
    by: Mapping[str, FloatArray] = {}
    growth: FloatArray | None = None
    growth_by: Mapping[str, FloatArray] = {}


class EffectOfRows(Protocol):
    """An effect in the rows of one set of measurements."""

    def moved(
        self,
        machine: Any,
        pose: FloatArray,
        actuators: FloatArray,
        rows: IntArray,
        numbers: Mapping[str, FloatArray],
    ) -> Moved:
        """Compute the platform's motion in some rows, by their numbers among those of the set.

        `machine` is that of these rows, `pose` (N, 6) and `actuators` (N, n) are where it is.
        `numbers` are the arguments (M, w) of all rows of the set, by name.
        """


class Effect(Protocol):
    """An effect: it moves a machine off the pose that geometry alone gives."""

    @property
    def name(self) -> str:
        """Name of the effect in messages."""

    def of_rows(self, measured: Any) -> EffectOfRows:
        """The effect in these rows; an error where what it needs was not read."""

    def dependences(self, measured: Any) -> Iterator[Dependence]:
        """Return the effect's coefficients; no reading and no other effect has their names."""


class Changed(NamedTuple):
    """An effect that is numbers of the machine itself, which its kinematics take into account.

    Attributes
    ----------
    name : str
        As messages say it.
    machine : Calibratable
        The machine with these numbers.
    free : mapping of str to float
        Which of its numbers the effect frees, and the standard deviation of what is known of each,
        about its present value; inf where nothing is.
    """

    name: str
    machine: Any
    free: Mapping[str, float]


class StatedEffect(Protocol):
    """An effect that is stated of any machine, and asks the machine what it is there."""

    def of_machine(self, machine: Any) -> Effect | Changed:
        """The effect on this machine."""


Effects = Effect | StatedEffect | Sequence[Effect | StatedEffect]
