"""A real Chromium without a window, for tests that look at a page."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import pytest

_FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    *("--hide-scrollbars", "--enable-logging=stderr", "--virtual-time-budget=2000"),
)
_PATIENCE = 120  # seconds


@dataclass(frozen=True)
class Seen:
    """What Chromium made of a page: its document, and what it wrote to the console."""

    dom: str
    console: list[str]


def chromium() -> str:
    """The browser, or a skip that says how to get it."""
    for name in ("chromium", "chromium-browser", "google-chrome"):
        if found := shutil.which(name):
            return found
    pytest.skip("no Chromium here (Debian: apt-get install chromium)")


def look(page: Path, *flags: str) -> Seen:
    """Open a page in a browser that knows nothing of any other."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        done = subprocess.run(
            [chromium(), *_FLAGS, f"--user-data-dir={profile}", *flags, page.as_uri()],
            capture_output=True,
            text=True,
            timeout=_PATIENCE,
            check=True,
        )
    return Seen(done.stdout, re.findall(r"CONSOLE.*", done.stderr))


def dump(page: Path, width: int = 1000) -> Seen:
    """The document after the browser has read and laid it out."""
    return look(page, "--dump-dom", f"--window-size={width},800")


def screenshot(page: Path, to: Path, dark: bool = False) -> Seen:
    """A picture of the top of the page."""
    scheme = f"--blink-settings=preferredColorScheme={0 if dark else 1}"
    return look(page, f"--screenshot={to}", "--window-size=1000,1600", scheme)
