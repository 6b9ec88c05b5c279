"""The process that computes: reads requests of the server line by line, and answers in lines.

It holds what it has read and fitted only to be quicker; the server may end it at any time.
"""

from __future__ import annotations

import json
import os
import sys
import traceback
from typing import IO, Any

from pkmcal.app.work import OPERATIONS, Work, told
from pkmcal.exceptions import Error


def main() -> None:
    """Answer until the server closes the pipe."""
    # standard output is for the answers alone: what libraries print goes to the log
    with os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8") as answers:
        os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
        work = Work()
        for line in sys.stdin:
            _answer(work, json.loads(line), answers)


def _answer(work: Work, asked: dict[str, Any], answers: IO[str]) -> None:
    def send(message: dict[str, Any]) -> None:
        answers.write(json.dumps({"id": asked["id"], **message}, allow_nan=False) + "\n")
        answers.flush()

    def say(words: str, share: float | None = None) -> None:
        send({"progress": words, "share": share})

    try:
        result = OPERATIONS[asked["operation"]](work, asked["state"], asked["given"], say)
    except (Error, OSError) as error:
        send({"error": told(error)})
    except Exception as error:  # a fault of pkmcal's own, which must not end the window
        traceback.print_exc()
        send({"error": {"message": f"a mistake in pkmcal: {error!r}", "fault": True}})
    else:
        send({"result": result})
