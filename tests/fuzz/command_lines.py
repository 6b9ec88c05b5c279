"""Command lines of any words, in one process, in a folder that has some files."""

from __future__ import annotations

import io
import json
import os
import re
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from random import Random
from typing import Any
from unittest import mock

import typer

from pkmcal.cli.verbs import app
from pkmcal.display import visible

from .damage import HOSTILE, Door

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
FILES = {
    "robot.toml": EXAMPLES / "linear-delta" / "robot.toml",
    "probe.csv": EXAMPLES / "linear-delta" / "probe.csv",
    "printer.cfg": EXAMPLES / "linear-delta" / "printer.cfg",
    "desired.csv": EXAMPLES / "2tpr2tps-compensation" / "desired.csv",
    "measured.csv": EXAMPLES / "2tpr2tps-compensation" / "measured.csv",
}
CONTENT = {name: source.read_bytes() for name, source in FILES.items()}
DEEP = "1/2/3/4/5/6/7/8"  # the folder in which a line runs, lest `..` leads to what is not ours
_ABSOLUTE = re.compile(r"(^|[=:,])/+")


@cache
def command() -> Any:
    """The program with its verbs, which are loaded once: that takes longer than most lines."""
    return typer.main.get_command(app)


@contextmanager
def within(folder: Path) -> Iterator[None]:
    """In this folder; `contextlib.chdir` of later Pythons."""
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def ended(words: list[str]) -> tuple[int, str, str]:
    """The exit code of a line, and what it printed."""
    given, *printed = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8") for _ in range(3))
    out, err = printed
    code: Any = 0
    with mock.patch.multiple(sys, argv=["pkmcal", *words], stdin=given, stdout=out, stderr=err):
        try:
            command().main(words, prog_name="pkmcal")
        except SystemExit as stop:
            code = stop.code or 0
    for each in printed:
        each.seek(0)
    return code, out.read(), err.read()


def line(folder: Path, content: bytes, chance: Random) -> bool:
    """One word on each line of the input; none is the place of a file outside the folder."""
    text = content.decode("utf-8", "replace").replace("\0", "")
    words = [_ABSOLUTE.sub(r"\1", each) for each in text.split("\n")]
    inside = folder / DEEP
    inside.mkdir(parents=True)
    for name, known in CONTENT.items():
        (inside / name).write_bytes(known)
    with within(inside), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        code, out, err = ended(words)
    assert code in (0, 1, 2), f"exit {code}: {err[-1000:]}"
    assert "Traceback" not in out + err
    for printed in (out, err):
        assert visible(printed) == printed, f"steers a terminal: {printed[-1000:]!r}"
    if code == 2:
        *_, last = err.splitlines()
        assert last.startswith("pkmcal: "), last
    elif "--json" in words and "--help" not in words and out.startswith(("{", "[")):
        json.loads(out, parse_constant=_no_json)
    if not any(each.startswith("--fo") for each in words):
        for name, known in CONTENT.items():
            assert (inside / name).read_bytes() == known, f"{name} was replaced"
    return code < 2


def _no_json(word: str) -> None:
    raise AssertionError(f"{word} is not JSON")


_QUICK = """
new hexapod mine.toml
check robot.toml --json
check hexapod
tolerance 2tpr2tps --sigma 0.1 --samples 100 --json
plan robot.toml --count 8 --kind height --prior 0.5 --out plan --json
calibrate robot.toml probe.csv --prior 0.5 --json
compensate 2tpr2tps desired.csv measured.csv --orientation assumed --json
export robot.toml --as klipper --config printer.cfg --out new.cfg --json
export hexapod --as c --out hexapod.h --number float
import printer.cfg --out imported --json
inverse hexapod 0,0,800,0,0,0 --json
inverse 2tpr2tps desired.csv --match --out . --force
forward hexapod 700,700,700,700,700,700 --json
"""
_SLOW = """
machines --json
show hexapod
demo --seed 3 --json
sensitivity 2tpr2tps --step 0.1 --json
tolerance hexapod --allowed 0.1
calibrate robot.toml probe.csv --prior 0.5 --holdout 0.2 --report out --force
"""
_QUICKER = 15  # times as often as those that draw or simulate, which take up to seconds
_WORDS = b"""
--json --force --help --version --rad --match --common --project --seed --samples --out --report
--free --prior --holdout --loss --frame --target --tracker --poses --targets --criterion --kind
--noise --count --accuracy --sigma --allowed --map --step --as --from --number --config --unknown
--method --orientation --bounds robot.toml probe.csv hexapod desired.csv measured.csv 2tpr2tps 3r
linear-delta nothing.toml . .. / unknown measured huber pso exact D A pose height position y,z
base*=0.5 rod* angle1=0.1deg 0.5 12 -1 0 1e308 nan 1,2,3 c klipper reprap marlin mjcf float demo
check plan inverse show new export import calibrate compensate sensitivity tolerance forward -- - '
""".split()


def _seeds(lines: str) -> tuple[bytes, ...]:
    return tuple("\n".join(each.split()).encode() for each in lines.strip().split("\n"))


LINE = Door(
    _seeds(_QUICK) * _QUICKER + _seeds(_SLOW),
    tuple(b"\n" + each + b"\n" for each in (*_WORDS, *HOSTILE, b"a b")),
    line,
)
