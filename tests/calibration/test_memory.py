"""How much memory each row of a calibration takes, its verdict included."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

import pkmcal as pk

_WITHIN = 1800.0  # bytes a row: 2 GB for a million of them, with 0.2 GB for the rest
_ROWS = 60_000  # more than any lot


def a_row(robot: pk.Robot, free: str | None, rows: int = _ROWS) -> float:
    """The most bytes a row that are held at once, measurements aside."""
    rng = np.random.default_rng(0)
    poses = robot.home + rng.uniform(-1, 1, (rows, 6)) * [100, 100, 100, 0.2, 0.2, 0.2]
    true = robot.replace({"offset2": 0.3, "offset5": -0.2})
    q = robot.inverse(poses)
    places = true.forward(q).pose[:, :3] + rng.normal(0.0, 0.02, (rows, 3))
    measured = pk.Measurements(q, places, "position")
    tracemalloc.start()
    found = pk.identify(robot, measured, free)
    assert found.verdict.state == "calibrated"
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return most / rows


@pytest.mark.slow
def test_a_million_rows_are_calibrated_within_two_gigabytes(hexapod: pk.Robot) -> None:
    a_row(hexapod, "offset*", 1000)  # imports
    assert a_row(hexapod, "offset*") < _WITHIN


@pytest.mark.slow
def test_of_many_numbers_hardly_more_than_two_jacobians_are_held(hexapod: pk.Robot) -> None:
    jacobian = 8.0 * 3 * len(hexapod.model.free)
    assert a_row(hexapod, None) < 2.5 * jacobian + _WITHIN  # half a one for lots
