"""Complete poses from some of their coordinates, and the rates of the actuators there.

Where limbs constrain the pose (3-RPS, 3-PRS, spatial 2TPR&2TPS) or share an actuator, six numbers
are too many: the closures, with the matched coordinates held, determine the rest.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal.arguments import did_you_mean, words
from pkmcal.arrays import BoolArray, FloatArray, wrapped
from pkmcal.core.chains import AnyMachine
from pkmcal.core.library import MAPS, POSE
from pkmcal.core.machine import Closure
from pkmcal.exceptions import ArgumentError

ITERATIONS = 30
SETTLED = 1e-12  # of the machine's size
KEPT = 1e-9  # of the size, or rad: a matched coordinate that is off by more was not kept


def matched_coordinates(
    match: bool | str | Sequence[str], declared: Sequence[str] | None, coordinates: Sequence[str]
) -> list[int]:
    """Places of the matched coordinates in x y z α β γ.

    Raises
    ------
    ValueError
        An unknown coordinate, or ``match=True`` where the robot declares none.
    """
    if match is True:
        names = tuple(declared if declared is not None else coordinates)
    elif match is False or match is None:
        raise ArgumentError(f"match must be True or names of coordinates, found {match!r}")
    else:
        names = words("match", match)
    for name in names:
        if name not in POSE:
            raise ArgumentError(f"match: {name!r} is no coordinate{did_you_mean(name, POSE)}")
    if len(set(names)) != len(names):
        raise ArgumentError(f"match: a coordinate is named twice in {', '.join(names)}")
    return [POSE.index(name) for name in names]


def complete(
    machine: AnyMachine,
    map: str,
    slots: FloatArray,
    pose: FloatArray,
    matched: Sequence[int],
    near: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Poses on the machine's manifold that keep the matched coordinates.

    Newton's method on the closures and the matched coordinates, in the free coordinates and the
    actuator coordinates together; least squares where there are more rows than needed.

    Parameters
    ----------
    machine : Machine or ChainMachine
        The machine.
    map : str
        Its pose map.
    slots : ndarray (limbs, SLOTS)
        Geometry.
    pose : ndarray (N, 6)
        Where to start, and what to keep.
    matched : sequence of int
        Places in x y z α β γ.
    near : ndarray (n,) or (N, n), optional
        Coordinates that angles are given nearest to, as for `Machine.inverse`.

    Returns
    -------
    pose : ndarray (N, 6)
        NaN where no pose was found that keeps what is matched.
    q : ndarray (N, n)
        The actuator coordinates there.
    """
    free = [POSE.index(name) for name in MAPS[map]]
    unknown = [i for i in matched if i not in free]
    if unknown:
        raise ArgumentError(f"match: {POSE[unknown[0]]} is not free on this machine")
    freedom = len(free) + machine.actuators - machine.rows
    if len(matched) != freedom and machine.rows <= len(free):
        raise ArgumentError(f"match must name {freedom} coordinates here, found {len(matched)}")
    own = pose.copy()
    wanted = own[:, matched]
    q = machine.inverse(slots, own, near)
    size = machine.struct.size
    live: BoolArray = np.asarray(np.isfinite(q).all(axis=1))
    done = np.zeros(len(own), dtype=bool)
    for _ in range(ITERATIONS):
        rows = np.flatnonzero(live & ~done)
        if not rows.size:
            break
        closure = machine.closure(slots, own[rows], q[rows])
        left = _system(closure, free, matched)
        missing = own[rows][:, matched] - wanted[rows]
        right = np.concatenate([closure.residual, missing], axis=1)
        good = np.isfinite(left).all(axis=(1, 2)) & np.isfinite(right).all(axis=1)
        live[rows[~good]] = False
        step = np.zeros((len(rows), left.shape[-1]))
        step[good] = -(np.linalg.pinv(left[good]) @ right[good][..., None])[..., 0]
        own[rows[:, None], free] += step[:, : len(free)]
        q[rows] += step[:, len(free) :]
        done[rows] = good & (np.abs(step).max(axis=1) <= SETTLED * size)
    own[~done], q[~done] = np.nan, np.nan
    q = machine.nearest_turns(slots, q, near)  # a long step may have gone round
    own = machine.forward(slots, q, own, threads=None)[0]
    if machine.rows > len(free):
        own, q = _correct_actuators(machine, slots, own, q, matched, wanted)
    if map == "spatial":
        own = _as_wanted(own, matched, wanted)
    kept = _missing(own, matched, wanted) <= KEPT * np.where(np.array(matched) < 3, size, 1.0)
    unsolved = ~kept.all(axis=1)  # at a stationary point that is no solution, or without a pose
    own[unsolved], q[unsolved] = np.nan, np.nan
    return own, q


def _missing(own: FloatArray, matched: Sequence[int], wanted: FloatArray) -> FloatArray:
    """How far the matched coordinates of poses (N, 6) are from those wanted, mm or rad."""
    off = own[:, matched] - wanted
    off = np.where(np.array(matched) < 3, off, wrapped(off))
    return np.asarray(np.abs(off))


def _as_wanted(own: FloatArray, matched: Sequence[int], wanted: FloatArray) -> FloatArray:
    """Poses with their rotations written as is nearer to what is wanted.

    α + π, π - β, γ + π is the same rotation as α, β, γ.
    """
    other = own.copy()
    other[:, 3:] = wrapped(own[:, 3:] * [1.0, -1.0, 1.0] + np.pi)
    angles = [i for i in matched if i >= 3]
    places = [i >= 3 for i in matched]
    off, other_off = (
        _missing(each, angles, wanted[:, places]).sum(axis=1) for each in (own, other)
    )
    return np.where((other_off < off)[:, None], other, own)


def _system(closure: Closure, free: list[int], matched: Sequence[int]) -> FloatArray:
    """Closures and matched coordinates by free and actuator coordinates, (N, rows, m + n)."""
    by_all = np.concatenate([closure.by_free, closure.by_q], axis=-1)
    keep = np.zeros((len(matched), by_all.shape[-1]))
    keep[np.arange(len(matched)), [free.index(i) for i in matched]] = 1.0
    system: FloatArray = np.concatenate(
        [by_all, np.broadcast_to(keep, (len(by_all), *keep.shape))], axis=1
    )
    return system


def completed_rates(
    machine: AnyMachine,
    map: str,
    slots: FloatArray,
    pose: FloatArray,
    q: FloatArray,
    matched: Sequence[int],
    rates: tuple[FloatArray, FloatArray],
) -> tuple[FloatArray, FloatArray]:
    """Velocity and acceleration of the actuators, (N, n), that move the matched coordinates.

    Parameters
    ----------
    machine, map, slots, matched
        As for `complete`.
    pose, q : ndarray (N, 6), (N, n)
        What `complete` found.
    rates : two ndarray (N, matched)
        Velocity and acceleration of the matched coordinates, by time.
    """
    left = _system(
        machine.closure(slots, pose, q), [POSE.index(name) for name in MAPS[map]], matched
    )
    good = np.isfinite(left).all(axis=(1, 2))
    inverse = np.full((len(pose), machine.actuators, len(matched)), np.nan)
    inverse[good] = np.linalg.pinv(left[good])[:, -machine.actuators :, machine.rows :]
    velocity = np.einsum("nij,nj->ni", inverse, rates[0])
    carried = machine.motion(slots, pose, q, velocity, np.zeros_like(velocity))[2][:, matched]
    return velocity, np.einsum("nij,nj->ni", inverse, rates[1] - carried)


def _correct_actuators(
    machine: AnyMachine,
    slots: FloatArray,
    own: FloatArray,
    q: FloatArray,
    matched: Sequence[int],
    wanted: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Correct the actuators until the least-squares pose has the wanted coordinates.

    With more rows than free coordinates and inexact geometry no pose meets them all, and the one
    above that met the matched coordinates is not quite where the machine goes.
    """
    for _ in range(ITERATIONS):
        missing = own[:, matched] - wanted
        live = np.flatnonzero(np.abs(missing).max(axis=1) > SETTLED * machine.struct.size)
        if not live.size:
            break
        slope = machine.forward_jacobian(slots, own[live], q[live])[:, matched]
        good = np.isfinite(slope).all(axis=(1, 2))
        live, slope = live[good], slope[good]
        q[live] -= (np.linalg.pinv(slope) @ missing[live][..., None])[..., 0]
        own[live] = machine.forward(slots, q[live], own[live], threads=None)[0]
    return own, q
