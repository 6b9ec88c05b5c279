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


@pytest.fixture(scope="module")
def mirrored() -> pk.Measurements:
    """One of 20 pictures, left and right exchanged."""
    sound = pictures(20)
    values = np.array(sound.values)
    values[sound.group == ODD, 0] = 1280 - 1 - values[sound.group == ODD, 0]
    return replace(sound, values=values)


@pytest.mark.slow
def test_a_picture_that_agrees_with_no_pose_is_named_with_what_leaves_it_out(
    mirrored: pk.Measurements,
) -> None:
    with pytest.raises(pk.ArgumentError) as error:
        checks(mirrored)
    named = f"; pose {ODD} ({CORNERS} rows): no pose agrees both with what was read"
    assert named in str(error.value)
    assert "--drop-outliers (drop='outliers')" in str(error.value)


def test_a_picture_that_agrees_with_no_pose_is_an_outlier(mirrored: pk.Measurements) -> None:
    found, _ = checks(mirrored, drop="outliers")
    assert {*mirrored.group[list(found.dropped)].tolist()} == {ODD}
    assert len(found.dropped) == CORNERS and found.verdict.state == "calibrated"


@dataclass
class Set:
    rows: list[int]


def test_rows_that_are_many_or_all_of_a_set_are_no_outliers() -> None:
    """That is rather a mistake of all: nobody gets a machine from the rest unasked."""
    sets: Any = [Set([0, 1, 2, 3]), Set([4, 5, 6, 7, 8, 9])]
    assert are_few(sets, [1, 4])
    assert not are_few(sets, [1, 4, 5]) and not are_few(sets, [0, 1, 2, 3])
    assert not are_few([Set([0]), Set(list(range(1, 20)))], [0])  # type: ignore[list-item]
