"""Plans: what a weight of travel costs and gains, and how long many candidates take."""

from __future__ import annotations

import time
from typing import Any

import pkmcal as pk
from benchmarks.timing import Report

WEIGHTS = (0.0, 0.1, 0.25, 0.5, 1.0)
MANY = 100_000


def bench_travel(report: Report) -> None:
    """30 of 500 poses; predicted error and tour beside those without a weight."""
    kinds: dict[str, dict[str, Any]] = {"hexapod": {"kind": "pose"}, "2tpr2tps": {"prior": 0.5}}
    rows = []
    for name, options in kinds.items():
        robot = pk.load(name)
        candidates = pk.sample_poses(robot, 500)
        for weight in WEIGHTS:
            start = time.process_time()
            plan = pk.plan_poses(robot, candidates, 30, travel_weight=weight, **options)
            took = time.process_time() - start
            error = plan.predicted / plan.predicted_unweighted - 1.0
            tour = plan.travel / plan.travel_unweighted - 1.0
            rows.append([
                f"{name}, weight {weight:g}", f"{plan.predicted:.4f} mm", f"{100 * error:+.0f} %",
                f"{1e-3 * plan.travel:.2f} m", f"{100 * tour:+.0f} %", f"{took:.1f} s",
            ])  # fmt: skip
    report.table(["plan", "error", "", "tour", "", "processor time"], rows)


def bench_many(report: Report) -> None:
    """20 of many positions."""
    robot = pk.load("hexapod")
    candidates = pk.sample_poses(robot, MANY)
    start = time.process_time()
    pk.plan_poses(robot, candidates, 20, noise=0.01)
    took = time.process_time() - start
    report.text(f"20 of {MANY} positions of a hexapod: {took:.0f} s of processor time.")


def main() -> None:
    report = Report("Plans")
    bench_travel(report)
    bench_many(report)
    report.write("plan")


if __name__ == "__main__":
    main()
