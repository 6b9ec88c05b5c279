"""Which rows repeat another: those of one pose and one target, however the target was given."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

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


@pytest.mark.parametrize("name", ["hexapod", "2tpr2tps", "linear-delta"])
def test_distances_to_several_second_places_or_attachments_repeat_nothing(name: str) -> None:
    robot = pk.load(name)
    q = robot.inverse(pk.sample_poses(robot, 12, seed=1, share=0.5))
    rng = np.random.default_rng(2)
    ends = rng.uniform(-50.0, 50.0, (12, 3))
    first, second = np.repeat(np.arange(12), 3), np.add.outer(np.arange(12), [1, 2, 3]).ravel() % 12
    between = pk.VirtualMachine(robot, 0.02, 1).measure(
        q[first], pk.readings.Between(q[second]), [0.0, 0.0, 10.0]
    )
    wires = pk.VirtualMachine(robot, 0.02, 1).measure(
        q[first], pk.readings.Distance(ends[second]), [0.0, 0.0, -900.0]
    )
    for measured in (between, wires):
        assert len(np.unique(groups(measured))) == 36
        twice = measured.select(np.repeat(np.arange(36), 2))
        found = groups(twice)
        assert len(np.unique(found)) == 36 and (found[::2] == found[1::2]).all()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            once, again = (pk.identify(robot, each, "offset*") for each in (measured, twice))
        assert np.isnan(once.repeatability) and "repeats scatter" not in once.summary()
        assert again.repeatability == pytest.approx(0.0, abs=1e-9)  # copies
