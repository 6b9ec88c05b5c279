"""Whether the two sides of the workspace want other numbers: play that hangs, and nothing else."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.diagnostics.check import RARE
from pkmcal.diagnostics.sides import sides
from pkmcal.statistics.distributions import f_tail
from pkmcal.statistics.group_test import group_test

from ..sweeps import sweep

ROBOT = pk.load("4ups-ps")
FREE = ROBOT.model.free


def identified(seed: int, play: float, of: str = "limb2.platform.dz") -> Any:
    """A machine of which one joint hangs to the side to which the platform leans."""
    rng = np.random.default_rng(900 + seed)
    unit = dict(zip(ROBOT.geometry.names, ROBOT.geometry.units, strict=True))
    true = ROBOT.replace(
        {n: ROBOT.geometry[n] + (0.2 if unit[n] == "mm" else 1e-3) * rng.normal() for n in FREE}
    )
    poses = pk.sample_poses(ROBOT, 60, seed=900 + seed, share=0.5)
    q = ROBOT.inverse(poses, match=True)
    there = true.forward(q, guess=poses).pose
    hung = [
        true.replace({of: true.geometry[of] + by}).forward(q, guess=there).pose
        for by in (play, -play)
    ]
    there = np.where(there[:, 3:4] > 0, *hung)
    read = there + rng.normal(size=there.shape) * [*[0.02] * 3, *[6e-5] * 3]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return pk.identify(ROBOT, pk.Measurements(q, read, "pose"), FREE)


@sweep("seed", range(3), quick=[0])
def test_a_joint_that_hangs_where_it_is_pushed_is_seen(seed: int) -> None:
    """No cause that has a column looks like it."""
    found = identified(seed, 0.3)
    seen = sides(found)
    assert seen is not None
    assert seen.chance < RARE
    assert seen.where == "that lean to the two sides about x"
    assert found.verdict.state == "doubtful"


@sweep("seed", range(6), quick=[0, 1])
def test_a_sound_machine_has_no_sides(seed: int) -> None:
    seen = sides(identified(seed, 0.0))
    assert seen is None or seen.chance >= RARE


def test_how_far_apart_they_are_is_that_of_two_fits() -> None:
    """Chow's ratio, from the squares of a common fit and of one of each group."""
    rng = np.random.default_rng(4)
    design, mine = rng.normal(size=(50, 4)), rng.permutation(50) < 20
    values = rng.normal(size=50) + design[:, 0] * np.where(mine, 2.0, 0.0)

    def squares(rows: Any) -> float:
        left = values[rows] - design[rows] @ np.linalg.lstsq(design[rows], values[rows])[0]
        return float(left @ left)

    own = squares(mine) + squares(~mine)
    ratio = (squares(slice(None)) - own) / 4 / (own / 42)
    found = group_test(design, values, mine)
    assert found is not None
    assert found.ratio == pytest.approx(ratio, rel=1e-9)
    assert found.chance == pytest.approx(f_tail(ratio, 4, 42), rel=1e-9)
