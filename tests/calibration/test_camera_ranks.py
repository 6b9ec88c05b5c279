"""How much pictures tell of a machine: ranks that another implementation found."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.readings import Board, Camera

JOINTS = ["base*", "platform*", "offset*"]
CASES = [  # machine, free, rank of so many numbers with a known board, and one of unknown size
    ("hexapod", JOINTS, (42, 54), (43, 55)),
    ("hexapod", [*JOINTS, "gain*"], (48, 60), (48, 61)),
    ("linear-delta", [*JOINTS, "rod*", "slider*"], (21, 42), (22, 43)),
    ("3rps", [*JOINTS, "normal*"], (27, 39), (28, 40)),
]


@pytest.mark.slow
@pytest.mark.parametrize("size", [False, True], ids=["known board", "unknown size"])
@pytest.mark.parametrize(("machine", "free", "known", "unknown"), CASES)
def test_rank_is_that_of_another_implementation(
    machine: str, free: list[str], known: tuple[int, int], unknown: tuple[int, int], size: bool
) -> None:
    """A board of unknown size costs the scale where gains are free, and nothing elsewhere."""
    robot = pk.load(machine)
    x, y, z = robot.home[:3]
    camera = Camera(
        fx=3478.0, fy=3478.0, cx=1223.5, cy=1023.5, k1=-0.1, k2=0.08, find_size=size,
        stands=[-x - 150, y + 120, z + 1200, np.pi - 0.1, 0.15, 0.2],
        carried=[10, -15, 20, np.pi + 0.03, -0.02, 0.3],
    )  # fmt: skip
    poses = pk.sample_poses(robot, 60, seed=0, share=0.4)
    at, seeing = camera.seeing(robot.inverse(poses), Board.chessboard(6, 5, 25))
    seen = pk.VirtualMachine(robot, 0.0).measure(at, seeing)
    seen = seen.select(np.flatnonzero(np.isfinite(seen.values).all(axis=1)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pk.CalibrationWarning)
        found = pk.identify(robot, replace(seen, actuator_sigma=0.0, sigma=0.1), free)
    assert (found.rank, len(found.free)) == (unknown if size else known)
