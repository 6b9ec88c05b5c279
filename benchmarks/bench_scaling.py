"""Time and memory of a batch from a thousand to ten million rows."""

from __future__ import annotations

import statistics
import time
import tracemalloc

import numpy as np

import pkmcal as pk
from benchmarks.timing import Report, nanoseconds
from tests.workspaces import poses

SIZES = (1_000, 10_000, 100_000, 1_000_000, 10_000_000)


def rows_of(count: int) -> np.ndarray:
    """Poses of the hexapod, in parts that repeat: ten million random ones are not needed."""
    return np.tile(poses("hexapod", min(count, 100_000)), (max(count // 100_000, 1), 1))


def peak(run) -> tuple[int, object]:
    """Bytes that a call holds at most beyond what was there, and what it returns."""
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    found = run()
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return most - before, found


def main() -> None:
    report, rows = Report("Scaling"), []
    robot = pk.load("hexapod")
    for count in SIZES:
        q = robot.inverse(rows_of(count))
        seconds = []
        for _ in range(max(3, min(51, 2_000_000 // count))):
            start = time.perf_counter()
            found = robot.forward(q, threads=1)
            seconds.append(time.perf_counter() - start)
        del found
        most, found = peak(lambda q=q: robot.forward(q, threads=1))
        fields = (found.pose, found.status, found.iterations, found.residual)
        out = sum(field.nbytes for field in fields)
        each = nanoseconds(statistics.median(seconds), count)
        rows.append(
            [count, each, f"{q.nbytes / 1e6:.2f}", f"{out / 1e6:.2f}", f"{(most - out) / 1e3:.1f}"]
        )
        del found, fields
    report.text("Forward kinematics of the hexapod, one thread, through Python.")
    report.table(["rows", "ns a row", "in, MB", "out, MB", "more than in and out, kB"], rows)
    report.write("scaling")


if __name__ == "__main__":
    main()
