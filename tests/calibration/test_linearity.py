"""Whether deviations say anything: an arm whose height is linear in one number, not in another."""

from __future__ import annotations

import functools
import warnings

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arrays import FloatArray
from pkmcal.diagnostics.linearity import Weak, beyond_linear
from pkmcal.kinematics.calibratable import as_machine

ROWS = 12


@functools.cache
def nominal() -> pk.SerialArm:
    return pk.load("3r")


def arm_with(name: str, value: float) -> pk.SerialArm:
    arm = nominal()
    geometry = as_machine(arm).geometry
    values = geometry.values.copy()
    values[geometry.names.index(name)] += value
    return arm.replace(values.reshape(-1, 6))


def joints(raised: float) -> FloatArray:
    """Of an arm whose upper joint is at this angle, rad, give or take."""
    apart: FloatArray = np.random.default_rng(0).uniform(-0.2, 0.2, (ROWS, 3))
    return apart + np.array([0.0, raised, -0.5])


def heights(name: str, value: float, raised: float) -> FloatArray:
    z: FloatArray = as_machine(arm_with(name, value)).forward(joints(raised)).pose[:, 2]
    return z


def slope(name: str, raised: float) -> float:
    """Root of the sum of squares by which heights change per mm or rad."""
    change = (heights(name, 1e-4, raised) - heights(name, -1e-4, raised)) / 2e-4
    return float(np.linalg.norm(change))


def weak(
    name: str, deviation: float, raised: float, prior: float | None = None, stated: bool = True
) -> Weak | None:
    """What is said where heights leave a number this uncertain.

    By the sigma that is stated, without any noise; or by residuals that neither the number nor its
    square can explain, where sigma is ten times too small.
    """
    read = heights(name, 0.0, raised)
    sigma = deviation * slope(name, raised)
    steps = np.array([heights(name, step, raised) - read for step in (-0.1, 0.1)])
    apart = np.linalg.qr(np.column_stack([*steps, np.random.default_rng(2).random(ROWS)]))[0][:, 2]
    if not stated:
        read = read + apart * sigma * np.sqrt(ROWS - 1)
    measured = pk.Measurements(
        joints(raised), read, "height", sigma=sigma if stated else sigma / 10.0
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pk.CalibrationWarning)
        found = pk.identify(nominal(), measured, free=name, prior=prior)
    if prior is None:
        assert found.stderr[0] == pytest.approx(deviation, rel=0.05)
    return beyond_linear(found.fit.estimate, found.fit.uncertainty)


def rise(name: str, deviation: float, raised: float) -> float:
    """Median share by which squares rise by more or less than those of the linear machine."""
    there, shares = heights(name, 0.0, raised), []
    for step in deviation * np.random.default_rng(1).normal(size=99):
        linear = (step * slope(name, raised)) ** 2
        change = heights(name, step, raised) - there
        shares.append(abs(change @ change - linear) / linear)
    return float(np.median(shares))


def test_a_machine_that_is_linear_is_so_however_uncertain() -> None:
    for deviation in (50.0, 500.0):
        assert rise("joint1.dz", deviation, 0.9) < 1e-6
        assert weak("joint1.dz", deviation, 0.9) is None


@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.parametrize(("raised", "linear"), [(0.9, True), (1.4, False)])
def test_half_of_the_rise_of_the_misfit_decides(raised: float, linear: bool, stated: bool) -> None:
    share = rise("joint2.dphi", 0.7, raised)
    assert share < 0.35 if linear else share > 0.75
    said = weak("joint2.dphi", 0.7, raised, stated=stated)
    assert said == (None if linear else Weak(("joint2.dphi",), assembled=True))
    assert linear or "joint2.dphi are hardly determined: the machine is not linear" in str(said)


def test_what_a_prior_determines_is_not_asked() -> None:
    assert weak("joint2.dphi", 0.7, 1.4, prior=0.1) is None
