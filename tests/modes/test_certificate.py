"""Certificates: what they prove is so, and what is not so they do not prove."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

import pkmcal as pk
from pkmcal.modes import certificate
from pkmcal.modes.find import frames_of

from .. import dietmaier

NAMES = [
    *("2tpr2tps", "2tpr2tps-spatial", "rbt-6t03p", "hexapod", "linear-delta", "rotary-delta"),
    *("6-rus", "3rps", "3prs", "3rrr-planar"),
]


def solved(name: str) -> tuple[certificate.Closures, np.ndarray]:
    """The closures of a machine near home, and (R, p/length) of the pose there (1, 12)."""
    robot = pk.load(name)
    q = robot.inverse(robot.home)
    q = q + np.random.default_rng(0).normal(size=q.shape) * (0.02 * np.abs(q) + 0.01)
    u = frames_of(robot.forward(q).pose[None])
    u[:, 9:] /= robot.length
    closures = robot.assembly_problem(q).closures()
    return closures, certificate.newton(closures, u, 2)


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_are_those_of_the_equations(name):
    closures, u = solved(name)
    turn = 1e-30 * np.eye(12)
    by_step = np.stack([closures(u + 1j * e)[0].imag / 1e-30 for e in turn], axis=-1)
    df = closures(u)[1]
    assert np.abs(df - by_step).max() <= 1e-14 * np.abs(df).max()


@pytest.mark.parametrize("name", NAMES)
def test_change_bounds_how_fast_derivatives_change(name):
    closures, u = solved(name)
    rng = np.random.default_rng(2)
    change = closures(u)[4]
    for _ in range(20):
        h = rng.choice([-1.0, 1.0], size=(1, 12))
        moved = np.abs(closures(u + h)[1] - closures(u)[1]).sum(axis=2)[0]
        assert (moved <= change * (1 + 1e-9) + 1e-6).all()


@pytest.mark.parametrize("name", NAMES)
def test_error_is_above_the_true_distance(name):
    closures, u = solved(name)
    rng = np.random.default_rng(3)
    assert certificate.certify(closures, u).ok.all()
    for size in 10.0 ** np.arange(-10, -1.5):
        moved = u + size * rng.uniform(-1, 1, u.shape)
        proof = certificate.certify(closures, moved)
        apart = closures.length * np.abs(moved - u).max()
        if proof.ok[0]:
            assert apart <= proof.error[0] <= proof.unique[0]
        else:
            assert size > 1e-5  # near enough a solution has to be certified
    assert not certificate.certify(closures, u + 1.0).ok.any()


def test_forty_digits_lie_within_the_error():
    """The modes of a delta by mpmath, from the doubles as they are."""
    robot = pk.load("linear-delta")
    q = robot.inverse(robot.home) + np.array([1.0, -2.0, 3.0])
    found = robot.forward_all(q)
    spheres = robot.machine.spheres(robot.slots, q[None])[0]
    with mpmath.workdps(40):
        limbs = [[mpmath.mpf(float(v)) for v in limb] for limb in spheres]

        def closures(*p: mpmath.mpf) -> list[mpmath.mpf]:
            return [sum((p[k] + g[k] - g[3 + k]) ** 2 for k in range(3)) - g[6] ** 2 for g in limbs]

        for pose, error in zip(found.poses, found.error, strict=True):
            exact = mpmath.findroot(closures, [mpmath.mpf(float(v)) for v in pose[:3]])
            off = max(abs(a - float(b)) for a, b in zip(exact, pose[:3], strict=True))
            assert off <= error <= 1e-8


def test_reflections_are_not_certified():
    """RᵀR = 1 holds for reflections too, and mirrored limbs close there."""
    robot = pk.load("hexapod")
    closures, u = solved("hexapod")
    mirrored = u.copy()
    mirrored[:, [6, 7, 8, 11]] *= -1.0  # z of everything: the base is in z = 0
    f, _, f_abs, _, _ = closures(mirrored)
    assert (np.abs(f) < 1e-12 * f_abs).all()
    assert not certificate.certify(closures, mirrored).ok.any()
    assert robot.length == closures.length


def test_a_singular_matrix_proves_nothing():
    closures, u = solved("hexapod")
    assert not certificate.certify(closures, np.zeros_like(u)).ok.any()
    assert not certificate.certify(closures, np.full_like(u, np.nan)).ok.any()


def test_complex_solutions_are_certified_like_real_ones():
    robot = dietmaier.hexapod()
    q = np.array(dietmaier.LENGTHS) * [1, 1.3, 1, 1, 1, 1]
    found = robot.forward_all(q)
    assert found.complete and len(found) < 40
    assert "certified" in found.reason


@pytest.mark.parametrize("name", NAMES)
def test_forward_kinematics_certifies_each_row_on_request(name):
    robot = pk.load(name)
    q = robot.inverse(robot.home)
    rows = q + np.random.default_rng(4).normal(size=(2, 3, len(q))) * (0.01 * np.abs(q) + 0.01)
    rows[1, 2] = np.nan
    found = robot.forward(rows)
    proof = found.certificate
    assert proof.ok.shape == proof.error.shape == (2, 3)
    assert (proof.ok == found.ok).all() and not proof.ok[1, 2]
    assert (proof.error[found.ok] < 1e-6).all()
    assert np.isnan(proof.error[1, 2]) and np.isnan(proof.unique[1, 2])
    modes_there = robot.forward_all(rows[0, 1])
    k = modes_there.nearest(found.pose[0, 1])
    assert abs(modes_there.unique[k] - proof.unique[0, 1]) < 1e-6


def test_least_squares_poses_are_not_certified():
    robot = pk.load("examples/2tpr2tps-eight-rows.toml")
    found = robot.forward(robot.inverse(robot.home))
    assert found.ok and not found.certificate.ok
