"""All tests collected once; for each mutant a process is forked from there, which runs some.

A mutant of ``csrc`` is loaded in place of the core, one of Python gives its code to the function
that is imported already. What was reckoned while tests were collected is of the code without the
mutant: tests of files that call ``csrc`` while they are collected, and mutants of functions of
Python that are called then, are left to a process that begins anew.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import mmap
import os
import resource
import signal
import struct
from collections.abc import Callable, Iterator
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import pytest

from . import calls

Function = tuple[str, int]
HANGS = 1200  # seconds of the clock after which a process is stopped that waits for nothing


class Collected:
    """A plugin of pytest that runs no test, but answers requests, each in a process of its own."""

    def __init__(self, copy: Path, folder: str, requests: Connection) -> None:
        self.copy, self.folder, self.requests = copy, folder, requests
        self.apart: set[str] = set()
        self.called: set[Function] = set()
        self._drain = calls.python_calls(copy, folder) if folder != "csrc" else lambda: set()

    def _core(self) -> Any:
        return ctypes.CDLL(str(self.copy / "pkmcal" / "_core.abi3.so"))

    def _count(self) -> int:
        return ctypes.c_long.in_dll(self._core(), "pkm_core_calls").value

    @pytest.hookimpl(hookwrapper=True)
    def pytest_make_collect_report(self, collector: pytest.Collector) -> Any:
        before = self._count() if self.folder == "csrc" else 0
        yield
        self.called |= self._drain()
        if self.folder == "csrc" and self._count() != before:
            self.apart.add(str(collector.path.relative_to(self.copy)))

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        calls.untraced()
        items = {item.nodeid: item for item in session.items}
        self.requests.send((self.apart, self.called))
        while request := self.requests.recv():
            at = mmap.mmap(-1, 8)  # shared: which test it is at
            child = os.fork()
            if not child:
                try:
                    self._run(session, [items[test] for test in request["tests"]], request, at)
                except BaseException as error:
                    os.write(2, repr(error).encode())
                    os._exit(99)
            _, status = os.waitpid(child, 0)
            with contextlib.suppress(ProcessLookupError):
                os.killpg(child, signal.SIGKILL)  # what it left behind
            code, place = os.waitstatus_to_exitcode(status), struct.unpack("q", at[:])[0]
            self.requests.send((code, request["tests"][place]))
        return True

    def _run(
        self,
        session: pytest.Session,
        items: list[pytest.Item],
        request: dict[str, Any],
        at: mmap.mmap,
    ) -> None:
        os.setsid()
        signal.alarm(HANGS)
        if self.folder == "csrc":
            os.environ["PKMCAL_UNITS"] = str(self.copy / "mutant.so")
            use = self._core().pkm_use
            use.restype = ctypes.c_char_p
            if missing := use(str(self.copy / "mutant.so").encode()):
                raise OSError(missing)
        else:
            exchange(self.copy / request["file"], request["before"], request["after"])
        most = resource.getrlimit(resource.RLIMIT_CPU)[1]
        for k, (item, following) in enumerate(zip(items, [*items[1:], None], strict=True)):
            at[:] = struct.pack("q", k)
            spent = resource.getrusage(resource.RUSAGE_SELF)
            limit = spent.ru_utime + spent.ru_stime + 5 + 10 * request["seconds"][item.nodeid]
            resource.setrlimit(resource.RLIMIT_CPU, (int(limit), most))
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
            if session.testsfailed:
                os._exit(1)
        os._exit(0)


def exchange(path: Path, before: str, after: str) -> None:
    """Give the functions imported from a file the code of another text with the same lines."""
    new = {
        _place(one): other
        for one, other in _pairs(compile(before, "", "exec"), compile(after, "", "exec"))
        if one != other
    }
    for each in gc.get_objects():
        if not isinstance(each, FunctionType) or _place(each.__code__) not in new:
            continue
        if Path(each.__code__.co_filename).resolve() == path:
            other = new[_place(each.__code__)]
            each.__code__ = other.replace(co_filename=each.__code__.co_filename)


def _place(code: CodeType) -> tuple[Any, ...]:
    return code.co_name, code.co_firstlineno, code.co_varnames[: code.co_argcount], code.co_freevars


def _pairs(one: CodeType, other: CodeType) -> Iterator[tuple[CodeType, CodeType]]:
    """Codes inside of two codes, by name and line: what begins elsewhere or is dropped is left."""
    inside = {_place(each): each for each in other.co_consts if isinstance(each, CodeType)}
    for each in one.co_consts:
        if isinstance(each, CodeType) and _place(each) in inside:
            yield each, inside[_place(each)]
            yield from _pairs(each, inside[_place(each)])


def begin(
    copy: Path, folder: str, fork: Callable[[Callable[[], int]], int], options: list[str]
) -> tuple[Connection, set[str], set[Function]]:
    """Collect in a process of its own: where to ask, files to leave out, functions called."""
    ours, theirs = Pipe()

    def run() -> int:
        ours.close()
        return int(pytest.main(options, plugins=[Collected(copy, folder, theirs)]))

    fork(run)
    theirs.close()
    apart, called = ours.recv()
    return ours, apart, called
