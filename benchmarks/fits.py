"""Calibrations of another checkout and of this one, timed in turn on the same data.

Each checkout has a process of its own, which runs this file as a script: it needs nothing of either
but `load`, `Measurements` and `identify`, which all of them have.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple


class Draw(NamedTuple):
    """What one call of `identify` is given."""

    machine: str  # a name, or a robot file below a checkout
    actuators: Any
    values: Any
    kind: str
    options: dict[str, Any]


class Parts(NamedTuple):
    """Processor seconds of one calibration; NaN of what that state of pkmcal does not have."""

    identify: float
    verdict: float  # the verdict after it, the robust check not counted
    robust: float  # the robust check


def timed(checkouts: Sequence[Path], draws: Sequence[Draw], rounds: int) -> list[list[Parts]]:
    """Medians of each draw (inner) in each checkout (outer), which take turns."""
    with tempfile.TemporaryDirectory() as folder, ExitStack() as open_until_done:
        data = Path(folder) / "draws.json"
        as_lists = [
            draw._replace(actuators=draw.actuators.tolist(), values=draw.values.tolist())
            for draw in draws
        ]
        data.write_text(json.dumps(as_lists), encoding="utf-8")
        workers = [open_until_done.enter_context(_Worker(path, data)) for path in checkouts]
        found: list[list[list[Parts]]] = [[[] for _ in draws] for _ in workers]
        numbers = [0] * len(draws)
        for turn in range(rounds + 1):
            for k in range(len(draws)):
                for i, worker in enumerate(workers):
                    free, parts = worker.run(k)
                    if i and free != numbers[k]:
                        raise ValueError(f"draw {k}: {numbers[k]} free numbers here, {free} there")
                    numbers[k] = free
                    if turn:  # the first warms up
                        found[i][k].append(parts)
    return [
        [Parts(*(median(each) for each in zip(*parts, strict=True))) for parts in of_worker]
        for of_worker in found
    ]


class _Worker:
    """A process that imports the pkmcal of a checkout."""

    def __init__(self, checkout: Path, data: Path) -> None:
        surroundings = {**os.environ, "PYTHONPATH": str(checkout), "OPENBLAS_NUM_THREADS": "1"}
        self._process = subprocess.Popen(
            [sys.executable, __file__, str(checkout), str(data)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=surroundings,
        )

    def __enter__(self) -> _Worker:
        return self

    def __exit__(self, *error: object) -> None:
        self._process.communicate()

    def run(self, draw: int) -> tuple[int, Parts]:
        """How many numbers a draw found, and what that took."""
        assert self._process.stdin is not None and self._process.stdout is not None
        print(draw, file=self._process.stdin, flush=True)
        free, *parts = json.loads(self._process.stdout.readline())
        return free, Parts(*parts)


def _serve(checkout: Path, data: Path) -> None:
    """Answer each line of standard input, the number of a draw."""
    import warnings

    import pkmcal as pk

    if not Path(pk.__file__).is_relative_to(checkout):
        raise ImportError(f"expected the pkmcal of {checkout}, found {pk.__file__}")
    warnings.simplefilter("ignore")
    draws = [Draw(*each) for each in json.loads(data.read_text(encoding="utf-8"))]
    given = []
    for draw in draws:
        file = checkout / draw.machine
        machine = pk.load(file if file.exists() else draw.machine)
        given.append((machine, pk.Measurements(draw.actuators, draw.values, draw.kind)))
    for line in sys.stdin:
        (machine, measured), options = given[int(line)], draws[int(line)].options
        start = time.thread_time()
        found = pk.identify(machine, measured, **options)
        identify, verdict, robust = time.thread_time() - start, float("nan"), float("nan")
        if hasattr(type(found), "verdict"):
            from pkmcal.diagnostics.robust_check import robust_check

            both = _seconds(lambda found=found: found.verdict)
            robust = _seconds(lambda found=found: robust_check(found.fit))
            verdict = both - robust
        print(json.dumps([len(found.free), identify, verdict, robust]), flush=True)


def _seconds(run: Callable[[], object]) -> float:
    start = time.thread_time()
    run()
    return time.thread_time() - start


if __name__ == "__main__":
    _serve(Path(sys.argv[1]), Path(sys.argv[2]))
