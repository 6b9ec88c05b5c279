"""Digests of what every call of the core returns: ``python -m benchmarks.digest``.

A line for each ISA, machine and call with the SHA-256 of its results at 20 000 rows. Two versions of
the core whose lines are equal give the same bits: compare the output of one with that of the other.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator

import numpy as np

import pkmcal as pk
from pkmcal.core import instruments, library, paths, screws
from pkmcal.core import poses as core_poses
from pkmcal.core.random import Normals
from pkmcal.core.screws import FRAMES
from pkmcal.core.statistics import Bins, Stream
from pkmcal.core.swarm import PAPER, Swarm, SwarmSettings, minimise_eq18
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.kinematics.limb_residual import LimbResidual
from pkmcal.kinematics.perturbed import Geometries
from pkmcal.modes.homotopy import start_system

ROWS = 20_000
FEW = 50  # rows of what is not done by the thousand
Call = tuple[str, Callable[[], object]]


def digest(result: object) -> str:
    """SHA-256 of an array, or of arrays one after the other; all NaN are one."""
    sha = hashlib.sha256()
    for each in result if isinstance(result, tuple | list) else (result,):
        array = np.array(each)
        if array.dtype.kind in "fc":
            parts = array.view(np.float64)
            parts[np.isnan(parts)] = np.nan
        sha.update(str(array.shape).encode() + array.tobytes())
    return sha.hexdigest()


def of_machine(name: str) -> Iterator[Call]:
    """Every call of a parallel machine, a twentieth of the rows out of reach or not finite."""
    robot = pk.load(name)
    machine, slots, model = robot.machine, robot.slots, robot.model
    rng = np.random.default_rng(1)
    spread = np.array([30.0, 30.0, 30.0, 0.2, 0.2, 0.2])
    free = np.isin(library.POSE, library.MAPS[model.map])
    poses = model.home + free * spread * rng.uniform(-1, 1, (ROWS, 6))
    poses[::40, 2] += 5e3
    poses[20::40, 0] = np.nan
    q = machine.inverse(slots, poses)
    q[::100] = slots[0, 0]
    home = np.ascontiguousarray(model.home, dtype=np.float64)
    found = machine.forward(slots, q, home, 1)[0]
    solved = np.concatenate([home[None], found[np.isfinite(found).all(axis=1)]])
    own = machine.inverse(slots, solved)
    bend = rng.normal(size=(2, *own.shape))
    places = np.arange(len(model.geometry.numbers))
    places = np.array([k for k in places if model.geometry.numbers[k].tie is None])
    columns = np.ascontiguousarray(np.sort(model.geometry.slot_index[places]), dtype=np.int32)
    errors = 0.1 * rng.uniform(-1, 1, (ROWS, len(places)))
    geometries = Geometries(model.geometry, places, ROWS).with_errors(errors).copy()
    motion = rng.normal(size=(ROWS, 3, 4, 4))
    motion[:, 0] = screws.joint_motions(poses, np.zeros((ROWS, 3))).reshape(-1, 4, 4)
    yield "with_errors", lambda: geometries
    yield "inverse", lambda: machine.inverse(slots, poses)
    yield "forward", lambda: machine.forward(slots, q, home, 1)
    yield "forward, threads", lambda: machine.forward(slots, q, home, 2)
    yield "forward, own guesses", lambda: machine.forward(slots, q, poses, 1)
    yield "forward, own geometries", lambda: machine.forward(geometries, q, home, 1)
    yield "jacobian", lambda: machine.jacobian(slots, poses)
    yield "forward_jacobian", lambda: machine.forward_jacobian(slots, solved, own)
    yield "error_jacobian", lambda: machine.error_jacobian(slots, solved, own, columns)
    yield (
        "error_jacobian, twists",
        lambda: machine.error_jacobian(slots, solved, own, columns, True),
    )
    yield "rates", lambda: machine.rates(slots, motion, q)
    yield "motion", lambda: machine.motion(slots, solved, own, bend[0], bend[1])
    yield "closure", lambda: machine.closure(slots, poses, q)
    yield "spheres", lambda: machine.spheres(slots, q)
    yield "limbs", lambda: machine.limbs(slots, poses)
    yield "closure_cost", lambda: LimbResidual(robot, solved[:FEW], own[:FEW]).of_slots(geometries)
    kinds = [KINDS[limb.kind].all_rows(limb.couple > 0.0) for limb in model.limbs]
    spheres = machine.spheres(slots, own[:1])[0]
    start = start_system(model.map, kinds, spheres)
    if start is not None and machine.rows == machine.m:
        scaled = spheres / np.repeat([300.0, 1.0], [7, spheres.shape[-1] - 7])
        yield "paths", lambda: paths.follow(machine, start.limbs, scaled, start.states, 5e-3)


def of_arm(name: str) -> Iterator[Call]:
    """Every call of a serial arm, with errors shared and of each row."""
    arm = pk.load(name)
    core_arm = arm.core
    rng = np.random.default_rng(2)
    theta = rng.uniform(-3, 3, (ROWS, arm.n_joints))
    theta[::50, 0] = np.nan
    shared = 0.01 * rng.uniform(-1, 1, (arm.n_joints, 6))
    for rows, errors in (
        ("shared", shared),
        ("by row", shared * rng.uniform(-1, 1, (ROWS, 1, 1))),
    ):
        links = core_arm.links(errors)
        yield f"arm_links, {rows}", lambda links=links: links.numbers
        yield f"arm_forward, {rows}", lambda links=links: core_arm.forward(theta, links, 1)
        for frame in range(len(FRAMES)):
            yield (
                f"arm_jacobian, {rows}, {FRAMES[frame]}",
                lambda links=links, frame=frame: core_arm.jacobian(theta, links, frame),
            )
            yield (
                f"arm_error_jacobian, {rows}, {FRAMES[frame]}",
                lambda links=links, frame=frame: core_arm.error_jacobian(theta, links, frame),
            )


def of_rows() -> Iterator[Call]:
    """Every call that knows no machine: frames, readings, screws, the closed forms."""
    rng = np.random.default_rng(3)
    poses = rng.uniform(-3, 3, (ROWS, 6)) * [200, 200, 200, 1, 1, 1]
    others = rng.uniform(-3, 3, (ROWS, 6)) * [50, 50, 50, 1, 1, 1]
    points, ends = rng.uniform(-300, 300, (2, ROWS, 3))
    twists = rng.uniform(-4, 4, (ROWS, 6)) * 10.0 ** rng.uniform(-9, 0, (ROWS, 1))
    poses[::50, 3], twists[::50, 1], points[7::50, 2] = np.nan, np.nan, np.nan
    one, other = poses[1], others[1]
    seen = core_poses.compose(one, others)
    free = rng.uniform(-1, 1, (ROWS, 4)) * [100, 50, 0.4, 0.4] + [0, 400, 0, 0]
    size = np.array([300.0, 200.0, 150.0, 250.0, 500.0, 400.0])
    motions = screws.exp(twists)
    closed = np.empty((ROWS, 4)), np.empty((ROWS, 4, 4))
    yield "compose, one and many", lambda: core_poses.compose(one, others)
    yield "compose, many and one", lambda: core_poses.compose(poses, other)
    yield "compose, many and many", lambda: core_poses.compose(poses, others)
    yield "invert", lambda: [core_poses.invert(pose) for pose in poses[:FEW]]
    yield "compose_rates", lambda: core_poses.compose_rates(one, others, other, seen)
    yield "compose_rates, own tools", lambda: core_poses.compose_rates(one, others, poses, seen)
    yield "compose_twists", lambda: core_poses.compose_twists(one, others, other)
    yield (
        "tpr2tps_lengths",
        lambda: (core_poses.tpr2tps_lengths(size, free, closed[0]), closed[0])[1:],
    )
    yield (
        "tpr2tps_jacobian",
        lambda: (core_poses.tpr2tps_jacobian(size, free, closed[1]), closed[1])[1:],
    )
    yield "points", lambda: instruments.points(poses, points)
    yield "points, one target", lambda: instruments.points(poses, points[0])
    yield "seen_points", lambda: instruments.seen_points(one, points)
    yield "distances", lambda: instruments.distances(poses, points, ends)
    yield "distances, one target", lambda: instruments.distances(poses, points[0], ends[0])
    yield "exp", lambda: motions
    yield "log", lambda: screws.log(motions)
    yield "adjoint", lambda: screws.adjoint(motions)
    yield "motion_pose", lambda: screws.pose(motions)
    yield "exp_jacobian", lambda: screws.exp_jacobian(twists, False)
    yield "log_jacobian", lambda: screws.exp_jacobian(twists, True)
    yield "joint_motions", lambda: screws.joint_motions(twists, points)


def of_chance() -> Iterator[Call]:
    """Normal numbers, their counts, and swarms."""
    numbers = [Normals(np.random.SeedSequence(4)).fill(np.empty(n)) for n in (ROWS, 1003)]
    values = numbers[0].reshape(4, -1)
    stream = Stream(Bins.around(values[:, :1000].copy()))

    def steps() -> list[object]:
        lower, upper = np.array([-2.0, -1.0, 0.0]), np.array([1.0, 3.0, 2.0])
        swarm, seen = Swarm(PAPER, lower, upper, 5), []
        for _ in range(20):
            positions = swarm.positions
            swarm.update_best((positions**2).sum(axis=1))
            swarm.move()
            seen += [positions, *swarm.best]
        return seen

    yield "normals", lambda: numbers
    yield "count", lambda: (stream.add(values), stream.quantile(0.95), stream.mean)[1:]
    yield "swarm", steps
    settings = SwarmSettings(particles=37, iterations=30)
    off = values[:, : 60 * FEW].reshape(FEW, 60, 4)
    yield "swarm_eq18", lambda: minimise_eq18(settings, off, np.full(4, 3.0), 6)


def show(subject: str, calls: Iterable[Call]) -> None:
    """A line for each call: ISA, what it is of, its name, and the digest."""
    for name, call in calls:
        print(library.ISAS[library.ISA], subject, name, digest(call()), sep="\t", flush=True)


def main() -> None:
    """Run every call in this process, or in one process for each ISA this processor has."""
    if "PKMCAL_ISA" not in os.environ:
        for isa in library.ISAS[: library.lib.pkm_best_isa() + 1]:
            command = [sys.executable, "-m", "benchmarks.digest"]
            subprocess.run(command, env={**os.environ, "PKMCAL_ISA": isa}, check=True)
        return
    show("rows", of_rows())
    show("chance", of_chance())
    for name in pk.machines():
        is_arm = isinstance(pk.load(name), pk.SerialArm)
        show(name, of_arm(name) if is_arm else of_machine(name))


if __name__ == "__main__":
    main()
