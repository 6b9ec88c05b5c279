"""Progress of long work on the terminal; nothing where what is printed goes elsewhere."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from pkmcal.progress import Progress

_TAKEN_FOR_ONE = {"FORCE_COLOR", "TTY_COMPATIBLE"}  # by rich, which takes long to import


@contextmanager
def progress(work: str) -> Iterator[Progress]:
    """A bar on stderr that is gone when the work is done.

    Parameters
    ----------
    work : str
        What stands beside the bar.

    Yields
    ------
    callable
        Moves the bar, called with what is done and the whole. Until then the bar shows only that
        the work goes on, and for how long.
    """
    nothing: Progress = lambda done, total: None  # noqa: E731
    if not (sys.stderr.isatty() or _TAKEN_FOR_ONE & os.environ.keys()):
        yield nothing
        return
    from rich.console import Console
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    console = Console(stderr=True)
    if not console.is_terminal:  # a bar that is disabled still ends its line, before rich 14
        yield nothing
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
    )
    with Bar(*columns, console=console, transient=True) as bar:
        task = bar.add_task(work, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)
