"""Dependences of readings beside the pose: numbers that are fixed or estimated."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pkmcal.arguments import kind
from pkmcal.arrays import FloatArray, IntArray, Unit
from pkmcal.exceptions import ArgumentError, ArgumentTypeError

POINT: tuple[tuple[str, Unit], ...] = (("x", "mm"), ("y", "mm"), ("z", "mm"))
ANGLES: tuple[tuple[str, Unit], ...] = (("alpha", "rad"), ("beta", "rad"), ("gamma", "rad"))
PLACE = POINT + ANGLES
_WHOLE_POINT = (0, 1, 2)


@dataclass(frozen=True, eq=False)
class Numbers:
    """Estimated numbers that some rows have in common: a point, a zero.

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
    scale : ndarray or None
        Change of each that moves readings about as 1 mm of the machine does; None: by the unit.
    spread : ndarray (w, w) or None
        Covariance of what is known of them: they are not looked for, but fitted along near where
        they start. None: nothing is known.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    slots: IntArray
    start: FloatArray
    scale: FloatArray | None = None
    spread: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Dependence:
    """A dependence: an argument of `Reading.predict` in the rows of a set.

    Attributes
    ----------
    argument : str
        Its name there.
    role : str
        What it is to users: "target", "anchor", "attachment", "tool", "run", "angle" …
    given : ndarray (N, w)
        Its numbers in each row of the set, as far as they are known.
    estimated : mapping of str to Numbers
        Those that are estimated, by the name that rows have in common.
    index : ndarray of int (N,)
        Which of them each row has, in their order.
    """

    argument: str
    role: str
    given: FloatArray
    estimated: Mapping[str, Numbers]
    index: IntArray


def yielded(owner: object, given: object) -> Iterator[Dependence]:
    """Iterate over what the method `dependences` of a reading or an effect returned.

    Raises
    ------
    TypeError
        Something else than dependences.
    """
    for each in given if isinstance(given, Iterable) else (given,):
        if not isinstance(each, Dependence):
            raise ArgumentTypeError(
                f"{type(owner).__name__}: dependences has to yield objects of Dependence, as"
                f" always(…) and point(…) return; found {kind(each)}"
            )
        yield each


@dataclass(frozen=True, eq=False)
class Start:
    """The start of an artefact, a zero or a sensor, found with the nominal machine.

    Attributes
    ----------
    slots : tuple of int
        Which numbers of the argument are estimated: a plane has one place and two turnings.
    values : ndarray
        Their values.
    axis : int
        Which axis of its own a line has, or is normal to a plane: 0, 1 or 2.
    """

    slots: tuple[int, ...]
    values: FloatArray
    axis: int = 0

    def __post_init__(self) -> None:
        values = np.asarray(self.values, dtype=np.float64)
        if values.shape != (len(self.slots),):
            raise ArgumentError(
                f"Start: {len(self.slots)} slots {tuple(self.slots)} need as many values; found"
                f" shape {values.shape}"
            )
        object.__setattr__(self, "values", values)


Found = dict[tuple[str, str], Start]  # by role and name


def always(
    argument: str,
    role: str,
    numbers: Sequence[tuple[str, str]],
    names: Sequence[str],
    starts: Mapping[tuple[str, str], Start],
    scale: Sequence[float] | None = None,
) -> Dependence:
    """A dependence on numbers that are never known before.

    Parameters
    ----------
    argument : str
        Of `Reading.predict`.
    role : str
        What it is to users, as in `Dependence`.
    numbers : sequence of (str, str)
        Name and unit of each number of the argument.
    names : sequence of str, N
        Which run, artefact or sensor each row has; "" where there is but one.
    starts : mapping of (str, str) to Start
        Where the search for each begins, by role and name.
    scale : sequence of float, optional
        Of each number, as in `Numbers`; needed where its unit is none of the package's.

    Raises
    ------
    ValueError
        A name of which `starts` has no `Start`.
    """
    estimated = {}
    for name in dict.fromkeys(names):
        start = starts.get((role, name))
        if not isinstance(start, Start):
            raise ArgumentError(
                f"{argument}: the search for {role} {str(name)!r} has no start: the method starts"
                f" of the reading has to set found[{role!r}, {str(name)!r}] = Start(…)"
            )
        if not set(start.slots) <= {*range(len(numbers))}:
            raise ArgumentError(
                f"{argument}: the start of {role} {str(name)!r} has slots {tuple(start.slots)},"
                f" and the argument {len(numbers)} numbers, from 0"
            )
        chosen = [numbers[slot] for slot in start.slots]
        whose = ".".join(filter(None, (role.partition(" ")[0], name)))
        estimated[name] = Numbers(
            tuple(f"{whose}.{number}" for number, _ in chosen),
            tuple(unit for _, unit in chosen),
            np.array(start.slots, dtype=np.intp),
            start.values,
            None if scale is None else np.array([scale[slot] for slot in start.slots]),
        )
    order = {name: i for i, name in enumerate(estimated)}
    index = np.array([order[name] for name in names], dtype=np.intp)
    return Dependence(argument, role, np.zeros((len(names), len(numbers))), estimated, index)


def point(m: Any, argument: str, role: str, unknown: bool) -> Dependence:
    """A dependence on a point of platform or base, which the user places."""
    if not unknown:
        given = m.attachments if role == "attachment" else m.targets
        return Dependence(argument, role, given, {}, np.zeros(len(m), dtype=np.intp))
    places, index = points_of(role, m)
    units = tuple(unit for _, unit in POINT)
    estimated = {
        name: Numbers(
            tuple(f"{role}{name}.{axis}" for axis, _ in POINT), units, np.array(_WHOLE_POINT), place
        )
        for name, place in places.items()
    }
    given = np.array(list(places.values()))[index]  # which counts where they are held
    return Dependence(argument, role, given, estimated, index)


def points_of(role: str, measured: Any) -> tuple[dict[str, FloatArray], IntArray]:
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
