"""Angles that are wrong are never calibrated from, whatever the lengths beside them say."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pkmcal as pk
from pkmcal.arrays import FloatArray
from pkmcal.diagnostics.families import unlike_families
from pkmcal.fitted.solution import Solution

from ..simulated import with_errors
from ..sweeps import sweep

Spoil = Callable[[FloatArray, np.random.Generator], FloatArray]
SIGMA = np.array([0.02, 0.02, 0.02, 5e-5, 5e-5, 5e-5])
ARM = pk.SerialArm.from_dh(
    a=[312, 1075, 225, 0, 0, 0],
    d=[670, 0, 0, 1280, 0, 215],
    alpha=np.radians([-90, 0, -90, 90, -90, 0]),
    theta=np.radians([0, -90, 0, 0, 0, 0]),
)


def columns(order: list[int], signs: list[float]) -> Spoil:
    return lambda y, rng: np.hstack([y[:, :3], y[:, 3:][:, order] * signs])


def in_order(order: str) -> Spoil:
    def spoil(y: FloatArray, rng: np.random.Generator) -> FloatArray:
        """As R = Rx Ry Rz, say, each angle in the column of its axis."""
        first = Rotation.from_euler("xyz", y[:, 3:]).as_euler(order)
        return np.hstack([y[:, :3], first[:, [order.index(axis) for axis in "XYZ"]]])

    return spoil


def with_noise(more: float) -> Spoil:
    return lambda y, rng: y + rng.normal(size=y.shape) * SIGMA * [0, 0, 0, more, more, more]


def of_other_rows(y: FloatArray, rng: np.random.Generator) -> FloatArray:
    return np.hstack([y[:, :3], y[rng.permutation(len(y)), 3:]])


def transposed(y: FloatArray, rng: np.random.Generator) -> FloatArray:
    return np.hstack([y[:, :3], Rotation.from_euler("xyz", y[:, 3:]).inv().as_euler("xyz")])


MISTAKES: dict[str, Spoil] = {
    "of other rows": of_other_rows,
    "gamma reversed": columns([0, 1, 2], [1, 1, -1]),
    "all reversed": columns([0, 1, 2], [-1, -1, -1]),
    "exchanged": columns([1, 0, 2], [1, 1, 1]),
    "beta not filled": columns([0, 1, 2], [1, 0, 1]),
    "XYZ": in_order("XYZ"),
    "YZX": in_order("YZX"),
    "transposed": transposed,
}


def measured(machine: Any, rows: int, seed: int) -> tuple[Any, FloatArray, FloatArray]:
    """A machine with errors, the actuators of some poses, and these poses with noise."""
    rng = np.random.default_rng(seed)
    if isinstance(machine, pk.SerialArm):
        true: Any = machine.replace(rng.normal(size=(6, 6)) * [0.3, 0.3, 0.3, 5e-4, 5e-4, 5e-4])
        q = rng.uniform(-1.3, 1.3, (rows, 6))
        poses = pk.screw.to_pose(true.forward(q))
    else:
        names = machine.geometry.match("offset*")
        true = machine.replace({n: machine.geometry[n] + rng.normal(0, 0.4) for n in names})
        asked = pk.sample_poses(machine, rows, seed=seed)
        q = machine.inverse(asked)
        poses = true.forward(q, guess=asked).pose
    return true, q, poses + rng.normal(size=poses.shape) * SIGMA


def judged(machine: Any, spoil: Spoil | None, seed: int = 0, **held: Any) -> Any:
    """The result of poses whose angles are spoiled; None where it is refused."""
    _, q, poses = measured(machine, 40, seed)
    wrong = poses if spoil is None else spoil(poses, np.random.default_rng(seed + 7))
    free = None if isinstance(machine, pk.SerialArm) else "offset*"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return pk.identify(machine, pk.Measurements(q, wrong, "pose"), free, **held)
        except ValueError:
            return None


def not_calibrated(found: Any) -> bool:
    return found is None or found.verdict.state != "calibrated"


@sweep("mistake", MISTAKES, quick=["of other rows", "all reversed", "beta not filled"])
def test_wrong_angles_are_not_calibrated_from(hexapod: pk.Robot, mistake: str) -> None:
    assert not_calibrated(judged(hexapod, MISTAKES[mistake], holdout=0.25))


@pytest.mark.slow
@pytest.mark.parametrize("mistake", MISTAKES)
@pytest.mark.parametrize("name", ["2tpr2tps", "6-rus", "arm"])
def test_wrong_angles_are_not_calibrated_from_on_other_machines(name: str, mistake: str) -> None:
    machine = ARM if name == "arm" else pk.load(name)
    if name == "2tpr2tps" and mistake in ("gamma reversed", "YZX"):
        pytest.skip("it does not turn about z: nothing is mistaken")
    assert not_calibrated(judged(machine, MISTAKES[mistake]))


@sweep("name", ["hexapod", "2tpr2tps", "6-rus"], quick=["2tpr2tps"])
def test_sound_angles_raise_no_suspicion(name: str) -> None:
    """Not even where their noise is a hundred times that of the lengths, as arcs."""
    for seed, spoil in ((0, None), (1, with_noise(300.0))):
        found = judged(pk.load(name), spoil, seed)
        assert isinstance(found, Solution) and not list(unlike_families(found))
        said = {each.check for each in found.verdict.said}
        assert not said & {"family-off", "constant-component", "unit-errors"}


@pytest.mark.parametrize(("mistake", "words"), [
    ("XYZ", "in the order XYZ (--rotation XYZ)"),
    ("YZX", "in the order YZX (--rotation YZX)"),
    ("gamma reversed", "gamma counts the other way"),
    ("exchanged", "alpha and beta are exchanged"),
    ("transposed", "orientations are those of the base in the platform's frame"),
])  # fmt: skip
def test_what_is_meant_is_named(hexapod: pk.Robot, mistake: str, words: str) -> None:
    found = judged(hexapod, MISTAKES[mistake])
    assert any(words in text for text in found.warnings)


def test_an_order_is_named_where_errors_of_the_machine_hide_it(hexapod: pk.Robot) -> None:
    """Poses that hardly tilt: the order makes less than the errors of the machine do."""
    rng = np.random.default_rng(4)
    names = hexapod.geometry.match("offset*")
    true = hexapod.replace({name: rng.normal(0, 3.0) for name in names})
    asked = hexapod.home + rng.uniform(-1, 1, (40, 6)) * [60, 60, 40, 0.1, 0.1, 0.1]
    q = hexapod.inverse(asked)
    poses = true.forward(q).pose + rng.normal(size=(40, 6)) * SIGMA
    wrong = in_order("XYZ")(poses, rng)
    with pytest.warns(pk.CalibrationWarning, match=r"\(--rotation XYZ\)"):
        found = pk.identify(hexapod, pk.Measurements(q, wrong, "pose"), "offset*")
    assert found.verdict.state == "doubtful"


@sweep(
    "mistake, seed",
    product([None, "gamma reversed", "YZX"], range(3)),
    quick=[(None, 0), ("gamma reversed", 1), ("YZX", 0)],
)
def test_mistakes_that_numbers_of_the_machine_take_up_are_named(
    mistake: str | None, seed: int
) -> None:
    """A platform that turns about z by its errors alone, all numbers free."""
    words = {"gamma reversed": "gamma counts the other way", "YZX": "(--rotation YZX)"}
    robot = pk.load("2tpr2tps-spatial")
    rng = np.random.default_rng(seed)
    true = with_errors(robot, 0.4, rng)
    asked = pk.sample_poses(robot, 40, seed=seed)
    q = robot.inverse(asked)
    poses = true.forward(q, guess=asked).pose + rng.normal(size=(40, 6)) * SIGMA
    values = poses if mistake is None else MISTAKES[mistake](poses, rng)
    good = np.isfinite(values).all(axis=1)
    verdict = pk.identify(robot, pk.Measurements(q[good], values[good], "pose")).verdict
    said = [each.text for each in verdict.said if each.check == "other-reading"]
    assert len(said) == (mistake is not None)
    assert all(words[str(mistake)] in text for text in said)
    assert (verdict.state == "calibrated") == (mistake is None)


def test_held_out_angles_are_judged_beside_lengths(hexapod: pk.Robot) -> None:
    """100 mrad off, 2000 times the stated sigma; the lengths are as they should be."""
    true, q, poses = measured(hexapod, 40, 0)
    asked = pk.sample_poses(hexapod, 30, seed=9)
    rng = np.random.default_rng(9)
    later = hexapod.inverse(asked)
    sound = true.forward(later, guess=asked).pose + rng.normal(size=(30, 6)) * SIGMA
    turned = pk.screw.from_pose(sound)
    turned[:, :3, :3] = turned[:, :3, :3] @ Rotation.from_euler("x", 0.1).as_matrix()
    fitted = pk.Measurements(q, poses, "pose", sigma=SIGMA)
    for values, contradicts in ((sound, False), (pk.screw.to_pose(turned), True)):
        held = pk.Measurements(later, values, "pose", sigma=SIGMA)
        found = pk.identify(hexapod, fitted, "offset*", holdout=held)
        assert found.holdout_contradicts == contradicts
        assert [each.family.noun for each in found.holdout_contradicting] == [
            "angles"
        ] * contradicts
        assert (found.verdict.state == "calibrated") != contradicts
        # what is expected of a point is that of its families, angles as arcs
        arcs = [1.0, hexapod.length]
        by_hand = np.hypot(
            *(a * f.expected for a, f in zip(arcs, found.holdout_families, strict=True))
        )
        assert found.holdout_expected == pytest.approx(by_hand)


def test_a_misfit_counts_angles_as_their_arc(hexapod: pk.Robot) -> None:
    _, q, poses = measured(hexapod, 40, 3)
    found = pk.identify(hexapod, pk.Measurements(q, poses, "pose"), "offset*")
    (residual,) = found.residuals
    by_hand = (residual[:, :3] ** 2).sum(1) + (
        hexapod.length * residual[:, 3:] ** 2 * hexapod.length
    ).sum(1)
    assert found.rms == pytest.approx(float(np.sqrt(by_hand.mean())))


def test_a_column_that_was_not_filled_is_named() -> None:
    """The platform turns about z by its errors alone; zeros there are no reading."""
    robot = pk.load("2tpr2tps-spatial")
    rng = np.random.default_rng(1)
    true = robot.replace(
        {n: robot.geometry[n] + rng.normal(0, 0.4) for n in robot.geometry.match("base*.?")}
    )
    asked = pk.sample_poses(robot, 40, seed=1)
    q = robot.inverse(asked)
    poses = true.forward(q, guess=asked).pose
    good = np.isfinite(poses).all(axis=1)
    poses = poses[good] + rng.normal(size=(good.sum(), 6)) * SIGMA
    for values, named in ((poses, False), (poses * [1, 1, 1, 1, 1, 0], True)):
        found = pk.identify(robot, pk.Measurements(q[good], values, "pose"))
        texts = [each.text for each in found.verdict.said if each.check == "constant-component"]
        assert [text.startswith("gamma is 0 deg in every row") for text in texts] == [True] * named


def test_zeros_of_a_machine_that_does_not_turn_are_readings(hexapod: pk.Robot) -> None:
    robot = pk.load("linear-delta")
    q = robot.inverse(pk.sample_poses(robot, 20, seed=0))
    found = pk.identify(robot, pk.Measurements(q, robot.forward(q).pose, "pose"), "offset*")
    assert not {"constant-component", "family-off"} & {each.check for each in found.verdict.said}
    turns = replace(found.fit.equations.table.sets[0], sigma=1e-3)
    assert not list(unlike_families(pk.identify(robot, turns, "offset*")))


@pytest.mark.parametrize("name", ["3rrr-planar", "five-bar"])
def test_a_component_that_was_not_read_is_exchanged_with_none(name: str) -> None:
    """Other rows would be read than those that are judged: fewer have smaller residuals."""
    robot = pk.load(name)
    q = robot.inverse(pk.sample_poses(robot, 40, seed=1), match=True)
    true = robot.replace({"offset1": robot.geometry["offset1"] + 1e-3})
    seen = pk.VirtualMachine(true, noise=0.02, seed=1).measure(q, "position").values.copy()
    seen[:, 2] = np.nan
    found = pk.identify(robot, pk.Measurements(q, seen, "position"), "offset*")
    assert "other-reading" not in {said.check for said in found.verdict.said}
