"""What readings depend on beside the pose: points, zeros, artefacts; given, or found along."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray, Unit
from pkmcal.estimation.expansion import Expansion
from pkmcal.exceptions import ArgumentError
from pkmcal.measurements.components import KINDS
from pkmcal.measurements.measurements import Measurements

PLACE = KINDS["pose"].components  # names and units, of frames too
_POINT, _ANGLES = PLACE[:3], PLACE[3:]
_WHOLE_POINT = (0, 1, 2)


@dataclass(frozen=True, eq=False)
class Numbers:
    """Numbers that are found along, and that some rows have in common: a point, a zero.

    Attributes
    ----------
    names : tuple of str
        Of the parameters, as ``touch.A.x``.
    units : tuple of str
        Their units.
    slots : ndarray of int
        Which numbers of the argument they are.
    start : ndarray
        Where the search for them starts.
    """

    names: tuple[str, ...]
    units: tuple[Unit, ...]
    slots: IntArray
    start: FloatArray


@dataclass(frozen=True, eq=False)
class Dependence:
    """What an argument of `predict` is in the rows of a set.

    Attributes
    ----------
    argument : str
        Its name there.
    role : str
        What it is to users: "target", "anchor", "attachment", "tool", "run", "angle" …
    given : ndarray (N, w)
        Its numbers, as far as they are known.
    sought : mapping of str to Numbers
        Those that are found along, by the name that rows have in common.
    index : ndarray of int (N,)
        Which of them each row has, in their order.
    """

    argument: str
    role: str
    given: FloatArray
    sought: Mapping[str, Numbers]
    index: IntArray


@dataclass(frozen=True, eq=False)
class Start:
    """Where an artefact, a zero or a sensor is found with the nominal machine.

    Attributes
    ----------
    slots : tuple of int
        Which numbers of the argument are sought: a plane has one place and two turnings.
    values : ndarray
        Their values.
    along : int
        Which axis of its own a line has, or is normal to a plane: 0, 1 or 2.
    """

    slots: tuple[int, ...]
    values: FloatArray
    along: int = 0


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
        Which of them `identify` was asked to find along.
    set_name : str
        Of the set, where it has a frame or points of its own.
    starts : mapping of (str, str) to Start
        Of all that is always found along, by role and name.
    expansion : Expansion or None
        How the machine grows with its temperature.
    """

    measured: Measurements
    rows: IntArray
    unknown_frame: bool
    unknown_target: bool
    unknown_attachment: bool = False
    set_name: str = ""
    starts: Mapping[tuple[str, str], Start] = field(default_factory=dict)
    expansion: Expansion | None = None

    def select(self, chosen: IntArray | BoolArray) -> FitData:
        """Some of the rows."""
        return replace(self, measured=self.measured.select(chosen), rows=self.rows[chosen])

    @property
    def framed(self) -> bool:
        """Whether these readings depend on the unknown frame."""
        return self.unknown_frame and KINDS[self.measured.kind].framed

    @property
    def along(self) -> IntArray | None:
        """Of touched lines and planes, which axis of its own each row's has, (N,)."""
        touched = self.measured.touched
        if touched is None:
            return None
        return np.array([self.starts["touch", name].along for name in touched.tolist()])

    def dependences(self) -> Iterator[Dependence]:
        """What the readings depend on beside the pose and the frame."""
        m = self.measured
        if KINDS[m.kind].point == "platform":
            yield self._point("target", "target", self.unknown_target)
        if m.kind == "pose" and self.unknown_target:
            yield self._always("tool", "tool", PLACE, [""] * len(m))
        if KINDS[m.kind].point == "base":
            yield self._point("target", "attachment", self.unknown_attachment)
            yield self._point("anchor", "anchor", self.unknown_target)
        if m.run is not None:
            yield self._always("zero", "run", (("zero", "mm"),), m.run.tolist())
        if m.joint is not None:
            yield self._always("zero", "angle", (("zero", "rad"),), [m.joint] * len(m))
        if m.kind == "tilt" or (m.kind == "orientation" and self.unknown_target):
            yield self._always("mounting", "mounting", _ANGLES, [""] * len(m))
        if m.touched is not None:
            names = m.touched.tolist()
            if m.artefact == "sphere":
                yield self._always("anchor", "touch", _POINT, names)
                yield self._always("zero", "touch radius", (("radius", "mm"),), names)
            else:
                yield self._always("place", "touch", PLACE, names)
        if m.kind == "touch-distance":
            one, other = zip(*((one, other) for one, other, _, _ in m.touch_distances), strict=True)
            yield self._always("place", "touch", PLACE, one)
            yield self._always("anchor", "touch", _POINT, other)

    def _point(self, argument: str, role: str, unknown: bool) -> Dependence:
        """A point of platform or base, which the user places."""
        m = self.measured
        if not unknown:
            given = m.attachments if role == "attachment" else m.targets
            return Dependence(argument, role, given, {}, np.zeros(len(m), dtype=np.intp))
        places, index = points_of(role, m)
        units = tuple(unit for _, unit in _POINT)
        sought = {
            name: Numbers(
                tuple(f"{role}{name}.{axis}" for axis, _ in _POINT),
                units,
                np.array(_WHOLE_POINT),
                place,
            )
            for name, place in places.items()
        }
        given = np.array(list(places.values()))[index]  # which counts where they are held
        return Dependence(argument, role, given, sought, index)

    def _always(
        self,
        argument: str,
        role: str,
        numbers: Sequence[tuple[str, Unit]],
        names: Sequence[str],
    ) -> Dependence:
        """What is never known before: `numbers` are the argument's, `names` (N,) whose they are."""
        sought = {}
        for name in dict.fromkeys(names):
            start = self.starts[role, name]
            chosen = [numbers[slot] for slot in start.slots]
            whose = ".".join(filter(None, (role.partition(" ")[0], name)))
            sought[name] = Numbers(
                tuple(f"{whose}.{number}" for number, _ in chosen),
                tuple(unit for _, unit in chosen),
                np.array(start.slots, dtype=np.intp),
                start.values,
            )
        order = {name: i for i, name in enumerate(sought)}
        index = np.array([order[name] for name in names], dtype=np.intp)
        return Dependence(argument, role, np.zeros((len(names), len(numbers))), sought, index)


def points_of(role: str, measured: Measurements) -> tuple[dict[str, FloatArray], IntArray]:
    """The points of one role by name, where the user puts them, and which one each row has."""
    given = measured.attachment if role == "attachment" else measured.target
    names, index = measured.target_names, measured.target_index
    one = given is None if role == "attachment" else names is None and given is None
    if one or (given is not None and given.ndim == 1):
        place = np.zeros(3) if given is None else given
        return {"1": place}, np.zeros(len(measured), dtype=np.intp)
    if names is None or index is None:
        raise ArgumentError(
            f"{role}: one place per row cannot be estimated; say with target_index which of a few"
            " each row measured"
        )
    places = np.zeros((len(names), 3)) if given is None else given
    return dict(zip(names, places, strict=True)), index
