"""A picture that contradicts its actuators so much that no pose agrees with both."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.fitted.dropped import are_few, leaves_none

from ..diagnostics.test_pictures import BOARD, LENS, checks, pictures

CORNERS = len(BOARD.ids)
ODD = 7
MOUNTED: Any = {"stands": [-150, 120, 1950, 3.0, 0.1, 0.2], "carried": [-90, 70, 20, np.pi, 0, 0.3]}


def mirrored(count: int, odd: list[int]) -> pk.Measurements:
    """Some of the pictures have left and right exchanged."""
    sound = pictures(count)
    values, some = np.array(sound.values), np.isin(sound.group, odd)
    values[some, 0] = 1280 - 1 - values[some, 0]
    return replace(sound, values=values)


@pytest.mark.parametrize(("count", "odd"), [(20, [ODD]), (16, [3, ODD])])
def test_pictures_that_contradict_all_others_are_named_with_what_leaves_them_out(
    count: int, odd: list[int]
) -> None:
    with pytest.raises(pk.ArgumentError) as error:
        checks(mirrored(count, odd))
    text, names = str(error.value), [f"pose {each} ({CORNERS} rows)" for each in odd]
    assert f"{len(odd) * CORNERS} of {count * CORNERS} rows contradict all others" in text
    assert f"; {', '.join(names)}: what was read there contradicts the actuators" in text
    assert "--drop-outliers (drop='outliers')" in text


@pytest.mark.parametrize(("count", "odd"), [(20, [ODD]), (16, [3, ODD])])
def test_pictures_that_contradict_all_others_are_outliers(count: int, odd: list[int]) -> None:
    measured = mirrored(count, odd)
    found, _ = checks(measured, drop="outliers")
    assert {*measured.group[list(found.dropped)].tolist()} == {*odd}
    assert len(found.dropped) == len(odd) * CORNERS and found.verdict.state == "calibrated"


class Measured(NamedTuple):
    session: np.ndarray | None


@dataclass
class Set:
    rows: list[int]
    sessions: list[str] | None = None

    @property
    def measured(self) -> Measured:
        return Measured(None if self.sessions is None else np.array(self.sessions))


def test_rows_that_are_many_or_all_of_a_set_are_no_outliers() -> None:
    """That is rather a mistake of all: nobody gets a machine from the rest unasked."""
    sets: Any = [Set([0, 1, 2, 3]), Set([4, 5, 6, 7, 8, 9])]
    assert are_few(sets, [1, 4])
    assert not are_few(sets, [1, 4, 5]) and not are_few(sets, [0, 1, 2, 3])
    assert not are_few([Set([0]), Set(list(range(1, 20)))], [0])  # type: ignore[list-item]


def test_a_board_that_is_fastened_anew_in_few_pictures_is_one_of_its_session() -> None:
    """Its pictures are judged by themselves: by those of the others it is 60 mm off."""
    sound = pictures(24)
    session = np.where(sound.group >= 20, "b", "a")
    corner = np.array(sound.instrument.corner)
    corner[session == "b"] += [25.0, -15.0, 0.0]  # where it is fastened now
    robot = pk.load("hexapod")
    seen = pk.VirtualMachine(robot, 0.1, 1).measure(
        sound.actuators, replace(sound.instrument, corner=corner, **MOUNTED)
    )
    measured = replace(seen, instrument=sound.instrument, group=sound.group, session=session)
    found, _ = checks(measured, per_session="tool*")
    assert found.verdict.state == "calibrated"
    tools = dict(zip(found.free, found.values, strict=True))
    moved = [tools[f"tool.board.{axis}@b"] - tools[f"tool.board.{axis}@a"] for axis in "xyz"]
    assert np.linalg.norm(moved) == pytest.approx(np.hypot(25.0, 15.0), abs=2.0)


def test_a_picture_at_the_edge_of_a_lens_that_is_found_contradicts_no_other() -> None:
    """All others are in the middle of the picture, where they tell little of its edge."""
    robot, random = pk.load("hexapod"), np.random.default_rng(0)
    names = robot.geometry.match(["base*", "platform*", "offset*"])
    true = robot.replace({n: robot.geometry[n] + random.normal(0.0, 0.3) for n in names})
    camera = pk.readings.Camera(**{**LENS, "k1": -0.3, "k2": 0.12}, **MOUNTED)
    near = np.array(pk.sample_poses(robot, 9, seed=1, share=0.08))
    near[-1, :2] = [-330.0, 150.0]
    at, seeing = camera.seeing(robot.inverse(near), BOARD)
    seen = pk.VirtualMachine(true, 0.1, 2).measure(at, seeing)
    start = replace(seen.instrument, k1=0.0, k2=0.0, lens="all")
    measured = replace(seen, instrument=start, group=np.repeat(np.arange(9), CORNERS))
    found, _ = checks(measured, drop="outliers")
    assert not found.dropped


def test_a_small_session_with_numbers_of_the_machine_is_judged_by_its_own() -> None:
    """Of what an actuator was set to then the others say nothing."""
    robot, sound = pk.load("hexapod"), pictures(20)
    session = np.where(sound.group >= 17, "b", "a")
    before, later = robot, robot.replace({"offset1": robot.geometry["offset1"] + 30.0})
    camera = replace(sound.instrument, **MOUNTED)
    seen = [
        pk.VirtualMachine(true, 0.1, 3).measure(sound.actuators, camera).values
        for true in (before, later)
    ]
    values = np.where((session == "b")[:, None], seen[1], seen[0])
    measured = replace(sound, values=values, session=session)
    found, _ = checks(measured, per_session=["offset1"])
    offsets = dict(zip(found.free, found.values, strict=True))
    assert offsets["offset1@b"] - offsets["offset1@a"] == pytest.approx(30.0, abs=1.0)


def test_rows_of_a_session_that_is_far_off_as_a_whole_leave_nothing_of_it() -> None:
    sets: Any = [Set([0, 1, 2, 3], ["a", "a", "b", "b"]), Set([4, 5, 6, 7], None)]
    assert leaves_none(sets, [2, 3]) and leaves_none(sets, [0, 1, 2])
    assert not leaves_none(sets, [0, 2]) and not leaves_none(sets, [4, 5])
