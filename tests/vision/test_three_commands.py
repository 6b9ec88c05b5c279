"""As a new user: pictures and a log of the joints become a calibrated machine, as the page says."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.readings.hand_eye import of_frame_and_tool

pytest.importorskip("cv2", reason="OpenCV is not installed (the extra vision)")

from pkmcal.examples.camera.render import main

PAGE = Path(__file__).parents[2] / "docs" / "tutorial-camera.md"
COMMANDS = [
    shlex.split(line)[1:]
    for block in re.findall(r"^```sh\n(.*?)^```$", PAGE.read_text("utf-8"), re.M | re.S)
    for line in block.splitlines()
    if line.startswith("pkmcal ") and not line.startswith("pkmcal plan ")
]


def poses(machine: Any, q: np.ndarray) -> np.ndarray:
    """Of the platform, or the flange, (N, 6)."""
    solved = machine.forward(q)
    return solved.pose if hasattr(solved, "pose") else pk.screw.to_pose(solved)


def off(machine: Any, true: Any, q: np.ndarray) -> float:
    """Root mean square distance elsewhere, mm, after the best motions of base and platform.

    No camera tells where base and flange are: a frame and a tool take them to one another.
    """
    found, wanted = poses(machine, q), poses(true, q)
    frame, tool = (pk.screw.from_pose(each) for each in of_frame_and_tool(wanted, found))
    laid = frame @ pk.screw.from_pose(found) @ tool
    away = laid[:, :3, 3] - wanted[:, :3]
    return float(np.sqrt((away**2).sum(axis=1).mean()))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "file", "most", "better"),
    [("hexapod", "hexapod.toml", 0.06, 15), ("arm", "arm.urdf", 0.04, 5)],
)
def test_pictures_and_a_log_lead_to_a_calibrated_machine_in_three_commands(
    run: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    name: str, file: str, most: float, better: float,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    main([name, name, "30"])
    printing, *others = COMMANDS
    mine = [each for each in others if any(word.startswith(f"{name}/") for word in each)]
    assert [each[0] for each in (printing, *mine)] == ["board", "detect", "calibrate"]
    results = [run(*each) for each in (printing, *mine)]
    assert [each.exit_code for each in results] == [0, 0, 0], results[-1].output
    assert results[-1].stdout.startswith("Calibrated") and "outliers:" not in results[-1].stdout
    drawn, true = pk.load(Path(name) / file), pk.load(Path(name) / "true.toml")
    found = pk.load(Path(name) / "calibrated" / "robot.toml")
    if name == "hexapod":
        q = drawn.inverse(pk.sample_poses(drawn, 40, seed=77, share=0.3))
    else:
        near = np.radians([0.0, -10, 45, 0, 55, 0])
        q = near + np.random.default_rng(7).uniform(-0.35, 0.35, (40, 6))
    left = off(found, true, q)
    assert left < most and left * better < off(drawn, true, q), (left, off(drawn, true, q))
