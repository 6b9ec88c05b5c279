"""Monte Carlo of a toleranced machine against the same loop over scipy.optimize.root.

    python benchmarks/bench_tolerance.py          ratios, everything in one run
    pytest --benchmark-only benchmarks            the parts by pytest-benchmark
    python benchmarks/bench_tolerance.py --against CHECKOUT    its core built in place

The loop draws the 28 errors of the 2TPR&2TPS, solves its four leg lengths for y z alpha beta, and
keeps the pose error. Its closures come three ways: from the pose by R = Rz Ry Rx, as for any
machine; written out for this machine; and with their derivatives written out as well. The package
runs on one core, and on two by threads.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import pytest
from scipy.optimize import root

import pkmcal as pk

Array = np.ndarray
HERE = Path(__file__).resolve().parents[1]
SAMPLES = 1_000_000
LOOPED = 2_000  # samples of the loop
SIGMA = 0.1  # mm

ROBOT = pk.load("2tpr2tps")
SLOTS = ROBOT.geometry.slots
BASE, PLATFORM, OFFSET = SLOTS[:, 0:3], SLOTS[:, 3:6], SLOTS[:, 6]
LENGTHS = ROBOT.inverse(ROBOT.home)


def monte_carlo(samples: int = SAMPLES, threads: int = 1) -> pk.Tolerance:
    """By the package."""
    if threads == 1:
        return pk.tolerance(ROBOT, ROBOT.home, SIGMA, samples=samples)
    with ThreadPoolExecutor(threads) as executor:
        return pk.tolerance(ROBOT, ROBOT.home, SIGMA, samples=samples, executor=executor)


def rotation(pose: Array) -> Array:
    (ca, cb, cg), (sa, sb, sg) = np.cos(pose[3:]), np.sin(pose[3:])
    rx = np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]])
    ry = np.array([[cb, 0, sb], [0, 1, 0], [-sb, 0, cb]])
    rz = np.array([[cg, -sg, 0], [sg, cg, 0], [0, 0, 1]])
    return rz @ ry @ rx


def closures_of_limbs(free: Array, base: Array, platform: Array, lengths: Array) -> Array:
    y, z, alpha, beta = free
    pose = np.array([z * np.tan(beta), y, z, alpha, beta, 0.0])
    d = pose[:3] + platform @ rotation(pose).T - base
    return np.linalg.norm(d, axis=1) - lengths


def closures(free: Array, base: Array, platform: Array, lengths: Array) -> Array:
    y, z, alpha, beta = free
    sa, ca, sb, cb = np.sin(alpha), np.cos(alpha), np.sin(beta), np.cos(beta)
    turn = np.array([[cb, sb * sa, sb * ca], [0.0, ca, -sa], [-sb, cb * sa, cb * ca]])
    d = platform @ turn.T + (z * sb / cb, y, z) - base
    return np.sqrt((d * d).sum(axis=1)) - lengths


def derivatives(free: Array, base: Array, platform: Array, lengths: Array) -> Array:
    y, z, alpha, beta = free
    sa, ca, sb, cb = np.sin(alpha), np.cos(alpha), np.sin(beta), np.cos(beta)
    turn = np.array([[cb, sb * sa, sb * ca], [0.0, ca, -sa], [-sb, cb * sa, cb * ca]])
    by_alpha = np.array([[0.0, sb * ca, -sb * sa], [0.0, -sa, -ca], [0.0, cb * ca, -cb * sa]])
    by_beta = np.array([[-sb, cb * sa, cb * ca], [0.0, 0.0, 0.0], [-cb, -sb * sa, -sb * ca]])
    d = platform @ turn.T + (z * sb / cb, y, z) - base
    u = d / np.sqrt((d * d).sum(axis=1))[:, None]
    return np.stack(
        [
            u[:, 1],
            u[:, 0] * (sb / cb) + u[:, 2],
            (u * (platform @ by_alpha.T)).sum(axis=1),
            (u * (platform @ by_beta.T + (z / cb**2, 0.0, 0.0))).sum(axis=1),
        ],
        axis=1,
    )


WAYS: dict[str, tuple[Callable[..., Array], Callable[..., Array] | None]] = {
    "of any limbs": (closures_of_limbs, None),
    "written out": (closures, None),
    "and derivatives": (closures, derivatives),
}


def loop(samples: int, way: str) -> tuple[Array, Array]:
    """Mean and standard deviation of the pose error, (6,), solving one machine after the other."""
    function, jacobian = WAYS[way]
    random = np.random.default_rng(0)
    start = ROBOT.home[1:5]
    errors = np.empty((samples, 6))
    for i in range(samples):
        base = BASE + SIGMA * random.standard_normal((4, 3))
        platform = PLATFORM + SIGMA * random.standard_normal((4, 3))
        lengths = LENGTHS + OFFSET + SIGMA * random.standard_normal(4)
        y, z, alpha, beta = root(function, start, (base, platform, lengths), jac=jacobian).x
        errors[i] = (z * np.tan(beta), y, z, alpha, beta, 0.0)
    errors -= ROBOT.home
    return errors.mean(axis=0), errors.std(axis=0, ddof=1)


@pytest.mark.parametrize("way", WAYS)
def test_both_find_the_same_spread(way: str) -> None:
    own, (_, spread) = monte_carlo(100_000), loop(LOOPED, way)
    np.testing.assert_allclose(spread[:5], own.std[:5], rtol=5 / np.sqrt(2 * LOOPED))


@pytest.mark.parametrize("threads", [1, 2])
def test_monte_carlo(benchmark: Any, threads: int) -> None:
    benchmark.pedantic(monte_carlo, (SAMPLES, threads), rounds=3)


@pytest.mark.parametrize("way", WAYS)
def test_loop_over_root(benchmark: Any, way: str) -> None:
    benchmark.pedantic(loop, (LOOPED, way), rounds=3)


def ratios(rounds: int = 5) -> dict[str, float]:
    """How many times as long the loops take for a machine as the package, in processor time."""
    own: list[float] = []
    loops: dict[str, list[float]] = {way: [] for way in WAYS}
    for _ in range(rounds):  # each once a round, so that all see the same machine
        own.append(processor_seconds(monte_carlo) / SAMPLES)
        for way, times in loops.items():
            times.append(processor_seconds(lambda way=way: loop(LOOPED, way)) / LOOPED)
    elapsed = []
    for threads in (1, 2):
        begin = time.perf_counter()
        monte_carlo(threads=threads)
        elapsed.append(time.perf_counter() - begin)
    print(f"Monte Carlo of {ROBOT.name}, {SAMPLES} machines: {SAMPLES * median(own):.2f} s of the"
          f" processor; by the clock {elapsed[0]:.2f} s on one core, {elapsed[1]:.2f} s by two"
          " threads")  # fmt: skip
    found = {way: median(times) / median(own) for way, times in loops.items()}
    for way, times in loops.items():
        print(f"  loop over scipy.optimize.root, closures {way:15} {1e6 * median(times):7.1f} us a"
              f" machine {found[way]:5.0f} x")  # fmt: skip
    return found


MANY_POSES = """
import time, pkmcal as pk
robot = pk.load({name!r})
poses = pk.sample_poses(robot, 30, seed=1)
pk.tolerance(robot, poses, {sigma}, samples=100)
begin = time.process_time()
pk.tolerance(robot, poses, {sigma}, samples=65536)
print(time.process_time() - begin)
"""


def against(checkout: Path, rounds: int = 7) -> dict[str, float]:
    """Processor time over that of another checkout, processes in turn, medians."""
    found = {}
    for name in ("hexapod", "2tpr2tps", "linear-delta", "3rps"):
        ratios = []
        for _ in range(rounds):
            took = []
            for tree in (HERE, checkout):
                command = [sys.executable, "-c", MANY_POSES.format(name=name, sigma=SIGMA)]
                place = {**os.environ, "PYTHONPATH": str(tree)}
                took.append(float(subprocess.check_output(command, env=place, cwd=tree)))
            ratios.append(took[0] / took[1])
        found[name] = median(ratios)
        print(f"Monte Carlo of {name}, 65536 machines at 30 poses: {found[name]:.2f} of the other's"
              f" time ({min(ratios):.2f} to {max(ratios):.2f})")  # fmt: skip
    return found


def processor_seconds(call: Callable[[], object]) -> float:
    """Of this process, whatever else the machine does."""
    begin = time.process_time()
    call()
    return time.process_time() - begin


if __name__ == "__main__":
    if sys.argv[1:2] == ["--against"]:
        against(Path(sys.argv[2]).resolve())
    else:
        for each in WAYS:
            test_both_find_the_same_spread(each)
        ratios()
