"""The pages of `docs` are true: their blocks are run, their links lead somewhere."""

from __future__ import annotations

import doctest
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk

from ..docs.test_readme import ROOT, as_pkmcal, assert_same, run

DOCS = ROOT / "docs"
DATA = ROOT.parent / "shared" / "data"
LOGS = {  # measurements that are no part of the project, by the names the pages give them
    "probe41.csv": DATA / "linear-delta" / "probe41.csv",
    "tracker.csv": DATA / "fanuc-r2000ic" / "tracker.csv",
}
PAGES = sorted(DOCS.glob("*.md"))
BLOCK = re.compile(r"^```(\w*)(?: (\S+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
DOCTEST = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


def blocks(page: Path) -> list[tuple[str, str, str]]:
    return BLOCK.findall(page.read_text(encoding="utf-8"))


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


GIVEN = {"compensation.md": compensated}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_block_runs_and_prints_what_it_shows(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = page.read_text(encoding="utf-8")
    for name, log in LOGS.items():
        if re.search(rf"^\$ .*\b{name}", text, re.MULTILINE):
            if not log.exists():
                pytest.skip(f"{name} is not beside this checkout (../shared/data)")
            shutil.copy(log, tmp_path / name)
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = GIVEN.get(page.name, dict)()
    for language, file, block in blocks(page):
        if file:
            Path(file).write_text(block, encoding="utf-8")
        elif language == "python":
            _python(block, names, page)
        elif language == "console":
            _console(block)
        else:
            assert language in ("text", "toml", "csv"), f"{page.name}: a block of {language!r}"


def _python(block: str, names: dict[str, Any], page: Path) -> None:
    if ">>>" not in block:
        exec(compile(block, str(page), "exec"), names)
        return
    parsed = doctest.DocTestParser().get_doctest(block, names, page.name, str(page), 0)
    results = doctest.DocTestRunner(optionflags=DOCTEST).run(parsed, clear_globs=False)
    names.update(parsed.globs)
    assert results.failed == 0


def _console(block: str) -> None:
    for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
        command, _, shown = part.partition("\n")
        pipe = re.fullmatch(r"(pkmcal .*?) \| head -(\d+)", command)
        if command.startswith("pkmcal"):
            result = run(as_pkmcal(pipe[1] if pipe else command))
            assert result.exit_code in (0, 1) and result.stderr == "", command
            printed = result.stdout
            if pipe:
                printed = "\n".join(printed.splitlines()[: int(pipe[2])])
        else:
            done = subprocess.run(command, shell=True, capture_output=True, text=True, check=True)
            printed = done.stdout
        assert_same(printed, shown)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_to_files(page: Path) -> None:
    for link in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text(encoding="utf-8")):
        if not link.startswith("http"):
            assert (DOCS / link).exists(), link


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_tests_that_are_named_exist(page: Path) -> None:
    sources = list((ROOT / "tests").rglob("test_*.py"))
    defined = {
        name
        for path in sources
        for name in re.findall(r"^def (test_\w+)\(", path.read_text(encoding="utf-8"), re.MULTILINE)
    }
    text = page.read_text(encoding="utf-8")
    files = {path.name for path in sources}
    assert set(re.findall(r"`(test_\w+)`", text)) <= defined
    assert set(re.findall(r"(test_\w+\.py)`", text)) <= files


def test_readme_leads_to_every_page() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    for page in PAGES:
        assert f"(docs/{page.name})" in readme, page.name


def test_reference_is_built_of_all_public_names(tmp_path: Path) -> None:
    pytest.importorskip("pdoc")
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    _, recipe, _ = re.split(r"(?<=/pdoc )(.*)\n", makefile, maxsplit=1)
    options = recipe.replace("build/docs", str(tmp_path)).split()
    command = [sys.executable, "-W", "ignore", "-m", "pdoc", *options]
    subprocess.run(command, check=True, capture_output=True)
    page = (tmp_path / "pkmcal.html").read_text(encoding="utf-8")
    assert "kinematics.html#Kinematics.inverse" in page  # what Robot inherits
    for name in pk.__all__:
        assert f'id="{name}"' in page or f'"pkmcal/{name}.html"' in page, name
