"""Distances, of wires and ball bars and legs: either end may be known or found along."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pkmcal.calibration.identify import identify
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.virtual_machine import VirtualMachine
from pkmcal.readings import Distance

from ..simulated import hexapod_poses


def test_the_unknown_fixed_point_of_distances_is_found(hexapod: Robot) -> None:
    rng = np.random.default_rng(17)
    true = hexapod.replace({"offset2": 0.5})
    q = hexapod.inverse(hexapod_poses(hexapod, 30, rng))
    anchor = np.array([400.0, 300.0, -100.0])
    exact = VirtualMachine(true, noise=0).measure(q, kind="distance", target=anchor)
    rough = dataclasses.replace(exact, target=anchor + np.array([3.0, -4.0, 5.0]))
    found = identify(hexapod, rough, free="offset2", unknown="target")
    assert found.free == ("offset2", "anchor1.x", "anchor1.y", "anchor1.z")
    np.testing.assert_allclose(found.values, [0.5, *anchor], atol=1e-6)


def test_wires_are_found_at_both_ends(hexapod: Robot) -> None:
    """Six draw wires, each from a fixed point to its own place on the platform."""
    rng = np.random.default_rng(18)
    true = hexapod.replace({"offset2": 0.5, "offset5": -0.3})
    q = np.repeat(hexapod.inverse(hexapod_poses(hexapod, 60, rng)), 6, axis=0)
    index = np.tile(np.arange(6), 60)
    anchors, ends = rng.uniform(-500, 500, (6, 3)), rng.uniform(-120, 120, (6, 3))
    anchors[:, 2] -= 400.0
    exact = VirtualMachine(true, noise=0).measure(q, Distance(ends[index]), anchors[index])
    rough = dataclasses.replace(
        exact,
        target=anchors + rng.normal(0, 3, (6, 3)),
        instrument=Distance(ends + rng.normal(0, 3, (6, 3))),
        target_index=index,
    )
    found = identify(hexapod, rough, free="offset*", unknown=["target", "attachment"])
    assert found.free[6:9] == ("attachment1.x", "attachment1.y", "attachment1.z")
    assert found.free[24:27] == ("anchor1.x", "anchor1.y", "anchor1.z")
    truth = np.concatenate([[0, 0.5, 0, 0, -0.3, 0], ends.ravel(), anchors.ravel()])
    np.testing.assert_allclose(found.values, truth, atol=1e-6)
    known = dataclasses.replace(
        exact, target=anchors, instrument=Distance(ends), target_index=index
    )
    np.testing.assert_allclose(
        identify(hexapod, known, free="offset*").values, truth[:6], atol=1e-9
    )


def test_wires_may_be_held_out_with_both_ends_unknown(hexapod: Robot) -> None:
    rng = np.random.default_rng(20)
    q = hexapod.inverse(hexapod_poses(hexapod, 60, rng))
    anchor, end = np.array([400.0, 300.0, -100.0]), np.array([60.0, -40.0, 20.0])
    measured = VirtualMachine(hexapod, noise=0.02).measure(q, Distance(end), anchor)
    rough = dataclasses.replace(measured, target=anchor + 3.0, instrument=Distance(end - 2.0))
    words = {"unknown": ["target", "attachment"]}
    found = identify(hexapod, rough, free="offset2", prior=0.5, holdout=0.25, **words)
    assert found.free[1:] == tuple(
        f"{point}1.{axis}" for point in ("attachment", "anchor") for axis in "xyz"
    )
    assert found.holdout_rms == pytest.approx(found.holdout_expected, rel=0.5)


def test_one_end_may_be_known_and_the_other_not(hexapod: Robot) -> None:
    rng = np.random.default_rng(19)
    q = hexapod.inverse(hexapod_poses(hexapod, 40, rng))
    anchor, end = np.array([400.0, 300.0, -100.0]), np.array([60.0, -40.0, 20.0])
    exact = VirtualMachine(hexapod, noise=0).measure(q, Distance(end), anchor)
    rough = dataclasses.replace(exact, instrument=Distance(end + np.array([3, -4, 5])))
    found = identify(hexapod, rough, free="offset2", unknown="attachment")
    assert found.free == ("offset2", "attachment1.x", "attachment1.y", "attachment1.z")
    np.testing.assert_allclose(found.values, [0.0, *end], atol=1e-6)
