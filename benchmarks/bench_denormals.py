"""Numbers too small for full precision: what they cost the core, and the core at one lane.

At one lane with floats in pairs two floats leave half of a register unused, and what is left there
may be such a number. It changes no result, but every instruction on it waits for the processor's
assistance. With such numbers counted as 0 these pairs are as fast as they can be, so that is what the
core is compared with.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import pkmcal as pk
from benchmarks import native
from benchmarks.bench_forward import forward
from benchmarks.timing import Report, medians, nanoseconds, times
from tests.workspaces import poses

ROWS = 20_000
MACHINES = ("hexapod", "2tpr2tps", "rbt-6t03p", "rotary-delta")
HEADS = ("machine", "ISA", "core, ns", "flushed", "ratio", "in pairs, ns", "flushed", "ratio")


def main() -> None:
    report, rows = Report("Denormals"), []
    with tempfile.TemporaryDirectory() as folder:
        lane = native.OneLane(Path(folder), joined=2)

        def flushing(on: bool, run: Callable[[], pk.Forward]) -> Callable[[], pk.Forward]:
            def flushed() -> pk.Forward:
                lane.flush_denormals(on)
                found = run()
                lane.flush_denormals(False)
                return found

            return flushed

        for name in MACHINES:
            q = pk.load(name).inverse(poses(name, ROWS))
            for isa in native.available():
                solve = forward(name, isa)

                def one_lane(
                    solve: Callable[[np.ndarray], pk.Forward] = solve, q: np.ndarray = q
                ) -> pk.Forward:
                    with lane:
                        return solve(q)

                runs: dict[str, Callable[[], pk.Forward]] = {
                    "core": lambda solve=solve, q=q: solve(q),
                    "lane": one_lane,
                }
                cells = [name, isa]
                for run in runs.values():  # apart: wide registers need time to wake up
                    cases = {"plain": flushing(False, run), "flushed": flushing(True, run)}
                    if cases["plain"]().pose.tobytes() != cases["flushed"]().pose.tobytes():
                        raise RuntimeError(f"{name}, {isa}: flushing changes results")
                    took = medians(cases, 11, time.thread_time)
                    cells += [nanoseconds(seconds, ROWS) for seconds in took.values()]
                    cells.append(times(took["plain"] / took["flushed"]))
                rows.append(cells)
    report.text(f"Forward kinematics, {ROWS} rows, one thread, ns a row of processor time.")
    report.table(HEADS, rows)
    report.write("denormals")


if __name__ == "__main__":
    main()
