"""What verdicts say of imperfect data, and how many true values their intervals hold."""

from __future__ import annotations

import argparse
import warnings
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from typing import Any, NamedTuple

import numpy as np

import pkmcal as pk
from benchmarks.imperfect import SCENARIOS, Case, numbers
from benchmarks.timing import Report

DRAWS, OF_SOUND = 40, 200
LEAST_INSIDE, MOST_DOUBTED = 0.90, 0.02
PLACES = 150


class Draw(NamedTuple):
    """One calibration: its verdict, how many true values intervals hold, and its true error."""

    state: str
    inside: int
    known: int
    ratio: float  # true error over `accuracy`
    worse: bool  # than before, at other poses
    checks: tuple[str, ...]


def judged(name: str, number: int) -> Draw:
    """Draw a scenario and calibrate."""
    rng = np.random.default_rng([number, *name.encode()])
    case = SCENARIOS[name].draw(rng)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            found = pk.identify(case.robot, case.data, case.free, **case.options)
        except (ValueError, TypeError) as error:
            return Draw("refused", 0, 0, np.nan, False, (str(error)[:60],))
        verdict = found.verdict
        spoken = tuple(said.check for said in verdict.said if said.level != "remark")
        true = numbers(case.true)
        truth = np.array([true.get(name, np.nan) for name in found.free])
        low, high = found.interval95.T
        known = np.isfinite(low) & np.isfinite(high) & np.isfinite(truth)
        inside = (low <= truth) & (truth <= high)
        ratio, worse = errors(case, found)
        return Draw(verdict.state, int(inside[known].sum()), int(known.sum()), ratio, worse, spoken)


def errors(case: Case, found: Any) -> tuple[float, bool]:
    """True error of the calibrated machine over the stated one, and whether it grew."""
    if isinstance(case.robot, pk.SerialArm):
        at = np.random.default_rng(0).uniform(-1.2, 1.2, (PLACES, 6))
        wanted = case.true.forward(at)[:, :3, 3]
        before, after = (
            rms(each.forward(at)[:, :3, 3] - wanted) for each in (case.robot, found.robot)
        )
    else:
        at = pk.sample_poses(case.robot, PLACES, seed=999, share=0.4)
        before, after = (missed(each, case, at) for each in (case.robot, found.robot))
    stated = rms(found.accuracy(at)[:, None])
    return after / stated if stated > 0 else np.inf, after > before


def missed(robot: Any, case: Case, poses: Any) -> float:
    """How far the true machine goes from poses, commanded by another."""
    q = robot.inverse(poses, match=True if case.robot.model.match else None)
    there = case.true.forward(q, guess=poses).pose
    return rms(there[:, :3] - poses[:, :3])


def rms(off: Any) -> float:
    """Root mean square of the lengths of rows."""
    return float(np.sqrt(np.nanmean((off**2).sum(axis=1))))


def row(name: str, draws: list[Draw]) -> tuple[list[str], bool]:
    """A line of the table, and whether the scenario is as it must be."""
    states = Counter(each.state for each in draws)
    good = [each for each in draws if each.state == "calibrated"]
    known = sum(each.known for each in good)
    inside = sum(each.inside for each in good) / known if known else np.nan
    ratio = float(np.median([each.ratio for each in good])) if good else np.nan
    said = Counter(check for each in draws for check in each.checks)
    meant = SCENARIOS[name].meant
    fine = True
    if meant == "seen":
        fine = not good or inside >= LEAST_INSIDE
    if meant == "sound":
        fine = len(draws) - len(good) <= np.ceil(MOST_DOUBTED * len(draws))
    verdicts = " ".join(f"{n} {state}" for state, n in states.most_common())
    most = ", ".join(f"{check} {n}" for check, n in said.most_common(3))
    return [
        name, meant, verdicts, "" if np.isnan(inside) else f"{inside:.2f}",
        "" if np.isnan(ratio) else f"{ratio:.2f}", str(sum(each.worse for each in good)),
        most, "" if fine else "FAILS",
    ], fine  # fmt: skip


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("names", nargs="*", help="scenarios, or how their names begin")
    options.add_argument("--draws", type=int, default=DRAWS)
    options.add_argument("--of-sound", type=int, default=OF_SOUND, help="draws of sound data")
    options.add_argument("--workers", type=int, default=1)
    given = options.parse_args()
    report = Report("Imperfect data")
    report.text(
        "Inside: true values in the 95 % intervals of what was calibrated. True / stated: median of"
        " the true error over `accuracy`. Worse: calibrated, but worse than before."
    )
    lines, failed = [], []
    with ProcessPoolExecutor(given.workers) as pool:
        for name, each in SCENARIOS.items():
            if given.names and not any(name.startswith(begin) for begin in given.names):
                continue
            count = given.of_sound if each.meant == "sound" else given.draws
            draws = list(pool.map(judged, [name] * count, range(count)))
            line, fine = row(name, draws)
            print(*line, sep=" | ", flush=True)
            lines.append(line)
            failed += [] if fine else [name]
    heads = ["scenario", "meant", "verdicts", "inside", "true / stated", "worse", "said", ""]
    report.table(heads, lines)
    report.text(f"{len(lines) - len(failed)} of {len(lines)} as they must be.")
    report.write("imperfect")
    if failed:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
