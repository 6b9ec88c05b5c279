"""Ctrl-C, SIGTERM and SIGHUP: one line at most, their exit code, and nothing half written."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

import pytest

from pkmcal.cli import interrupt
from pkmcal.cli.interrupt import IsRaised, Stopped
from pkmcal.files import atomic
from pkmcal.files.atomic import write_whole

# Says when the program is loaded, so that the signal meets its work.
_PROGRAM = "from pkmcal.cli.main import main; print('ready', flush=True); main()"

pytestmark = pytest.mark.skipif(os.name != "posix", reason="sends a POSIX signal")


TOLERANCE = ["tolerance", "2tpr2tps", "--sigma", "0.1", "--samples", "50000000", "--out", "."]
ALLOCATION = ["tolerance", "hexapod", "--allowed", "0.1", "--samples", "50000000", "--out", "."]
# What writes pictures: its folder of drafts is there when the signal comes.
DRAFTING = (
    "import time\nfrom pkmcal.report import error_figures\n"
    "def slow(*given):\n    print('ready', flush=True)\n    time.sleep(60)\n"
    "error_figures.mean_errors = slow\nfrom pkmcal.cli.main import main\nmain()"
)


def ended_by(number: int, code: str, arguments: list[str], folder: Path, after: float) -> str:
    """What a program says on stderr that gets a signal some time after it is ready."""
    scratch = folder / "tmp"
    scratch.mkdir()
    process = subprocess.Popen(
        [sys.executable, "-c", code, *arguments],
        cwd=folder,
        env={**os.environ, "TMPDIR": str(scratch)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None and process.stdout.readline() == "ready\n"
        time.sleep(after)
        assert process.poll() is None, "it was over before it could be interrupted"
        process.send_signal(number)
        process.send_signal(number)  # as of a terminal that closes
        out, errors = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 128 + number
    assert out == "" and "Traceback" not in errors
    assert list(scratch.iterdir()) == []
    scratch.rmdir()
    assert list(folder.iterdir()) == []
    return errors


@pytest.mark.parametrize(
    ("number", "arguments"),
    [(signal.SIGINT, TOLERANCE), (signal.SIGTERM, ALLOCATION)],
    ids=["Ctrl-C", "SIGTERM"],
)
def test_interrupted_work_leaves_nothing_behind(
    number: int, arguments: list[str], tmp_path: Path
) -> None:
    ended_by(number, _PROGRAM, arguments, tmp_path, after=1.5)


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_a_signal_leaves_no_draft(name: str, tmp_path: Path) -> None:
    arguments = ["sensitivity", "hexapod", "--out", "out"]
    number = signal.Signals[name]
    assert ended_by(number, DRAFTING, arguments, tmp_path, 0.1) == f"pkmcal: stopped by {name}\n"


def test_what_a_shell_has_ignored_stays_ignored(tmp_path: Path) -> None:
    """As by nohup."""
    code = "import os, signal\nsignal.signal(signal.SIGHUP, signal.SIG_IGN)\n"
    code += "from pkmcal.cli.interrupt import IsRaised, ends_at_once\nends_at_once()\n"
    code += "with IsRaised():\n    os.kill(os.getpid(), signal.SIGHUP)\nprint('went on')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "went on\n", "")


def test_interrupt_while_a_file_is_written_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "robot.toml").write_text("old")

    def stopped(path: Path, pieces: Iterable[bytes]) -> None:
        path.write_bytes(b"".join(pieces)[:3])
        raise KeyboardInterrupt

    monkeypatch.setattr(atomic, "_write", stopped)
    with pytest.raises(KeyboardInterrupt):
        write_whole(tmp_path / "robot.toml", "new and longer")
    assert [path.name for path in tmp_path.iterdir()] == ["robot.toml"]
    assert (tmp_path / "robot.toml").read_text() == "old"


class Asks:
    """An object that a signal meets while Python tidies it up."""

    def __init__(self, number: int) -> None:
        self.number = number

    def __del__(self) -> None:
        signal.raise_signal(self.number)
        time.sleep(0.0)  # here the handler runs


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_is_not_lost_that_comes_while_an_object_is_tidied_up(number: int) -> None:
    """There Python prints what is raised, and goes on: a server had not ended."""
    begun = time.monotonic()
    with IsRaised(), pytest.raises(Stopped) as stopped:
        Asks(number)
        time.sleep(30.0)
    assert stopped.value.number == number
    assert time.monotonic() - begun < 30.0


def test_a_signal_that_comes_twice_while_an_object_is_tidied_up_is_raised_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As of a terminal that closes: the second one meets the hook that takes care of the first."""
    raised = []
    with IsRaised():
        hook = sys.unraisablehook

        def met(unraisable: sys.UnraisableHookArgs) -> None:
            signal.raise_signal(signal.SIGTERM)
            hook(unraisable)
            signal.raise_signal(signal.SIGTERM)
            time.sleep(0.0)

        monkeypatch.setattr(sys, "unraisablehook", met)
        for _ in range(2):
            try:
                if not raised:
                    Asks(signal.SIGTERM)
                time.sleep(0.5)
            except Stopped as stopped:
                raised.append(stopped.number)
    assert raised == [signal.SIGTERM]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_is_raised_again_that_others_pass_over(
    number: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(interrupt, "_PATIENCE", 0.3)
    begun = time.monotonic()
    with IsRaised(), pytest.raises(Stopped) as stopped:
        with suppress(BaseException):
            signal.raise_signal(number)
            time.sleep(30.0)
        time.sleep(30.0)
    assert stopped.value.number == number
    assert 0.3 <= time.monotonic() - begun < 30.0


def test_a_signal_that_was_heard_is_not_raised_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interrupt, "_PATIENCE", 0.1)
    with pytest.raises(Stopped), IsRaised():
        signal.raise_signal(signal.SIGINT)
        time.sleep(30.0)
    time.sleep(0.3)
