"""A page as PDF on A4, as an installed Chromium prints it.

A browser, for the page is made for browsers: libraries that print HTML know neither all of its
style sheet nor its scripts.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import tempfile
from pathlib import Path

from pkmcal.exceptions import ArgumentError

_BROWSERS = (
    *("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome"),
    *("microsoft-edge", "msedge", "brave-browser"),
)
# Where macOS and Windows have them, which is not on the path.
_APPLICATIONS = (
    *(
        f"/Applications/{name}.app/Contents/MacOS/{name}"
        for name in ("Google Chrome", "Chromium", "Microsoft Edge", "Brave Browser")
    ),
    *(
        os.path.join(os.environ[folder], *parts)
        for folder in ("ProgramFiles", "ProgramFiles(x86)", "LocalAppData")
        if folder in os.environ
        for parts in (
            ("Google", "Chrome", "Application", "chrome.exe"),
            ("Microsoft", "Edge", "Application", "msedge.exe"),
        )
    ),
)
_FLAGS = (
    *("--headless", "--disable-gpu", "--no-first-run", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync", "--no-pdf-header-footer"),
    "--virtual-time-budget=2000",  # ms until the scripts of the page have drawn
)
_PATIENCE = 120  # seconds


def browser() -> str:
    """Find a browser that prints.

    Raises
    ------
    ValueError
        None is installed.
    """
    for name in (*_BROWSERS, *_APPLICATIONS):
        if found := shutil.which(name):
            return found
    raise ArgumentError(
        "pdf: no Chromium was found (Debian: apt-get install chromium); without it open"
        " report.html in any browser and print it"
    )


def _said(command: list[str]) -> str:
    """Run a browser to its end and return what it says on stderr; none of its own stays behind."""
    with subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        start_new_session=True,
    ) as process:
        try:
            return process.communicate(timeout=_PATIENCE)[1]
        except BaseException:  # out of patience, or interrupted
            if hasattr(os, "killpg"):  # a browser may be a script that started one
                os.killpg(process.pid, signal.SIGKILL)
            else:
                process.kill()
            raise


def print_page(page: Path, to: Path) -> None:
    """Print an HTML file.

    Raises
    ------
    ValueError
        No browser is installed, or it printed nothing.
    """
    by = browser()
    root = ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []
    with tempfile.TemporaryDirectory(prefix="pkmcal-", ignore_cleanup_errors=True) as profile:
        command = [by, *_FLAGS, *root, f"--user-data-dir={profile}", f"--print-to-pdf={to}"]
        try:
            said = _said([*command, page.resolve().as_uri()]).strip().splitlines()
        except subprocess.TimeoutExpired:
            said = [f"no answer within {_PATIENCE} s"]
        except OSError as error:
            said = [str(error)]
    if not to.exists():
        why = said[-1] if said else "it does not say why"
        raise ArgumentError(f"pdf: {by} printed nothing: {why}")
