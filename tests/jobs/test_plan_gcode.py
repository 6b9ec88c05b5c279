"""G-code of a plan: what it drives is what was planned, read without the code that wrote it."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.exceptions import ArgumentError
from pkmcal.jobs import planning
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.plan import Planning
from pkmcal.measurements.pose_csv import read_poses

PRINTER = Path(__file__).parents[2] / "examples" / "linear-delta" / "printer.cfg"
MOVE = re.compile(r"G1 ((?:[XYZABC]-?\d+\.\d+ )+)F1500")


@pytest.fixture(scope="module")
def printer(tmp_path_factory: pytest.TempPathFactory) -> str:
    file = tmp_path_factory.mktemp("printer") / "robot.toml"
    file.write_text(pk.import_printer(PRINTER).text)
    return str(file)


def written(tmp_path: Path, robot: str, **asked: Any) -> tuple[list[str], np.ndarray, pk.Robot]:
    """Lines of the program, the poses of the plan's own table, and the machine."""
    job = Planning(robot, count=8, **asked)
    made = planning.run(job, Inputs())
    planning.write(job, made, tmp_path, "# Written by a test\n")
    (program,) = (each for each in tmp_path.iterdir() if each.suffix in (".gcode", ".ngc"))
    assert program.name in planning.files(job)
    machine = pk.load(robot)
    assert isinstance(machine, pk.Robot)
    return program.read_text().splitlines(), read_poses(tmp_path / "poses.csv", machine), machine


def driven(lines: list[str], letters: str) -> list[tuple[np.ndarray, list[str]]]:
    """Places it goes to, mm and deg, each with the other lines until the next one."""
    found: list[tuple[np.ndarray, list[str]]] = []
    for line in lines:
        if match := MOVE.fullmatch(line):
            words = match[1].split()
            assert [each[0] for each in words] == list(letters)
            found.append((np.array([float(each[1:]) for each in words]), []))
        elif found and not line.startswith(";"):
            found[-1][1].append(line)
    return found


@pytest.mark.parametrize("firmware", ["klipper", "reprap", "marlin"])
def test_a_printer_stops_at_each_planned_pose(tmp_path: Path, printer: str, firmware: str) -> None:
    lines, poses, _ = written(tmp_path, printer, gcode=firmware, dwell=2.5)
    code = [line for line in lines if not line.startswith(";")]
    assert "G28" in code[:2] and "G90" in code[:3]  # homed, and absolute, before it moves
    stops = [at for at, then in driven(lines, "XYZ") if then == ["M400", "G4 P2500"]]
    np.testing.assert_allclose(stops, poses[:, :3], atol=2e-5)
    assert [line for line in lines if "pose 3 of 8" in line]


@pytest.mark.parametrize(
    ("firmware", "word"), [("klipper", "PROBE"), ("reprap", "G30 S-1"), ("marlin", "G30 X")]
)
def test_a_probe_works_above_each_place_and_nothing_is_dragged_over_the_bed(
    tmp_path: Path, printer: str, firmware: str, word: str
) -> None:
    lines, poses, _ = written(tmp_path, printer, gcode=firmware, kind="probe", safe_height=7.0)
    moves = driven(lines, "XYZ")
    probed = [(at, then) for at, then in moves if then]
    np.testing.assert_allclose([at for at, _ in probed], poses[:, :3] + [0, 0, 7.0], atol=2e-5)
    assert all(len(then) == 1 and then[0].startswith(word) for _, then in probed)
    assert min(at[2] for at, _ in moves) == 7.0
    # what follows a probe goes straight up from there before it goes on
    for (at, then), (after, _) in pairwise(moves):
        if then and after[2] == 7.0:
            assert (after == at).all()


def test_linuxcnc_turns_the_platform_too_and_does_not_home(tmp_path: Path) -> None:
    lines, poses, _ = written(tmp_path, "hexapod", gcode="linuxcnc", dwell=3.0)
    code = [line for line in lines if not line.startswith(";")]
    assert code[0] == "G21 G90 G94" and code[-1] == "M2" and not any("G28" in x for x in code)
    stops = [at for at, then in driven(lines, "XYZABC") if then == ["G4 P3"]]
    np.testing.assert_allclose(np.array(stops)[:, :3], poses[:, :3], atol=2e-5)
    np.testing.assert_allclose(np.array(stops)[:, 3:], np.degrees(poses[:, 3:]), atol=2e-5)


@pytest.mark.parametrize("height", [None, 40.0])
def test_every_way_stays_within_the_limits(
    tmp_path: Path, printer: str, height: float | None
) -> None:
    lines, _, robot = written(tmp_path, printer, gcode="klipper", safe_height=height)
    places = [at for at, _ in driven(lines, "XYZ")]
    for begin, end in pairwise(places):
        way = np.zeros((50, 6))
        way[:, :3] = begin + np.linspace(0, 1, 50)[:, None] * (end - begin)
        assert robot.feasible(way).ok.all()
        if height is not None:  # below it, it goes up and down alone
            across = np.hypot(*(end - begin)[:2]) > 0
            assert not across or min(begin[2], end[2]) >= height


@pytest.mark.parametrize(
    ("robot", "asked", "said"),
    [
        ("hexapod", {"gcode": "klipper"}, "drives x, y and z alone, and hexapod moves x, y, z, a"),
        ("hexapod", {"gcode": "klippr"}, "did you mean 'klipper'"),
        ("linear-delta", {"gcode": "klipper", "dwell": -1.0}, "--dwell must be from 0 to 3600"),
        ("linear-delta", {"gcode": "klipper", "dwell": float("inf")}, "--dwell must be"),
        ("linear-delta", {"gcode": "linuxcnc", "kind": "probe"}, "no probe"),
        ("linear-delta", {"gcode": "klipper", "safe_height": 5000.0}, "leaves the limits"),
        ("linear-delta", {"gcode": "klipper", "safe_height": 1e300}, "leaves the limits"),
        ("linear-delta", {"gcode": "klipper", "safe_height": float("nan")}, "--safe-height must"),
        ("linear-delta", {"gcode": "klipper", "safe_height": float("inf")}, "--safe-height must"),
    ],
)  # fmt: skip
def test_what_a_program_cannot_say_is_refused(
    tmp_path: Path, robot: str, asked: dict[str, Any], said: str
) -> None:
    job = Planning(robot, count=4, **asked)
    with pytest.raises(ArgumentError, match=said):
        planning.files(job)
        planning.write(job, planning.run(job, Inputs()), tmp_path, "")
