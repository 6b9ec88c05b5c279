"""Complete poses from some of their coordinates, and the rates of the actuators there.

Where limbs constrain the pose (3-RPS, 3-PRS, spatial 2TPR&2TPS) or share an actuator, six numbers
are too many: the closures, with the matched coordinates held, determine the rest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

import numpy as np

from pkmcal.arguments import did_you_mean, words
from pkmcal.arrays import BoolArray, FloatArray, wrapped
from pkmcal.core.library import MAPS, POSE
from pkmcal.core.machine import Closure
from pkmcal.core.path_differences import along_path
from pkmcal.core.poses import rates_of_twists
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.frames import Frames
from pkmcal.kinematics.loaded import AnyCompiled, LoadedMachine
from pkmcal.screw import from_pose

ITERATIONS = 30
SETTLED = 1e-12  # of the machine's size
ON_THE_MANIFOLD = 1e-6  # mm of closure error up to which a pose is taken as it is given
KEPT = 1e-9  # of the size, or rad: a matched coordinate that is off by more was not kept
OTHER_BRANCH = 1e-6  # of the size: so far apart, at a pose, are the drives of a limb's branches


def matched_coordinates(match: bool | str | Sequence[str], moved: Sequence[str]) -> list[int]:
    """Places of the matched coordinates in x y z α β γ; of those `moved` for True.

    Raises
    ------
    ValueError
        An unknown coordinate, or one that is named twice.
    """
    if match is True:
        names = tuple(moved)
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


class Completing(Protocol):
    """The interface that completion asks of a robot."""

    def violation(self, pose: FloatArray) -> FloatArray:
        """Return how far poses are from those the machine can take, mm."""

    def complete(self, pose: FloatArray) -> FloatArray:
        """The poses that keep the coordinates which its file declares."""


def completed(robot: Completing, poses: FloatArray) -> FloatArray:
    """Poses (N, 6) with those completed that the closures do not allow; NaN where there is none."""
    fits = robot.violation(poses) <= ON_THE_MANIFOLD
    if fits.all():
        return poses
    poses = poses.copy()
    poses[~fits] = robot.complete(poses[~fits])
    return poses


class Completed(NamedTuple):
    """Poses on the machine's manifold; NaN where none keeps what is matched.

    Attributes
    ----------
    pose : ndarray (N, 6)
        In the user's frames.
    own : ndarray (N, 6)
        In the machine's.
    q : ndarray (N, n)
        The actuator coordinates there.
    """

    pose: FloatArray
    own: FloatArray
    q: FloatArray


def complete(
    machine: AnyCompiled,
    map: str,
    slots: FloatArray,
    frames: Frames,
    pose: FloatArray,
    matched: Sequence[int],
    near: FloatArray | None = None,
    start: Callable[[FloatArray], FloatArray] | None = None,
) -> Completed:
    """Poses on the machine's manifold that keep the matched coordinates, in the user's frames.

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
    frames : Frames
        The user's.
    pose : ndarray (N, 6)
        Where to start, and what to keep, in the user's frames.
    matched : sequence of int
        Places in x y z α β γ.
    near : ndarray (n,) or (N, n), optional
        Coordinates that angles are given nearest to, as for `Machine.inverse`.
    start : callable, optional
        Own poses (N, 6) to coordinates (N, n) to start at, near which angles are given then. By
        default `Machine.inverse`.
    """
    free = [POSE.index(name) for name in MAPS[map]]
    fixed = [i for i in range(6) if i not in free]
    unknown = [i for i in matched if i not in free]
    if unknown and frames.trivial:
        raise ArgumentError(f"match: {POSE[unknown[0]]} is not free on this machine")
    freedom = len(free) + min(0, machine.actuators - machine.rows)  # joints of a tail may be more
    if len(matched) != freedom and machine.rows <= len(free):
        why = (
            "" if len(matched) > freedom else ": check_geometry says if a joint adds no way to move"
        )
        raise ArgumentError(
            f"match must name {freedom} coordinates here, found {len(matched)}{why}"
        )
    wanted = pose[:, matched]
    own = frames.inward(pose).copy()
    if not frames.trivial and fixed:
        _to_map(machine, slots, frames, own, free, matched, wanted)
    if start is None:
        q = machine.inverse(slots, own, near)
    else:
        near = start(own)
        q = near.copy()
    size = machine.struct.size
    live: BoolArray = np.asarray(np.isfinite(q).all(axis=1))
    done = np.zeros(len(own), dtype=bool)
    for k in range(ITERATIONS):
        rows = np.flatnonzero(live & ~done)
        if not rows.size:
            break
        closure = machine.of_rows(rows).closure(slots, own[rows], q[rows])
        own[rows[:, None], fixed] = closure.pose[:, fixed]
        seen = _seen(frames, own[rows], matched, wanted[rows])
        left = _system(closure, frames, own[rows], seen, free, matched)
        missing = _off(seen, matched, wanted[rows])
        right = np.concatenate([closure.residual, missing], axis=1)
        good = np.isfinite(left).all(axis=(1, 2)) & np.isfinite(right).all(axis=1)
        # the machine takes the pose as it is: near β = ±90° rates of angles would lead away
        met = (np.abs(right).max(axis=1) <= SETTLED * size) & (k == 0)
        good &= ~met
        live[rows[~good & ~met]] = False
        step = np.zeros((len(rows), left.shape[-1]))
        step[good] = -(np.linalg.pinv(left[good]) @ right[good][..., None])[..., 0]
        own[rows[:, None], free] += step[:, : len(free)]
        q[rows] += step[:, len(free) :]
        done[rows] = np.where(good, np.abs(step).max(axis=1) <= SETTLED * size, met)
    own[~done], q[~done] = np.nan, np.nan
    q = machine.nearest_turns(slots, q, near)  # a long step may have gone round
    own = _forward(machine, slots, frames, own, q, matched, wanted)
    if machine.rows > len(free):
        own, q = _correct_actuators(machine, slots, frames, own, q, matched, wanted)
    seen = _seen(frames, own, matched, wanted)
    limit = KEPT * np.where(np.array(matched) < 3, size, 1.0)
    kept = (np.abs(_off(seen, matched, wanted)) <= limit).all(axis=1)
    if machine.turns_freely:
        seen[~kept] = _same_rotation(seen[~kept], matched, wanted[~kept], KEPT)
        kept = (np.abs(_off(seen, matched, wanted)) <= limit).all(axis=1)
        own = seen.copy() if frames.trivial else own
    # not at a stationary point that is no solution, and with no limb on its other branch
    unsolved = ~(kept & in_working_mode(machine, slots, own, q))
    seen[unsolved], own[unsolved], q[unsolved] = np.nan, np.nan, np.nan
    return Completed(seen, own, q)


def in_working_mode(
    machine: AnyCompiled, slots: FloatArray, own: FloatArray, q: FloatArray
) -> BoolArray:
    """Return whether limbs at actuators (N, n) are in the working mode of the inverse."""
    way, there = (machine.drives(slots, each) for each in (q, machine.inverse(slots, own, q)))
    missed = machine.struct.closure_tolerance if machine.rows > machine.m else 0.0
    most = max(OTHER_BRANCH * machine.struct.size, 10.0 * missed)
    with np.errstate(invalid="ignore"):
        return np.asarray((np.abs(there - way) <= most).all(axis=1))


def _to_map(
    machine: AnyCompiled,
    slots: FloatArray,
    frames: Frames,
    own: FloatArray,
    free: list[int],
    matched: Sequence[int],
    wanted: FloatArray,
) -> None:
    """Move own poses (N, 6) onto the map, to where the matched coordinates are if limbs allow.

    What the map does not move is some of the user's coordinates, and limbs may not reach there.
    """
    fixed = np.setdiff1d(range(6), free)
    q = np.zeros((len(own), machine.actuators))
    for _ in range(ITERATIONS):
        closure = machine.closure(slots, own, q)
        own[:, fixed] = closure.pose[:, fixed]
        seen = _seen(frames, own, matched, wanted)
        missing = _off(seen, matched, wanted)
        off = np.abs(missing).max(axis=1, initial=0.0) > SETTLED * machine.struct.size
        if not off.any():
            break
        keep = _kept_by_free(closure, frames, own, seen, free, matched)
        good = off & np.isfinite(keep).all(axis=(1, 2)) & np.isfinite(missing).all(axis=1)
        step = np.linalg.pinv(keep[good]) @ missing[good][..., None]
        own[np.flatnonzero(good)[:, None], free] -= step[..., 0]


def _off(pose: FloatArray, matched: Sequence[int], wanted: FloatArray) -> FloatArray:
    """Matched coordinates of poses (N, 6) less those wanted, angles the short way round."""
    with np.errstate(invalid="ignore"):  # what is infinite is kept nowhere
        off = np.asarray(pose[:, matched] - wanted)
    angles = np.array(matched) >= 3
    off[:, angles] = wrapped(off[:, angles])
    return off


def _seen(
    frames: Frames, own: FloatArray, matched: Sequence[int], wanted: FloatArray
) -> FloatArray:
    """Own poses (N, 6) in the user's frames."""
    if frames.trivial:
        return np.array(own)
    return written_as(frames.outward(own), matched, wanted)


def written_as(pose: FloatArray, matched: Sequence[int], wanted: FloatArray) -> FloatArray:
    """Poses (N, 6) with rotations written as is nearer to what is wanted, (N, matched).

    α + π, π - β, γ + π is the same rotation as α, β, γ.
    """
    other = pose.copy()
    other[:, 3:] = wrapped(pose[:, 3:] * [1.0, -1.0, 1.0] + np.pi)
    angles = [i for i in matched if i >= 3]
    places = [i >= 3 for i in matched]
    off, other_off = (
        np.abs(_off(each, angles, wanted[:, places])).sum(axis=1) for each in (pose, other)
    )
    return np.where((other_off < off)[:, None], other, pose)


def _same_rotation(
    pose: FloatArray, matched: Sequence[int], wanted: FloatArray, alike: float
) -> FloatArray:
    """Poses with the angles that are wanted, where all three are and say the same rotation.

    Near β = ±90° very different angles do.
    """
    places = [i for i, k in enumerate(matched) if k >= 3]
    if len(places) < 3:
        return pose
    asked = pose.copy()
    asked[:, [matched[i] for i in places]] = wanted[:, places]
    apart = np.abs(from_pose(asked) - from_pose(pose))[:, :3, :3].max(axis=(1, 2))
    return np.where((apart <= alike)[:, None], asked, pose)


def _system(
    closure: Closure,
    frames: Frames,
    own: FloatArray,
    seen: FloatArray,
    free: list[int],
    matched: Sequence[int],
) -> FloatArray:
    """Closures and matched coordinates by free and actuator coordinates, (N, rows, m + n)."""
    by_all = np.concatenate([closure.by_free, closure.by_q], axis=-1)
    keep = np.zeros((len(own), len(matched), by_all.shape[-1]))
    keep[:, :, : len(free)] = _kept_by_free(closure, frames, own, seen, free, matched)
    system: FloatArray = np.concatenate([by_all, keep], axis=1)
    return system


def _kept_by_free(
    closure: Closure,
    frames: Frames,
    own: FloatArray,
    seen: FloatArray,
    free: list[int],
    matched: Sequence[int],
) -> FloatArray:
    """Matched coordinates by the free ones, (N, matched, m)."""
    by_free = closure.pose_by_free
    by_free[:, free] = np.eye(len(free))  # without rounding
    kept: FloatArray = frames.rates_outward(own, seen, by_free)[:, matched]
    return kept


def completed_rates(
    machine: AnyCompiled,
    map: str,
    slots: FloatArray,
    frames: Frames,
    at: Completed,
    matched: Sequence[int],
    rates: tuple[FloatArray, FloatArray],
) -> tuple[FloatArray, FloatArray]:
    """Velocity and acceleration of the actuators, (N, n), that move the matched coordinates.

    Parameters
    ----------
    machine, map, slots, frames, matched
        As for `complete`.
    at : Completed
        What `complete` found.
    rates : two ndarray (N, matched)
        Velocity and acceleration of the matched coordinates, by time.
    """
    free = [POSE.index(name) for name in MAPS[map]]
    # closures that depend cannot be solved for rates, one by one, nor those that loads move
    if machine.rows > len(free) or isinstance(machine, LoadedMachine):
        scale = np.where(np.array(matched) < 3, 1.0 / machine.struct.size, 1.0)

        def completed(change: FloatArray) -> FloatArray:
            pose = at.pose.copy()
            pose[:, matched] += change
            return complete(machine, map, slots, frames, pose, matched, at.q).q

        return along_path(completed, *rates, scale)
    left = _system(machine.closure(slots, at.own, at.q), frames, at.own, at.pose, free, matched)
    good = np.isfinite(left).all(axis=(1, 2))
    inverse = np.full((len(left), machine.actuators, len(matched)), np.nan)
    inverse[good] = np.linalg.pinv(left[good])[:, -machine.actuators :, machine.rows :]
    velocity = np.einsum("nij,nj->ni", inverse, rates[0])
    motion = machine.motion(slots, at.own, at.q, velocity, np.zeros_like(velocity))[0]
    carried = _acceleration(frames.motion_outward(motion), at.pose)[:, matched]
    return velocity, np.einsum("nij,nj->ni", inverse, rates[1] - carried)


def _acceleration(motion: FloatArray, pose: FloatArray) -> FloatArray:
    """Second derivatives of x y z α β γ as poses (N, 6) write them, of motions (N, 3, 4, 4).

    Of an angle φ with sine s and cosine c up to a factor, n = s² + c²: n φ̇ = c ṡ - s ċ.
    """
    R = np.moveaxis(motion[:, :, :3, :3], 1, -1)  # (N, 3, 3) by order
    out = np.empty((len(motion), 6))
    out[:, :3] = motion[:, 2, :3, 3]
    for k, s, c in ((3, R[:, 2, 1], R[:, 2, 2]), (5, R[:, 1, 0], R[:, 0, 0])):
        n, by_time = s[:, 0] ** 2 + c[:, 0] ** 2, 2 * (s[:, 0] * s[:, 1] + c[:, 0] * c[:, 1])
        speed = (c[:, 0] * s[:, 1] - s[:, 0] * c[:, 1]) / n
        out[:, k] = (c[:, 0] * s[:, 2] - s[:, 0] * c[:, 2] - speed * by_time) / n
    sine, cosine = -R[:, 2, 0], np.hypot(R[:, 0, 0, 0], R[:, 1, 0, 0])
    cosine = np.copysign(cosine, np.cos(pose[:, 4]))
    out[:, 4] = (sine[:, 2] + sine[:, 0] * (sine[:, 1] / cosine) ** 2) / cosine
    return out


def _correct_actuators(
    machine: AnyCompiled,
    slots: FloatArray,
    frames: Frames,
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
        seen = _seen(frames, own, matched, wanted)
        missing = _off(_same_rotation(seen, matched, wanted, SETTLED), matched, wanted)
        live = np.flatnonzero(np.abs(missing).max(axis=1) > SETTLED * machine.struct.size)
        if not live.size:
            break
        slope = machine.forward_jacobian(slots, own[live], q[live], twists=True)
        slope = frames.twists_outward(own[live], slope)
        slope = rates_of_twists(seen[live], slope)[:, matched]
        good = np.isfinite(slope).all(axis=(1, 2))
        live, slope = live[good], slope[good]
        q[live] -= (np.linalg.pinv(slope) @ missing[live][..., None])[..., 0]
        own[live] = _forward(machine, slots, frames, own[live], q[live], matched, wanted[live])
    return own, q


def _forward(
    machine: AnyCompiled,
    slots: FloatArray,
    frames: Frames,
    own: FloatArray,
    q: FloatArray,
    matched: Sequence[int],
    wanted: FloatArray,
) -> FloatArray:
    """Own poses (N, 6) at actuators, near those given; written as is wanted if they are seen so."""
    own = machine.forward(slots, q, own, threads=None)[0]
    if frames.trivial and machine.turns_freely:
        return written_as(own, matched, wanted)
    return own
