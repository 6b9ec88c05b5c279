"""What every assembly mode costs: paths and proofs, and how much luck random starts need instead."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping

import numpy as np

import pkmcal as pk
from benchmarks.timing import Report
from pkmcal.modes.find import frames_of, from_random_starts
from tests import dietmaier

STARTS = 200_000


def processor_seconds(
    cases: Mapping[str, Callable[[], object]], rounds: int = 15
) -> dict[str, float]:
    """Median seconds of one core that each case keeps busy: calls of this length get interrupted."""
    found: dict[str, list[float]] = {name: [] for name in cases}
    for _ in range(rounds + 1):
        for name, run in cases.items():
            start = time.process_time()
            run()
            found[name].append(time.process_time() - start)
    return {name: statistics.median(each[1:]) for name, each in found.items()}


def bench_machines(report: Report) -> None:
    """All modes of each built-in machine near home; 40 real ones wanted in 20 ms."""
    robots = {
        name: pk.load(name) for name in pk.machines() if name not in ("3r", "rbt-6t03p-printed")
    }
    cases = {"Dietmaier's hexapod": (dietmaier.hexapod(), np.array(dietmaier.LENGTHS))}
    for name, robot in robots.items():
        q = robot.inverse(robot.home)
        noise = np.random.default_rng(0).normal(size=q.shape)
        cases[name] = robot, q + noise * (0.02 * np.abs(q) + 0.01)
    took = processor_seconds(
        {name: lambda r=r, q=q: r.forward_all(q) for name, (r, q) in cases.items()}
    )
    rows = []
    for name, (robot, q) in cases.items():
        found = robot.forward_all(q)
        numbers = [found.paths, found.far, len(found), int(found.certified.sum())]
        rows.append([name, *numbers, "yes" if found.complete else "no", f"{1e3 * took[name]:.1f}"])
    report.text(
        "Every assembly mode of a machine, one core's time (wanted: 40 real modes in 20 ms)."
    )
    report.table(["machine", "paths", "far", "real", "certified", "complete", "ms"], rows)


def bench_forward(report: Report) -> None:
    """A certificate beside the pose it is of."""
    robot = pk.load("hexapod")
    q = robot.inverse(robot.home) + np.random.default_rng(0).normal(size=(2000, 6)) * 10.0
    took = processor_seconds(
        {"pose": lambda: robot.forward(q), "and certificate": lambda: robot.forward(q).certificate}
    )
    rows = [[name, f"{1e6 * seconds / len(q):.2f}"] for name, seconds in took.items()]
    report.text("Forward kinematics of the hexapod, with and without a certificate.")
    report.table(["", "us a row"], rows)


def bench_starts(report: Report) -> None:
    """How often random starts lead to the rarest of 40 modes."""
    robot = dietmaier.hexapod()
    found = robot.forward_all(dietmaier.LENGTHS)
    problem = robot.assembly_problem(np.array(dietmaier.LENGTHS))
    begin = time.process_time()
    frames = from_random_starts(problem, problem.spheres(), STARTS)
    each = (time.process_time() - begin) / STARTS
    own = frames_of(found.poses)
    hits = np.zeros(len(own), dtype=int)
    for part in np.array_split(frames, 20):
        apart = np.abs(part[:, None] - own).max(axis=2)
        assert apart.min(axis=1).max() < 1e-3  # no other mode
        hits += np.bincount(apart.argmin(axis=1), minlength=len(own))
    chance = hits / STARTS
    enough = int(10 / chance.min())
    report.text(
        f"Random starts on Dietmaier's hexapod: {100 * len(frames) / STARTS:.0f} % converge. The modes "
        f"are found with chances from {chance.min():.1e} to {chance.max():.1e} a start. Ten times as "
        f"many starts as one for the rarest, {enough}, take {1e3 * enough * each:.0f} ms and miss it "
        f"with chance {(1 - chance.min()) ** enough:.0e}; 2000 miss some mode with chance "
        f"{1 - np.prod(1 - (1 - chance) ** 2000):.2f}."
    )


def main() -> None:
    report = Report("Assembly modes")
    bench_machines(report)
    bench_forward(report)
    bench_starts(report)
    report.write("modes")


if __name__ == "__main__":
    main()
