"""Forward kinematics of machines of chains beside the same machines of fast limbs.

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
from tests.chain_files import as_chains
from tests.workspaces import CHAINS

ROWS = 20_000
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


if __name__ == "__main__":
    main()
