"""How far long work has come, told to who asked for it from wherever the work is done."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple

Progress = Callable[[int, int], object]  # of what is done and the whole
PERCENT = 100
_LEFT = 0.85  # of a part's share at each step: how many steps a search takes is not known before


class _Part(NamedTuple):
    """The part of the work that goes on, from one share to another, and what is told."""

    tell: Progress
    start: float
    end: float
    steps: int


_now: ContextVar[_Part | None] = ContextVar("part of the work", default=None)


@contextmanager
def telling(progress: Progress | None) -> Iterator[None]:
    """Work of which `progress` is told, in percent of the whole, never less than before.

    Parameters
    ----------
    progress : callable or None
        None: nobody, also where work around this one is told of.
    """
    token = _now.set(None if progress is None else _Part(progress, 0.0, 0.0, 0))
    try:
        yield
        if progress is not None:
            progress(PERCENT, PERCENT)
    finally:
        _now.reset(token)


def part(end: float) -> None:
    """Begin a part of the work that goes on to this share of the whole, at most 1."""
    if (now := _now.get()) is not None:
        _now.set(_Part(now.tell, now.end, end, 0))
        now.tell(int(PERCENT * now.end), PERCENT)


def step() -> None:
    """Tell of a step within a part, of which it is not known how many there are."""
    if (now := _now.get()) is not None:
        now = now._replace(steps=now.steps + 1)
        _now.set(now)
        share = now.end - (now.end - now.start) * _LEFT**now.steps
        now.tell(int(PERCENT * share), PERCENT)


def within(progress: Progress | None, start: float, end: float) -> Progress | None:
    """Work that is a part of other work, from one share of that to another."""
    if progress is None:
        return None
    tell = progress
    return lambda done, total: tell(int(PERCENT * (start + (end - start) * done / total)), PERCENT)
