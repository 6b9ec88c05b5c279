"""Plans: what a weight of travel costs and gains, and how long many candidates take."""

from __future__ import annotations

import time
from typing import Any

import pkmcal as pk
from benchmarks.timing import Report

WEIGHTS = (0.0, 0.1, 0.25, 0.5, 1.0)
MANY, FEWER = 100_000, 5_000


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
    """20 of many positions, by both criteria, and as few as an accuracy takes of some thousands."""
    robot = pk.load("hexapod")
    candidates, rows = pk.sample_poses(robot, MANY), []
    kinds: dict[str, tuple[int, dict[str, Any]]] = {
        "20, the error predicted": (MANY, {"count": 20}),
        "20, the determinant": (MANY, {"count": 20, "criterion": "D"}),
        "as few as 0.01 mm take": (FEWER, {"accuracy": 0.01}),
    }
    for name, (among, options) in kinds.items():
        start = time.process_time()
        plan = pk.plan_poses(robot, candidates[:among], noise=0.01, **options)
        took = time.process_time() - start
        rows.append([
            name, str(among), str(len(plan.poses)), f"{plan.predicted:.4f} mm", f"{took:.1f} s"
        ])  # fmt: skip
    report.table(["positions of a hexapod", "of", "chosen", "error", "processor time"], rows)


def main() -> None:
    report = Report("Plans")
    bench_travel(report)
    bench_many(report)
    report.write("plan")


if __name__ == "__main__":
    main()
