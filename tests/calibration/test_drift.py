"""Repeats that move with time are found, repeats that scatter are not called drift."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arrays import FloatArray
from pkmcal.calibration.identification import Identification
from pkmcal.statistics.drift_test import trend

from ..simulated import hexapod_poses

POSES, HOMES, TARGETS = 40, 10, 3
REPEATABILITY, NOISE = 0.007, 0.01


def a_day(
    robot: pk.Robot, seed: int, growth: float, temperature: FloatArray | None = None
) -> pk.Measurements:
    """Poses with home again and again between them, three targets at each, of a machine that
    repeats to 7 µm and grows along z.
    """
    rng = np.random.default_rng(seed)
    true = robot.replace({f"offset{i}": rng.normal(0, 0.3) for i in range(1, 7)})
    poses = hexapod_poses(robot, POSES, rng)
    poses[np.linspace(0, POSES - 1, HOMES).astype(int)] = robot.home
    q = robot.inverse(poses)
    visit = true.forward(q).pose[:, :3] + rng.normal(0, REPEATABILITY, (POSES, 3))
    visit[:, 2] += np.linspace(0, growth, POSES)
    points = np.repeat(visit, TARGETS, axis=0)
    return pk.Measurements(
        np.repeat(q, TARGETS, axis=0),
        points + rng.normal(0, NOISE, points.shape),
        target=np.zeros((TARGETS, 3)),
        target_index=np.tile(np.arange(TARGETS), POSES),
        time=np.repeat(np.linspace(0, 2700, POSES), TARGETS),
        temperature=temperature,
    )


def of(robot: pk.Robot, measured: pk.Measurements, **words: object) -> Identification:
    return pk.identify(robot, measured, "offset*", **words)  # type: ignore[arg-type]


def test_a_machine_that_grows_while_it_is_measured_is_said_to(hexapod: pk.Robot) -> None:
    found = of(hexapod, a_day(hexapod, 1, 0.1))
    drift = found.drift
    assert drift is not None and drift.found and drift.large
    assert drift.shift[2] == pytest.approx(0.1, abs=0.03) and drift.hours == pytest.approx(0.75)
    assert (drift.poses, drift.visits) == (1, HOMES)
    assert found.verdict.state == "doubtful"
    assert "a pose measured 10 times drifts by 0.0" in found.verdict.reasons[0]
    assert "most of it z" in str(drift) and "warm up" in str(drift)


def test_its_hours_are_those_of_the_pose_that_was_watched_longest(hexapod: pk.Robot) -> None:
    day = a_day(hexapod, 1, 0.1)
    soon = np.arange(len(day)) // TARGETS == 12  # two visits, two minutes apart
    q, values = day.actuators.copy(), day.values.copy()
    before = np.arange(len(day)) // TARGETS == 10
    q[soon], values[soon] = q[before], values[before] + 0.005
    drift = of(hexapod, dataclasses.replace(day, actuators=q, values=values)).drift
    assert drift is not None and (drift.poses, drift.visits) == (2, HOMES + 2)
    assert drift.hours == pytest.approx(0.75)


def test_a_drift_below_the_scatter_is_a_remark(hexapod: pk.Robot) -> None:
    calls = [of(hexapod, a_day(hexapod, seed, 0.018)) for seed in range(12)]
    small = [c for c in calls if c.drift is not None and c.drift.found and not c.drift.large]
    for found in small:
        assert any("drifts by" in text for text in found.verdict.remarks)
        assert not any("drifts by" in text for text in found.verdict.reasons)


def test_a_machine_that_does_not_move_is_not_said_to(hexapod: pk.Robot) -> None:
    """Three targets of one visit share its error: they are one witness, not three."""
    chances = np.array([drift_chance(hexapod, seed, 0.0) for seed in range(30)])
    assert (chances < 0.01).sum() <= 2 and (chances < 0.2).mean() < 0.45


@pytest.mark.filterwarnings("ignore:residuals are .* free more parameters")
def test_two_targets_given_by_their_places_are_no_repeats_of_one(hexapod: pk.Robot) -> None:
    """Both were read at each pose, always in the same order, and no pose was visited again."""
    rng = np.random.default_rng(2)
    q = np.repeat(hexapod.inverse(hexapod_poses(hexapod, 40, rng)), 2, axis=0)
    places = np.tile([[80.0, 0.0, 30.0], [-60.0, 50.0, 30.0]], (40, 1))
    true = hexapod.replace({"base1.x": hexapod.geometry["base1.x"] + 2.0})  # is not sought
    found = of(hexapod, pk.VirtualMachine(true, noise=0.01, seed=3).measure(q, target=places))
    assert found.drift is None and np.isnan(found.repeatability)


def test_a_drift_of_five_deviations_is_found_in_most_cases(hexapod: pk.Robot) -> None:
    chances = np.array([drift_chance(hexapod, seed, 0.05) for seed in range(15)])
    assert (chances < 0.01).sum() >= 10


def drift_chance(robot: pk.Robot, seed: int, growth: float) -> float:
    drift = of(robot, a_day(robot, seed, growth)).drift
    assert drift is not None
    return drift.chance


def test_the_test_has_the_chance_it_states() -> None:
    """False alarms of 4000 sets of repeats: 1 % at 1 %, however correlated the components are."""
    rng = np.random.default_rng(0)
    pose = np.repeat(np.arange(4), 4)
    mixed = np.array([[1.0, 0.9, 0.0], [0.0, 0.5, 0.2], [0.0, 0.0, 3.0]])
    chances = []
    for _ in range(4000):
        found = trend(rng.normal(size=(16, 3)) @ mixed, pose, rng.permutation(16) * 1.0)
        assert found is not None
        chances.append(found.chance)
    assert 0.005 < np.mean(np.array(chances) < 0.01) < 0.015


def test_home_that_was_held_out_drifts_as_well(hexapod: pk.Robot) -> None:
    measured = a_day(hexapod, 1, 0.1)
    home = (np.abs(measured.actuators - hexapod.inverse(hexapod.home)) < 1e-9).all(axis=1)
    found = of(hexapod, measured.select(~home), holdout=measured.select(home))
    assert found.drift is not None and found.drift.found


def test_repeats_without_coming_back_are_one_visit(hexapod: pk.Robot) -> None:
    """Five readings in place share the error of the place: 2 visits, whatever their number."""
    rng = np.random.default_rng(4)
    poses = hexapod_poses(hexapod, 12, rng)
    order = np.repeat([*range(12), *range(12)], 5)
    q = hexapod.inverse(poses)[order]
    place = np.repeat(rng.normal(0, 0.02, (24, 3)), 5, axis=0)
    values = hexapod.forward(q).pose[:, :3] + place + rng.normal(0, 0.001, (120, 3))
    drift = of(hexapod, pk.Measurements(q, values)).drift
    assert drift is not None and drift.visits == 24 and drift.chance > 0.01


def test_without_repeats_nothing_is_said(hexapod: pk.Robot) -> None:
    measured = a_day(hexapod, 1, 0.1)
    alone = np.unique(measured.actuators, axis=0, return_index=True)[1]
    assert of(hexapod, measured.select(np.sort(alone))).drift is None


def test_growth_that_the_temperature_explains_is_no_drift(hexapod: pk.Robot) -> None:
    """A frame of 850 mm grows by 0.1 mm within 10 K at 11.5 µm/m/K."""
    at = 20.0 + np.linspace(0, 10, POSES)
    cold = a_day(hexapod, 1, 0.0)
    z = hexapod.forward(cold.actuators).pose[:, :3]
    values = cold.values + z * 11.5e-6 * (np.repeat(at, TARGETS) - 20.0)[:, None]
    warm = pk.Measurements(
        cold.actuators, values, target=np.zeros((TARGETS, 3)), target_index=cold.target_index,
        temperature=np.repeat(at, TARGETS),
    )  # fmt: skip
    plain = of(hexapod, warm).drift
    assert plain is not None and plain.found and "from 20 to 30 °C" in str(plain)
    allowed = of(hexapod, warm, effects=[pk.Expansion(11.5e-6)]).drift
    assert allowed is not None and not allowed.found
