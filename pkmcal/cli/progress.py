"""Progress of long work on the terminal; nothing where what is printed goes elsewhere."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from pkmcal.error_model.monte_carlo import Progress


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
    from rich.console import Console
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    console = Console(stderr=True)
    if not console.is_terminal:  # a bar that is disabled still ends its line, before rich 14
        yield lambda done, total: None
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
