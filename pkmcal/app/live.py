"""A measurement with a machine, for a page: its process, started and stopped by who looks at it.

The process lives as long as the stream that tells a page of it: a tab that is closed, a server that
ends or dies stop the machine. Nothing moves before the page that connected it says ``start``.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import secrets
from collections.abc import AsyncIterator, Callable
from typing import Any

from starlette.requests import Request
from starlette.responses import JSONResponse, Response, StreamingResponse
from starlette.routing import Route

from pkmcal.app.body import TooLargeError, body
from pkmcal.app.folder import Folder
from pkmcal.app.launched import launched
from pkmcal.exceptions import Error, words_of

_MOST = 20_000  # bytes of a request
_SILENT = 1.0  # s, after which a line that says nothing finds out whether somebody still listens
_LONGEST = 2**20  # bytes of a line that it says
_LAST = 20.0  # s in which a process that was told to stop has stopped its machine
_ELSEWHERE = "a measurement is going on; it has to end, or to be stopped, first"
Message = dict[str, Any]


class Live:
    """The measurement of a project: one at a time.

    Parameters
    ----------
    folder : Folder
        The project, in which rows are written.
    follow : callable
        Takes over what was edited in the project's file.
    """

    def __init__(self, folder: Folder, follow: Callable[[], None]) -> None:
        self._folder, self._follow = folder, follow
        self._name = ""  # of the run; who has it may start it
        self._process: asyncio.subprocess.Process | None = None

    def routes(self) -> list[Route]:
        """Routes of the requests of a page."""
        return [
            Route("/api/live", self.begin, methods=["POST"]),
            Route("/api/live/stop", self.stopped, methods=["POST"]),
            Route("/api/live/{name}/{word}", self.said, methods=["POST"]),
        ]

    async def begin(self, request: Request) -> Response:
        """Connect machine and instrument, and stream what happens."""
        asked = await _asked(request)
        if not isinstance(asked, dict) or not isinstance(asked.get("machine"), str):
            return _refused(400, "no machine in this request")
        if self._name:
            return _refused(409, _ELSEWHERE)
        try:
            self._follow()
            self._folder.refuse_links(self._folder.project)
        except (Error, OSError) as error:
            return _refused(400, words_of(error))
        first = {"state": self._folder.project.table(), "given": asked}
        return StreamingResponse(self._lines(first), media_type="application/x-ndjson")

    async def said(self, request: Request) -> Response:
        """Pass on what the page says: ``start``, or ``type`` with a text."""
        asked, word = await _asked(request), request.path_params["word"]
        own = bool(self._name) and request.path_params["name"] == self._name
        if not own or self._process is None:
            return _refused(409, "this measurement has ended")
        if word == "start":
            self._tell({"do": "start"})
        elif word == "type" and isinstance(asked, dict) and isinstance(asked.get("text"), str):
            self._tell({"do": "type", "text": asked["text"], "number": asked.get("number")})
        else:
            return _refused(400, "neither start nor a text")
        return JSONResponse({})

    async def stopped(self, request: Request) -> Response:
        """Stop, whoever asks: also from another tab."""
        self.stop()
        return JSONResponse({})

    def stop(self) -> None:
        """Tell the process to stop the machine and to end."""
        self._tell({"do": "stop"})

    async def ended(self) -> None:
        """Wait until the process has stopped its machine and has ended."""
        process = self._process
        if process is None:
            return
        self.stop()
        if process.stdin is not None:
            process.stdin.close()
        try:
            await asyncio.wait_for(process.wait(), _LAST)
        except asyncio.TimeoutError:
            process.kill()
            await process.wait()
        if self._process is process:
            self._process, self._name = None, ""

    def _tell(self, message: Message) -> None:
        process = self._process
        if process is not None and process.stdin is not None and process.returncode is None:
            with contextlib.suppress(ConnectionError, RuntimeError):  # it has ended
                process.stdin.write(json.dumps(message).encode() + b"\n")

    async def _lines(self, first: Message) -> AsyncIterator[bytes]:
        if self._name:  # another tab was first
            yield _line({"error": {"message": _ELSEWHERE}})
            return
        self._name = name = secrets.token_urlsafe(12)
        following: asyncio.Future[bytes] | None = None
        try:
            yield _line({"run": name})
            self._process = process = await launched(
                "pkmcal.app.measurer", self._folder.path,
                stderr=asyncio.subprocess.DEVNULL, limit=_LONGEST,
                start_new_session=True,  # Ctrl-C reaches it by the server alone, in order
            )  # fmt: skip
            assert process.stdin is not None and process.stdout is not None
            process.stdin.write(json.dumps(first).encode() + b"\n")
            last = False
            while True:
                following = asyncio.ensure_future(process.stdout.readline())
                while not (await asyncio.wait({following}, timeout=_SILENT))[0]:
                    yield b"\n"
                line = following.result()
                if not line:
                    break
                last = b'"result"' in line[:12] or b'"error"' in line[:12]
                yield line
            if not last:
                code = await process.wait()
                why = f"the measuring process ended ({code}): look whether the machine moves"
                yield _line({"error": {"message": f"{why}; every row is in its file"}})
        finally:
            if following is not None:
                following.cancel()
            await asyncio.shield(self._finished(name))

    async def _finished(self, name: str) -> None:
        await self.ended()
        if self._name == name:
            self._name = ""


async def _asked(request: Request) -> Any:
    """The JSON of a request; None where it has none, or too much."""
    try:
        return json.loads(await body(request, _MOST) or b"{}")
    except (ValueError, RecursionError, TooLargeError):
        return None


def _refused(status: int, why: str) -> Response:
    return JSONResponse({"error": why}, status)


def _line(message: Message) -> bytes:
    return json.dumps(message).encode() + b"\n"
