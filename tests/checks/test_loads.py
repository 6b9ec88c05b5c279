"""Stiffness and masses in another unit show at home; those of a machine as built do not."""

from __future__ import annotations

import pytest

import pkmcal as pk
from tests.robots import hexapod


def test_a_machine_as_built_raises_no_alarm() -> None:
    robot = hexapod(*[{"stiffness": 2e4}] * 6, platform={"mass": 30.0})
    assert pk.check_geometry(robot).ok


@pytest.mark.parametrize("stiffness", [20.0, 0.02], ids=["kN/m", "MN/m"])
def test_stiffness_in_another_unit_is_found(stiffness: float) -> None:
    robot = hexapod(*[{"stiffness": stiffness}] * 6, platform={"mass": 300.0})
    (finding,) = pk.check_geometry(robot).findings
    assert finding.kind == "load" and "under the load that its file states" in finding.what
    assert "N/mm" in finding.suggestion
