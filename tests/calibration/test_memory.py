"""How much memory each row of a calibration takes, its verdict included."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

import pkmcal as pk

_BESIDE = 900.0  # bytes a row that are held at most beside a Jacobian
_ROWS = 60_000  # more than any lot


def positions(robot: pk.Robot, rows: int) -> pk.Measurements:
    """Of a machine two of whose offsets are wrong."""
    rng = np.random.default_rng(0)
    poses = robot.home + rng.uniform(-1, 1, (rows, 6)) * [100, 100, 100, 0.2, 0.2, 0.2]
    true = robot.replace({"offset2": 0.3, "offset5": -0.2})
    q = robot.inverse(poses)
    places = true.forward(q).pose[:, :3] + rng.normal(0.0, 0.02, (rows, 3))
    return pk.Measurements(q, places, "position")


def a_row(robot: pk.Robot, free: str | None) -> float:
    """The most bytes a row that are held at once, measurements aside."""
    measured = positions(robot, _ROWS)
    tracemalloc.start()
    found = pk.identify(robot, measured, free)
    assert found.verdict.state == "calibrated"
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return most / _ROWS


@pytest.mark.slow
@pytest.mark.parametrize(("free", "numbers"), [("offset*", 6), (None, 42)])
def test_one_jacobian_is_held_and_little_more(
    hexapod: pk.Robot, free: str | None, numbers: int
) -> None:
    """At 60 000 rows 942 bytes are held with 6 numbers, and 1824 with 42; measurements aside."""
    assert pk.identify(hexapod, positions(hexapod, 1000), free).verdict.state  # imports
    assert a_row(hexapod, free) < 8.0 * 3 * numbers + _BESIDE
