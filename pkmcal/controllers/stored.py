"""The content of a firmware's file: a robot file made of it, and measurements it stores."""

from __future__ import annotations

from dataclasses import dataclass

from pkmcal.measurements.measurements import Measurements


@dataclass(frozen=True, eq=False)
class Stored:
    """The contents of a firmware's file.

    Attributes
    ----------
    text : str
        A robot file with its numbers.
    measurements : Measurements or None
        Heights of the nozzle, or lengths of belts at places that nobody measured.
    distances : Measurements or None
        Distances between points of a printed part.
    notes : tuple of str
        What it says besides and the robot file has not; files that were not there.
    """

    text: str
    measurements: Measurements | None = None
    distances: Measurements | None = None
    notes: tuple[str, ...] = ()
