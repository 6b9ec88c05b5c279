"""Which rows repeat another: those of one pose and one target, however the target was given."""

from __future__ import annotations

import numpy as np

import pkmcal as pk
from pkmcal.measurements.repeats import groups

ROBOT = pk.load("hexapod")
Q = np.repeat(ROBOT.inverse([[0, 0, 800, 0, 0, 0], [20, 0, 820, 0, 0.1, 0]]), 4, axis=0)
PLACES = np.array([[80.0, 0.0, 30.0], [-60.0, 50.0, 30.0]])
OF = np.tile([0, 1], 4)
EXPECTED = [0, 1, 0, 1, 2, 3, 2, 3]


def test_targets_by_name_and_by_place_are_as_many() -> None:
    values = np.zeros((8, 3))
    named = pk.Measurements(Q, values, "position", target=PLACES, target_index=OF)
    placed = pk.Measurements(Q, values, "position", target=PLACES[OF])
    for measured in (named, placed):
        found = groups(measured)
        np.testing.assert_array_equal(found[:, None] == found, np.equal.outer(EXPECTED, EXPECTED))


def test_one_target_for_all_rows_is_one() -> None:
    measured = pk.Measurements(Q, np.zeros((8, 3)), "position", target=PLACES[0])
    assert len(np.unique(groups(measured))) == 2
