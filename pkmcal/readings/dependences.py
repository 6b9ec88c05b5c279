"""Statements of what readings and effects depend on: by names, by points; and what is refused."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from pkmcal.arguments import kind, shown
from pkmcal.arrays import FloatArray, IntArray
from pkmcal.exceptions import ArgumentError, ArgumentTypeError, named_failures, of_the_package
from pkmcal.readings.unknowns import ORIGIN, PLAIN, POINT, Dependence, Nature, Numbers, Start

_WHOLE_POINT = (0, 1, 2)
_TAKEN = {"frame": "the frames of instruments", "residual": "numbers that residuals bring"}
_NO_ARGUMENT = ("self", "at")  # which `predict` has for something else
_TARGETS = "target"  # the role of the points `Measurements.target`
_CARRIED = "tool"  # the role of poses on the platform in results


def yielded(owner: Any, data: Any) -> list[Dependence]:
    """The dependences that a reading or an effect states of some rows.

    Raises
    ------
    TypeError
        Something else than dependences.
    """
    what = f"{type(owner).__name__}: dependences"
    with named_failures(owner, what):
        given = owner.dependences(data)
        found = list(given) if isinstance(given, Iterable) else [given]
    for each in found:
        if not isinstance(each, Dependence):
            raise ArgumentTypeError(
                f"{what} has to yield objects of Dependence, as always(…) and point(…) return;"
                f" found {kind(each)}"
            )
        if not of_the_package(owner):
            _require_own(what, each)
            _require_nature(what, each, getattr(owner, "point", ""))
    return found


def _require_nature(what: str, each: Dependence, body: str) -> None:
    """Refuse targets that are not said to be points of the body that the class says they are of."""
    if each.role == _TARGETS and body and each.nature.point_of != body:
        raise ArgumentError(
            f"{what}: targets are points of the {body}, as the class says by its point, and nature"
            f" of {each.argument!r} does not say so; give nature=Nature({body!r}), or use point(…)"
        )


def _require_own(what: str, each: Dependence) -> None:
    """Refuse a dependence of a user's class that means something else to the package."""
    if each.role in _TAKEN:
        raise ArgumentError(
            f"{what}: the role {each.role!r} is that of {_TAKEN[each.role]}; give {each.argument!r}"
            " another one"
        )
    if each.argument in _NO_ARGUMENT or each.argument.endswith(ORIGIN):
        raise ArgumentError(f"{what}: an argument cannot be called {each.argument!r}")
    if each.role == _CARRIED and not each.nature.pose:
        raise ArgumentError(
            f"{what}: the role {_CARRIED!r} is that of poses on the platform, whose nature is"
            f' Nature("platform", pose=True); give {each.argument!r} another one'
        )
    last = len(each.estimated) - 1
    wrong = (each.index < 0) | (each.index > last)
    if each.estimated and wrong.any():
        raise ArgumentError(
            f"{each.argument}: index says which of {last + 1} numbers each row has, from 0 to"
            f" {last}; found {each.index[np.argmax(wrong)]} in row {np.argmax(wrong)}"
        )


def always(
    argument: str,
    role: str,
    numbers: Sequence[tuple[str, str]],
    names: Sequence[str],
    starts: Mapping[tuple[str, str], Start],
    scale: Sequence[float] | None = None,
    nature: Nature = PLAIN,
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
    nature : Nature, optional
        As in `Dependence`.

    Raises
    ------
    ValueError
        A name of which `starts` has no `Start`; names, numbers or a scale of another form.
    """
    if not all(isinstance(each, tuple) and [*map(type, each)] == [str, str] for each in numbers):
        raise ArgumentTypeError(
            f'{argument}: numbers must be names with units, as in (("zero", "mm"),); found'
            f" {shown(numbers)}"
        )
    if isinstance(names, str) or not isinstance(names, Sequence | np.ndarray):
        raise ArgumentTypeError(
            f'{argument}: names must be a sequence with one for each row, "" where there is but'
            f" one; found {shown(names)}"
        )
    if scale is not None and np.shape(scale) != (len(numbers),):
        raise ArgumentError(
            f"{argument}: scale must have one number for each of {len(numbers)}; found"
            f" {shown(scale)}"
        )
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
        whose = ".".join(filter(None, (str(role).partition(" ")[0], name)))
        estimated[name] = Numbers(
            tuple(f"{whose}.{number}" for number, _ in chosen),
            tuple(unit for _, unit in chosen),
            np.array(start.slots, dtype=np.intp),
            start.values,
            None if scale is None else np.array([scale[slot] for slot in start.slots]),
        )
    order = {name: i for i, name in enumerate(estimated)}
    index = np.array([order[name] for name in names], dtype=np.intp)
    return Dependence(
        argument, role, np.zeros((len(names), len(numbers))), estimated, index, nature
    )


def point(m: Any, argument: str, role: str, unknown: bool) -> Dependence:
    """A dependence on a point of platform or base, which the user places.

    Targets are points of the body that the class of the reading states as its `point`, attachments
    of the platform.
    """
    attached = role == "attachment"  # which moves with the platform's joints, axis by axis
    nature = Nature("platform" if attached else m.instrument.point, alone=attached)
    if not unknown:
        given = m.attachments if attached else m.targets
        one = np.zeros(len(m), dtype=np.intp)
        return Dependence(argument, role, given, {}, one, nature)
    places, index = points_of(role, m)
    units = tuple(unit for _, unit in POINT)
    estimated = {
        name: Numbers(
            tuple(f"{role}{name}.{axis}" for axis, _ in POINT), units, np.array(_WHOLE_POINT), place
        )
        for name, place in places.items()
    }
    given = np.array(list(places.values()))[index]  # which counts where they are held
    return Dependence(argument, role, given, estimated, index, nature)


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
