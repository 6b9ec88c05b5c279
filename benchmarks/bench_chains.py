"""Forward kinematics of machines of chains beside the same machines of fast limbs, and how their
poses move with their numbers beside solving again.

python -m benchmarks.bench_chains
"""

from __future__ import annotations

import os
import tempfile
import time
from functools import partial
from pathlib import Path

import numpy as np

import pkmcal as pk
from benchmarks.timing import medians
from tests import solved_again
from tests.chain_files import as_chains
from tests.workspaces import CHAINS

ROWS = 20_000
FEW = 64  # rows of error Jacobians
REACH = {"mm": 15.0, "rad": 0.1}  # of the actuators about home
NAMES = ("hexapod", "rbt-6t03p", "3rps")
AXES = "axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]"  # of an S, which is then no ball


def machines(folder: Path) -> dict[str, pk.Robot]:
    """Fast limbs, the same as chains that end in balls and in three joints, and what is built in."""
    found: dict[str, pk.Robot] = {}
    for name in NAMES:
        robot = found[f"{name}, fast limbs"] = pk.load(name)
        text = as_chains(robot)
        for kind, written in (("balls", text), ("six rows", with_axes(text))):
            file = folder / "chains.toml"
            file.write_text(written, encoding="utf-8")
            found[f"{name}, chains, {kind}"] = pk.load(file)
    return found | {name: pk.load(name) for name in CHAINS}


def with_axes(text: str) -> str:
    """Every ball as three joints."""
    return text.replace('kind = "S"', f'kind = "S", {AXES}')


def main() -> None:
    """Print microseconds a pose, cold from home: of one thread, and as it is called by itself."""
    with tempfile.TemporaryDirectory() as folder:
        robots = machines(Path(folder))
    random = np.random.default_rng(0)
    alone, together, said = {}, {}, {}
    for name, robot in robots.items():
        way = np.array([REACH[unit] for unit in robot.actuator_units])
        q = robot.inverse(robot.home) + random.uniform(-way, way, (ROWS, robot.n_actuators))
        found = robot.forward(q)
        said[name] = f"{found.iterations.mean():5.2f} steps, {100 * found.ok.mean():.2f} % ok"
        alone[name] = partial(robot.forward, q, threads=1)
        together[name] = partial(robot.forward, q)
    by_one = medians(alone, rounds=7, clock=time.thread_time)
    by_all = medians(together, rounds=7, clock=time.perf_counter)
    print(f"µs a pose, one thread and all of {os.cpu_count()} processors")
    for name in robots:
        each = (1e6 * found[name] / ROWS for found in (by_one, by_all))
        print(f"{name:32}" + "".join(f" {one:7.3f}" for one in each) + f"   {said[name]}")
    bench_errors({name: robots[name] for name in CHAINS})


def bench_errors(robots: dict[str, pk.Robot]) -> None:
    """Print microseconds a row of the error Jacobian by all numbers, one with errors in each."""
    random = np.random.default_rng(0)
    print("µs a row, how the pose moves with all numbers, and by differences of solving again")
    for name, exact in robots.items():
        sigma = {"mm": 0.1, "rad": 3e-4, "1": 1e-5}
        wrong = [sigma[unit] * random.normal() for unit in exact.geometry.units]
        robot = exact.replace(exact.geometry.values + wrong)
        q = np.tile(robot.inverse(exact.home), (FEW, 1))
        found = robot.forward(q)
        columns = robot.geometry.slot_index.astype(np.int32)
        given = (robot.slots, found.pose, q, columns, True)
        cases = {
            "": partial(robot.machine.error_jacobian, *given),
            "again": partial(solved_again.by_numbers, robot, found.pose, q),
        }
        each = medians(cases, rounds=5, clock=time.thread_time)
        print(
            f"{name:32}" + "".join(f" {1e6 * seconds / FEW:9.1f}" for seconds in each.values()),
            f"  {len(columns)} numbers, misses {found.residual.max():.2g} mm",
        )


if __name__ == "__main__":
    main()
