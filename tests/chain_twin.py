"""Machines of chains in plain NumPy: products of exponentials, closed by Newton with differences.

Nothing of the core is used but the joints that the file states.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pkmcal import Robot
from pkmcal.geometry.chain_joints import ERRORS

FloatArray = NDArray[np.float64]


def skew(v: FloatArray) -> FloatArray:
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def rotation(w: FloatArray) -> FloatArray:
    angle = float(np.linalg.norm(w))
    if angle == 0.0:
        return np.eye(3)
    K = skew(w / angle)
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def rpy(a: float, b: float, c: float) -> FloatArray:
    ex, ey, ez = np.eye(3)
    return rotation(c * ez) @ rotation(b * ey) @ rotation(a * ex)


def about(R: FloatArray, point: FloatArray, shift: FloatArray | None = None) -> FloatArray:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, point - R @ point + (0.0 if shift is None else shift)
    return T


def posed(pose: FloatArray) -> FloatArray:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rpy(*pose[3:]), pose[:3]
    return T


class Twin:
    """A machine of chains at one geometry."""

    def __init__(self, robot: Robot) -> None:
        chains = robot.model.chains
        assert chains is not None
        self.chains, self.numbers = chains, dict(robot.geometry.items())
        self.rows = {"spatial": range(6), "planar": (2, 3, 4), "spherical": range(3)}[chains.map]
        self.length = chains.length
        self.passive = [n for n, part in chains.parts.items() if part.joint.actuator is None]
        self.home = posed(chains.home)

    def error(self, name: str, point: FloatArray) -> FloatArray:
        e = [self.numbers.get(f"{name}.{error}", 0.0) for error in ERRORS]
        return about(rpy(*e[3:]), point, np.array(e[:3]))

    def joints(self, q: FloatArray, theta: FloatArray) -> dict[str, float]:
        values = dict(zip(self.passive, theta, strict=True))
        for name, part in self.chains.parts.items():
            a = part.joint.actuator
            if a is not None:
                gain, offset = self.numbers[f"gain{a + 1}"], self.numbers[f"offset{a + 1}"]
                values[name] = gain * q[a] + offset - part.joint.home_value
        return values

    def chain(self, limb: int, values: dict[str, float]) -> FloatArray:
        T = np.eye(4)
        for name in self.chains.members[limb]:
            part = self.chains.parts[name]
            T = T @ self.error(name, part.joint.at)
            moved = np.eye(4)
            if part.slides:
                moved[:3, 3] = values[name] * part.axis
            else:
                moved = about(rotation(values[name] * part.axis), part.joint.at)
            T = T @ moved
        return T

    def misses(self, T: FloatArray, q: FloatArray, theta: FloatArray) -> FloatArray:
        """All closures of all limbs, mm."""
        values, found = self.joints(q, theta), []
        carried = T @ np.linalg.inv(self.home)
        for i, limb in enumerate(self.chains.limbs):
            P, end = self.chain(i, values), limb[-1].at
            if limb[-1].ball:
                ball = P @ self.error(f"limb{i + 1}.joint{len(limb)}", end) @ [*end, 1.0]
                there = carried @ self.error(f"limb{i + 1}.platform", end) @ [*end, 1.0]
                found.append((ball - there)[:3])
                continue
            name = self.chains.end_of(i)
            if f"{name}.{ERRORS[-1]}" not in self.numbers:  # of the limb that ends there too
                first = next(
                    k for k, other in enumerate(self.chains.limbs) if other[-1] is limb[-1]
                )
                name = f"limb{first + 1}.platform"
            C = P @ np.linalg.inv(self.error(name, end)) @ self.home
            D = C[:3, :3] @ T[:3, :3].T
            vee = np.array([D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]]) / 2
            row = np.concatenate([self.length * vee, C[:3, 3] - T[:3, 3]])
            found.append(row[list(self.rows)])
        return np.concatenate(found)

    def moved(self, T: FloatArray, step: FloatArray) -> FloatArray:
        found = T.copy()
        twist = np.zeros(6)
        twist[list(self.rows)] = step
        found[:3, :3] = rotation(twist[:3]) @ T[:3, :3]
        found[:3, 3] = T[:3, 3] + twist[3:]
        return found

    def forward(self, q: FloatArray, parts: int = 6) -> tuple[FloatArray, FloatArray, float]:
        """Platform, passive joints and the largest miss, from home in `parts` of the way."""
        T, theta, m = self.home.copy(), np.zeros(len(self.passive)), len(self.rows)
        zero = np.array([joint.home_value for _, joint in self.chains.actuated])
        for share in np.linspace(0, 1, parts + 1)[1:]:
            at = zero + share * (q - zero)
            for _ in range(12 if share == 1 else 4):
                slope = self.differences(T, at, theta)
                step = -np.linalg.pinv(slope, rcond=1e-9) @ self.misses(T, at, theta)
                T, theta = self.moved(T, step[:m]), theta + step[m:]
                if np.abs(step).max() < 1e-12:
                    break
        return T, theta, float(np.abs(self.misses(T, q, theta)).max())

    def settled(self, q: FloatArray) -> FloatArray:
        """Where the platform comes to rest if joints are elastic: all closures hold by their give.

        Least energy Σ eᵀ c⁻¹ e of what joints give way, by Lagrange and Newton with differences;
        c is 1 along, and 1/length² about, every axis.
        """
        names = list(self.chains.parts)
        names += [
            f"limb{i + 1}.joint{len(b)}" for i, b in enumerate(self.chains.limbs) if b[-1].ball
        ]
        given = [f"{name}.{error}" for name in names for error in ERRORS]
        start = np.array([self.numbers.get(name, 0.0) for name in given])
        stiff = np.tile([1.0] * 3 + [self.length**2] * 3, len(names))
        T, theta, m = self.home.copy(), np.zeros(len(self.passive)), len(self.rows)
        give, h = np.zeros(len(given)), 1e-5
        for _ in range(12):
            self.numbers.update(zip(given, start + give, strict=True))
            r, A = self.misses(T, q, theta), self.differences(T, q, theta)
            B = np.empty((len(r), len(given)))
            for k, name in enumerate(given):
                ends = []
                for sign in (1, -1):
                    self.numbers[name] = start[k] + give[k] + sign * h
                    ends.append(self.misses(T, q, theta))
                self.numbers[name] = start[k] + give[k]
                B[:, k] = (ends[0] - ends[1]) / (2 * h)
            x, n, c = A.shape[1], len(given), len(r)
            K = np.zeros((x + n + c, x + n + c))
            K[x : x + n, x : x + n] = np.diag(stiff)
            K[x + n :, :x], K[x + n :, x : x + n] = A, B
            K[:x, x + n :], K[x : x + n, x + n :] = A.T, B.T
            right = np.concatenate([np.zeros(x), -stiff * give, -r])
            step = np.linalg.lstsq(K, right, rcond=1e-13)[0]
            T, theta = self.moved(T, step[:m]), theta + step[m:x]
            give = give + step[x : x + n]
            if np.abs(step[: x + n]).max() < 1e-8:
                break
        self.numbers.update(zip(given, start, strict=True))
        return T

    def differences(self, T: FloatArray, q: FloatArray, theta: FloatArray) -> FloatArray:
        columns, h = [], 1e-5
        m = len(self.rows)
        for k in range(m + len(theta)):
            step = np.zeros(m + len(theta))
            step[k] = h
            ends = [
                self.misses(self.moved(T, sign * step[:m]), q, theta + sign * step[m:])
                for sign in (1, -1)
            ]
            columns.append((ends[0] - ends[1]) / (2 * h))
        return np.array(columns).T
