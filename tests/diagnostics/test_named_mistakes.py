"""Mistakes of orientations are named: in frames that are unknown, of wrists, and held out."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pkmcal as pk


def arm(seed: int, joints: int, size: float) -> tuple[pk.SerialArm, pk.SerialArm]:
    """An arm with axes in any directions, and the same with errors; `size` 0 is a wrist."""
    rng = np.random.default_rng([34, seed])
    axes = rng.normal(size=(joints, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    points = size * rng.uniform(-1.0, 1.0, (joints, 3))
    home = [*(size * rng.uniform(0.5, 1.0, 3)), 0.0, 0.0, 0.0]
    nominal = pk.SerialArm(axes, points, home)
    return nominal, nominal.replace(rng.normal(size=(joints, 6)) * ([0.3] * 3 + [1e-3] * 3))


def read(true: pk.SerialArm, seed: int, count: int = 40) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    q = rng.uniform(-1.2, 1.2, (count, true.n_joints))
    pose = pk.screw.to_pose(true.forward(q))
    return q, pose + rng.normal(size=pose.shape) * ([0.02] * 3 + [1e-4] * 3)


def identified(*given: object, **asked: object) -> pk.Identification:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pk.CalibrationWarning)
        return pk.identify(*given, **asked)  # type: ignore[arg-type]


def said(found: pk.Identification, name: str) -> str:
    """What one check says, the others not made."""
    check = next(each for each in pk.CHECKS if each.name == name)
    return "; ".join(check.say(found, each) for each in check.run(found))


def other_sign(angles: np.ndarray) -> np.ndarray:
    return angles * [1.0, -1.0, 1.0]


def inverted(angles: np.ndarray) -> np.ndarray:
    return Rotation.from_euler("xyz", angles).inv().as_euler("xyz")


def about_turned_axes(angles: np.ndarray) -> np.ndarray:
    return Rotation.from_euler("xyz", angles).as_euler("XYZ")


@pytest.mark.parametrize(
    ("mistake", "words"),
    [
        (other_sign, "beta counts the other way"),
        (inverted, "--invert-poses"),
        (about_turned_axes, "--rotation XYZ"),
    ],
)
def test_mistakes_of_orientations_in_an_unknown_frame_are_named(mistake, words: str) -> None:
    nominal, true = arm(1, 4, 400.0)
    q, pose = read(true, 1)
    frame = pk.screw.from_pose([100.0, 200.0, 300.0, 0.5, -0.3, 1.0])
    turned = pk.screw.to_pose(frame @ pk.screw.from_pose(pose))[:, 3:]
    found = identified(nominal, pk.Measurements(q, mistake(turned), "orientation"), unknown="frame")
    assert words in said(found, "unit-errors")


@pytest.mark.parametrize("kind", ["pose", "orientation"])
def test_rows_of_a_wrist_that_are_a_row_late_are_no_calibration_and_named(kind: str) -> None:
    for seed in range(2):
        nominal, true = arm(seed, 3, 0.0)
        q, pose = read(true, seed)
        values = pose if kind == "pose" else pose[:, 3:]
        found = identified(nominal, pk.Measurements(q[1:], values[:-1], kind))
        words = "if each reading belongs to the row 1 before it"
        assert words in said(found, "much-turned")  # a grave finding
        sound = identified(nominal, pk.Measurements(q, values, kind))
        assert not said(sound, "much-turned")


def test_a_mistake_in_measurements_that_are_held_out_is_named() -> None:
    nominal, true = arm(2, 6, 400.0)
    q, pose = read(true, 2, 70)
    fitted = pk.Measurements(q[:40], pose[:40], "pose")
    signs = pose[40:].copy()
    signs[:, 3:] = other_sign(signs[:, 3:])
    for held, words in (
        (pk.Measurements(q[40:], pose[40:], "pose"), None),
        (pk.Measurements(q[40:], signs, "pose"), "beta counts the other way"),
        (pk.Measurements(q[41:], pose[40:-1], "pose"), "each reading belongs to the row 1 before"),
    ):
        found = identified(nominal, fitted, holdout=held)
        assert found.holdout_contradicts == (words is not None)
        assert words is None or words in said(found, "holdout-contradicts")


def test_where_no_machine_has_the_numbers_over_their_deviations_the_verdict_says_so() -> None:
    """Of angles with a wrong sign a wrist's joints are told so little that it cannot be built."""
    axes, rng = [[0, 0, 1], [0, 1, 0], [1, 0, 0]], np.random.default_rng([0, 3])
    nominal = pk.SerialArm(axes, np.zeros((3, 3)), np.eye(4))
    true = nominal.replace(rng.normal(size=(3, 6)) * ([0.3] * 3 + [1e-3] * 3))
    q = rng.uniform(-1.2, 1.2, (50, 3))
    turned = pk.screw.to_pose(true.forward(q))[:, 3:] + 1e-4 * rng.normal(size=(50, 3))
    turned[:, 2] *= -1.0
    found = identified(nominal, pk.Measurements(q, turned, "orientation"))
    assert said(found, "beyond-linear")


@pytest.mark.parametrize("off", [2e-3, 2e-2])
def test_a_wrong_ratio_by_which_a_joint_follows_is_named_and_its_hint_cures(off: float) -> None:
    axes = [[0, 0, 1], [0, 1, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0]]
    points = [[0, 0, 0], [0, 0, 300], [300, 0, 300], [500, 0, 300], [560, 0, 300]]
    stated, true = (
        pk.SerialArm(axes, points, [640, 0, 300, 0, 0, 0], follows={3: {2: ratio}})
        for ratio in (-1.0, -1.0 + off)
    )
    errors = np.random.default_rng(34).normal(size=(5, 6)) * ([0.2] * 3 + [5e-4] * 3)
    rng = np.random.default_rng(35)
    q = rng.uniform(-1.0, 1.0, (60, 4))
    pose = pk.screw.to_pose(true.replace(errors).forward(q))
    read = pose + rng.normal(size=pose.shape) * ([0.02] * 3 + [5e-5] * 3)
    rows = pk.Measurements(q, read, "pose")
    found = identified(stated, rows)
    assert not said(found, "sag-lacking")
    assert said(found, "causes").startswith("residuals look like a wrong ratio by which joint 3")
    cured = identified(stated, rows, effects=[pk.Coupling([(3, 2)])])
    assert cured.verdict.state == "calibrated", str(cured.verdict)
    assert cured.parameters["coupling3.2"]["value"] == pytest.approx(off, abs=2e-4)
