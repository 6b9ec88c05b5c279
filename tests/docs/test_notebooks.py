"""Notebooks, one for each real machine: they are those of their scripts, and run."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from .notebooks import DATA, SCRIPTS, data_of, notebook, outputs
from .test_pages import same

every_script = pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)


def stored(script: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(script.with_suffix(".ipynb").read_text(encoding="utf-8"))
    return found


def settled(lines: list[str]) -> str:
    """Without the gap behind the rank, which is rounding's."""
    return re.sub(r"gap [\d.e+]+", "gap", "".join(lines))


def of_code(found: dict[str, Any]) -> list[list[dict[str, Any]]]:
    return [cell["outputs"] for cell in found["cells"] if cell["cell_type"] == "code"]


def test_every_folder_of_real_measurements_has_a_notebook() -> None:
    if not DATA.exists():
        pytest.skip("the measurements are not beside this checkout (../shared/data)")
    folders = {path.parent for path in DATA.rglob("*") if path.suffix in (".csv", ".json")}
    folders.discard(DATA / "charuco")  # pictures of a camera and no machine: poses of a flange
    assert folders == {file.parent for script in SCRIPTS for file in data_of(script)}


@every_script
def test_a_notebook_has_the_cells_of_its_script(script: Path) -> None:
    """`python -m tests.docs.notebooks` writes it."""
    found = stored(script)
    again = notebook(script, of_code(found))
    assert again == found
    assert script.with_suffix(".ipynb").stat().st_size < 400_000


@pytest.mark.slow
@every_script
def test_a_notebook_runs_and_says_what_it_shows(script: Path) -> None:
    if not all(file.exists() for file in data_of(script)):
        pytest.skip("its measurements are not beside this checkout (../shared/data)")
    for now, shown in zip(outputs(script), of_code(stored(script)), strict=True):
        assert [each["output_type"] for each in now] == [each["output_type"] for each in shown]
        for one, other in zip(now, shown, strict=True):
            if "text" in one:
                assert same("".join(one["text"]), "".join(other["text"]))
            elif "text/plain" in one["data"]:
                for kind in ("text/plain", "text/html"):
                    printed, expected = one["data"].get(kind, []), other["data"].get(kind, [])
                    assert same(settled(printed), settled(expected)), kind
            else:
                assert one["data"].keys() == {"image/png"}
