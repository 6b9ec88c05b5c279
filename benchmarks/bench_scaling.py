"""Time and memory of a batch from a thousand to ten million rows."""

from __future__ import annotations

import gc
import statistics
import time
import tracemalloc
from collections.abc import Callable

import numpy as np

import pkmcal as pk
from benchmarks.timing import Report, nanoseconds, times
from tests.workspaces import poses

SIZES = (1_000, 10_000, 100_000, 1_000_000, 10_000_000)


def rows_of(count: int) -> np.ndarray:
    """Poses of the hexapod, in parts that repeat: ten million random ones are not needed."""
    return np.tile(poses("hexapod", min(count, 100_000)), (max(count // 100_000, 1), 1))


def seconds(run: Callable[[], object], count: int) -> float:
    """Median of some runs, fewer of the long ones; nothing of one is kept for the next."""
    found = []
    for _ in range(max(3, min(51, 2_000_000 // count))):
        start = time.perf_counter()
        run()
        found.append(time.perf_counter() - start)
    return statistics.median(found)


def peak(run: Callable[[], tuple[np.ndarray, ...]]) -> tuple[int, int]:
    """Bytes that a call holds at most beyond what was there, and those of what it returns."""
    gc.collect()
    tracemalloc.start()
    found = run()
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return most, sum(array.nbytes for array in found)


def solved(robot: pk.Robot, q: np.ndarray) -> tuple[np.ndarray, ...]:
    """What forward kinematics returns, on one thread."""
    found = robot.forward(q, threads=1)
    return found.pose, found.status, found.iterations, found.residual


def main() -> None:
    report, robot = Report("Scaling"), pk.load("hexapod")
    for name in ("forward", "inverse"):
        rows, each, more = [], [], []
        for count in SIZES:
            given = rows_of(count)
            if name == "forward":
                given = robot.inverse(given)
                run = lambda given=given: solved(robot, given)  # noqa: E731
            else:
                run = lambda given=given: (robot.inverse(given),)  # noqa: E731
            took = seconds(run, count)
            most, out = peak(run)
            each.append(took / count)
            more.append(most - out)
            sizes = [f"{given.nbytes / 1e6:.2f}", f"{out / 1e6:.2f}", f"{more[-1] / 1e3:.1f}"]
            rows.append([count, nanoseconds(took, count), *sizes])
            del given, run
        report.text(f"{name} of the hexapod, one thread, through Python.")
        heads = ["rows", "ns a row", "in, MB", "out, MB", "more than in and out, kB"]
        report.table(heads, rows)
        report.text(
            f"A row of {SIZES[-1]} costs {times(each[-1] / each[0])} one of {SIZES[0]}, the dearest "
            f"size {times(max(each) / min(each))} the cheapest (wanted: linear); at most "
            f"{max(more) / 1e3:.0f} kB beside inputs and outputs (wanted: a constant)."
        )
    report.write("scaling")


if __name__ == "__main__":
    main()
