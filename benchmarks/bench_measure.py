"""Measuring pose by pose: whether the ± keep their promise, and how many rows are enough."""

from __future__ import annotations

import tempfile
import time
import warnings
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import pkmcal as pk
from benchmarks.timing import Report
from pkmcal.live.course import UNSTATED, Course
from pkmcal.live.replay import places, replayed

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
PRINTER = Path(__file__).resolve().parents[1] / "examples" / "linear-delta" / "robot.toml"

RUNS, NOISE, UP = 1000, 0.03, (0.0, 0.0, 1.0)
WITHIN = 1.1  # of the misfit of all rows: enough
TURNS = np.array([13.21144, 14.0456, 13.8233, 14.124109, 14.16007, 14.03256]) * 1e-3  # per mm


def bed(radius: float = 115.0) -> np.ndarray:
    """61 places on the bed, 5 mm above it."""
    rings = [np.zeros((1, 2))]
    for n in range(1, 5):
        turns = 2.0 * np.pi * np.arange(6 * n) / (6 * n)
        rings.append(radius * n / 4 * np.stack([np.cos(turns), np.sin(turns)], axis=1))
    poses = np.zeros((61, 6))
    poses[:, :2], poses[:, 2] = np.concatenate(rings), 5.0
    return poses


def bench_promise(report: Report) -> None:
    """1000 printers, each measured until the predicted error of its height is there."""
    robot, poses = pk.load(PRINTER), bed()
    free = robot.model.free
    rows = []
    cases = {
        "noise stated": (NOISE, NOISE, 0.016),
        "no noise stated": (None, NOISE, 0.022),
        "noise stated as half of what it is": (0.5 * NOISE, NOISE, 0.016),
    }
    for name, (stated, true, wanted) in cases.items():
        start = time.process_time()
        choice = pk.next_pose(
            robot, poses, kind="height", noise=UNSTATED if stated is None else stated, direction=UP
        )
        first = Course(choice, stated is not None, wanted)
        random = np.random.default_rng(26)
        inside, errors, counts, odd = [], [], [], 0
        for run in range(RUNS):
            off = dict(zip(free, random.normal(0, 1, len(free)) * _spread(free), strict=True))
            machine = robot.replace({n: robot.geometry[n] + d for n, d in off.items()})
            log = pk.VirtualMachine(machine, true, seed=run).measure(robot.inverse(poses), "height")
            log = replace(log, sigma=stated)
            last = first
            for last in replayed(first, log, list(np.arange(61)[:, None])):
                odd += last.odd is not None
            found = last.found
            truth = np.array([machine.geometry[n] for n in found.free])
            low, high = found.interval95.T
            inside.append(((low <= truth) & (truth <= high)).mean())
            q = robot.inverse(poses)
            errors.append(found.robot.forward(q).pose[:, 2] - machine.forward(q).pose[:, 2])
            counts.append(last.poses)
            if run % 100 == 99:
                print(name, run + 1, np.mean(inside), np.mean(counts), flush=True)
        rms = np.sqrt((np.array(errors) ** 2).mean())
        rows.append([
            name, f"{100 * np.mean(inside):.1f} %", f"{np.mean(counts):.1f}",
            f"{min(counts)} … {max(counts)}", f"{wanted:.3f}", f"{rms:.4f}",
            f"{1000 * odd / sum(counts):.2f}",
            f"{(time.process_time() - start) / sum(counts) * 1e3:.0f} ms",
        ])  # fmt: skip
        print(rows[-1], flush=True)
    report.text(f"{RUNS} printers a line, heights of 61 places with a noise of {NOISE} mm.")
    report.table(
        ["", "true values in the 95 % intervals", "rows", "from … to", "error asked for, mm",
         "true error of the height, mm rms", "rows called odd, per thousand", "a row takes"], rows
    )  # fmt: skip


def _spread(free: Iterable[str]) -> np.ndarray:
    return np.array([0.003 if "angle" in name else 0.5 for name in free])


def bench_odd(report: Report) -> None:
    """A row that is off by some deviations: whether it is called odd as soon as it is there."""
    robot, poses, told, runs = pk.load(PRINTER), bed(), [], 100
    choice = pk.next_pose(robot, poses, kind="height", noise=NOISE, direction=UP)
    order = _indices(choice)
    for stated in (NOISE, None):
        for at in (12, 20):
            shares = []
            for off in (4.0, 6.0, 8.0, 12.0):
                found = 0
                for run in range(runs):
                    log = pk.VirtualMachine(robot, NOISE, seed=run).measure(
                        robot.inverse(poses), "height"
                    )
                    values = log.values.copy()
                    values[order[at - 1]] += off * NOISE
                    log = replace(log, values=values, sigma=stated)
                    before = log.select(order[: at - 1])
                    course = Course(choice, stated is not None, None, rows=before)
                    found += course.after(order[at - 1], log.select(order[:at])).odd is not None
                shares.append(f"{100 * found // runs} %")
            told.append(["unknown" if stated is None else f"{stated:g} mm", at, *shares])
            print(told[-1], flush=True)
    report.text(
        f"A row of {runs} printers, off by 4 to 12 times its deviation: told as soon as it was"
        " measured."
    )
    report.table(["noise stated", "which row", "off by 4 σ", "by 6 σ", "by 8 σ", "by 12 σ"], told)


def _indices(choice: pk.NextPose) -> list[int]:
    """Candidates in the order that is chosen, which no reading changes."""
    found = []
    while choice.left:
        found.append(choice.index)
        choice = choice.after()
    return found


def bench_next(report: Report) -> None:
    """What the choice of the next of 1000 candidates takes, of processor time."""
    hexapod = pk.load("hexapod")
    poses, rows = pk.sample_poses(hexapod, 1000), []
    for name, options in (("poses", {"kind": "pose"}), ("positions", {"prior": 0.5})):
        choice = pk.next_pose(hexapod, poses, noise=0.02, **options)
        times = []
        for _ in range(100):
            began = time.process_time()
            choice = choice.after()
            assert choice.index >= 0 and choice.predicted > 0
            times.append(1e3 * (time.process_time() - began))
        rows.append([name, len(choice.parameters), f"{np.median(times):.1f}", f"{max(times):.1f}"])
    report.text("The next of 1000 candidates of a hexapod, chosen, with both predictions.")
    report.table(["", "numbers", "median of 100, ms", "longest, ms"], rows)


def bench_order(report: Report) -> None:
    """Rows until an error is predicted: chosen, and in an order drawn at random."""
    rows = []
    hexapod, printer = pk.load("hexapod"), pk.load(PRINTER)
    cases: dict[str, Any] = {
        "printer, heights on the bed": (printer, bed(), {"kind": "height", "direction": UP}),
        "hexapod, poses": (hexapod, pk.sample_poses(hexapod, 300), {"kind": "pose"}),
        "hexapod, positions": (hexapod, pk.sample_poses(hexapod, 300), {"prior": 0.5}),
    }
    random = np.random.default_rng(1)
    for name, (robot, poses, options) in cases.items():
        first = pk.next_pose(robot, poses, noise=0.02, **options)
        chosen = _predicted(first, None)
        worse, drawn = 0, []
        for _ in range(20):
            order = random.permutation(first.indices).tolist()
            own = _predicted(first, order)
            worse += int((chosen > own * (1 + 1e-6))[np.isfinite(own)].sum())
            drawn.append(own)
        for share in (3.0, 2.0, 1.5):
            wanted = share * first.predicted_at_last
            need = [int((each > wanted).sum()) for each in (chosen, *drawn)]
            rows.append([
                name, f"{share:g} times that of all", need[0], f"{np.median(need[1:]):.0f}",
                min(need[1:]), worse,
            ])  # fmt: skip
    report.table(
        ["", "predicted error", "poses, chosen", "at random, median of 20", "best of 20",
         "counts at which one at random predicted less"], rows
    )  # fmt: skip


def _predicted(choice: pk.NextPose, order: list[int] | None) -> np.ndarray:
    """The predicted error behind 1, 2 … poses."""
    found = []
    for i in range(choice.left):
        choice = choice.after(None if order is None else order[i])
        found.append(choice.predicted)
    return np.array(found)


def hexapod_with_spools(folder: Path) -> pk.Robot:
    """The machine of the two sessions, as drawn."""
    n = np.arange(6)
    base = _circle(410.0, 200 + 100 * (n // 2) + 20 * ((n + 1) // 2))
    platform = _circle(219.075, 154.3012223 + 8.6024446 * (n // 2) + 111.3975554 * ((n + 1) // 2))
    zeros = np.linalg.norm(platform - base + np.array([0.0, 0.0, 565.0]), axis=1)
    lines = [
        'name = "hexapod"', "[pose]", 'map = "spatial"', "home = { z = 780.0 }",
        "[calibration]", 'free = ["base*", "platform*", "offset*", "gain*"]',
    ]  # fmt: skip
    for b, p, zero in zip(base.tolist(), platform.tolist(), zeros.tolist(), strict=True):
        lines += ["[[limb]]", 'kind = "UPS"', f"base = {b}", f"platform = {p}", f"offset = {zero}"]
    return _robot(folder, lines)


def belts(folder: Path) -> pk.Robot:
    lines = ['name = "belts"', "[pose]", 'map = "xy"', "home = { x = 1500.0, y = 1000.0 }"]
    lines += ["[calibration]", 'free = ["base1.x", "base1.y", "base2.x", "base2.y", "base4.x"]']
    for x, y in ((0.0, 2000.0), (3000.0, 2000.0), (0.0, 0.0), (3000.0, 0.0)):
        lines += ["[[limb]]", 'kind = "cable"', f"base = [{x}, {y}, 0.0]", "platform = [0, 0, 0]"]
    return _robot(folder, lines)


def _robot(folder: Path, lines: list[str]) -> pk.Robot:
    path = folder / "robot.toml"
    units = ['units = { length = "mm", angle = "deg" }']
    path.write_text("\n".join([lines[0], *units, *lines[1:]]), encoding="utf-8")
    return pk.load(path)


def _circle(radius: float, angles: np.ndarray) -> np.ndarray:
    turned = np.radians(angles)
    return radius * np.column_stack([np.cos(turned), np.sin(turned), 0 * turned])


def logs(folder: Path) -> dict[str, tuple[Any, Any, dict[str, Any], dict[str, Any]]]:
    """Of each log the machine, what was measured, and options of the plan and of the fit."""
    probe = np.loadtxt(DATA / "linear-delta" / "probe41.csv", delimiter=",", skiprows=1)
    heights = pk.Measurements(-probe[:, 2:] * 60 / 6400, probe[:, 1], "height", sigma=0.04)
    session = np.genfromtxt(DATA / "jugglebot" / "session1.csv", delimiter=",", skip_header=1)
    motion = np.tile(np.eye(4), (len(session), 1, 1))
    motion[:, :3, :3] = _rotations(session[:, 9:13])
    motion[:, :3, 3] = session[:, 6:9]
    poses = pk.Measurements(session[:, :6] / TURNS, pk.screw.to_pose(motion), "pose")
    poses = replace(poses, sigma=[0.9] * 3 + [0.9 / 200] * 3)
    table = np.loadtxt(DATA / "maslow" / "run1.csv", delimiter=",", skiprows=1)
    group = np.repeat(np.arange(25), 4)
    closure = pk.Measurements(table, None, "closure", actuator_sigma=0.5, group=group)
    other = np.loadtxt(DATA / "maslow" / "run2.csv", delimiter=",", skiprows=1)
    before = pk.Measurements(other, None, "closure", actuator_sigma=0.5)
    sled = pk.identify(belts(folder), before).robot  # as calibrated by the other run
    return {
        "41 heights of a printer": (
            pk.load(PRINTER), heights, {"kind": "height", "noise": 0.04, "direction": UP}, {}
        ),
        "108 poses of a hexapod": (
            hexapod_with_spools(folder), poses, {"kind": "pose", "noise": 0.9}, {}
        ),
        "24 poses of an arm, 3 reflectors": _arm(),
        "25 places of four belts": (
            sled, closure, {"kind": "closure", "actuator_noise": 0.5}, {}
        ),
    }  # fmt: skip


def _rotations(quaternions: np.ndarray) -> np.ndarray:
    x, y, z, w = (quaternions / np.linalg.norm(quaternions, axis=1)[:, None]).T
    return np.stack([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]).transpose(2, 0, 1)  # fmt: skip


def _arm() -> tuple[Any, Any, dict[str, Any], dict[str, Any]]:
    """The arm as drawn; 50 numbers of tracker, reflectors and joints are free."""
    axes = [[0, 0, 1], [0, 1, 0], [0, -1, 0], [-1, 0, 0], [0, -1, 0], [-1, 0, 0]]
    points = [[0, 0, 0], [312, 0, 670], [312, 0, 1745], [312, 0, 1970], *2 * [[1592, 0, 1970]]]
    home = np.eye(4)
    home[:3, 3] = [1807.0, 0.0, 1970.0]
    arm = pk.SerialArm(np.array(axes), points, home, name="arm")
    log = replace(pk.read_measurements(DATA / "fanuc-r2000ic" / "tracker.csv"), sigma=0.15)
    unknown = {"unknown": ["frame", "target"]}
    reflectors = pk.identify(arm, log, free="joint1.dx", **unknown)  # where they are, for the plan
    known = dict(zip(reflectors.free, reflectors.values, strict=True))
    at = np.array([value for name, value in known.items() if name.startswith("target")])
    plan = {"kind": "position", "noise": 0.15, "target": at.reshape(3, 3), "prior": 1.0, **unknown}
    return arm, log, plan, {"prior": 1.0, **unknown}


def misfit(robot: Any, fitted: pk.Measurements, held: pk.Measurements, asked: Any) -> float:
    """Rms of rows that are not fitted, mm; of belts how far they contradict each other."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if held.kind == "closure":
            return float(np.sqrt((pk.identify(robot, fitted, **asked).robot.forward(
                held.actuators).residual ** 2).mean()))  # fmt: skip
        return float(pk.identify(robot, fitted, holdout=held, **asked).holdout_rms)


def enough(misfits: list[float]) -> int | None:
    """How many poses, from which on the misfit stays within `WITHIN` of that of all."""
    good = np.array(misfits) <= WITHIN * misfits[-1]
    return len(good) - int(np.argmin(good[::-1])) + 1 if not good.all() else 1


def bench_replay(report: Report) -> None:
    """Every third pose is held out; the others are measured again, in three orders."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for name, (robot, log, plan, asked) in logs(Path(folder)).items():
            poses, of_pose = places(robot, log)
            offered = [i for i in range(len(poses)) if i % 3 != 2]
            held = log.select(np.concatenate(of_pose[2::3]))
            choice = pk.next_pose(robot, poses[offered], **plan)
            least = 2
            while not np.isfinite(choice.predicted):
                choice = choice.after()
            least = max(least, len(offered) - choice.left)
            chosen = [*_order(pk.next_pose(robot, poses[offered], **plan))]
            chosen += [i for i in range(len(offered)) if i not in chosen]  # that are no candidates
            random = np.random.default_rng(0)
            orders = [chosen, list(range(len(offered)))]
            orders += [random.permutation(len(offered)).tolist() for _ in range(3)]
            found = []
            for order in orders:
                misfits = []
                for n in range(least, len(offered) + 1):
                    taken = np.concatenate([of_pose[offered[i]] for i in order[:n]])
                    try:
                        misfits.append(misfit(robot, log.select(taken), held, asked))
                    except pk.Error:  # too few
                        misfits.append(np.inf)
                found.append((least + enough(misfits) - 1, misfits[-1]))
            rows.append([
                name, len(offered), f"{found[0][1]:.3f}", found[0][0], found[1][0],
                f"{np.median([n for n, _ in found[2:]]):.0f}",
                f"{min(n for n, _ in found[2:])} … {max(n for n, _ in found[2:])}",
            ])  # fmt: skip
            print(rows[-1], flush=True)
    report.text(
        f"Poses from which on rows that were held out are within {WITHIN:g} times what they are"
        " off with all others."
    )
    report.table(
        ["log", "poses", "held out, mm rms", "chosen", "in their order", "at random, median of 3",
         "from … to"], rows
    )  # fmt: skip


def _order(choice: pk.NextPose) -> Iterable[int]:
    while choice.left:
        yield choice.index
        choice = choice.after()


def main() -> None:
    report = Report("Measuring pose by pose")
    bench_next(report)
    bench_order(report)
    bench_odd(report)
    if DATA.exists():
        bench_replay(report)
    bench_promise(report)
    report.write("measure")


if __name__ == "__main__":
    main()
