"""The README and the page of the command line: what they name works; the example's log is sound."""

from __future__ import annotations

import re
import runpy
import shlex
import shutil
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk

from .pages import DOCS, ROOT, as_pkmcal, blocks, run

README = (ROOT / "README.md").read_text(encoding="utf-8")
COMMAND_LINE = (DOCS / "command-line.md").read_text(encoding="utf-8")
DELTA = ROOT / "examples" / "linear-delta"


def of_language(language: str) -> list[str]:
    return [block.text for block in blocks(ROOT / "README.md") if block.language == language]


def makefile() -> str:
    return (ROOT / "Makefile").read_text(encoding="utf-8")


@pytest.fixture
def beside_the_examples(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_readme_is_short() -> None:
    assert len(README.splitlines()) <= 140


def _with_temperature(name: str) -> str:
    """A table with a column of temperatures in place of a table."""
    if not name.endswith(".csv"):
        return name
    head, *rows = Path(name).read_text("utf-8").splitlines()
    Path("warm.csv").write_text(
        "\n".join([f"{head},temperature [°C]", *(f"{row},22" for row in rows)])
    )
    return "warm.csv"


def test_options_named_in_the_text_work(beside_the_examples: Path) -> None:
    (command,) = (line for line in of_language("console")[0].splitlines() if "calibrate" in line)
    calibrate = as_pkmcal(command.removeprefix("$ "))
    (section,) = re.findall(r"^## Calibrate\n(.*?)^## ", COMMAND_LINE, re.M | re.S)
    options = re.findall(r"`(--[a-z]+(?: [^`]+)?)`", section)
    assert len(options) >= 5
    shutil.copy(DELTA / "probe.csv", "log.csv")  # that of a controller
    for option in options:
        extra = shlex.split(option.replace("DIR", "calibrated"))
        if extra[0] == "--prior":
            extra += ["--free", "radius,angle[12],offset*,rod*"]
        given = [_with_temperature(each) for each in calibrate] if "expan" in option else calibrate
        assert run([*given, *extra]).exit_code == 0, option
    assert pk.load("calibrated/robot.toml").name == pk.load(DELTA / "robot.toml").name


def test_calibration_from_the_file_of_the_demo_finds_the_same(beside_the_examples: Path) -> None:
    assert run(["demo"]).exit_code == 0
    match = re.search(r"`pkmcal (calibrate [^`]*measured[^`]*)`", COMMAND_LINE)
    assert match
    assert run([*shlex.split(match[1]), "--report", "again"]).exit_code == 0
    for name in ("robot.toml", "report.json"):  # what they were made of is named by its path
        again, first = (Path(each, name).read_text("utf-8") for each in ("again", "pkmcal-demo"))
        own, others = (
            [line for line in text.splitlines() if "sha256" not in line and ".csv" not in line]
            for text in (again, first)
        )
        assert own == others
        assert len(own) > 10


def test_measurements_shown_are_the_first_of_the_log() -> None:
    shown, _ = of_language("text")
    assert (DELTA / "probe.csv").read_text(encoding="utf-8").startswith(shown)


def test_make_targets_named_are_there() -> None:
    named = set(
        re.findall(r"make ([a-z-]+)", "\n".join(of_language("sh")).replace("install make", ""))
    )
    named |= set(re.findall(r"`make ([a-z-]+)", README))
    phony = " ".join(re.findall(r"^\.PHONY: (.*)$", makefile(), re.MULTILINE)).split()
    assert named <= set(phony)
    assert {"demo", "test", "docs"} <= named


def test_debian_packages_named_are_those_the_build_asks_for() -> None:
    match = re.search(r"`apt-get install ([^`]*)`", README)
    assert match
    asked = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    installed = re.search(r"apt-get install -qq -y (.*)", asked)
    assert installed
    assert set(match[1].split()) == set(installed[1].split()) - {"python3"}


def test_folders_named_are_there() -> None:
    _, layout = of_language("text")
    folders = re.findall(r"^(\S+)/ ", layout, re.MULTILINE)
    assert len(folders) >= 6
    for path in folders:
        assert (ROOT / path).exists(), path


@pytest.mark.parametrize("picture", ["demo.png", "app/result.png"])
def test_pictures_are_small_enough_to_check_in(picture: str) -> None:
    content = (ROOT / "docs" / picture).read_bytes()
    assert len(content) < 100_000
    assert struct.unpack(">II", content[16:24])[0] >= 600


# --- the example's log ---------------------------------------------------------------------------


@pytest.fixture(scope="module")
def make_log() -> dict[str, Any]:
    return runpy.run_path(str(DELTA / "make_log.py"))


def test_example_log_is_what_its_script_makes(make_log: dict[str, Any], tmp_path: Path) -> None:
    make_log["log"]().write(tmp_path / "probe.csv")
    made, kept = ((folder / "probe.csv").read_bytes() for folder in (tmp_path, DELTA))
    assert made == kept


def test_true_geometry_stated_is_that_of_the_script_and_found(make_log: dict[str, Any]) -> None:
    text = (DELTA / "README.md").read_text(encoding="utf-8")
    heads, _, values = (
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in text.splitlines()
        if line.startswith("|")
    )
    stated = {name: cell.split()[0] for name, cell in zip(heads, values, strict=True)}
    robot = pk.load(DELTA / "robot.toml")
    assert {robot.geometry[f"rod{i}"] for i in (1, 2, 3)} == {float(stated.pop("rods"))}
    found = pk.identify(robot, pk.read_measurements(DELTA / "probe.csv"))
    assert set(found.free) == set(make_log["TRUE"]) == set(stated)
    for i, name in enumerate(found.free):
        true = make_log["TRUE"][name]
        shown = np.degrees(true) if stated[name].endswith("°") else true
        assert shown == pytest.approx(float(stated[name].rstrip("°")), abs=1e-9)
        assert abs(found.values[i] - true) < 2.5 * found.stderr[i], name
