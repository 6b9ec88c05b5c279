"""Every complex solution of a machine's closures, followed from a start system where all are known.

The start systems are in ``modes.json``, which ``python -m derive.modes`` writes: of each kind of
machine limbs of random complex numbers, and all the poses that close there. While the limbs change
in a straight line to those of interest the solutions move along paths, which do not meet unless the
line runs into a singular system; a line from random complex numbers does not, save at its end.

That no path was mistaken for another is checked by its end: two that end in the same solution are
one too few. At infinity they may meet, so where paths go there, or beyond 100 000, all are
followed a second time by another way, with smaller steps, and have to end as before.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from itertools import pairwise

import numpy as np

from pkmcal.arrays import ComplexArray, FloatArray
from pkmcal.core.machine import Machine
from pkmcal.core.paths import ARRIVED, FAR, follow

ATTEMPTS = ((5e-3, 0), (1e-3, 1), (1e-3, 2), (3e-4, 3))  # accuracy, and which way round
MIDDLING = 1e3  # entries of R and scaled p: larger ones are known less well, and never real
SAME = 1e-7  # frames nearer than this, beside their size, are one


@dataclass(frozen=True, eq=False)
class StartSystem:
    """Limbs whose solutions are all known.

    Attributes
    ----------
    name : str
        Of the kind of machine.
    limbs : ndarray of complex (limbs, width)
        As `Machine.spheres` gives them, up to the last axis that a row has.
    states : ndarray of complex (N, k)
        Every solution, as a state of the pose map.
    """

    name: str
    limbs: ComplexArray
    states: ComplexArray


@dataclass(frozen=True, eq=False)
class Endpoints:
    """End points of the paths.

    Attributes
    ----------
    frames : ndarray of complex (k, 12)
        The finite ones: R row by row and p, mm.
    paths, far, lost : int
        How many there were, how many went to infinity (R or scaled p beyond 100 000 near the
        end), and how many failed or ran into another; -1 where two ways did not agree.
    """

    frames: ComplexArray
    paths: int
    far: int
    lost: int


@dataclass(frozen=True, eq=False)
class _Family:
    """Machines of one start system: pose map, rows of each limb, and numbers that are zero."""

    map: str
    rows: tuple[tuple[str, ...], ...]
    zero: tuple[tuple[int, int], ...]
    start: StartSystem


@cache
def _families() -> tuple[_Family, ...]:
    """Return start systems, those with the fewest paths first."""
    text = (files("pkmcal.modes") / "modes.json").read_text(encoding="utf-8")
    found = []
    for name, family in json.loads(text).items():
        limbs, states = (_complex(family[key]) for key in ("limbs", "states"))
        rows = tuple(tuple(kinds) for kinds in family["rows"])
        zero = tuple((limb, place) for limb, place in family["zero"])
        found.append(_Family(family["map"], rows, zero, StartSystem(name, limbs, states)))
    return tuple(sorted(found, key=lambda family: len(family.start.states)))


def _complex(pairs: list[object]) -> ComplexArray:
    array = np.ascontiguousarray(pairs, dtype=np.float64).view(np.complex128)
    found: ComplexArray = array[..., 0]
    return found


def start_system(map: str, rows: list[tuple[str, ...]], spheres: FloatArray) -> StartSystem | None:
    """The start system with the fewest paths for a machine, its limbs in their order; or None.

    Parameters
    ----------
    map : str
        Pose map.
    rows : list of tuple of str
        Of each limb, its rows beside the sphere.
    spheres : ndarray (limbs, 7 + 3 axes)
        The limbs; what is zero in a family has to be zero here.
    """
    for family in _families():
        if family.map != map or sorted(family.rows) != sorted(rows):
            continue
        left = list(range(len(rows)))
        order = []
        for kinds in rows:
            order.append(next(k for k in left if family.rows[k] == kinds))
            left.remove(order[-1])
        start = family.start
        if all(spheres[order.index(limb), place] == 0.0 for limb, place in family.zero):
            return StartSystem(start.name, start.limbs[order], start.states)
    return None


def endpoints(machine: Machine, start: StartSystem, map: str, spheres: FloatArray) -> Endpoints:
    """Follow every path to the limbs `spheres`; where some fail, again."""
    target, scale, middle_b, middle_c = _normalized(map, spheres)
    n, every, before = len(start.states), np.empty((0, 12), dtype=np.complex128), None
    for accuracy, way in ATTEMPTS:
        frames, far = _track(machine, start, target, accuracy, way)
        lost = n - far - len(frames)
        every = distinct(np.concatenate([every, frames]))
        if len(every) == n:  # there are no more, whichever way they were found
            far = lost = 0
            break
        if lost == 0:
            if before is not None and _same_solutions(frames, before):
                every = frames
                break
            before, lost = frames, -1
    turned = every[:, :9].reshape(-1, 3, 3)
    every[:, 9:] = scale * every[:, 9:] - turned @ middle_b + middle_c
    return Endpoints(every, n, far, lost)


def _same_solutions(one: ComplexArray, other: ComplexArray) -> bool:
    """Return whether two sets of frames hold the same solutions of a middling size or less."""
    one, other = (each[np.abs(each).max(axis=1) < MIDDLING] for each in (one, other))
    return len(one) == len(other) == len(distinct(np.concatenate([one, other])))


def _track(
    machine: Machine, start: StartSystem, target: FloatArray, accuracy: float, way: int
) -> tuple[ComplexArray, int]:
    """The different finite ends of all paths, and how many went to infinity."""
    corners = [start.limbs, target.astype(np.complex128)]
    if way:  # through other limbs, random as the start
        rng, shape = np.random.default_rng(way), start.limbs.shape
        turn = np.exp(2j * np.pi * rng.random(shape))
        corners.insert(1, start.limbs * turn * rng.uniform(0.5, 1.5, shape))
    states, arrived = start.states, np.ones(len(start.states), dtype=bool)
    for a, b in pairwise(corners):
        paths = follow(machine, a, b, states, accuracy)
        states, before = paths.state, arrived
        arrived = before & (paths.status == ARRIVED)
    return distinct(paths.frame[arrived]), int(np.sum(before & (paths.status == FAR)))


def distinct(frames: ComplexArray) -> ComplexArray:
    """The frames (N, 12) without those that are there already."""
    if not len(frames):
        return frames
    size = np.maximum(1.0, np.abs(frames).max(axis=1))
    apart = np.abs(frames[:, None] - frames[None]).max(axis=2) / np.maximum(size, size[:, None])
    first = np.argmax(apart < SAME, axis=1)
    kept: ComplexArray = frames[first == np.arange(len(frames))]
    return kept


def _normalized(map: str, spheres: FloatArray) -> tuple[FloatArray, float, FloatArray, FloatArray]:
    """Limbs moved to the origin and scaled to the size of random ones; scale and both centres."""
    scaled = spheres.copy()
    b, c = spheres[:, 0:3], spheres[:, 3:6]
    middle_b, middle_c = b.mean(axis=0), c.mean(axis=0)
    if map in ("planar", "xy"):
        middle_b[2] = middle_c[2] = 0.0
    if map == "2tpr2tps":  # its poses are about the origins
        middle_b, middle_c = np.zeros(3), np.zeros(3)
    scaled[:, 0:3] -= middle_b
    scaled[:, 3:6] -= middle_c
    scale = float(np.sqrt((scaled[:, :7] ** 2).sum(axis=1).mean() / 9.0))
    scaled[:, :7] /= scale
    return scaled, scale, middle_b, middle_c
