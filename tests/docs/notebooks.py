"""The notebooks of the documentation: scripts in cells, run here, with what they print and draw.

`docs/notebooks/NAME.py` is what is written by hand, in the percent format that editors run cell by
cell; `python -m tests.docs.notebooks` runs each and writes `NAME.ipynb` with its outputs. Own code
in place of nbclient: with a kernel that is some twenty packages more for the tests, and all that is
needed of it is the value of a cell's last line.
"""

from __future__ import annotations

import ast
import base64
import contextlib
import io
import json
import os
import re
import shutil
import sys
import tempfile
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .pages import DATA, DOCS, ROOT

FOLDER = DOCS / "notebooks"
SCRIPTS = sorted(FOLDER.glob("*.py"))
_CELL = re.compile(r"^# %%( \[markdown\])?\n", re.MULTILINE)


@dataclass(frozen=True)
class Cell:
    """A cell: text in Markdown, or Python."""

    markdown: bool
    source: str


def data_of(script: Path) -> list[Path]:
    """The measurements that it reads, which are no part of the project."""
    first = script.read_text(encoding="utf-8").partition("\n")[0]
    return [DATA / name for name in first.removeprefix("# data: ").split()]


def cells(script: Path) -> list[Cell]:
    _, *parts = _CELL.split(script.read_text(encoding="utf-8"))
    found = []
    for kind, text in zip(parts[::2], parts[1::2], strict=True):
        lines = text.strip("\n").splitlines()
        if kind:
            assert all(line.startswith("#") for line in lines), lines
            lines = [line[1:].removeprefix(" ") for line in lines]
        found.append(Cell(bool(kind), "\n".join(lines)))
    return found


def outputs(script: Path) -> list[list[dict[str, Any]]]:
    """What each cell of code gives, run in order in a folder of its own beside its data."""
    from matplotlib import pyplot

    names: dict[str, Any] = {"__name__": "__main__"}
    made = []
    here = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            shutil.copytree(ROOT / "examples", "examples")
            for file in data_of(script):
                os.symlink(file, file.name)
            for cell in cells(script):
                if not cell.markdown:
                    made.append(_run(cell.source, names, pyplot))
        finally:
            os.chdir(here)
            pyplot.close("all")
    return made


def _run(source: str, names: dict[str, Any], pyplot: Any) -> list[dict[str, Any]]:
    *before, last = ast.parse(source).body
    value, printed = None, io.StringIO()
    with contextlib.redirect_stdout(printed), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        if isinstance(last, ast.Expr):
            exec(compile(ast.Module(before, []), "cell", "exec"), names)
            value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
        else:
            exec(compile(source, "cell", "exec"), names)
    said = [f"{each.category.__name__}: {each.message}\n" for each in caught]
    found = [_stream("stdout", printed.getvalue()), _stream("stderr", "".join(said))]
    found = [each for each in found if each["text"]]
    figures = [pyplot.figure(number) for number in pyplot.get_fignums()]
    if hasattr(value, "savefig"):
        figures.append(value)
    elif value is not None:
        data = {"text/plain": _lines(repr(value))}
        if hasattr(value, "_repr_html_"):
            data["text/html"] = _lines(value._repr_html_())
        found.append({"output_type": "execute_result", "data": data})
    for figure in figures:
        png = io.BytesIO()
        figure.savefig(png, format="png", dpi=72, metadata={"Software": None}, facecolor="white")
        data = {"image/png": base64.b64encode(png.getvalue()).decode()}
        found.append({"output_type": "display_data", "data": data})
    pyplot.close("all")
    return found


def _stream(name: str, text: str) -> dict[str, Any]:
    return {"output_type": "stream", "name": name, "text": _lines(text)}


def _lines(text: str) -> list[str]:
    return text.splitlines(keepends=True)


def notebook(script: Path, given: list[list[dict[str, Any]]]) -> dict[str, Any]:
    """The notebook of a script with these outputs, in version 4 of the format."""
    left, count, made = iter(given), 0, []
    for cell in cells(script):
        shared = {"metadata": {}, "source": _lines(cell.source)}
        if cell.markdown:
            made.append({"cell_type": "markdown", **shared})
            continue
        count += 1
        shown = [
            {**each, **({} if each["output_type"] == "stream" else {"metadata": {}}),
             **({"execution_count": count} if each["output_type"] == "execute_result" else {})}
            for each in next(left)
        ]  # fmt: skip
        more = {"execution_count": count, "outputs": shown}
        made.append({"cell_type": "code", **shared, **more})
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    metadata = {"kernelspec": kernel, "language_info": {"name": "python"}}
    return {"cells": made, "metadata": metadata, "nbformat": 4, "nbformat_minor": 4}


def main() -> None:
    for script in SCRIPTS:
        if sys.argv[1:] and script.stem not in sys.argv[1:]:
            continue
        text = json.dumps(notebook(script, outputs(script)), indent=1, ensure_ascii=False)
        script.with_suffix(".ipynb").write_text(text + "\n", encoding="utf-8")
        print(script.stem)


if __name__ == "__main__":
    main()
