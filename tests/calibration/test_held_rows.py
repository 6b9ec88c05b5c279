"""Passive joints of machines with surplus actuators hold exactly, beside poses that are unknown."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import pkmcal as pk
from pkmcal.arrays import FloatArray
from pkmcal.kinematics import pose_steps

NOISE = 0.02  # mm, of legs and of the camera
TARGET = [30.0, -20.0, 50.0]
HEAD = 'name = "made"\nunits = { length = "mm", angle = "deg" }\n[pose]\nmap = "spatial"\n'
ANGLES = np.radians([90, 210, 330, 30])
AROUND = np.c_[np.cos(ANGLES), np.sin(ANGLES), np.zeros(4)]
TANGENT = np.c_[-np.sin(ANGLES), np.cos(ANGLES), np.zeros(4)]


def four_legs(folder: Path, weights: str = "") -> pk.Robot:
    """Three legs that keep to planes of the base, and a fourth that is free: 4 for 3 ways."""
    limbs = ""
    for i in range(4):
        plane = f"normal = {TANGENT[i].tolist()}\n{weights}\n" if i < 3 else ""
        limbs += (
            f'[[limb]]\nkind = "{"RPS" if i < 3 else "UPS"}"\nbase = {(300 * AROUND[i]).tolist()}\n'
            f"platform = {(200 * AROUND[i]).tolist()}\n{plane}"
        )
    path = folder / "four.toml"
    path.write_text(HEAD + 'home = { z = 500.0 }\nmatch = ["z", "alpha", "beta"]\n' + limbs)
    return pk.load(path)


class Drawn(NamedTuple):
    q: FloatArray
    read: FloatArray  # positions of the target, NaN where nobody looked
    true: pk.Robot


FREE = ("offset*", "base1.x", "base2.y", "platform3.y")


def drawn(robot: pk.Robot, seed: int, rows: int, noise: float = NOISE) -> Drawn:
    rng = np.random.default_rng(seed)
    geometry = robot.geometry
    errors = {name: geometry[name] + rng.normal(0, 0.5) for name in geometry.match(FREE)}
    true = robot.replace(errors)
    want = np.zeros((rows, 6))
    want[:, 2] = rng.uniform(420, 580, rows)
    want[:, 3:5] = rng.uniform(-0.3, 0.3, (rows, 2))
    pose = true.complete(want)
    turn = Rotation.from_euler("ZYX", pose[:, [5, 4, 3]])
    seen = pose[:, :3] + turn.apply(TARGET) + rng.normal(0, noise, (rows, 3))
    seen[rows // 3 :] = np.nan
    q = true.inverse(pose)
    return Drawn(q + rng.normal(0, noise, q.shape), seen, true)


def measured(data: Drawn, noise: float | None = NOISE) -> pk.Measurements:
    return pk.Measurements(
        data.q, data.read, "position", target=TARGET, sigma=noise, actuator_sigma=noise
    )


def dense(data: Drawn) -> tuple[FloatArray, FloatArray, float]:
    """Parameters, deviations and χ², all poses among the unknowns and planes 1e5 times as sure."""
    rows, has = len(data.q), np.isfinite(data.read)

    def parts(unknowns: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        base, platform = 300 * AROUND, 200 * AROUND
        base[0, 0], base[1, 1], platform[2, 1] = unknowns[4:7]
        own = unknowns[7:].reshape(rows, 6)
        turn = Rotation.from_rotvec(own[:, 3:])
        arms = np.einsum("nij,kj->nki", turn.as_matrix(), platform) + own[:, None, :3] - base
        legs = np.linalg.norm(arms, axis=2) - unknowns[:4]
        planes = np.einsum("nki,ki->nk", arms[:, :3], TANGENT[:3])
        return legs - data.q, planes, (own[:, :3] + turn.apply(TARGET) - data.read)[has]

    def residual(unknowns: FloatArray) -> FloatArray:
        legs, planes, seen = parts(unknowns)
        return np.concatenate([1e5 * planes.ravel(), legs.ravel(), seen]) / NOISE

    values = data.true.geometry
    start = [values[n] for n in (*(f"offset{i}" for i in range(1, 5)), *FREE[1:])]
    pose = data.true.forward(data.q).pose
    own = np.c_[pose[:, :3], Rotation.from_euler("ZYX", pose[:, [5, 4, 3]]).as_rotvec()]
    best = least_squares(
        residual, np.r_[start, own.ravel()], "3-point", x_scale="jac", xtol=1e-15, ftol=1e-15
    )
    assert np.abs(parts(best.x)[1]).max() < 1e-8
    deviation = np.linalg.norm(np.linalg.pinv(best.jac, rcond=1e-12)[:7], axis=1)
    return best.x[:7], deviation, 2.0 * best.cost


ORDER = ("offset1", "offset2", "offset3", "offset4", *FREE[1:])


@pytest.mark.parametrize("seed", [0, 1])
def test_planes_hold_while_everything_that_was_read_is_fitted(tmp_path: Path, seed: int) -> None:
    robot = four_legs(tmp_path)
    assert (pose_steps.surplus(robot), robot.machine.rows) == (1, 7)
    data = drawn(robot, seed, 24)
    found = pk.identify(robot, measured(data), ORDER)
    values, deviation, chi2 = dense(data)
    widened = found.fit.uncertainty.covariance.scale
    np.testing.assert_allclose((found.values - values) / deviation, 0.0, atol=1e-4)
    np.testing.assert_allclose(found.stderr, widened * deviation, rtol=1e-4)
    assert found.chi2_per_dof * found.dof == pytest.approx(chi2, rel=1e-6)
    assert found.dof == 24 * (4 - 3) + 3 * 8 - 7
    assert isinstance(found.robot, pk.Robot)
    off = pose_steps.readings(found.robot, found.fit.estimate.evaluation.pose, data.q)[0]
    assert np.abs(off[:, [1, 3, 5]]).max() < 1e-10  # of the planes, mm


def test_planes_that_are_weighed_give_way_like_the_legs(tmp_path: Path) -> None:
    """The heavier they are, the nearer to planes that hold."""
    data = drawn(four_legs(tmp_path), 0, 24)
    held = pk.identify(four_legs(tmp_path), measured(data), ORDER)
    apart = []
    for weight in (0.5, 5.0, 50.0):
        robot = four_legs(tmp_path, f"weights = [{weight}]")
        found = pk.identify(robot, measured(data), ORDER)
        assert found.dof == held.dof
        apart.append(np.abs((found.values - held.values) / held.stderr).max())
    assert apart[0] > 0.1 and apart[2] < 1e-2
    assert apart == sorted(apart, reverse=True)


@pytest.mark.parametrize("free", [ORDER, (*ORDER, "normal*", "gain2")])
def test_the_jacobian_of_what_is_left_is_that_of_differences(
    tmp_path: Path, free: tuple[str, ...]
) -> None:
    robot = four_legs(tmp_path)
    equations = pk.identify(robot, measured(drawn(robot, 2, 12)), free).fit.equations
    end = equations.start()
    ones, step = np.ones(2), 1e-3
    by_parameters = equations.by_parameters(end, ones)
    pull = 2.0 * by_parameters.T @ equations.residual(end, ones)
    for k in range(len(free)):
        costs = []
        for sign in (1.0, -1.0):
            theta = end.theta.copy()
            theta[k] += sign * step * equations.parameters.scale[k]
            costs.append((equations.residual(equations.at(theta), ones) ** 2).sum())
        slope = (costs[1] - costs[0]) / (2.0 * step * equations.parameters.scale[k])
        assert slope == pytest.approx(pull[k], rel=1e-4, abs=1e-4 * np.abs(pull).max())


def test_exact_lengths_and_positions_are_met_to_rounding(tmp_path: Path) -> None:
    robot = four_legs(tmp_path)
    data = drawn(robot, 4, 24, noise=0.0)
    found = pk.identify(robot, measured(data, None), ORDER)
    assert found.converged and found.evaluations < 60
    assert found.rms < 1e-8
    want = [data.true.geometry[name] for name in found.free]
    np.testing.assert_allclose(found.values, want, atol=1e-7)


def test_limbs_on_one_actuator_share_its_error(tmp_path: Path) -> None:
    """Two of five cables on one winch: how they differ holds, and its noise counts once."""
    anchors = np.array([
        [0, -1600, -120], [1550, 900, -120], [-1370, 790, -120], [0, 400, 2350], [0, -400, 2350.0],
    ])  # fmt: skip
    winch = [0, 1, 2, 3, 3]
    limbs = "".join(
        f'[[limb]]\nkind = "cable"\nbase = {anchor.tolist()}\nplatform = [0, 0, 0]\n'
        f"actuator = {a + 1}\n"
        for anchor, a in zip(anchors, winch, strict=True)
    )
    path = tmp_path / "winches.toml"
    head = HEAD.replace("spatial", "translation") + "home = { z = 500.0 }\n"
    path.write_text(head + '[calibration]\nfree = ["offset*"]\n' + limbs)
    robot = pk.load(path)
    assert pose_steps.surplus(robot) == 4 - 2  # it moves in a surface
    rng = np.random.default_rng(5)
    offset = rng.normal(0, 3, 5)

    def differ(at: FloatArray) -> FloatArray:
        both = np.linalg.norm(at[:, None] - anchors[3:], axis=2) - offset[3:]
        return np.asarray(both[:, 1] - both[:, 0])

    rows = 30
    at = np.c_[rng.uniform(-400, 400, rows), np.zeros(rows), rng.uniform(100, 900, rows)]
    for _ in range(30):  # along y to where both cables of the winch are taut
        step = np.array([0, 1e-3, 0])
        at[:, 1] -= differ(at) * 2e-3 / (differ(at + step) - differ(at - step))
    lengths = np.linalg.norm(at[:, None] - anchors, axis=2) - offset
    q = lengths[:, :4] + rng.normal(0, NOISE, (rows, 4))
    seen = at + rng.normal(0, NOISE, at.shape)
    found = pk.identify(robot, pk.Measurements(q, seen, sigma=NOISE, actuator_sigma=NOISE))
    assert found.dof == rows * (4 + 3 - 2) - 5

    def residual(unknowns: FloatArray) -> FloatArray:
        own = unknowns[5:].reshape(rows, 3)
        need = np.linalg.norm(own[:, None] - anchors, axis=2) - unknowns[:5]
        mean = np.c_[need[:, :3], need[:, 3:].mean(axis=1)]
        held = 1e5 * (need[:, 4] - need[:, 3])
        return np.concatenate([held, (mean - q).ravel(), (own - seen).ravel()]) / NOISE

    best = least_squares(
        residual, np.r_[offset, at.ravel()], "3-point", x_scale="jac", xtol=1e-15, ftol=1e-15
    )
    deviation = np.linalg.norm(np.linalg.pinv(best.jac, rcond=1e-12)[:5], axis=1)
    widened = found.fit.uncertainty.covariance.scale
    np.testing.assert_allclose((found.values - best.x[:5]) / deviation, 0.0, atol=1e-4)
    np.testing.assert_allclose(found.stderr, widened * deviation, rtol=1e-4)
