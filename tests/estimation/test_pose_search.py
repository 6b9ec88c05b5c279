"""Poses at their best: also where what is read is grossly wrong."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core.elimination import PoseEquations
from pkmcal.estimation.pose_search import best
from pkmcal.estimation.row_states import RowStates

ANCHORS = np.array([[0.0, 2000], [3000, 2000], [0, 0], [3000, 0]])


class Plane:
    """A point in the plane, of which its pose's x and y are unknown."""

    def moved(self, states: RowStates, step: FloatArray) -> RowStates:
        pose = states.pose.copy()
        pose[:, :2] += step
        return RowStates(pose, states.actuators, states.status)


def test_poses_of_gross_readings_are_at_a_minimum() -> None:
    """Near an anchor a belt bends more than straight steps allow for: they go on for hundreds.

    Only at an anchor itself, where the squares have a cusp, there is no minimum to be at.
    """
    drawn, count = np.random.default_rng(0), 500
    at = drawn.uniform([600.0, 400], [2400, 1600], (count, 2))
    gross = 10.0 ** drawn.uniform(1.0, 3.3, (count, 1))
    read = np.linalg.norm(at[:, None] - ANCHORS, axis=2) + drawn.normal(0.0, gross, (count, 4))

    def system(states: RowStates) -> tuple[FloatArray, FloatArray]:
        away = states.pose[:, None, :2] - ANCHORS
        length = np.linalg.norm(away, axis=2)
        return (length - read).ravel(), (away / length[:, :, None]).reshape(-1, 2)

    pose = np.zeros((count, 6))
    pose[:, :2] = at
    start = RowStates(pose, read, np.zeros(count, dtype=np.int32))
    equations = PoseEquations.of(np.repeat(np.arange(count), 4), count, 2)
    found, _ = best(equations, 3000.0, Plane(), start, system)  # type: ignore[arg-type]
    residual, slopes = (each.reshape(count, 4, -1) for each in system(found))
    pull = np.linalg.norm((slopes * residual).sum(axis=1), axis=1)
    nearest = np.linalg.norm(found.pose[:, None, :2] - ANCHORS, axis=2).min(axis=1)
    assert (pull[nearest > 1.0] < 0.01).all()  # mm, where single readings miss by hundreds
    assert (found.status[nearest > 1.0] == 0).all() and (nearest > 1.0).sum() > 0.98 * count
