"""The body of a request, no longer than it may be."""

from __future__ import annotations

from starlette.requests import Request


class TooLargeError(Exception):
    """A request has more bytes than it may have."""


async def body(request: Request, most: int) -> bytes:
    """Return the body of a request of at most so many bytes.

    Raises
    ------
    TooLargeError
        It has more.
    """
    found = b""
    async for chunk in request.stream():
        found += chunk
        if len(found) > most:
            raise TooLargeError
    return found
