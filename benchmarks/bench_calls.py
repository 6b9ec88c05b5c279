"""What a call costs beside the kinematics: single poses, threads, the inverse, importing.

And what a new array costs, and a whole command.
"""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import pkmcal as pk
from benchmarks import native
from benchmarks.timing import Report, medians, nanoseconds, times
from tests.workspaces import poses


def bench_one_pose(report: Report) -> None:
    """One pose through Python, wanted in 10 us."""
    robot, many = pk.load("hexapod"), 1000
    pose = poses("hexapod", 1)[0]
    q = robot.inverse(pose)
    calls = {
        "forward": lambda: robot.forward(q),
        "forward, from a guess": lambda: robot.forward(q, guess=pose),
        "inverse": lambda: robot.inverse(pose),
        "jacobian": lambda: robot.jacobian(pose),
        "forward_jacobian": lambda: robot.forward_jacobian(pose),
        "error_jacobian": lambda: robot.error_jacobian(pose),
        "feasible": lambda: robot.feasible(pose).ok,
    }

    def repeated(call):
        def run() -> None:
            for _ in range(many):  # as in a control loop: nothing is kept
                call()

        return run

    took = medians(
        {name: repeated(call) for name, call in calls.items()}, 25, time.thread_time, warm=True
    )
    rows = [[name, f"{1e6 * seconds / many:.1f}"] for name, seconds in took.items()]
    report.text("One pose of the hexapod through Python, processor time (wanted: 10 us).")
    report.table(["call", "us"], rows)


def bench_threads(report: Report) -> None:
    """Two threads against one, wanted 1.8x."""
    robot, rows = pk.load("hexapod"), []
    for count in (5_000, 20_000, 100_000, 1_000_000):
        q = robot.inverse(poses("hexapod", count))
        took = medians(
            {n: lambda n=n: robot.forward(q, threads=n) for n in (1, 2, None)},
            25 if count <= 100_000 else 9,
            warm=True,
        )
        one = took[1]
        cells = [f"{count}", *(nanoseconds(seconds, count) for seconds in took.values())]
        rows.append([*cells, times(one / took[2]), times(one / took[None])])
    report.text("Forward kinematics of the hexapod in threads, ns a row (wanted: two at 1.8x).")
    report.table(["rows", "one", "two", "None", "two is", "None is"], rows)
    with tempfile.TemporaryDirectory() as folder:
        lib = native.fma_peak(Path(folder), native.available()[-1]).lib

    def multiply_adds(threads: int) -> None:
        others = [
            threading.Thread(target=lambda: lib.fused_double(4_000_000, 1.0))
            for _ in range(threads - 1)
        ]
        for thread in others:
            thread.start()
        lib.fused_double(4_000_000, 1.0)
        for thread in others:
            thread.join()

    took = medians({str(n): lambda n=n: multiply_adds(n) for n in (1, 2)}, 25)
    report.text(
        f"Two threads of multiply-adds in registers alone: {times(2 * took['1'] / took['2'])}. "
        "Less than 2x is the machine's: cores that share their units, or other work on them."
    )


def bench_inverse(report: Report) -> None:
    """Limbs a second, wanted 300 million on AVX2 and up."""
    rows = []
    for name in ("hexapod", "2tpr2tps", "rbt-6t03p", "rotary-delta"):
        robot = pk.load(name)
        for count in (2_000, 100_000):
            at = poses(name, count)
            cases = {}
            for isa in native.available():
                same = pk.load(name)
                same.machine.isa = native.ISAS.index(isa)
                cases[isa] = lambda same=same, at=at: same.inverse(at)
            took = medians(cases, 25, time.thread_time, warm=True)
            limbs = count * len(robot.model.limbs)
            rates = [f"{limbs / took[isa] / 1e6:.0f}" for isa in native.available()]
            rows.append([name, count, *rates])
    report.text(
        "Inverse kinematics through Python, million limbs a second of processor time (wanted: 300)."
    )
    report.table(["machine", "rows", *native.available()], rows)


def bench_reused(report: Report) -> None:
    """A million rows written to arrays that are there, against new ones."""
    robot = pk.load("hexapod")
    at = poses("hexapod", 1_000_000)
    q = robot.inverse(at)
    found, other = robot.forward(q, threads=1), q.copy()
    took = medians(
        {
            "forward": lambda: robot.forward(q, threads=1),
            "forward(out=)": lambda: robot.forward(q, threads=1, out=found),
            "inverse": lambda: robot.inverse(at),
            "inverse(out=)": lambda: robot.inverse(at, out=other),
        },
        9,
        time.process_time,
        warm=True,
    )
    rows = [
        [name, f"{1e3 * took[name]:.0f}", f"{took[f'{name}(out=)'] / took[name]:.2f}"]
        for name in ("forward", "inverse")
    ]
    report.text("A million rows of the hexapod, one thread: processor time, and with `out=`.")
    report.table(["call", "ms", "with out="], rows)


def bench_import(report: Report) -> None:
    """Importing in fresh processes, wanted at most twice as long as NumPy.

    Both from compiled bytecode, in a folder that is filled first: without, Python compiles what is
    not in site-packages at every import.
    """
    found: dict[str, list[float]] = {"numpy": [], "pkmcal": []}
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"PYTHONPYCACHEPREFIX": folder, "PYTHONDONTWRITEBYTECODE": ""}

        def seconds(module: str) -> float:
            code = (
                "import time; start = time.process_time(); "
                f"import {module}; print(time.process_time() - start)"
            )
            run = [sys.executable, "-c", code]
            done = subprocess.run(run, capture_output=True, check=True, env=environment)
            return float(done.stdout)

        seconds("pkmcal")
        for _ in range(21):
            for module, list_ in found.items():
                list_.append(seconds(module))
    numpy, own = (statistics.median(found[module]) for module in found)
    report.text(
        f"import numpy {1e3 * numpy:.0f} ms, import pkmcal (with numpy) {1e3 * own:.0f} ms of "
        f"processor time: {times(own / numpy)} (wanted: 2x)."
    )


def bench_commands(report: Report) -> None:
    """Whole commands over importing SciPy's search, from compiled bytecode; wanted 1.0."""
    delta = Path(__file__).resolve().parents[1] / "examples" / "linear-delta"
    command = str(Path(sys.executable).with_name("pkmcal"))
    base = "import numpy, scipy.optimize"
    runs = {
        base: [sys.executable, "-c", base],
        "import numpy, scipy.special": [sys.executable, "-c", "import numpy, scipy.special"],
        "pkmcal machines": [command, "machines"],
        "pkmcal calibrate, 41 heights": [
            *(command, "calibrate"),
            *(str(delta / name) for name in ("robot.toml", "probe.csv")),
        ],
    }
    found: dict[str, list[float]] = {name: [] for name in runs}
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"PYTHONPYCACHEPREFIX": folder, "PYTHONDONTWRITEBYTECODE": ""}
        for turn in range(10):
            for name, run in runs.items():
                before = resource.getrusage(resource.RUSAGE_CHILDREN)
                subprocess.run(run, capture_output=True, check=True, env=environment)
                after = resource.getrusage(resource.RUSAGE_CHILDREN)
                if turn:  # the first compiles
                    took = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
                    found[name].append(took)
    middle = {name: statistics.median(each) for name, each in found.items()}
    rows = [
        [name, f"{1e3 * took:.0f}", f"{took / middle[base]:.2f}"] for name, took in middle.items()
    ]
    report.text("Whole commands, processor time (wanted: a calibration at 1.0 of the imports).")
    report.table(["command", "ms", "over the search's import"], rows)


def main() -> None:
    report = Report("Calls")
    bench_one_pose(report)
    bench_threads(report)
    bench_inverse(report)
    bench_reused(report)
    bench_import(report)
    bench_commands(report)
    report.write("calls")


if __name__ == "__main__":
    main()
