"""`pkmcal measure`: nothing moves that nobody started, and nothing is asked that nobody typed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from .servers import duet, grbl

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    robot = (ROOT / "examples" / "linear-delta" / "robot.toml").read_text()
    (tmp_path / "robot.toml").write_text(robot)
    places = np.random.default_rng(1).uniform(-70, 70, (30, 2)).round(2)
    rows = "".join(f"{x},{y},5\n" for x, y in places)
    (tmp_path / "poses.csv").write_text("x [mm],y [mm],z [mm]\n" + rows)
    return tmp_path


def measured(folder: Path, machine: str, typed: str, *more: str) -> Any:
    command = [
        Path(sys.executable).with_name("pkmcal"), "measure", "robot.toml", "--kind", "height",
        "--noise", "0.03", "--direction", "z", "--poses", "poses.csv", "--dwell", "0",
        "--machine", machine, "--instrument", "person", "--out", "log.csv", *more,
    ]  # fmt: skip
    return subprocess.run(
        command, cwd=folder, input=typed, capture_output=True, text=True, timeout=120
    )


@pytest.mark.parametrize("typed", ["", "\n", "yes\n", "START\n"])
def test_nothing_moves_that_nobody_started(folder: Path, typed: str) -> None:
    with duet() as (address, machine):
        done = measured(folder, f"reprap:{address}", typed, "--count", "2")
    assert done.returncode == 2 and "not started" in done.stderr
    assert machine.lines == []
    assert f"driven by reprap:{address}" in done.stdout and "no safe height" in done.stdout


@pytest.mark.parametrize("server", [duet, grbl])
def test_a_machine_is_driven_and_a_person_types(folder: Path, server: Any) -> None:
    word = "reprap" if server is duet else "fluidnc"
    with server() as (address, machine):
        done = measured(folder, f"{word}:{address}", "start\n5.1\nno\n5.2\n", "--count", "2")
        assert done.returncode == 0, done.stderr
        assert len(machine.lines) == 2
        assert "all the poses that were asked for are measured" in done.stdout
        more = measured(folder, f"{word}:{address}", "start\n5.0\n", "--count", "4")
    assert more.returncode == 1  # nobody types the fourth
    assert "goes on behind 2 rows" in more.stderr and "stopped with 3 rows" in more.stderr
    assert len(machine.lines) == 4
    rows = (folder / "log.csv").read_text().splitlines()
    assert [row.split(",")[3] for row in rows if row[0] == "-"] == ["5.1", "5.2", "5.0"]


@pytest.mark.parametrize(
    ("machine", "more", "said"),
    [
        ("nothing:http://a", ["--count", "2"], "it has person"),
        ("reprap:http://127.0.0.1:9", ["--count", "2"], "does not answer"),
        ("person", [], "state when to stop"),
        ("person", ["--count", "0"], "--count"),
        ("person", ["--count", "2", "--repeats", "0"], "--repeats"),
        ("person", ["--count", "2", "--feed", "-1"], "--feed"),
        ("person", ["--accuracy", "1e-4"], "together predict"),
        ("person", ["--count", "2", "--kind", "position=2,height=1"], "one kind|--kind"),
    ],
)
def test_what_does_not_fit_is_refused_before_anything_moves(
    folder: Path, machine: str, more: list[str], said: str
) -> None:
    done = measured(folder, machine, "start\n", *more)
    assert done.returncode == 2 and not done.stdout
    assert any(part in done.stderr for part in said.split("|")), done.stderr
