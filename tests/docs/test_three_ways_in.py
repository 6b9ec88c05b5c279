"""The three ways in of README and first page: the commands are the same, and they work."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk

from .pages import DOCS, ROOT, as_pkmcal, blocks, run

DELTA = ROOT / "examples" / "linear-delta"


def ways_in(page: Path) -> list[list[str]]:
    """The commands of each block of a page that are pkmcal's."""
    texts = [block.text for block in blocks(page) if block.language == "sh"]
    return [text.splitlines() for text in texts if text.startswith("pkmcal ")][:3]


PRINTER, TRACKER, DESIGN = ways_in(ROOT / "README.md")


def follow(commands: list[str]) -> list[str]:
    """Run them one after the other; what each prints."""
    said = []
    for command in commands:
        done = run(as_pkmcal(command))
        assert done.exit_code == 0, f"{command}\n{done.stdout}{done.stderr}"
        said.append(done.stdout)
    return said


def test_the_first_page_has_those_of_the_readme() -> None:
    assert ways_in(DOCS / "index.md") == [PRINTER, TRACKER, DESIGN]


def test_a_printer_gets_its_configuration(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copy(DELTA / "printer.cfg", tmp_path)
    monkeypatch.chdir(tmp_path)
    follow(PRINTER)
    assert "delta_radius" in (tmp_path / "new.cfg").read_text("utf-8")


def test_a_tracker_gets_a_certificate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robot, rng = pk.load("hexapod"), np.random.default_rng(1)
    true = robot.replace({f"offset{i}": 0.3 * rng.normal() for i in range(1, 7)})
    q = robot.inverse(pk.sample_poses(robot, 40, seed=1))
    pose = true.forward(q).pose
    seen = pose[:, :3] + rng.normal(0, 0.01, (40, 3)) + [1000.0, -300.0, 200.0]
    monkeypatch.chdir(tmp_path)
    legs = ["pose," + ",".join(f"q{i} [mm]" for i in range(1, 7))]
    legs += [f"{k}," + ",".join(map(repr, row)) for k, row in enumerate(q.tolist())]
    Path("legs.csv").write_text("\n".join(legs))
    points = ["pose,x [mm],y [mm],z [mm],sigma [mm]"]
    points += [f"{k}," + ",".join(map(repr, row)) + ",0.01" for k, row in enumerate(seen.tolist())]
    Path("tracker.csv").write_text("\n".join(points))
    Path("certificate.toml").write_text('number = "1"\n[instrument]\nexpanded = 0.02\n')
    drawn = [each.replace(" --pdf", "") for each in TRACKER]  # needs a browser
    follow(drawn)
    assert "Calibration certificate 1" in Path("report/report.html").read_text("utf-8")


def test_a_design_gets_a_page_and_its_spread(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    said = follow([f"{each} --samples 50" if "tolerance" in each else each for each in DESIGN])
    assert "std" in said[-1] and list(tmp_path.glob("*.html"))
