"""The server of a window: its page, the project, files, and streams of what is computed.

It computes nothing and imports nothing that does: that is the worker's.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import secrets
import tempfile
from collections.abc import AsyncIterator, Callable
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Route

from pkmcal.app.body import TooLargeError, body
from pkmcal.app.commands import commands
from pkmcal.app.folder import MOST_FILE, MOST_FOLDER, UPLOAD, Folder
from pkmcal.app.guard import Application, Guard
from pkmcal.app.live import Live
from pkmcal.app.process import Message, Worker
from pkmcal.exceptions import Error, words_of
from pkmcal.jobs.plan import GCODE
from pkmcal.jobs.stated import quoted
from pkmcal.view import scripts

OPERATIONS = ("take", "machine", "plan", "look", "devices", "fit", "out", "report")
FOR_TESTS = ("wait", "crash")
PAGES = ("app.js", "frame.js", "transport.js", "picture.js", "machine.js", "plan.js",
         "measure.js", "live.js", "result.js", "grid.js", "numbers.js", "out.js")  # fmt: skip
_KINDS = {".css": "text/css", ".js": "text/javascript", ".html": "text/html"}
_MOST_STATE = 1_000_000  # bytes
_SILENT = 15.0  # s, after which a stream of events says that it is there


class Server:
    """The server of one project's page."""

    def __init__(
        self,
        folder: Folder,
        worker: Worker,
        operations: tuple[str, ...],
        door: contextlib.AbstractContextManager[None],
    ) -> None:
        self._folder, self._worker, self._operations, self._door = folder, worker, operations, door
        self._listeners: set[asyncio.Queue[Message | None]] = set()
        self._running: dict[str, asyncio.Event] = {}
        self._announced = folder.version
        self._live = Live(folder, self._follow)

    def application(self) -> Starlette:
        """Return the routes, without the guard."""

        @contextlib.asynccontextmanager
        async def life(_: Starlette) -> AsyncIterator[None]:
            with self._door:  # uvicorn ends by the signal that it got: nothing after it runs
                await self._worker.start()  # it imports while the page is opened
                yield
                await self._live.ended()
                await self._worker.stop()

        return Starlette(
            lifespan=life,
            routes=[
                _static("/", "index.html"),
                *(_static(f"/{name}", name) for name in PAGES),
                _constant("/view.js", scripts.module("calibration").encode(), "text/javascript"),
                _constant("/app.css", _style(), "text/css"),
                Route("/wasm/{kind}", self.core),
                Route("/api/state", self.state),
                Route("/api/state", self.change, methods=["POST"]),
                Route("/api/undo", self.undo, methods=["POST"]),
                Route("/api/file/{name:path}", self.upload, methods=["PUT"]),
                Route("/api/run/{operation}", self.run, methods=["POST"]),
                Route("/api/cancel/{job}", self.cancel, methods=["POST"]),
                *self._live.routes(),
                Route("/api/events", self.events),
                Route("/api/download/{path:path}", self.download),
                Route("/api/health", self.health),
            ],
        )

    async def core(self, request: Request) -> Response:
        """The WebAssembly of a kind of machine."""
        name = scripts.MODULES.get(request.path_params["kind"])
        if name is None:
            return _refused(404, "no such core")
        return Response(scripts.resource(f"wasm/{name}.wasm"), media_type="application/wasm")

    async def state(self, request: Request) -> Response:
        """The project, its files, and what each screen does as lines for a terminal."""
        try:
            self._follow(_tab(request))
        except (Error, OSError) as error:
            return JSONResponse({**self._state(), "trouble": str(error)})
        return JSONResponse(self._state())

    def _follow(self, by: str = "") -> None:
        """Take over what was edited in the project's file, and tell all pages but who asked."""
        try:
            self._folder.follow()
        finally:
            self._announce(by)

    def _announce(self, by: str) -> None:
        if self._folder.version == self._announced:
            return
        self._announced = self._folder.version
        for queue in self._listeners:
            queue.put_nowait({"changed": self._announced, "by": by})

    def _state(self) -> Message:
        folder = self._folder
        return {
            "version": folder.version,
            "state": folder.project.table(),
            "files": folder.files,
            "folder": str(folder.path),
            "undo": folder.undoable,
            "commands": commands(folder.project),
            "enter": quoted(["cd", str(folder.path)]),
            "again": quoted(["pkmcal", "app", str(folder.path)]),
            "machines": _built_in(),
            "gcode": GCODE,
        }

    async def change(self, request: Request) -> Response:
        """Take a whole new state of the version that it was made of."""
        try:
            asked = json.loads(await body(request, _MOST_STATE))
            table, version = asked["state"], asked["version"]
        except TooLargeError:
            return _refused(413, "too large")
        except (ValueError, RecursionError, TypeError, KeyError):
            return _refused(400, "no state in this request")
        try:
            taken = isinstance(table, dict) and self._folder.change(table, version)
        except Error as error:
            return _refused(400, str(error))
        except OSError as error:  # a full disk, a folder that may only be read
            return _refused(507, words_of(error))
        return self._changed(request, taken)

    async def undo(self, request: Request) -> Response:
        """Go one state back."""
        try:
            version = json.loads(await body(request, _MOST_STATE))["version"]
        except (ValueError, RecursionError, TypeError, KeyError, TooLargeError):
            return _refused(400, "no version in this request")
        try:
            return self._changed(request, self._folder.undo(version))
        except Error as error:
            return _refused(400, str(error))
        except OSError as error:
            return _refused(507, words_of(error))

    def _changed(self, request: Request, taken: bool) -> Response:
        self._announce(_tab(request))
        if not taken:
            return JSONResponse({**self._state(), "error": "changed elsewhere"}, 409)
        return JSONResponse(self._state())

    async def upload(self, request: Request) -> Response:
        """Take a file into the folder: the whole of it, or nothing."""
        announced = request.headers.get("content-length", "0")
        room = min(MOST_FILE, MOST_FOLDER - self._folder.used())
        large = f"files of this project may have {MOST_FILE // 10**6} MB, all of them together 1 GB"
        if not announced.isdecimal() or int(announced) > room:
            return _refused(413, large)
        try:
            self._folder.refuse_gone()
            place, part = tempfile.mkstemp(UPLOAD[1], UPLOAD[0], self._folder.path)
        except Error as error:
            return _refused(400, str(error))
        except OSError as error:
            return _refused(507, f"the file could not be kept: {error.strerror}")
        try:
            count = 0
            with os.fdopen(place, "wb") as out:
                async for chunk in request.stream():
                    count += len(chunk)
                    if count > room:
                        return _refused(413, large)
                    out.write(chunk)
            name, former = self._folder.store(request.path_params["name"], Path(part))
        except ClientDisconnect:
            return _refused(400, "not complete")
        except OSError as error:
            return _refused(507, f"the file could not be kept: {error.strerror}")
        finally:
            Path(part).unlink(missing_ok=True)
        said = None if former is None else f"{name} is new; the one before is kept as {former}"
        return JSONResponse({"name": name, "said": said})

    async def run(self, request: Request) -> Response:
        """Stream what an operation of the worker says, line by line."""
        operation = request.path_params["operation"]
        if operation not in self._operations:
            return _refused(404, "no such work")
        try:
            asked = json.loads(await body(request, _MOST_STATE) or b"{}")
        except (ValueError, RecursionError, TooLargeError):
            return _refused(400, "no request")
        if not isinstance(asked, dict):
            return _refused(400, "no request")
        return _streamed(self._lines(operation, asked))

    async def _lines(self, operation: str, asked: Message) -> AsyncIterator[bytes]:
        try:
            self._follow()
            self._folder.refuse_links(self._folder.project)
        except (Error, OSError) as error:
            yield _line({"error": {"message": words_of(error)}})
            return
        job = secrets.token_urlsafe(6)
        stopped = self._running[job] = asyncio.Event()
        messages = self._worker.run(operation, state=self._folder.project.table(), given=asked)
        stop = asyncio.ensure_future(stopped.wait())
        following: asyncio.Future[Message | None] = asyncio.ensure_future(anext(messages, None))
        try:
            yield _line({"job": job})
            while True:
                tasks: set[asyncio.Future[Any]] = {following, stop}
                await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
                if not following.done():
                    await _ended(following)
                    yield _line({"error": {"message": "stopped", "stopped": True}})
                    return
                message = following.result()
                if message is None:
                    return
                yield _line(message)
                following = asyncio.ensure_future(anext(messages, None))
        finally:  # also where the tab was closed
            stop.cancel()
            self._running.pop(job, None)
            await asyncio.shield(_ended(following))

    async def cancel(self, request: Request) -> Response:
        """Stop a job at once."""
        event = self._running.get(request.path_params["job"])
        if event is not None:
            event.set()
        return JSONResponse({"stopped": event is not None})

    async def events(self, request: Request) -> Response:
        """Stream that the project changed, and by which tab."""
        return _streamed(self._events())

    async def _events(self) -> AsyncIterator[bytes]:
        queue: asyncio.Queue[Message | None] = asyncio.Queue()
        self._listeners.add(queue)
        try:
            yield _line({"version": self._folder.version})
            while True:
                try:
                    told = await asyncio.wait_for(queue.get(), _SILENT)
                except asyncio.TimeoutError:
                    yield b"\n"
                    continue
                if told is None:
                    return
                yield _line(told)
        finally:
            self._listeners.discard(queue)

    def end(self) -> None:
        """End what is streamed to pages, machines first: the server is about to end."""
        self._live.stop()
        for queue in self._listeners:
            queue.put_nowait(None)
        for stopped in self._running.values():
            stopped.set()

    async def download(self, request: Request) -> Response:
        """A file of the folder, never shown by the browser itself."""
        found = self._folder.written(request.path_params["path"])
        if found is None:
            return _refused(404, "no such file")
        return FileResponse(found, media_type="application/octet-stream", filename=found.name)

    async def health(self, request: Request) -> Response:
        """The processes that compute and wait, and how many have computed."""
        worker = self._worker
        return JSONResponse({"worker": worker.pid, "spare": worker.spare, "starts": worker.starts})


@cache
def _built_in() -> list[str]:
    """Return the names of all built-in machines, as files that nobody has to read."""
    folders = (files("pkmcal.builtin").joinpath(kind) for kind in ("machines", "arms"))
    found = [each.name for folder in folders for each in folder.iterdir()]
    return sorted(name.removesuffix(".toml") for name in found if name.endswith(".toml"))


def guarded(
    folder: Folder,
    port: int,
    token: str,
    door: contextlib.AbstractContextManager[None],
    testing: bool = False,
) -> tuple[Application, Callable[[], None]]:
    """Return the whole application, routes behind the guard, and what ends its streams.

    `door` is open while it is there.
    """
    operations = OPERATIONS + FOR_TESTS * testing
    server = Server(folder, Worker(folder.path), operations, door)
    return Guard(server.application(), port, token), server.end


async def _ended(task: asyncio.Future[Any]) -> None:
    """End a task, and wait until it has ended."""
    task.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await task


def _static(path: str, name: str) -> Route:
    content = files("pkmcal.app").joinpath(f"page/{name}").read_bytes()
    return _constant(path, content, _KINDS[Path(name).suffix])


def _style() -> bytes:
    """Return one style sheet: of the page, and of a machine in it."""
    own = files("pkmcal.app").joinpath("page/app.css").read_bytes()
    return scripts.style().encode() + b"\n" + own


def _constant(path: str, content: bytes, kind: str) -> Route:
    async def answer(request: Request) -> Response:
        return Response(content, media_type=kind)

    return Route(path, answer)


def _streamed(lines: AsyncIterator[bytes]) -> StreamingResponse:
    return StreamingResponse(lines, media_type="application/x-ndjson")


def _tab(request: Request) -> str:
    return request.headers.get("x-pkmcal-tab", "")


def _refused(status: int, why: str) -> Response:
    return JSONResponse({"error": why}, status)


def _line(message: Any) -> bytes:
    return json.dumps(message, separators=(",", ":"), allow_nan=False).encode() + b"\n"
