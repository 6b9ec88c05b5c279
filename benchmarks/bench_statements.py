"""What a calibration says beside its numbers: what that costs, and what moved is seen by it."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

import pkmcal as pk
from benchmarks.timing import Report, medians
from pkmcal.estimation.begin import begun, estimator_at
from pkmcal.estimation.datasets import as_fit_data, by_set
from pkmcal.estimation.free_parameters import parameters
from pkmcal.estimation.parameters import Asked
from tests.simulated import hexapod_poses, tilted_poses, with_errors

NOISE = 0.02
DRAWS, RUNS = 9, 20


class Case(NamedTuple):
    """A machine, one with errors, the actuators of some poses, and how it is calibrated."""

    robot: pk.Robot
    true: pk.Robot
    q: np.ndarray
    kind: pk.Kind
    options: dict[str, Any]

    def measured(
        self, rng: np.random.Generator, moved: np.ndarray | None = None
    ) -> pk.Measurements:
        """What is read of it, poses displaced by `moved` (N, 3)."""
        read = self.true.forward(self.q).pose
        read[:, :3] += rng.normal(0.0, NOISE, read[:, :3].shape)
        read[:, 3:] += rng.normal(0.0, NOISE / self.robot.length, read[:, 3:].shape)
        read[:, :3] += 0.0 if moved is None else moved
        values = {"pose": read, "position": read[:, :3], "height": read[:, 2]}
        return pk.Measurements(self.q, values[self.kind], self.kind)


def offsets(rng: np.random.Generator, **options: Any) -> Case:
    """Six numbers of a hexapod by 40 positions."""
    robot = pk.load("hexapod")
    names = [f"offset{i}" for i in range(1, 7)]
    true = robot.replace({name: robot.geometry[name] + rng.normal(0.0, 0.3) for name in names})
    q = robot.inverse(hexapod_poses(robot, 40, rng))
    return Case(robot, true, q, "position", {"free": "offset*", **options})


def framed(rng: np.random.Generator) -> Case:
    """The same with an unknown frame and target."""
    return offsets(rng, frame="unknown", target="unknown")


def all_numbers(rng: np.random.Generator) -> Case:
    """All numbers of a hexapod by 40 poses."""
    robot = pk.load("hexapod")
    q = robot.inverse(hexapod_poses(robot, 40, rng))
    return Case(robot, with_errors(robot, 0.3, rng), q, "pose", {})


def paper(rng: np.random.Generator) -> Case:
    """The 2TPR&2TPS with a prior by 30 positions."""
    robot = pk.load("2tpr2tps")
    q = robot.inverse(tilted_poses(robot, 30, rng))
    return Case(robot, with_errors(robot, 0.5, rng), q, "position", {"prior": 0.5})


def printer(rng: np.random.Generator) -> Case:
    """A delta by 24 heights."""
    robot = pk.load("examples/linear-delta/robot.toml")
    poses = np.tile(robot.home, (24, 1))
    way, angle = 90.0 * np.sqrt(rng.uniform(0, 1, 24)), rng.uniform(0, 2 * np.pi, 24)
    poses[:, 0], poses[:, 1] = way * np.cos(angle), way * np.sin(angle)
    q = robot.inverse(poses)
    return Case(robot, with_errors(robot, 0.3, rng), q, "height", {})


CASES: dict[str, Callable[[np.random.Generator], Case]] = {
    "hexapod, 6 numbers": offsets,
    "hexapod, all numbers": all_numbers,
    "2TPR&2TPS, prior": paper,
    "delta, heights": printer,
    "hexapod, unknown frame": framed,
}


def searched(case: Case, log: pk.Measurements) -> object:
    """From measurements to the least-squares solution, without a word about it."""
    words = {"frame": "known", "target": "known", "attachment": "known"}
    unknown = {name: case.options.get(name, word) for name, word in words.items()}
    data = as_fit_data(case.robot, log, unknown, False, None)
    asked = Asked(
        case.options.get("free"), case.options.get("prior"), None, (), by_set(unknown), ()
    )
    equations, commanded, start = begun(data, parameters(case.robot, data, asked), 0)
    return estimator_at(equations, commanded, start, "linear").solve()


def bench_cost(report: Report) -> None:
    """`identify` and its verdict beside the search alone; processor time."""
    rows = []
    for name, made in CASES.items():
        ratios = []
        for seed in range(DRAWS):
            rng = np.random.default_rng(seed)
            case = made(rng)
            log = case.measured(rng)

            def fitted(case: Case = case, log: pk.Measurements = log) -> pk.Identification:
                return pk.identify(case.robot, log, **case.options)

            jobs: dict[str, Callable[[], object]] = {
                "search": lambda case=case, log=log: searched(case, log),
                "identify": fitted,
                "verdict": lambda fitted=fitted: fitted().verdict,
            }
            took = medians(jobs, 9, time.thread_time)
            ratios.append([took[job] / took["search"] for job in ("identify", "verdict")])
        middle, most = np.median(ratios, axis=0), np.max(ratios, axis=0)
        rows.append([name, *(f"{ratio:.2f}" for ratio in (*middle, *most))])
    report.text(
        f"Times the search alone, of {DRAWS} draws of errors and noise: where a robust fit is needed"
        " to judge one, it takes longer."
    )
    heads = ["case", "identify, median", "with its verdict", "identify, most", "with its verdict"]
    report.table(heads, rows)


def bench_order(report: Report) -> None:
    """How many calibrations are doubtful where something moved while they were measured."""
    moved = {
        "nothing": (0.0, 0.0),
        "jump of 50": (50, 0),
        "jump of 5": (5, 0),
        "drift of 10": (0, 10),
    }
    rows = []
    for name in list(CASES)[:4]:
        row: list[object] = [name]
        for jump, drift in moved.values():
            doubtful = 0
            for seed in range(RUNS):
                rng = np.random.default_rng(seed)
                case = CASES[name](rng)
                n = len(case.q)
                way = jump * (np.arange(n) >= n // 2) + drift * np.linspace(0.0, 1.0, n)
                axis = rng.normal(size=3)
                axis = np.array([0.0, 0.0, 1.0]) if case.kind == "height" else axis
                shift = NOISE * np.outer(way, axis / np.linalg.norm(axis))
                found = pk.identify(case.robot, case.measured(rng, shift), **case.options)
                order = found.measuring_order
                doubtful += order is not None and order.large
            row.append(f"{doubtful} of {RUNS}")
        rows.append(row)
    report.text("Shifts half-way, or in the course of measuring, times the noise of a reading.")
    report.table(["doubtful for the order", *moved], rows)


def main() -> None:
    warnings.simplefilter("ignore", pk.CalibrationWarning)
    report = Report("What a calibration says")
    bench_cost(report)
    bench_order(report)
    report.write("statements")


if __name__ == "__main__":
    main()
