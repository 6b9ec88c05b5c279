"""Coefficients of effects that are held by name: where their search would start, and exact."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pkmcal.arguments import did_you_mean
from pkmcal.effects.effect import Effect, EffectOfRows
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.sessions import matches
from pkmcal.estimation.shapes import effect_of_rows
from pkmcal.exceptions import ArgumentError
from pkmcal.readings.dependences import yielded
from pkmcal.readings.unknowns import Dependence, Numbers


@dataclass(frozen=True)
class Held:
    """An effect of which some coefficients are held.

    Attributes
    ----------
    effect : Effect
        The effect.
    patterns : tuple of str
        Names or wildcards of the coefficients.
    """

    effect: Effect
    patterns: tuple[str, ...]

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name

    def of_rows(self, measured: Any) -> EffectOfRows:
        """The effect in these rows."""
        return effect_of_rows(self.effect, measured)

    def dependences(self, measured: Any) -> Iterator[Dependence]:
        """Return the effect's coefficients, the held ones as fixed."""
        for each in yielded(self.effect, measured):
            yield self._without_held(each)

    def _without_held(self, whole: Dependence) -> Dependence:
        given, index = whole.given.copy(), np.full_like(whole.index, -1)
        estimated: dict[str, Numbers] = {}
        for i, (name, own) in enumerate(whole.estimated.items()):
            rows = np.flatnonzero(whole.index == i)
            held = np.array([_meant(self.patterns, each) for each in own.names], dtype=bool)
            given[rows[:, None], own.slots[held]] = own.start[held]
            if not held.all():
                index[rows] = len(estimated)
                estimated[name] = _some(own, np.flatnonzero(~held))
        return replace(whole, given=given, estimated=estimated, index=index)


def coefficients(datasets: Sequence[FitData]) -> tuple[str, ...]:
    """Names of all coefficients of effects that would be estimated."""
    return tuple(
        dict.fromkeys(
            name
            for data in datasets
            for effect in data.effects
            for dependence in yielded(effect, data.measured)
            for numbers in dependence.estimated.values()
            for name in numbers.names
        )
    )


def with_held(datasets: Sequence[FitData], patterns: tuple[str, ...]) -> list[FitData]:
    """The rows with effects of which the coefficients of these names are held."""
    return [
        replace(data, effects=tuple(_held(effect, data, patterns) for effect in data.effects))
        for data in datasets
    ]


def of_the_machine(
    argument: str, patterns: Sequence[str], coefficients: Sequence[str], names: Sequence[str]
) -> tuple[str, ...]:
    """Patterns without those that mean coefficients and none of the machine's numbers.

    Raises
    ------
    ValueError
        One that means neither, where there are coefficients.
    """
    found = []
    for each in patterns:
        if any(matches(each, name) for name in names) or not coefficients:
            found.append(each)
        elif not any(matches(each, name) for name in coefficients):
            raise ArgumentError(
                f"{argument}: no number of the geometry or of an effect matches {each!r}"
                f"{did_you_mean(each, (*names, *coefficients))}"
            )
    return tuple(found)


def _held(effect: Effect, data: FitData, patterns: tuple[str, ...]) -> Effect:
    names = coefficients([replace(data, effects=(effect,))])
    return Held(effect, patterns) if any(_meant(patterns, name) for name in names) else effect


def _meant(patterns: Sequence[str], name: str) -> bool:
    return any(matches(pattern, name) for pattern in patterns)


def _some(own: Numbers, chosen: Any) -> Numbers:
    """Some of the numbers that rows have in common."""
    return Numbers(
        tuple(own.names[i] for i in chosen),
        tuple(own.units[i] for i in chosen),
        own.slots[chosen],
        own.start[chosen],
        None if own.scale is None else own.scale[chosen],
    )
