"""A camera or a board that was moved between two pictures is named, with the picture from which."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import f as f_distribution

import pkmcal as pk
from pkmcal.diagnostics.moved_instrument import moved_instrument
from pkmcal.statistics.linear_fit import linear_fit
from pkmcal.statistics.score_test import jump

from .test_pictures import LENS, checks, pictures


@pytest.fixture(scope="module")
def sound() -> pk.Measurements:
    return pictures()


def turned(measured: pk.Measurements, since: int, px: float) -> pk.Measurements:
    """As by a camera that turned a little between two pictures."""
    values = measured.values.copy()
    assert measured.group is not None
    x = (values[:, 0] - LENS["cx"]) / LENS["fx"]
    values[measured.group >= since, 0] += px * (1.0 + x[measured.group >= since] ** 2)
    return replace(measured, values=values)


def test_nothing_is_said_to_have_moved_where_nothing_did(sound: pk.Measurements) -> None:
    found, said = checks(sound)
    seen = moved_instrument(found)
    assert seen is not None and seen.chance > 0.01
    assert "moved-instrument" not in said


@pytest.mark.parametrize(("since", "px"), [(4, 2.0), (18, -4.0)])
def test_a_camera_that_was_moved_is_named_and_found_in_each_part(
    sound: pk.Measurements, since: int, px: float
) -> None:
    off = turned(sound, since, px)
    found, said = checks(off)
    seen = moved_instrument(found)
    assert seen is not None and seen.thing == "the camera" and seen.numbers == "frame*"
    assert seen.size == pytest.approx(abs(px), rel=0.25)
    assert found.verdict.state == "doubtful" and "moved-instrument" in said
    assert off.group is not None
    first = int(np.flatnonzero(off.group >= since)[0])
    assert f"from row {first}," in said["moved-instrument"]
    assert "two-machines" not in said
    part = np.where(off.group >= since, "after", "before")
    cured, said = checks(replace(off, session=part), per_session="frame*")
    assert "moved-instrument" not in said
    assert cured.actuator_noise < 0.3 * found.actuator_noise


def test_a_camera_of_several_is_named(sound: pk.Measurements) -> None:
    sets: Any = [
        replace(m, instrument=m.instrument.with_fields({"camera_name": name}))
        for m, name in ((sound, "left"), (turned(sound, 12, 3.0), "right"))
    ]
    found, said = checks(sets)
    seen = moved_instrument(found)
    assert seen is not None and (seen.thing, seen.numbers) == ("the camera right", "frame.right*")
    assert "moved-instrument" in said


def test_a_jump_is_that_of_fits_with_and_without_it() -> None:
    """F test of ordinary least squares, division by division."""
    random = np.random.default_rng(4)
    count, each = 20, 5
    visit = random.permutation(np.repeat(np.arange(count), each))
    design, columns = random.normal(size=(len(visit), 4)), random.normal(size=(len(visit), 2))
    y = random.normal(size=len(visit)) + (columns @ [1.5, -1.0]) * (visit >= 8)

    def left(*parts: Any) -> float:
        whole = np.hstack(parts)
        return float(((y - whole @ np.linalg.lstsq(whole, y, rcond=None)[0]) ** 2).sum())

    basis = np.linalg.qr(design)[0]
    fit = linear_fit(
        basis, y - basis @ (basis.T @ y), np.zeros((0, 4)), np.eye(4), visit, np.zeros_like(visit)
    )
    found = jump(fit, columns, visit, 3)
    assert found is not None
    chances = {}
    for at in range(3, count - 2):
        own = columns * (visit >= at)[:, None]
        before, after = left(design), left(design, own)
        rest = len(y) - 6
        chances[at] = f_distribution.sf((before - after) / 2 / (after / rest), 2, rest)
    at = min(chances, key=lambda each: chances[each])
    assert found.at == at == 8
    assert found.chance == pytest.approx(len(chances) * chances[at], rel=1e-6)
    own = np.hstack([design, columns * (visit >= at)[:, None]])
    assert found.size == pytest.approx(np.linalg.lstsq(own, y, rcond=None)[0][4:], rel=1e-9)


def test_errors_that_a_visit_shares_are_no_jump() -> None:
    """As of a tag whose corners are off together: many equations, few visits."""
    visit, said = np.repeat(np.arange(20), 30), 0
    for seed in range(20):
        random = np.random.default_rng(seed)
        columns = random.normal(size=(len(visit), 2))
        shared = 0.6 * random.normal(size=(20, 2))[visit]
        y = random.normal(size=len(visit)) + (columns * shared).sum(axis=1)
        basis = np.linalg.qr(columns)[0]
        left = y - basis @ (basis.T @ y)
        fit = linear_fit(basis, left, np.zeros((0, 2)), np.eye(2), visit, np.zeros_like(visit))
        found = jump(fit, columns, visit, 3)
        said += found is not None and found.chance < 0.001
    assert said <= 1
