"""The option ``--effects``: what moves a machine off the pose of its geometry, in words."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal

from pkmcal.arguments import word as checked_word
from pkmcal.effects.elasticity import Elasticity
from pkmcal.effects.gears import Backlash, Coupling, Harmonics
from pkmcal.effects.sag import Sag
from pkmcal.exceptions import ArgumentError
from pkmcal.files.number_text import typed

OPTION = "--effects"
AUTO = "auto"


def read_effects(given: Sequence[str]) -> list[Any] | Literal["auto"]:
    """The effects that are named.

    Raises
    ------
    ValueError
        An unknown word, or numbers that are none.
    """
    words = _words(given)
    if AUTO in words:
        if words != [AUTO]:
            raise ArgumentError(f"{OPTION}: auto stands alone")
        return "auto"
    if "none" in words:
        if words != ["none"]:
            raise ArgumentError(f"{OPTION}: none stands alone")
        return []
    return [_effect(word) for word in words]


def with_effects(given: Sequence[str], more: Sequence[Any]) -> tuple[str, ...]:
    """Add words of effects, which replace those of the same name."""
    names = {each.name for each in more}
    stated = [word for word in _words(given) if word not in ("none", AUTO)]
    kept = (word for word in stated if _effect(word).name not in names)
    return (*kept, *(each.option for each in more))


def _words(given: Sequence[str]) -> list[str]:
    return [word.strip() for text in given for word in text.split(",")]


def _effect(word: str) -> Any:
    name, _, of = word.partition("=")
    if name not in _READ:
        checked_word(OPTION, name, (*_READ, AUTO, "none"))
    try:
        return _READ[name](of)
    except ValueError:
        raise ArgumentError(f"{OPTION} {word}: {_FORMS[name]}") from None


def _sag(of: str) -> Sag:
    if of in ("", "main"):
        return Sag()
    if of == "tied":
        return Sag("all", tied=True)
    return Sag("all") if of == "all" else Sag(_joints(of))


def _harmonics(of: str) -> Harmonics:
    waves, _, joints = of.partition("@")
    found = [typed(each) for each in waves.split(":")]
    return Harmonics(found, _joints(joints)) if joints else Harmonics(found)


def _coupling(of: str) -> Coupling:
    pairs = [each.split(".") for each in of.split(":")]
    return Coupling([(int(joint), int(other)) for joint, other in pairs])


def _backlash(of: str) -> Backlash:
    return Backlash(_joints(of)) if of else Backlash()


def _elasticity(of: str) -> Elasticity:
    return Elasticity(of.split(":")) if of else Elasticity()


def _joints(of: str) -> tuple[int, ...]:
    return tuple(int(each) for each in of.split(":"))


_READ: dict[str, Callable[[str], Any]] = {
    "sag": _sag,
    "harmonics": _harmonics,
    "coupling": _coupling,
    "backlash": _backlash,
    "elasticity": _elasticity,
}
_FORMS = {
    "sag": "sag, sag=all, sag=tied or joints, sag=2:3",
    "harmonics": "waves a turn, harmonics=1:2, or of some joints, harmonics=200@3",
    "coupling": "a joint and the one that turns it, coupling=5.4:6.4",
    "backlash": "backlash, or joints, backlash=1:2",
    "elasticity": "names of numbers, elasticity=offset*:rod*",
}
