"""Arms whose joints have laws, for what holds none: refused with how far off, or said."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arms.joint_laws import sag_term
from pkmcal.controllers import loss
from pkmcal.view import page, serial, skeleton

AXES = [[0, 0, 1], [0, 1, 0], [0, 1, 0]]
POINTS = [[0, 0, 0], [0, 0, 300], [0, 0, 600]]
STIFF = pk.SerialArm(AXES, POINTS, [300, 0, 600, 0, 0, 0], name="three")


@pytest.fixture
def sagging() -> pk.SerialArm:
    arm = STIFF.with_terms([sag_term(1, 1, 2)])
    return arm.with_laws(arm.laws.with_values(np.array([1e-3])))


def test_the_loss_is_what_sag_moves_the_tool(sagging: pk.SerialArm) -> None:
    """At most 1e-3 rad at the reach of joint 2, 600 mm when stretched."""
    lost = loss.laws(sagging)
    assert 0.3 < lost.worst < 0.6 and 0.1 < lost.rms < lost.worst
    assert loss.laws(STIFF).exact


@pytest.mark.parametrize("write", ["urdf", "sdf", "dh"])
def test_what_holds_no_laws_refuses_them_with_the_loss(
    sagging: pk.SerialArm, tmp_path: Path, write: str
) -> None:
    with pytest.raises(pk.ArgumentError, match=r"arm.rigid, without it, is off by 0\.\d+ mm rms"):
        getattr(pk.export, write)(sagging, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    getattr(pk.export, write)(sagging.rigid, tmp_path / "out")


@pytest.mark.parametrize("target", ["urdf", "dh"])
def test_the_command_writes_the_rigid_arm_and_says_by_what_it_is_off(
    sagging: pk.SerialArm, tmp_path: Path, run: Any, target: str
) -> None:
    sagging.save(tmp_path / "arm.toml")
    done = run("export", str(tmp_path / "arm.toml"), "--as", target, "--out", str(tmp_path / "out"))
    assert done.exit_code == 0
    assert "by what its joints add to their commands" in done.output


def test_a_page_shows_the_rigid_arm_and_says_so(sagging: pk.SerialArm) -> None:
    data = serial.data(sagging)
    assert "left out here" in data["what"] and "left out" not in serial.data(STIFF)["what"]
    assert data["machine"] == serial.data(STIFF)["machine"]
    theta = np.full((1, 3), 0.4)
    assert page.places("", sagging, theta) == page.places("", STIFF, theta)
    drawn = skeleton.skeleton(sagging, theta[0], np.zeros(6))
    assert drawn is not None
    np.testing.assert_allclose(drawn.limbs[0][-1], sagging.forward(theta[0])[:3, 3])
