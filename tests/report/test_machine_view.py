"""The machine in the report: residuals as arrows where they were measured, and what changed."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.calibration.identification import Identification
from pkmcal.report.residual_vectors import measured_places, residual_vectors

from .. import browser, driven
from ..simulated import hexapod_poses
from ..view import pages

HEXAPOD = pk.load("hexapod")
POSES = hexapod_poses(HEXAPOD, 20, np.random.default_rng(3))
TRUE = HEXAPOD.replace({"offset1": 0.4, "offset4": -0.3})
Q = HEXAPOD.inverse(POSES)
TARGET = np.array([30.0, -20.0, 60.0])


def rotation(angles: np.ndarray) -> np.ndarray:
    """Rz(γ) Ry(β) Rx(α), written out."""
    (sa, sb, sg), (ca, cb, cg) = np.sin(angles), np.cos(angles)
    return np.array([
        [cb * cg, sa * sb * cg - ca * sg, ca * sb * cg + sa * sg],
        [cb * sg, sa * sb * sg + ca * cg, ca * sb * sg - sa * cg],
        [-sb, sa * cb, ca * cb],
    ])  # fmt: skip


ANCHOR = np.array([900.0, -200.0, 100.0])


def found_from(kind: Any) -> Identification:
    machine = pk.VirtualMachine(TRUE, noise=0.01, seed=1)
    if kind == "distance":
        measured = machine.measure(Q, pk.readings.Distance(TARGET), ANCHOR)
    else:
        measured = machine.measure(Q, kind, TARGET)
    return pk.identify(HEXAPOD, measured, free="offset*")


def targets(found: Identification) -> np.ndarray:
    """Where the target is at each row's pose, by NumPy."""
    pose = found.fit.end.pose[np.concatenate(found.fit.equations.table.pose_of)]
    return np.array([p[:3] + rotation(p[3:]) @ TARGET for p in pose])


def test_positions_leave_vectors_as_they_are() -> None:
    found = found_from("position")
    vectors = residual_vectors(found.fit.equations, found.fit.end)
    np.testing.assert_allclose(vectors, found.residuals[0], atol=1e-12)
    np.testing.assert_allclose(
        measured_places(found.fit.equations, found.fit.end), targets(found), atol=1e-9
    )


def test_vectors_of_a_tracker_somewhere_are_turned_into_the_base() -> None:
    measured = pk.VirtualMachine(TRUE, noise=0.01, seed=1).measure(Q, "position", target=TARGET)
    frame = np.array([500.0, -300.0, 80.0, 0.3, -0.5, 1.1])  # the base as the tracker has it
    seen = measured.values @ rotation(frame[3:]).T + frame[:3]
    away = pk.Measurements(measured.actuators, seen, kind="position", target=TARGET)
    found = pk.identify(HEXAPOD, away, free="offset*", unknown="frame")
    vectors = residual_vectors(found.fit.equations, found.fit.end)
    np.testing.assert_allclose(
        np.linalg.norm(vectors, axis=1), np.linalg.norm(found.residuals[0], axis=1), atol=1e-12
    )
    turned = found.residuals[0] @ rotation(frame[3:])  # the frame is found to 1e-4 rad
    np.testing.assert_allclose(vectors, turned, atol=1e-3 * np.abs(turned).max())


def test_heights_point_along_z() -> None:
    found = found_from("height")
    vectors = residual_vectors(found.fit.equations, found.fit.end)
    np.testing.assert_allclose(vectors[:, :2], 0.0, atol=1e-15)
    np.testing.assert_allclose(vectors[:, 2], found.residuals[0][:, 0], atol=1e-12)


def test_distances_point_away_from_their_anchor() -> None:
    found = found_from("distance")
    vectors = residual_vectors(found.fit.equations, found.fit.end)
    way = targets(found) - ANCHOR
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    np.testing.assert_allclose(vectors, found.residuals[0] * way, atol=1e-9)


# --- in the browser ------------------------------------------------------------------------------

_DRIVER = """<pre id="said"></pre><script>
(async () => {
const root = document.querySelector(".pkmcal-view")
while (!root.machine) await new Promise(next => setTimeout(next, 5))
const { mover, calibration, changed, scene } = root.machine, said = {}
const still = () => getComputedStyle(document.querySelector(".still")).display
said.still = still()
mover.visit(mover.data.places.poses[4], mover.data.places.q[4])
calibration.exaggeration = 1
changed()
said.visited = [mover.pose, mover.q, calibration.assumed]
calibration.exaggeration = 3
changed()
said.three = calibration.assumed
const odd = calibration.points.find(point => point.outlier)
const [x, y] = scene.seen(scene.eye, odd.at)
calibration.point(x + 2, y - 2, scene)
said.named = calibration.wordsOf(calibration.named)
said.before = calibration.found.textContent
calibration.switches[1].click()
said.after = calibration.found.textContent
document.getElementById("said").textContent = JSON.stringify(said)
})().catch(error => { document.getElementById("said").textContent = "failed: " + error })
</script>"""


@pytest.fixture(scope="module")
def slipped() -> Identification:
    """A hexapod, one of whose rows is 5 mm off."""
    measured = pk.VirtualMachine(TRUE, noise=0.01, seed=1).measure(Q, "position", target=TARGET)
    values = measured.values.copy()
    values[7] += [0.0, 5.0, 0.0]
    wrong = pk.Measurements(Q, values, kind="position", target=TARGET, sigma=0.01)
    return pk.identify(HEXAPOD, wrong, free="offset*", loss="cauchy")


@pytest.fixture(scope="module")
def report(slipped: Identification, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    slipped.report(folder)
    return folder / "report.html"


@pytest.fixture(scope="module")
def said(report: Path) -> dict[str, Any]:
    policy = r'<meta http-equiv="Content-Security-Policy"[^>]*>'
    text = re.sub(policy, "", report.read_text(encoding="utf-8"))
    other = report.with_name("driven.html")
    other.write_text(text.replace("</body>", _DRIVER + "</body>"), encoding="utf-8")
    seen = pages.dumped(other)
    match = re.search(r'<pre id="said">(.*?)</pre>', seen.dom, re.DOTALL)
    assert match and match[1] and not match[1].startswith("failed"), (match, seen.console)
    result: dict[str, Any] = json.loads(html.unescape(match[1]))
    return result


def test_the_policy_of_the_report_allows_its_script_and_no_other(report: Path) -> None:
    text = report.read_text(encoding="utf-8")
    scripts = re.findall(r"<script>(.*?)</script>", text, re.DOTALL)
    assert len(scripts) == 1
    digest = base64.b64encode(hashlib.sha256(scripts[0].encode()).digest()).decode()
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', text)
    assert policy and f"script-src 'sha256-{digest}' 'wasm-unsafe-eval'" in policy[1]
    assert (
        "default-src 'none'" in policy[1] and "unsafe-inline'" not in policy[1].split("script")[1]
    )
    seen = pages.started(report)
    assert not seen.console and "Measured minus predicted, at the places" in seen.dom


def test_measured_poses_can_be_visited(slipped: Identification, said: dict[str, Any]) -> None:
    pose, q, _ = said["visited"]
    np.testing.assert_allclose(slipped.robot.forward(q, pose).pose, pose, rtol=0, atol=1e-10)
    assert np.abs(slipped.fit.end.pose - pose).max(axis=1).min() == 0.0


def test_the_machine_as_assumed_is_overlaid(slipped: Identification, said: dict[str, Any]) -> None:
    pose, q, assumed = said["visited"]
    nominal = HEXAPOD.forward(q, pose).pose
    np.testing.assert_allclose(assumed, nominal, rtol=0, atol=1e-10)
    three = 3 * HEXAPOD.geometry.values - 2 * slipped.robot.geometry.values
    other = HEXAPOD.replace(three).forward(q, pose).pose
    np.testing.assert_allclose(said["three"], other, rtol=0, atol=1e-9)


def test_outliers_are_named_where_one_points(said: dict[str, Any]) -> None:
    assert re.fullmatch(r"row 7: \S+ → \S+ mm, outlier", said["named"])


def test_the_switch_shows_residuals_after(slipped: Identification, said: dict[str, Any]) -> None:
    for when, expected in (("before", slipped.rms_before), ("after", slipped.rms)):
        match = re.match(r"20 points: (\S+) mm rms", said[when])
        assert match and float(match[1]) == pytest.approx(expected, rel=5e-3)
    assert said["before"] != said["after"]


def test_the_still_picture_gives_way(said: dict[str, Any], report: Path) -> None:
    assert said["still"] == "none"
    text = report.read_text(encoding="utf-8")
    other = report.with_name("forbidden.html")
    other.write_text(re.sub(r"'sha256-[^']*'", "'none'", text), encoding="utf-8")
    without = browser.dump(other)
    assert '<div class="pkmcal-view"><p' in without.dom  # not "moves": hidden by its style
    assert ".pkmcal-view:not(.moves), .pkmcal-view.moves ~ .still { display: none; }" in text


@pytest.mark.parametrize("name", ["3r", "exechon"])
def test_arms_and_chains_have_it_too(name: str, tmp_path: Path) -> None:
    robot = pk.load(name)
    rng = np.random.default_rng(1)
    if isinstance(robot, pk.SerialArm):
        true = robot.replace(rng.normal(0, [0.3, 0.3, 0.3, 1e-3, 1e-3, 1e-3], (3, 6)))
        q = rng.uniform(-1.0, 1.0, (40, 3))
    else:
        name = robot.model.free[0]
        true = robot.replace({name: robot.geometry[name] + 0.3})
        q = robot.inverse(pk.sample_poses(robot, 25, seed=1, share=0.5))
    measured = pk.VirtualMachine(true, noise=0.01).measure(q, "position")
    found = pk.identify(robot, measured, prior=1.0)
    found.report(tmp_path)
    seen = pages.started(tmp_path / "report.html")
    assert not seen.console and "the machine as assumed before" in seen.dom
    assert not re.search(r"<td>\d{6,}</td>", seen.dom)  # degrees of freedom of a prior: infinite


def test_a_machine_with_drive_laws_moves_but_is_not_overlaid(tmp_path: Path) -> None:
    """The numbers of laws are not those of the page's core."""
    robot = driven.with_laws(HEXAPOD, np.random.default_rng(3), ("quadratic", "spool"))
    assert robot.model.driven
    poses = pk.sample_poses(robot, 20, seed=1, share=0.5)
    true = robot.replace({"base1.x": robot.geometry["base1.x"] + 0.5})
    measured = pk.VirtualMachine(true, noise=0.01).measure(robot.inverse(poses), "position")
    pk.identify(robot, measured, free=["base1.x", "base2.y"]).report(tmp_path)
    seen = pages.started(tmp_path / "report.html")
    assert not seen.console and "Measured minus predicted, at the places" in seen.dom
    assert "the machine as assumed before" not in seen.dom
