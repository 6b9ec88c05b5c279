"""Every kind of reading by its name."""

from pkmcal.readings.angles import Angle
from pkmcal.readings.closure import Closure
from pkmcal.readings.distances import Between, Distance, RelativeDistance
from pkmcal.readings.points import Height, Position
from pkmcal.readings.reading import Reading
from pkmcal.readings.touches import Touch, TouchDistance
from pkmcal.readings.turnings import Orientation, Pose, Tilt

_EVERY: tuple[Reading, ...] = (
    Pose(), Position(), Height(), Distance(), Closure(), Between(), RelativeDistance(),
    Orientation(), Tilt(), Angle(), Touch(), TouchDistance(),
)  # fmt: skip
KINDS: dict[str, Reading] = {each.name: each for each in _EVERY}
