"""Ctrl-C, and signals that ask a program to end.

While the program is loaded or ends they end it at once, while a verb works they are raised.
Imports next to nothing, so that they are provided for from the beginning.
"""

from __future__ import annotations

import os
import signal
import time
from contextlib import suppress
from types import FrameType

_NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")  # the last is that of a console of Windows
_SIGNALS = [getattr(signal, name) for name in _NAMES if hasattr(signal, name)]
_TWICE = 1.0  # s: a terminal that closes says so twice


class Stopped(KeyboardInterrupt):
    """A signal came while a verb worked.

    Attributes
    ----------
    number : int
        Of the signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


def code(stop: KeyboardInterrupt) -> int:
    """Return what shells give a program that was ended so."""
    return 128 + _number(stop)


def words(stop: KeyboardInterrupt) -> str:
    """Say what ended the program."""
    return _said(_number(stop))


def ends_at_once() -> None:
    """End at once when interrupted: nothing is to be tidied up, and an import might be hit."""
    _handle(_end)


class IsRaised:
    """While in this context: as KeyboardInterrupt, so that what was begun is tidied up."""

    def __enter__(self) -> None:
        self._before = [signal.getsignal(number) for number in _SIGNALS]
        self._last = -_TWICE
        self._begin()

    def _begin(self) -> None:
        _handle(self._raise)

    def _raise(self, number: int, frame: FrameType | None) -> None:
        before, self._last = self._last, time.monotonic()
        if self._last - before >= _TWICE:  # else it is being tidied up
            raise Stopped(number)

    def __exit__(self, *_: object) -> None:
        for number, handler in zip(_SIGNALS, self._before, strict=True):
            if handler is not None:
                signal.signal(number, handler)


class EndsAtOnce(IsRaised):
    """While in this context as with `ends_at_once`: a verb is loaded."""

    def _begin(self) -> None:
        ends_at_once()


def _handle(handler: signal._HANDLER) -> None:
    for number in _SIGNALS:
        # ignored: in the background, or under nohup; None: what embeds Python handles it
        if signal.getsignal(number) not in (signal.SIG_IGN, None):
            signal.signal(number, handler)


def _end(number: int, frame: FrameType | None) -> None:
    with suppress(OSError):  # there may be no stderr
        os.write(2, f"pkmcal: {_said(number)}\n".encode())
    os._exit(128 + number)


def _number(stop: KeyboardInterrupt) -> int:
    return stop.number if isinstance(stop, Stopped) else signal.SIGINT


def _said(number: int) -> str:
    name = "Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name
    return f"stopped by {name}"
