"""Round trips from a pose over the actuators back to a pose, judged row by row.

A machine with random errors in every number is driven to random poses of its workspace, and forward
kinematics, cold from home, has to find them again. A row is *returned* to the pose, or in a valid
*other* assembly mode, or *flagged* by its status. What is none of these is *wrong*, and there must
be none. The judge is `twin_rows`, which knows nothing of the core.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

import pkmcal as pk
from pkmcal.core.library import STATUS

from . import twin_rows
from .workspaces import poses

SIGMA = {"mm": 0.5, "rad": 1e-3, "1": 1e-3}  # of the error of each number
RETURNED = 1e-8  # mm; of an angle its arc at the characteristic length
OTHER = 1e-3  # mm, from which a pose is another one and not the same one badly solved
CLOSED = 1e-8  # mm, to which an other mode meets the closures
ON_THE_MANIFOLD = 1e-9  # mm, to which the wanted poses do
# limbs that leave no six numbers free
CONSTRAINED = ("2tpr2tps-spatial", "3rps", "3prs", "linear-delta-6")
OWN_GEOMETRY = 4  # every fourth chunk has a geometry of its own in each row


class Counts(NamedTuple):
    """What became of the rows; `flagged` by status, `worst` the largest error of a returned row."""

    rows: int
    returned: int
    other: int
    flagged: tuple[int, ...]
    wrong: int
    worst: float

    @property
    def ok(self) -> int:
        """Rows that came with a pose."""
        return self.returned + self.other + self.wrong

    def __add__(self, more: Counts) -> Counts:  # type: ignore[override]
        sums = [a + b for a, b in zip(self[:3], more[:3], strict=True)]
        flagged = tuple(a + b for a, b in zip(self.flagged, more.flagged, strict=True))
        worst = max(self.worst, more.worst)
        return Counts(*sums, flagged, self.wrong + more.wrong, worst)

    def __str__(self) -> str:
        flags = ", ".join(
            f"{count} {STATUS[code]}" for code, count in enumerate(self.flagged, 1) if count
        )
        return (
            f"{self.rows} rows: {self.returned} returned (worst {self.worst:.1e} mm), "
            f"{self.other} in another mode, flagged {flags or 'none'}, {self.wrong} wrong"
        )


class Trip(NamedTuple):
    """Rows of one chunk: geometry (shared or one each), coordinates, and pose they come from."""

    slots: np.ndarray
    q: np.ndarray
    wanted: np.ndarray
    pose: np.ndarray
    status: np.ndarray


def errors(robot: pk.Robot, rng: np.random.Generator, *shape: int) -> np.ndarray:
    """Random errors (*shape, p) of every number."""
    sigma = np.array([SIGMA[unit] for unit in robot.geometry.units])
    return sigma * rng.standard_normal((*shape, len(sigma)))


def shared_geometry(robot: pk.Robot, name: str, rows: int, seed: int) -> Trip:
    """One machine with errors at random poses, through the public interface."""
    rng, at = np.random.default_rng(seed), poses(name, rows, seed)
    true = robot.replace(robot.geometry.values + errors(robot, rng))
    if name in CONSTRAINED:  # where the ideal machine's commands lead it
        at = true.forward(robot.inverse(at), guess=at).pose
    q = true.inverse(at)
    found = true.forward(q)
    return Trip(true.geometry.slots, q, at, found.pose, found.status)


def own_geometry(robot: pk.Robot, name: str, rows: int, seed: int) -> Trip:
    """As many machines with errors as rows, each driven to one pose by the ideal one's commands."""
    rng, at = np.random.default_rng(seed), poses(name, rows, seed)
    slots = np.tile(robot.geometry.slots.ravel(), (rows, 1))
    slots[:, robot.geometry.slot_index] += errors(robot, rng, rows)
    slots = slots.reshape(rows, *robot.geometry.slots.shape)
    q = robot.inverse(at)
    wanted = robot.machine.forward(slots, q, at, None)[0]
    pose, status, _, _ = robot.machine.forward(slots, q, robot.home, None)
    return Trip(slots, q, wanted, pose, status)


def judge(robot: pk.Robot, trip: Trip) -> Counts:
    """Count what became of the rows of one chunk."""
    rows = len(trip.q)
    known = np.isfinite(trip.wanted).all(axis=1)
    missed = twin_rows.closures(robot.model, trip.wanted, trip.q, trip.slots)
    assert np.abs(missed[known]).max() < ON_THE_MANIFOLD
    solved = trip.status == 0
    assert np.isfinite(trip.pose[solved]).all() and np.isnan(trip.pose[~solved]).all()
    off = trip.pose - trip.wanted
    off[:, 3:] = robot.length * ((off[:, 3:] + np.pi) % (2.0 * np.pi) - np.pi)
    distance = np.abs(off).max(axis=1)
    returned = solved & (distance <= RETURNED)
    others = np.flatnonzero(solved & ~returned)
    slots = trip.slots[others] if trip.slots.ndim == 3 else trip.slots
    missed = twin_rows.closures(robot.model, trip.pose[others], trip.q[others], slots)
    apart = (distance[others] > OTHER) | ~known[others]
    valid = (np.abs(missed).max(axis=1, initial=0.0) <= CLOSED) & apart
    return Counts(
        rows,
        int(returned.sum()),
        int(valid.sum()),
        tuple(int((trip.status == code).sum()) for code in range(1, len(STATUS))),
        int((~valid).sum()),
        float(distance[returned].max(initial=0.0)),
    )


def chunks(name: str, rows: int, chunk: int, seed: int = 0) -> Iterator[Counts]:
    """Counts of every chunk of round trips of a built-in machine, each with errors of its own."""
    robot = pk.load(name)
    for k in range(rows // chunk):
        way = own_geometry if k % OWN_GEOMETRY == OWN_GEOMETRY - 1 else shared_geometry
        yield judge(robot, way(robot, name, chunk, seed + k))


def round_trips(name: str, rows: int, chunk: int, seed: int = 0) -> Counts:
    """Counts over all chunks."""
    first, *rest = chunks(name, rows, chunk, seed)
    return sum(rest, first)
