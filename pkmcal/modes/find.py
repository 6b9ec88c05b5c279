"""Find every assembly mode: by paths and random starts, with certificates and mirror images."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arrays import BoolArray, FloatArray, Int32Array, IntArray
from pkmcal.core import screws
from pkmcal.core.chains import AnyMachine, ChainMachine
from pkmcal.core.library import SLOTS
from pkmcal.core.machine import Machine
from pkmcal.modes.assemblies import Assemblies, Signs
from pkmcal.modes.certificate import Certificate, Closures, certify, newton
from pkmcal.modes.chain_certificate import certify_chains, most_modes
from pkmcal.modes.homotopy import Endpoints, endpoints, start_system

NEARLY_REAL = 1e-3  # with smaller imaginary parts a solution counts as real unless proven otherwise
FLAT = 1e-9  # points this near a plane, beside their spread, are in it
CLOSED = 1e-10  # of the terms of a closure: what Newton's method did not bring there is no mode
BLURRED = 1e-4  # rad, or lengths: near a singularity poses without a proof are not known better
AT_ONCE = 2000  # certificates: 12 x 12 matrices in memory
_LENGTHS = (*SLOTS[:6], "offset", "rod", "crank")  # of a crank, the offset is a few radians
STARTS = 2000  # random ones, where the paths prove nothing

_EQUAL = 1e-7  # share of the machine's size by which distances of poses differ that are not equal
_DECIMALS = 6  # of R, and of p in the machine's size, that are more than rounding


class AssemblyProblem(NamedTuple):
    """A machine at given actuator coordinates.

    Attributes
    ----------
    machine : Machine
        In the core.
    map : str
        Its pose map.
    rows : list of tuple of str
        Of each limb, its rows beside the sphere.
    levers : list of float
        Of the couple rows, mm.
    length : float
        Characteristic length, mm.
    slots, q : ndarray
        Geometry (limbs, SLOTS), and coordinates (n,), or (N, n) for `certify_rows`.
    """

    machine: AnyMachine
    map: str
    rows: list[tuple[str, ...]]
    levers: list[float]
    length: float
    slots: FloatArray
    q: FloatArray

    @property
    def provable(self) -> bool:
        """True if the closures are quadratic equations, one for each free coordinate."""
        square = self.machine.rows == self.machine.m
        return square and isinstance(self.machine, Machine) and self.machine.fixed_spheres

    def spheres(self) -> FloatArray:
        """The limbs (limbs, 7 + 3 axes), or of each row."""
        rows = np.ascontiguousarray(self.q.reshape(-1, self.q.shape[-1]))
        assert isinstance(self.machine, Machine)
        spheres: FloatArray = self.machine.spheres(self.slots, rows)
        return spheres if self.q.ndim > 1 else spheres[0]

    def closures(self) -> Closures:
        """The closures as quadratic equations.

        Anchors and lengths are as exact as the numbers they are computed from: those of the limbs,
        and the actuators', which are the limb's length or the anchor's way less the offset. Home
        has no part in it: it may be that of another geometry. Nor have gains and angles.
        """
        lengths = np.isin(SLOTS, _LENGTHS)
        size = 2.0 * float(np.abs(self.slots[:, lengths]).sum(axis=1).max())
        return Closures(self.map, self.rows, self.spheres(), self.length, size, self.levers)


class Found(NamedTuple):
    """Modes in the machine's own frame, not yet in order."""

    poses: FloatArray
    proof: Certificate
    complete: bool
    reason: str
    ends: Endpoints | None


def frames_of(poses: FloatArray) -> FloatArray:
    """R row by row and p, (N, 12), of poses (N, 6)."""
    motions = screws.frames(poses)
    frames: FloatArray = np.hstack([motions[:, :3, :3].reshape(-1, 9), motions[:, :3, 3]])
    return frames


def poses_of(map: str, frames: FloatArray) -> FloatArray:
    """Poses (N, 6) of a map from R row by row and p, (N, 12)."""
    poses = np.zeros((len(frames), 6))
    poses[:, :3] = frames[:, 9:]
    if map == "2tpr2tps":  # γ = 0, and β on the whole circle
        poses[:, 3] = np.arctan2(-frames[:, 5], frames[:, 4])
        poses[:, 4] = np.arctan2(-frames[:, 6], frames[:, 0])
    elif map == "planar":
        poses[:, 2] = 0.0
        poses[:, 5] = np.arctan2(frames[:, 3], frames[:, 0])
    elif map in ("spatial", "spherical"):
        motions = np.zeros((len(frames), 4, 4))
        motions[:, :3, :3] = frames[:, :9].reshape(-1, 3, 3)
        motions[:, :3, 3], motions[:, 3, 3] = frames[:, 9:], 1.0
        poses = screws.pose(motions.reshape(-1, 16))
    return poses


def find_modes(problem: AssemblyProblem, starts: int | None) -> Found:
    """Find all modes by paths; by random starts where paths prove nothing, or with `starts`."""
    if isinstance(problem.machine, ChainMachine):
        real = _of_chains(problem.machine, problem, STARTS if starts is None else starts)
        poses, proof = _certified(problem, real)
        return Found(poses, proof, *_all_of_chains(problem.machine, proof), None)
    square = problem.machine.rows == problem.machine.m
    spheres = problem.spheres()
    start = start_system(problem.map, problem.rows, spheres) if problem.provable else None
    ends, real, reason, all_proven = None, np.empty((0, 12)), "", False
    if not np.isfinite(spheres).all():
        nothing = np.empty(0)
        proof = Certificate(np.empty(0, dtype=bool), nothing, nothing)
        return Found(np.empty((0, 6)), proof, False, "a limb has no positive finite length", None)
    if not square:
        reason = "more closures than free coordinates"
    elif not problem.provable:
        reason = "cables over pulleys or several points"
    elif start is None:
        reason = "no start system for such limbs"
    else:
        ends = endpoints(problem.machine, start, problem.map, spheres)
        real, all_proven = _real_solutions(problem, ends)
        if ends.lost > 0:
            reason = f"{ends.lost} of {ends.paths} paths failed"
        elif ends.lost:
            reason = f"of {ends.paths} paths not as many end alike by two ways around"
    expected = len(real)
    if starts is None:
        starts = STARTS if reason else 0
    if starts:
        real = np.concatenate([real, from_random_starts(problem, spheres, starts)])
    poses, proof = _certified(problem, real)
    if not reason and not proof.ok.all():
        reason = f"{np.sum(~proof.ok)} modes not certified"
    if not reason and len(poses) != expected:
        reason = f"{expected} paths to real poses, but {len(poses)} modes"
    complete = not reason
    if ends and complete:
        reason = f"all {ends.paths} complex solutions followed"
        if ends.far:
            reason += f", {ends.far} of them to infinity or nearly"
        elif all_proven:
            reason = f"all {ends.paths} complex solutions certified, and there are no more"
    return Found(poses, proof, complete, reason, ends)


def _real_solutions(problem: AssemblyProblem, ends: Endpoints) -> tuple[FloatArray, bool]:
    """Frames at the ends of paths that are real, or not proven to be otherwise.

    And whether all ends, complex ones too, are certified to be as many different solutions.
    """
    closures = problem.closures()
    u = newton(closures, _scaled(ends.frames, problem.length), 1)
    proof = certify(closures, u)
    imaginary = np.abs(u.imag).max(axis=1, initial=0.0)
    with np.errstate(invalid="ignore"):
        complex_ones = (imaginary > NEARLY_REAL) | (imaginary * problem.length > proof.error)
    frames: FloatArray = newton(closures, np.ascontiguousarray(u.real[~complex_ones]), 3)
    frames[:, 9:] *= problem.length
    apart = np.abs(u[:, None] - u[None]).max(axis=2, initial=0.0) * problem.length
    alike = apart <= proof.error + proof.error[:, None]
    return frames, bool(proof.ok.all() and np.sum(alike) == len(u))


def _scaled(frames: Any, length: float) -> Any:
    """(R, p) as the certificate counts them."""
    u = frames.copy()
    u[:, 9:] /= length
    return u


def from_random_starts(problem: AssemblyProblem, spheres: FloatArray, starts: int) -> FloatArray:
    """Frames found by Newton's method from random orientations, on the sphere of some limb."""
    rng = np.random.default_rng(0)
    quaternion = rng.normal(size=(starts, 4))
    w, x, y, z = (quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)).T
    guess = np.zeros((starts, 6))
    guess[:, 3] = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    guess[:, 4] = np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0))
    guess[:, 5] = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    if problem.map == "2tpr2tps":
        guess[:, 4] = rng.uniform(-np.pi, np.pi, starts)
    turned = frames_of(guess)[:, :9].reshape(-1, 3, 3)
    limb = rng.integers(len(spheres), size=starts)
    way = rng.normal(size=(starts, 3))
    way *= spheres[limb, 6, None] / np.linalg.norm(way, axis=1, keepdims=True)
    guess[:, :3] = spheres[limb, 3:6] + way - np.einsum("nij,nj->ni", turned, spheres[limb, 0:3])
    q = np.ascontiguousarray(np.broadcast_to(problem.q, (starts, len(problem.q))))
    poses, status, _, _ = problem.machine.forward(problem.slots, q, guess, threads=None)
    return frames_of(poses[status == 0])


def _of_chains(machine: ChainMachine, problem: AssemblyProblem, starts: int) -> FloatArray:
    """Frames found from random poses of the platform, within the machine's size around home."""
    rng = np.random.default_rng(0)
    home = screws.pose(machine.layout.home.reshape(1, 16))
    guess = np.repeat(home, starts, axis=0)
    guess[:, :3] += rng.uniform(-1, 1, (starts, 3)) * machine.layout.size
    guess[:, 3:] = rng.uniform(-np.pi, np.pi, (starts, 3))
    guess[:1] = home
    q = np.ascontiguousarray(np.broadcast_to(problem.q, (starts, len(problem.q))))
    poses, status, _, _ = machine.forward(problem.slots, q, guess, threads=None)
    return frames_of(poses[status == 0])


def _all_of_chains(machine: ChainMachine, proof: Certificate) -> tuple[bool, str]:
    """Return whether modes with these certificates are all, and why or why not."""
    if machine.rows != machine.m:
        return False, "more closures than free coordinates"
    most = most_modes(machine.layout)
    if most is None or len(proof.ok) < most[0] or not proof.ok.all():
        return False, "chains of joints: random starts"
    return True, f"all {most[0]} certified, and there are no more: {most[1]}"


def _certified(problem: AssemblyProblem, frames: FloatArray) -> tuple[FloatArray, Certificate]:
    """Poses of real frames, each once, and their certificates."""
    poses = poses_of(problem.map, frames[np.isfinite(frames).all(axis=1)])
    u = _scaled(frames_of(poses), problem.length)
    if problem.provable:
        closures = problem.closures()
        f, _, f_abs, _, _ = closures(u)
        closed = (np.abs(f) <= CLOSED * f_abs).all(axis=1)
        poses, u = poses[closed], u[closed]
        proof = certify(closures, u)
    else:
        proof = certify_rows(problem._replace(q=np.tile(problem.q, (len(u), 1))), poses)
    of_chains = isinstance(problem.machine, ChainMachine)
    kept: list[int] = []
    for k in np.lexsort((~proof.ok,)):
        apart = np.abs(u[kept] - u[k]).max(axis=1, initial=0.0) * problem.length
        if of_chains:  # other passive joints may have the platform as near
            reach = proof.error[kept] + proof.error[k]
        else:  # within the ball in which there is only one solution, its own error included
            reach = proof.unique[kept] - np.nan_to_num(proof.error[k])
        if not (apart < np.where(np.isnan(reach), BLURRED * problem.length, reach)).any():
            kept.append(int(k))
    return poses[kept], Certificate(proof.ok[kept], proof.error[kept], proof.unique[kept])


def certify_rows(problem: AssemblyProblem, poses: FloatArray) -> Certificate:
    """Certify poses (N, 6), each at its own coordinates: `problem.q` is (N, n)."""
    ok, error, unique = np.zeros(len(poses), dtype=bool), *np.full((2, len(poses)), np.nan)
    solved = np.isfinite(poses).all(axis=1)
    machine = problem.machine
    of_chains = isinstance(machine, ChainMachine) and machine.rows == machine.m
    if (problem.provable or of_chains) and solved.any():
        for part in np.array_split(np.flatnonzero(solved), 1 + solved.sum() // AT_ONCE):
            if isinstance(machine, ChainMachine):
                proof = certify_chains(machine, problem.slots, poses[part], problem.q[part])
            else:
                u = _scaled(frames_of(poses[part]), problem.length)
                proof = certify(problem._replace(q=problem.q[part]).closures(), u)
            ok[part], error[part], unique[part] = proof.ok, proof.error, proof.unique
    return Certificate(ok, error, unique)


def pose_distance(poses: FloatArray, pose: FloatArray, length: float) -> FloatArray:
    """Distance of poses (N, 6) from one (1, 6), mm: of p, and largest entry of R times length."""
    difference = _scaled(frames_of(poses) - frames_of(pose), length)
    return np.asarray(np.abs(difference).max(axis=1, initial=0.0) * length)


def nearest_first(poses: FloatArray, pose: FloatArray, length: float) -> IntArray:
    """Order of poses (N, 6) by `pose_distance` from one (1, 6).

    Poses equally far, as symmetric machines have them, come in the order of R and p, so that
    rounding does not decide.
    """
    apart = pose_distance(poses, pose, length)
    order = np.argsort(apart)
    step = np.diff(apart[order], prepend=apart[order[:1]]) > _EQUAL * length
    shell = np.empty(len(poses), dtype=np.intp)
    shell[order] = np.cumsum(step)
    entries = np.round(_scaled(frames_of(poses), length), _DECIMALS)
    return np.lexsort((*entries.T[::-1], shell))


def signs(problem: AssemblyProblem, poses: FloatArray) -> Signs:
    """Sign of the closures' determinant at poses (N, 6); 0 where it has none."""
    if problem.machine.rows != problem.machine.m:
        return np.zeros(len(poses), dtype=np.int8)
    q = np.ascontiguousarray(np.broadcast_to(problem.q, (len(poses), len(problem.q))))
    steps = problem.machine.closure(problem.slots, poses, q).by_step
    known = np.isfinite(steps).all(axis=(1, 2))
    found = np.zeros(len(poses), dtype=np.int8)
    found[known] = np.sign(np.linalg.det(steps[known]))
    return found


def mirror_images(problem: AssemblyProblem, poses: FloatArray) -> Int32Array:
    """Index of each pose's mirror image in the plane of the anchors; -1 where none is."""
    none = np.full(len(poses), -1, dtype=np.int32)
    if isinstance(problem.machine, ChainMachine) or not problem.machine.fixed_spheres:
        return none
    spheres, frames = problem.spheres(), frames_of(poses)
    b, c = spheres[:, 0:3], spheres[:, 3:6]
    if problem.map in ("planar", "xy") or not len(poses):
        return none
    if problem.map == "translation":
        b, c = np.zeros_like(b), c - b
    base, platform = _plane(c), _plane(b)
    if base is None or platform is None:
        return none
    flip, turn = (np.eye(3) - 2.0 * np.outer(axis, axis) for axis, _ in (base, platform))
    at, over = base[1], 2.0 * platform[1] * platform[0]
    R, p = frames[:, :9].reshape(-1, 3, 3), frames[:, 9:]
    image = frames.copy()
    if problem.map != "translation":
        image[:, :9] = (flip @ R @ turn).reshape(-1, 9)
    image[:, 9:] = p @ flip + 2.0 * at * base[0] + (R @ over) @ flip
    near = np.abs(_scaled(image[:, None] - frames[None], problem.length)).max(axis=2)
    which = near.argmin(axis=1)
    return np.where(near.min(axis=1) < 1e-7, which, none).astype(np.int32)


def continue_path(problem: AssemblyProblem, pose: FloatArray, way: FloatArray) -> FloatArray:
    """Follow a pose (1, 6) while the actuators go by the rows of `way` (N, n) to `problem.q`.

    The pose there; NaN where a type-2 singularity is on the way.
    """
    machine, slots = problem.machine, problem.slots
    at, side = pose, 0.0
    for q in way[:, None]:
        at, status, _, _ = machine.forward(slots, q, at, threads=1)
        if status[0]:
            return np.full((1, 6), np.nan)
        if machine.rows == machine.m:
            now = np.sign(np.linalg.det(machine.closure(slots, at, q).by_step[0]))
            if now * side < 0:
                return np.full((1, 6), np.nan)
            side = now
    return at


def _plane(points: FloatArray) -> tuple[FloatArray, float] | None:
    """Unit normal and distance from the origin of the plane of points, if they have just one."""
    middle = points.mean(axis=0)
    if not np.ptp(points, axis=0).any():  # joints in one point: any plane through it will do
        return np.array([0.0, 0.0, 1.0]), float(middle[2])
    _, spread, axes = np.linalg.svd(points - middle)
    if spread[1] <= FLAT * spread[0] or spread[-1] > FLAT * spread[0]:
        return None
    return axes[-1], float(axes[-1] @ middle)


def assemblies(
    problem: AssemblyProblem,
    found: Found,
    order: IntArray,
    *,
    poses: FloatArray,
    distance: Callable[[FloatArray], FloatArray],
    feasible: Callable[[], BoolArray],
    continued: Callable[[FloatArray, ArrayLike | None, int], FloatArray],
) -> Assemblies:
    """Collect modes in `order` with their `poses` in the user's frames; calls as `Assemblies`'."""
    proof, ends = found.proof, found.ends
    own = found.poses[order]
    return Assemblies(
        poses=poses,
        certified=np.asarray(proof.ok[order]),
        error=proof.error[order],
        unique=proof.unique[order],
        complete=found.complete,
        reason=found.reason,
        sign=signs(problem, own),
        mirror=mirror_images(problem, own),
        paths=ends.paths if ends else 0,
        far=ends.far if ends else 0,
        lost=ends.lost if ends else 0,
        _distance=distance,
        _feasible=feasible,
        _continued=continued,
    )
