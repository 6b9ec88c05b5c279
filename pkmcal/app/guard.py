"""The guard of the server: only its own page, with its token, on this computer may ask."""

from __future__ import annotations

import hmac
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any

Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
Application = Callable[[Message, Receive, Send], Awaitable[None]]

TOKEN = "x-pkmcal-token"
POLICY = "; ".join([
    "default-src 'none'", "script-src 'self' 'wasm-unsafe-eval'", "style-src 'self'",
    "connect-src 'self'", "img-src 'self' blob: data:", "base-uri 'none'", "form-action 'none'",
    "frame-ancestors 'none'",
])  # fmt: skip
_HEADERS = {
    "content-security-policy": POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "x-frame-options": "DENY",
    "cache-control": "no-store",
}


class Guard:
    """Stands before an application: refuses foreign hosts, origins, sites and missing tokens.

    Parameters
    ----------
    application : callable
        What answers (ASGI).
    port : int
        Where the server listens: the only hosts are 127.0.0.1 and localhost with it, for a name of
        another that was made to lead here (DNS rebinding) is not one of them.
    token : str
        What every request below ``/api/`` has to bring in a header, which a page of another
        origin cannot send.
    """

    def __init__(self, application: Application, port: int, token: str) -> None:
        self._application, self._token = application, token.encode()
        self._hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}

    async def __call__(self, scope: Message, receive: Receive, send: Send) -> None:
        """Answer a request (ASGI)."""
        if scope["type"] == "lifespan":
            await self._application(scope, receive, send)
        elif scope["type"] == "http":
            refused = self._refused(scope)
            if refused is None:
                await self._application(scope, receive, _with_headers(send))
            else:
                await _refuse(_with_headers(send), *refused)

    def _refused(self, scope: Message) -> tuple[int, str] | None:
        given: dict[str, list[str]] = {}
        for name, value in scope["headers"]:
            given.setdefault(name.decode("latin-1"), []).append(value.decode("latin-1"))
        hosts = given.get("host", [])
        if len(hosts) != 1 or hosts[0] not in self._hosts:
            return 421, "not this host"
        if any(origin != f"http://{hosts[0]}" for origin in given.get("origin", [])):
            return 403, "another origin"
        if any(site not in ("same-origin", "none") for site in given.get("sec-fetch-site", [])):
            return 403, "another site"
        tokens = given.get(TOKEN, [])
        said = tokens[0].encode("latin-1") if len(tokens) == 1 else b""
        if scope["path"].startswith("/api/") and not hmac.compare_digest(said, self._token):
            return 401, "no token: open the page from the terminal again"
        return None


async def _refuse(send: Send, status: int, why: str) -> None:
    head = [(b"content-type", b"text/plain; charset=utf-8")]
    await send({"type": "http.response.start", "status": status, "headers": head})
    await send({"type": "http.response.body", "body": why.encode()})


def _with_headers(send: Send) -> Send:
    async def sent(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = list(message.get("headers", ()))
            there = {name for name, _ in headers}
            more = [(name.encode(), value.encode()) for name, value in _HEADERS.items()]
            message = {**message, "headers": headers + [one for one in more if one[0] not in there]}
        await send(message)

    return sent
