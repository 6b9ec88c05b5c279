"""Pictures of a board: lenses that are not theirs, mirrors, level plans, pictures of other rows."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.readings import Board, Camera

BOARD = Board.chessboard(6, 5, 35)
LENS = {
    "fx": 1500.0, "fy": 1505.0, "cx": 640.0, "cy": 400.0, "k1": -0.15, "k2": 0.1, "p1": 1e-3,
    "p2": -5e-4, "width": 1280, "height": 800,
}  # fmt: skip
PLAIN = {"fx": 1500.0, "fy": 1500.0, "cx": 640.0, "cy": 400.0, "width": 1280, "height": 800}
SCATTER, NOISE = 0.01, 0.1  # mm of legs, px
FREE = ["base*", "platform*", "offset*"]


def pictures(
    count: int = 24, tilt: float = 1.0, off: dict[int, float] | None = None, **lens: float
) -> pk.Measurements:
    """Of a board on a hexapod with errors, below a camera; some picture is mm off its row."""
    random, drawn = np.random.default_rng(3), pk.load("hexapod")
    names = drawn.geometry.match(FREE)
    true = drawn.replace({n: drawn.geometry[n] + random.normal(0.0, 0.3) for n in names})
    carried = pk.screw.from_pose(np.array([0, 0, 20, np.pi + 0.02, 0.03, 0.3]))
    carried[:3, 3] += [0, 0, 20] - carried[:3, :3] @ BOARD.places.mean(axis=0) - carried[:3, 3]
    camera = Camera(
        **{**LENS, **lens}, stands=[-150, 120, 1950, 3.0, 0.1, 0.2],
        carried=pk.screw.to_pose(carried),
    )  # fmt: skip
    poses = pk.sample_poses(drawn, 200, seed=1, share=0.25)
    poses[:, 3:] *= tilt
    told = drawn.inverse(poses)
    moved = true.forward(told + random.normal(0.0, SCATTER, told.shape)).pose
    for picture, mm in (off or {}).items():
        moved[picture, :3] += mm * np.array([0.6, -0.64, 0.48])
    at, seeing = camera.seeing(true.inverse(moved), BOARD)
    seen = pk.VirtualMachine(true, NOISE, 5).measure(at, seeing)
    corners = len(BOARD.ids)
    whole = np.isfinite(seen.values).all(axis=1).reshape(-1, corners).all(axis=1)
    assert whole[:count].sum() >= 0.9 * count
    rows = np.flatnonzero(np.repeat(whole, corners) & (np.arange(len(at)) < count * corners))
    own = seen.select(rows)
    return pk.Measurements(
        np.repeat(told, corners, axis=0)[rows], own.values, own.instrument, group=rows // corners
    )


def fitted(measured: pk.Measurements, **options: Any) -> pk.Identification:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pk.CalibrationWarning)
        return pk.identify(pk.load("hexapod"), measured, FREE, fix="datum", **options)


def checks(measured: pk.Measurements, **options: Any) -> tuple[pk.Identification, dict[str, str]]:
    found = fitted(measured, **options)
    return found, {each.check: each.text for each in found.verdict.said}


@pytest.fixture(scope="module")
def sound() -> pk.Measurements:
    return pictures()


@pytest.fixture(scope="module")
def few(sound: pk.Measurements) -> pk.Measurements:
    """Enough of them to tell what is wrong with pixels, or with where they are."""
    return sound.select(sound.group < 8)


def with_lens(measured: pk.Measurements, **numbers: float) -> pk.Measurements:
    return replace(measured, instrument=replace(measured.instrument, **numbers))


def test_sound_pictures_are_not_doubted(sound: pk.Measurements) -> None:
    found, said = checks(sound)
    assert "doubtful-readings" not in said and "hardly-turned" not in said
    assert found.outliers == () and "poses-elsewhere" not in said
    assert found.component_noise[0] == pytest.approx((NOISE, NOISE), rel=0.1)
    assert found.actuator_noise == pytest.approx(SCATTER, rel=0.3)


def doubts(measured: pk.Measurements) -> str:
    return " ".join(measured.instrument.doubts(measured))


def test_rectified_pictures_with_the_lens_of_others_are_said(few: pk.Measurements) -> None:
    straight = {"k1": 0.0, "k2": 0.0, "p1": 0.0, "p2": 0.0}
    bent = {**straight, "k1": -0.45, "k2": 0.3}
    rectified = with_lens(pictures(8, **straight), **bent)
    assert "rectified" in doubts(rectified)
    assert not doubts(few) and not doubts(with_lens(few, width=0, height=0))
    assert not doubts(with_lens(rectified, **straight))


def test_the_lens_of_turned_pictures_is_said(few: pk.Measurements) -> None:
    turned = {"fx": "fy", "cx": "cy", "p1": "p2"} | {"fy": "fx", "cy": "cx", "p2": "p1"}
    wrong = with_lens(few, **{name: LENS[of] for name, of in turned.items()})
    assert "turned pictures" in doubts(wrong)
    unknown_size = with_lens(wrong, width=0, height=0)
    assert "turned pictures" in doubts(unknown_size)


@pytest.mark.parametrize("way", ["right", "left"])
@pytest.mark.parametrize("known", [True, False])
def test_turned_pictures_are_named_so_and_no_distortion(
    few: pk.Measurements, way: str, known: bool
) -> None:
    """What corners are off with the lens as it was is little; that turned it fits is a reason."""
    u, v = few.values.T
    ends = {"right": (LENS["height"] - 1 - v, u), "left": (v, LENS["width"] - 1 - u)}
    turned = replace(few, values=np.column_stack(ends[way]))
    said = doubts(turned if known else with_lens(turned, width=0, height=0))
    assert "that of turned pictures" in said and "another (" not in said


@pytest.mark.parametrize("scale", [0.5, 2 / 3, 2.0])
def test_the_lens_of_pictures_of_another_size_is_named_so(
    few: pk.Measurements, scale: float
) -> None:
    smaller = replace(few, values=(few.values + 0.5) * scale - 0.5)
    assert f"with the lens times {scale:.3g} corners" in doubts(smaller)


def test_pictures_that_a_lens_folds_are_refused_as_not_showing_the_board(
    sound: pk.Measurements,
) -> None:
    """Beyond where a distortion folds no direction belongs to a pixel: the search begins beside."""
    folded = with_lens(sound, k1=-2.5)
    with pytest.raises(pk.ArgumentError, match="the lens of these pictures"):
        pk.identify(pk.load("hexapod"), folded, free=[])


def test_mirrored_pictures_and_numbers_from_the_other_side_are_said(few: pk.Measurements) -> None:
    """With numbers from the other side the same fits: the board then is turned by half a turn."""
    width = LENS["width"]
    values = few.values.copy()
    values[:, 0] = width - 1 - values[:, 0]
    mirrored = with_lens(replace(few, values=values), cx=width - 1 - LENS["cx"])
    assert "mirrored" in doubts(mirrored)
    with pytest.raises(pk.exceptions.ArgumentError, match="mirrored"):
        pk.identify(pk.load("hexapod"), mirrored, FREE, fix="datum")
    behind = with_lens(few, corner=np.asarray(few.instrument.corner) * [-1, 1, 1])
    assert "seen from behind" in doubts(behind)
    fits = [
        pk.identify(pk.load("hexapod"), replace(each, actuator_sigma=0.0), free=[])
        for each in (few, behind)
    ]
    assert "doubtful-readings" in {each.check for each in fits[1].verdict.said}
    one, other = (fit.residuals[0] for fit in fits)
    np.testing.assert_allclose(one, other, atol=1e-5)


@pytest.mark.parametrize(
    ("tilt", "words"),
    [(0.0, "all turned alike"), ([0, 0, 1], "about one axis alone")],
)
def test_plans_that_do_not_turn_are_doubtful_and_named(tilt: Any, words: str) -> None:
    """Frames alone are found; tilts are told by the poses, which the nominal machine knows."""
    measured = replace(pictures(tilt=tilt), actuator_sigma=0.0)
    found = pk.identify(pk.load("hexapod"), measured, free=[])
    (text,) = (each.text for each in found.verdict.said if each.check == "hardly-turned")
    assert words in text and found.verdict.state != "calibrated"


def test_machines_that_cannot_turn_are_not_asked_to() -> None:
    robot = pk.load("linear-delta")
    q = robot.inverse(pk.sample_poses(robot, 16, seed=0))
    carried = pk.screw.to_pose(pk.screw.exp(np.array([0, np.pi, 0, 0, 0, 0])))
    camera = Camera(**PLAIN, stands=[0, 0, 800, np.pi, 0, 0], carried=carried)
    at, seeing = camera.seeing(q, Board.chessboard(4, 3, 10))
    found = pk.identify(robot, pk.VirtualMachine(robot, 0.1).measure(at, seeing), fix="datum")
    assert "hardly-turned" not in {each.check for each in found.verdict.said}


@pytest.mark.parametrize(("mm", "which"), [(0.6, (7,)), (1.2, (5, 16))])
def test_a_picture_of_another_row_is_named_and_no_sound_one(
    mm: float, which: tuple[int, ...]
) -> None:
    measured = pictures(off=dict.fromkeys(which, mm))
    found, said = checks(measured)
    named = {int(each) for each in measured.group[list(found.outliers)]}
    assert named == {*which}
    assert len(found.outliers) == len(which) * len(BOARD.ids)  # whole pictures
    assert found.verdict.state == "doubtful"
    assert all(f"pose {each} ({len(BOARD.ids)} rows)" in said["poses-elsewhere"] for each in which)


def test_a_picture_that_carries_the_fit_is_grave_and_left_out_as_advised() -> None:
    """Of 3 mm among legs of 0.01: no other number of the fit can be believed with it."""
    measured = pictures(off={4: 3.0})
    found, said = checks(measured)
    assert found.verdict.state == "not calibrated" and "poses-elsewhere" in said
    assert found.verdict.reasons[0] == said["poses-elsewhere"]
    (own,) = (each for each in found.verdict.said if each.check == "poses-elsewhere")
    assert {*measured.group[list(own.remedies[0].value)]} == {4}
    without, said = checks(measured, drop="outliers")
    assert {*measured.group[list(without.dropped)]} == {4}
    assert without.verdict.state == "calibrated" and "poses-elsewhere" not in said
    assert without.actuator_noise == pytest.approx(SCATTER, rel=0.3)


@pytest.mark.parametrize(
    ("machine", "free", "size", "level"),
    [
        ("hexapod", ["base*"], False, "remark"),
        ("hexapod", ["base*"], True, None),
        ("hexapod", ["base*", "gain*"], False, "remark"),
        ("hexapod", ["base*", "gain*"], True, "doubt"),
        ("6-rus", ["base*"], False, "remark"),
        ("6-rus", ["base*", "crank*", "rod*", "platform*"], True, "doubt"),
    ],
)
def test_what_alone_tells_the_size_of_a_machine_is_named(
    machine: str, free: list[str], size: bool, level: str | None
) -> None:
    """Where turning drives, or gains are found, a board of unknown size leaves a scale open."""
    robot = pk.load(machine)
    height = float(robot.home[2])
    camera = Camera(
        **PLAIN, stands=[0, 0, height + 900, np.pi, 0, 0], find_size=size,
        carried=[0, 0, 0, np.pi, 0, 0],
    )  # fmt: skip
    poses = pk.sample_poses(robot, 20, seed=0, share=0.2)
    at, seeing = camera.seeing(robot.inverse(poses), Board.chessboard(4, 3, 30))
    measured = pk.VirtualMachine(robot, 0.05).measure(at, seeing)
    measured = replace(measured, actuator_sigma=0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pk.CalibrationWarning)
        found = pk.identify(robot, measured, free)
    levels = {each.check: each.level for each in found.verdict.said}
    assert levels.get("scale") == level


@pytest.mark.parametrize("printed", [1.0, 0.97, 1.04])
def test_a_board_printed_larger_or_smaller_is_named_where_it_alone_tells_the_size(
    printed: float,
) -> None:
    """A machine that has become larger as a whole, and in no part else, was not made so."""
    random, drawn = np.random.default_rng(2), pk.load("6-rus")
    names = drawn.geometry.match(["base*", "platform*", "crank*", "rod*"])
    names = [
        name for name in names if drawn.geometry.units[drawn.geometry.names.index(name)] == "mm"
    ]
    true = drawn.replace({n: drawn.geometry[n] + random.normal(0.0, 0.1) for n in names})
    height = float(drawn.home[2])
    board = Board.chessboard(4, 3, 30)
    camera = Camera(
        **PLAIN, stands=[0, 0, height + 900, np.pi, 0, 0],
        carried=[0, 0, 0, np.pi, 0, 0],
    )  # fmt: skip
    at, seeing = camera.seeing(drawn.inverse(pk.sample_poses(drawn, 25, seed=0, share=0.5)), board)
    seen = pk.VirtualMachine(true, 0.02).measure(at, seeing)
    stated = replace(seen.instrument, corner=np.asarray(seen.instrument.corner) / printed)
    measured = replace(seen, instrument=stated, actuator_sigma=0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pk.CalibrationWarning)
        found = pk.identify(drawn, measured, names)
    (said,) = (each for each in found.verdict.said if each.check == "scale")
    if printed == 1.0:
        assert said.level == "remark" and abs(said.finding.grown) < 2e-3
    else:
        assert said.level == "doubt" and found.verdict.state == "doubtful"
        assert said.finding.grown == pytest.approx(1.0 / printed - 1.0, abs=2e-3)
        words = ("smaller", "larger") if printed < 1 else ("larger", "smaller")
        assert f"the board is rather {100 * abs(1 / printed - 1):.2g} % {words[0]}" in said.text


def test_pictures_of_corners_in_a_line_place_nothing(sound: pk.Measurements) -> None:
    """Six corners in a row tell no turning of the board; all rows are fitted all the same."""
    row = np.arange(len(sound)) % len(BOARD.ids)
    values = np.where(((sound.group == 4) & (row > 5))[:, None], np.nan, sound.values)
    measured = replace(sound, values=values, actuator_sigma=0.0)
    pose = pk.load("hexapod").forward(sound.actuators).pose
    seen = np.isfinite(measured.instrument.places_seen(measured, pose)).all(axis=1)
    assert not seen[sound.group == 4].any() and seen[sound.group == 5].any()
    found = pk.identify(pk.load("hexapod"), measured, free=[])
    assert (
        np.isfinite(found.residuals[0]).all(axis=1).sum() == np.isfinite(values).all(axis=1).sum()
    )


@pytest.mark.parametrize(
    ("numbers", "word"),
    [
        ({"fx": 1530.0, "fy": 1535.0}, "focal length or middle of the lens"),
        ({"cx": 655.0}, "focal length or middle of the lens"),
    ],
)
def test_a_lens_that_is_off_is_named_as_the_cause(
    sound: pk.Measurements, numbers: dict[str, float], word: str
) -> None:
    found, said = checks(with_lens(sound, **numbers))
    assert found.verdict.state != "calibrated"
    assert word in said["causes"] and "--lens focal" in said["causes"]


def test_a_board_of_another_size_is_named_as_the_cause(sound: pk.Measurements) -> None:
    larger = np.asarray(sound.instrument.corner) * 1.02
    found, said = checks(with_lens(sound, corner=larger))  # type: ignore[arg-type]
    assert found.verdict.state != "calibrated" and "a board of another size" in said["causes"]


def test_a_lens_without_its_distortion_is_named_beside_a_fit_that_is_none(
    sound: pk.Measurements,
) -> None:
    straight = with_lens(sound, k1=0.3, k2=0.0, p1=0.0, p2=0.0)
    some = straight.select(straight.group < 12)
    found, said = checks(replace(some, actuator_sigma=0.0))
    assert "the lens is not that of these pictures" in said["doubtful-readings"]
    assert found.verdict.state != "calibrated"


def test_pixels_beyond_the_edge_of_the_picture_are_said(few: pk.Measurements) -> None:
    assert "v reaches" not in doubts(few)
    narrow = with_lens(few, height=300)
    assert "v reaches from" in doubts(narrow) and "300 px high" in doubts(narrow)


def test_pictures_of_another_board_are_refused(sound: pk.Measurements) -> None:
    other = Board.chessboard(5, 6, 35)
    places = np.tile(other.places, (len(sound) // len(other.ids), 1))
    with pytest.raises(pk.ArgumentError, match="columns before rows"):
        checks(with_lens(sound, corner=places))  # type: ignore[arg-type]


def test_pictures_of_the_rows_beside_are_refused(sound: pk.Measurements) -> None:
    shifted = np.roll(sound.actuators, len(BOARD.ids), axis=0)
    with pytest.raises(pk.ArgumentError, match="deg with the actuators of the next picture"):
        checks(replace(sound, actuators=shifted))


@pytest.mark.parametrize(("unit", "larger"), [(1e-3, 1000), (1 / 25.4, 25.4), (25.4, 0.03937)])
def test_a_board_in_another_unit_is_named(
    sound: pk.Measurements, unit: float, larger: float
) -> None:
    corner = unit * np.asarray(sound.instrument.corner)
    with pytest.raises(pk.ArgumentError, match=r"with a board .* times as large") as error:
        checks(with_lens(sound, corner=corner))  # type: ignore[arg-type]
    found = re.search(r"with a board ([\d.]+) times as large", str(error.value))
    assert found is not None and float(found[1]) == pytest.approx(larger, rel=2e-3)


def test_a_camera_on_the_other_of_base_and_platform_is_named(sound: pk.Measurements) -> None:
    with pytest.raises(pk.ArgumentError, match="with the camera on the other of base"):
        checks(with_lens(sound, on="platform"))  # type: ignore[arg-type]
