"""Anchors of a point from lengths alone: distances between true anchors, in closed form."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.distance import pdist
from scipy.spatial.transform import Rotation

import pkmcal as pk
from tests.robots import linear_delta, made


def machine(anchors: np.ndarray, **sections: Any) -> pk.Robot:
    flat = not anchors[:, 2].any()
    limbs = [{"kind": "cable", "base": a, "platform": [30.0, -20.0, 0.0]} for a in anchors]
    home = {"x": 100.0, "y": 50.0} | ({} if flat else {"z": 20.0})
    return made("xy" if flat else "translation", home, limbs, **sections)


def case(m: int, count: int, rows: int, seed: int) -> tuple[pk.Robot, np.ndarray]:
    """A machine with anchors anywhere, and places of its point."""
    rng = np.random.default_rng(seed)
    anchors, places = np.zeros((count, 3)), np.zeros((rows, 6))
    anchors[:, :m] = rng.uniform(-2000, 2000, (count, m))
    places[:, :m] = rng.uniform(-800, 800, (rows, m))
    return machine(anchors), places


def off(found: pk.Robot, true: pk.Robot) -> float:
    """How far distances between anchors are off."""
    return float(np.abs(pdist(found.slots[:, :3]) - pdist(true.slots[:, :3])).max())


@pytest.mark.parametrize(("m", "count", "rows"), [(2, 3, 6), (2, 5, 12), (3, 4, 10), (3, 5, 30)])
def test_exact_lengths_have_their_anchors_wherever_these_stand(
    m: int, count: int, rows: int
) -> None:
    """Nearly in a plane as well: what is small beside the rest is no noise without noise."""
    for seed in range(40):
        true, places = case(m, count, rows, seed)
        rng = np.random.default_rng(seed + 100)
        stated = [n for n in true.geometry.match("base*") if m == 3 or not n.endswith("z")]
        file = true.replace({n: true.geometry[n] + rng.normal(0, 150) for n in stated})
        assert off(pk.locate_anchors(file, true.inverse(places)).robot, true) < 1e-3, seed


@pytest.mark.parametrize("count", [4, 6])
def test_misfit_says_before_any_fit_that_a_constant_is_missing(count: int) -> None:
    """With one anchor more than dimensions too, where the pattern alone always fits."""
    good, wrong = [], []
    for seed in range(20):
        true, places = case(3, count, 40, seed)
        q = true.inverse(places) + np.random.default_rng(seed).normal(0, 0.3, (40, count))
        good.append(pk.locate_anchors(true, q).misfit)
        wrong.append(pk.locate_anchors(true, q + 150.0).misfit)
    assert 0.0 < np.median(good) < 3e-3 and np.median(wrong) > 5e-3
    assert (np.array(wrong) > 2 * np.array(good)).mean() > 0.75


def test_as_few_rows_as_needed_say_nothing_of_the_misfit() -> None:
    true, places = case(2, 3, 6, 0)
    assert np.isnan(pk.locate_anchors(true, true.inverse(places)).misfit)


@pytest.mark.parametrize(("m", "count"), [(2, 3), (2, 5), (3, 4), (3, 6)])
def test_how_much_better_anchors_lie_as_they_are_than_mirrored(m: int, count: int) -> None:
    """Rms distances of the file's anchors from the true ones and from their mirror image."""
    for seed in range(5):
        true, places = case(m, count, 30, seed)
        names = [f"base{i + 1}.{axis}" for i in range(count) for axis in "xyz"[:m]]
        change = np.random.default_rng(seed + 100).normal(0, 300, len(names))
        file = true.replace({n: true.geometry[n] + c for n, c in zip(names, change, strict=True)})
        on, anchors = (robot.slots[:, :m] for robot in (file, true))
        on, anchors = on - on.mean(axis=0), anchors - anchors.mean(axis=0)
        rms = []
        for sign in (1.0, -1.0):
            mirrored = anchors * [sign, *[1.0] * (m - 1)]
            if m == 2:  # by the angle of the best rotation of the plane
                z, w = (p[:, 0] + 1j * p[:, 1] for p in (mirrored, on))
                turn = np.exp(1j * np.angle(np.vdot(z, w)))
                rms.append(np.linalg.norm(turn * z - w))
            else:
                rms.append(Rotation.align_vectors(on, mirrored)[1])
        found = pk.locate_anchors(file, true.inverse(places))
        assert found.mirrored == pytest.approx(max(rms) / min(rms), rel=1e-3)


def test_what_noise_hides_of_the_gram_matrix_is_as_large_as_noise() -> None:
    """Places that are nearly in a plane: an eigenvalue is below its deviation, or negative.

    The map x = G u is told by the lengths to the first anchor, linearly in M = GᵀG; anchors about
    the first are orthonormal columns times the inverse of G. So their singular values are one over
    the roots of the eigenvalues, or of these eigenvalues' deviations where those are larger.
    """
    hidden = 0
    for seed in range(6):
        true, places = case(3, 6, 40, seed)
        places[:, 2] *= 0.01
        q = true.inverse(places) + np.random.default_rng(seed).normal(0, 3.0, (40, 6))
        squares = q**2
        pattern = (squares[:1] + squares[:, :1] - squares - squares[0, 0])[:, 1:] / 2
        left, size, _ = np.linalg.svd(pattern, full_matrices=False)
        u = left[1:, :3] * size[:3] / size[0]
        table = np.array([[*np.outer(row, row).ravel(), *row] for row in u])
        target = squares[1:, 0] - squares[0, 0]
        inverse = np.linalg.pinv(table, rcond=1e-12)  # of least norm, so that M is symmetric

        def eigenvalues(target: np.ndarray, inverse: np.ndarray = inverse) -> np.ndarray:
            return np.linalg.eigvalsh((inverse @ target)[:9].reshape(3, 3))

        missed = target - table @ inverse @ target
        slopes = [(eigenvalues(target + e) - eigenvalues(target - e)) / 2 for e in np.eye(39)]
        deviation = np.sqrt(missed @ missed / (39 - 9)) * np.linalg.norm(slopes, axis=0)
        values = eigenvalues(target)
        hidden += int((values < deviation).sum())
        base = pk.locate_anchors(true, q).robot.slots[:, :3]
        found = np.linalg.svd(base[1:] - base[0], compute_uv=False)
        wanted = size[0] / np.sqrt(np.sort(np.maximum(values, deviation)))
        np.testing.assert_allclose(found, wanted, rtol=1e-3)
    assert hidden >= 2


def test_poses_are_in_the_frames_of_the_file() -> None:
    anchors = np.array([[0.0, -1597, -120], [1550, 900, -120], [-1370, 790, -60], [0, 0, 2355]])
    turned = machine(anchors, frames={"base": {"x": 100.0, "alpha": 0.4, "gamma": 0.7}})
    own = np.zeros((20, 6))
    own[:, :3] = np.random.default_rng(0).uniform(-500, 500, (20, 3))
    poses = turned.frames.outward(own)
    found = pk.locate_anchors(turned, turned.inverse(poses))
    np.testing.assert_allclose(found.poses[:, :3], poses[:, :3], atol=1e-6)


def test_rows_with_nothing_read_are_refused() -> None:
    true, places = case(3, 5, 12, 1)
    q = true.inverse(places)
    q[3, 2] = np.nan
    with pytest.raises(ValueError, match=r"actuators: must be finite, found .* in row 3"):
        pk.locate_anchors(true, q)


def test_lengths_that_fall_where_they_should_grow_are_no_anchors() -> None:
    """c² less the squared distance: as regular as distances, and of no point."""
    true, places = case(3, 5, 12, 1)
    squares = true.inverse(places) ** 2
    with pytest.raises(ValueError, match="lengths that no anchors have; check offsets"):
        pk.locate_anchors(true, np.sqrt(2.0 * squares.max() - squares))


@pytest.mark.parametrize("name", ["linear-delta", "hexapod"])
def test_a_machine_that_is_no_point_on_limbs_of_variable_length_is_refused(name: str) -> None:
    robot = linear_delta() if name == "linear-delta" else pk.load(name)
    q = np.tile(robot.inverse(robot.home), (20, 1))
    with pytest.raises(ValueError, match="is no point on limbs of variable length"):
        pk.locate_anchors(robot, q)
