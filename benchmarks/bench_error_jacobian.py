"""The error Jacobian of 100 000 poses against central differences on NumPy models, one thread.

    python benchmarks/bench_error_jacobian.py     ratios, everything in one run
    pytest --benchmark-only benchmarks            the parts by pytest-benchmark

Two NumPy models of the 2TPR&2TPS with its 28 errors: one that solves a pose after the other, as
anyone would write it first, and one that solves all poses of a batch together. Both differentiate
by solving twice for each error. All three agree, which is checked first.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

import pkmcal as pk

Array = np.ndarray
POSES = 100_000
BATCHED, LOOPED = 2_000, 20  # poses of the slow ways; their times are linear in these
STEP = 1e-3  # mm

ROBOT = pk.load("2tpr2tps")
NAMES = ROBOT.model.free
COLUMNS = [ROBOT.geometry.names.index(name) for name in NAMES]


def poses(count: int) -> Array:
    """Poses in the workspace, (count, 6)."""
    rng = np.random.default_rng(0)
    y, z = rng.uniform(-60, 60, count), rng.uniform(350, 430, count)
    alpha, beta = rng.uniform(-0.3, 0.3, (2, count))
    return np.stack([z * np.tan(beta), y, z, alpha, beta, 0 * y], axis=1)


def joints() -> tuple[Array, Array, Array]:
    """Base (4, 3), platform (4, 3) and zero lengths (4,)."""
    geometry = ROBOT.geometry
    base, platform = (
        np.array([[geometry[f"{joint}{i}.{axis}"] for axis in "xyz"] for i in range(1, 5)])
        for joint in ("base", "platform")
    )
    return base, platform, np.array([geometry[f"offset{i}"] for i in range(1, 5)])


def legs(free: Array, base: Array, platform: Array) -> tuple[Array, Array]:
    """Leg lengths (N, 4) and their derivatives by y z alpha beta (N, 4, 4)."""
    y, z, alpha, beta = free.T
    sa, ca, sb, cb = np.sin(alpha), np.cos(alpha), np.sin(beta), np.cos(beta)
    zero, one = np.zeros_like(y), np.ones_like(y)
    turn = np.stack([cb, sb * sa, sb * ca, zero, ca, -sa, -sb, cb * sa, cb * ca], axis=-1).reshape(
        -1, 3, 3
    )
    by_alpha = np.stack(
        [zero, sb * ca, -sb * sa, zero, -sa, -ca, zero, cb * ca, -cb * sa], axis=-1
    ).reshape(-1, 3, 3)
    by_beta = np.stack(
        [-sb, cb * sa, cb * ca, zero, zero, zero, -cb, -sb * sa, -sb * ca], axis=-1
    ).reshape(-1, 3, 3)
    position = np.stack([z * sb / cb, y, z], axis=-1)
    d = position[:, None] + platform @ turn.swapaxes(1, 2) - base
    length = np.sqrt((d**2).sum(axis=-1))
    rates = np.stack(
        [
            np.broadcast_to(np.stack([zero, one, zero], axis=-1)[:, None], d.shape),
            np.broadcast_to(np.stack([sb / cb, zero, one], axis=-1)[:, None], d.shape),
            platform @ by_alpha.swapaxes(1, 2),
            platform @ by_beta.swapaxes(1, 2) + np.stack([z / cb**2, zero, zero], axis=-1)[:, None],
        ],
        axis=-1,
    )
    return length, np.einsum("nij,nijk->nik", d / length[..., None], rates)


def forward(q: Array, start: Array, base: Array, platform: Array, offset: Array) -> Array:
    """Poses (N, 6) by Newton's method in three steps, which is enough this near."""
    free = start[:, 1:5].copy()
    for _ in range(3):
        length, by_free = legs(free, base, platform)
        free -= np.linalg.solve(by_free, (length - offset - q)[..., None])[..., 0]
    y, z, alpha, beta = free.T
    return np.stack([z * np.tan(beta), y, z, alpha, beta, 0 * y], axis=1)


def by_differences(at: Array) -> Array:
    """d pose / d errors (N, 6, 28), all poses together."""
    base, platform, offset = joints()
    q = legs(at[:, 1:5], base, platform)[0] - offset
    columns = []
    for part in (base, platform, offset):
        for place in np.ndindex(part.shape):
            kept = part[place]
            part[place] = kept + STEP
            ahead = forward(q, at, base, platform, offset)
            part[place] = kept - STEP
            columns.append((ahead - forward(q, at, base, platform, offset)) / (2 * STEP))
            part[place] = kept
    return np.stack(columns, axis=-1)


def one_by_one(at: Array) -> Array:
    """The same, a pose after the other."""
    return np.concatenate([by_differences(pose[None]) for pose in at])


def compiled(at: Array) -> Array:
    """The same by the package: all 32 numbers of the geometry."""
    return ROBOT.error_jacobian(at)


def test_all_three_agree() -> None:
    at = poses(LOOPED)
    own = compiled(at)[..., COLUMNS]
    np.testing.assert_allclose(by_differences(at), own, atol=1e-6)
    np.testing.assert_allclose(one_by_one(at), own, atol=1e-6)


def test_compiled(benchmark: Any) -> None:
    benchmark(compiled, poses(POSES))


def test_numpy_batched(benchmark: Any) -> None:
    benchmark.pedantic(by_differences, (poses(BATCHED),), rounds=3)


def test_numpy_one_by_one(benchmark: Any) -> None:
    benchmark.pedantic(one_by_one, (poses(LOOPED),), rounds=3)


def test_at_least_200_times_as_fast_as_central_differences() -> None:
    assert min(ratios(rounds=3)) >= 200


def ratios(rounds: int = 7) -> tuple[float, float]:
    """How many times as long batched and looped NumPy take for a pose."""
    at = poses(POSES)
    own = least(lambda: compiled(at), rounds) / POSES
    batched = least(lambda: by_differences(at[:BATCHED]), 3) / BATCHED
    looped = least(lambda: one_by_one(at[:LOOPED]), 3) / LOOPED
    own = min(own, least(lambda: compiled(at), rounds) / POSES)
    print(f"error Jacobian of {ROBOT.name}, {POSES} poses: {1e9 * own:.0f} ns a pose")
    print(f"  central differences, NumPy, all poses together {1e6 * batched:8.1f} us a pose"
          f" {batched / own:8.0f} x")  # fmt: skip
    print(f"  central differences, NumPy, pose by pose       {1e6 * looped:8.1f} us a pose"
          f" {looped / own:8.0f} x")  # fmt: skip
    return batched / own, looped / own


def least(call: Callable[[], object], rounds: int) -> float:
    """Seconds of the fastest run."""
    times = []
    for _ in range(rounds):
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return min(times)


if __name__ == "__main__":
    test_all_three_agree()
    ratios()
