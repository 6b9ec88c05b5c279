"""Fixtures that tests of several rooms share: the command line, run in this process; machines."""

from __future__ import annotations

import re
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings
from typer.testing import CliRunner

import pkmcal as pk
from pkmcal.cli.verbs import app

# Folders of the sources beside the package, such as wheels; last, for pkmcal is the installed one.
sys.path.append(str(Path(__file__).resolve().parents[1]))

# A shell that starts the tests in the background, or nohup, has them ignore these; tests send them.
for _number, _handler in (
    (signal.SIGINT, signal.default_int_handler),
    (getattr(signal, "SIGHUP", None), signal.SIG_DFL),  # Windows has it not
):
    if _number is not None and signal.getsignal(_number) is signal.SIG_IGN:
        signal.signal(_number, _handler)

# No test is of wall time: other work may take all cores.
settings.register_profile("pkmcal", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("pkmcal")


@pytest.fixture(scope="session")
def run() -> Callable[..., Any]:
    """Return a function that runs `pkmcal` with these arguments; a traceback goes through."""

    def run_pkmcal(*arguments: object) -> Any:
        result = CliRunner().invoke(app, [str(each) for each in arguments], prog_name="pkmcal")
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        return result

    return run_pkmcal


@pytest.fixture(scope="session")
def refused(run: Callable[..., Any]) -> Callable[..., str]:
    """Return a function that gives the one line with which `pkmcal` refuses these arguments."""

    def message(*arguments: object) -> str:
        result = run(*arguments)
        assert (result.exit_code, result.stdout) == (2, "")
        match = re.fullmatch(r"pkmcal: ([^\n]+)\n", result.stderr)
        assert match, result.stderr
        return match[1]

    return message


@pytest.fixture(scope="session")
def hexapod() -> pk.Robot:
    return pk.load("hexapod")


@pytest.fixture(scope="session")
def paper() -> pk.Robot:
    """The 2TPR&2TPS of the paper."""
    return pk.load("2tpr2tps")
