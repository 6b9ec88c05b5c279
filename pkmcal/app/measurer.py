"""The process that measures with a machine: what a page asked for, started by whom looks at it.

It is not ended as the one that computes: it is told to stop, stops the machine first, and ends
then. Whoever closes the pipe to it, or dies, has told it so.
"""

from __future__ import annotations

import json
import os
import queue
import signal
import sys
import threading
import traceback
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from pkmcal.app.names import safe_name
from pkmcal.app.work import told
from pkmcal.display import displayed
from pkmcal.exceptions import ArgumentError, Error
from pkmcal.jobs import measuring
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.measuring import Driven
from pkmcal.jobs.plan import Planning
from pkmcal.jobs.project import Project
from pkmcal.jobs.stated import command, quoted
from pkmcal.live import course_words
from pkmcal.live.course import Course
from pkmcal.live.measuring_run import Rules, Stopped, pose_words

Table = dict[str, Any]
_RULES = {"feed": "--feed", "dwell": "--dwell", "repeats": "--repeats",
          "safe_height": "--safe-height"}  # fmt: skip


class Measurer:
    """One measurement, and the page that it tells and asks.

    Parameters
    ----------
    words : text file
        Lines of JSON: ``start``, ``type`` with a text and the number of the question that it
        answers, ``stop``; their end is ``stop``, too.
    answers : text file
        Lines of JSON.
    """

    def __init__(self, words: IO[str], answers: IO[str]) -> None:
        self._words, self._answers = words, answers
        self._speaking = threading.Lock()
        self._stopped, self._ready = threading.Event(), threading.Event()
        self._started = queue.Queue[bool]()
        self._typed = queue.Queue[tuple[object, str] | None]()
        self._questions, self._out = 0, ""
        self._driven: Driven | None = None

    def run(self) -> None:
        """Connect, wait for the start, measure, and say how it ended."""
        asked = json.loads(self._words.readline())
        threading.Thread(target=self._listen, daemon=True).start()
        for name in ("SIGINT", "SIGTERM", "SIGHUP"):
            if hasattr(signal, name):
                signal.signal(getattr(signal, name), self._ended)
        try:
            self._measure(asked["state"], asked["given"])
        except Stopped:
            self._send({"error": {"message": self._there(), "stopped": True}})
        except (Error, OSError) as error:
            if self._driven is not None:
                self._say(self._there())
            self._send({"error": told(error)})
        except Exception as error:  # a fault of pkmcal's own: rows are in their file
            traceback.print_exc()
            self._send({"error": {"message": f"a mistake in pkmcal: {error!r}", "fault": True}})
        finally:
            if self._driven is not None:
                self._driven.close()

    def _measure(self, state: Table, given: Table) -> None:
        project = Project.of_table(state)
        job = Planning.of_table({"plan": given.get("plan", {})})
        job = Planning(**{**vars(job), "robot": project.calibration.robot})
        rules = Rules(**{name: given[name] for name in _RULES if given.get(name) is not None})
        out, machine, instrument = _log(given), given["machine"], given.get("instrument")
        self._out = out
        driven = measuring.driven(
            job, machine, instrument, rules, out, Inputs(), self._say, self._ask
        )
        self._driven = driven
        words = [*job.options(), "--machine", machine]
        words += ["--instrument", instrument] if instrument else []
        for name, option in _RULES.items():
            if getattr(rules, name) != getattr(Rules(), name):
                words += [option, str(getattr(rules, name))]
        line = quoted(command("measure", [job.robot], [*words, "--out", out]))
        course = driven.course
        self._ready.set()
        self._send({"ready": driven.words, "command": line, "over": course.over,
                    "course": _course(course, None)})  # fmt: skip
        if not course.over:
            self._started.get()
            self._require_running()
            self._send({"started": True})
            for course in driven.start():
                self._send({"row": _course(course, driven.course)})
        self._send({"result": {"file": out, "said": course_words.conclusion(course)}})

    def _listen(self) -> None:
        """Hear what the page says; whatever ends that stops the machine."""
        try:
            for line in self._words:
                said = json.loads(line)
                if said["do"] == "start":
                    if self._ready.is_set():  # who starts has seen what it does
                        self._started.put(True)
                elif said["do"] == "type":
                    self._typed.put((said["number"], str(said["text"])))
                else:
                    break
        finally:
            self._stop()

    def _ended(self, number: int, frame: object) -> None:
        threading.Thread(target=self._stop).start()  # what it interrupts may be speaking

    def _stop(self) -> None:
        self._stopped.set()
        self._started.put(False)
        self._typed.put(None)
        if self._driven is not None:
            self._driven.stop()

    def _ask(self, question: str) -> str:
        self._require_running()
        self._questions += 1
        self._send({"asked": question.strip(), "number": self._questions})
        while (typed := self._typed.get()) is not None:
            number, text = typed
            if number == self._questions:  # Enter twice does not answer the next question
                return text
        raise Stopped

    def _require_running(self) -> None:
        if self._stopped.is_set():
            raise Stopped

    def _there(self) -> str:
        rows = None if self._driven is None else self._driven.log.rows
        return course_words.stopped(0 if rows is None else len(rows), self._out)

    def _say(self, text: object) -> None:
        self._send({"said": str(text)})

    def _send(self, message: Table) -> None:
        """Send a message to the page; if the page is gone, the stop is on its way."""
        with self._speaking, suppress(OSError, ValueError):
            self._answers.write(json.dumps(message, allow_nan=False) + "\n")
            self._answers.flush()


def _log(given: Table) -> str:
    """The name of the log, a file of the folder.

    Raises
    ------
    ValueError
        Another name than that of a CSV file, or one that leads out of the folder.
    """
    name = str(given.get("out", ""))
    if safe_name(name) != name or not name.endswith(".csv") or Path(name).is_symlink():
        raise ArgumentError(f"rows go to a file of this project that ends in .csv, found {name!r}")
    return name


def _course(course: Course, first: Course | None) -> Table:
    """Figures of a course for a page: the newest rows, their messages, the next pose."""
    found: Table = {"line": course_words.line(course), "warnings": course_words.warnings(course)}
    predicted = course.predicted
    found["predicted"] = predicted if 0.0 < predicted < float("inf") else None
    found["wanted"] = course.accuracy
    if not course.over:
        found["next"] = pose_words(course.choice.pose)
    if first is not None and course.rows is not None:
        newest = course.rows.select(slice(-1, None))
        read = [
            " ".join(f"{number:.4f} {unit}" for number, unit in shown)
            for row in newest.values.reshape(1, -1).tolist()
            for shown in [[displayed(v, u) for v, u in zip(row, newest.units, strict=True)]]
        ]
        at = course.choice.robot.forward(newest.actuators).pose[0]  # type: ignore[union-attr]
        found |= {"number": len(course.rows), "at": pose_words(at), "read": read[0]}
    return found


def main() -> None:
    """Measure what standard input asks for."""
    with os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8") as answers:
        os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
        Measurer(sys.stdin, answers).run()
    os._exit(0)  # a thread still listens, for which the interpreter would wait
