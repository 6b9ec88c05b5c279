"""Effects as they are stated: the machine that has their numbers, and the others on it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pkmcal.effects.effect import Changed, Effect
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.readings.reading import Reading

_MEMBERS = ("name", "of_rows", "dependences")  # of an `Effect`


def effects_on(
    machine: Calibratable, effects: Any
) -> tuple[Calibratable, tuple[Effect, ...], dict[str, float]]:
    """The machine with the numbers of effects, the other effects on it, each stated once.

    And which numbers effects free, with the deviation of what is known of each.
    """
    found: dict[str, Effect] = {}
    names: list[str] = []
    free: dict[str, float] = {}
    for each in each_effect(effects):
        effect = each.of_machine(machine) if hasattr(each, "of_machine") else each
        _require_members(effect)
        if effect.name in names:
            raise ArgumentError(f"effects: {effect.name} is stated more than once")
        names.append(effect.name)
        if isinstance(effect, Changed):
            machine = effect.machine
            free |= effect.free
        else:
            found[effect.name] = effect
    return machine, tuple(found.values()), free


def each_effect(effects: Any) -> tuple[Any, ...]:
    """The effects, of one alone or of several."""
    alone = isinstance(effects, str | type) or not isinstance(effects, Iterable)
    several = (effects,) if alone or _is_effect(effects) else tuple(effects)
    for each in several:
        if isinstance(each, type) and _is_effect(each):
            raise ArgumentTypeError(
                f"effects: found the class {each.__name__}; an object of it is needed:"
                f" {each.__name__}(…)"
            )
        if not _is_effect(each):
            raise ArgumentTypeError(
                f"effects: expected such as pk.Expansion(11.5e-6), found {each!r}"
            )
    return several


def _is_effect(given: Any) -> bool:
    members = any(hasattr(given, name) for name in ("of_rows", "of_machine"))
    return members and not isinstance(given, Reading)


def _require_members(effect: Any) -> None:
    """Refuse an object without all members of `Effect`."""
    missing = [name for name in _MEMBERS if not hasattr(effect, name)]
    if missing and not isinstance(effect, Changed):
        raise ArgumentTypeError(
            f"effects: an object of class {type(effect).__name__} has no {' and no '.join(missing)}"
        )
