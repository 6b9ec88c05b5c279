"""Dependences of readings beside the pose: points, zeros, artefacts; fixed or estimated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

from pkmcal.arrays import BoolArray, IntArray
from pkmcal.effects.effect import Effect
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.measurements.measurements import Measurements
from pkmcal.readings.dependences import points_of, yielded
from pkmcal.readings.unknowns import PLACE, Dependence, Numbers, Start

FRAME = "frame"  # the role of frames

__all__ = ["FRAME", "PLACE", "Dependence", "FitData", "Numbers", "Start", "points_of"]


@dataclass(frozen=True, eq=False)
class FitData:
    """Rows of one set of measurements, to be fitted or held out.

    Attributes
    ----------
    measured : Measurements
        These rows alone.
    rows : ndarray of int (N,)
        Their numbers in what the user gave, counted through all sets.
    unknown_frame, unknown_target, unknown_attachment : bool
        Which of them `identify` was asked to estimate.
    set_name : str
        Of the set, where it has a frame or points of its own.
    starts : mapping of (str, str) to Start
        Where the search begins for all that is never known before, by role and name.
    effects : tuple of Effect
        What moves the machine off the pose that geometry alone gives.
    """

    measured: Measurements
    rows: IntArray
    unknown_frame: bool
    unknown_target: bool
    unknown_attachment: bool = False
    set_name: str = ""
    starts: Mapping[tuple[str, str], Start] = field(default_factory=dict)
    effects: tuple[Effect, ...] = ()

    def select(self, chosen: IntArray | BoolArray) -> FitData:
        """Return the data of some of the rows."""
        return replace(self, measured=self.measured.select(chosen), rows=self.rows[chosen])

    def roles(self, unknown: str) -> tuple[str, ...]:
        """The roles of what is unknown of these rows if a word of `identify` says so."""
        instrument = self.measured.instrument
        found: dict[str, tuple[str, ...]] = {
            FRAME: (FRAME,),
            "target": instrument.unknown_with_target,
            "attachment": instrument.unknown_with_attachment,
        }
        return found[unknown]

    @property
    def framed(self) -> bool:
        """True if these readings depend on the unknown frame."""
        instrument = self.measured.instrument
        return bool(instrument.framed and (self.unknown_frame or not instrument.placed))

    @property
    def frame(self) -> tuple[str, str] | None:
        """Role and name of the unknown frame that these readings are in; None: of none."""
        return (FRAME, self.measured.instrument.frame_name) if self.framed else None

    @property
    def axis(self) -> IntArray | None:
        """The axis (N,) of its own from which each row's thing counts; None where none does."""
        found: IntArray | None = self.measured.instrument.axis(self)
        return found

    def dependences(self) -> Iterator[Dependence]:
        """Return the dependences of the readings beside pose and frame.

        Raises
        ------
        ValueError
            A dependence that does not have one entry for each row.
        """
        instrument = self.measured.instrument
        own = yielded(instrument, self)
        of_effects = [*chain.from_iterable(yielded(each, self.measured) for each in self.effects)]
        for each in of_effects:
            if each.nature.body:
                raise ArgumentError(
                    f"effects: {each.argument}: a place on the {each.nature.body} is of a reading"
                )
        for each in (*own, *of_effects):
            if not len(each.index) == len(each.given) == len(self.measured):
                raise ArgumentError(
                    f"{each.argument}: the dependence on it has {len(each.index)} names and"
                    f" {len(each.given)} given numbers; it needs one of each for each of"
                    f" {len(self.measured)} rows"
                )
            yield each


def refuse_free_poses(datasets: Sequence[FitData], robot: Calibratable) -> None:
    """Refuse what needs exact actuators, where poses have unknowns.

    Those are effects, and readings of joints and between poses.
    """
    effects = [effect.name for data in datasets for effect in data.effects]
    if effects:
        names = ", ".join(dict.fromkeys(effects))
        raise ArgumentError(
            f"{names}: needs poses that follow from the actuators: no actuator_sigma, and"
            " no surplus actuators; found others"
        )
    for m in (data.measured for data in datasets):
        if not m.instrument.follows_pose(robot):
            raise ArgumentError(
                f"measurements: readings of kind {m.kind!r} need poses that follow from the"
                " actuators: no actuator_sigma, and no surplus actuators"
            )
