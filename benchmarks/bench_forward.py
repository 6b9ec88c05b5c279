"""Forward kinematics side by side: the core, the core at one lane, and what others would write."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

import pkmcal as pk
from benchmarks import native, operations
from benchmarks.reference import Hexapod
from benchmarks.timing import Report, medians, nanoseconds, times
from tests.workspaces import WORKSPACE, poses

ROWS = 100_000
FEW = 200  # rows for scipy.optimize.root
OTHERS = ("2tpr2tps", "rbt-6t03p", "rotary-delta")
CLOSED = 1e-10  # mm, to which the legs are met
SPREAD = [60.0, 60.0, 60.0, *np.radians([15.0, 15.0, 15.0])]  # mm and rad about home
WANTED = {"avx512": (6.0, 10.0), "avx2": (3.4, None), "base": (1.9, None)}  # one lane, scalar C


def hexapod_rows(robot: pk.Robot) -> tuple[np.ndarray, np.ndarray]:
    """Poses around home and the legs that lead there."""
    at = robot.home + np.random.default_rng(0).uniform(-1, 1, (ROWS, 6)) * SPREAD
    return at, robot.inverse(at)


def forward(name: str, isa: str) -> Callable[[np.ndarray], pk.Forward]:
    """A machine's forward kinematics on one ISA, one thread, cold from home."""
    robot = pk.load(name)
    robot.machine.isa = native.ISAS.index(isa)
    return lambda q: robot.forward(q, threads=1)


def one_lane(
    folder: Path, joined: int = 1
) -> Callable[[Callable[[np.ndarray], pk.Forward], np.ndarray], object]:
    """Forward kinematics by the core at one lane; see `native.OneLane`."""
    lane = native.OneLane(folder, joined)

    def run(solve: Callable[[np.ndarray], pk.Forward], q: np.ndarray) -> pk.Forward:
        lane.flush_denormals(True)  # or pairs are by chance two and a half times slower
        with lane:
            found = solve(q)
        lane.flush_denormals(False)
        return found

    return run


def bench_hexapod(report: Report, folder: Path) -> None:
    """Every solver on the same 100 000 rows."""
    robot = pk.load("hexapod")
    at, q = hexapod_rows(robot)
    plain, scalar = Hexapod(robot), native.scalar_newton(folder)
    lane, pairs = one_lane(folder), one_lane(folder, joined=2)
    out = np.empty_like(at)
    arrays = (plain.base, plain.platform, plain.offset, q, robot.home)
    pointers = [scalar.ffi.from_buffer("double[]", np.ascontiguousarray(a)) for a in arrays]
    written = scalar.ffi.from_buffer("double[]", out)

    def textbook() -> np.ndarray:
        if scalar.lib.scalar_newton(ROWS, *pointers, CLOSED, written) < 0:
            raise RuntimeError("the scalar Newton did not converge")
        return out

    solvers = {isa: forward("hexapod", isa) for isa in native.available()}
    fast: dict[str, Callable[[], object]] = {"scalar Newton in C, native": textbook}
    for isa, solve in solvers.items():
        fast[f"core, {isa}"] = lambda solve=solve: solve(q)
        fast[f"core at one lane, {isa}"] = lambda solve=solve: lane(solve, q)
        fast[f"core at one lane, floats in pairs, {isa}"] = lambda solve=solve: pairs(solve, q)
    slow: dict[str, Callable[[], object]] = {
        "NumPy Newton on the batch": lambda: plain.numpy_newton(q, robot.home, CLOSED),
        f"scipy root, analytic Jacobian ({FEW} rows)": lambda: plain.scipy_root(
            q[:FEW], robot.home
        ),
    }
    bits = solvers["base"](q).pose.tobytes()
    for name, run in (fast | slow).items():
        found = run()
        pose = found.pose if isinstance(found, pk.Forward) else found
        worst = np.abs(pose - at[: len(pose)]).max()
        if not worst < 1e-8:
            raise RuntimeError(f"{name} is off by {worst} mm")
        if name.startswith("core") and pose.tobytes() != bits:
            raise RuntimeError(f"{name} gives other bits than the core")
    took = medians(fast, 25, time.thread_time, warm=True)
    took |= medians(slow, 3, time.thread_time)
    best = solvers[native.available()[-1]](q)
    report.text(
        f"hexapod, {ROWS} rows, cold from home, ±60 mm and ±15°, one thread, through Python, "
        f"processor time of warm runs. "
        f"Worst closure {best.residual.max():.1e} mm, worst pose {np.abs(best.pose - at).max():.1e} mm; "
        f"{np.mean(best.iterations > best.iterations.min()):.2%} of the rows took safeguarded Newton."
    )
    rows = []
    for name, seconds in took.items():
        count = FEW if str(FEW) in name else ROWS
        cells = [name, nanoseconds(seconds, count)]
        for isa in native.available():
            cells.append(times(seconds / count / (took[f"core, {isa}"] / ROWS)))
        rows.append(cells)
    report.table(["solver", "ns a row", *(f"core {isa} is" for isa in native.available())], rows)
    for isa in native.available():
        lanes = took[f"core at one lane, {isa}"] / took[f"core, {isa}"]
        paired = took[f"core at one lane, floats in pairs, {isa}"] / took[f"core, {isa}"]
        text = took["scalar Newton in C, native"] / took[f"core, {isa}"]
        at_least, scalars = WANTED[isa]
        report.text(
            f"{isa}: {times(lanes)} one lane (wanted {at_least}x), {times(paired)} with floats in pairs"
            + (f", {times(text)} the scalar Newton (wanted {scalars}x)" if scalars else "")
        )
    bench_units(report, folder)
    bench_peak(report, folder, {isa: took[f"core, {isa}"] / ROWS for isa in solvers}, best)


def bench_units(report: Report, folder: Path) -> None:
    """What more lanes can gain at most: what the processor's units gain."""
    steps, rows = 50_000, []
    for isa in native.available():
        lib = native.lane_units(folder, isa).lib
        gain = {}
        for what in ("multiply_add", "divide"):
            one, every = (getattr(lib, f"{what}_{many}") for many in ("one", "all"))
            took = medians(
                {
                    "one": lambda one=one: one(steps, 1.5),
                    "all": lambda every=every: every(steps, 1.5),
                },
                41,
                time.thread_time,
            )
            gain[what] = took["one"] / took["all"] * native.BYTES[isa] / 8
        rows.append([isa, native.BYTES[isa] // 8, *(times(each) for each in gain.values())])
    report.text("What a register full of doubles gains on one double, nothing else in the way:")
    report.table(["ISA", "lanes", "multiplications with additions", "divisions"], rows)


def bench_peak(report: Report, folder: Path, took: dict[str, float], found: pk.Forward) -> None:
    """What the multiplications and additions alone would take at the peak of one core."""
    needed = operations.hexapod_forward(int(np.median(found.iterations)))
    report.text(
        f"A row needs {needed.floats} operations in floats and {needed.doubles} in doubles "
        "(generated headers, and elimination). Contraction is off, so that all ISAs give the same "
        "bits. Peak is the better of two loops in registers, processor time: fused multiply-adds, "
        "and multiplications beside additions, as the core has them."
    )
    rows = []
    for isa, each in took.items():
        peak = native.fma_peak(folder, isa)
        steps = 2_000_000
        loops = {
            (how, kind): getattr(peak.lib, f"{how}_{kind}")
            for how in native.PEAKS
            for kind in ("double", "float")
        }
        took_peak = medians(
            {f"{how} {kind}": partial(run, steps, 1.0) for (how, kind), run in loops.items()},
            9,
            time.thread_time,
        )
        lanes = {"double": native.BYTES[isa] // 8, "float": native.BYTES[isa] // 4}
        rates = {
            (how, kind): steps * native.PEAKS[how] * lanes[kind] / took_peak[f"{how} {kind}"]
            for how, kind in loops
        }
        rate = {kind: max(rates[how, kind] for how in native.PEAKS) for kind in lanes}
        least = needed.floats / rate["float"] + needed.doubles / rate["double"]
        rows.append(
            [
                isa,
                *(f"{rates[how, kind] / 1e9:.0f}" for kind in lanes for how in native.PEAKS),
                f"{1e9 * least:.1f}",
                f"{1e9 * each:.1f}",
                f"{least / each:.0%}",
            ]
        )
    heads = ["ISA", "GFLOP/s, doubles fused", "apart", "floats fused", "apart"]
    heads += ["ns a row at peak", "ns a row", "of peak"]
    report.table(heads, rows)


def bench_others(report: Report, folder: Path) -> None:
    """Other machines in their workspaces, against one lane."""
    lane, rows = one_lane(folder), []
    for name in OTHERS:
        at = poses(name, ROWS)
        q = pk.load(name).inverse(at)
        cases: dict[str, Callable[[], object]] = {}
        for isa in native.available():
            solve = forward(name, isa)
            if np.abs(solve(q).pose - at).max() > 1e-8:
                raise RuntimeError(f"{name} is off")
            cases[isa] = lambda solve=solve, q=q: solve(q)
            cases[f"{isa} one lane"] = lambda solve=solve, q=q: lane(solve, q)
        took = medians(cases, 15, time.thread_time, warm=True)
        for isa in native.available():
            ratio = took[f"{isa} one lane"] / took[isa]
            slow = nanoseconds(took[f"{isa} one lane"], ROWS)
            rows.append([name, isa, nanoseconds(took[isa], ROWS), slow, times(ratio)])
    report.text(f"Other machines, {ROWS} rows in their workspaces, cold from home, one thread.")
    report.table(["machine", "ISA", "ns a row", "one lane", "ratio"], rows)


def bench_all_machines(report: Report) -> None:
    """Every built-in machine, and its inverse."""
    rows = []
    for name in WORKSPACE:
        robot, at = pk.load(name), poses(name, ROWS)
        q, limbs = robot.inverse(at), len(robot.model.limbs)
        took = medians(
            {"forward": lambda: robot.forward(q, threads=1), "inverse": lambda: robot.inverse(at)},
            9,
            time.thread_time,
            warm=True,
        )
        rate = limbs * ROWS / took["inverse"] / 1e6
        forward_ns = nanoseconds(took["forward"], ROWS)
        rows.append([name, forward_ns, nanoseconds(took["inverse"], ROWS), limbs, f"{rate:.0f}"])
    report.text(f"Every built-in machine, {ROWS} rows, best ISA, one thread, through Python.")
    heads = ["machine", "forward, ns a row", "inverse, ns a row", "limbs", "M limbs/s (inverse)"]
    report.table(heads, rows)


def main() -> None:
    report = Report("Forward kinematics")
    with tempfile.TemporaryDirectory() as folder:
        bench_hexapod(report, Path(folder))
        bench_others(report, Path(folder))
    bench_all_machines(report)
    report.write("forward")


if __name__ == "__main__":
    main()
