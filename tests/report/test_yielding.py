"""What reports and pages say of a machine that yields, against the machine under forces."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.kinematics.robot import Robot
from pkmcal.report.yielding import FORCE, of
from pkmcal.view import yielding

from .. import browser
from ..simulated import hexapod_poses
from ..view.pages import started

MACHINES = {"hexapod": "offset*", "linear-delta-6": "rod*", "6-rus": "offset*"}
_NUDGE = 1e-3  # N: so small that nothing bends


def softest(robot: Robot, poses: np.ndarray) -> np.ndarray:
    """N/mm along the softest direction, by pulling along x, y and z at held actuators."""
    q, columns = robot.inverse(poses), []
    for axis in np.eye(3):
        there = [
            robot.forward(q, guess=poses, load=pk.Load(force=sign * _NUDGE * axis)).pose[:, :3]
            for sign in (1, -1)
        ]
        columns.append((there[0] - there[1]) / (2 * _NUDGE))
    return 1.0 / np.linalg.eigvalsh(np.stack(columns, axis=2))[:, -1]


@pytest.mark.parametrize("name", MACHINES)
def test_page_shows_what_forces_do(name: str) -> None:
    robot = pk.load(name).yielding({MACHINES[name]: 1e-4})
    poses = pk.sample_poses(robot.rigid, 12, seed=1, share=0.5)
    said = yielding.data(robot, poses)
    known = softest(robot, np.vstack([robot.home, poses]))
    np.testing.assert_allclose(said["cloud"], known[1:], rtol=6e-3)
    _, home, least, median = said["rows"][-1]
    np.testing.assert_allclose(
        [home, least, median], [known[0], known[1:].min(), np.median(known[1:])], rtol=6e-3
    )


def test_page_opens_with_the_stiffness_in_it(tmp_path: Path) -> None:
    robot = pk.load("hexapod").yielding({"offset*": 5e-5})
    page = pk.show(robot, tmp_path / "stiff.html")
    seen = started(page)
    assert seen.console == []
    stiff = pk.stiffness(robot, robot.home).softest[1]
    assert f"<td>softest</td><td>{float(f'{stiff:.3g}'):g}</td>" in seen.dom
    assert "by stiffness" in seen.dom


def test_report_of_a_machine_that_yields_has_its_stiffness(tmp_path: Path) -> None:
    robot = pk.load("hexapod").yielding({"offset*": 5e-5})
    poses = hexapod_poses(robot, 20, np.random.default_rng(0))
    rows = pk.VirtualMachine(robot, noise=0.01).measure(robot.inverse(poses))
    found = pk.identify(robot, rows, free="offset*")
    page, numbers, _ = found.report(tmp_path)
    said = json.loads(numbers.read_text())["stiffness"]
    assert said["home"] == pytest.approx(softest(found.robot, robot.home[None])[0], rel=1e-6)
    least = {way["name"]: way["least"] for way in said["ways"]}
    worst = np.array(said["pose"])[None]
    assert least["softest"] == pytest.approx(softest(found.robot, worst)[0], rel=1e-5)
    assert least["softest"] <= min(said["softest"])
    moved = {way["name"]: way["moved_most"] for way in said["ways"]}
    assert moved["softest"] == pytest.approx(FORCE / least["softest"])
    along = np.array(said["direction"])
    q = found.robot.inverse(worst)
    fore, back = (
        found.robot.forward(q, guess=worst, load=pk.Load(force=sign * _NUDGE * along)).pose[0, :3]
        for sign in (1, -1)
    )
    assert (fore - back) @ along == pytest.approx(2 * _NUDGE / least["softest"], rel=1e-5)
    seen = browser.dump(page)
    assert seen.console == [] and 'id="stiffness"' in seen.dom
    assert 'aria-label="Stiffness over the workspace"' in seen.dom


def test_what_does_not_yield_has_no_stiffness() -> None:
    assert of(pk.load("hexapod"), None) is None
    assert of(pk.load("3r"), None) is None
