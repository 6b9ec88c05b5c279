"""Of starts that the nominal machine cannot tell apart the fits decide, or the verdict doubts."""

from __future__ import annotations

import warnings
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.starts import with_starts

from ..sweeps import sweep

NOISE = 5e-4  # rad, of an inclinometer
UPRIGHT, HANGING = (0.0, 0.0, 0.4), (np.pi, 0.0, 0.3)
AXES = {"pan-tilt": [[0.0, 0, 1], [0, 1, 0]], "wrist": [[0.0, 0, 1], [1, 0, 0]]}


def arm(name: str, length: float) -> pk.SerialArm:
    return pk.SerialArm(AXES[name], [[0, 0, 0], [0, 0, length]], [length, 0, length, 0, 0, 0])


def tilts(
    nominal: pk.SerialArm, mounting: tuple[float, ...], seed: int, off: float = 1e-3
) -> tuple[np.ndarray, pk.Measurements]:
    """Turnings of the joints, (2, 3), and what an inclinometer reads of that arm."""
    rng, errors = np.random.default_rng(seed), np.zeros((2, 6))
    errors[:, 3:] = off * rng.normal(size=(2, 3))
    machine = pk.VirtualMachine(nominal.replace(errors), seed=seed, angle_noise=NOISE)
    q = rng.uniform(-1.0, 1.0, (40, 2))
    return errors[:, 3:], machine.measure(q, pk.readings.Tilt(mounting=mounting))


def identified(nominal: pk.SerialArm, read: pk.Measurements, **more: object) -> pk.Identification:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pk.CalibrationWarning)
        return pk.identify(nominal, read, **more)  # type: ignore[arg-type]


def is_turned_over(found: pk.Identification, mounting: tuple[float, ...]) -> bool:
    off = found.parameters["mounting.alpha"]["value"] - mounting[0]
    return bool(np.cos(off) < 0.0)


def doubts(found: pk.Identification) -> bool:
    return any("explain the readings equally well" in text for text in found.warnings)


@sweep(
    "name, length, mounting",
    product(AXES, [0.0, 300.0], [UPRIGHT, HANGING]),
    quick=[("pan-tilt", 300.0, HANGING), ("wrist", 0.0, UPRIGHT)],
)
def test_no_sensor_is_taken_to_be_upside_down_without_a_doubt(
    name: str, length: float, mounting: tuple[float, ...]
) -> None:
    nominal = arm(name, length)
    for seed in range(4):
        found = identified(nominal, tilts(nominal, mounting, seed)[1])
        assert doubts(found) or not is_turned_over(found, mounting)
        assert found.verdict.state == ("doubtful" if doubts(found) else "calibrated")


@sweep(
    "name, mounting, stated",
    product(AXES, [UPRIGHT, HANGING], [True, False]),
    quick=[("pan-tilt", HANGING, True), ("wrist", UPRIGHT, False)],
)
def test_the_readings_tell_which_side_is_up_where_errors_exceed_the_noise(
    name: str, mounting: tuple[float, ...], stated: bool
) -> None:
    nominal = arm(name, 0.0)
    for seed in range(4):
        _, read = tilts(nominal, mounting, seed, off=0.01)
        found = identified(nominal, read if stated else replace(read, sigma=None))
        assert not is_turned_over(found, mounting) and not doubts(found)


def test_what_is_known_of_the_mounting_ends_the_doubt() -> None:
    nominal = arm("pan-tilt", 0.0)
    ended = 0
    for seed in range(8):
        _, read = tilts(nominal, UPRIGHT, seed)
        if doubts(identified(nominal, read)):
            found = identified(nominal, read, prior={"mounting.alpha": (0.0, 0.2)})
            assert not doubts(found) and not is_turned_over(found, UPRIGHT)
            ended += 1
    assert ended


def test_a_platform_that_turns_about_two_axes_has_one_start() -> None:
    robot = pk.load("hexapod")
    poses = pk.sample_poses(robot, 30, seed=0, share=0.8)
    read = pk.VirtualMachine(robot, seed=0, angle_noise=NOISE).measure(
        robot.inverse(poses), pk.readings.Tilt(mounting=HANGING)
    )
    (data,) = with_starts(robot, [FitData(read, np.arange(len(poses)), False, False)])
    start = data.starts["mounting", ""]
    assert not start.others
    assert np.cos(start.values[0] - HANGING[0]) > 0.99


def sessions(name: str, seed: int, off: float) -> tuple[pk.SerialArm, pk.Measurements]:
    """Two sessions of 30 rows, the sensor upright in the first and hanging in the second."""
    nominal, rng, errors = arm(name, 0.0), np.random.default_rng(seed), np.zeros((2, 6))
    errors[:, 3:] = off * rng.normal(size=(2, 3))
    machine = pk.VirtualMachine(nominal.replace(errors), seed=seed, angle_noise=NOISE)
    q = rng.uniform(-1.0, 1.0, (60, 2))
    read = [
        machine.measure(q[k : k + 30], pk.readings.Tilt(mounting=mounting)).values
        for k, mounting in ((0, UPRIGHT), (30, HANGING))
    ]
    where = ["morning"] * 30 + ["evening"] * 30
    return nominal, pk.Measurements(q, np.vstack(read), "tilt", sigma=NOISE, session=where)


@pytest.mark.parametrize("name", AXES)
def test_each_session_has_its_side_up(name: str) -> None:
    for off in (1e-3, 1e-2):
        nominal, read = sessions(name, 0, off)
        found = identified(nominal, read, per_session="mounting*")
        sides = [
            np.cos(found.parameters[f"mounting.alpha@{session}"]["value"])
            for session in ("morning", "evening")
        ]
        assert doubts(found) or (sides[0] > 0.0 > sides[1])
        assert doubts(found) <= (off < 0.01)


@pytest.mark.parametrize("name", AXES)
def test_a_session_that_is_held_out_may_have_the_other_side_up(name: str) -> None:
    for seed in range(3):
        nominal, read = sessions(name, seed, 0.01)
        fitted, held = read.select(np.arange(30)), read.select(np.arange(30, 60))
        found = identified(nominal, fitted, per_session="mounting*", holdout=held)
        assert not found.holdout_contradicts
        assert np.cos(found.holdout_parameters["mounting.alpha@evening"]["value"]) < 0.0


@pytest.mark.parametrize("alpha", [0.0, np.pi, -np.pi])
@pytest.mark.parametrize("name", AXES)
def test_what_is_stated_of_the_mounting_decides_before_any_fit(name: str, alpha: float) -> None:
    """No joint turns half over for a sensor that is stated to be upright; angles count by turns."""
    nominal = arm(name, 0.0)
    for seed in range(2):
        _, read = tilts(nominal, HANGING if np.cos(alpha) < 0 else UPRIGHT, seed)
        found = identified(nominal, read, prior={"mounting.alpha": (alpha, 0.2)})
        assert found.verdict.state == "calibrated", str(found.verdict)
        assert abs(found.parameters["mounting.alpha"]["value"] - alpha) < 0.2
        assert np.abs(found.robot.joint_errors[:, 3:]).max() < 0.1
