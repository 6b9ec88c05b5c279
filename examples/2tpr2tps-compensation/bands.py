"""What each reading of the 2TPR&2TPS paper's compensation removes, over 200 random machines.

Every machine has errors in all 28 parameters (0.5 mm, one standard deviation) and goes to 30 random
poses at zero orientation. In percent of the mean distance to the desired position; without noise
unless a line says so. The published figures are 98.148 % (simulation) and 87.457 % (experiment).

    python examples/2tpr2tps-compensation/bands.py [MACHINES]
"""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np
from experiment import NOISE, level_poses, with_errors, within_strokes

import pkmcal as pk

PUBLISHED = (98.148, 87.457)
Commanded = Callable[[np.ndarray], np.ndarray]


def readings(seed: int) -> dict[str, float]:
    """Percent of the error removed from machine number `seed`, by reading."""
    rng = np.random.default_rng(seed)
    robot = pk.load("2tpr2tps")
    true = with_errors(robot, rng)
    desired = level_poses(robot, rng)
    tilted = tilted_poses(robot, rng)
    tracker = pk.VirtualMachine(true, noise=NOISE, seed=seed)

    def pose(q: np.ndarray) -> np.ndarray:
        return true.forward(q).pose

    def position(q: np.ndarray) -> np.ndarray:
        return pose(q)[:, :3]

    def without_x(q: np.ndarray) -> np.ndarray:
        return position(q) * [0.0, 1.0, 1.0]

    def read(q: np.ndarray) -> np.ndarray:
        return tracker.measure(q).values

    def by(measured: Commanded, **how: object) -> float:
        found = pk.compensate(robot, desired, measured, **how)
        return gone(robot, pose, desired, found.actuators)

    def identified(poses: np.ndarray, check: np.ndarray) -> float:
        measured = tracker.measure(robot.inverse(poses))
        calibrated = pk.identify(robot, measured, prior=0.5).robot
        return gone(robot, pose, check, calibrated.inverse(check))

    return {
        "full pose, one pass": by(pose),
        "full pose, two passes": by(pose, passes=2),
        "full pose, three passes": by(pose, passes=3),
        "full pose, four passes": by(pose, passes=4),
        "orientation assumed": by(position, orientation="assumed"),
        "orientation assumed, x left out": by(without_x, orientation="assumed"),
        "beta from the position, one pass": by(position, orientation="from-position"),
        "beta from the position, two passes": by(position, orientation="from-position", passes=2),
        f"beta from the position, noise {NOISE} mm": by(read, orientation="from-position"),
        "one common offset": by(pose, common=True),
        f"identified there, noise {NOISE} mm": identified(desired, desired),
        f"identified tilted, noise {NOISE} mm, elsewhere": identified(
            tilted[:30], tilted[30:]
        ),
    }  # fmt: skip


def spatial_readings(seed: int) -> dict[str, float]:
    """The same of a machine whose joints are all modelled, so that x = z tan β does not hold."""
    rng = np.random.default_rng(seed)
    robot = pk.load("2tpr2tps-spatial")
    true = with_errors(robot, rng)
    desired = level_poses(robot, rng)

    def pose(q: np.ndarray) -> np.ndarray:
        return true.forward(q).pose

    def by(**how: object) -> float:
        found = pk.compensate(robot, desired, pose, passes=4, **how)
        return gone(robot, pose, desired, found.actuators)

    return {
        "spatial, six coordinates, four passes": by(),
        "spatial, position matched, four passes": by(match=("x", "y", "z", "alpha")),
    }


def gone(robot: pk.Robot, pose: Commanded, desired: np.ndarray, q: np.ndarray) -> float:
    """Percent of the mean distance to the desired position that commands `q` remove."""
    before, after = (
        np.linalg.norm((pose(commands) - desired)[:, :3], axis=1).mean()
        for commands in (robot.inverse(desired), q)
    )
    return float(100 * (1 - after / before))


def tilted_poses(robot: pk.Robot, rng: np.random.Generator, count: int = 130) -> np.ndarray:
    """Random poses with both tilts, x = z tan β, that keep the strokes."""
    y, z, alpha, beta = rng.uniform(
        [-80, 330, -0.35, -0.35], [80, 450, 0.35, 0.35], (20 * count, 4)
    ).T
    poses = np.stack([z * np.tan(beta), y, z, alpha, beta, 0 * y], axis=1)
    return within_strokes(robot, poses)[:count]


def bands(machines: int = 200) -> dict[str, np.ndarray]:
    """Percent removed by reading, one number a machine."""
    rows = [readings(seed) | spatial_readings(seed) for seed in range(machines)]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def table(found: dict[str, np.ndarray]) -> str:
    width = max(map(len, found))
    heads = ("least", "5 %", "median", "95 %", "most", *(f"above {p}" for p in PUBLISHED))
    lines = [f"{'':{width}}  " + "  ".join(f"{head:>12}" for head in heads)]
    for name, values in found.items():
        band = [f"{v:12.6f}" for v in np.percentile(values, [0, 5, 50, 95, 100])]
        above = [f"{100 * (values > p).mean():10.1f} %" for p in PUBLISHED]
        lines.append(f"{name:{width}}  " + "  ".join([*band, *above]))
    return "\n".join(lines)


if __name__ == "__main__":
    print(table(bands(int(sys.argv[1]) if len(sys.argv) > 1 else 200)))
