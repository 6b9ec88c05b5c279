"""How a command ends: the one place where whatever was raised becomes one line and an exit code.

Codes: 0 done, 1 done but not to be trusted, 2 nothing done, because of what was given or because a
file cannot be read or written, 3 nothing done, because of a mistake in this program, 130 stopped.
"""

from __future__ import annotations

import sys
import traceback
from pathlib import Path
from typing import Any, TextIO

from pkmcal.cli import interrupt
from pkmcal.display import printable
from pkmcal.exceptions import Error

DONE, NOT_TRUSTED, REFUSED, MISTAKE = 0, 1, 2, 3
_LONGEST = 1000  # letters of a message: names of others may be in it


def code(error: BaseException) -> int:
    """Print why a command ended in one line on stderr, and return its exit code."""
    if isinstance(error, KeyboardInterrupt):
        return _ended(interrupt.WORDS, interrupt.STOPPED)
    if isinstance(error, MemoryError):
        return _ended("not enough memory for what was given", REFUSED)
    if isinstance(error, OSError):
        return _ended(_of_system(error), REFUSED)
    if isinstance(error, Error):
        return _ended(str(error), REFUSED)
    if hasattr(error, "format_message"):  # typer's, of the command line
        return _ended(_of_command_line(error), REFUSED)
    return _ended(f"a mistake in pkmcal, please report this line: {_of_program(error)}", MISTAKE)


def warned(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Print a warning in one line, in place of `warnings.showwarning`."""
    print("pkmcal: warning:", _one_line(str(message)), file=sys.stderr)


def _ended(message: str, how: int) -> int:
    print("pkmcal:", _one_line(message), file=sys.stderr)
    return how


def _one_line(message: str) -> str:
    return printable(" ".join(message.split()), _LONGEST)


def _of_system(error: OSError) -> str:
    if error.strerror and error.filename:
        return f"{error.filename}: {error.strerror}"
    return str(error)


def _of_command_line(error: Any) -> str:
    """An error of typer's, which knows the verb that was meant."""
    context = getattr(error, "ctx", None)
    verb = context.command_path if context else "pkmcal"
    return f"{error.format_message().rstrip('.')} (see {verb} --help)"


def _of_program(error: BaseException) -> str:
    """What was raised, and the last line of the package on the way there."""
    package = Path(__file__).parents[1]
    lines = [
        f"{Path(frame.filename).relative_to(package).as_posix()}:{frame.lineno}"
        for frame in traceback.extract_tb(error.__traceback__)
        if Path(frame.filename).is_relative_to(package)
    ]
    where = f" ({lines[-1]})" if lines else ""
    return f"{type(error).__name__}: {error}{where}"
