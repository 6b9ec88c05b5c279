"""Forward kinematics of a 6-UPS as one would write it in Python, for comparison."""

from __future__ import annotations

import numpy as np
from scipy.optimize import root
from scipy.spatial.transform import Rotation

import pkmcal as pk


class Hexapod:
    """Joints (6, 3) and offsets (6,) of a 6-UPS, in mm."""

    def __init__(self, robot: pk.Robot) -> None:
        geometry = robot.geometry
        self.base, self.platform = (
            np.array([[geometry[f"{point}{i}.{axis}"] for axis in "xyz"] for i in range(1, 7)])
            for point in ("base", "platform")
        )
        self.offset = np.array([geometry[f"offset{i}"] for i in range(1, 7)])

    def numpy_newton(self, q: np.ndarray, guess: np.ndarray, closed: float) -> np.ndarray:
        """All rows at once: Newton in a twist, the rows that are left solved by LAPACK."""
        n = len(q)
        p, R = np.tile(guess[:3], (n, 1)), np.tile(rotation(guess), (n, 1, 1))
        rows = np.arange(n)
        for _ in range(50):
            arm = np.einsum("nij,kj->nki", R[rows], self.platform)
            d = p[rows, None] + arm - self.base
            length = np.linalg.norm(d, axis=-1)
            missed = length - (q[rows] + self.offset)
            left = np.abs(missed).max(axis=1) >= closed
            if not left.any():
                break
            rows, d, arm = rows[left], d[left] / length[left, :, None], arm[left]
            jacobian = np.concatenate([d, np.cross(arm, d)], axis=-1)
            step = -np.linalg.solve(jacobian, missed[left][..., None])[..., 0]
            p[rows] += step[:, :3]
            R[rows] = Rotation.from_rotvec(step[:, 3:]).as_matrix() @ R[rows]
        angles = Rotation.from_matrix(R).as_euler("ZYX")
        return np.concatenate([p, angles[:, ::-1]], axis=1)

    def scipy_root(self, q: np.ndarray, guess: np.ndarray) -> np.ndarray:
        """Row by row, by MINPACK's hybrid method with the analytic Jacobian in Euler angles."""
        found = [root(self._missed, guess, args=(row,), jac=True, tol=1e-14).x for row in q]
        return np.array(found)

    def _missed(self, pose: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        R = rotation(pose)
        arm = self.platform @ R.T
        d = pose[:3] + arm - self.base
        length = np.sqrt((d * d).sum(axis=1))
        d /= length[:, None]
        turn = np.empty((6, 3))
        turn[:, 0] = arm[:, 1] * d[:, 2] - arm[:, 2] * d[:, 1]
        turn[:, 1] = arm[:, 2] * d[:, 0] - arm[:, 0] * d[:, 2]
        turn[:, 2] = arm[:, 0] * d[:, 1] - arm[:, 1] * d[:, 0]
        cb, sb, cg, sg = np.cos(pose[4]), np.sin(pose[4]), np.cos(pose[5]), np.sin(pose[5])
        rates = np.array([[cg * cb, -sg, 0.0], [sg * cb, cg, 0.0], [-sb, 0.0, 1.0]])
        return length - (q + self.offset), np.concatenate([d, turn @ rates], axis=1)


def rotation(pose: np.ndarray) -> np.ndarray:
    """R (3, 3) = Rz(gamma) Ry(beta) Rx(alpha)."""
    (ca, cb, cg), (sa, sb, sg) = np.cos(pose[3:]), np.sin(pose[3:])
    return np.array(
        [
            [cg * cb, cg * sb * sa - sg * ca, cg * sb * ca + sg * sa],
            [sg * cb, sg * sb * sa + cg * ca, sg * sb * ca - cg * sa],
            [-sb, cb * sa, cb * ca],
        ]
    )
