"""Dependences of readings beside the pose: numbers that are fixed or estimated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from pkmcal.arguments import kind, shown
from pkmcal.arrays import FloatArray, IntArray, Unit
from pkmcal.exceptions import ArgumentError, ArgumentTypeError

POINT: tuple[tuple[str, Unit], ...] = (("x", "mm"), ("y", "mm"), ("z", "mm"))
ANGLES: tuple[tuple[str, Unit], ...] = (("alpha", "rad"), ("beta", "rad"), ("gamma", "rad"))
PLACE = POINT + ANGLES
Body = Literal["platform", "base", ""]
ORIGIN = "_origin"  # behind the name of a carried pose: the argument of `predict` with its origin


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

    def __post_init__(self) -> None:
        sizes = {
            "names": len(self.names),
            "units": len(self.units),
            "slots": len(self.slots),
            "start": len(self.start),
            "scale": len(self.names if self.scale is None else self.scale),
        }
        if len({*sizes.values()}) > 1:
            found = ", ".join(f"{size} {name}" for name, size in sizes.items())
            raise ArgumentError(f"Numbers: as many of each are needed; found {found}")
        what = f"Numbers {', '.join(map(str, self.names))}"
        for own, each in (("names", self.names), ("units", self.units)):
            if not all(isinstance(word, str) for word in each):
                raise ArgumentTypeError(f"{what}: {own} must be words; found {shown(each)}")
        slots = _array(f"{what}: slots", self.slots, "iu")
        if (slots < 0).any() or len({*slots.tolist()}) < len(slots):
            raise ArgumentError(
                f"{what}: slots must be different numbers from 0; found {slots.tolist()}"
            )
        object.__setattr__(self, "slots", slots)
        object.__setattr__(self, "start", _array(f"{what}: start", self.start, "iuf"))
        if self.scale is not None:
            scale = _array(f"{what}: scale", self.scale, "iuf")
            if not ((scale > 0.0) & np.isfinite(scale)).all():
                raise ArgumentError(f"{what}: scale must be positive; found {scale.tolist()}")
            object.__setattr__(self, "scale", scale)
        if self.spread is not None:
            spread, w = _array(f"{what}: spread", self.spread, "iuf"), len(slots)
            symmetric = spread.shape == (w, w) and np.array_equal(spread, spread.T)
            finite = np.isfinite(spread).all()
            if not (symmetric and finite) or (np.linalg.eigvalsh(spread) < 0.0).any():
                raise ArgumentError(
                    f"{what}: spread must be the covariance ({w}, {w}) of what is known of them;"
                    f" found {shown(self.spread)}"
                )
            object.__setattr__(self, "spread", spread)


class Nature(NamedTuple):
    """What numbers that readings depend on are to a calibration.

    Attributes
    ----------
    body : {"platform", "base", ""}
        The body on which they are a place that somebody chose: a point grows, is placed and is
        turned with its body. "": no such place.
    pose : bool
        Whether they are all six numbers of the pose of what the platform carries. It is found with
        the frame, by `Reading.places_seen`, and counted from there: `predict` is given the origin
        (N, 6) under the name of the argument with ``_origin`` behind.
    alone : bool
        Whether each number is of a kind of its own where combinations that nothing determines are
        named; else all numbers of a role are of one kind.
    joint : bool
        Whether it is the zero of the angle of a joint of the machine, by the joint's name.
    """

    body: Body = ""
    pose: bool = False
    alone: bool = False
    joint: bool = False

    @property
    def point_of(self) -> Body:
        """The body that they are a point of; "" of other numbers."""
        return "" if self.pose else self.body


PLAIN = Nature()


@dataclass(frozen=True, eq=False)
class Dependence:
    """A dependence: an argument of `Reading.predict` in the rows of a set.

    Attributes
    ----------
    argument : str
        Its name there.
    role : str
        What it is to users: "target", "anchor", "attachment", "tool", "run", "angle" …; not "frame"
        and "residual", and "tool" of a pose on the platform alone.
    given : ndarray (N, w)
        Its numbers in each row of the set, as far as they are known.
    estimated : mapping of str to Numbers
        Those that are estimated, by the name that rows have in common.
    index : ndarray of int (N,)
        Which of them each row has, in their order, from 0.
    nature : Nature
        What its numbers are to a calibration; by default numbers as any others.
    """

    argument: str
    role: str
    given: FloatArray
    estimated: Mapping[str, Numbers]
    index: IntArray
    nature: Nature = PLAIN

    def __post_init__(self) -> None:
        for own in ("argument", "role"):
            if not isinstance(getattr(self, own), str):
                raise ArgumentTypeError(
                    f"Dependence: {own} must be a word; found {shown(getattr(self, own))}"
                )
        given = _array(f"{self.argument}: given", self.given, "biuf")
        if given.ndim != 2:
            raise ArgumentError(
                f"{self.argument}: given numbers must have shape (N, w), a row for each reading;"
                f" found {given.shape}"
            )
        object.__setattr__(self, "given", given)
        object.__setattr__(self, "index", _array(f"{self.argument}: index", self.index, "iu"))
        several = self.estimated
        numbers = several.values() if isinstance(several, Mapping) else [several]
        if not all(isinstance(each, Numbers) for each in numbers):
            raise ArgumentTypeError(
                f"{self.argument}: estimated must have Numbers(…) by the names that rows have in"
                f" common, {{}} where none is; found {shown(several)}"
            )
        for name, each in several.items():
            if each.slots.max(initial=-1) >= given.shape[1]:
                raise ArgumentError(
                    f"{self.argument}: numbers {name!r} have slots {each.slots.tolist()}, and the"
                    f" argument {given.shape[1]} numbers, from 0"
                )
        self._require_place()

    def _require_place(self) -> None:
        """Refuse a place on a body that is no point, and no whole pose on the platform."""
        if not isinstance(self.nature, Nature):
            raise ArgumentTypeError(
                f"{self.argument}: nature must be a Nature(…); found {kind(self.nature)}"
            )
        body, pose = self.nature[:2]
        if body not in get_args(Body) or (pose and body != "platform"):
            allowed = ("platform",) if pose else get_args(Body)
            raise ArgumentError(
                f"{self.argument}: body of its nature must be {' or '.join(map(repr, allowed))};"
                f" found {shown(body)}"
            )
        if not body:
            return
        width, needed = self.given.shape[1], len(PLACE) if pose else len(POINT)
        whole = all(np.array_equal(own.slots, range(width)) for own in self.estimated.values())
        if width != needed or not whole:
            raise ArgumentError(
                f"{self.argument}: a {'pose' if pose else 'point'} of the {body} has {needed}"
                f" numbers, which are estimated together; found {width}"
            )


def _array(what: str, given: Any, kinds: str) -> Any:
    """Numbers of these kinds of numpy as an array, doubles if they may be."""
    try:
        found = np.asarray(given)
    except ValueError as error:
        raise ArgumentTypeError(f"{what} must be an array; found {shown(given)}") from error
    if found.size and found.dtype.kind not in kinds:
        words = "numbers" if "f" in kinds else "whole numbers"
        raise ArgumentTypeError(f"{what} must be {words}; found {shown(given)}")
    return found.astype(np.float64 if "f" in kinds else np.intp, copy=False)


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
    others : tuple of ndarray
        Other values with which the nominal machine misses about as much: the fit from each tells.
    """

    slots: tuple[int, ...]
    values: FloatArray
    axis: int = 0
    others: tuple[FloatArray, ...] = ()

    def __post_init__(self) -> None:
        every = [np.asarray(each, dtype=np.float64) for each in (self.values, *self.others)]
        for values in every:
            if values.shape != (len(self.slots),):
                raise ArgumentError(
                    f"Start: {len(self.slots)} slots {tuple(self.slots)} need as many values; found"
                    f" shape {values.shape}"
                )
        object.__setattr__(self, "values", every[0])
        object.__setattr__(self, "others", tuple(every[1:]))


Found = dict[tuple[str, str], Start]  # by role and name
