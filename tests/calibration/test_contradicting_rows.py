"""A picture that contradicts its actuators so much that no pose agrees with both."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.fitted.dropped import are_few

from ..diagnostics.test_pictures import BOARD, checks, pictures

CORNERS = len(BOARD.ids)
ODD = 7


def mirrored(count: int, odd: list[int]) -> pk.Measurements:
    """Some of the pictures have left and right exchanged."""
    sound = pictures(count)
    values, some = np.array(sound.values), np.isin(sound.group, odd)
    values[some, 0] = 1280 - 1 - values[some, 0]
    return replace(sound, values=values)


@pytest.mark.parametrize(("count", "odd"), [(20, [ODD]), (16, [3, ODD])])
def test_pictures_that_contradict_all_others_are_named_with_what_leaves_them_out(
    count: int, odd: list[int]
) -> None:
    with pytest.raises(pk.ArgumentError) as error:
        checks(mirrored(count, odd))
    text, names = str(error.value), [f"pose {each} ({CORNERS} rows)" for each in odd]
    assert f"{len(odd) * CORNERS} of {count * CORNERS} rows contradict all others" in text
    assert f"; {', '.join(names)}: what was read there contradicts the actuators" in text
    assert "--drop-outliers (drop='outliers')" in text


@pytest.mark.parametrize(("count", "odd"), [(20, [ODD]), (16, [3, ODD])])
def test_pictures_that_contradict_all_others_are_outliers(count: int, odd: list[int]) -> None:
    measured = mirrored(count, odd)
    found, _ = checks(measured, drop="outliers")
    assert {*measured.group[list(found.dropped)].tolist()} == {*odd}
    assert len(found.dropped) == len(odd) * CORNERS and found.verdict.state == "calibrated"


@dataclass
class Set:
    rows: list[int]


def test_rows_that_are_many_or_all_of_a_set_are_no_outliers() -> None:
    """That is rather a mistake of all: nobody gets a machine from the rest unasked."""
    sets: Any = [Set([0, 1, 2, 3]), Set([4, 5, 6, 7, 8, 9])]
    assert are_few(sets, [1, 4])
    assert not are_few(sets, [1, 4, 5]) and not are_few(sets, [0, 1, 2, 3])
    assert not are_few([Set([0]), Set(list(range(1, 20)))], [0])  # type: ignore[list-item]
