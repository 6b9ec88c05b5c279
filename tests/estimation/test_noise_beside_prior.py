"""A prior adds knowledge: noise that is estimated without it is estimated with it, too."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk

pytestmark = pytest.mark.filterwarnings("ignore::pkmcal.CalibrationWarning")


def suspended(folder: Path, rng: np.random.Generator) -> pk.Robot:
    """A point on four cables, one more than its coordinates: closures show the actuators' noise."""
    around = 2.0 * np.pi * np.arange(3) / 3 + rng.uniform(-0.3, 0.3, 3)
    anchors = np.column_stack([1500 * np.cos(around), 1500 * np.sin(around), np.full(3, -100.0)])
    anchors = np.vstack([anchors, [0.0, 0.0, 2300.0]]) + rng.uniform(-80.0, 80.0, (4, 3))
    limbs = "".join(
        f'[[limb]]\nkind = "cable"\nbase = {anchor.tolist()}\nplatform = [0, 0, 0]\n'
        for anchor in anchors
    )
    path = folder / "suspended.toml"
    path.write_text(
        'name = "suspended"\nunits = { length = "mm", angle = "deg" }\n'
        '[pose]\nmap = "translation"\nhome = { z = 500 }\n'
        '[calibration]\nfree = ["base*", "offset*"]\n' + limbs
    )
    return pk.load(path)


@pytest.mark.parametrize("seed", range(4))
def test_deviations_are_finite_and_no_larger_than_without_the_prior(
    tmp_path: Path, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    robot = suspended(tmp_path, rng)
    names = [name for name in robot.geometry.names if name.startswith(("base", "offset"))]
    true = robot.replace({name: robot.geometry[name] + rng.normal(0.0, 3.0) for name in names})
    poses = np.zeros((9, 6))
    poses[:, :3] = rng.uniform([-350, -350, 100], [350, 350, 900], (9, 3))
    q = true.inverse(poses) + rng.normal(0.0, 0.7, (9, 4))
    measured = pk.Measurements(q, poses[:, :3] + rng.normal(0.0, 0.02, (9, 3)), "position")
    alone = pk.identify(robot, measured)
    assert np.isfinite([*alone.noise, alone.actuator_noise]).all()
    known = pk.identify(robot, measured, prior={f"offset{i}": 3.0 for i in range(1, 5)})
    assert np.isfinite([*known.noise, known.actuator_noise]).all()
    assert np.isfinite(known.stderr).all()
    assert known.stderr.max() < alone.stderr.max()
    truth = np.array([true.geometry[name] for name in known.free])
    assert (np.abs(known.values - truth) < 4.5 * known.stderr).all()
