"""Arguments of `identify`: several words in one, and the keywords of the version before."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, cast

from pkmcal.arguments import word, words
from pkmcal.effects.effect import Changed, Effect
from pkmcal.effects.expansion import Expansion
from pkmcal.estimation.loss import LIMITS, LossName
from pkmcal.estimation.parameters import Known
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.fitted.datum import DATUM
from pkmcal.kinematics.calibratable import Calibratable
from pkmcal.readings.reading import Reading
from pkmcal.statistics.covariance import RULES, CovarianceRule

Role = Literal["frame", "target", "attachment"]
ROLES: tuple[Role, ...] = ("frame", "target", "attachment")
Unknown = Role | Sequence[Role] | Mapping[Role, Known | Sequence[Known]]

ErrorWord = LossName | Literal["classical", "cluster"]
_ERROR_WORDS: tuple[ErrorWord, ...] = (*LIMITS, "classical", "cluster")

_MEMBERS = ("name", "of_rows", "dependences")  # of an `Effect`

EARLIER = ("frame", "target", "attachment", "datum", "expansion", "slack", "covariance")


def unknown_roles(unknown: Unknown) -> dict[str, Known | Sequence[Known]]:
    """What is "known" or "unknown" of each set, by role."""
    if not isinstance(unknown, Mapping):
        unknown = dict.fromkeys(cast(Any, words("unknown", unknown)), "unknown")
    known: dict[str, Known | Sequence[Known]] = dict.fromkeys(ROLES, "known")
    return known | {word("unknown", role, ROLES): given for role, given in unknown.items()}


def loss_and_rule(loss: ErrorWord | Sequence[ErrorWord]) -> tuple[LossName, CovarianceRule]:
    """The loss, and whether errors are taken to be shared; as the residuals say by default."""
    given: list[str] = [word("loss", each, _ERROR_WORDS) for each in words("loss", loss)]
    losses = [each for each in given if each in LIMITS]
    rules = [each for each in given if each in RULES]
    for several in (losses, rules):
        if len(several) > 1:
            raise ArgumentError(f"loss: {' and '.join(several)} exclude each other")
    return cast(tuple[LossName, CovarianceRule], (*(losses or ["linear"]), *(rules or ["auto"])))


def fixed_names(fix: str | Sequence[str]) -> tuple[tuple[str, ...], bool]:
    """Names of numbers that are held, and whether those that define the frames are."""
    names = words("fix", fix)
    return tuple(name for name in names if name != DATUM), DATUM in names


def effects_on(
    machine: Calibratable, effects: Any
) -> tuple[Calibratable, tuple[Effect, ...], dict[str, float]]:
    """The machine with the numbers of effects, the other effects on it, each stated once.

    And which numbers effects free, with the deviation of what is known of each.
    """
    found: dict[str, Effect] = {}
    names: list[str] = []
    free: dict[str, float] = {}
    for each in _each_effect(effects):
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


def _each_effect(effects: Any) -> tuple[Any, ...]:
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


def now(before: dict[str, Any], others: dict[str, Any]) -> dict[str, Any]:
    """Keywords of today for those of the version before."""
    new: dict[str, Any] = {}
    roles = {role: before[role] for role in ROLES if before.get(role, "known") != "known"}
    if roles:
        stated = unknown_roles(others.get("unknown", ()))
        roles = {role: roles.get(role, stated[role]) for role in ROLES}
        roles = {role: given for role, given in roles.items() if given != "known"}
        alone = all(given == "unknown" for given in roles.values())
        new["unknown"] = roles if not alone else [*roles] if len(roles) > 1 else next(iter(roles))
    if word("datum", before.get("datum", "none"), ("none", "auto")) == "auto":
        new["fix"] = _beside(others.get("fix"), DATUM)
    if word("slack", before.get("slack", "keep"), ("keep", "drop")) == "drop":
        new["drop"] = _beside(others.get("drop"), "slack")
    rule = word("covariance", before.get("covariance", "auto"), RULES)
    if rule != "auto":
        new["loss"] = _beside(others.get("loss"), rule)
    if before.get("expansion") is not None:
        if isinstance(beside := others.get("effects", ()), str):
            raise ArgumentError(f"expansion: not beside effects={beside!r}; state the effects")
        new["effects"] = [*_each_effect(beside), Expansion(before["expansion"])]
    return new


def _beside(given: Any, one: str) -> Any:
    """One more of what an argument takes several of."""
    if given is None or (not isinstance(given, str) and not len(given)):
        return one
    return [given, one] if isinstance(given, str) else [*given, one]
