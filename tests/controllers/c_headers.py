"""C headers of robots, compiled and called; toolchains for other processors, where installed."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk

from ..workspaces import CHAINS

STRICT = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-O2"]
PARALLEL = [
    name for name in pk.machines() if name not in CHAINS and isinstance(pk.load(name), pk.Robot)
]

FRAMES = {
    "base": {"x": 10.0, "y": -20.0, "z": 30.0, "alpha": 0.1, "beta": -0.2, "gamma": 2.5},
    "tool": {"x": 1.0, "y": 2.0, "z": -40.0, "alpha": -0.3, "beta": 0.1, "gamma": 0.2},
}

_LIBRARY = """\
#include "robot.h"
int inverse(const {real} *pose, {real} *q);
int forward(const {real} *q, {real} *pose);
int jacobian(const {real} *pose, {real} *by_free);
int inverse(const {real} *pose, {real} *q) {{ return robot_inverse(pose, q); }}
int forward(const {real} *q, {real} *pose) {{ return robot_forward(q, pose); }}
int jacobian(const {real} *pose, {real} *by_free) {{ return robot_jacobian(pose, by_free); }}
int missed(const {real} *pose, {real} *by);
int missed(const {real} *pose, {real} *by) {{ return robot_missed(pose, by); }}
"""
_SIDE = """\
int side(const {real} *q, {real} *pose);
int side(const {real} *q, {real} *pose) {{ return robot_side(q, pose); }}
int forward_same_side(const {real} *q, {real} *pose);
int forward_same_side(const {real} *q, {real} *pose) {{ return robot_forward_same_side(q, pose); }}
"""


def needed(*programs: str) -> None:
    """Skip the test that needs programs which are not installed."""
    missing = [program for program in programs if not shutil.which(program)]
    if missing:
        pytest.skip(f"not installed: {', '.join(missing)}")


def compiled(robot: pk.Robot, folder: Path, number: Any = "double", compiler: str = "gcc") -> Any:
    """The functions of a robot's header, in a shared library."""
    needed(compiler)
    pk.export.c_header(robot, folder / "robot.h", number)
    text = _LIBRARY + (_SIDE if robot.machine.rows == robot.machine.m else "")
    (folder / "robot.c").write_text(text.format(real=number))
    built = folder / f"robot-{compiler}-{number}.so"
    command = [compiler, *STRICT, "-shared", "-fPIC", "-o", built, folder / "robot.c", "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return Library(ctypes.CDLL(str(built)), robot, number)


def compiled_once(
    cases: Mapping[str, Callable[[], pk.Robot]], folders: pytest.TempPathFactory
) -> Callable[[str, str], Any]:
    """The functions of a case's header as compiled by gcc, once."""

    @cache
    def of_case(case: str, number: str) -> Any:
        return compiled(cases[case](), folders.mktemp("header"), number)

    return of_case


class Library:
    """Rows through a compiled header; where it refuses a row, what was there stays."""

    def __init__(self, library: ctypes.CDLL, robot: pk.Robot, number: str) -> None:
        self._library = library
        self._type = {"double": np.float64, "float": np.float32}[number]
        self._n, self._m = robot.n_actuators, len(robot.coordinates)

    def inverse(self, poses: Any, before: float = np.nan) -> tuple[Any, Any]:
        return self._rows("inverse", poses, np.full((len(poses), self._n), before))

    def jacobian(self, poses: Any) -> tuple[Any, Any]:
        size = self._n * self._m
        status, found = self._rows("jacobian", poses, np.full((len(poses), size), np.nan))
        return status, found.reshape(-1, self._n, self._m)

    def forward(self, q: Any, guess: Any) -> tuple[Any, Any]:
        return self._rows("forward", q, np.broadcast_to(guess, (len(q), 6)))

    def forward_same_side(self, q: Any, guess: Any) -> tuple[Any, Any]:
        return self._rows("forward_same_side", q, np.broadcast_to(guess, (len(q), 6)))

    def missed(self, poses: Any) -> tuple[Any, Any]:
        return self._rows("missed", poses, np.full((len(poses), 1), np.nan))

    def side(self, q: Any, poses: Any) -> Any:
        return self._rows("side", q, poses)[0]

    def _rows(self, name: str, given: Any, written: Any) -> tuple[Any, Any]:
        call = getattr(self._library, name)
        given = np.ascontiguousarray(given, dtype=self._type)
        written = np.array(written, dtype=self._type, order="C")
        status = [
            call(one.ctypes.data_as(ctypes.c_void_p), other.ctypes.data_as(ctypes.c_void_p))
            for one, other in zip(given, written, strict=True)
        ]
        return np.array(status), written
