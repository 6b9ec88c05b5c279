"""Residuals that are functions of named numbers, beside those of measurements."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
import pytest

import pkmcal as pk

from ..sweeps import sweep

NOISE = np.random.default_rng(0)
TIED = "examples/linear-delta/robot.toml"


def point(n: Mapping[str, float], name: str) -> np.ndarray:
    return np.array([n[f"{name}.{axis}"] for axis in "xyz"])


def measured(robot: pk.Robot, true: pk.Robot, seed: int = 0) -> pk.Measurements:
    q = robot.inverse(pk.sample_poses(robot, 30, seed=seed), match=True)
    return pk.VirtualMachine(true, noise=0.02, angle_noise=5e-5, seed=seed).measure(q)


@sweep("machine", ["hexapod", "rbt-6t03p", "rotary-delta"], quick=["rotary-delta"])
def test_a_residual_of_a_length_is_the_prior_of_that_length(machine: str) -> None:
    """Two ways: the package's own functions of numbers, with exact derivatives, and one's own."""
    robot = pk.load(machine)
    true = robot.replace({"base1.x": robot.geometry["base1.x"] + 0.3})
    data = measured(robot, true)
    length = np.linalg.norm(point(true.geometry, "base1") - point(true.geometry, "base2"))

    def tape(n: Mapping[str, float]) -> float:
        return float(np.linalg.norm(point(n, "base1") - point(n, "base2")) - length) / 0.01

    free = ["base1.x", "base1.y", "base2.x", "base2.y"]
    stated = pk.identify(robot, data, free, prior={"|base1 - base2|": (length, 0.01)})
    own = pk.identify(robot, data, free, residuals=[tape])
    np.testing.assert_allclose(own.values, stated.values, atol=1e-5)
    np.testing.assert_allclose(own.stderr, stated.stderr, rtol=1e-5)
    assert own.prior_test is not None and stated.prior_test is not None
    assert own.prior_test.chance == pytest.approx(stated.prior_test.chance, rel=1e-3)


def test_derivatives_that_are_brought_are_those_by_differences_through_ties_and_frames() -> None:
    robot = pk.load(TIED)
    true = robot.replace({"radius": robot.geometry["radius"] + 0.2})
    data = measured(robot, true)
    nominal = robot.geometry["base2.x"] * robot.geometry["angle2"]

    def values(n: Mapping[str, float]) -> np.ndarray:
        product = n["base2.x"] * n["angle2"] - nominal
        return np.array([product, n["frame.alpha"] * 1e3, n["radius"] - 170.0])

    def brought(n: Mapping[str, float]) -> tuple[np.ndarray, dict[str, Any]]:
        return values(n), {
            "base2.x": [n["angle2"], 0.0, 0.0],
            "angle2": [n["base2.x"], 0.0, 0.0],
            "frame.alpha": [0.0, 1e3, 0.0],
            "radius": [0.0, 0.0, 1.0],
        }

    found = [
        pk.identify(robot, data, unknown="frame", fix="datum", residuals=each)
        for each in (values, brought)
    ]
    np.testing.assert_allclose(found[0].values, found[1].values, atol=1e-6)
    chosen = found[1].fit.parameters
    theta = found[1].fit.end.theta
    np.testing.assert_allclose(
        found[0].fit.parameters.prior_rows(theta), chosen.prior_rows(theta), rtol=1e-6, atol=1e-6
    )


@pytest.mark.parametrize("times", [-1.0, 0.5, 0.9, 1.1, 10.0])
def test_a_derivative_that_is_not_that_of_the_values_is_refused_by_name(times: float) -> None:
    robot = pk.load("hexapod")

    def near(n: Mapping[str, float]) -> tuple[list[float], dict[str, Any]]:
        by_second = [0.0, times * 2.0 * n["offset2"] / 0.01]
        values = [n["offset1"] / 0.001, (n["offset2"] ** 2 - 0.2) / 0.01]
        return values, {"offset1": [1000.0, 0.0], "offset2": by_second}

    start = robot.replace({"offset2": 0.4})
    with pytest.raises(ValueError, match="near: its derivative by offset2 is stated as"):
        pk.identify(start, measured(start, start), "offset*", residuals=[near])


def test_the_kink_of_a_residual_is_no_wrong_derivative() -> None:
    """Within a step of differences of it."""
    robot = pk.load("hexapod").replace({"offset1": 0.0005})

    def near(n: Mapping[str, float]) -> tuple[float, dict[str, float]]:
        return abs(n["offset1"]), {"offset1": float(np.sign(n["offset1"]))}

    assert pk.identify(robot, measured(robot, robot), "offset*", residuals=[near]).converged


def test_a_residual_brings_numbers_that_are_found() -> None:
    """A bar of unknown length between two pairs of joints: its law is that of both lengths."""

    class Bar:
        numbers: ClassVar = {"bar.length": (415.0, "mm")}

        def __call__(self, n: Mapping[str, float]) -> np.ndarray:
            lengths = [
                np.linalg.norm(point(n, f"base{i}") - point(n, f"base{i + 1}")) for i in (1, 3)
            ]
            return (np.array(lengths) - n["bar.length"]) / 0.001

    robot = pk.load("hexapod")
    data = measured(robot, robot.replace({"offset1": 0.2}))
    found = pk.identify(robot, data, ["offset*", "base1.x", "base3.x"], residuals=[Bar()])
    n = found.robot.geometry
    k = found.free.index("bar.length")
    for i in (1, 3):
        length = np.linalg.norm(point(n, f"base{i}") - point(n, f"base{i + 1}"))
        assert found.values[k] == pytest.approx(length, abs=0.005)
    assert np.isfinite(found.stderr[k])
    held = pk.identify(
        robot, data, ["offset*", "base1.x", "base3.x"], residuals=[Bar()], holdout=0.2
    )
    assert held.verdict.state == "calibrated"


def test_a_residual_that_is_wrong_is_said_to_contradict_the_measurements() -> None:
    robot = pk.load("hexapod")

    def tape(n: Mapping[str, float]) -> float:
        return (n["offset1"] - 5.0) / 0.01

    with pytest.warns(pk.CalibrationWarning):
        found = pk.identify(robot, measured(robot, robot), "offset*", residuals=[tape])
    assert found.verdict.state != "calibrated"
    assert any("pull tape" in text for text in found.verdict.reasons)


@pytest.mark.parametrize(
    ("residual", "said"),
    [
        (lambda n: n["offset7"], "no number 'offset7'"),
        (lambda n: n["base1.x"] - 3.0, "does not change with any free number"),
        (lambda n: np.nan, "finite"),
        (lambda n: "five", "found 'five'"),
        (lambda n: (n["offset1"], {"offset9": 1.0}), "offset9"),
        (lambda n: (n["offset1"], {"offset1": [1.0, 2.0]}), "offset1"),
        (lambda n: (n["offset1"], {"offset1": "one"}), "by 'offset1' must be"),
        (lambda n: 1e200 * n["offset1"], "below 1e\\+50"),
        (lambda n: (n["offset1"], {"offset1": 1e200}), "below 1e\\+50"),
        (lambda n: 1 / 0, "<lambda> failed with ZeroDivisionError"),
        (lambda n: [n["offset1"]][1], "<lambda> failed with IndexError"),
        (lambda n: n + 1, "<lambda> failed with TypeError"),
        (lambda n, m: 0.0, "<lambda> failed with TypeError"),
        (lambda n: dict[str, float]()["of its own"], "<lambda> failed with KeyError: 'of its own'"),
        (lambda n: n["offset1"] + NOISE.normal(), "other values"),
    ],
)  # fmt: skip
def test_a_residual_that_does_not_fit_is_refused(residual: Any, said: str) -> None:
    robot = pk.load("hexapod")
    with pytest.raises(ValueError, match=said):
        pk.identify(robot, measured(robot, robot), "offset*", residuals=[residual])


@pytest.mark.parametrize("residuals", [3, "tape", [None]])
def test_what_is_no_function_is_refused(residuals: Any) -> None:
    robot = pk.load("hexapod")
    with pytest.raises(TypeError, match="residuals: expected"):
        pk.identify(robot, measured(robot, robot), "offset*", residuals=residuals)
