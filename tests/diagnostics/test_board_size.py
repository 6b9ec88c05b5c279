"""Boards that are larger than stated: what that does to a machine, and ± that contain it."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.diagnostics.scale import CHECKS, Scale
from pkmcal.fitted.machine_accuracy import machine_rates
from pkmcal.readings import Camera

from .test_pictures import PLAIN, fitted, pictures, with_lens


@pytest.fixture(scope="module")
def sound() -> pk.Measurements:
    return pictures()


def printed(measured: pk.Measurements, larger: float, **fields: Any) -> pk.Measurements:
    """The same pictures, of a board that is larger than what is stated."""
    corner = np.asarray(measured.instrument.corner) / (1.0 + larger)
    return with_lens(measured, corner=corner, **fields)  # type: ignore[arg-type]


def moved(one: pk.Identification, other: pk.Identification) -> float:
    """By how much two machines differ, mm rms, after the best motions of base and platform."""
    at = one.fit.end.pose
    own = one.fit.parameters.geometry_of()
    change = (np.asarray(other.values) - np.asarray(one.values))[: len(own)]
    off = machine_rates(one.fit, at, at) @ change
    return float(np.sqrt((off**2).sum(axis=1).mean()))


@pytest.fixture(scope="module")
def exact(sound: pk.Measurements) -> pk.Identification:
    """With the size as it is, held."""
    return fitted(sound)


def said(found: pk.Identification) -> Scale:
    (finding,) = (each.finding for each in found.verdict.said if each.check == "scale")
    return finding  # type: ignore[no-any-return]


def test_the_share_that_is_said_moves_the_machine_by_as_much_as_is_stated(
    sound: pk.Measurements, exact: pk.Identification
) -> None:
    finding = said(exact)
    assert not finding.alone and finding.known == 0.0
    again = fitted(printed(sound, finding.harmful))
    stated = float(np.sqrt(np.mean(exact._by_itself() ** 2)))
    assert moved(exact, again) == pytest.approx(stated, rel=0.1)


@pytest.mark.parametrize("larger", [1e-3, -1e-3])
def test_a_size_with_its_deviation_is_found_within_it_and_the_machine_stays(
    sound: pk.Measurements, exact: pk.Identification, larger: float
) -> None:
    """A board 0.1 % off moves a machine that takes it for exact by many times its ±."""
    along = fitted(printed(sound, larger, size_sigma=1e-3))
    (size,) = (each for each in along.nuisances if each.name == "board.size")
    assert size.stated == pytest.approx(1e-3)
    assert abs(size.value - larger) < 2.0 * size.stderr < 2e-3
    assert "scale" not in {each.check for each in along.verdict.said}
    stated = float(np.sqrt(np.mean(along._by_itself() ** 2)))
    assert moved(exact, along) < stated
    held = fitted(printed(sound, larger))
    assert moved(exact, held) > 2.0 * float(np.sqrt(np.mean(held._by_itself() ** 2)))


def test_a_deviation_of_the_size_widens_what_rests_on_it(
    sound: pk.Measurements, exact: pk.Identification
) -> None:
    """From nothing of it, that of a held size, up to all of it, that of one that is found."""
    others = {"size_sigma": 1e-8}, {"size_sigma": 0.1}, {"find_size": True}
    held, hardly, much, free = (
        float(np.sqrt(np.mean(each._by_itself() ** 2)))
        for each in (exact, *(fitted(with_lens(sound, **fields)) for fields in others))
    )
    assert hardly == pytest.approx(held, rel=0.01)
    assert much == pytest.approx(free, rel=0.02) and free > 1.1 * held


def rotary() -> pk.Measurements:
    """Pictures of a machine of which the board alone tells the size."""
    robot = pk.load("6-rus")
    camera = Camera(
        **PLAIN, stands=[0, 0, float(robot.home[2]) + 900, np.pi, 0, 0],
        carried=[0, 0, 0, np.pi, 0, 0],
    )  # fmt: skip
    poses = pk.sample_poses(robot, 20, seed=0, share=0.2)
    at, seeing = camera.seeing(robot.inverse(poses), pk.readings.Board.chessboard(4, 3, 30))
    return replace(pk.VirtualMachine(robot, 0.05).measure(at, seeing), actuator_sigma=0.0)


@pytest.mark.parametrize(
    ("fields", "prior", "level", "words"),
    [
        ({"size_sigma": 5e-4}, None, "remark", "whose size is stated to 0.05 %"),
        ({"find_size": True}, {"board.size": 1e-3}, "remark", "whose size is stated to 0.1 %"),
        ({"find_size": True}, None, "doubt", "nothing that was measured has a length"),
    ],
)
def test_a_board_whose_size_is_known_to_a_share_is_a_length(
    fields: dict[str, Any], prior: Any, level: str, words: str
) -> None:
    robot, measured = pk.load("6-rus"), rotary()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pk.CalibrationWarning)
        found = pk.identify(robot, with_lens(measured, **fields), ["base*"], prior=prior)
    (own,) = (each for each in found.verdict.said if each.check == "scale")
    assert own.level == level and words in own.text


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"size_sigma": 0.5}, "a share of the size of the board.*found 0.5"),
        ({"size_sigma": -1e-3}, "size_sigma"),
        ({"size_sigma": float("nan")}, "size_sigma"),
        ({"size_sigma": 1e-3, "find_size": True}, "find_size=True finds the board's size"),
    ],
)
def test_deviations_of_a_size_that_make_no_sense_are_refused(
    sound: pk.Measurements, fields: dict[str, Any], words: str
) -> None:
    with pytest.raises(pk.ArgumentError, match=words):
        with_lens(sound, **fields)


@pytest.mark.parametrize(
    ("fields", "stated", "words"),
    [
        ({}, {"prior": {"board.size": 1e-3}}, "prior: board.size: size_sigma .--size-sigma. is"),
        ({"size_sigma": 1e-3}, {"prior": {"board.size": 1e-3}}, "state one of both"),
        ({"size_sigma": 1e-3}, {"uncertainty": {"board.size": 1e-3}}, "uncertainty: board.size: s"),
        ({"find_size": True}, {"uncertainty": {"board.size": 1e-3}}, "state one of both"),
        ({}, {"uncertainty": {"scale": 1e-3}}, "the board is the length that a camera sees"),
        ({}, {"prior": {"lens.fx": 1.0}}, "lens_sigma, or deviations in the lens file, is"),
    ],
)
def test_a_prior_of_a_size_or_a_lens_says_what_states_it(
    sound: pk.Measurements, fields: dict[str, Any], stated: dict[str, Any], words: str
) -> None:
    """It had been called a name that is not known."""
    with pytest.raises(pk.ArgumentError, match=words):
        fitted(with_lens(sound, **fields), **stated)


@pytest.mark.parametrize(
    ("alone", "known", "harmful", "words"),
    [
        (True, 0.0, np.inf, "how large the machine is rests on the board alone"),
        (True, 5e-4, np.inf, "rests on the board alone, whose size is stated to 0.05 %"),
        (False, 5e-4, 1e-4, "a board that is some 0.01 % larger or smaller than stated puts"),
        (True, 0.0, 2e-4, "alone: one that is some 0.02 % larger or smaller than stated puts"),
    ],
)
def test_what_is_said_of_a_size_is_what_is_known(
    exact: pk.Identification, alone: bool, known: float, harmful: float, words: str
) -> None:
    """Of two boards one may be stated and one held; of a machine that is not determined no ± is."""
    (check,) = CHECKS
    text = check.say(exact, Scale("board", alone, known, harmful, 0.0, 0.0))
    assert words in text and "inf" not in text
