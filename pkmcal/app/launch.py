"""Starts a window: a socket on this computer alone, a token, a browser."""

from __future__ import annotations

import asyncio
import contextlib
import os
import secrets
import signal
import socket
import webbrowser
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType

import uvicorn

from pkmcal.app.claim import CLAIM, ClaimedError, claimed
from pkmcal.app.folder import Folder
from pkmcal.app.server import guarded

HOST = "127.0.0.1"
DOOR = ".open-pkmcal.html"
_DOOR = """<!doctype html><meta charset="utf-8"><title>pkmcal</title>
<meta http-equiv="refresh" content="0; url={url}"><a href="{url}">pkmcal</a>
"""
_CLOSED = getattr(signal, "SIGHUP", None)  # the terminal; Windows has it not
_QUEUE = 64  # connections that wait to be taken
_PATIENCE = 1.0  # s that a page has for the last that it is told


def launch(
    path: Path,
    say: Callable[[str], object],
    browser: bool = True,
    port: int = 0,
    testing: bool = False,
) -> None:
    """Serve the project of a folder until it is interrupted; one that is served already is shown.

    Parameters
    ----------
    path : Path
        The folder, which is made if it is not there.
    say : callable
        Takes the line with the address, once the server listens.
    browser : bool
        Whether to open it in the browser.
    port : int
        Where to listen; 0 takes one that is free.

    Raises
    ------
    ValueError
        A project file with a mistake, or a folder that another process serves and no browser is to
        show.
    OSError
        The port is taken.
    """
    path.mkdir(parents=True, exist_ok=True)
    try:
        with claimed(path):
            _serve(Folder(path), say, browser, port, testing)
    except ClaimedError:
        door = path.resolve() / DOOR
        if not browser or not door.is_file():
            raise
        webbrowser.open(door.as_uri())
        say(f"{path.resolve()}\nits window is open already; the browser shows it")


def _serve(
    folder: Folder, say: Callable[[str], object], browser: bool, port: int, testing: bool
) -> None:
    token = secrets.token_urlsafe(24)
    with contextlib.closing(socket.socket(socket.AF_INET, socket.SOCK_STREAM)) as listening:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((HOST, port))
        listening.listen(_QUEUE)  # a fast browser is here before the server is
        port = listening.getsockname()[1]
        url = f"http://{HOST}:{port}/#t={token}"
        door = _door(folder.path, url, browser)
        application, end = guarded(folder, port, token, door, testing)
        config = uvicorn.Config(
            application, log_level="error", access_log=False,
            proxy_headers=False, server_header=False, lifespan="on", ws="none",
        )  # fmt: skip
        say(f"{folder.path}\n{url}")
        _Ending(config, end).run(sockets=[listening])


class _Ending(uvicorn.Server):
    """A server that ends the streams of its pages when it is asked to end, and waits for none."""

    def __init__(self, config: uvicorn.Config, end: Callable[[], None]) -> None:
        super().__init__(config)
        self._end = end

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Also end in order when the terminal is closed, which uvicorn leaves to others."""
        with super().capture_signals():
            before = None if _CLOSED is None else signal.getsignal(_CLOSED)
            if _CLOSED is None or before in (signal.SIG_IGN, None):  # under nohup, or embedded
                yield
                return
            signal.signal(_CLOSED, self.handle_exit)
            try:
                yield
            finally:
                signal.signal(_CLOSED, before)

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        super().handle_exit(sig, frame)
        self._end()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Cut connections off that are not closed in time, which is no error of anybody's.

        With its own timeout uvicorn cancels their tasks, and prints a traceback of each.
        """
        cutting = asyncio.get_running_loop().call_later(_PATIENCE, self._cut)
        try:
            await super().shutdown(sockets)
        finally:
            cutting.cancel()

    def _cut(self) -> None:
        for each in list(self.server_state.connections):
            each.transport.abort()


@contextlib.contextmanager
def _door(folder: Path, url: str, browser: bool) -> Iterator[None]:
    """Keep a file that only its owner reads and that leads to the page, and open it.

    A browser's arguments are in everybody's list of processes, so the token is not among them.
    """
    path = folder / DOOR
    path.unlink(missing_ok=True)
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
        file.write(_DOOR.format(url=url))
    try:
        if browser:
            webbrowser.open(path.as_uri())
        yield
    finally:
        path.unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # Windows keeps a file that is open
            (folder / CLAIM).unlink()
