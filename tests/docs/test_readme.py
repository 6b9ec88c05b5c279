"""The README is true: its commands and examples are run, its quotations are looked up."""

from __future__ import annotations

import doctest
import re
import runpy
import shlex
import shutil
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import pkmcal as pk
from pkmcal.cli import main as cli

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
DELTA = ROOT / "examples" / "linear-delta"
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def blocks(language: str) -> list[str]:
    return [text for name, text in BLOCKS if name == language]


def sessions() -> list[tuple[str, str]]:
    """Commands of the console blocks, each with what it is said to print."""
    parts = [part for text in blocks("console") for part in re.split(r"^\$ ", text, flags=re.M)]
    return [(command, printed) for command, _, printed in (p.partition("\n") for p in parts if p)]


def makefile() -> str:
    return (ROOT / "Makefile").read_text(encoding="utf-8")


def as_pkmcal(command: str) -> list[str]:
    """The arguments of `pkmcal` in a command, of `make` through its recipe."""
    if command.startswith("make "):
        target = re.escape(command.split()[1])
        match = re.search(rf"^{target}:.*\n\t\$\(BIN\)/(pkmcal .*)$", makefile(), re.MULTILINE)
        assert match, f"the Makefile has no recipe of pkmcal for {command!r}"
        command = match[1]
    program, *arguments = shlex.split(command)
    assert program == "pkmcal"
    return arguments


def run(arguments: list[str]) -> Any:
    return CliRunner().invoke(cli.app, arguments, prog_name="pkmcal")


def assert_same(printed: str, shown: str) -> None:
    """The same text, and numbers that differ by one in their last digit at most."""
    assert NUMBER.sub("0", printed).split() == NUMBER.sub("0", shown).split(), printed
    for a, b in zip(NUMBER.findall(printed), NUMBER.findall(shown), strict=True):
        places = len(b.partition("e")[0].partition(".")[2])
        power = int(b.partition("e")[2] or 0)
        assert abs(float(a) - float(b)) <= 1.001 * 10.0 ** (power - places), (a, b)


@pytest.fixture
def beside_the_examples(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_every_block_is_of_a_kind_that_is_checked() -> None:
    assert {name for name, _ in BLOCKS} == {"console", "csv", "python", "sh", "text"}


@pytest.mark.parametrize(("command", "shown"), sessions(), ids=[c for c, _ in sessions()])
def test_command_prints_what_the_readme_shows(
    command: str, shown: str, beside_the_examples: Path
) -> None:
    result = run(as_pkmcal(command))
    assert (result.exit_code, result.stderr) == (0, "")
    assert_same(result.stdout, shown)


def test_comparison_sees_a_wrong_digit_and_a_wrong_word() -> None:
    assert_same("rms 0.0259 mm\n", "rms 0.0260 mm")
    for printed in ("rms 0.0257 mm", "rms 0.0259 um", "rms mm", "rms 0.0259 mm 1"):
        with pytest.raises(AssertionError):
            assert_same(printed, "rms 0.0259 mm")


def test_options_named_in_the_text_work(beside_the_examples: Path) -> None:
    calibrate = as_pkmcal(next(c for c, _ in sessions() if "calibrate" in c))
    options = re.findall(r"`(--[a-z]+(?: [^`]+)?)`", README)
    assert len(options) >= 5
    for option in options:
        extra = shlex.split(option.replace("DIR", "calibrated"))
        if extra[0] == "--prior":
            extra += ["--free", "radius,angle[12],offset*,rod*"]
        assert run([*calibrate, *extra]).exit_code == 0, option
    assert pk.load("calibrated/robot.toml").name == pk.load(DELTA / "robot.toml").name


def test_calibration_from_the_file_of_the_demo_finds_the_same(beside_the_examples: Path) -> None:
    assert run(["demo"]).exit_code == 0
    match = re.search(r"`pkmcal (calibrate [^`]*measured[^`]*)`", README)
    assert match
    assert run([*shlex.split(match[1]), "--report", "again"]).exit_code == 0
    for name in ("robot.toml", "report.json", "report.html"):
        assert Path("again", name).read_bytes() == Path("pkmcal-demo", name).read_bytes()


def test_python_examples_give_what_they_show() -> None:
    source = "\n".join(blocks("python"))
    parsed = doctest.DocTestParser().get_doctest(source, {}, "README.md", "README.md", 0)
    assert len(parsed.examples) >= 10
    results = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(parsed)
    assert results.failed == 0


def test_measurements_shown_are_the_first_of_the_log() -> None:
    (shown,) = blocks("csv")
    assert (DELTA / "probe.csv").read_text(encoding="utf-8").startswith(shown)


def test_make_targets_named_are_there() -> None:
    named = set(re.findall(r"make ([a-z-]+)", "\n".join(blocks("sh")).replace("install make", "")))
    named |= set(re.findall(r"`make ([a-z-]+)", README))
    phony = re.search(r"^\.PHONY: (.*)$", makefile(), re.MULTILINE)
    assert phony
    assert named <= set(phony[1].split())
    assert {"demo", "test", "regenerate", "bench"} <= named


def test_debian_packages_named_are_those_the_build_asks_for() -> None:
    match = re.search(r"apt-get install (.*)", "\n".join(blocks("sh")))
    assert match
    asked = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    installed = re.search(r"apt-get install -qq -y (.*)", asked)
    assert installed
    assert set(match[1].split()) == set(installed[1].split()) - {"python3"}


def test_lines_of_the_way_of_a_leg_length_stand_in_their_files() -> None:
    rows = re.findall(r"^\| `([^`]+)` \| `([^`]+)` \|", README, re.MULTILINE)
    assert [Path(file).parts[0] for file, _ in rows] == ["derive", "generated", "csrc", "pkmcal"]
    for file, line in rows:
        assert line in (ROOT / file).read_text(encoding="utf-8"), (file, line)


def test_folders_and_linked_files_are_there() -> None:
    (layout,) = blocks("text")
    folders = re.findall(r"^(\S+)/ ", layout, re.MULTILINE)
    assert len(folders) >= 6
    links = re.findall(r"\]\(([^)]+)\)", README)
    for path in [*folders, *links]:
        assert (ROOT / path).exists(), path


def test_picture_is_small_enough_to_check_in() -> None:
    content = (ROOT / "docs" / "demo.png").read_bytes()
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
