"""Proof that chains of joints close near a pose, by the theorem of Newton and Kantorovich.

The unknowns y are a step of the platform and all passive joints, turns as arcs at the machine's
length; the equations F(y) = 0 are what is between the end of each chain and the platform. They are
not quadratic, but how fast F' changes is bounded everywhere: each turn by a joint is a product with
a rotation, so the second derivatives of a chain's orientation are at most 1, and those of its end
at most what reaches from the joint to the end. `certificate` says what follows from that.

The closures are products of exponentials, written here a second time; the core's own are not taken
on trust.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray
from pkmcal.core import screws
from pkmcal.core.chains import GROUPS, ChainLayout, ChainMachine
from pkmcal.modes.certificate import Certificate, kantorovich

_NEAR = 0.1  # of the length: the ball in which bounds hold that depend on how far joints slide
_ROWS = {"spatial": slice(0, 6), "planar": slice(2, 5), "spherical": slice(0, 3)}  # of (ω, v)
_UPRIGHT = 2.5  # trace of a rotation that is far from a half turn
_SPUN = 0.5  # rad, which it turns by at most beyond that
_ROOT3 = float(np.sqrt(3.0))
_TURN = np.pi * 3.0 / np.sqrt(8.0)  # rad, at most, of rotations whose entries differ by 1


class System(NamedTuple):
    """The closures of N poses, as `kantorovich` takes them, and what more there is to know.

    `turns` is how fast orientations turn at most, by the largest of y over the length, and
    `upright` whether those of chains are near the platform's.
    """

    f: FloatArray
    df: FloatArray
    f_abs: FloatArray
    df_abs: FloatArray
    change: FloatArray
    turns: float
    upright: BoolArray


def certify_chains(
    machine: ChainMachine, slots: FloatArray, pose: FloatArray, q: FloatArray
) -> Certificate:
    """Certify poses (N, 6) of a machine with as many rows as unknowns, at coordinates (N, n).

    `unique` is of the platform together with the passive joints: where these are elsewhere, it may
    be as near.
    """
    layout = machine.layout
    theta = machine.frames(slots, pose, q)[0]
    drive = machine.drives(slots, q) - layout.zero
    system = closures(layout, slots.ravel(), pose, drive, theta)
    error, unique, holds = kantorovich(*system[:5])
    unique = np.minimum(unique, _NEAR * layout.length)
    with np.errstate(invalid="ignore"):
        spun = system.turns * error / layout.length  # vee(C Rᵀ) is 0 after a half turn, too
        ok = holds & (error < unique) & system.upright & (spun < _SPUN)
    return Certificate(
        ok, np.where(ok, _ROOT3 * error, np.nan), np.where(ok, unique / _TURN, np.nan)
    )


def most_modes(layout: ChainLayout) -> tuple[int, str] | None:
    """Bound the number of isolated modes, and say why; None where nothing is known.

    A chain with two passive joints that turn keeps the distance of a point of the platform from
    one of the base, or about a point the angle of two axes; with one, it leaves a turn.
    """
    if layout.map == "spatial" or layout.shared or layout.ball.any():
        return None
    passive = [
        [joint for joint in layout.member[first:end] if layout.coordinate[joint] >= 0]
        for first, end in pairwise(layout.first)
    ]
    if any(layout.prismatic[joint] for chain in passive for joint in chain):
        return None
    match (layout.map, *sorted(len(chain) for chain in passive)):
        case (_, 1, 2):
            return 2, "one turn, and one condition that is linear in its sine and cosine"
        case ("planar", 2, 2, 2):
            return 6, "three circles"
        case ("spherical", 2, 2, 2):
            return 8, "three quadrics of the quaternion"
    return None


def closures(
    layout: ChainLayout,
    numbers: FloatArray,
    pose: FloatArray,
    drive: FloatArray,
    theta: FloatArray,
) -> System:
    """The system at poses (N, 6), drives from home (N, n) and passive joints (N, passive)."""
    rows, m, length = _ROWS[layout.map], GROUPS[layout.map], layout.length
    n, unknowns = len(pose), m + theta.shape[1]
    at = screws.frames(pose)
    R, p = at[:, :3, :3], at[:, :3, 3]
    step = np.eye(6)[:, rows]
    f, df, f_abs, df_abs, change = [], [], [], [], []
    fastest, upright = 0.0, np.ones(n, dtype=bool)
    for chain in range(len(layout.ball)):
        walk = _Walk(layout, numbers, chain, drive, theta)
        scale = 0.5 * (len(walk.points) + 2)
        size = scale * (walk.size + np.abs(p).max(axis=1))
        turns = len(walk.turning) + _ROOT3
        by, r, arm = np.zeros((n, 6, unknowns)), np.zeros((n, 6)), np.zeros((n, 3))
        r[:, 3:] = walk.end - p
        by[:, 3:, :m] = -step[3:]
        if layout.ball[chain]:
            on_platform = layout.end[chain] + numbers[layout.end_place[chain] + np.arange(3)]
            arm = R @ layout.home[:3, :3].T @ (on_platform - layout.home[:3, 3])
            r[:, 3:] -= arm
            by[:, 3:, :m] -= np.cross(step[:3].T / length, arm[:, None]).swapaxes(1, 2)
        else:
            D = walk.axes @ R.swapaxes(1, 2)
            upright &= np.trace(D, axis1=1, axis2=2) > _UPRIGHT
            r[:, :3] = length * screws.skew_vectors(D)
            for j in range(m):
                by[:, :3, j] = -screws.skew_vectors(D @ _skew(step[:3, j]))
        for coordinate, w, v in walk.columns:
            if not layout.ball[chain]:
                by[:, :3, m + coordinate] = screws.skew_vectors(_skew(w) @ D)
            slides = not w.any()
            by[:, 3:, m + coordinate] = v / (1.0 if slides else length)
        bent = walk.bend(length, _NEAR * length)
        bent = bent + 3.0 * np.linalg.norm(arm, axis=1) / length**2
        closing = slice(3, 6) if layout.ball[chain] else rows
        f.append(r[:, closing])
        df.append(by[:, closing])
        level = np.full(n, scale * length)
        f_abs.append(np.repeat([level, size], 3, axis=0).T[:, closing])
        entry = scale + size / length
        df_abs.append(np.where(by[:, closing] != 0.0, entry[:, None, None], 0.0))
        change.append(np.repeat([np.full(n, turns**2 / length), bent], 3, axis=0).T[:, closing])
        fastest = max(fastest, turns)
    return System(
        np.concatenate(f, axis=1),
        np.concatenate(df, axis=1),
        np.concatenate(f_abs, axis=1),
        np.concatenate(df_abs, axis=1),
        np.concatenate(change, axis=1),
        fastest,
        upright,
    )


class _Walk:
    """A chain from the base to its end, at N states.

    Attributes
    ----------
    axes, end : ndarray (N, 3, 3), (N, 3)
        The platform's axes as the chain has them, and its origin, or the ball.
    points : list of ndarray (N, 3)
        Of all joints.
    turning : list of int
        The places of the passive joints that turn.
    columns : list
        Of each passive joint its coordinate, the axis that it turns about (N, 3), or 0, and the
        velocity of the end by it.
    size : ndarray (N,)
        What rounding is measured against, mm.
    """

    def __init__(
        self,
        layout: ChainLayout,
        numbers: FloatArray,
        chain: int,
        drive: FloatArray,
        theta: FloatArray,
    ) -> None:
        n = len(drive)
        R, t = np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3))  # moved what is behind a joint
        self.points: list[FloatArray] = []
        self.turning: list[int] = []
        self._slides = 0
        largest = np.abs(layout.end).max() + np.abs(layout.home[:3, 3]).max()
        self.size = np.full(n, largest)
        passive: list[tuple[int, int, FloatArray]] = []
        for place, joint in enumerate(layout.member[layout.first[chain] : layout.first[chain + 1]]):
            e = numbers[layout.place[joint] + np.arange(6)]
            point, axis = layout.point[joint], layout.axes[joint][:, 2]
            wrong = _rotation(e[3:])
            t = R @ (point + e[:3] - wrong @ point) + t
            R = R @ wrong
            a, c = int(layout.actuator[joint]), int(layout.coordinate[joint])
            x = theta[:, c] if a < 0 else drive[:, a]
            along = R @ axis
            self.points.append(R @ point + t)
            self.size += np.abs(point).max() + np.abs(e[:3]).max()
            if a < 0:
                passive.append((c, place, along))
            if layout.prismatic[joint]:
                t = t + x[:, None] * along
                self.size += np.abs(x) + (np.abs(layout.zero[a]) if a >= 0 else 0.0)
                self._slides += a < 0
                continue
            if a < 0:
                self.turning.append(place)
            turned = screws.turnings(x[:, None] * axis)
            t = np.einsum("nij,nj->ni", R, point - turned @ point) + t
            R = R @ turned
        end, home = layout.end[chain], layout.home
        if layout.ball[chain]:
            self.axes = R
            self.end = R @ (end + numbers[layout.ball_place[chain] + np.arange(3)]) + t
        else:
            e = numbers[layout.end_place[chain] + np.arange(6)]
            back = _rotation(e[3:]).T  # of x -> end + e + wrong (x - end)
            self.axes = R @ back @ home[:3, :3]
            self.end = R @ (end + back @ (home[:3, 3] - end - e[:3])) + t
            self.size += np.abs(e[:3]).max()
        self.columns = [
            (c, along, np.cross(along, self.end - self.points[place]))
            if place in self.turning
            else (c, np.zeros((n, 3)), along)
            for c, place, along in passive
        ]

    def bend(self, length: float, ball: float) -> FloatArray:
        """Bound the end's second derivatives by unit steps of all passive joints, (N,)."""
        links = [*self.points, self.end]
        ways = [np.linalg.norm(b - a, axis=1) for a, b in pairwise(links)]
        reach = np.cumsum(ways[::-1], axis=0)[::-1] + self._slides * ball  # from joints to the end
        pairs = sum(reach[max(i, j)] for i in self.turning for j in self.turning) + 0.0 * reach[0]
        bent: FloatArray = pairs / length**2 + 2.0 * len(self.turning) * self._slides / length
        return bent


def _skew(w: FloatArray) -> FloatArray:
    """[w], the matrices of w × (.), (..., 3, 3)."""
    found: FloatArray = np.cross(w[..., None, :], np.eye(3)).swapaxes(-1, -2)
    return found


def _rotation(angles: FloatArray) -> FloatArray:
    """Rz(ψ) Ry(θ) Rx(φ)."""
    pose = np.concatenate([np.zeros(3), angles])[None]
    rotation: FloatArray = screws.frames(pose)[0, :3, :3]
    return rotation
