"""Measuring side by side, and tables of what was found."""

from __future__ import annotations

import os
import platform
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

RESULTS = Path(__file__).parent / "results"


def medians(
    cases: Mapping[str, Callable[[], object]],
    rounds: int = 15,
    clock: Callable[[], float] = time.perf_counter,
    warm: bool = False,
) -> dict[str, float]:
    """Median seconds of each case; every round runs each once, so that all see the same machine.

    With ``clock=time.thread_time`` other work on the machine does not count, nor do other threads.
    With `warm` each runs once untimed just before: a virtual machine may ask microseconds for each
    page of memory that was not touched for a tenth of a second, as while the other cases ran.
    """
    for run in cases.values():
        run()
    found: dict[str, list[float]] = {name: [] for name in cases}
    for _ in range(rounds):
        for name, run in cases.items():
            if warm:
                run()
            start = clock()
            run()
            found[name].append(clock() - start)
    return {name: statistics.median(times) for name, times in found.items()}


def medians_of_made(
    cases: Mapping[str, Callable[[], Callable[[], object]]],
    rounds: int,
    clock: Callable[[], float],
) -> dict[str, float]:
    """The same of what each case makes anew, untimed, in every round."""
    found: dict[str, list[float]] = {name: [] for name in cases}
    for turn in range(rounds + 1):
        for name, make in cases.items():
            run = make()
            start = clock()
            run()
            if turn:  # the first warms up
                found[name].append(clock() - start)
    return {name: statistics.median(each) for name, each in found.items()}


def processor() -> str:
    """Model name of the processor, and how many of it."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    models = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    family = {
        key: line.split(":")[1].strip()
        for line in lines
        for key in ("cpu family", "model")
        if line.split(":")[0].strip() == key
    }
    model = models[0] if models else platform.processor() or platform.machine()
    numbers = ", ".join(f"{key} {value}" for key, value in family.items())
    return f"{model} ({numbers})" if numbers else model


class Report:
    """Tables for reading: printed as they come, and kept as Markdown.

    Parameters
    ----------
    title : str
        Of the whole report.
    """

    def __init__(self, title: str) -> None:
        self._lines = [f"# {title}", ""]
        print(title)
        self.text(f"Processor: {processor()}.")

    def text(self, line: str) -> None:
        """Add a line."""
        print(line, flush=True)
        self._lines += [line, ""]

    def table(self, heads: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
        """Add a table, its first column to the left and numbers to the right."""
        cells = [[str(cell) for cell in row] for row in (heads, *rows)]
        widths = [max(len(row[k]) for row in cells) for k in range(len(heads))]
        lines = []
        for row in cells:
            shown = [row[0].ljust(widths[0])]
            shown += [cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True)]
            lines.append("| " + " | ".join(shown) + " |")
        rules = ["-" * (widths[0] + 1) + " ", *(" " + "-" * width + ":" for width in widths[1:])]
        lines.insert(1, "|" + "|".join(rules).replace(" |", "|").replace("| ", "|") + "|")
        print("\n".join(lines), flush=True)
        self._lines += [*lines, ""]

    def write(self, name: str) -> None:
        """Write the report to ``results/name.md``."""
        RESULTS.mkdir(exist_ok=True)
        path = RESULTS / f"{name}.md"
        path.write_text("\n".join(self._lines).rstrip() + "\n", encoding="utf-8")
        print(f"written to {os.path.relpath(path)}\n", flush=True)


def times(number: float) -> str:
    """A ratio for reading."""
    return (
        f"{number:.0f}x"
        if number >= 100
        else f"{number:.1f}x"
        if number >= 10
        else f"{number:.2f}x"
    )


def nanoseconds(seconds: float, rows: int) -> str:
    """Time a row for reading."""
    each = 1e9 * seconds / rows
    return f"{each:.1f}" if each < 1000 else f"{each:,.0f}".replace(",", " ")
