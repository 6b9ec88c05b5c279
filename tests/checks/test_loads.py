"""Stiffness and masses in another unit show at home; those of a machine as built do not."""

from __future__ import annotations

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arms.joint_laws import Term
from tests.robots import hexapod

from ..arms.test_joint_laws import CENTRES, MASSES, SIX


def test_a_machine_as_built_raises_no_alarm() -> None:
    robot = hexapod(*[{"stiffness": 2e4}] * 6, platform={"mass": 30.0})
    assert pk.check_geometry(robot).ok


@pytest.mark.parametrize("stiffness", [20.0, 0.02], ids=["kN/m", "MN/m"])
def test_stiffness_in_another_unit_is_found(stiffness: float) -> None:
    robot = hexapod(*[{"stiffness": stiffness}] * 6, platform={"mass": 300.0})
    (finding,) = pk.check_geometry(robot).findings
    assert finding.kind == "load" and "under the load that its file states" in finding.what
    assert "N/mm" in finding.suggestion


@pytest.mark.parametrize(
    ("compliance", "what"), [(5e-8, None), (5e-6, "sags by more than"), (5e3, "gives way")]
)
def test_compliances_of_an_arm_in_another_unit_are_found(
    compliance: float, what: str | None
) -> None:
    """Also where no posture holds: the sag of such an arm is no number."""
    laws = SIX.joint_laws.weighing(MASSES, CENTRES).with_terms([Term(1, "compliance")])
    arm = SIX.with_laws(laws.with_values(np.array([compliance])))
    findings = pk.check_geometry(arm).findings
    assert len(findings) == (what is not None)
    assert all(each.kind == "load" and str(what) in each.what for each in findings)
