"""Ctrl-C: one line at most, exit code 130, and no file half written."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pkmcal.files import atomic
from pkmcal.files.atomic import write_whole

# Says when the program is loaded, so that the signal meets its work.
_PROGRAM = "from pkmcal.cli.main import main; print('ready', flush=True); main()"

pytestmark = pytest.mark.skipif(os.name != "posix", reason="sends a POSIX signal")


@pytest.mark.parametrize(
    "arguments",
    [
        ["tolerance", "2tpr2tps", "--sigma", "0.1", "--samples", "50000000", "--out", "."],
        ["tolerance", "hexapod", "--allowed", "0.1", "--samples", "50000000", "--out", "."],
    ],
    ids=["tolerance", "allocation"],
)
def test_interrupted_work_leaves_nothing_behind(arguments: list[str], tmp_path: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", _PROGRAM, *arguments],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # a shell that starts the tests in the background has them ignore the signal
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    try:
        assert process.stdout is not None and process.stdout.readline() == "ready\n"
        time.sleep(1.5)
        assert process.poll() is None, "it was over before it could be interrupted"
        process.send_signal(signal.SIGINT)
        out, errors = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 130
    assert out == "" and "Traceback" not in errors
    assert list(tmp_path.iterdir()) == []


def test_interrupt_while_a_file_is_written_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "robot.toml").write_text("old")

    def stopped(path: Path, content: bytes) -> None:
        path.write_bytes(content[:3])
        raise KeyboardInterrupt

    monkeypatch.setattr(atomic, "_write", stopped)
    with pytest.raises(KeyboardInterrupt):
        write_whole(tmp_path / "robot.toml", "new and longer")
    assert [path.name for path in tmp_path.iterdir()] == ["robot.toml"]
    assert (tmp_path / "robot.toml").read_text() == "old"
