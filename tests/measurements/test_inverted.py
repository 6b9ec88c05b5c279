"""Poses that were measured from the platform are turned round."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.measurements.inverted import inverted

SIGMA = [0.02, 0.03, 0.04, 1e-4, 2e-4, 3e-4]


def poses(robot: pk.Robot, rows: int = 30) -> tuple[np.ndarray, np.ndarray]:
    q = robot.inverse(pk.sample_poses(robot, rows, seed=2))
    return q, robot.forward(q).pose


def test_a_pose_and_what_is_turned_round_are_inverse(hexapod: pk.Robot) -> None:
    q, seen = poses(hexapod)
    for kind, values in (("pose", seen), ("orientation", seen[:, 3:])):
        given = pk.Measurements(q, values, kind)
        whole = np.zeros((2, len(q), 6))
        whole[:, :, 6 - values.shape[1] :] = values, inverted(given).values
        together = pk.screw.from_pose(whole[0]) @ pk.screw.from_pose(whole[1])
        np.testing.assert_allclose(together, np.tile(np.eye(4), (len(q), 1, 1)), atol=1e-9)
        np.testing.assert_allclose(inverted(inverted(given)).values, values, atol=1e-9)


def test_a_sigma_is_turned_round_as_draws_are(hexapod: pk.Robot) -> None:
    q, seen = poses(hexapod, 1)
    rng = np.random.default_rng(0)
    draws = seen + rng.normal(size=(40000, 6)) * SIGMA
    many = inverted(pk.Measurements(np.tile(q, (40000, 1)), draws, "pose")).values
    sigma = inverted(pk.Measurements(q, seen, "pose", sigma=SIGMA)).sigma
    assert sigma is not None
    scale = np.sqrt(np.diag(sigma[0]))
    np.testing.assert_allclose(
        np.cov(many.T) / np.outer(scale, scale), sigma[0] / np.outer(scale, scale), atol=0.03
    )


def test_a_row_that_was_not_read_in_full_is_unknown(hexapod: pk.Robot) -> None:
    q, seen = poses(hexapod)
    seen[3, 3:] = np.nan
    turned = inverted(pk.Measurements(q, seen, "pose", sigma=SIGMA))
    assert (
        np.isnan(turned.values[3]).all() and np.isfinite(np.delete(turned.values, 3, axis=0)).all()
    )


def test_positions_cannot_be_turned_round(hexapod: pk.Robot) -> None:
    q, seen = poses(hexapod)
    with pytest.raises(ValueError, match="invert_poses: values of kind 'position' have no orient"):
        inverted(pk.Measurements(q, seen[:, :3], "position"))


@pytest.mark.parametrize("headings", [("alpha", "beta", "gamma"), ("Rx", "Ry", "Rz")])
def test_a_file_of_poses_from_the_platform_is_read(
    hexapod: pk.Robot, tmp_path: Path, headings: tuple[str, ...]
) -> None:
    """In columns that say how they are turned, and in others whose order has to be stated."""
    q, seen = poses(hexapod)
    other = inverted(pk.Measurements(q, seen, "pose")).values
    path = tmp_path / "camera.csv"
    names = [f"q{i} [mm]" for i in range(1, 7)] + [f"{axis} [mm]" for axis in "xyz"]
    table = np.hstack([q, other])
    np.savetxt(
        path,
        table,
        delimiter=",",
        header=",".join([*names, *(f"{h} [rad]" for h in headings)]),
        comments="",
    )
    order = None if headings[0] == "alpha" else "xyz"
    read = pk.read_measurements(path, hexapod, rotation=order, invert_poses=True)
    np.testing.assert_allclose(read.values, seen, atol=1e-8)
    if order is not None:
        with pytest.raises(ValueError, match="--invert-poses"):
            pk.read_measurements(path, hexapod, rotation=order)
