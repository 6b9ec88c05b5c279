"""Rows are named as far as their file, line, pose and target are known."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.estimation.fit_data import FitData
from pkmcal.fitted.row_names import row_names

FILE = {"file": "day.csv", "lines": np.arange(8) // 2 + 3}
INDEX = {"target": np.zeros((2, 3)), "target_index": np.arange(8) % 2}


@pytest.mark.parametrize(
    ("known", "expected"),
    [
        ({}, "row 2, row 3, row 6"),
        (INDEX, "row 2 (1), row 3 (2), row 6 (1)"),
        (INDEX | {"target_names": ("A", "B")}, "row 2 (A), row 3 (B), row 6 (A)"),
        (FILE, "day.csv line 4, day.csv line 6"),
        (FILE | INDEX | {"target_names": ("A", "B")}, "day.csv line 4 (A, B), day.csv line 6 (A)"),
        ({"lines": np.arange(8)}, "line 2, line 3, line 6"),
        ({"group": np.arange(8) // 2}, "row 2, pose 1, row 3, pose 1, row 6, pose 3"),
    ],
)
def test_a_row_is_named_by_what_is_known_of_it(known: dict[str, Any], expected: str) -> None:
    measured = pk.Measurements(np.zeros((8, 6)), np.zeros((8, 3)), **known)
    assert row_names([FitData(measured, np.arange(8), False, False)], [2, 3, 6]) == expected


def test_rows_of_several_sets_count_on_and_long_lists_are_cut() -> None:
    sets = [
        pk.Measurements(np.zeros((4, 6)), np.zeros((4, 3)), file=file, lines=np.arange(4) + 2)
        for file in ("one.csv", "two.csv")
    ]
    data = [FitData(m, np.arange(4) + 4 * i, False, False) for i, m in enumerate(sets)]
    assert row_names(data, [3, 4]) == "one.csv line 5, two.csv line 2"
    assert row_names(data, range(6)).endswith("two.csv line 3")
    assert row_names(data, range(8)).endswith("two.csv line 3 and 2 more")
