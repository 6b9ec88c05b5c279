"""Time and memory of a batch from a thousand to ten million rows."""

from __future__ import annotations

import gc
import tracemalloc
from collections.abc import Callable
from resource import RUSAGE_THREAD, getrusage

import numpy as np

import pkmcal as pk
from benchmarks.timing import Report, nanoseconds, times
from tests.workspaces import poses

SIZES = (1_000, 10_000, 100_000, 1_000_000, 10_000_000)
MANY = 10_000_000  # rows, after which ticks do not matter


def rows_of(count: int) -> np.ndarray:
    """Poses of the hexapod, in parts that repeat: ten million random ones are not needed."""
    return np.tile(poses("hexapod", min(count, 100_000)), (max(count // 100_000, 1), 1))


def seconds(run: Callable[[], object], count: int) -> tuple[float, float]:
    """Processor time of one run: the program's and the system's, the mean of many rows."""
    runs = max(3, MANY // count)
    run()
    start = getrusage(RUSAGE_THREAD)  # in ticks of some ms
    for _ in range(runs):
        run()
    end = getrusage(RUSAGE_THREAD)
    return (end.ru_utime - start.ru_utime) / runs, (end.ru_stime - start.ru_stime) / runs


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
            own, system = seconds(run, count)
            most, out = peak(run)
            each.append(own / count)
            more.append(most - out)
            sizes = [f"{given.nbytes / 1e6:.2f}", f"{out / 1e6:.2f}", f"{more[-1] / 1e3:.1f}"]
            rows.append([count, nanoseconds(own, count), nanoseconds(system, count), *sizes])
            del given, run
        report.text(
            f"{name} of the hexapod, one thread, through Python. Processor time: the system's is for "
            "clearing memory, which small batches use again."
        )
        heads = ["rows", "ns a row", "system, ns", "in, MB", "out, MB", "beside in and out, kB"]
        report.table(heads, rows)
        report.text(
            f"A row of {SIZES[-1]} costs {times(each[-1] / each[0])} one of {SIZES[0]} (wanted: "
            f"linear); at most {max(more) / 1e3:.0f} kB beside inputs and outputs (wanted: a constant)."
        )
    report.write("scaling")


if __name__ == "__main__":
    main()
