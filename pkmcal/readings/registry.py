"""Every kind of reading by its name."""

from __future__ import annotations

from typing import Literal, cast

from pkmcal.arguments import shown, word
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.readings.angles import Angle
from pkmcal.readings.camera import Camera
from pkmcal.readings.closure import Closure
from pkmcal.readings.distances import Between, Distance, RelativeDistance
from pkmcal.readings.points import Height, Position
from pkmcal.readings.reading import Reading
from pkmcal.readings.touches import Touch, TouchDistance
from pkmcal.readings.turnings import Orientation, Pose, Tilt

Kind = Literal[
    "pose", "position", "height", "distance", "closure",
    "between", "relative-distance", "orientation", "tilt", "angle", "touch", "touch-distance",
    "pixel",
]  # fmt: skip

_EVERY: tuple[Reading, ...] = (
    Pose(), Position(), Height(), Distance(), Closure(), Between(), RelativeDistance(),
    Orientation(), Tilt(), Angle(), Touch(), TouchDistance(),
    Camera(),
)  # fmt: skip
KINDS: dict[Kind, Reading] = {cast(Kind, each.name): each for each in _EVERY}


def as_reading(given: Kind | Reading, argument: str = "kind") -> Reading:
    """The instrument itself, or the one that a word stands for."""
    if isinstance(given, Reading):
        return given
    if not isinstance(given, str):
        raise ArgumentTypeError(f"{argument} must be a word or a Reading, found {shown(given)}")
    return KINDS[word(argument, given, KINDS)]


def stated(kind: Kind | Reading | str | None, instrument: Reading | None) -> Reading:
    """The instrument that `kind` and `instrument` state."""
    own = None if instrument is None else as_reading(instrument, "instrument")
    if kind is None:
        return as_reading("position") if own is None else own
    if own is None or not isinstance(kind, str):
        return as_reading(kind)  # type: ignore[arg-type]
    if kind != own.name:
        raise ArgumentError(
            f"kind: {kind!r} contradicts the instrument, {type(own).__name__}; an object, such as"
            " kind=pkmcal.readings.Pose(), takes the place of both"
        )
    return own
