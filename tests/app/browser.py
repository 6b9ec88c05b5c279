"""A server of a project for a test, and Debian's Chromium that looks at it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), None)


@dataclass(frozen=True)
class Served:
    """A project that is served: its folder, address and process."""

    folder: Path
    url: str
    process: subprocess.Popen[str]

    @property
    def token(self) -> str:
        return self.url.partition("#t=")[2]

    @property
    def port(self) -> int:
        return int(self.url.split(":")[2].partition("/")[0])


# the command itself, for it decides what signals do; with operations for tests
_PROGRAM = (
    "from functools import partial; from pkmcal.app import launch as it;"
    "it.launch = partial(it.launch, testing=True);"
    "from pkmcal.cli.main import main; main()"
)


@contextmanager
def served(folder: Path, stderr: int | None = None) -> Iterator[Served]:
    """Serve a folder as `pkmcal app` does until the end of the block."""
    with subprocess.Popen(
        [sys.executable, "-c", _PROGRAM, "app", str(folder), "--no-browser"],
        stdout=subprocess.PIPE,
        stderr=stderr,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    ) as process:
        try:
            assert process.stdout is not None
            process.stdout.readline()
            yield Served(folder, process.stdout.readline().strip(), process)
        finally:
            process.terminate()
            process.wait(timeout=20)


@contextmanager
def page_of(served: Served, spoken: str = "", **context: Any) -> Iterator[Any]:
    """Open the page in Chromium; no other host is asked, and nothing is said on the console.

    But what has `spoken` in it, for what a test makes go wrong.
    """
    api = pytest.importorskip("playwright.sync_api", reason="no Playwright: make test-app")
    if CHROMIUM is None:
        pytest.skip("no Chromium here: make test-app")
    with api.sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = chromium.new_context(accept_downloads=True, **context).new_page()
        page.set_default_timeout(60_000)
        said: list[str] = []
        elsewhere: list[str] = []
        page.on(
            "console", lambda m: said.append(m.text) if m.type in ("error", "warning") else None
        )
        page.on("pageerror", lambda error: said.append(str(error)))
        own = (f"http://127.0.0.1:{served.port}/", "blob:", "data:")
        page.on("request", lambda r: None if r.url.startswith(own) else elsewhere.append(r.url))
        page.goto(served.url)
        page.locator("body[data-ready]").wait_for(state="attached")
        yield page
        said = [each for each in said if not spoken or spoken not in each]
        assert not said, said
        assert not elsewhere, elsewhere
        chromium.close()
