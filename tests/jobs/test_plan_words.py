"""Every word of a plan's program is one of its firmware, and leads where the plan says.

Three readers tell it that know nothing of what writes these programs: the tables by which pkmcal
follows other people's programs, interpreters written from the firmwares' documents, and LinuxCNC's
own (``make test-linuxcnc``).
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from importlib.resources import files
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.core.library import POSE
from pkmcal.exceptions import ArgumentError
from pkmcal.files.provenance import comment
from pkmcal.jobs.plan import GCODE, Planning
from pkmcal.jobs.plan_gcode import FIRMWARES, program
from pkmcal.planning.plan_poses import Plan

from ..compensation import reads_klipper, reads_linuxcnc, reads_marlin, reads_reprap
from ..compensation.controller import HIDDEN, Controller

FOLDER = files("pkmcal.builtin").joinpath("machines")
NOWHERE = "rbt-6t03p-printed.toml"  # its home is singular
MACHINES = sorted(
    each.name.removesuffix(".toml")
    for each in FOLDER.iterdir()
    if each.name.endswith(".toml") and each.name != NOWHERE
)
PRINTER = Path(__file__).parents[2] / "examples" / "linear-delta" / "printer.cfg"
TRANSLATIONS = ("x", "y", "z")
PRINTERS = ("klipper", "marlin", "reprap")
READS: dict[str, tuple[ModuleType, tuple[int, ...]]] = {
    "klipper": (reads_klipper, (0, 1)),
    "marlin": (reads_marlin, (1, 2)),
    "reprap": (reads_reprap, (0, 1)),
    "linuxcnc": (reads_linuxcnc, (0,)),
}
PROBES = {"klipper": "PROBE", "marlin": "G30", "reprap": "G30"}
RS274 = shutil.which("rs274") if os.environ.get("LINUXCNC") else None


def machine_of(name: str) -> pk.Robot:
    robot = pk.load(name)
    assert isinstance(robot, pk.Robot)
    return robot


def plan_of(robot: pk.Robot, bed: float | None = None) -> Plan:
    """A plan of poses near home; on the bed where a radius of it is given."""
    if bed is None:
        poses = pk.sample_poses(robot, 5, seed=3, share=0.2)
    else:
        poses = np.tile(np.zeros(6), (5, 1))
        angles = np.linspace(0.0, 5.0, 5)
        poses[:, 0], poses[:, 1] = bed * np.cos(angles), bed * np.sin(angles)
    return Plan(robot, np.arange(5), poses, robot.inverse(poses), 0.1, 0.2, 0.05, 0, ("rod1",))


def text_of(made: Plan, firmware: str, **asked: object) -> str:
    head = comment({"a (named) ü\\.toml": b""})
    return program(Planning("machine", gcode=firmware, **asked), made, head)  # type: ignore[arg-type]


def written() -> list[tuple[str, str]]:
    """Machines and firmwares for which a program is written."""
    return [
        (name, firmware)
        for name in MACHINES
        for firmware in GCODE
        if firmware == "linuxcnc" or machine_of(name).moved == TRANSLATIONS
    ]


def test_other_machines_are_refused_by_what_they_move() -> None:
    for name in set(MACHINES) - {name for name, firmware in written() if firmware == "klipper"}:
        robot = machine_of(name)
        turned = set(robot.moved) - set(TRANSLATIONS)
        if turned:
            with pytest.raises(ArgumentError, match="drives x, y and z alone"):
                text_of(plan_of(robot), "klipper")


@pytest.mark.parametrize(("name", "firmware"), written())
@pytest.mark.parametrize("asked", [{}, {"dwell": 0.0}, {"dwell": 1e-4}])
def test_the_tables_of_words_know_each_of_a_plan(
    tmp_path: Path, name: str, firmware: str, asked: dict[str, float]
) -> None:
    robot = machine_of(name)
    made = plan_of(robot)
    path = tmp_path / "poses.gcode"
    path.write_text(text_of(made, firmware, **asked), encoding="utf-8")
    followed = pk.compensate_program(robot, robot, path, firmware=firmware)  # type: ignore[arg-type]
    assert followed.left == ()
    assert followed.moves >= len(made.poses) + 2  # and home, twice
    assert followed.correction <= 1e-6


@pytest.mark.parametrize("firmware", PRINTERS)
def test_of_a_probes_plan_the_probe_alone_may_move_unseen(tmp_path: Path, firmware: str) -> None:
    robot = printer(tmp_path)
    path = tmp_path / "poses.gcode"
    path.write_text(text_of(plan_of(robot, 60.0), firmware, kind="probe"), encoding="utf-8")
    followed = pk.compensate_program(robot, robot, path, firmware=firmware)  # type: ignore[arg-type]
    assert {each.partition(" (")[0] for each in followed.left} <= {PROBES[firmware]}
    assert followed.correction <= 1e-6


def printer(folder: Path) -> pk.Robot:
    file = folder / "robot.toml"
    file.write_text(pk.import_printer(PRINTER).text)
    return machine_of(str(file))


def stops(ran: Controller) -> list[tuple[tuple[float, ...], str]]:
    """Where it stood when it did something else than to move, once a place, and what."""
    found: list[tuple[tuple[float, ...], str]] = []
    at = None
    for step in ran.steps:
        if step.moves:
            at = step.at
        elif at is not None and not step.did.startswith(("M400", "M2", "LEFTING93")):
            found.append((at, step.did))
    return found


@pytest.mark.parametrize(("name", "firmware"), [
    (name, firmware) for name, firmware in written()
    if machine_of(name).moved == TRANSLATIONS
])  # fmt: skip
def test_the_firmwares_documents_lead_to_each_pose_and_wait_there(name: str, firmware: str) -> None:
    robot = machine_of(name)
    made = plan_of(robot)
    reads, versions = READS[firmware]
    home = dict(zip("XYZ", robot.home[:3].tolist(), strict=True))
    for version in versions:
        ran = reads.run(
            text_of(made, firmware, dwell=2.5), {"X": 1.0, "Y": 2.0, "Z": 3.0}, home, version
        )
        pauses = [(at, did) for at, did in stops(ran) if did.startswith("G4")]
        assert {did for _, did in pauses} == {"G4P2.5" if firmware == "linuxcnc" else "G4P2500"}
        np.testing.assert_allclose([at for at, _ in pauses], made.poses[:, :3], atol=1e-5)
        moved = [step for step in ran.steps if step.moves]
        assert all(step.begin != tuple(HIDDEN.values()) for step in moved)  # nothing unknown
        np.testing.assert_allclose(moved[-1].at, robot.home[:3], atol=1e-5)
        assert len(pauses) == len(stops(ran))


@pytest.mark.parametrize("firmware", PRINTERS)
def test_the_firmwares_documents_lead_a_probe_over_each_place(
    tmp_path: Path, firmware: str
) -> None:
    robot = printer(tmp_path)
    made = plan_of(robot, 60.0)
    reads, versions = READS[firmware]
    text = text_of(made, firmware, kind="probe", safe_height=8.0)
    home = dict(zip("XYZ", robot.home[:3].tolist(), strict=True))
    for version in versions:
        ran = reads.run(text, {"X": 1.0, "Y": 2.0, "Z": 3.0}, home, version)
        probed = stops(ran)
        assert len(probed) == len(made.poses)
        assert all(did.startswith(PROBES[firmware]) for _, did in probed)
        np.testing.assert_allclose(
            [at for at, _ in probed], made.poses[:, :3] + [0, 0, 8.0], atol=1e-5
        )
        if firmware == "marlin":  # it goes there itself, with the probe in place of the nozzle
            places = [re.fullmatch(r"G30X(.*)Y(.*)", did) for _, did in probed]
            told = [[float(each[1]), float(each[2])] for each in places if each]
            np.testing.assert_allclose(told, made.poses[:, :2], atol=1e-5)


@pytest.mark.skipif(RS274 is None, reason="LINUXCNC is not set: make test-linuxcnc")
@pytest.mark.parametrize("name", MACHINES)
def test_linuxcncs_own_interpreter_goes_to_each_pose_and_waits_there(
    tmp_path: Path, name: str
) -> None:
    robot = machine_of(name)
    made = plan_of(robot)
    file = tmp_path / f"poses.{FIRMWARES['linuxcnc'].ending}"
    file.write_text(text_of(made, "linuxcnc", dwell=2.5), encoding="utf-8")
    assert RS274 is not None
    done = subprocess.run(
        [RS274, "-g", file], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    said = re.findall(r"\d+ N\.*\s+(\w+)\((.*)\)", done.stdout)
    assert ("USE_LENGTH_UNITS", "CANON_UNITS_MM") in said and ("PROGRAM_END", "") in said
    assert ("SET_FEED_RATE", "1500.0000") in said
    places, waited = [], []
    for word, given in said:
        if word == "STRAIGHT_FEED":
            places.append([float(each) for each in given.split(",")])
        elif word == "DWELL":
            assert float(given) == 2.5
            waited.append(places[-1])
    moved = [POSE.index(axis) for axis in robot.moved]
    meant = np.where(np.arange(6) < 3, made.poses, np.degrees(made.poses))
    np.testing.assert_allclose(np.array(waited)[:, moved], meant[:, moved], atol=1e-4)
    home = np.where(np.arange(6) < 3, robot.home, np.degrees(robot.home))
    for at in (places[0], places[-1]):
        np.testing.assert_allclose(np.array(at)[moved], home[moved], atol=1e-4)
