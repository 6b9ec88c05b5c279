"""No orientation is special: what is measured is a rotation, whatever triple of angles names it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pkmcal as pk
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.free_parameters import parameters
from pkmcal.estimation.parameters import Asked
from pkmcal.readings import orientation
from pkmcal.readings.registry import KINDS

from ..workspaces import WORKSPACE, poses

ANGLES = np.vstack([
    np.random.default_rng(0).uniform(-3, 3, (20, 3)),
    [[0.4, np.pi / 2, -1.0], [0.0, -np.pi / 2, 0.3], [np.pi, 0.0, np.pi]],
])  # fmt: skip
SIGMA = np.array([0.02, 0.02, 0.02, 1e-4, 1e-4, 1e-4])


def of(angles: np.ndarray) -> Rotation:
    return Rotation.from_euler("xyz", angles)


def other_triple(values: np.ndarray) -> np.ndarray:
    """The same orientations, named the other way."""
    out = values.copy()
    out[:, 3:] = np.stack([values[:, 3] + np.pi, np.pi - values[:, 4], values[:, 5] + np.pi], 1)
    return out


def test_orientations_differ_by_the_rotation_vector_between_them() -> None:
    vectors = np.random.default_rng(1).uniform(-1.7, 1.7, ANGLES.shape)
    measured = (Rotation.from_rotvec(vectors) * of(ANGLES)).as_euler("xyz")
    np.testing.assert_allclose(orientation.between(measured, ANGLES), vectors, atol=1e-7)
    back = orientation.turned(ANGLES, vectors)
    np.testing.assert_allclose(of(back).as_matrix(), of(measured).as_matrix(), atol=1e-7)
    same = orientation.shortest(ANGLES)
    np.testing.assert_allclose(of(same).as_matrix(), of(ANGLES).as_matrix(), atol=1e-7)
    assert (np.abs(same[:, 1]) <= np.pi / 2).all()


def test_a_difference_is_undone_by_correcting() -> None:
    rng = np.random.default_rng(2)
    values = rng.uniform(-3, 3, (30, 6))
    residual = rng.normal(0, 0.5, (30, 6))
    again = KINDS["pose"].difference(KINDS["pose"].corrected(values, residual), values)
    np.testing.assert_allclose(again, residual, atol=1e-9)


def test_rates_of_a_rotation_vector_are_its_differences() -> None:
    vectors, step = np.random.default_rng(3).uniform(-1.5, 1.5, (9, 3)), 1e-6
    rates = orientation.by_turning(vectors)
    for k, axis in enumerate(np.eye(3)):
        ends = [
            (Rotation.from_rotvec(vectors) * Rotation.from_rotvec(-s * axis)).as_rotvec()
            for s in (step, -step)
        ]
        np.testing.assert_allclose(-rates[:, :, k], (ends[0] - ends[1]) / (2 * step), atol=1e-8)


def test_covariances_of_angles_are_carried_to_rotation_vectors() -> None:
    rng = np.random.default_rng(4)
    angles = ANGLES[:1] * [1.0, 0.3, 1.0]
    root = 1e-4 * rng.normal(size=(6, 6))
    stated = (root @ root.T)[None]
    drawn = rng.multivariate_normal(np.zeros(6), stated[0], 200_000)
    vectors = (of(angles + drawn[:, 3:]) * of(angles[0]).inv()).as_rotvec()
    seen = np.cov(np.hstack([drawn[:, :3], vectors]).T)
    carried = orientation.covariance(stated, angles)[0]
    np.testing.assert_allclose(carried, seen, atol=0.02 * np.abs(seen).max())


def test_equal_deviations_are_the_same_about_every_axis_and_others_nearly_so() -> None:
    expected = np.diag(SIGMA**2)
    for change in (0.0, 1e-9):  # no step between equal deviations and others
        stated = np.tile(SIGMA * (1.0 + change * np.eye(6)[3]), (len(ANGLES), 1))
        carried = orientation.covariance(stated, ANGLES)
        np.testing.assert_allclose(carried, np.tile(expected, (len(ANGLES), 1, 1)), atol=1e-16)
    level = orientation.covariance(np.array([[1.0, 1, 1, 0.1, 0.2, 0.3]]), np.zeros((1, 3)))
    np.testing.assert_allclose(level[0], np.diag([1, 1, 1, 0.01, 0.04, 0.09]), atol=1e-15)


def test_a_covariance_that_knows_a_turning_exactly_is_refused() -> None:
    q = np.ones((1, 6))
    robot = pk.load("hexapod")
    measured = pk.Measurements(
        q, [[0, 0, 800, 0, np.pi / 2, 0]], "pose", sigma=np.diag(SIGMA**2)[None]
    )
    data = FitData(measured, np.arange(1), False, False)
    with pytest.raises(ValueError, match="row 0 says, so near to beta = 90 degrees"):
        Equations.of([data], parameters(robot, [data], Asked("offset*")))


@pytest.mark.parametrize("framed", [False, True], ids=["frame known", "frame unknown"])
@pytest.mark.parametrize("name", WORKSPACE)
def test_derivatives_of_residuals_are_their_differences(name: str, framed: bool) -> None:
    robot, rng = pk.load(name), np.random.default_rng(5)
    at = poses(name, 6, 5)
    values = KINDS["pose"].corrected(robot.complete(at), rng.normal(0, 0.4, (6, 6)))
    data = FitData(pk.Measurements(robot.inverse(at), values, "pose"), np.arange(6), framed, False)
    chosen = parameters(robot, [data], Asked("offset*"))
    equations = Equations.of([data], chosen)
    theta = chosen.start.copy()
    if framed:
        frame = chosen.nuisance["frame", ""]
        theta[frame : frame + 6] = [40, -20, 9, 0.4, np.pi / 2, 2.0]
    near = equations.at(theta).states.at_poses(np.arange(len(at)), at)
    (jacobian,) = equations.jacobian(equations.at(theta, near=near))
    for j, scale in enumerate(chosen.scale):
        step = np.eye(len(theta))[j] * 1e-4 * scale
        ends = [equations.at(theta + s * step, near=near).residuals[0] for s in (1, -1)]
        expected = (ends[1] - ends[0]) / 2e-4
        np.testing.assert_allclose(jacobian[:, :, j] * scale, expected, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("name", [*WORKSPACE, "3r"])
def test_the_same_rotations_give_the_same_calibration(name: str) -> None:
    robot = pk.load(name)
    if name == "3r":
        q, free = np.random.default_rng(0).uniform(-1.5, 1.5, (30, 3)), "joint*.dx"
    else:
        q, free = robot.inverse(robot.complete(pk.sample_poses(robot, 30))), "offset*"
    measured = pk.VirtualMachine(robot, 0.02, seed=1).measure(q, "pose")
    for sigma in (measured.sigma, None):
        stated = dataclasses.replace(measured, sigma=sigma)
        renamed = dataclasses.replace(stated, values=other_triple(measured.values))
        found, again = (pk.identify(robot, m, free) for m in (stated, renamed))
        assert again.warnings == found.warnings
        off = np.abs(again.values - found.values) / found.stderr
        assert off[np.isfinite(off)].max() < 1e-3
        assert again.rms == pytest.approx(found.rms, rel=1e-6)


@pytest.mark.parametrize("beta", [1.0, 1.4, np.pi / 2 - 1e-3, np.pi / 2])
def test_a_turned_tool_does_not_change_a_calibration(beta: float) -> None:
    rng, plain = np.random.default_rng(6), pk.load("hexapod")
    at = plain.home + rng.uniform(-1, 1, (40, 6)) * [80, 80, 80, 0.25, 0.25, 0.25]
    q, n = plain.inverse(at), len(plain.model.limbs)
    true = plain.replace({f"offset{i + 1}": 0.3 * rng.normal() for i in range(n)})
    noise = SIGMA * rng.normal(size=(40, 6))
    seen = KINDS["pose"].corrected(true.forward(q).pose, noise)
    tool = of(np.array([0.2, beta, -0.4]))
    values = seen.copy()
    turned_axes = orientation.rotations(seen[:, 3:]) @ tool.as_matrix()
    values[:, 3:] = orientation.turned(
        np.zeros((40, 3)), Rotation.from_matrix(turned_axes).as_rotvec()
    )
    frame = np.array([0.0, 0.0, 0.0, 0.2, beta, -0.4])
    turned = pk.Robot(dataclasses.replace(plain.model, tool_frame=frame))
    for sigma in (SIGMA, None):
        found = pk.identify(plain, pk.Measurements(q, seen, "pose", sigma=sigma), "offset*")
        again = pk.identify(turned, pk.Measurements(q, values, "pose", sigma=sigma), "offset*")
        np.testing.assert_allclose(again.values, found.values, atol=1e-5)
        np.testing.assert_allclose(again.stderr, found.stderr, rtol=1e-4)
