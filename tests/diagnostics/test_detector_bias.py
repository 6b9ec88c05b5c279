"""Corners of tags that a detector puts outward alike are told from a lens that is another one."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.readings import Board, Camera

BOARD = Board.apriltags(3, 2, 40, 15)
NOISE = 0.05  # px


@pytest.fixture(scope="module")
def sound() -> pk.Measurements:
    random, drawn = np.random.default_rng(1), pk.load("hexapod")
    names = drawn.geometry.match(["offset*"])
    true = drawn.replace({n: drawn.geometry[n] + random.normal(0.0, 0.3) for n in names})
    camera = Camera(
        fx=1500.0, fy=1500.0, cx=640.0, cy=400.0, k1=-0.1, stands=[-50, 40, 1900, np.pi, 0.1, 0.2],
        carried=[-70, -40, 20, np.pi, 0.03, 0.1],
    )  # fmt: skip
    at, seeing = camera.seeing(drawn.inverse(pk.sample_poses(drawn, 10, seed=1, share=0.25)), BOARD)
    return replace(pk.VirtualMachine(true, NOISE, 2).measure(at, seeing), actuator_sigma=0.0)


def causes(measured: pk.Measurements) -> list[str]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pk.CalibrationWarning)
        found = pk.identify(pk.load("hexapod"), measured, ["offset*"])
    return [each.finding.name for each in found.verdict.said if each.check == "causes"]


def test_corners_that_are_put_outward_are_named_so_and_no_lens(sound: pk.Measurements) -> None:
    assert causes(sound) == []
    tags = sound.values.reshape(-1, 4, 2)
    away = tags - tags.mean(axis=1, keepdims=True)
    out = away / np.linalg.norm(away, axis=2, keepdims=True)
    put = replace(sound, values=(tags + 0.15 * out).reshape(-1, 2))
    (first, *others) = causes(put)
    assert first.startswith("a detector that puts corners of tags") and not others


def test_another_lens_is_no_bias_of_tags(sound: pk.Measurements) -> None:
    other = replace(sound, instrument=replace(sound.instrument, fx=1530.0, fy=1530.0))
    (first, *_) = causes(other)
    assert "lens" in first


def test_the_way_outward_is_that_of_the_tag(sound: pk.Measurements) -> None:
    """From the middle of its tag, clockwise from top left; squares have none."""
    out = BOARD.outward_at(BOARD.ids)
    assert out is not None and np.allclose(np.linalg.norm(out, axis=1), 1.0)
    assert np.allclose(out.reshape(-1, 4, 3).sum(axis=1), 0.0)
    assert np.allclose(out[:2], np.array([[-1, -1, 0], [1, -1, 0]]) / np.sqrt(2.0))
    assert Board.chessboard(4, 3, 30).outward_at([0]) is None
