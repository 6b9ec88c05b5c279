"""Arguments of `identify`: several words in one, and the keywords of the version before."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, cast

from pkmcal.arguments import word, words
from pkmcal.effects.expansion import Expansion
from pkmcal.effects.stated import each_effect
from pkmcal.estimation.loss import LIMITS, LossName
from pkmcal.estimation.parameters import Known
from pkmcal.exceptions import ArgumentError
from pkmcal.fitted.datum import DATUM
from pkmcal.statistics.covariance import RULES, CovarianceRule

Role = Literal["frame", "target", "attachment"]
ROLES: tuple[Role, ...] = ("frame", "target", "attachment")
Unknown = Role | Sequence[Role] | Mapping[Role, Known | Sequence[Known]]

ErrorWord = LossName | Literal["classical", "cluster"]
_ERROR_WORDS: tuple[ErrorWord, ...] = (*LIMITS, "classical", "cluster")

EARLIER = ("frame", "target", "attachment", "datum", "expansion", "slack", "covariance")


def unknown_roles(unknown: Unknown) -> dict[str, Known | Sequence[Known]]:
    """Return the roles, "known" or "unknown", of each set."""
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


def now(before: dict[str, Any], others: dict[str, Any]) -> dict[str, Any]:
    """Translate keywords of the version before into those of this one."""
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
        new["effects"] = [*each_effect(beside), Expansion(before["expansion"])]
    return new


def _beside(given: Any, one: str) -> Any:
    """One more of what an argument takes several of."""
    if given is None or (not isinstance(given, str) and not len(given)):
        return one
    return [given, one] if isinstance(given, str) else [*given, one]
