"""Which functions each test calls: a mutant is shown to the tests that call its function alone.

A function is its file and first line. Those of Python are told by `sys.settrace`, those of C by a
core compiled with ``-finstrument-functions``, whose hook fills a table of addresses (linked with
``-Bsymbolic``, for the C library has a hook that does nothing). What is called
while a test file is collected counts for all its tests. coverage knows no C, and gcov no tests.
"""

from __future__ import annotations

import ast
import ctypes
import difflib
import functools
import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import pytest

Function = tuple[str, int]

HOOK = r"""
#include <stdint.h>
enum { SIZE = 1 << 16 };
static void *volatile called[SIZE];
__attribute__((no_instrument_function, visibility("default")))
void __cyg_profile_func_enter(void *function, void *site)
{
    uint32_t at = (uint32_t)((uintptr_t)function * 2654435761u) % SIZE;
    (void)site;
    while (called[at] && called[at] != function) at = (at + 1) % SIZE;
    called[at] = function;
}
__attribute__((no_instrument_function, visibility("default")))
void __cyg_profile_func_exit(void *function, void *site) { (void)function; (void)site; }
__attribute__((no_instrument_function, visibility("default")))
int pkm_called(uintptr_t *found)
{
    int count = 0;
    for (int k = 0; k < SIZE; k++) {
        if (called[k]) found[count++] = (uintptr_t)called[k];
        called[k] = 0;
    }
    return count;
}
"""


class Recorder:
    """A plugin of pytest that notes processor time, what fails, and what is called."""

    def __init__(self, drain: Callable[[], set[Function]]) -> None:
        self.drain = drain
        self.tests: dict[str, dict[str, Any]] = {}
        self._of_files: dict[str, set[Function]] = {}

    @pytest.hookimpl(hookwrapper=True)
    def pytest_make_collect_report(self, collector: pytest.Collector) -> Any:
        self.drain()
        yield
        self._of_files.setdefault(str(collector.path), set()).update(self.drain())

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Any:
        self.drain()
        began = time.process_time()
        yield
        called = self.drain() | self._of_files.get(str(item.path), set())
        test = self._of(item.nodeid)
        test["seconds"] += time.process_time() - began
        test["calls"] = sorted(called)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        test = self._of(report.nodeid)
        test["ran"] |= report.when == "call" and not report.skipped
        test["failed"] |= report.failed

    def _of(self, test: str) -> dict[str, Any]:
        return self.tests.setdefault(test, {"seconds": 0.0, "ran": False, "failed": False})

    def write(self, path: Path) -> None:
        """Write what is known, for the process that forked this one."""
        path.write_text(json.dumps(self.tests), encoding="utf-8")


class Chosen:
    """A plugin of pytest that runs these tests alone, in their order, and notes which one fails."""

    def __init__(self, tests: Iterable[str], failed: Path) -> None:
        self.place, self.failed = {test: k for k, test in enumerate(tests)}, failed

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self.failed.write_text(report.nodeid, encoding="utf-8")

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        chosen = [item for item in items if item.nodeid in self.place]
        items[:] = sorted(chosen, key=lambda item: self.place[item.nodeid])


def python_calls(copy: Path, folder: str) -> Callable[[], set[Function]]:
    """Begin to trace; the function returned gives what was called since it was called last."""
    root, inside = str(copy) + "/", str((copy / folder).resolve()) + "/"
    codes: dict[int, CodeType] = {}  # by what they are: hashing code looks at all of it
    resolved = functools.cache(lambda name: str(Path(name).resolve()))

    def trace(frame: FrameType, event: str, argument: Any) -> None:
        codes[id(frame.f_code)] = frame.f_code

    def drain() -> set[Function]:
        found = {
            (resolved(code.co_filename).removeprefix(root), code.co_firstlineno)
            for code in list(codes.values())
            if code.co_name != "<module>" and resolved(code.co_filename).startswith(inside)
        }
        codes.clear()
        return found

    sys.settrace(trace)
    threading.settrace(trace)
    return drain


def untraced() -> None:
    """End what `python_calls` began."""
    sys.settrace(None)
    threading.settrace(None)  # type: ignore[arg-type]


def c_calls(copy: Path, core: Path) -> Callable[[], set[Function]]:
    """The same for a core with the hook."""
    names, lines, buffer = (
        ctypes.CDLL(str(core)),
        c_functions(copy, core),
        (ctypes.c_size_t * 65536)(),
    )
    reference = ctypes.cast(names.pkm_called, ctypes.c_void_p).value or 0
    base = reference - next(at for at, (_, name) in lines.items() if name == "pkm_called")

    def drain() -> set[Function]:
        count = names.pkm_called(buffer)
        return {lines[at - base][0] for at in buffer[:count] if at - base in lines}

    return drain


def c_functions(copy: Path, core: Path) -> dict[int, tuple[Function, str]]:
    """Where each function of a compiled core begins in the source, and its name, by its address."""
    root = str(copy) + "/"
    told = subprocess.run(["nm", "-l", core], capture_output=True, text=True, check=True).stdout
    found = {}
    for line in told.splitlines():
        symbol, _, place = line.partition("\t")
        address, _, rest = symbol.partition(" ")
        kind, _, name = rest.partition(" ")
        if kind in ("t", "T") and address:
            file, _, at = place.rpartition(":")
            found[int(address, 16)] = (file.removeprefix(root), int(at or 0)), name
    return found


def python_function(text: str, line: int) -> int | None:
    """First line of the innermost function around a line, as its code object has it."""
    inside = [
        min([node.lineno, *(each.lineno for each in node.decorator_list)])
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.FunctionDef)
        and node.body[0].lineno <= line <= (node.end_lineno or 0)
    ]
    return max(inside, default=None)


def c_function(text: str, at: int, starts: Iterable[int]) -> int | None:
    """First line of the function of C around a place, None where that is in no braces."""
    before = text[:at]
    line = before.count("\n") + 1
    within = before.count("{") > before.count("}")
    return max((start for start in starts if start <= line), default=None) if within else None


def changed_lines(before: list[str], after: list[str]) -> set[int]:
    """Lines of a text, from 0, that another text has not or has more behind."""
    found: set[int] = set()
    for kind, begin, end, _, _ in difflib.SequenceMatcher(None, before, after, False).get_opcodes():
        if kind != "equal":
            found.update(range(begin, max(end, begin + 1)))
    return found
