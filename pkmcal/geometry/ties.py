"""Limb numbers, and the ties by which named parameters drive some of them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple

from pkmcal.arrays import Unit


class Term(NamedTuple):
    """A constant (`name` is None), or a factor of +1 or -1 on the parameter `name`."""

    factor: float
    name: str | None = None

    @property
    def written(self) -> float | str:
        """The tie as a robot file has it."""
        if self.name is None:
            return self.factor
        return self.name if self.factor > 0.0 else f"-{self.name}"


class Tie(NamedTuple):
    """A tie: a limb number as a function of its terms.

    ``"equal"``: one term. ``"cos"`` and ``"sin"``: two terms, a radius and an angle, the number
    being radius·cos(angle) or radius·sin(angle).
    """

    rule: Literal["equal", "cos", "sin"]
    terms: tuple[Term, ...]

    @property
    def drivers(self) -> tuple[str, ...]:
        """The parameters that the number follows."""
        return tuple(term.name for term in self.terms if term.name is not None)

    def value(self, parameters: Mapping[str, float]) -> float:
        """Value of the number for these values of the parameters."""
        first, *angle = (_term_value(term, parameters) for term in self.terms)
        if self.rule == "equal":
            return first
        return first * (math.cos(angle[0]) if self.rule == "cos" else math.sin(angle[0]))

    def derivatives(self, parameters: Mapping[str, float]) -> Iterator[tuple[str, float]]:
        """Return each parameter of the tie with the number's derivative by it."""
        first, *angle = (_term_value(term, parameters) for term in self.terms)
        if self.rule == "equal":
            slopes: tuple[float, ...] = (1.0,)
        elif self.rule == "cos":
            slopes = (math.cos(angle[0]), -first * math.sin(angle[0]))
        else:
            slopes = (math.sin(angle[0]), first * math.cos(angle[0]))
        for term, slope in zip(self.terms, slopes, strict=True):
            if term.name is not None:
                yield term.name, term.factor * slope


def _term_value(term: Term, parameters: Mapping[str, float]) -> float:
    return term.factor if term.name is None else term.factor * parameters[term.name]


@dataclass(frozen=True)
class LimbNumber:
    """One number of one limb.

    Attributes
    ----------
    name : str
        Its public name, such as ``"base1.x"``.
    unit : str
        "mm", "rad" or "1" (a ratio).
    limb : int
        Its limb, counted from 0.
    slot : str
        Which of `SLOTS` it is.
    tie : Tie or None
        How it follows from parameters; None where it is its own.
    place : int or None
        Where it is among the numbers of the core; None: limb by limb in the order of `SLOTS`.
    """

    name: str
    unit: Unit
    limb: int
    slot: str
    tie: Tie | None = None
    place: int | None = None
