"""The end of a command: whatever was raised becomes one line and an exit code here.

Codes: 0 done, 1 done but not to be trusted, 2 nothing done, because of what was given or because a
file cannot be read or written, 3 nothing done, because of a mistake in this program; from 129 on
stopped, by the signal of that number less 128: 130 by Ctrl-C.
"""

from __future__ import annotations

import re
import sys
import traceback
from pathlib import Path
from typing import Any, TextIO

from pkmcal.cli import interrupt
from pkmcal.display import LONGEST, printable
from pkmcal.exceptions import Error, words_of

DONE, NOT_TRUSTED, REFUSED, MISTAKE = 0, 1, 2, 3
_KINDS = {REFUSED: "input", MISTAKE: "mistake"}  # any other: stopped
_WHERE = re.compile(r"(?P<file>.+?), line (?P<line>[0-9]+)(?:, column '(?P<column>[^']*)')?: ")


def code(error: BaseException, json: bool = False) -> int:
    """Print why a command ended in one line on stderr, and return its exit code.

    With `json` also as JSON on stdout: the message, and file, line and column where it has them.
    """
    message, how = _reason(error)
    message = _one_line(message)
    print("pkmcal:", message, file=sys.stderr)
    if json:
        from pkmcal.report.as_json import as_json  # loads the package, which may be what failed

        where = _WHERE.match(message)
        parts = where.groupdict() if where else dict.fromkeys(("file", "line", "column"))
        parts["line"] = parts["line"] and int(parts["line"])
        if isinstance(error, OSError) and not where:
            parts["file"] = error.filename or message.partition(": ")[0]
        said = {"message": message, "kind": _KINDS.get(how, "stopped"), "exit_code": how, **parts}
        print(as_json({"error": said}, schema="error"))
    return how


def _reason(error: BaseException) -> tuple[str, int]:
    """Return the sentence about an error, and the exit code."""
    if isinstance(error, KeyboardInterrupt):
        return interrupt.words(error), interrupt.code(error)
    if isinstance(error, MemoryError):
        return "not enough memory for what was given", REFUSED
    if isinstance(error, (Error, OSError)):
        return words_of(error), REFUSED
    if hasattr(error, "format_message"):  # typer's, of the command line
        return _of_command_line(error), REFUSED
    return f"a mistake in pkmcal, please report this line: {_of_program(error)}", MISTAKE


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


def _one_line(message: str) -> str:
    return printable(" ".join(message.split()), LONGEST)


def _of_command_line(error: Any) -> str:
    """An error of typer's, which knows the verb that was meant."""
    context = getattr(error, "ctx", None)
    verb = context.command_path if context else "pkmcal"
    return f"{error.format_message().rstrip('.')} (see {verb} --help)"


def _of_program(error: BaseException) -> str:
    """Return the error of the program, and the last line of the package on the way to it."""
    package = Path(__file__).parents[1]
    lines = [
        f"{file.relative_to(package).as_posix()}:{line}"
        for frame, line in traceback.walk_tb(error.__traceback__)  # whatever limit is set
        if (file := Path(frame.f_code.co_filename)).is_relative_to(package)
    ]
    where = f" ({lines[-1]})" if lines else ""
    return f"{type(error).__name__}: {error}{where}"
