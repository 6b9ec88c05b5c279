"""Files that do not say which coordinates determine a pose: as many are taken as limbs leave."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.geometry import robot_file
from tests.kinematics.test_chains import commands, loaded

STATED = re.compile(r"(?m)^match.*\n")


def with_match() -> list[str]:
    names = [name for name in pk.machines() if name != "3r"]
    return [n for n in names if STATED.search(robot_file.located(n)[0].decode())]


@pytest.mark.parametrize("name", with_match())
def test_as_many_coordinates_as_ways_to_move_determine_a_pose(name: str, tmp_path: Path) -> None:
    stated = pk.load(name)
    text = STATED.sub("", robot_file.located(name)[0].decode())
    robot = loaded(text, tmp_path)
    assert robot.model.match is None and len(robot.moved) == len(stated.moved)
    pose = stated.forward(commands(stated, 5, share=0.3)).pose
    places = [("x", "y", "z", "alpha", "beta", "gamma").index(c) for c in robot.moved]
    asked = np.tile(robot.home, (5, 1))
    asked[:, places] = pose[:, places]
    found = robot.complete(asked)
    assert np.abs(found - pose).max() < 1e-6
    assert "no problems found" in str(pk.check_geometry(robot))
