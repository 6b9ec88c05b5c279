"""How far an export is from the machine, at the poses that both have, and how many lack."""

from __future__ import annotations

import numpy as np

import pkmcal as pk
from pkmcal.controllers.loss import Loss, sag


def test_poses_at_which_a_machine_gives_way_do_not_hide_how_far_it_sags_elsewhere() -> None:
    robot = pk.load("hexapod").yielding({"offset*": 1.0 / 300.0}).carrying(pk.Load(mass=100.0))
    lost = sag(robot)
    assert 0.0 < lost.lacking < 1.0 and np.isfinite([lost.rms, lost.worst]).all()
    assert 1.0 < lost.rms < lost.worst and not lost.exact
    said = str(lost)
    assert "inf" not in said and f"without a pose at {100 * lost.lacking:.0f} %" in said


def test_a_loss_of_no_pose_says_so() -> None:
    lost = Loss.of(np.full((3, 3), np.nan), "over the bed")
    assert str(lost) == "without any pose over the bed" and not lost.exact
    off = np.array([[0.0, 0.0, 0.0], [np.nan, 0.0, 0.0]])
    assert not Loss.of(off, "over the bed").exact  # what is missing is not held
