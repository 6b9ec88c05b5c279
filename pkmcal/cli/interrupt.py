"""Ctrl-C, and signals that ask a program to end; and the one of a pipe that nobody reads.

While the program is loaded or ends they end it at once, while a verb works they are raised.
Imports next to nothing, so that they are provided for from the beginning.
"""

from __future__ import annotations

import _thread
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType

_NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")  # the last is that of a console of Windows
_SIGNALS = [getattr(signal, name) for name in _NAMES if hasattr(signal, name)]
_TWICE = 1.0  # s: a terminal that closes says so twice
_AGAIN = 0.01  # s, after which a signal is raised again where Python ignored what it raised
_PATIENCE = 30.0  # s, after which one is raised again that led to nothing
_UNREAD = getattr(signal, "SIGPIPE", None)  # what is written to is closed; Windows has it not


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


def ends_with_its_reader() -> None:
    """End at once when nobody reads what is printed, as others do: `pkmcal … | head`."""
    if _UNREAD is not None:
        signal.signal(_UNREAD, signal.SIG_DFL)


@contextmanager
def lost_connections_are_errors() -> Iterator[None]:
    """While in this context: a connection or process that is gone is raised, and ends nothing.

    For a verb that speaks with others than its terminal: the system sends one signal for all.
    """
    before = None if _UNREAD is None else signal.signal(_UNREAD, signal.SIG_IGN)
    try:
        yield
    finally:
        if _UNREAD is not None:
            signal.signal(_UNREAD, before)


class IsRaised:
    """While in this context: as KeyboardInterrupt, so that what was begun is tidied up.

    What is raised while Python tidies up an object, as in a callback of a weak reference, it prints
    and ignores: such a signal is raised again. So is one after which this context lasts: libraries
    may pass over it, too, or keep a lock that they were just taking.
    """

    def __enter__(self) -> None:
        self._lasts = True
        self._before = [signal.getsignal(number) for number in _SIGNALS]
        self._hook, sys.unraisablehook = sys.unraisablehook, self._ignored
        self._last = -_TWICE
        self._begin()

    def _begin(self) -> None:
        _handle(self._raise)

    def _raise(self, number: int, frame: FrameType | None) -> None:
        before, self._last = self._last, time.monotonic()
        if self._last - before >= _TWICE:  # else it is being tidied up
            self._soon(number, _PATIENCE)
            raise Stopped(number)

    def _ignored(self, unraisable: sys.UnraisableHookArgs) -> None:
        if isinstance(unraisable.exc_value, Stopped):
            self._soon(unraisable.exc_value.number, _AGAIN)
        else:
            self._hook(unraisable)

    def _soon(self, number: int, after: float) -> None:
        # by no object of `threading`, whose locks the main thread may hold just here
        _thread.start_new_thread(self._again, (number, after))

    def _again(self, number: int, after: float) -> None:
        time.sleep(after)
        if self._lasts:
            self._last = -_TWICE  # now: at once, and a signal that comes twice would be lost
            _send(number)

    def __exit__(self, *_: object) -> None:
        self._lasts = False
        sys.unraisablehook = self._hook
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


def _send(number: int) -> None:
    """Raise a signal in the main thread, whose sleep it ends."""
    main = threading.main_thread().ident
    if main is None or not hasattr(signal, "pthread_kill"):  # Windows
        signal.raise_signal(number)
    else:
        signal.pthread_kill(main, number)


def _number(stop: KeyboardInterrupt) -> int:
    return stop.number if isinstance(stop, Stopped) else signal.SIGINT


def _said(number: int) -> str:
    name = "Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name
    return f"stopped by {name}"
