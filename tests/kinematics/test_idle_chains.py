"""Chains that hold the platform in no direction: with a joint too many, or with no actuator."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from tests.chain_files import as_chains
from tests.kinematics.test_chain_postures import missed
from tests.kinematics.test_chains import commands, loaded

PASSIVE = """[[limb]]
kind = "chain"
joints = [
  { kind = "U", at = [40.0, 0.0, 0.0] },
  { kind = "P" },
  { kind = "S", at = [10.0, 30.0, 780.0] },
]
"""
SPARE = """[[limb]]
kind = "chain"
joints = [
  { kind = "U", at = [0.0, 60.0, 0.0] },
  { kind = "R", at = [0.0, 250.0, 400.0], axis = [1.0, 0.0, 0.0] },
  { kind = "P", actuator = 7, axis = [0.0, 0.0, 1.0] },
  { kind = "S", at = [0.0, -30.0, 780.0] },
]
"""


@pytest.mark.parametrize("idle", (PASSIVE, SPARE), ids=("passive", "a joint too many"))
def test_a_chain_that_holds_nothing_goes_along(idle: str, tmp_path: Path) -> None:
    """Beside six legs, which say where the platform is; its joints close as soon as theirs."""
    plain = pk.load("hexapod")
    legs, robot = (loaded(as_chains(plain) + more, tmp_path) for more in ("", idle))
    q, spare = commands(plain, 8, share=0.3), np.linspace(-20.0, 20.0, 8)[:, None]
    q = np.hstack([q, spare])[:, : robot.n_actuators]
    found = robot.forward(q)
    assert found.ok.all()
    assert found.iterations.max() <= legs.forward(q[:, :6]).iterations.max()
    assert np.abs(found.pose - plain.forward(q[:, :6]).pose).max() < 1e-9
    back = robot.inverse(found.pose)
    assert np.abs(back - q)[:, :6].max() < 1e-8
    for there in (q, back):
        passive = robot.forward(there, guess=found.pose).passive
        for pose, row, joints in zip(found.pose, there, passive, strict=True):
            assert missed(robot, pose, row, joints) < 1e-9
