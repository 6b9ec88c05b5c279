"""What the machine as drawn does not show is held, and may be far off: a board on a platform."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np

import pkmcal as pk
from pkmcal.diagnostics.held_combinations import CHECKS, held_combinations
from pkmcal.readings import Board, Camera

BOARD, COUNT = Board.chessboard(10, 5, 6), 30
ERRORS = {"mm": 0.3, "rad": 1e-3, "1": 1e-4}


def fitted(drawn: pk.Robot, seed: int, nominal: bool) -> pk.Identification:
    """Pictures of a board, 20 mm beside the middle of the platform, of a machine with errors."""
    random, geometry = np.random.default_rng(seed), drawn.geometry
    units = dict(zip(geometry.names, geometry.units, strict=True))
    names = geometry.match(["base*", "platform*", "offset*", "rod*", "slider*"])
    true = drawn.replace({n: geometry[n] + random.normal(0.0, ERRORS[units[n]]) for n in names})
    camera = Camera(
        fx=3478.0, fy=3478.0, cx=1223.5, cy=1023.5, stands=[0, 0, 560, np.pi, 0.3, 0.5],
        carried=[-25, 10, 20, np.pi + 0.03, -0.02, 0.3],
    )  # fmt: skip
    at, seeing = camera.seeing(
        drawn.inverse(pk.sample_poses(drawn, COUNT, seed=seed, share=0.9)), BOARD
    )
    measured = pk.VirtualMachine(true, 0.1, seed).measure(at, seeing)
    measured = replace(measured, group=np.repeat(np.arange(COUNT), len(BOARD.ids)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pk.CalibrationWarning)
        return pk.identify(drawn if nominal else true, measured, names, fix="datum")


def test_a_board_beside_the_middle_of_a_platform_that_does_not_turn_is_said_to_be_held_wrong() -> (
    None
):
    """As drawn this platform never turns; with errors it does by 0.1 deg, and moves the board."""
    for seed in range(2):
        found = fitted(pk.load("linear-delta-6"), seed, nominal=True)
        seen = held_combinations(found)
        assert seen is not None and seen.chance < 0.01
        assert any(name.startswith("tool.board.") for name in seen.names)
        text = CHECKS[0].say(found, seen)
        assert f"{seen.count} combinations, of " in text and "nan" not in text


def test_what_a_machine_shows_from_the_beginning_is_not_held() -> None:
    assert held_combinations(fitted(pk.load("linear-delta-6"), 0, nominal=False)) is None
    assert held_combinations(fitted(pk.load("linear-delta"), 0, nominal=True)) is None
