"""What a calibration says beside its numbers: what that costs, and what moved is seen by it."""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import pkmcal as pk
from benchmarks.fits import Draw, Parts, timed
from benchmarks.timing import Report, medians
from pkmcal.calibration.asked import unknown_roles
from pkmcal.diagnostics.robust_check import robust_check
from pkmcal.estimation.begin import begun, estimator_at
from pkmcal.estimation.datasets import as_fit_data, by_set
from pkmcal.estimation.free_parameters import parameters
from pkmcal.estimation.parameters import Asked
from pkmcal.estimation.solving import solve
from tests.simulated import hexapod_poses, tilted_poses, with_errors

HERE = Path(__file__).parents[1]
NOISE = 0.02
DRAWS, ROUNDS, RUNS = 9, 9, 20
MOVED = 1.0  # mm


class Case(NamedTuple):
    """A machine, one with errors, the actuators of some poses, and how it is calibrated."""

    name: str
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
    return Case("hexapod", robot, true, q, "position", {"free": "offset*", **options})


def framed(rng: np.random.Generator) -> Case:
    """The same with an unknown frame and target."""
    return offsets(rng, unknown=["frame", "target"])


def all_numbers(rng: np.random.Generator) -> Case:
    """All numbers of a hexapod by 40 poses."""
    robot = pk.load("hexapod")
    q = robot.inverse(hexapod_poses(robot, 40, rng))
    return Case("hexapod", robot, with_errors(robot, 0.3, rng), q, "pose", {})


def paper(rng: np.random.Generator) -> Case:
    """The 2TPR&2TPS with a prior by 30 positions."""
    robot = pk.load("2tpr2tps")
    q = robot.inverse(tilted_poses(robot, 30, rng))
    true = with_errors(robot, 0.5, rng)
    return Case("2tpr2tps", robot, true, q, "position", {"prior": 0.5})


def printer(rng: np.random.Generator) -> Case:
    """A delta by 24 heights."""
    name = "examples/linear-delta/robot.toml"
    robot = pk.load(HERE / name)
    poses = np.tile(robot.home, (24, 1))
    way, angle = 90.0 * np.sqrt(rng.uniform(0, 1, 24)), rng.uniform(0, 2 * np.pi, 24)
    poses[:, 0], poses[:, 1] = way * np.cos(angle), way * np.sin(angle)
    q = robot.inverse(poses)
    return Case(name, robot, with_errors(robot, 0.3, rng), q, "height", {})


CASES: dict[str, Callable[[np.random.Generator], Case]] = {
    "hexapod, 6 numbers": offsets,
    "hexapod, all numbers": all_numbers,
    "2TPR&2TPS, prior": paper,
    "delta, heights": printer,
    "hexapod, unknown frame": framed,
}


def searched(case: Case, log: pk.Measurements) -> object:
    """From measurements to the least-squares solution, without a word about it."""
    unknown = unknown_roles(case.options.get("unknown", ()))
    data = as_fit_data(case.robot, log, unknown, False, None)
    asked = Asked(
        case.options.get("free"), case.options.get("prior"), None, (), by_set(unknown), ()
    )
    equations, start = begun(data, parameters(case.robot, data, asked), 0)
    return solve(estimator_at(equations, start, "linear"))


def bench_cost(report: Report) -> None:
    """`identify` and its verdict beside the search alone; processor time."""
    rows = []
    for name, made in CASES.items():
        ratios = []
        for seed in range(DRAWS):
            rng = np.random.default_rng(seed)
            case = made(rng)
            log = case.measured(rng)
            found = pk.identify(case.robot, log, **case.options)

            def fitted(case: Case = case, log: pk.Measurements = log) -> pk.Identification:
                return pk.identify(case.robot, log, **case.options)

            jobs: dict[str, Callable[[], object]] = {
                "search": lambda case=case, log=log: searched(case, log),
                "identify": fitted,
                "verdict": lambda fitted=fitted: fitted().verdict,
                "robust": lambda found=found: robust_check(found.fit),
            }
            took = medians(jobs, ROUNDS, time.thread_time)
            shown = took["identify"], took["verdict"] - took["robust"], took["robust"]
            ratios.append([each / took["search"] for each in shown])
        rows.append([name, *_middle_and_most(np.array(ratios))])
    report.text(
        f"Processor time, times the search alone, medians of {DRAWS} draws of errors and noise and"
        " the most. The robust check, for which the verdict makes a robust fit where some rows seem"
        " to carry the linear one, is apart."
    )
    report.table(["case", *_twice("identify", "with its verdict", "robust check")], rows)


def _twice(*heads: str) -> list[str]:
    return [f"{head}, {which}" for which in ("median", "most") for head in heads]


def _middle_and_most(ratios: np.ndarray) -> list[str]:
    """Of ratios (draws, k), medians and largest."""
    both = np.concatenate([np.median(ratios, axis=0), np.max(ratios, axis=0)])
    return [f"{ratio:.2f}" for ratio in both]


def bench_against(report: Report, checkout: Path) -> None:
    """`identify` and its verdict beside the `identify` of another checkout, on the same data."""
    rows = []
    for name, made in CASES.items():
        draws = []
        for seed in range(DRAWS):
            rng = np.random.default_rng(seed)
            case = made(rng)
            log = case.measured(rng)
            draws.append(Draw(case.name, log.actuators, log.values, case.kind, case.options))
        here, there = (np.array(each) for each in timed([HERE, checkout], draws, ROUNDS))
        base = there[:, Parts._fields.index("identify")]
        identify, verdict, robust = here.T
        shown = np.column_stack([identify, identify + verdict, robust]) / base[:, None]
        rows.append([name, f"{1e3 * np.median(base):.1f}", *_middle_and_most(shown)])
    report.text(
        "The same beside `identify` of the other checkout, which is told in ms; each in a process"
        " of its own, in turn, on the same data."
    )
    heads = _twice("identify", "with its verdict", "robust check")
    report.table(["case", "other, ms", *heads], rows)


def bench_moved(report: Report) -> None:
    """The search for what moved beside the calibration that it belongs to; processor time."""
    rows = []
    for name in list(CASES)[:3]:
        ratios = []
        for seed in range(DRAWS):
            rng = np.random.default_rng(seed)
            case = CASES[name](rng)
            log = case.measured(rng)
            offset = case.true.geometry["offset1"]
            later = case._replace(true=case.true.replace({"offset1": offset + MOVED}))
            again = later.measured(rng)

            def found(
                case: Case = case, log: pk.Measurements = log, again: pk.Measurements = again
            ) -> pk.Identification:
                return pk.identify(case.robot, log, holdout=again, **case.options)

            jobs: dict[str, Callable[[], object]] = {
                "identify": found,
                "moved": lambda found=found: found().moved,
            }
            took = medians(jobs, ROUNDS, time.thread_time)
            ratios.append([took["moved"] / took["identify"] - 1.0])
        rows.append([name, *_middle_and_most(np.array(ratios))])
    report.text(
        f"The search for what moved, where an offset did by {MOVED:g} mm before as much was"
        " measured again, times `identify` with these measurements held out."
    )
    report.table(["case", "median", "most"], rows)


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
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--against", type=Path, help="another checkout, its core built in place")
    asked = parser.parse_args()
    warnings.simplefilter("ignore", pk.CalibrationWarning)
    report = Report("What a calibration says")
    bench_cost(report)
    if asked.against is not None:
        bench_against(report, asked.against.resolve())
    bench_moved(report)
    bench_order(report)
    report.write("statements")


if __name__ == "__main__":
    main()
