"""What a calibration says of its camera and its pictures is what simulated ones are."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.readings import Camera
from pkmcal.report import contents, report

from ..diagnostics.test_pictures import BOARD, LENS, fitted, pictures, with_lens


@pytest.fixture(scope="module")
def sound() -> pk.Measurements:
    return pictures()


@pytest.fixture(scope="module")
def found(sound: pk.Measurements) -> pk.Identification:
    assert sound.group is not None
    names = np.array([f"img_{group:03d}.png" for group in sound.group.tolist()])
    return fitted(replace(sound, pose_name=names), holdout=0.2)


def test_a_camera_as_found_sees_with_the_machine_as_found_what_the_fit_predicts(
    found: pk.Identification,
) -> None:
    (camera,), (measured,) = found.instruments, found.fit.equations.table.sets
    seen = pk.VirtualMachine(found.robot, 0.0).measure(measured.actuators, camera).values
    read = np.isfinite(seen).all(axis=1)  # not what is beyond the edge of the picture
    assert read.sum() > 0.9 * len(read)
    residual = (measured.values - seen)[read]
    np.testing.assert_allclose(residual, found.residuals[0][read], atol=1e-6)


def test_angles_change_the_shorter_way_round(found: pk.Identification) -> None:
    """A board that looks up starts at half a turn, and ends on either side of it."""
    start = np.where(np.array(found.units) == "rad", found.values + 6.2, found.start)
    turned = replace(found, start=start)
    columns = turned._columns()
    told = dict(zip(columns["name"], columns["change"].tolist(), strict=True))
    angles = [name for name, unit in zip(found.free, found.units, strict=True) if unit == "rad"]
    assert angles and all(abs(told[name] - (2 * np.pi - 6.2)) < 1e-9 for name in angles)
    i = found.free.index("offset1")
    assert told["offset1"] == found.values[i] - found.start[i]
    assert "-355" not in str(turned)


def test_lens_and_size_that_were_found_are_those_of_the_instrument(sound: pk.Measurements) -> None:
    measured = with_lens(sound, lens="focal", find_size=True, fx=1495.0)
    free = fitted(measured)
    (camera,) = free.instruments
    assert isinstance(camera, Camera) and camera.lens == "none" and not camera.find_size
    assert camera.fx == free.parameters["lens.fx"]["value"]
    grown = 1.0 + free.parameters["board.size"]["value"]
    given = np.asarray(measured.instrument.corner)
    np.testing.assert_allclose(np.asarray(camera.corner), given * grown, rtol=1e-12)


def test_what_a_picture_shows_elsewhere_is_how_far_its_machine_was(sound: pk.Measurements) -> None:
    off = pictures(off={6: 0.5})
    assert off.group is not None
    kept = off.select(off.group != 6)
    one = off.select(off.group == 6)
    result = fitted(kept, holdout=one)
    (moved,) = (each for each in result.pictures if each.use == "held out")
    others = [each.seen for each in result.pictures if each.use == "fitted"]
    shown = np.hypot(moved.seen.across, moved.seen.along)
    assert shown == pytest.approx(0.5, rel=0.25)
    assert shown > 4 * np.hypot(*np.median([[e.across, e.along] for e in others], axis=0))
    assert moved.seen.off == pytest.approx(0.1 * np.sqrt(2.0), rel=0.3)  # the noise of the corners
    assert moved.seen.off_commanded > 2 * moved.seen.off


def test_pictures_have_their_names_and_places(found: pk.Identification) -> None:
    used = {each.name: each for each in found.pictures}
    assert len(used) == len(found.pictures) and all(name.startswith("img_") for name in used)
    assert {each.use for each in found.pictures} == {"fitted", "held out"}
    for each in found.pictures:
        assert each.seen.corners == len(BOARD.ids) and 1000 < each.seen.distance < 1500
        assert each.seen.mm_per_pixel == pytest.approx(each.seen.distance / LENS["fx"], rel=0.1)
        assert 0.0 <= each.seen.tilt < np.radians(60.0)
    assert "pictures held out the board is off by" in str(found)


def test_a_picture_in_which_nothing_was_read_is_listed(sound: pk.Measurements) -> None:
    assert sound.group is not None
    values = sound.values.copy()
    values[sound.group == sound.group[0]] = np.nan
    seen = replace(sound, values=values, actuator_sigma=0.0)
    empty = pk.identify(pk.load("hexapod"), seen, free=[]).pictures
    assert len(empty) == len(np.unique(sound.group)) - 1  # it says nothing, and is not fitted


def test_the_machine_by_itself_is_known_as_well_as_drawn_machines_differ(
    found: pk.Identification,
) -> None:
    """Machines drawn from the covariance, laid on one another by finite motions, in numbers."""
    poses = pk.sample_poses(found.robot, 30, seed=5, share=0.25)
    stated = contents.expected(found, poses)
    names = [n for n in found.free if n in found.robot.geometry.names]
    of = [found.free.index(n) for n in names]
    covariance = found.covariance[np.ix_(of, of)]
    random, q = np.random.default_rng(2), found.robot.inverse(poses)
    root = np.linalg.cholesky(covariance + 1e-18 * np.eye(len(of)))
    off = []
    for _ in range(40):
        change = root @ random.normal(size=len(of))
        values = {n: found.robot.geometry[n] + d for n, d in zip(names, change, strict=True)}
        off.append(_apart(found.robot.replace(values).forward(q).pose, poses))
    scatter = np.sqrt(np.mean(np.square(off), axis=0))
    assert np.sqrt(np.mean(stated**2)) == pytest.approx(np.sqrt(np.mean(scatter**2)), rel=0.1)
    assert np.corrcoef(stated, scatter)[0, 1] > 0.95


def _apart(pose: np.ndarray, onto: np.ndarray) -> np.ndarray:
    """Distances (N,) of places after the best finite motions of base and platform."""
    at, wanted = pk.screw.from_pose(pose), pk.screw.from_pose(onto)
    length = pk.load("hexapod").length

    def moved(x: np.ndarray) -> np.ndarray:
        return pk.screw.exp(x[:6]) @ at @ pk.screw.exp(x[6:])

    def residual(x: np.ndarray) -> np.ndarray:
        there = moved(x)
        turned = there[:, :3, :3] @ wanted[:, :3, :3].transpose(0, 2, 1)
        angles = [turned[:, i, j] - turned[:, j, i] for i, j in ((2, 1), (0, 2), (1, 0))]
        return np.hstack([np.stack(angles, 1) * 0.5 * length, (there - wanted)[:, :3, 3]]).ravel()

    from scipy.optimize import least_squares

    scale = np.tile([1e-3] * 3 + [1.0] * 3, 2)
    best = least_squares(residual, np.zeros(12), x_scale=scale, method="lm").x
    return np.linalg.norm((moved(best) - wanted)[:, :3, 3], axis=1)


def test_the_report_has_pictures_the_camera_and_mm_of_the_machine(
    found: pk.Identification, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its figures are drawn; what they are as SVG is tested with reports."""
    monkeypatch.setattr("pkmcal.report.svg.inline_svg", lambda figure, name, text: f"<svg {name}>")
    facts = report.gather(found, {})
    accuracy = facts["accuracy"]
    assert accuracy is not None
    np.testing.assert_allclose(
        accuracy.accuracy, contents.expected(found, accuracy.poses), rtol=1e-9
    )
    page = report.html(facts)
    assert all(each.name in page for each in found.pictures)
    assert all(f"<svg {name}>" in page for name in ("points", "residuals", "accuracy"))
    assert "base to camera" in page and "board to platform" in page
    assert '"rides":false' in page  # the page draws it
    assert facts["instruments"][0]["numbers"]["fx"] == LENS["fx"]


@pytest.mark.parametrize("on", ["base", "platform"])
def test_a_camera_is_read_back_from_the_file_of_what_was_found(on: Any, tmp_path: Path) -> None:
    stands, carried = [100.0, -20, 1900, 0.3, -0.2, 1.0], [1.0, 2, 3, 0.1, 0.2, 0.3]
    camera = Camera(**LENS, on=on, stands=stands, carried=carried, camera_name="left")
    assert camera.file_name == "camera-left.yaml"
    camera.write(tmp_path / "c.yaml", "# a comment: 3\n")
    again = Camera.from_file(tmp_path / "c.yaml")
    np.testing.assert_array_equal(again.lens_numbers(), camera.lens_numbers())
    assert (again.width, again.height) == (camera.width, camera.height)
    names = ("base_to_camera", "board_to_platform")
    names = names if on == "base" else ("base_to_board", "camera_to_platform")
    assert tuple(camera.motions) == names
    wanted = pk.screw.from_pose(np.array([stands, carried]))
    np.testing.assert_allclose([*camera.motions.values()], wanted, atol=1e-12)


def test_opencv_reads_the_file_of_a_camera(tmp_path: Path) -> None:
    cv2 = pytest.importorskip("cv2")
    camera = Camera(**LENS, stands=[0, 0, 2000, 3, 0, 0], carried=[1, 2, 3, 0.1, 0.2, 0.3])
    camera.write(tmp_path / "c.yaml", "# written by a test\n")
    file = cv2.FileStorage(str(tmp_path / "c.yaml"), cv2.FILE_STORAGE_READ)
    for name, motion in camera.motions.items():
        np.testing.assert_array_equal(file.getNode(name).mat(), motion)
    assert file.getNode("camera_matrix").mat()[0, 0] == LENS["fx"]
