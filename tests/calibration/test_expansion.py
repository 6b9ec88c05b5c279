"""Numbers that were identified on a warm machine are those of the machine at 20 °C."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pkmcal as pk
from pkmcal.arrays import FloatArray

from ..simulated import hexapod_poses

COEFFICIENTS = {"base": 11.5e-6, "platform": 23e-6, "limbs": 11.5e-6, "limb3": 20e-6}
TARGET = np.array([60.0, 20.0, -30.0])
FREE = ["offset*", "base2.x"]


def grown(robot: pk.Robot, temperature: FloatArray) -> pk.Robot:
    """The robot with every length longer, by names: base, platform, then limb by limb."""
    values = {}
    for name in robot.geometry.names:
        if name.startswith("base"):
            growth = COEFFICIENTS["base"] * (temperature[0] - 20.0)
        elif name.startswith("platform"):
            growth = COEFFICIENTS["platform"] * (temperature[1] - 20.0)
        else:
            i = int(name[-1])
            coefficient = COEFFICIENTS.get(f"limb{i}", COEFFICIENTS["limbs"])
            growth = coefficient * (temperature[1 + i] - 20.0)
        values[name] = robot.geometry[name] * (1.0 + growth)
    return robot.replace(values)


@pytest.fixture(scope="module")
def warm(hexapod: pk.Robot) -> tuple[pk.Robot, FloatArray, FloatArray, FloatArray]:
    """The true machine at 20 °C; actuators, temperatures and points of a day it was warm."""
    rng = np.random.default_rng(3)
    true = hexapod.replace({"offset1": 0.4, "base2.x": hexapod.geometry["base2.x"] + 0.5})
    poses = hexapod_poses(hexapod, 40, rng)
    q = hexapod.inverse(poses)
    warmth = 20.0 + 10.0 * rng.random((40, 8))
    points = []
    for row, pose in enumerate(poses):
        at = grown(true, warmth[row]).forward(q[row], guess=pose).pose
        place = TARGET * (1.0 + COEFFICIENTS["platform"] * (warmth[row, 1] - 20.0))
        turn = Rotation.from_euler("ZYX", at[[5, 4, 3]]).as_matrix()
        points.append(at[:3] + turn @ place)
    return true, q, warmth, np.array(points)


@pytest.mark.parametrize("known", [True, False], ids=["known", "frame and target unknown"])
def test_the_numbers_are_those_at_20_degrees(warm: Any, hexapod: pk.Robot, known: bool) -> None:
    true, q, warmth, points = warm
    words: dict[str, Any] = {}
    if not known:
        turn = Rotation.from_euler("ZYX", [0.7, -0.2, 0.1]).as_matrix()
        points = points @ turn.T + [100.0, 200.0, 300.0]
        words = {"unknown": ["frame", "target"]}
    measured = pk.Measurements(q, points, target=TARGET if known else None, temperature=warmth)
    found = pk.identify(hexapod, measured, FREE, effects=[pk.Expansion(COEFFICIENTS)], **words)
    assert found.rms < 1e-3  # mm: what is left is of second order
    for name in ("base2.x", *(f"offset{i}" for i in range(1, 7))):
        assert found.parameters[name]["value"] == pytest.approx(true.geometry[name], abs=2e-3)
    cold = pk.identify(hexapod, measured, FREE, **words)
    assert cold.rms > 0.1 and "is not taken into account" in str(cold)
    assert found.expansion == COEFFICIENTS and "those at 20 °C" in str(found)


def test_points_that_are_held_out_are_warm_too(warm: Any, hexapod: pk.Robot) -> None:
    _, q, warmth, points = warm
    measured = pk.Measurements(q, points, target=TARGET, temperature=warmth)
    found = pk.identify(hexapod, measured, FREE, effects=[pk.Expansion(COEFFICIENTS)], holdout=0.3)
    assert found.holdout_rms < 1e-3
    fit, later = measured.split(0.3)
    assert (
        pk.identify(
            hexapod, fit, FREE, effects=[pk.Expansion(COEFFICIENTS)], holdout=later
        ).holdout_rms
        < 1e-3
    )


def test_a_machine_that_grows_as_a_whole_has_larger_poses(hexapod: pk.Robot) -> None:
    """All lengths 0.01 % longer: so are all positions, and orientations stay."""
    poses = hexapod_poses(hexapod, 20, np.random.default_rng(5))
    q = hexapod.inverse(poses)
    larger = poses * [1 + 1e-4, 1 + 1e-4, 1 + 1e-4, 1, 1, 1]
    measured = pk.Measurements(q, larger, "pose", sigma=0.01, temperature=30.0)
    found = pk.identify(hexapod, measured, "offset*", effects=[pk.Expansion(1e-5)])
    np.testing.assert_allclose(found.values, hexapod.geometry.values[6::8], atol=1e-4)


def test_ties_and_angles_of_a_delta_grow_as_its_lengths_do() -> None:
    from pathlib import Path

    robot = pk.load(Path(__file__).parents[2] / "examples" / "linear-delta" / "robot.toml")
    poses = np.array(
        [[x, y, z, 0, 0, 0] for x in (-60, 0, 60) for y in (-60, 60) for z in (1, 90.0)]
    )
    q = robot.inverse(poses)
    measured = pk.Measurements(q, poses[:, :3] * (1 + 1e-4), sigma=0.01, temperature=30.0)
    found = pk.identify(robot, measured, effects=[pk.Expansion(1e-5)])
    assert found.rms < 1e-4 and np.abs(found.values - found.start).max() < 1e-3


def test_what_does_not_go_with_expansion_is_refused(hexapod: pk.Robot) -> None:
    q = hexapod.inverse(hexapod_poses(hexapod, 10, np.random.default_rng(1)))
    measured = pk.Measurements(q, np.zeros((10, 3)))
    with pytest.raises(pk.ArgumentError, match=r"no temperature; the file needs a column"):
        pk.identify(hexapod, measured, effects=[pk.Expansion(1e-5)])
    blank = dataclasses.replace(measured, temperature=np.full(10, np.nan), lines=np.arange(10) + 5)
    with pytest.raises(pk.ArgumentError, match=r"line 5: a temperature is missing"):
        pk.identify(hexapod, blank, effects=[pk.Expansion(1e-5)])
    read = dataclasses.replace(measured, temperature=21.0)
    with pytest.raises(pk.ArgumentError, match=r"in 1/K, of steel 11.5e-6; found 11.5"):
        pk.identify(hexapod, read, effects=[pk.Expansion(11.5)])
    with pytest.raises(pk.ArgumentError, match=r"in 1/K, of steel 11.5e-6; found 0.0115"):
        pk.identify(hexapod, read, effects=[pk.Expansion(0.0115)])
    with pytest.raises(pk.ArgumentError, match=r"limb1 to limb6; found 'limb7'"):
        pk.identify(hexapod, read, effects=[pk.Expansion({"limb7": 1e-5})])
    with pytest.raises(pk.ArgumentError, match=r"chains of joints"):
        pk.identify(pk.load("tricept"), read.select([0]), effects=[pk.Expansion(1e-5)])
    with pytest.raises(pk.ArgumentError, match=r"temperature must be a number or have shape"):
        pk.Measurements(q, np.zeros((10, 3)), temperature=np.zeros((10, 6)))
