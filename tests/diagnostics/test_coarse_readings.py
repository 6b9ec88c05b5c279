"""Readings in coarse steps, at a stop, or that are none: said, and counted by ±."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.statistics.steps import deviation

from ..robots import linear_delta
from ..simulated import hexapod_poses, with_errors
from ..sweeps import sweep


def said(found: pk.Identification) -> dict[str, str]:
    return {each.check: each.level for each in found.verdict.said}


def delta() -> pk.Robot:
    return linear_delta(calibration={"free": ["offset*"]})


def heights(robot: pk.Robot, count: int, rng: np.random.Generator) -> np.ndarray:
    """Actuators of places on a disc above the bed, as the nominal machine goes there."""
    turn, reach = rng.uniform(0, 2 * np.pi, count), 60 * np.sqrt(rng.random(count))
    poses = np.tile(robot.home, (count, 1))
    poses[:, 0], poses[:, 1] = reach * np.cos(turn), reach * np.sin(turn)
    poses[:, 2] = 0.3
    return robot.inverse(poses)


@sweep(
    "kind, written",
    product(["pose", "position", "height", "distance", "orientation"], [None, 4]),
    quick=[("pose", None), ("position", 4), ("height", None), ("orientation", 4)],
)
def test_commands_in_place_of_readings_are_no_calibration(kind: str, written: int | None) -> None:
    """Exact to the last digit, or as far as four decimals of the actuators allow."""
    robot = pk.load("hexapod")
    poses = hexapod_poses(robot, 30, np.random.default_rng(0))
    q = robot.inverse(poses)
    target = [900.0, 200.0, -100.0] if kind == "distance" else None
    data = pk.VirtualMachine(robot, noise=0, angle_noise=0).measure(q, kind, target)
    logged = pk.Measurements(
        q if written is None else np.round(q, written), data.values, kind, target=target
    )
    found = pk.identify(robot, logged, "offset*", holdout=0.25)
    assert found.verdict.state == "not calibrated"
    assert found.verdict.reasons[0].startswith("nothing was measured")


def test_a_column_of_zeros_is_no_measurement() -> None:
    robot = delta()
    q = heights(robot, 25, np.random.default_rng(0))
    shifted = robot.replace({f"offset{i}": 0.3 for i in (1, 2, 3)})  # so that z is 0
    found = pk.identify(shifted, pk.Measurements(np.round(q, 6), np.zeros(25), "height"))
    assert said(found)["nothing-measured"] == "grave"


@sweep("size", [0.02, 0.05, 0.1], quick=[0.02])
def test_a_machine_as_good_as_the_display_is_not_calibrated_by_it(size: float) -> None:
    """0.1 mm steps: whatever is drawn, numbers that are believed are as good as they say."""
    robot = delta()
    inside, known = 0, 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        q = heights(robot, 25, rng)
        true = with_errors(robot, size, rng)
        read = np.round(true.forward(q).pose[:, 2] + rng.normal(0, 0.002, 25), 1)
        found = pk.identify(robot, pk.Measurements(q, read, "height"))
        if found.verdict.state == "calibrated":
            truth = np.array([true.geometry[name] for name in found.free])
            inside += ((found.interval95[:, 0] < truth) & (truth < found.interval95[:, 1])).sum()
            known += len(truth)
        else:
            assert {"nothing-measured", "coarse-readings"} & said(found).keys()
    assert inside >= 0.85 * known


@pytest.mark.filterwarnings("ignore:residuals are:pkmcal.CalibrationWarning")
@pytest.mark.parametrize("stated", [None, 0.002])
def test_no_deviation_is_less_than_rounding_alone_gives(stated: float | None) -> None:
    """The classical covariance with s/√12 as noise, from the Jacobian by differences."""
    robot, step = delta(), 0.1
    rng = np.random.default_rng(3)
    q = heights(robot, 25, rng)
    true = with_errors(robot, 0.02, rng)
    read = np.round(true.forward(q).pose[:, 2] / step) * step
    read[0] += step  # one reading differs: there is a step to be seen
    found = pk.identify(robot, pk.Measurements(q, read, "height", sigma=stated))

    def predicted(change: np.ndarray) -> np.ndarray:
        numbers = dict(zip(found.free, found.values + change, strict=True))
        return robot.replace(numbers).forward(q).pose[:, 2]

    jacobian = np.stack([(predicted(h) - predicted(-h)) / 2e-3 for h in 1e-3 * np.eye(3)], axis=1)
    least = deviation(step) * np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    assert (found.stderr >= 0.999 * least).all()
    np.testing.assert_array_less(0.0, found.accuracy(robot.home))


@sweep(
    "name, cut",
    product(["five-bar", "rotary-delta", "hexapod"], [np.round, np.floor, np.trunc]),
    quick=[("five-bar", np.floor), ("rotary-delta", np.round)],
)
def test_intervals_hold_whether_readings_were_rounded_or_cut(name: str, cut: np.ufunc) -> None:
    """Positions shown in steps of ten times the noise: an offset of half a step in all rows."""
    sound, kind = cut is np.round, "pose" if name == "hexapod" else "position"
    robot, step, inside, known, named = pk.load(name), 0.05, 0, 0, 0
    for seed in range(5):
        rng = np.random.default_rng(seed)
        true = with_errors(robot, 0.4, rng)
        asked = pk.sample_poses(robot, 40, seed=seed)
        q = robot.inverse(asked)
        read = true.forward(q, guess=asked).pose
        read += rng.normal(size=read.shape) * [*[0.005] * 3, *[1e-5] * 3]
        read[:, :3] = cut(read[:, :3] / step) * step
        rows = np.isfinite(read).all(axis=1)
        values = read[rows] if kind == "pose" else read[rows, :3]
        found = pk.identify(robot, pk.Measurements(q[rows], values, kind))
        level = said(found).get("cut-readings")
        assert not (sound and level == "doubt")
        named += level is not None
        if found.verdict.state == "calibrated":
            low, high = found.interval95.T
            truth = np.array([true.geometry[n] for n in found.free])
            sure = np.isfinite(high)
            inside += ((low < truth) & (truth < high))[sure].sum()
            known += sure.sum()
    assert inside >= 0.87 * known
    if name == "five-bar":  # of which no number takes up an offset in two directions
        assert named == (0 if sound else 5)


@sweep("decimals", [2, 3, 6], quick=[2])
def test_fine_steps_change_nothing(decimals: int) -> None:
    robot = pk.load("hexapod")
    rng = np.random.default_rng(5)
    q = robot.inverse(hexapod_poses(robot, 40, rng))
    true = with_errors(robot, 0.3, rng)
    read = true.forward(q).pose[:, :3] + rng.normal(0, 0.02, (40, 3))
    coarse, fine = (
        pk.identify(robot, pk.Measurements(q, each, "position"), "offset*")
        for each in (np.round(read, decimals), read)
    )
    assert coarse.fit.uncertainty.covariance.widening == 1.0
    np.testing.assert_allclose(coarse.stderr, fine.stderr, rtol=0.1)
    assert "coarse-readings" not in said(coarse)


def test_rounding_to_a_micrometre_is_sound_where_there_is_no_other_noise() -> None:
    robot = pk.load("hexapod")
    inside = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        q = robot.inverse(hexapod_poses(robot, 40, rng))
        true = with_errors(robot, 0.3, rng)
        free = [f"base{i}.{c}" for i in range(1, 7) for c in "xyz"]
        true = robot.replace({name: true.geometry[name] for name in free})
        read = np.round(true.forward(q).pose[:, :3], 3)
        found = pk.identify(robot, pk.Measurements(q, read, "position"), free, holdout=0.25)
        assert found.verdict.state == "calibrated", found.verdict
        truth = np.array([true.geometry[name] for name in found.free])
        inside.append((found.interval95[:, 0] < truth) & (truth < found.interval95[:, 1]))
    assert np.mean(inside) > 0.9


@pytest.mark.parametrize("step", [None, 0.01])
def test_a_probe_at_its_stop_is_named_with_its_rows(step: float | None) -> None:
    robot = delta()
    rng = np.random.default_rng(1)
    q = heights(robot, 40, rng)
    true = robot.replace({"offset1": 0.9, "offset2": -0.7})
    read = true.forward(q).pose[:, 2] + rng.normal(0, 0.02, 40)
    cut = np.quantile(read, 0.8)
    cut = cut if step is None else np.round(cut / step) * step
    read = read if step is None else np.round(read / step) * step
    clipped = np.flatnonzero(read >= cut)
    found = pk.identify(robot, pk.Measurements(q, np.minimum(read, cut), "height"))
    assert found.verdict.state == "doubtful"
    (seen,) = (each for each in found.verdict.said if each.check == "at-stop")
    assert set(clipped) <= set(seen.finding.rows) and seen.finding.highest
    (remedy,) = seen.remedies
    again: dict[str, Any] = remedy.applied({})
    sound = pk.identify(robot, pk.Measurements(q, np.minimum(read, cut), "height"), **again)
    assert "at-stop" not in said(sound)
    np.testing.assert_allclose(sound.values, [0.9, -0.7, 0.0], atol=0.05)
