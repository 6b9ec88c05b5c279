"""Long work shows on a terminal that it goes on, beside what is printed and not in it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
LINEAR_DELTA = ROOT / "examples" / "linear-delta"


@pytest.mark.parametrize(
    ("arguments", "work"),
    [
        (["plan", "hexapod", "--kind", "pose", "--count", "8"], "choosing poses"),
        (
            ["calibrate", str(LINEAR_DELTA / "robot.toml"), str(LINEAR_DELTA / "probe.csv")],
            "identifying",
        ),
        (["tolerance", "3rps", "--sigma", "0.1", "--samples", "100"], "machines x poses"),
    ],
    ids=lambda argument: argument[0] if isinstance(argument, list) else "",
)
def test_a_bar_is_drawn_on_a_terminal_and_nowhere_else(
    run: Any, arguments: list[str], work: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("FORCE_COLOR", raising=False)
    piped = run(*arguments)
    monkeypatch.setenv("FORCE_COLOR", "1")  # by which rich takes a pipe for a terminal
    monkeypatch.setenv("TERM", "xterm")
    shown = run(*arguments)
    assert piped.stderr == "" and work in shown.stderr
    assert shown.stdout == piped.stdout != ""
