"""The process that computes: started again whatever ended it, for the project is its only state."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import os
import signal
import sys
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

_LONGEST_LINE = 2**28  # bytes of one message
_FAILED = (
    "the computing process ended{how}; it is started again, and nothing of your project is lost"
)

Message = dict[str, Any]


class Worker:
    """A process that computes, one at a time; requests wait for each other.

    Parameters
    ----------
    folder : Path
        The project, in which the process works.
    log : Path, optional
        Where it writes what nobody asked for.
    """

    def __init__(self, folder: Path, log: Path | None = None) -> None:
        self._folder, self._log = folder, log
        self._process: asyncio.subprocess.Process | None = None
        self._numbers = itertools.count(1)
        self._one_by_one = asyncio.Lock()
        self.starts = 0

    @property
    def pid(self) -> int | None:
        """The process, if there is one."""
        there = self._process is not None and self._process.returncode is None
        return self._process.pid if there and self._process is not None else None

    async def start(self) -> asyncio.subprocess.Process:
        """Start the process, if none runs; it imports while nobody waits."""
        if self._process is None or self._process.returncode is not None:
            log = os.devnull if self._log is None else self._log
            with open(log, "ab") as errors:
                self._process = await asyncio.create_subprocess_exec(
                    sys.executable, "-m", "pkmcal.app.worker",
                    stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE, stderr=errors,
                    cwd=self._folder, limit=_LONGEST_LINE,
                    env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONUTF8": "1"},
                )  # fmt: skip
            self.starts += 1
        return self._process

    async def run(self, operation: str, **asked: Any) -> AsyncIterator[Message]:
        """Yield the messages of one request; the last is a result or an error.

        Who stops listening ends the process, for nobody waits for what it does.
        """
        async with self._one_by_one:
            process = await self.start()
            assert process.stdin is not None and process.stdout is not None
            number = next(self._numbers)
            line = json.dumps({"id": number, "operation": operation, **asked}) + "\n"
            done = False
            try:
                with contextlib.suppress(ConnectionError):
                    process.stdin.write(line.encode())
                    await process.stdin.drain()
                    while answer := await process.stdout.readline():
                        message = json.loads(answer)
                        if message.pop("id") != number:
                            continue
                        done = "result" in message or "error" in message
                        yield message
                        if done:
                            return
                code = await process.wait()
                done = True
                how = f" (signal {signal.Signals(-code).name})" if code < 0 else ""
                await self.start()
                yield {"error": {"message": _FAILED.format(how=how), "crashed": True}}
            finally:
                if not done:
                    await asyncio.shield(self.restart())

    async def restart(self) -> None:
        """End what the process does, and start another."""
        await self.stop()
        await self.start()

    async def stop(self) -> None:
        """End the process."""
        if self._process is not None and self._process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                self._process.kill()
            await self._process.wait()
