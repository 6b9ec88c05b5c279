"""Forward kinematics of a 6R arm with joint errors: pkmcal beside NumPy, MuJoCo and Pinocchio.

`python benchmarks/bench_serial.py` prints the ratios of one run on one core;
`pytest --benchmark-only benchmarks` times each alone.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk

sys.path.insert(0, str(Path(__file__).parents[1]))  # the engines' models are those of the tests

from tests.multibody import ENGINES

ROWS = 100_000
LOOPED = 2_000  # rows for what goes one by one
ROUNDS = 30
DH = {  # an industrial arm, mm
    "a": [312, 1075, 225, 0, 0, 0],
    "alpha": np.radians([-90, 0, -90, 90, -90, 0]),
    "d": [670, 0, 0, 1280, 0, 215],
    "theta": np.radians([0, -90, 0, 0, 0, 0]),
}


def arm_with_errors() -> tuple[pk.SerialArm, np.ndarray]:
    """A 6R arm, and the errors of its joints: distinct, signed, about 0.3 mm and 1 mrad."""
    errors = np.random.default_rng(0).normal(size=(6, 6)) * [0.3, 0.3, 0.3, 1e-3, 1e-3, 1e-3]
    return pk.SerialArm.from_dh(**DH), errors


def angles(rows: int) -> np.ndarray:
    """Random joint angles (rows, 6), rad."""
    return np.random.default_rng(1).uniform(-3, 3, (rows, 6))


def in_numpy(arm: pk.SerialArm, errors: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """The product of exponentials, vectorised over the rows by hand."""
    motions = arm.replace(errors).error_motions()
    generators = np.zeros((6, 4, 4))
    for generator, (x, y, z, *v) in zip(generators, arm.screws, strict=True):
        generator[:3] = np.array([[0, -z, y, v[0]], [z, 0, -x, v[1]], [-y, x, 0, v[2]]])
    squares = generators @ generators

    def forward(theta: np.ndarray) -> np.ndarray:
        sine, versine = np.sin(theta)[..., None, None], 1 - np.cos(theta)[..., None, None]
        total = np.eye(4)
        for i in range(6):
            joint = np.eye(4) + sine[:, i] * generators[i] + versine[:, i] * squares[i]
            total = total @ motions[i] @ joint
        return total @ arm.home

    return forward


def contestants() -> dict[str, tuple[Callable[[np.ndarray], np.ndarray], int]]:
    """What is timed, and on how many rows; engines that are not installed are left out."""
    arm, errors = arm_with_errors()
    found: dict[str, tuple[Callable[[np.ndarray], np.ndarray], int]] = {
        "pkmcal": (lambda theta: arm.forward(theta, errors, threads=1), ROWS),
        "NumPy, vectorised": (in_numpy(arm, errors), ROWS),
        "pkmcal, one row a call": (
            lambda theta: np.array([arm.forward(row, errors) for row in theta]), LOOPED,
        ),
    }  # fmt: skip
    for name, engine in ENGINES.items():
        try:
            found[f"{name}, Python loop"] = (engine(arm, errors), LOOPED)
        except pytest.skip.Exception:
            continue
    return found


@pytest.mark.parametrize("name", contestants())
def test_forward_of_a_6r_arm(benchmark: Callable[..., object], name: str) -> None:
    forward, rows = contestants()[name]
    benchmark(forward, angles(rows))


def main() -> None:
    """Time all in turn, many times over, and print the best processor time of each."""
    runs = {name: (call, angles(rows)) for name, (call, rows) in contestants().items()}
    arm, errors = arm_with_errors()
    for name, (forward, theta) in runs.items():
        assert np.abs(forward(theta) - arm.forward(theta, errors)).max() < 1e-11, name
    best = dict.fromkeys(runs, np.inf)
    for _ in range(ROUNDS):
        for name, (forward, theta) in runs.items():
            start = time.thread_time()
            forward(theta)
            best[name] = min(best[name], (time.thread_time() - start) / len(theta))
    for name, seconds in best.items():
        ratio = seconds / best["pkmcal"]
        print(f"{name:28} {seconds * 1e9:10.1f} ns a pose {1e-6 / seconds:8.2f} M/s  x {ratio:.1f}")


if __name__ == "__main__":
    main()
