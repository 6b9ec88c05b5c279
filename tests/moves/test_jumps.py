"""Moves through nodes of tables and through β = 90°, and how often drive laws are evaluated."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.core.laws import Laws
from pkmcal.report.as_json import as_json

from ..robots import hexapod

TABLE = [[780.0, 0.0], [830.0, 1.2], [840.0, -0.4], [850.0, -0.4], [870.0, 0.5], [880.0, 0.5]]
BENT = {780.0, 830.0, 840.0, 850.0, 870.0}  # at 880 it is as straight before as after its end
WAVES = [{"k": 0.2, "cos": 0.05, "sin": 0.03}, {"k": 0.5, "cos": 0.02, "sin": 0.02}]


def tabled(**more: Any) -> pk.Robot:
    """A hexapod with a table on its first leg."""
    return hexapod({"stroke": [700.0, 1000.0], "drive": {"table": TABLE, **more}})


@pytest.mark.parametrize("space", ["pose", "coordinates", "joint"])
def test_speeds_jump_where_a_move_says_so(space: Any) -> None:
    robot = tabled()
    end = robot.home + np.array([30, 20, 60, 0.1, 0, 0.1])
    move = pk.trajectory.move(robot, robot.home, end, duration=2.0, space=space)
    q = move.sample(np.linspace(0, 2.0, 501)).actuators[:, 0]
    assert (np.diff(q) > 0).all()
    passed = sorted(node for node in BENT if q[0] < node < q[-1])
    assert len(passed) >= 3 and [jump.node for jump in move.jumps] == passed
    for jump in move.jumps:
        assert jump.actuator == 1
        assert abs(move.sample(jump.time).actuators[0] - jump.node) < 1e-9
        before, after = (move.sample(jump.time + side * 1e-6) for side in (-1, 1))
        own = before.velocities[0], after.velocities[0]
        platform = before.twist, after.twist
        # what the actuators do is smooth in joint space, and what the platform does elsewhere
        kinked, smooth = (platform, own) if space == "joint" else (own, platform)
        assert np.abs(np.subtract(*kinked)).max() > 1e-3 * np.abs(kinked).max()
        assert np.abs(np.subtract(*smooth)).max() < 1e-4 * np.abs(smooth).max()
    if space == "joint":
        assert "speeds jump" in str(move)
    assert json.loads(as_json(move))["jumps"][0]["node"] == passed[0]


def test_speeds_of_laws_without_kinks_do_not_jump() -> None:
    line = [[700.0, 0.0], [840.0, 0.14], [1000.0, 0.3]]
    for law in ({"harmonics": WAVES}, {"table": line}):
        robot = hexapod({"stroke": [750.0, 950.0], "drive": law})
        move = pk.trajectory.move(robot, robot.home, [0, 0, 840, 0, 0, 0], duration=1.0)
        assert move.jumps == ()


@pytest.mark.parametrize("step", [0.1, 0.0123])
def test_accelerations_are_those_of_the_positions_where_beta_passes_90_degrees(step: float) -> None:
    """Rates of the angles are not finite there, the motion is smooth."""
    robot = hexapod(frames={"tool": {"beta": np.pi / 2}})
    start, end = (np.array([0, 0, 800.0, 0.2, np.pi / 2 + side * step, 0.1]) for side in (-1, 1.5))
    move = pk.trajectory.move(robot, start, end, duration=1.0, space="coordinates")
    share = np.linspace(0.3, 0.45, 4001)  # β is 90° at 0.4 of the way
    at, h = move.sample(share), 1e-3
    back, on = (move.sample(share + side * h).actuators for side in (-1, 1))
    second = (back - 2 * at.actuators + on) / h**2
    np.testing.assert_allclose(at.accelerations, second, atol=1e-3 * np.abs(second).max())
    most = np.abs(at.accelerations).max(axis=0)
    shortest = pk.trajectory.move(robot, start, end, acceleration=most, space="coordinates")
    seen = np.abs(shortest.sample(shortest.duration * np.linspace(0, 1, 2001)).accelerations)
    assert (seen / most).max() == pytest.approx(1.0, abs=1e-4)


def test_a_law_is_evaluated_a_few_times_for_an_inverse(monkeypatch: pytest.MonkeyPatch) -> None:
    """No drive is inverted where it has no reading, as at a length of 0."""
    robot = tabled(harmonics=WAVES)
    counted = 0
    ways = Laws.ways

    def counting(self: Laws, *args: Any) -> Any:
        nonlocal counted
        counted += 1
        return ways(self, *args)

    robot.inverse(robot.home)
    monkeypatch.setattr(Laws, "ways", counting)
    q = robot.inverse(robot.home)
    assert np.isfinite(q).all() and counted < 25
