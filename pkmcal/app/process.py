"""The process that computes: started again whatever ended it, for the project is its only state."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import os
import signal
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

from pkmcal.app.launched import launched

_LONGEST_LINE = 2**28  # bytes of one message
_FAILED = (
    "the computing process ended{how}; it is started again, and nothing of your project is lost"
)

Message = dict[str, Any]
Process = asyncio.subprocess.Process
_REST = 0.5  # s without a request, after which the next process is started


class Worker:
    """A process that computes, one at a time; requests wait for each other.

    Once it has answered, a second process is started, which has imported everything when the first
    is ended: work goes on at once.

    Parameters
    ----------
    folder : Path
        The project, in which the process works.
    log : Path, optional
        Where it writes what nobody asked for.
    """

    def __init__(self, folder: Path, log: Path | None = None) -> None:
        self._folder, self._log = folder, log
        self._process: Process | None = None
        self._spare: Process | None = None
        self._preparing: asyncio.Task[None] | None = None
        self._numbers = itertools.count(1)
        self._one_by_one = asyncio.Lock()
        self.starts = 0

    @property
    def pid(self) -> int | None:
        """The process that works, if there is one."""
        return self._process.pid if self._process is not None and _runs(self._process) else None

    @property
    def spare(self) -> int | None:
        """The process that waits to take its place, if there is one."""
        return self._spare.pid if self._spare is not None and _runs(self._spare) else None

    async def start(self) -> Process:
        """Have a process, the one that waits if there is one; it imports while nobody waits."""
        if self._process is None or not _runs(self._process):
            spare, self._spare = self._spare, None
            there = spare is not None and _runs(spare)
            self._process = spare if spare is not None and there else await self._launched()
            self.starts += 1
        return self._process

    async def _launched(self) -> Process:
        log = os.devnull if self._log is None else self._log
        with open(log, "ab") as errors:
            return await launched(
                "pkmcal.app.worker", self._folder, stderr=errors, limit=_LONGEST_LINE
            )

    def _prepare(self) -> None:
        """Start a process that waits, once nothing was asked for a moment."""
        if self._preparing is not None:
            self._preparing.cancel()
        self._preparing = asyncio.ensure_future(self._prepared())

    async def _prepared(self) -> None:
        await asyncio.sleep(_REST)
        if self._spare is None or not _runs(self._spare):
            launching = asyncio.ensure_future(self._launched())
            launching.add_done_callback(self._keep)
            await asyncio.shield(launching)

    def _keep(self, launched: asyncio.Future[Process]) -> None:
        if not launched.cancelled() and launched.exception() is None:
            self._spare = launched.result()

    async def run(self, operation: str, **asked: Any) -> AsyncIterator[Message]:
        """Yield the messages of one request; the last is a result or an error.

        Who stops listening ends the process, for nobody waits for what it does.
        """
        await self._one_by_one.acquire()
        done = False
        try:
            process = await self.start()
            assert process.stdin is not None and process.stdout is not None
            number = next(self._numbers)
            line = json.dumps({"id": number, "operation": operation, **asked}) + "\n"
            with contextlib.suppress(ConnectionError):
                process.stdin.write(line.encode())
                await process.stdin.drain()
                while answer := await process.stdout.readline():
                    message = json.loads(answer)
                    if message.pop("id") != number:
                        continue
                    done = "result" in message or "error" in message
                    if done:
                        self._prepare()
                    yield message
                    if done:
                        return
            code = await process.wait()
            done = True
            how = f" (signal {signal.Signals(-code).name})" if code < 0 else ""
            await self.start()
            self._prepare()
            yield {"error": {"message": _FAILED.format(how=how), "crashed": True}}
        finally:
            if done:
                self._one_by_one.release()
            else:
                await asyncio.shield(self._ended())

    async def _ended(self) -> None:
        """End a request that nobody waits for: the next one has another process, not that."""
        try:
            await self.restart()
        finally:
            self._one_by_one.release()

    async def restart(self) -> None:
        """End what the process does, and have another."""
        await _end(self._process)
        await self.start()
        self._prepare()

    async def stop(self) -> None:
        """End all processes."""
        if self._preparing is not None:
            self._preparing.cancel()
        await _end(self._process)
        await _end(self._spare)


def _runs(process: Process) -> bool:
    return process.returncode is None


async def _end(process: Process | None) -> None:
    if process is not None and _runs(process):
        with contextlib.suppress(ProcessLookupError):
            process.kill()
        await process.wait()
