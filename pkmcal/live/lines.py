"""A connection that speaks in lines of text."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from typing import TypeVar

from pkmcal.live.device import DeviceError

_LONGEST = 100_000  # bytes without the end of a line
_T = TypeVar("_T")


class Lines:
    """A connection to a host that answers in lines.

    Parameters
    ----------
    host, port
        Where it listens.
    what : str
        What listens there, for messages.
    wait : float
        Seconds for which an answer is waited for.

    Raises
    ------
    DeviceError
        Nobody listens.
    """

    def __init__(self, host: str, port: int, what: str, wait: float = 10.0) -> None:
        self._what, self._wait, self._rest = f"{what} at {host}:{port}", wait, b""
        try:
            self._socket = socket.create_connection((host, port), timeout=wait)
        except OSError as error:
            raise DeviceError(f"{self._what} does not answer: {error}") from None

    def send(self, text: str | bytes) -> None:
        """Send a line, or bytes as they are.

        Raises
        ------
        DeviceError
            The connection is gone.
        """
        try:
            self._socket.sendall(text if isinstance(text, bytes) else f"{text}\n".encode("ascii"))
        except OSError as error:
            raise DeviceError(f"{self._what} broke off: {error}") from None

    def line(self, wait: float | None = None) -> str:
        """The next line, without its end.

        Raises
        ------
        DeviceError
            None comes in time, the connection is gone, or a line without end.
        """
        end = time.monotonic() + (self._wait if wait is None else wait)
        while b"\n" not in self._rest:
            left = end - time.monotonic()
            if left <= 0.0:
                raise DeviceError(f"{self._what} does not answer")
            self._socket.settimeout(left)
            try:
                some = self._socket.recv(65536)
            except TimeoutError:
                continue
            except OSError as error:
                raise DeviceError(f"{self._what} broke off: {error}") from None
            if not some or len(self._rest) > _LONGEST:
                raise DeviceError(f"{self._what} closed the connection")
            self._rest += some
        line, self._rest = self._rest.split(b"\n", 1)
        return line.decode("utf-8", "replace").strip()

    def answer(self, taken: Callable[[str], _T | None]) -> _T:
        """Return the content of the first line that is an answer; pass over others, for a time.

        Parameters
        ----------
        taken : callable
            Returns what a line says, None of one that is no answer; may raise.

        Raises
        ------
        DeviceError
            None comes in time, or the connection is gone.
        """
        end = time.monotonic() + self._wait
        while (found := taken(self.line(end - time.monotonic()))) is None:
            continue
        return found

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()
