"""Whether deviations say anything: an arm whose height is linear in one number, not in another."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arrays import FloatArray
from pkmcal.calibration.linearity import Weak, beyond_linear
from pkmcal.measurements.calibratable import as_machine

ROWS = 12


def arm_with(name: str, value: float) -> pk.SerialArm:
    arm = pk.load("3r")
    geometry = as_machine(arm).geometry
    values = geometry.values.copy()
    values[geometry.names.index(name)] += value
    return arm.replace(values.reshape(-1, 6))


def joints() -> FloatArray:
    return np.random.default_rng(0).uniform(-0.3, 0.3, (ROWS, 3)) + [0.0, 0.9, -0.5]


def heights(name: str, value: float) -> FloatArray:
    z: FloatArray = as_machine(arm_with(name, value)).forward(joints()).pose[:, 2]
    return z


def slope(name: str) -> float:
    """Root of the sum of squares by which heights change per mm or rad."""
    change = (heights(name, 1e-4) - heights(name, -1e-4)) / 2e-4
    return float(np.linalg.norm(change))


def weak(name: str, deviation: float, **options: object) -> Weak | None:
    """What is said where heights without noise leave a number this uncertain."""
    measured = pk.Measurements(
        joints(), heights(name, 0.0), "height", sigma=deviation * slope(name)
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pk.CalibrationWarning)
        found = pk.identify(pk.load("3r"), measured, free=name, **options)  # type: ignore[arg-type]
    (stated,) = found.stderr
    if not options:
        assert stated == pytest.approx(deviation, rel=0.05)
    return beyond_linear(found.fit.estimate, found.fit.uncertainty)


def rise(name: str, deviation: float) -> float:
    """Median share by which squares rise by more or less than those of the linear machine."""
    there = heights(name, 0.0)
    shares = []
    for step in deviation * np.random.default_rng(1).normal(size=99):
        linear = (step * slope(name)) ** 2
        shares.append(abs(((heights(name, step) - there) ** 2).sum() - linear) / linear)
    return float(np.median(shares))


def test_a_machine_that_is_linear_is_so_however_uncertain() -> None:
    for deviation in (100.0, 1000.0):
        assert rise("joint1.dz", deviation) < 1e-6
        assert weak("joint1.dz", deviation) is None


@pytest.mark.parametrize(("deviation", "linear"), [(0.3, True), (1.7, False)])
def test_half_of_the_rise_of_the_misfit_decides(deviation: float, linear: bool) -> None:
    share = rise("joint2.dphi", deviation)
    assert share < 0.35 if linear else share > 0.75
    said = weak("joint2.dphi", deviation)
    assert said == (None if linear else Weak(("joint2.dphi",), assembled=True))
    assert linear or "joint2.dphi are hardly determined: the machine is not linear" in str(said)


def test_what_a_prior_determines_is_not_asked() -> None:
    assert weak("joint2.dphi", 1.7) is not None
    assert weak("joint2.dphi", 1.7, prior=0.1) is None
