"""Ctrl-C: while the program is loaded or ends it ends at once, while a verb works it is raised.

Imports next to nothing, so that it is provided for from the beginning.
"""

from __future__ import annotations

import os
import signal
from types import FrameType

STOPPED = 130  # what shells give a program that Ctrl-C ended
WORDS = "stopped by Ctrl-C"


def ends_at_once() -> None:
    """There is nothing to tidy up, and an exception might end in somebody's import."""
    _handle(_end)


class IsRaised:
    """While in this context: as KeyboardInterrupt, so that what was begun is tidied up."""

    def __enter__(self) -> None:
        self._before = signal.getsignal(signal.SIGINT)
        self._begin()

    def _begin(self) -> None:
        _handle(signal.default_int_handler)

    def __exit__(self, *_: object) -> None:
        signal.signal(signal.SIGINT, self._before)


class EndsAtOnce(IsRaised):
    """While in this context as with `ends_at_once`: a verb is loaded."""

    def _begin(self) -> None:
        ends_at_once()


def _handle(handler: signal._HANDLER) -> None:
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:  # a program in the background
        signal.signal(signal.SIGINT, handler)


def _end(number: int, frame: FrameType | None) -> None:
    os.write(2, f"pkmcal: {WORDS}\n".encode())
    os._exit(STOPPED)
