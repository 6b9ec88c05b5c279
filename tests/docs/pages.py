"""The pages of the documentation as data: their blocks, and what each block prints when run.

`test_pages.py` compares with what the pages show; `python -m tests.docs.refresh` writes it.
"""

from __future__ import annotations

import doctest
import re
import shlex
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from typer.testing import CliRunner

import pkmcal as pk
from pkmcal.cli import verbs

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")),
    *sorted(DOCS.rglob("*.md")),
    *sorted((ROOT / "examples").rglob("*.md")),
    *sorted((ROOT / "benchmarks").rglob("*.md")),
]
DATA = ROOT.parent / "shared" / "data"
LOGS = {  # what readers have of their own, by the names the pages give it
    "printer.cfg": ROOT / "examples" / "linear-delta" / "printer.cfg",
    "probe41.csv": DATA / "linear-delta" / "probe41.csv",
    "tracker.csv": DATA / "fanuc-r2000ic" / "tracker.csv",
}
_BLOCK = re.compile(r"^```(\S*)(?: (\S+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_DOCTEST = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


def name_of(page: Path) -> str:
    """A page's path from the root of the project."""
    return page.relative_to(ROOT).as_posix()


@dataclass(frozen=True)
class Block:
    """One fenced block: its language, the file it is to be (or ""), its text and where it is."""

    language: str
    file: str
    text: str
    start: int


def blocks(page: Path) -> list[Block]:
    return [
        Block(m[1], m[2] or "", m[3], m.start(3))
        for m in _BLOCK.finditer(page.read_text(encoding="utf-8"))
    ]


def prose(page: Path) -> str:
    """A page without its blocks."""
    return _BLOCK.sub("", page.read_text(encoding="utf-8"))


def as_pkmcal(command: str) -> list[str]:
    """The arguments of `pkmcal` in a command, of `make` through its recipe."""
    if command.startswith("make "):
        target = re.escape(command.split()[1])
        makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
        match = re.search(rf"^{target}:.*\n\t\$\(BIN\)/(pkmcal .*)$", makefile, re.MULTILINE)
        assert match, f"the Makefile has no recipe of pkmcal for {command!r}"
        command = match[1]
    program, *arguments = shlex.split(command)
    assert program == "pkmcal"
    return arguments


def run(arguments: list[str]) -> Any:
    return CliRunner().invoke(verbs.app, arguments, prog_name="pkmcal")


def compensated() -> dict[str, Any]:
    """What the blocks of compensation.md take for granted: a machine with errors, and poses."""
    robot = pk.load("2tpr2tps-spatial")
    errors = np.random.default_rng(0).normal(0, 0.2, len(robot.model.free))
    names = [name for name in robot.model.free if robot.geometry.units[
        robot.geometry.names.index(name)] == "mm"]  # fmt: skip
    true = robot.replace({n: robot.geometry[n] + e for n, e in zip(names, errors, strict=False)})
    desired = robot.complete(pk.sample_poses(robot, 4, share=0.3))

    def measure(commands: np.ndarray) -> np.ndarray:
        return np.asarray(true.forward(commands, desired).pose)

    actuators = robot.inverse(desired)
    return {
        **{"pk": pk, "np": np, "robot": robot, "desired": desired, "measure": measure},
        **{"measured": measure(actuators), "poses": desired, "actuators": actuators},
        "identified": pk.load("2tpr2tps").replace({"offset1": 0.3}),
    }


_GIVEN = {"docs/compensation.md": compensated}


class MissingLog(Exception):
    """A page needs measurements that are not beside this checkout."""


@dataclass
class Session:
    """One page, run from its first block to its last in a folder of its own.

    Parameters
    ----------
    page : Path
        The page.
    folder : Path
        The working folder; the examples and the logs that the page names are put there.
    """

    page: Path
    folder: Path
    names: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.names |= _GIVEN.get(name_of(self.page), dict)()
        text = self.page.read_text(encoding="utf-8")
        for name, log in LOGS.items():
            if re.search(rf"^\$ .*\b{name}", text, re.MULTILINE):
                if not log.exists():
                    raise MissingLog(f"{name} is not beside this checkout (../shared/data)")
                shutil.copy(log, self.folder / name)
        shutil.copytree(ROOT / "examples", self.folder / "examples")

    def printed(self) -> Iterator[tuple[Block, str]]:
        """Each block that prints something, with its text as it is when run now."""
        for block in blocks(self.page):
            if block.file:
                Path(block.file).write_text(block.text, encoding="utf-8")
            elif block.language == "python" and ">>>" in block.text:
                yield block, self._doctest(block.text)
            elif block.language == "python":
                exec(compile(block.text, str(self.page), "exec"), self.names)
            elif block.language == "console":
                yield block, "".join(_console(block.text))

    def _doctest(self, text: str) -> str:
        parsed = doctest.DocTestParser().get_doctest(
            text, self.names, self.page.name, str(self.page), 0
        )
        runner = _Collect(optionflags=_DOCTEST)
        runner.run(parsed, out=lambda said: None, clear_globs=False)
        self.names.update(parsed.globs)
        lines = text.splitlines(keepends=True)
        for example, got in reversed(runner.failed):
            first = example.lineno + example.source.count("\n")
            last = first + example.want.count("\n")
            lines[first:last] = re.sub(r"^$(?=\n)", "<BLANKLINE>", got, flags=re.M)
        return "".join(lines)


class _Collect(doctest.DocTestRunner):
    """Keeps the examples whose output is another than the one shown."""

    def __init__(self, optionflags: int) -> None:
        super().__init__(verbose=False, optionflags=optionflags)
        self.failed: list[tuple[doctest.Example, str]] = []

    def report_failure(self, out: Any, test: Any, example: doctest.Example, got: str) -> None:
        self.failed.append((example, got))

    def report_unexpected_exception(
        self, out: Any, test: Any, example: doctest.Example, exc_info: Any
    ) -> None:
        raise exc_info[1]


def _console(text: str) -> Iterator[str]:
    before, *parts = re.split(r"^\$ ", text, flags=re.MULTILINE)
    assert not before
    for part in parts:
        command, _, _ = part.partition("\n")
        pipe = re.fullmatch(r"(pkmcal .*?) \| head -(\d+)", command)
        if command.startswith(("pkmcal", "make")):
            result = run(as_pkmcal(pipe[1] if pipe else command))
            assert result.exit_code in (0, 1), (command, result.exit_code, result.output)
            printed = result.stderr + result.stdout  # as a terminal shows them
            if pipe:
                printed = "".join(printed.splitlines(keepends=True)[: int(pipe[2])])
        else:
            done = subprocess.run(command, shell=True, capture_output=True, text=True, check=True)
            printed = done.stdout
        yield f"$ {command}\n{printed}"
