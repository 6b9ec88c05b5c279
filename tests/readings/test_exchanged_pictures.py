"""Pictures whose names, or columns of actuators, are exchanged are refused before a search."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.readings import Board, Camera

BOARD, COUNT = Board.chessboard(5, 4, 30), 16


def taken(machine: str, above: float, share: float, cy: float = 400.0) -> pk.Measurements:
    robot = pk.load(machine)
    names = robot.geometry.match(["base*", "offset*"])
    random = np.random.default_rng(3)
    true = robot.replace({n: robot.geometry[n] + random.normal(0.0, 0.3) for n in names})
    camera = Camera(
        fx=1500.0, fy=1500.0, cx=640.0, cy=cy,
        stands=[0, 0, robot.home[2] + above, np.pi, 0.1, 0.2],
        carried=[-60, -45, 20, np.pi, 0, 0.3],
    )  # fmt: skip
    q = robot.inverse(pk.sample_poses(robot, COUNT, seed=2, share=share))
    at, seeing = camera.seeing(q, BOARD)
    seen = pk.VirtualMachine(true, 0.05, 1).measure(at, seeing)
    corners = len(BOARD.ids)
    return replace(seen, group=np.repeat(np.arange(COUNT), corners))


def placed(measured: pk.Measurements, machine: str = "hexapod") -> None:
    pose = pk.load(machine).forward(measured.actuators).pose
    measured.instrument.places_seen(measured, pose)


@pytest.mark.parametrize("order", [{4: 9, 9: 4}, {2: 5, 5: 11, 11: 2}])
def test_pictures_in_each_others_place_are_named(order: dict[int, int]) -> None:
    measured = taken("hexapod", 1000.0, 0.3)
    placed(measured)
    values = measured.values.reshape(COUNT, len(BOARD.ids), 2).copy()
    values[list(order)] = values[list(order.values())]
    with pytest.raises(pk.ArgumentError, match="pictures are exchanged") as refused:
        placed(replace(measured, values=values.reshape(-1, 2)))
    assert all(f"{shown} shows {true}" in str(refused.value) for shown, true in order.items())


def test_turned_pictures_among_sound_ones_are_not_said_to_be_exchanged() -> None:
    """Two that are upside down are nearer to each other's place than to their own."""
    measured = taken("hexapod", 1000.0, 0.3)
    values = measured.values.copy()
    turned = np.isin(measured.group, [3, 8])
    values[turned] = np.array([1280.0, 800.0]) - values[turned]
    places = measured.instrument.places_seen(
        replace(measured, values=values), pk.load("hexapod").forward(measured.actuators).pose
    )
    shown = np.isfinite(places).all(axis=1)
    assert {*measured.group[shown].tolist()} == {*range(COUNT)} - {3, 8}


def test_a_motion_that_is_mirrored_is_refused_of_a_machine_that_does_not_turn() -> None:
    """As of a delta two of whose columns are exchanged: its places alone tell."""
    measured = taken("linear-delta", 480.0, 0.9)
    placed(measured, "linear-delta")
    exchanged = replace(measured, actuators=measured.actuators[:, [0, 2, 1]])
    with pytest.raises(pk.ArgumentError, match="are mirrored, or actuators are exchanged"):
        placed(exchanged, "linear-delta")


@pytest.mark.parametrize("count", [5, 8, 11])
def test_pictures_that_are_numbered_from_the_other_end_are_named(count: int) -> None:
    """As of a chessboard that looks alike when it is turned; the fewer of two kinds are named."""
    measured, corners = taken("hexapod", 1000.0, 0.3), len(BOARD.ids)
    random = np.random.default_rng(count)
    turned = np.sort(random.permutation(COUNT)[:count])
    values = measured.values.reshape(COUNT, corners, 2).copy()
    values[turned] = values[turned, ::-1]
    with pytest.raises(pk.ArgumentError, match="from the other end") as refused:
        placed(replace(measured, values=values.reshape(-1, 2)))
    fewer = turned if count <= COUNT / 2 else np.setdiff1d(np.arange(COUNT), turned)
    assert f"{len(fewer)} of {COUNT} pictures" in str(refused.value)
    assert count == COUNT / 2 or f": {', '.join(map(str, fewer))};" in str(refused.value)


def test_mirrored_pictures_of_a_board_that_is_its_own_mirror_image_are_named() -> None:
    """Their corners are numbered as if they were seen from the front."""
    measured = taken("hexapod", 1000.0, 0.3, cy=640.0)
    columns, rows = BOARD.shape
    values = measured.values.reshape(COUNT, rows, columns, 2)[:, :, ::-1] * [-1, 1] + [1280, 0]
    mirrored = replace(measured, values=values.reshape(-1, 2))
    with pytest.raises(pk.ArgumentError, match="the pictures are mirrored") as refused:
        pk.identify(pk.load("hexapod"), mirrored, ["base*"], unknown=["frame", "target"])
    assert " if " not in str(
        refused.value
    )  # nor u and v said to be exchanged: the board turns over
