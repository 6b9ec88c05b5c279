"""Requests to one server of HTTP: fixed paths, no redirects, no proxies, short answers."""

from __future__ import annotations

import json
import time
import urllib.error
import urllib.parse
import urllib.request
from typing import Any

from pkmcal.live.address import http_address
from pkmcal.live.device import DeviceError

_LONGEST = 1_000_000  # bytes of an answer
_WAIT = 10.0  # s, of a question; a move has its own


class RefusedError(DeviceError):
    """A server answers with an error.

    Attributes
    ----------
    code : int
        That of HTTP, such as 401.
    """

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code


class _NoRedirect(urllib.request.HTTPRedirectHandler):
    def redirect_request(self, *_: Any) -> None:
        return None  # what it leads to is an address that nobody typed


class Server:
    """A server whose answers are JSON or text.

    Parameters
    ----------
    address : str
        As `http_address` takes it.
    what : str
        What answers there, for messages.
    """

    def __init__(self, address: str, what: str) -> None:
        self.address = http_address(address, what)
        self._what = f"{what} at {self.address}"
        self._open = urllib.request.build_opener(
            _NoRedirect(), urllib.request.ProxyHandler({})
        ).open
        self.headers: dict[str, str] = {}

    def ask(
        self, path: str, method: str = "GET", wait: float = _WAIT, **query: str | int
    ) -> dict[str, Any]:
        """The JSON object of an answer.

        Raises
        ------
        DeviceError
            No answer, an error, no JSON object.
        """
        text = self.text(path, method, wait, **query)
        try:
            found = json.loads(text)
        except (ValueError, RecursionError):
            found = None
        if not isinstance(found, dict):
            raise DeviceError(f"{self._what}: its answer is no JSON object: {text[:80]!r}")
        return found

    def text(self, path: str, method: str = "GET", wait: float = _WAIT, **query: str | int) -> str:
        """The text of an answer.

        Raises
        ------
        DeviceError
            No answer, an error, or an answer that is too long or takes too long.
        """
        end = time.monotonic() + wait
        asked = f"?{urllib.parse.urlencode(query)}" if query else ""
        request = urllib.request.Request(
            self.address + path + asked, method=method, headers=self.headers
        )
        try:
            with self._answer(request, wait) as answer:
                found = b""
                while len(found) <= _LONGEST and (some := answer.read1(_LONGEST)):
                    found += some
                    if time.monotonic() > end:
                        raise TimeoutError("its answer does not end")
                if isinstance(answer, urllib.error.HTTPError):
                    raise RefusedError(f"{self._what}: {_said(answer, found)}", answer.code)
                if len(found) <= _LONGEST and answer.length:
                    raise DeviceError(f"{self._what} broke off: half an answer")
        except (OSError, ValueError, urllib.error.URLError) as error:
            reason = getattr(error, "reason", None) or error
            raise DeviceError(f"{self._what} does not answer: {reason}") from None
        except DeviceError:
            raise
        except Exception as error:  # of http.client: half an answer, a line that is none
            raise DeviceError(f"{self._what} broke off: {error or type(error).__name__}") from None
        if len(found) > _LONGEST:
            raise DeviceError(f"{self._what}: an answer of more than {_LONGEST} bytes")
        return found.decode("utf-8", "replace")

    def _answer(self, request: urllib.request.Request, wait: float) -> Any:
        """Return the answer, that of an error too: its body is read with the same limits."""
        try:
            return self._open(request, timeout=wait)
        except urllib.error.HTTPError as error:
            return error


def _said(error: urllib.error.HTTPError, body: bytes) -> str:
    """Text of a server's error, in its own words where it has some."""
    try:
        message = json.loads(body)["error"]["message"]
    except (ValueError, KeyError, TypeError, RecursionError):
        message = error.reason
    return f"{error.code}, {message}"
