"""The option ``--effects``: its words are the effects, and effects say their words."""

from __future__ import annotations

import pytest

import pkmcal as pk
from pkmcal.jobs.effects_option import read_effects


@pytest.mark.parametrize(
    "word, effect",
    [
        ("sag", pk.Sag()),
        ("sag=all", pk.Sag("all")),
        ("sag=2:3", pk.Sag((2, 3))),
        ("sag=tied", pk.Sag("all", tied=True)),
        ("harmonics=1:2", pk.Harmonics([1, 2])),
        ("harmonics=200@3", pk.Harmonics([200], (3,))),
    ],
)
def test_words_are_effects_and_effects_their_words(word: str, effect: pk.Sag) -> None:
    assert read_effects([word]) == [effect]
    assert effect.option == word


def test_words_stand_beside_each_other() -> None:
    assert read_effects(["sag,coupling=5.4:6.4", "backlash=2"]) == [
        pk.Sag(), pk.Coupling([(5, 4), (6, 4)]), pk.Backlash((2,)),
    ]  # fmt: skip
    assert read_effects(["auto"]) == "auto" and read_effects(["none"]) == []


@pytest.mark.parametrize(
    "word, message",
    [
        ("sagg", "must be one of sag, .* did you mean 'sag'"),
        ("", "must be one of sag, harmonics, [^;]*; found ''$"),
        ("sag=two", "sag=tied or joints"),
        ("harmonics", "waves a turn"),
        ("coupling=5", "a joint and the one that turns it"),
        ("auto,sag", "auto stands alone"),
        ("none,sag", "none stands alone"),
    ],
)
def test_mistakes_are_named(word: str, message: str) -> None:
    with pytest.raises(pk.ArgumentError, match=message):
        read_effects([word])
