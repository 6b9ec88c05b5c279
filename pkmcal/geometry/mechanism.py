"""The interface of the limbs of a machine, which each kind of them answers in its own module.

`pkmcal.geometry.limbs.Limbs` are limbs in closed form, `pkmcal.geometry.chains.Chains` chains of
joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from pkmcal.arrays import FloatArray, Unit
from pkmcal.display import Table
from pkmcal.geometry.laws import Law


class StatedDrive(NamedTuple):
    """A drive as the robot file states it.

    Attributes
    ----------
    actuator : int
        Its actuator, counted from 0; limbs in closed form may share one.
    law : Law or None
        What lies between the actuator's reading and its way beside gain and offset.
    unit : str
        Unit of its way, "mm" or "rad".
    stroke : tuple of float or None
        Limits of its way.
    limb : int
        Its limb, counted from 0.
    """

    actuator: int
    law: Law | None
    unit: Unit
    stroke: tuple[float, float] | None
    limb: int


class Mechanism(Protocol):
    """The limbs of a machine, apart from their numbers."""

    @property
    def closed_form(self) -> bool:
        """True if each limb is a driver and rows, and its numbers are places and lengths.

        Otherwise passive joints are eliminated, and the numbers are errors of joints.
        """

    @property
    def apart(self) -> bool:
        """True if each limb moves the platform for itself: no joint is of several, none behind."""

    @property
    def loose(self) -> bool:
        """True if limbs hold each other by joints that they share."""

    @property
    def tail(self) -> int:
        """Number of joints behind the platform."""

    @property
    def key_of_drives(self) -> str:
        """The key of a limb in a robot file at which its drive is stated."""

    @property
    def stated_drives(self) -> tuple[StatedDrive, ...]:
        """The drives, in the order of their numbers."""

    @property
    def first_drives(self) -> Sequence[int]:
        """The first drive of each limb, counted from 0; -1 where it has none."""

    @property
    def passive_names(self) -> tuple[str, ...]:
        """Passive joints whose angles a machine can say, in their order."""

    @property
    def read_at_home(self) -> FloatArray | None:
        """Ways of the drives at home, (n,), where the file states them; else None."""

    def row_actuators(self, rows: int) -> list[int]:
        """Return the actuator of each of so many closures; -1 of rows beside those of actuators."""

    def characteristic_length(self, slots: FloatArray) -> float:
        """Return the radius at which a rotation counts as its arc, mm."""

    def extent(self, slots: FloatArray, home: FloatArray) -> float:
        """Return a distance from the origin that the machine cannot reach beyond, mm."""

    def base_points(self, slots: FloatArray) -> FloatArray:
        """Return the base joint of each limb, (limbs, 3), mm."""

    def table(self, slots: FloatArray) -> Table:
        """Return a table of the limbs or of their joints."""
