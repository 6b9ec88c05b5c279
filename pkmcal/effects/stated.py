"""Effects as they are stated: the machine that has their numbers, and the others on it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from numbers import Real
from typing import Any

from pkmcal.arguments import shown
from pkmcal.arms.arm import SerialArm
from pkmcal.effects.effect import Changed, Effect
from pkmcal.effects.instrument_scale import InstrumentScale
from pkmcal.exceptions import ArgumentError, ArgumentTypeError, named_failures
from pkmcal.kinematics.arm_machine import ArmMachine
from pkmcal.kinematics.calibratable import Calibratable, as_machine
from pkmcal.kinematics.robot import Robot
from pkmcal.readings.reading import Reading

BY_UNCERTAINTY: dict[str, Effect] = {  # effects whose uncertainty alone is stated, by its name
    each.name: each for each in (InstrumentScale(),)
}
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
        effect = each
        if hasattr(each, "of_machine"):
            with named_failures(each, f"effects: of_machine of {type(each).__name__}"):
                effect = each.of_machine(machine)
        _require_members(effect)
        if effect.name in names:
            raise ArgumentError(f"effects: {effect.name} is stated more than once")
        names.append(effect.name)
        if isinstance(effect, Changed):
            machine, own = _changed(effect)
            free |= own
        else:
            found[effect.name] = effect
    return machine, tuple(found.values()), free


def _changed(effect: Changed) -> tuple[Calibratable, dict[str, float]]:
    """The machine with the numbers of an effect, and what is known of each that it frees."""
    what = f"effects: Changed of {effect.name!r}"
    if not isinstance(effect.machine, Robot | SerialArm | ArmMachine):
        raise ArgumentTypeError(
            f"{what}: machine must be a Robot or SerialArm, found {shown(effect.machine)}"
        )
    machine = as_machine(effect.machine)
    if not isinstance(effect.free, Mapping):
        raise ArgumentTypeError(
            f"{what}: free must be deviations of numbers by their names; found {shown(effect.free)}"
        )
    for name, deviation in effect.free.items():
        if name not in machine.geometry.names:
            raise ArgumentError(f"{what}: free names {shown(name)}, and the machine has none such")
        if not isinstance(deviation, Real) or not deviation > 0.0:
            raise ArgumentError(
                f"{what}: the deviation of {name} must be above 0, inf where nothing is known of"
                f" it; found {shown(deviation)}"
            )
    return machine, dict(effect.free)


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
    if not isinstance(effect.name, str):
        raise ArgumentTypeError(
            f"effects: name of {type(effect).__name__} must be a word, found {shown(effect.name)}"
        )
