"""A printer's probe: the right sign finds the machine, and the wrong ones are not silent."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.arrays import FloatArray

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "linear-delta" / "robot.toml"
FIRMWARE = pk.load(EXAMPLE)
TRUE = FIRMWARE.replace({
    "radius": 171.35, "angle1": np.radians(209.8), "offset1": 624.4, "offset2": 625.5,
})  # fmt: skip
GRID = [(x, y) for x in range(-80, 81, 40) for y in range(-80, 81, 40) if x * x + y * y < 1e4]
OFFSET = np.array([12.0, -7.0, 1.5])
ITSELF = np.zeros(3)  # the nozzle is the probe


def nozzle(robot: pk.Robot, q: FloatArray) -> FloatArray:
    return robot.forward(q).pose[0, :3]


def triggers(offset: FloatArray) -> FloatArray:
    """What the firmware reports: its own z at which the true nozzle is z_offset above the bed."""
    found = []
    for x, y in GRID:
        low, high = -10.0, 10.0
        for _ in range(60):
            z = (low + high) / 2
            q = FIRMWARE.inverse([[x, y, z, 0, 0, 0]])
            low, high = (z, high) if nozzle(TRUE, q)[2] < offset[2] else (low, z)
        found.append((x, y, z))
    return np.array(found)


def off(found: pk.Identification) -> float:
    """How much the true nozzle leaves a plane when the calibrated robot commands one, mm."""
    heights = []
    for x, y in GRID:
        q = found.robot.inverse([[x, y, 20.0, 0, 0, 0]])
        heights.append(nozzle(TRUE, q)[2])
    return float(np.ptp(heights))


def file(folder: Path, heads: str, rows: FloatArray) -> Path:
    path = folder / "probe.csv"
    lines = [heads, *(",".join(f"{v:.6f}" for v in row) for row in rows)]
    path.write_text("\n".join(lines))
    return path


@pytest.mark.parametrize("offset", [np.zeros(3), OFFSET], ids=["at the nozzle", "beside it"])
def test_the_points_of_a_probe_find_the_machine(offset: FloatArray, tmp_path: Path) -> None:
    path = file(tmp_path, "x [mm],y [mm],probe [mm]", triggers(offset))
    m = pk.read_measurements(path, FIRMWARE, probe_offset=offset)
    assert "taken as the firmware's z when the probe triggered" in m.notes[0]
    assert off(pk.identify(FIRMWARE, m)) < 1e-3
    assert off(pk.identify(FIRMWARE, m.select(slice(0, 1)), prior=0.001)) > 0.3  # as it was


def test_the_lines_of_a_log_are_read_as_they_stand(tmp_path: Path) -> None:
    points = triggers(np.zeros(3))
    path = tmp_path / "klippy.log"
    lines = [f"// probe at {x:.3f},{y:.3f} is z={z:.6f}" for x, y, z in points]
    path.write_text("Send: PROBE\n" + "\necho: something\n".join(lines))
    m = pk.read_measurements(path, FIRMWARE, probe_offset=ITSELF)
    expected = pk.probed(FIRMWARE, points, offset=ITSELF).actuators
    np.testing.assert_allclose(m.actuators, expected, atol=1e-5)
    path.write_text("\n".join(f"Bed X: {x:.3f} Y: {y:.3f} Z: {z:.6f}" for x, y, z in points))
    again = pk.read_measurements(path, FIRMWARE, probe_offset=ITSELF)
    np.testing.assert_array_equal(again.actuators, m.actuators)


def test_actuators_beside_a_probe_have_to_be_those_of_the_trigger(tmp_path: Path) -> None:
    """The second trap: actuators of the flat x, y, 0 beside the height of the mesh."""
    points = triggers(np.zeros(3))
    heads = "q1 [mm],q2 [mm],q3 [mm],probe [mm]"
    poses = np.column_stack([points, np.zeros_like(points)])
    right = np.column_stack([FIRMWARE.inverse(poses), points[:, 2]])
    m = pk.read_measurements(file(tmp_path, heads, right), FIRMWARE, probe_offset=ITSELF)
    assert off(pk.identify(FIRMWARE, m)) < 1e-3
    flat = poses * [1, 1, 0, 1, 1, 1]
    wrong = np.column_stack([FIRMWARE.inverse(flat), points[:, 2]])
    with pytest.raises(pk.FileError, match="have to be those at which the probe triggered"):
        pk.read_measurements(file(tmp_path, heads, wrong), FIRMWARE, probe_offset=ITSELF)


def test_heights_that_the_robot_file_gives_itself_are_warned_of(tmp_path: Path) -> None:
    """The first trap: actuators of the trigger, and the firmware's z there as a height."""
    points = triggers(np.zeros(3))
    q = FIRMWARE.inverse(np.column_stack([points, np.zeros_like(points)]))
    path = file(tmp_path, "q1 [mm],q2 [mm],q3 [mm],z [mm]", np.column_stack([q, points[:, 2]]))
    with pytest.warns(pk.CalibrationWarning, match="those that the robot file itself gives"):
        pk.read_measurements(path, FIRMWARE)


def test_the_sign_of_a_height_over_a_flat_command_is_said(tmp_path: Path) -> None:
    """Nothing in the numbers tells it: a dial indicator that reads up is right."""
    x, y = np.array(GRID, dtype=float).T
    q = FIRMWARE.inverse(np.column_stack([x, y, *np.zeros((4, len(x)))]))
    heights = [nozzle(TRUE, row[None])[2] for row in q]
    path = file(tmp_path, "q1 [mm],q2 [mm],q3 [mm],z [mm]", np.column_stack([q, heights]))
    m = pk.read_measurements(path, FIRMWARE)
    assert "measured height of the nozzle, up" in m.notes[0]
    assert off(pk.identify(FIRMWARE, m)) < 1e-3


def test_a_probe_without_its_machine_is_refused(tmp_path: Path) -> None:
    path = file(tmp_path, "x [mm],y [mm],probe [mm]", triggers(np.zeros(3)))
    with pytest.raises(pk.FileError, match="give the robot, as the firmware had it"):
        pk.read_measurements(path)
    with pytest.raises(pk.ArgumentError, match="does not reach"):
        pk.probed(FIRMWARE, [[0, 0, 0], [1000, 0, 0]], offset=ITSELF)
    with pytest.raises(pk.ArgumentError, match="offset must"):
        pk.probed(FIRMWARE, [[0, 0, 0]], offset=[1, 2])


@pytest.mark.parametrize("line", ["// probe at 0,0 is z=0.1", "Bed X: 0 Y: 0 Z: 0.1"])
def test_an_offset_that_is_stated_nowhere_is_asked_for(line: str, tmp_path: Path) -> None:
    """Taken as 0 it would move the end stops by the height at which the probe triggers."""
    path = tmp_path / "log.txt"
    path.write_text(line)
    for read in (
        lambda robot: pk.read_measurements(path, robot),
        lambda robot: pk.probed(robot, [[0, 0, 0.1]]),
    ):
        with pytest.raises(pk.Error, match=r"offset is stated nowhere: .*--probe-offset X,Y,Z"):
            read(FIRMWARE)
        stated = pk.Robot(replace(FIRMWARE.model, probe=OFFSET))
        np.testing.assert_allclose(read(stated).targets[0], [12.0, -7.0, -1.5])
    with pytest.raises(pk.Error, match=r"found -1\.7 mm; it is -Z of Marlin's M851"):
        pk.read_measurements(path, FIRMWARE, probe_offset=[0, 0, -1.7])


def test_heights_that_a_file_was_calibrated_with_are_not_warned_of(tmp_path: Path) -> None:
    """They agree with it as well as the probe repeats; carriages of a firmware, to its steps."""
    measured = pk.read_measurements(EXAMPLE.parent / "probe.csv", FIRMWARE)
    calibrated = pk.identify(FIRMWARE, measured).robot
    again = pk.read_measurements(EXAMPLE.parent / "probe.csv", calibrated)  # no warning
    assert "unless it was calibrated with them" in again.notes[0] and not measured.notes


def test_where_the_nozzle_would_touch_is_where_the_probe_triggered(tmp_path: Path) -> None:
    """Klipper's newer lines have its offsets of the probe taken in: x, y added, z taken off."""
    points = triggers(OFFSET)
    path = tmp_path / "klippy.log"
    old = [f"// probe at {x:.3f},{y:.3f} is z={z:.6f}" for x, y, z in points]
    path.write_text("\n".join(old))
    m = pk.read_measurements(path, FIRMWARE, probe_offset=OFFSET)
    beds = points + OFFSET * [1, 1, -1]
    new = [f"// probe: at {x:.3f},{y:.3f} bed will contact at z={z:.6f}" for x, y, z in beds]
    result = ["// Result: at 1.000,2.000 estimate contact at z=3.000000", *new]
    marlin = [f"Bed X: {x:.3f} Y: {y:.3f} Z: {z:.6f}" for x, y, z in beds]
    for lines in (marlin, result):
        path.write_text("\n".join(lines))
        again = pk.read_measurements(path, FIRMWARE, probe_offset=OFFSET)
        np.testing.assert_allclose(again.actuators, m.actuators, atol=1e-5)
        np.testing.assert_allclose(again.targets, m.targets)
        assert "12, -7, 1.5 mm, of --probe-offset" in again.notes[-1]
    assert off(pk.identify(FIRMWARE, again)) < 1e-3
    path.write_text("\n".join(old + new))
    with pytest.raises(pk.FileError, match="in another way than in line 1: make two files"):
        pk.read_measurements(path, FIRMWARE)


def test_an_offset_of_a_probe_beside_other_readings_is_said_to_have_no_effect(
    tmp_path: Path,
) -> None:
    file = tmp_path / "heights.csv"
    file.write_text("q1 [mm],q2 [mm],q3 [mm],z [mm]\n1,2,3,4\n")
    robot = pk.load("linear-delta")
    assert any(
        "offset of the probe" in note
        for note in pk.read_measurements(file, robot, probe_offset=[1, 2, 3]).notes
    )
    assert not any("offset" in note for note in pk.read_measurements(file, robot).notes)
