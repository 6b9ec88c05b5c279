"""M665 and M666 of RepRapFirmware and of Marlin: their published models go where the robot goes."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk

from .. import robots


def delta() -> pk.Robot:
    """Every number of its own that the firmwares have."""
    limbs: list[dict[str, Any]] = []
    for angle, rod, offset in ((210.4, 339.0, 600.0), (329.5, 340.0, 601.5), (90.2, 340.6, 600.7)):
        limbs.append(
            {"base": robots.ring(160.0, angle), "rod": rod, "offset": offset, "gain": -1.0}
        )
    return with_probe(robots.linear_delta(*limbs))


def with_probe(robot: pk.Robot, x: float = 12.0, y: float = -7.0, z: float = 1.7) -> pk.Robot:
    """With a bed probe that triggers when the nozzle is z above the bed."""
    return pk.Robot(replace(robot.model, probe=np.array([x, y, z])))


def words(text: str, command: str) -> dict[str, list[float]]:
    (line,) = re.findall(rf"^{command} (.*)", text, re.MULTILINE)
    pairs = re.findall(r"([A-Z])(\S+)", line)
    return {letter: [float(each) for each in value.split(":")] for letter, value in pairs}


def towers_of(size: dict[str, list[float]]) -> Any:
    """As in Recalc() of RepRapFirmware; Marlin's recalc_delta_settings() says the same."""
    (r,) = size["R"]
    x, y, z = (np.radians(size[letter][0]) for letter in "XYZ")
    third = np.pi / 6
    return np.array(
        [
            [-r * np.cos(third + x), -r * np.sin(third + x)],
            [r * np.cos(third - y), -r * np.sin(third - y)],
            [-r * np.sin(z), r * np.cos(z)],
        ]
    )


def reprap_model(text: str, nozzle: Any) -> Any:
    """How far each carriage stands below its switch: homed carriage heights less Transform()."""
    size, ends = words(text, "M665"), words(text, "M666")
    arms, (r,), (homed,) = np.array(size["L"]), size["R"], size["H"]
    adjustment = np.array([ends[letter][0] for letter in "XYZ"])
    assert abs(adjustment.mean()) < 1e-6  # as the firmware normalizes them
    assert ends["A"] == ends["B"] == [0.0]  # no tilt of the bed that was set before stays in force
    switch = homed + np.sqrt(arms**2 - r**2) + adjustment
    across = ((nozzle[:, None, :2] - towers_of(size)) ** 2).sum(axis=2)
    return switch - (np.sqrt(arms**2 - across) + nozzle[:, 2:3])


def marlin_model(text: str, nozzle: Any) -> Any:
    """The same of Marlin: homing moves each carriage from its switch by its adjustment."""
    size, ends = words(text, "M665"), words(text, "M666")
    (rod,), (r,), (height,) = size["L"], size["R"], size["H"]
    height -= words(text, "M851")["Z"][0]  # set_axis_is_at_home(), where there is a bed probe
    arms = rod + np.array([size[letter][0] for letter in "ABC"])
    adjustment = np.array([ends[letter][0] for letter in "XYZ"])
    assert adjustment.max() <= 0.0  # it cannot go beyond the switch
    after_homing = height + np.sqrt(arms**2 - r**2)
    across = ((nozzle[:, None, :2] - towers_of(size)) ** 2).sum(axis=2)
    return after_homing - adjustment - (np.sqrt(arms**2 - across) + nozzle[:, 2:3])


MODELS = {"reprap": reprap_model, "marlin": marlin_model}


@pytest.mark.parametrize("firmware", MODELS)
def test_published_model_moves_the_carriages_as_the_robot(firmware: str, tmp_path: Path) -> None:
    robot, out = delta(), tmp_path / "config.g"
    loss = getattr(pk.export, firmware)(robot, out)
    assert loss.exact
    nozzle = np.random.default_rng(1).uniform([-80, -80, 0], [80, 80, 200], (50, 3))
    down = MODELS[firmware](out.read_text(), nozzle)
    want = robot.inverse(np.pad(nozzle, ((0, 0), (0, 3))))
    np.testing.assert_allclose(down, want, rtol=0, atol=1e-5)  # six decimals


@pytest.mark.parametrize("firmware", MODELS)
def test_what_is_written_is_read_back(firmware: str, run: Any, tmp_path: Path) -> None:
    robot, out = delta(), tmp_path / "config.g"
    robot.save(tmp_path / "delta.toml")
    arguments = ("--as", firmware, "--out", out)
    assert run("export", tmp_path / "delta.toml", *arguments).exit_code == 0
    done = run("import", out, "--from", firmware, "--out", tmp_path / "made")
    assert done.exit_code == 0 and "no stored heights" in done.stdout
    again = pk.load(tmp_path / "made" / "robot.toml")
    poses = np.zeros((20, 6))
    poses[:, :3] = np.random.default_rng(2).uniform([-80, -80, 0], [80, 80, 200], (20, 3))
    found = again.forward(robot.inverse(poses)).pose
    np.testing.assert_allclose(found, poses, rtol=0, atol=1e-5)


OWN = """\
; Dre\xfcs config.g
M569 P0 S1 ; drive 0 goes forwards
M665 L250 R125.0 B85 H300.00 ; set delta radius and the rest
M665 X0.5 (left) Z-0
m666 x-0.2 Y0.1
M208 Z-0.2 S1 ; M665 L1 R1
"""


def test_users_config_is_kept_but_for_changed_numbers(run: Any, tmp_path: Path) -> None:
    """What it is read to is what was exported, and what is the same stays as it was written."""
    file, out = tmp_path / "config.g", tmp_path / "new.g"
    for newline in ("\n", "\r\n"):
        text = OWN.replace("\n", newline).encode("latin-1")
        file.write_bytes(text)
        robot = pk.import_printer(file, "reprap").robot
        pk.export.reprap(robot, out, config=file)
        assert out.read_bytes() == text
        out.unlink()
        g = robot.geometry
        height = g["offset1"] - np.sqrt(250.0**2 - 125.0**2)
        changes = {"radius": 125.6, "angle2": g["angle2"] + np.radians(0.25), "rod3": 250.4}
        for i, rod in ((1, 250.0), (2, 250.0), (3, 250.4)):  # the same heights at the switches
            changes[f"offset{i}"] = height + np.sqrt(rod**2 - 125.6**2)
        better = robot.replace(changes | {"offset2": changes["offset2"] + 0.3 + 0.2})
        better = better.replace({"offset3": better.geometry["offset3"] + 0.2})
        better.save(tmp_path / "better.toml")
        arguments = ("export", tmp_path / "better.toml", "--as", "reprap", "--config", file)
        assert run(*arguments, "--out", out).exit_code == 0
        want = text.replace(b"L250", b"L250.000000:250.000000:250.400000")
        want = want.replace(b"R125.0", b"R125.600000").replace(b"H300.00", b"H300.066667")
        want = want.replace(b"Z-0" + newline.encode(), b"Z-0 Y0.250000" + newline.encode())
        want = want.replace(b"x-0.2 Y0.1", b"x-0.266667 Y0.233333 Z-0.066667")
        assert out.read_bytes() == want
        again = pk.import_printer(out, "reprap").robot.geometry
        for name in ("radius", "rod1", "rod3", "angle1", "angle2", "offset1", "offset2", "offset3"):
            assert again[name] == pytest.approx(better.geometry[name], abs=2e-6)
        out.unlink()
    file.write_text("M665 L250 R125 H300\n")
    with pytest.raises(pk.FileError, match="M666 is missing"):
        pk.export.reprap(robot, out, config=file)
    assert not out.exists()


def test_lines_are_found_as_firmwares_print_them(tmp_path: Path) -> None:
    """Marlin's M503 and a commented config.g; the last command counts, one rod stands for three."""
    (tmp_path / "m503").write_text(
        "echo:  M665 L250.00 R125.00 H300.00 X0.5\necho:  M666 X-0.20\necho:  M851 Z0\n"
    )
    g = pk.import_printer(tmp_path / "m503", "marlin").robot.geometry
    assert (g["rod2"], g["radius"]) == (250.0, 125.0)
    assert g["offset1"] - g["offset2"] == pytest.approx(0.2, abs=1e-12)
    assert np.degrees(g["angle1"]) == pytest.approx(210.5)
    (tmp_path / "config.g").write_text("M665 L1 R2 H3\nM665 L250 R125 H300 B90 ; X9\nM666 Y0.2\n")
    g = pk.import_printer(tmp_path / "config.g", "reprap").robot.geometry
    assert (g["rod1"], g["rod3"]) == (250.0, 250.0)
    assert g["offset2"] - g["offset1"] == pytest.approx(0.2, abs=1e-12)
    assert np.degrees(g["angle1"]) == pytest.approx(210.0)


def test_a_rod_among_three_that_is_no_number_is_named(tmp_path: Path) -> None:
    (tmp_path / "config.g").write_text("M665 L250:25..0:250 R125 H300\nM666 X0\n")
    with pytest.raises(
        pk.FileError, match=r"L of M665 must be 1 or 3 numbers, found '250:25\.\.0:250'"
    ):
        pk.import_printer(tmp_path / "config.g", "reprap")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("M666 X0\n", "M665 is missing"),
        ("M665 L250 H300\nM666 X0\n", "R of M665 is missing"),
        ("M665 L100 R125 H300\nM666 X0\n", "longer than R"),
        ("M665 L250 R1.2.3 H300\nM666 X0\n", "R of M665 must be a number"),
        ("M665 L250 R1.2e2 H300\nM666 X0\n", "R of M665 must be a number, found '1.2e2'"),
        ("M665 L250 R125 H300\nM666 X{-0.2}\n", r"X of M666 must be a number, found '\{-0.2}'"),
        ("\nM665 L250 R125 ?\nM666 X0\n", "line 2: .*: M665 must have words alone"),
        ("M665 L250 R125 H300 M666 X1\nM666 Y0\n", "line 1: .*: M665 must be alone in its line"),
        ("M665 L250 R125 H300\nM666 X0\nM84 M666 X1\n", "line 3: .*: M666 must begin its line"),
        ("M665 L250 R125 R126 H300\nM666 X0\n", "line 1: .*: M665 must have R once"),
        (
            "if exists(var.a)\n  G4 P1\n\n  M665 L250 R125 H300\nelse\n  M665 L250 R120 H300\n",
            "line 4: .*: M665 under a condition",
        ),
    ],
)
def test_mistakes_are_named(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "config.g").write_text(text + "M851 Z0\n")
    for firmware in ("reprap", "marlin"):
        with pytest.raises(pk.FileError, match=message):
            pk.import_printer(tmp_path / "config.g", firmware)  # type: ignore[arg-type]


@pytest.mark.parametrize("firmware", MODELS)
@pytest.mark.parametrize(
    "text",
    [
        "m665 l250 r125 h300 x0.5\nm666 y-0.2\n",
        "N1 M665 L250 R125 H300 X0.5 *77\r\nN2 M666 Y-0.2*12\r\n",
        "\ufeffM665 L250 R125 H300 (as M665 R9) X0.5 ; R8\nM666 Y-0.2\n; M666 Y9\n",
        "M665 L250 H300\nM665 R125 X0.5\nM666 Y-0.2\nM666 Z0\n",  # each sets what it names
        "M665 L 250 R 125 H300 X.5\n  M666 Y-.2\n",
        'if true\n  G4\nM665 L250 R125 H300 X0.5\n  M666 Y-0.2\nM117 M666 X9\nM98 P"M665.g"\n',
        "12:01 < echo:  M665 L250 R125 H300 X0.5\n12:01 < echo:  M666 Y-0.2\n",
    ],
)
def test_settings_are_found_however_they_are_written(
    text: str, firmware: str, tmp_path: Path
) -> None:
    head = b"; D\xfcse\n"[: 9 * (text[0] != "\ufeff")]
    (tmp_path / "config.g").write_bytes(head + f"{text}M851 Z0\n".encode())
    g = pk.import_printer(tmp_path / "config.g", firmware).robot.geometry  # type: ignore[arg-type]
    assert (g["rod1"], g["radius"]) == (250.0, 125.0)
    assert np.degrees(g["angle1"]) == pytest.approx(210.5)
    lower = g["offset2"] - g["offset1"]
    assert lower == pytest.approx(-0.2 if firmware == "reprap" else 0.2, abs=1e-12)


def test_what_a_robot_file_cannot_hold_is_no_silent_zero(tmp_path: Path) -> None:
    """A tilt of the bed, inches, and adjustments beyond the switch."""
    for firmware, text, message in (
        (
            "reprap",
            "M665 L250 R125 H300\nM666 X0.1 A0 B-1.5\n",
            "B of M666 tilts the bed by -1.5 %",
        ),
        ("marlin", "G20\nM665 L10 R5 H12\nM666 X0\n", "stands behind G20, in inches"),
        ("marlin", "M665 L250 R125 H300\nM666 X0.2\nM851 Z0\n", "must not be above 0, found 0.2"),
        (
            "marlin",
            "M665 L250 R125 H300\nM666 X0\n",
            "M851 is missing: with a bed probe",
        ),
        ("marlin", "M665 L250 R125 H300\nM666 X0\nM851 X1\n", "Z of M851 is missing"),
        (
            "reprap",
            "M665 L250 R125 H100000000000000000000\nM666 X0\n",
            r"c\.g: its numbers .* home\.z: must be at",
        ),
    ):
        (tmp_path / "c.g").write_text(text)
        with pytest.raises(pk.FileError, match=message):
            pk.import_printer(tmp_path / "c.g", firmware)  # type: ignore[arg-type]


def test_leaning_towers_are_refused(tmp_path: Path) -> None:
    for firmware in MODELS:
        leaning = delta().replace({"slider2.tilt2": 0.004})
        with pytest.raises(pk.ArgumentError, match="vertical towers"):
            getattr(pk.export, firmware)(leaning, tmp_path / "x")
        assert not (tmp_path / "x").exists()
        assert not getattr(pk.export, firmware)(leaning, tmp_path / "x", project=True).exact
        (tmp_path / "x").unlink()


def rotary(**changes: float) -> pk.Robot:
    """Heights of its own for every shoulder, end stops above the horizontal, angles upwards."""
    limbs: list[dict[str, Any]] = []
    for angle, crank, rod, z, zero in (
        (210.5, 170.0, 400.0, 520.0, 0.6),
        (329.0, 170.5, 401.0, 521.0, 0.61),
        (90.0, 169.5, 399.5, 519.5, 0.59),
    ):
        limbs.append(
            {
                "kind": "RUS",
                "base": robots.ring(180.0, angle, z),
                "platform": [0.0, 0.0, 0.0],
                "crank": crank,
            }
            | {"rod": rod, "offset": zero, "axis": robots.ring(-1.0, angle + 90.0), "gain": -1.0}
            | {"zero": robots.ring(1.0, angle), "branch": -1}
        )
    return robots.made("translation", {"z": 150.0}, limbs).replace(changes)


def reprap_rotary_model(text: str, nozzle: Any) -> Any:
    """How far each crank stands below its switch, deg: Transform() of RepRapFirmware."""
    size, ends = words(text, "M669"), words(text, "M666")
    (radius,), (_, greatest) = size["R"], size["A"]
    arms, rods, heights = (np.array(size[letter]) for letter in "ULH")
    towers = np.radians([-150.0, -30.0, 90.0]) + np.radians([size[axis][0] for axis in "XYZ"])
    x = nozzle[:, :1] * np.cos(towers) + nozzle[:, 1:2] * np.sin(towers)
    y = nozzle[:, 1:2] * np.cos(towers) - nozzle[:, :1] * np.sin(towers)
    out, up = radius - x, heights - nozzle[:, 2:]
    a, b = 2.0 * arms * out, 2.0 * arms * up
    c = rods**2 - arms**2 - up**2 - out**2 - y**2
    sine = (b * c - a * np.sqrt(a**2 + b**2 - c**2)) / (a**2 + b**2)
    adjustment = np.array([ends[axis][0] for axis in "XYZ"])
    return greatest + adjustment - np.degrees(np.arcsin(sine))


def test_cranks_go_where_the_model_of_reprap_says_and_are_read_back(tmp_path: Path) -> None:
    robot = rotary()
    loss = pk.export.reprap(robot, tmp_path / "delta.g")
    assert loss.exact
    text = (tmp_path / "delta.g").read_text()
    assert text.startswith("M669 K10 U170.000000:170.500000:169.500000 L400.000000:")
    nozzle = np.random.default_rng(1).uniform([-60, -60, 100], [60, 60, 200], (40, 3))
    poses = np.pad(nozzle, ((0, 0), (0, 3)))
    down = np.degrees(robot.inverse(poses))
    np.testing.assert_allclose(reprap_rotary_model(text, nozzle), down, rtol=0, atol=1e-5)
    again = pk.import_printer(tmp_path / "delta.g", "reprap")
    assert str(again) == "delta: a rotary delta, no stored heights"
    np.testing.assert_allclose(again.robot.inverse(poses), robot.inverse(poses), atol=1e-7)
    own = text.replace("A-90.000000", "A-35.5").replace(" X0.5", " X+0.5")
    (tmp_path / "own.g").write_text(own)
    pk.export.reprap(robot, tmp_path / "new.g", config=tmp_path / "own.g")
    assert (tmp_path / "new.g").read_text() == own
    with pytest.raises(pk.ArgumentError, match="one radius and one height"):
        pk.export.klipper(robot, tmp_path / "x.cfg")
    with pytest.raises(pk.ArgumentError, match="one radius, and cranks"):
        pk.export.reprap(rotary(**{"axis1.tilt2": 0.003}), tmp_path / "x.g")
    with pytest.raises(pk.ArgumentError, match="no linear delta"):
        pk.export.marlin(robot, tmp_path / "x.g")
    (tmp_path / "delta.g").write_text(text.replace("R180", "P180"))
    with pytest.raises(pk.FileError, match="R of M669 is missing"):
        pk.import_printer(tmp_path / "delta.g", "reprap")
