"""Where each built-in machine works: boxes of poses, and random poses in them.

Every pose of a box is within strokes and cones where the robot file states them, and forward() from
the home pose finds it again.
"""

from __future__ import annotations

import numpy as np

from pkmcal.geometry import robot_file

# Machines whose limbs are chains of joints: tests/kinematics/test_chains.py and tests/checks hold
# their laws, where others are of spheres.
CHAINS = tuple(name for name in robot_file.builtin_names() if robot_file.read(name).chains)

# Half widths of the box about the home pose: x y z in mm, alpha beta gamma in rad. A coordinate
# that the machine does not move, or that follows from the others, has 0. rbt-6t03p-printed has no
# workspace: it is singular in every pose.
WORKSPACE: dict[str, tuple[float, float, float, float, float, float]] = {
    "2tpr2tps": (0.0, 20.0, 20.0, 0.12, 0.12, 0.0),
    "2tpr2tps-spatial": (0.0, 20.0, 20.0, 0.12, 0.12, 0.0),
    "3rps": (0.0, 0.0, 250.0, 0.5, 0.5, 0.0),
    "3prs": (0.0, 0.0, 60.0, 0.35, 0.35, 0.0),
    "3rrr-planar": (20.0, 20.0, 0.0, 0.0, 0.0, 0.2),
    "6-rus": (20.0, 20.0, 20.0, 0.15, 0.15, 0.15),
    "hexapod": (100.0, 100.0, 100.0, 0.3, 0.3, 0.3),
    "linear-delta": (60.0, 60.0, 80.0, 0.0, 0.0, 0.0),
    "linear-delta-6": (60.0, 60.0, 80.0, 0.0, 0.0, 0.0),
    "rbt-6t03p": (20.0, 20.0, 20.0, 0.15, 0.15, 0.15),
    "rotary-delta": (500.0, 500.0, 150.0, 0.0, 0.0, 0.0),
}


def poses(name: str, count: int, seed: int = 0) -> np.ndarray:
    """Random poses (count, 6) in the box, which the machine reaches with its nominal geometry."""
    spread = np.random.default_rng(seed).uniform(-1.0, 1.0, (count, 6))
    found = robot_file.read(name).home + spread * WORKSPACE[name]
    if name in ("2tpr2tps", "2tpr2tps-spatial"):
        found[:, 0] = found[:, 2] * np.tan(found[:, 4])
    if name in ("3rps", "3prs"):
        follow_planes(found, robot_file.read(name).geometry["platform1.x"])
    return found


def follow_planes(poses: np.ndarray, radius: float) -> None:
    """Set x, y and gamma of a 3-RPS's or 3-PRS's poses (N, 6) to what z, alpha and beta lead to.

    The platform joints, at radius r and 0, 120 and 240 degrees, stay in their limbs' planes. With
    the platform's axes n and o (columns of R): n_y = o_x, x = r (n_x - o_y) / 2, y = -r n_y.
    """
    alpha, beta = poses[:, 3], poses[:, 4]
    gamma = np.arctan2(np.sin(alpha) * np.sin(beta), np.cos(alpha) + np.cos(beta))
    n_x, n_y = np.cos(gamma) * np.cos(beta), np.sin(gamma) * np.cos(beta)
    o_y = np.sin(gamma) * np.sin(beta) * np.sin(alpha) + np.cos(gamma) * np.cos(alpha)
    poses[:, 0] = radius * (n_x - o_y) / 2.0
    poses[:, 1] = -radius * n_y
    poses[:, 5] = gamma
