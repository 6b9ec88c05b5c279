"""Distances between two places of a machine with backlash: each place has its own approach."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk

from ..robots import hexapod, linear_delta

PLAY = 0.1  # mm
PLAYING = {"drive": {"backlash": 0.0}}


def loose(robot: pk.Robot) -> pk.Robot:
    return robot.replace({f"drive{i}.backlash": PLAY for i in range(1, robot.n_actuators + 1)})


def driven(true: pk.Robot, way: np.ndarray) -> np.ndarray:
    """Where the true machine is after each move, found move by move."""
    came, places = np.zeros(way.shape[1]), []
    for k, q in enumerate(way):
        if k:
            came = np.where(q > way[k - 1], 1.0, np.where(q < way[k - 1], -1.0, came))
        places.append(true.approaching(came).forward(q).pose[:3])
    return np.array(places)


def pairs(robot: pk.Robot, count: int = 60) -> tuple[np.ndarray, np.ndarray]:
    first, second = (pk.sample_poses(robot, count, seed=seed, share=0.4) for seed in (1, 2))
    return robot.inverse(first), robot.inverse(second)


@pytest.mark.parametrize(
    "robot", [hexapod(*[PLAYING] * 6), linear_delta(*[PLAYING] * 3)], ids=["6-UPS", "delta"]
)
def test_play_is_found_from_distances_between_places_driven_in_order(robot: pk.Robot) -> None:
    true = loose(robot)
    q, other = pairs(robot)
    way = np.stack([q, other], axis=1).reshape(-1, robot.n_actuators)
    places = driven(true, way)
    noise = np.random.default_rng(0).normal(0.0, 0.003, len(q))
    length = np.linalg.norm(places[::2] - places[1::2], axis=1) + noise
    data = pk.Measurements(q, length, pk.readings.Between(other), sigma=0.003, approach="order")
    found = pk.identify(robot, data, ["offset*", "drive*.backlash"])
    play = [k for k, name in enumerate(found.free) if name.endswith("backlash")]
    np.testing.assert_allclose(found.values[play], PLAY, atol=0.02)
    assert found.verdict.state == "calibrated"
    inside = (found.interval95[play, 0] < PLAY) & (found.interval95[play, 1] > PLAY)
    assert inside.mean() > 0.6


def test_the_second_place_is_come_to_from_the_first_unless_stated() -> None:
    robot = hexapod(*[PLAYING] * 6)
    q, other = pairs(robot, 5)
    other[2, 0] = q[2, 0]  # stands still
    between = pk.Measurements(q, np.ones(5), pk.readings.Between(other), approach="order")
    assert between.approach is not None and between.other_drive_state.approach is not None
    expected = np.sign(other - q)
    expected[2, 0] = between.approach[2, 0]
    np.testing.assert_array_equal(between.other_drive_state.approach, expected)
    np.testing.assert_array_equal(between.approach[1:], np.sign(q[1:] - other[:-1]))
    stated = pk.Measurements(q, np.ones(5), pk.readings.Between(other, approach=-1))
    assert stated.approach is None
    assert (stated.other_drive_state.approach == -1).all()
    with pytest.raises(ValueError, match="approach must be 1, -1 or 0"):
        pk.Measurements(q, np.ones(5), pk.readings.Between(other, approach=0.5))


def test_a_simulated_machine_comes_to_both_places() -> None:
    robot = hexapod(*[PLAYING] * 6)
    true = loose(robot)
    q, other = pairs(robot, 8)
    read = pk.VirtualMachine(true, noise=0).measure(q, pk.readings.Between(other), approach="order")
    places = driven(true, np.stack([q, other], axis=1).reshape(-1, 6))
    lengths = np.linalg.norm(places[2::2] - places[3::2], axis=1)
    np.testing.assert_allclose(read.values[1:], lengths, atol=1e-9)


@pytest.mark.parametrize("one_column", [False, True])
def test_both_approaches_are_written_and_read(tmp_path: Path, one_column: bool) -> None:
    robot = hexapod(*[PLAYING] * 6)
    q, other = pairs(robot, 4)
    signs = np.ones((4, 6)) if one_column else np.sign(np.random.default_rng(0).normal(size=(4, 6)))
    data = pk.Measurements(
        q, np.ones(4), pk.readings.Between(other, approach=signs), approach=-signs
    )
    path = tmp_path / "between.csv"
    data.write(path)
    if one_column:
        text = path.read_text().splitlines()
        head = next(line for line in text if "to.approach.q1" in line)
        names = head.split(",")
        kept = [i for i, name in enumerate(names) if not name.startswith("to.approach.q")]
        rows = [[line.split(",")[i] for i in kept] for line in text[text.index(head) :]]
        rows[0].append("to.approach")
        table = [rows[0], *([*row, "1"] for row in rows[1:])]
        path.write_text("\n".join(",".join(row) for row in table))
    again = pk.read_measurements(path, robot)
    assert again.approach is not None and again.other_drive_state.approach is not None
    np.testing.assert_array_equal(again.approach, -signs)
    np.testing.assert_array_equal(again.other_drive_state.approach, signs)
