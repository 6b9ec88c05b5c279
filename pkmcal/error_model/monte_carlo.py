"""Many machines with random errors, solved exactly, in chunks of a fixed size.

Own code, because memory must not grow with the number of machines and the result must be the same
bits with any executor. Each chunk has a seed of its own and is combined in its place, so that the
numbers depend neither on how many workers there are nor on which is first.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from pkmcal import arguments
from pkmcal.arrays import FloatArray, IntArray
from pkmcal.core.random import Normals
from pkmcal.core.statistics import Bins, Stream, pose_errors
from pkmcal.geometry.model import Model
from pkmcal.kinematics.perturbed import Geometries, forward_of
from pkmcal.kinematics.robot import Robot
from pkmcal.progress import Progress

CHUNK = 16_384  # machines that share a seed
BATCH = 1_024  # of these solved at a time: what fits the cache
POSES = 16  # solved by one task
PILOT = 1_024  # machines that determine how wide the bins must be; one batch
AHEAD = 32  # tasks that are handed to an executor before the first of them is looked at

QUANTITIES = ("x", "y", "z", "alpha", "beta", "gamma", "distance")
Found = TypeVar("Found")


@dataclass(frozen=True, eq=False)
class Draw:
    """One task: a number of machines at some poses.

    Attributes
    ----------
    model : Model
        The machine without errors.
    places : ndarray of int (k,)
        Which names have errors.
    sigma : ndarray (k,)
        Their standard deviations.
    poses, actuators : ndarray (P, 6), (P, n)
        Ideal poses and what leads there.
    seed : SeedSequence
        Of this chunk.
    count : int
        How many machines.
    bins : tuple of Bins
        Of each pose.
    """

    model: Model
    places: IntArray
    sigma: FloatArray
    poses: FloatArray
    actuators: FloatArray
    seed: np.random.SeedSequence
    count: int
    bins: tuple[Bins, ...] = ()

    def errors(self) -> Iterator[list[FloatArray]]:
        """Pose errors of a batch of machines after the other: for each pose (7, n)."""
        robot = Robot(self.model)
        normals = Normals(self.seed)
        errors = np.empty((min(BATCH, self.count), len(self.sigma)))
        geometries = Geometries(robot.geometry, self.places, len(errors))
        for start in range(0, self.count, BATCH):
            drawn = normals.fill(errors[: self.count - start])
            drawn *= self.sigma
            found = forward_of(robot, geometries.with_errors(drawn), self.actuators, self.poses)
            yield [pose_errors(*each) for each in zip(found, self.poses, strict=True)]

    def run(self) -> list[Stream]:
        """Moments and counts of each pose."""
        streams = [Stream(bins) for bins in self.bins]
        for batch in self.errors():
            for stream, values in zip(streams, batch, strict=True):
                stream.add(values)
        return streams

    def farthest(self) -> FloatArray:
        """Largest size over the poses of each of `QUANTITIES` for each machine, (7, count)."""
        batches = [np.abs(batch).max(axis=0) for batch in self.errors()]  # NaN where one is NaN
        return np.concatenate(batches, axis=1)


def simulate(
    draw: Draw, executor: Executor | None = None, progress: Progress | None = None
) -> Iterator[Stream]:
    """Pose errors of ``draw.count`` machines, one pose after the other.

    Parameters
    ----------
    draw : Draw
        All machines and all poses; its seed is the root of all seeds, its bins are found here.
    executor : Executor, optional
        Whose workers solve the chunks: threads, processes, Dask, MPI.
    progress : callable, optional
        Called with the poses solved so far and those there are, all machines counted.

    Yields
    ------
    Stream
        Of `QUANTITIES`, for each pose; the same bits with any executor.
    """
    workers = arguments.executor(executor)
    if progress is not None:
        arguments.function("progress", progress)
    chunks, pilot_seed = _chunks(draw)

    def tasks() -> Iterator[Draw]:
        for block in _blocks(draw):
            (pilot,) = replace(block, seed=pilot_seed, count=PILOT).errors()
            bins = tuple(Bins.around(v[:, np.isfinite(v).all(axis=0)]) for v in pilot)
            for seed, count in chunks:
                yield replace(block, seed=seed, count=count, bins=bins)

    done, combined = 0, list[Stream]()
    for place, (task, found) in enumerate(_in_order(Draw.run, tasks(), workers)):
        if place % len(chunks) == 0:
            combined = found
        else:
            for stream, other in zip(combined, found, strict=True):
                stream.merge(other)
        done += task.count * len(task.poses)
        if progress is not None:
            progress(done, draw.count * len(draw.poses))
        if place % len(chunks) == len(chunks) - 1:
            yield from combined


def farthest(draw: Draw, executor: Executor | None = None) -> FloatArray:
    """Largest pose error of each machine over all poses.

    Parameters
    ----------
    draw, executor
        See `simulate`; the machines are the same.

    Returns
    -------
    ndarray (7, count)
        Of `QUANTITIES`, their sizes; inf for a machine that has no pose at one of them.
    """
    workers = arguments.executor(executor)
    chunks, _ = _chunks(draw)
    largest = np.zeros((len(QUANTITIES), draw.count))
    tasks = (
        replace(block, seed=seed, count=count) for block in _blocks(draw) for seed, count in chunks
    )
    for place, (task, found) in enumerate(_in_order(Draw.farthest, tasks, workers)):
        first = place % len(chunks) * CHUNK
        part = largest[:, first : first + task.count]
        np.maximum(part, np.where(np.isnan(found), np.inf, found), out=part)
    return largest


def _chunks(draw: Draw) -> tuple[list[tuple[np.random.SeedSequence, int]], np.random.SeedSequence]:
    """Seed and size of each chunk of machines, and the seed of the pilot."""
    count = -(-draw.count // CHUNK)
    pilot, *seeds = draw.seed.spawn(count + 1)
    sizes = [CHUNK] * (count - 1) + [draw.count - CHUNK * (count - 1)]
    return list(zip(seeds, sizes, strict=True)), pilot


def _blocks(draw: Draw) -> Iterator[Draw]:
    """All machines at a few poses at a time."""
    for first in range(0, len(draw.poses), POSES):
        part = slice(first, first + POSES)
        yield replace(draw, poses=draw.poses[part], actuators=draw.actuators[part])


def _in_order(
    work: Callable[[Draw], Found], tasks: Iterator[Draw], executor: Executor | None
) -> Iterator[tuple[Draw, Found]]:
    """Each task with its result, in order; with an executor, `AHEAD` of them are on their way."""
    if executor is None:
        for task in tasks:
            yield task, work(task)
        return
    waiting: deque[tuple[Draw, Future[Found]]] = deque()
    try:
        for task in tasks:
            waiting.append((task, executor.submit(work, task)))
            if len(waiting) >= AHEAD:
                first, future = waiting.popleft()
                yield first, future.result()
        while waiting:
            first, future = waiting.popleft()
            yield first, future.result()
    finally:
        for _, future in waiting:
            future.cancel()
