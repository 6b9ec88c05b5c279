"""Tables say what actuators read: lengths, angles, or counts that a gain converts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.kinematics.reading_units import reading_units
from pkmcal.measurements.command_csv import read_commands, write_commands

PRINTER = Path(__file__).parents[2] / "examples" / "linear-delta" / "printer.cfg"


@pytest.mark.parametrize("name", ["hexapod", "rotary-delta", "3r", "delta-parallelograms"])
def test_machines_as_drawn_read_lengths_and_angles(name: str) -> None:
    robot = pk.load(name)
    assert reading_units(robot) == tuple(robot.actuator_units)


def test_scales_and_gears_are_no_counts_and_steps_are() -> None:
    robot = pk.load("rotary-delta")
    assert reading_units(robot.replace({"gain1": 0.1, "gain2": -1.0})) == ("rad",) * 3
    assert reading_units(robot.replace({"gain1": 2 * np.pi / 3200})) == ("counts", "rad", "rad")
    legs = pk.load("hexapod").replace({"gain1": 1.1, "gain2": -0.9, "gain3": 5.0})
    assert reading_units(legs) == ("mm", "mm", "counts", "mm", "mm", "mm")


def test_steps_of_a_printer_are_no_mm(
    run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run("import", PRINTER, "--out", "in").exit_code == 0
    assert "q1 [counts],q2 [counts],q3 [counts],z [mm]" in Path("in/probe.csv").read_text()
    assert run("calibrate", "in/robot.toml", "in/probe.csv").exit_code == 0
    said = run("inverse", "in/robot.toml", "0,0,10,0,0,0", "--out", "out").stdout
    assert "q1 [counts]" in said and "[mm]" not in said
    back = run("forward", "in/robot.toml", "out/commands.csv").stdout.splitlines()
    assert back[1].split()[1:4] == ["0.0000", "0.0000", "10.0000"]
    robot = pk.load("in/robot.toml")
    options = ("--kind", "height", "--count", "8", "--free", "offset*", "--within", "z=0:200")
    assert run("plan", "in/robot.toml", *options, "--out", "plan").exit_code == 0
    q = read_commands("plan/commands.csv", reading_units(robot))
    drives = robot.feasible(np.vstack([robot.home, robot.forward(q).pose])).drive
    way = np.abs(np.diff(drives, axis=0)).max(axis=1).sum()
    plan = pk.plan_poses(robot, robot.forward(q).pose, 8, kind="height", free="offset*")
    assert plan.travel == pytest.approx(way, rel=1e-9) and way < 5000, "mm, no steps"


def test_a_printer_that_is_imported_stays_over_its_bed(tmp_path: Path) -> None:
    printer = pk.import_printer(PRINTER)
    robot = printer.robot
    (tmp_path / "robot.toml").write_text(printer.text, "utf-8")
    for each in (robot, pk.load(tmp_path / "robot.toml")):
        poses = pk.sample_poses(each, 100, share=1.0)
        ends = robot.inverse([0, 0, 0, 0, 0, 0]) * 0.0  # steps at the end stops
        high = robot.forward(ends).pose[2]
        assert poses[:, 2].min() >= 0.0 and poses[:, 2].max() <= high
        narrow = robot.model.workspace["z"][1]  # from there on the firmware narrows the radius
        assert 0.9 * narrow < poses[:, 2].max() <= narrow < high


def test_counts_are_read_as_mm_as_well(tmp_path: Path) -> None:
    q = np.array([[34192.0, 100.5]])
    for written in ("counts", "mm"):
        write_commands(tmp_path / "q.csv", (written,) * 2, q)
        assert (read_commands(tmp_path / "q.csv", ("counts",) * 2) == q).all()
    write_commands(tmp_path / "q.csv", ("counts",) * 2, q)
    with pytest.raises(pk.FileError, match="counts"):
        read_commands(tmp_path / "q.csv", ("mm",) * 2)
