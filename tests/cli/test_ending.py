"""Every way in which a command ends: an exit code, and one line where something is wrong."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.cli import ending
from pkmcal.exceptions import ArgumentError

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = [sys.executable, "-c", "from pkmcal.cli.main import main; main()"]
DELTA = ROOT / "examples" / "linear-delta"
CALIBRATION = f"calibrate {DELTA / 'robot.toml'} {DELTA / 'probe.csv'} --report out --force"
HEXAPOD = (Path(pk.__file__).parent / "builtin/machines/hexapod.toml").read_text("utf-8")
HOSTILE = "\x1b]0;owned\x07\x1b[31m red \u202e bidi \x00 nul \x9b8m"
CONTROL = re.compile(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")


def process(*arguments: str, **settings: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*PROGRAM, *arguments], capture_output=True, text=True, **settings)


@pytest.mark.parametrize(
    "raised",
    [
        ZeroDivisionError("division by zero"),
        ValueError("not of this library"),
        np.linalg.LinAlgError("Singular matrix"),
        RecursionError("deep"),
        AssertionError(),
        KeyError("base1.x"),
        OverflowError(34, "Numerical result out of range"),
    ],
    ids=lambda error: type(error).__name__,
)
def test_a_mistake_of_the_program_is_exit_3_and_one_line_to_report(
    run: Any, monkeypatch: pytest.MonkeyPatch, raised: Exception
) -> None:
    def broken(*arguments: Any) -> None:
        raise raised

    monkeypatch.setattr(pk, "load", broken)
    result = run("check", "hexapod")
    assert (result.exit_code, result.stdout) == (3, "")
    (line,) = result.stderr.splitlines()
    assert line.startswith("pkmcal: a mistake in pkmcal, please report this line: ")
    assert type(raised).__name__ in line and re.search(r"\(cli/check\.py:\d+\)$", line)


def test_what_the_user_can_mend_is_exit_2(capsys: pytest.CaptureFixture[str]) -> None:
    for error, line in (
        (ArgumentError("x must be 1"), "pkmcal: x must be 1"),
        (FileNotFoundError(2, "No such file", "a.csv"), "pkmcal: a.csv: No such file"),
        (MemoryError(), "pkmcal: not enough memory for what was given"),
    ):
        assert ending.code(error) == 2
        assert capsys.readouterr().err == line + "\n"


def test_a_long_message_is_cut(capsys: pytest.CaptureFixture[str]) -> None:
    ending.code(ArgumentError("a\nb" * 100_000))
    assert len(capsys.readouterr().err) < 1100


def test_an_environment_that_is_wrong_is_named_before_anything_else() -> None:
    done = process("--help", env={**os.environ, "PKMCAL_ISA": "zzz"})
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "pkmcal: PKMCAL_ISA must be one of base, avx2, avx512, found 'zzz'\n"


def test_the_module_is_the_command(tmp_path: Path) -> None:
    said = subprocess.run([sys.executable, "-m", "pkmcal", "machines"], capture_output=True)
    assert (said.returncode, said.stderr) == (0, b"")
    assert said.stdout.decode() == process("machines").stdout


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "cp437", "utf-8"])
def test_json_says_all_whatever_the_encoding_of_stdout(encoding: str) -> None:
    """As where Windows sends it into a file or a pipe."""
    name = "Prüfstand σ₁ 机器 😀"
    path = hostile(name)
    done = subprocess.run(
        [*PROGRAM, "check", str(path), "--json"],
        capture_output=True,
        env={**os.environ, "PYTHONIOENCODING": encoding},
    )
    written = "utf-8" if encoding == "ascii" else encoding  # typer mistrusts ASCII
    said = json.loads(done.stdout.decode(written))
    assert (done.returncode, said["robot"]["name"]) == (0, name)


def test_a_reader_that_leaves_ends_the_command_as_it_ends_others() -> None:
    command = f"{sys.executable} -c '{PROGRAM[2]}' check hexapod --json | head -c0"
    done = subprocess.run(
        ["bash", "-c", f"{command}; exit ${{PIPESTATUS[0]}}"], capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (128 + signal.SIGPIPE, "")


@pytest.mark.skipif(os.name != "posix", reason="closes it in a shell")
@pytest.mark.parametrize("verb", [CALIBRATION, "tolerance 3rps --sigma 0.1 --samples 100"])
def test_without_stderr_a_command_works_as_with_it(verb: str) -> None:
    """As services are started, and `pythonw`."""
    command = f"{sys.executable} -m pkmcal {verb}"
    closed, usual = (
        subprocess.run(["sh", "-c", f"{command}{end}"], stdout=subprocess.PIPE, check=True)
        for end in (" 2>&-", "")
    )
    assert closed.stdout == usual.stdout != b""


def test_without_stderr_an_error_is_not_in_what_is_printed() -> None:
    command = f"{sys.executable} -m pkmcal check nothing.toml 2>&-"
    done = subprocess.run(["sh", "-c", command], stdout=subprocess.PIPE)
    assert (done.returncode, done.stdout) == (2, b"")


@pytest.mark.skipif(os.name != "posix", reason="sends a POSIX signal")
def test_ctrl_c_while_the_verbs_are_loaded_is_130_and_one_line(tmp_path: Path) -> None:
    """A module that is imported on the way waits for the signal."""
    slow = "print('here', flush=True)\nimport time\ntime.sleep(60)\n"
    (tmp_path / "typer.py").write_text(slow)
    path = os.pathsep.join([str(tmp_path), str(ROOT)])
    running = subprocess.Popen(
        [*PROGRAM, "check", "hexapod"],
        env={**os.environ, "PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert running.stdout is not None and running.stdout.readline() == "here\n"
        running.send_signal(signal.SIGINT)
        _, errors = running.communicate(timeout=60)
    finally:
        running.kill()
    assert (running.returncode, errors) == (130, "pkmcal: stopped by Ctrl-C\n")


@pytest.mark.skipif(os.name != "posix", reason="sends a POSIX signal")
@pytest.mark.parametrize(
    "step", ["make_context", "parse_args", "invoke", "get_command", "__exit__"]
)
def test_ctrl_c_while_the_command_line_is_read_is_130_and_one_line(step: str) -> None:
    """Typer's own handling of it would end with the code alone."""
    owner = "interrupt.IsRaised" if step == "__exit__" else "TyperGroup"
    program = (
        "import os, signal\nfrom typer.core import TyperGroup\nfrom pkmcal.cli import interrupt\n"
        f"real = {owner}.{step}\n"
        "def stopped(*a, **k):\n    os.kill(os.getpid(), signal.SIGINT)\n    return real(*a, **k)\n"
        f"{owner}.{step} = stopped\n" + PROGRAM[2]
    )
    done = subprocess.run(
        [sys.executable, "-c", program, "machines"],
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stderr) == (130, "pkmcal: stopped by Ctrl-C\n")


@pytest.mark.skipif(os.name != "posix", reason="sends a POSIX signal")
def test_ctrl_c_at_any_moment_leaves_no_traceback(tmp_path: Path) -> None:
    """From when the program has begun to its end; before that the interpreter is alone."""
    program = (
        "import signal\nfrom pkmcal.cli import interrupt\nreal = interrupt.ends_at_once\n"
        "interrupt.ends_at_once = lambda: (real(), print('here', flush=True))\n" + PROGRAM[2]
    )
    for delay in (0.0, 0.01, 0.03, 0.1, 0.2, 0.4, 0.8, 1.6):
        running = subprocess.Popen(
            [sys.executable, "-c", program, "inverse", "hexapod", "0,0,860,0,0,0", "--out", "out"],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert running.stdout is not None and running.stdout.readline() == "here\n"
        time.sleep(delay)
        running.send_signal(signal.SIGINT)
        _, errors = running.communicate(timeout=120)
        done = (running.returncode, errors)  # -2: ended by the signal itself, past its last line
        assert done in ((130, "pkmcal: stopped by Ctrl-C\n"), (0, ""), (-2, "")), delay
        assert not list(tmp_path.glob("out/.*"))


# --- names of others -----------------------------------------------------------------------------


def hostile(name: str) -> Path:
    path = Path("hostile.toml")
    text = "".join(f"\\u{ord(c):04x}" if not c.isprintable() else c for c in name)
    path.write_text(re.sub(r"(?m)^name = .*", lambda _: f'name = "{text}"', HEXAPOD), "utf-8")
    assert pk.load(path).name == name
    return path


@pytest.mark.parametrize(
    "arguments",
    [
        ("check",),
        ("check", "--json"),
        ("tolerance", "--sigma", "0.1", "--samples", "100"),
        ("plan", "--prior", "0.5", "--count", "12"),
        ("plan", "--prior", "0.5", "--count", "12", "--json"),
    ],
    ids=" ".join,
)
def test_names_of_others_do_not_steer_a_terminal(run: Any, arguments: tuple[str, ...]) -> None:
    verb, *options = arguments
    result = run(verb, hostile(HOSTILE), *options)
    assert result.exit_code in (0, 1)
    assert not CONTROL.search(result.stdout + result.stderr)
    assert "owned" in result.stdout


@pytest.mark.parametrize(
    "heading", ["z [\x1bcmm]", "A\x1bc.x [mm]", "\u202ez [mm]", "z [mm],\x1b]0;t\x07.x [mm]"]
)
def test_headings_of_others_do_not_steer_a_terminal(refused: Any, heading: str) -> None:
    Path("m.csv").write_text(f"q1 [mm],q2 [mm],q3 [mm],distance [mm],{heading}\n1,2,3,4,5,6\n")
    assert not CONTROL.search(refused("check", "linear-delta", "m.csv"))


def test_results_of_the_library_do_not_steer_a_terminal() -> None:
    robot = pk.load(hostile(HOSTILE))
    found = pk.check_geometry(robot)
    assert not CONTROL.search(f"{found}{found!r}")


@pytest.mark.parametrize("name", [r"a$\\frac{1}{$ b", "machine $5 or $6_x", r"\\alpha^2_"])
def test_a_name_with_marks_of_formulas_is_drawn_as_it_is(run: Any, name: str) -> None:
    path = Path("name.toml")
    path.write_text(re.sub(r"(?m)^name = .*", lambda _: f'name = "{name}"', HEXAPOD), "utf-8")
    result = run("sensitivity", path, "--out", "out")
    assert (result.exit_code, result.stderr) == (0, "")
    svg = Path("out/limb1-mean.svg").read_text("utf-8")
    assert name.replace("\\\\", "\\") in svg


def test_controls_in_a_name_are_drawn_as_marks(run: Any) -> None:
    result = run("sensitivity", hostile(HOSTILE), "--out", "out")
    assert (result.exit_code, result.stderr) == (0, "")
    for path in Path("out").glob("*.svg"):
        assert not CONTROL.search(path.read_text("utf-8")), path
    assert "owned" in Path("out/limb1-mean.svg").read_text("utf-8")


def test_a_warning_of_a_library_is_one_line() -> None:
    program = (
        "import sys, warnings\nfrom pkmcal.cli.main import main\n"
        "sys.argv = ['pkmcal', '--version']\n"
        "try:\n    main()\nexcept SystemExit:\n    warnings.warn('over\\nflow \\x1b[31m')\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stderr == "pkmcal: warning: over flow �[31m\n"
