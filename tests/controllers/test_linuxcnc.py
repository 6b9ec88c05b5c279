"""LinuxCNC runs what is exported: `make test-linuxcnc` installs it; skipped where it is not."""

from __future__ import annotations

import ctypes
import json
import os
import re
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk

from .. import robots
from .c_headers import PARALLEL
from .test_c_header import eight, geared, pulleys

MODULES = Path("/usr/lib/linuxcnc/modules")
SESSION = Path(__file__).with_name("linuxcnc_session.py")
SYSTEM = {"PATH": "/usr/bin:/bin:/usr/sbin:/sbin", "LC_ALL": "C.UTF-8"}
NOBODY = 65534  # LinuxCNC does not run as root
COORDINATES = ("x", "y", "z", "alpha", "beta", "gamma")
needs_linuxcnc = pytest.mark.skipif(
    not os.environ.get("LINUXCNC"), reason="LINUXCNC is not set: make test-linuxcnc"
)
needs_root = pytest.mark.skipif(os.getuid() != 0, reason="installing a component needs root")

FRAMES = {
    "base": {"x": 10.0, "y": -20.0, "z": 30.0, "alpha": 0.1, "beta": -0.2, "gamma": 0.5},
    "tool": {"x": 1.0, "y": 2.0, "z": -40.0, "alpha": -0.3, "beta": 0.1, "gamma": 0.2},
}
CASES = {name: lambda name=name: pk.load(name) for name in PARALLEL if name != "rbt-6t03p-printed"}
CASES["curved laws"] = lambda: robots.hexapod(
    {"drive": {"spool": 75.0, "buildup": -0.1}, "gain": 1 / 70, "stroke": [300.0, 1500.0]},
    {"drive": {"harmonics": [{"k": 0.2, "cos": 0.05, "sin": -0.03}]}, "stroke": [300.0, 1500.0]},
    {"drive": {"table": [[300.0, 0.0], [800.0, 0.3], [900.0, 0.1]]}, "stroke": [300.0, 1500.0]},
)
CASES["pulleys"] = pulleys
CASES["eight pulleys"] = eight
CASES["chains"] = lambda: pk.load("trivariant")
CASES["geared"] = lambda: geared(0.5)
CASES["sled on four belts"] = lambda: robots.made(
    "xy",
    {"x": 1500.0, "y": 1000.0},
    [
        {"kind": "cable", "base": [x, y, 0.0], "platform": [0.0, 0.0, 0.0]}
        for x in (0.0, 3000.0)
        for y in (0.0, 2000.0)
    ],
)
CARRIED = pk.Load(mass=25.0, centre=(10.0, -20.0, 60.0), force=(30.0, 0.0, -80.0))
CASES["loaded"] = lambda: pk.load("hexapod").yielding({"offset*": 1e-4}).carrying(CARRIED)
CASES["loaded 3prs"] = lambda: pk.load("3prs").yielding({"offset*": 1e-4}).carrying(CARRIED)
CASES["loaded cranks"] = lambda: pk.load("6-rus").yielding({"offset*": 1e-6}).carrying(CARRIED)
CASES["framed"] = lambda: robots.hexapod({"offset": 12.0, "gain": -1.01}, frames=FRAMES)


def poses_of(robot: pk.Robot, count: int) -> Any:
    """Poses near home that the machine can take, in thousandths of mm and degrees."""
    moved = np.random.default_rng(5).uniform(-1, 1, (count, 6)) * [15, 15, 15, 4, 4, 4]
    moved[:, :3] = (robot.home[:3] + moved[:, :3]).round(3)
    moved[:, 3:] = np.radians((np.degrees(robot.home[3:]) + moved[:, 3:]).round(3))
    poses = robot.complete(moved)
    assert np.isfinite(poses).all()
    return poses


def in_degrees(robot: pk.Robot, q: Any) -> Any:
    return q * [np.degrees(1.0) if unit == "rad" else 1.0 for unit in robot.actuator_units]


def world(robot: pk.Robot, pose: Any) -> Any:
    """The six world coordinates of LinuxCNC; what is no axis is 0."""
    axes = robot.model.match or robot.coordinates
    full = np.r_[pose[:3], np.degrees(pose[3:])]
    return np.where([name in axes for name in COORDINATES], full, 0.0)


class Component:
    """A compiled component in this process; HAL's library for programs stands in for realtime."""

    def __init__(self, path: Path) -> None:
        ctypes.CDLL("liblinuxcnchal.so.0", mode=ctypes.RTLD_GLOBAL)
        self._library = ctypes.CDLL(str(path))
        assert self._library.rtapi_app_main() == 0
        self._flags = ctypes.c_ulong(0), ctypes.c_ulong(0)

    def __call__(self, name: str, given: Any, written: Any) -> tuple[int, Any]:
        one, other = ((ctypes.c_double * 16)(*row) for row in (given, written))
        flags = [ctypes.byref(flag) for flag in self._flags]
        status = getattr(self._library, name)(one, other, *flags)
        return status, np.array(other[: len(written)])

    def close(self) -> None:
        self._library.rtapi_app_exit()


@needs_linuxcnc
@pytest.mark.parametrize("case", CASES)
def test_component_has_the_joints_and_poses_of_the_robot(case: str, tmp_path: Path) -> None:
    robot = CASES[case]()
    folder = tmp_path / "machine"
    pk.export.linuxcnc(robot, folder)
    command = ["halcompile", "--compile", "pkm_machine.c"]
    subprocess.run(command, cwd=folder, env=SYSTEM, check=True, capture_output=True)
    component = Component(folder / "pkm_machine.so")
    try:
        status, before = component("kinematicsForward", [0.0] * 16, [7.0] * 6)
        if status:  # LinuxCNC asks this before homing
            assert status < 0 and (before == 7.0).all()
        poses = poses_of(robot, 100)
        want = in_degrees(robot, robot.inverse(poses, match=True))
        start = world(robot, robot.home)
        for pose, joints in zip(poses, want, strict=True):
            there = world(robot, pose)
            status, found = component("kinematicsInverse", there, [np.nan] * len(joints))
            assert status == 0
            np.testing.assert_allclose(found, joints, rtol=0, atol=1e-9)
            status, found = component("kinematicsForward", joints, start)
            assert status == 0
            np.testing.assert_allclose(found, there, rtol=0, atol=1e-9)
        status, found = component("kinematicsInverse", [1e300] * 6, [7.0] * 3)
        assert status < 0 and (found == 7.0).all()
    finally:
        component.close()


@pytest.fixture
def linuxcnc() -> Iterator[Any]:
    """Return a function that runs moves in LinuxCNC with an ini file, and gives what it did."""
    home = Path(tempfile.mkdtemp(prefix="linuxcnc-"))  # a socket's path must be short
    home.chmod(0o777)
    installed: list[Path] = []

    def run(ini: Path, module: str, moves: list[str]) -> list[dict[str, Any]]:
        folder = ini.parent
        if (folder / f"{module}.c").exists():
            command = ["halcompile", "--install", f"{module}.c"]
            subprocess.run(command, cwd=folder, env=SYSTEM, check=True, capture_output=True)
            installed.append(MODULES / f"{module}.so")
        own = {"HOME": str(home), "RTAPI_UID": str(NOBODY), "RTAPI_FIFO_PATH": f"{home}/fifo"}
        with open(home / "log", "w") as log:
            machine = subprocess.Popen(
                ["linuxcnc", "-r", ini.name],
                cwd=folder,
                env=SYSTEM | own,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
            )
            try:
                with interface(machine) as connection:
                    done = subprocess.run(
                        ["/usr/bin/python3", SESSION, module],
                        input="\n".join(moves),
                        env=SYSTEM | own,
                        capture_output=True,
                        text=True,
                        timeout=240,
                    )
                    connection.sendall(b"shutdown\r\n")
                    code = machine.wait(60)
            except BaseException as error:
                machine.terminate()
                machine.wait(60)
                raise AssertionError((home / "log").read_text()) from error
        assert done.returncode == 0, done.stderr + (home / "log").read_text()
        assert code == 0, (home / "log").read_text()
        return [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]

    yield run
    for path in installed:
        path.unlink(missing_ok=True)
    shutil.rmtree(home)


def interface(machine: subprocess.Popen[bytes]) -> socket.socket:
    """A connection to linuxcncrsh, the interface that the ini file names, when it has started."""
    end = time.monotonic() + 60
    while True:
        try:
            connection = socket.create_connection(("localhost", 5007), timeout=10)
        except ConnectionRefusedError:
            assert machine.poll() is None and time.monotonic() < end, "LinuxCNC did not start"
            time.sleep(0.1)
        else:
            connection.sendall(b"hello EMC test 1.0\r\nset enable EMCTOO\r\n")
            return connection


def move(robot: pk.Robot, pose: Any) -> str:
    """A program line to a pose."""
    axes = robot.model.match or robot.coordinates
    pairs = zip(COORDINATES, "XYZABC", world(robot, pose), strict=True)
    words = (f"{letter}{value:.3f}" for name, letter, value in pairs if name in axes)
    return f"G1 {' '.join(words)} F3000"


@needs_linuxcnc
@needs_root
@pytest.mark.parametrize("name", ["hexapod", "3prs", "rotary-delta"])
def test_simulation_homes_and_runs_poses(name: str, linuxcnc: Any, tmp_path: Path) -> None:
    robot = pk.load(name)
    pk.export.linuxcnc(robot, tmp_path / "machine")
    poses = poses_of(robot, 20)
    lines = [move(robot, pose) for pose in poses]
    found = linuxcnc(tmp_path / "machine" / "machine.ini", "pkm_machine", lines)
    assert len(found) == 20 and not any(each["failed"] or each["said"] for each in found)
    joints = in_degrees(robot, robot.inverse(poses, match=True))
    np.testing.assert_allclose([each["joints"] for each in found], joints, rtol=0, atol=1e-9)
    want = [world(robot, pose) for pose in poses]
    np.testing.assert_allclose([each["actual"] for each in found], want, rtol=0, atol=1e-9)


@needs_linuxcnc
@needs_root
def test_simulation_runs_poses_under_the_load_of_its_pins(linuxcnc: Any, tmp_path: Path) -> None:
    robot = pk.load("hexapod").yielding({"offset*": 1e-4})
    ini = tmp_path / "machine" / "machine.ini"
    pk.export.linuxcnc(robot, ini.parent)
    pins = {"payload.mass": CARRIED.mass}
    pins |= {f"payload.{axis}": CARRIED.centre[k] for k, axis in enumerate("xyz")}
    pins |= {f"force.{axis}": CARRIED.force[k] for k, axis in enumerate("xyz")}
    lines = [f"setp pkm_machine.{name} {value}" for name, value in pins.items()]
    hal = ini.with_name("machine.hal")
    hal.write_text("\n".join([hal.read_text(), *lines, ""]))
    poses = poses_of(robot, 8)
    found = linuxcnc(ini, "pkm_machine", [move(robot, pose) for pose in poses])
    assert len(found) == 8 and not any(each["failed"] or each["said"] for each in found)
    joints = robot.inverse(poses, load=CARRIED)
    assert np.abs(joints - robot.rigid.inverse(poses)).min(axis=1).max() > 1e-3
    np.testing.assert_allclose([each["joints"] for each in found], joints, rtol=0, atol=1e-9)
    want = [world(robot, pose) for pose in poses]
    np.testing.assert_allclose([each["actual"] for each in found], want, rtol=0, atol=1e-9)


@needs_linuxcnc
@needs_root
def test_genhexkins_loses_a_yaw_of_62_degrees_and_the_component_does_not(
    linuxcnc: Any, tmp_path: Path
) -> None:
    """Beyond 60° its iteration diverges: joints are right, but it does not know where it is."""
    robot = pk.load("hexapod")
    pk.export.linuxcnc(robot, tmp_path / "machine")
    ini = tmp_path / "machine" / "machine.ini"
    poses = np.tile(robot.home, (5, 1))
    poses[:, 3:] = np.radians([[1, 1, 0], [1, 1, 30], [1, 1, 50], [1, 1, 62], [1, 1, 66]])
    lines = [move(robot, pose) for pose in poses]
    ours = linuxcnc(ini, "pkm_machine", lines)
    text = ini.read_text().replace("= pkm_machine", "= genhexkins")
    text = text.replace("HALFILE = machine.hal", "HALFILE = machine.hal\nHALFILE = genhexkins.hal")
    ini.with_name("other.ini").write_text(text)
    theirs = linuxcnc(ini.with_name("other.ini"), "genhexkins", lines)
    joints = robot.inverse(poses)
    want = [world(robot, pose) for pose in poses]
    for found in (ours, theirs):  # the lines for genhexkins are this robot
        np.testing.assert_allclose([each["joints"] for each in found], joints, rtol=0, atol=1e-9)
    np.testing.assert_allclose([each["actual"] for each in ours], want, rtol=0, atol=1e-9)
    assert [each["failed"] for each in ours] == [False] * 5
    assert [each["failed"] for each in theirs] == [False, False, False, True, True]
    off = np.abs(np.subtract([each["actual"] for each in theirs], want)).max(axis=1)
    assert off[:3].max() < 1e-6 and off[3:].min() > 1.0


def settings(path: Path) -> dict[str, float]:
    """The `setp` lines of a file by the pins' names."""
    found = re.findall(r"^setp \w+\.(\S+) (\S+)$", path.read_text(), re.MULTILINE)
    return {name: float(value) for name, value in found}


@needs_linuxcnc
@pytest.mark.parametrize(
    ("name", "module", "order"),
    [
        ("linear-delta", "lineardeltakins", ("R", "L")),
        (
            "rotary-delta",
            "rotarydeltakins",
            ("platformradius", "thighlength", "shinlength", "footradius"),
        ),
    ],
)
def test_the_lines_make_a_shipped_module_the_robot(
    name: str, module: str, order: tuple[str, ...], tmp_path: Path
) -> None:
    robot = pk.load(name)
    loss = pk.export.linuxcnc(robot, tmp_path / "machine")
    assert loss is not None and loss.exact
    lines = tmp_path / "machine" / f"{module}.hal"
    numbers = [settings(lines)[key] for key in order]
    (limbs,) = re.findall(r"are limbs (\d), (\d), (\d)", lines.read_text())
    poses = poses_of(robot, 20)
    program = f"import json, {module} as m\nm.set_geometry(*{numbers})\n"
    program += f"print(json.dumps([m.inverse(*p) for p in {poses[:, :3].tolist()}]))"
    done = subprocess.run(
        ["/usr/bin/python3", "-c", program], env=SYSTEM, capture_output=True, text=True, check=True
    )
    joints = in_degrees(robot, robot.inverse(poses))[:, [int(limb) - 1 for limb in limbs]]
    np.testing.assert_allclose(json.loads(done.stdout), joints, rtol=0, atol=1e-9)


def test_what_a_shipped_module_loses_is_stated_and_no_lines_are_written(tmp_path: Path) -> None:
    for robot in (
        pk.load("linear-delta").replace({"rod1": 216.0}),
        pk.load("rotary-delta").replace({"crank1": 525.0}),
    ):
        loss = pk.export.linuxcnc(robot, tmp_path / "machine")
        assert loss is not None and 0.01 < loss.rms < loss.worst < 5.0
    names = {path.name for path in (tmp_path / "machine").iterdir()}
    assert names == {"machine.ini", "machine.hal", "pkm_machine.c"}
    assert pk.export.linuxcnc(pk.load("3prs"), tmp_path / "other") is None


def test_genhexkins_lines_are_the_legs_in_the_frames_of_the_user(tmp_path: Path) -> None:
    """The module's published model, distances of joints, with the numbers of the lines."""
    robot = CASES["framed"]()
    pk.export.linuxcnc(robot, tmp_path / "machine")
    at = settings(tmp_path / "machine" / "genhexkins.hal")
    base, platform = (
        np.array([[at[f"{part}.{i}.{axis}"] for axis in "xyz"] for i in range(6)])
        for part in ("base", "platform")
    )
    poses = poses_of(robot, 10)
    for pose, q in zip(poses, robot.inverse(poses), strict=True):
        turned = platform @ pk_rotation(pose[3:]).T
        lengths = np.linalg.norm(pose[:3] + turned - base, axis=1)
        drives = robot.slots[:, 7] * q + robot.slots[:, 6]
        np.testing.assert_allclose(lengths, drives, rtol=0, atol=1e-9)


def pk_rotation(angles: Any) -> Any:
    """R = Rz(γ) Ry(β) Rx(α), written out."""
    (sa, sb, sc), (ca, cb, cc) = np.sin(angles), np.cos(angles)
    return np.array(
        [
            [cc * cb, cc * sb * sa - sc * ca, cc * sb * ca + sc * sa],
            [sc * cb, sc * sb * sa + cc * ca, sc * sb * ca - cc * sa],
            [-sb, cb * sa, cb * ca],
        ]
    )


def test_the_command_line_writes_the_folder_and_keeps_what_was_changed_in_it(
    run: Any, refused: Any, tmp_path: Path
) -> None:
    folder = tmp_path / "Mill 2"
    arguments = ("export", "linear-delta", "--as", "linuxcnc", "--out", folder)
    assert run(*arguments).stdout == f"{folder}: linear delta\n"
    names = {"mill_2.ini", "mill_2.hal", "pkm_mill_2.c", "lineardeltakins.hal"}
    assert {path.name for path in folder.iterdir()} == names
    assert run(*arguments).exit_code == 0  # nobody has touched it
    ini = folder / "mill_2.ini"
    ini.write_text(ini.read_text().replace("MAX_VELOCITY = 200", "MAX_VELOCITY = 20"))
    assert refused(*arguments).startswith(f"{ini}: would be replaced")
    pk.load("linear-delta").replace({"rod1": 216.0}).save(tmp_path / "robot.toml")
    arguments = ("export", tmp_path / "robot.toml", *arguments[2:-1], tmp_path / "other")
    assert re.search(r"; LinuxCNC.s own module for it is off by 0\.\d+ mm", run(*arguments).stdout)
    assert not (tmp_path / "other" / "lineardeltakins.hal").exists()


def test_what_linuxcnc_cannot_hold_is_refused(tmp_path: Path) -> None:
    framed = robots.made(
        "planar",
        {"x": 0.0},
        [
            {"kind": "UPS", "base": robots.ring(300, a), "platform": robots.ring(50, a)}
            for a in (0, 120, 240)
        ],
        frames=FRAMES,
    )
    for robot, folder, reason in (
        (framed, "x", "base or tool frames"),
        (pk.load("exechon"), "x", "8 closures for 6 free coordinates"),
        (pk.load("hexapod"), "a" * 30, "folder must have a name"),
        (pk.load("rbt-6t03p-printed"), "x", "cannot reach its home pose"),
    ):
        with pytest.raises(pk.ArgumentError, match=reason):
            pk.export.linuxcnc(robot, tmp_path / folder)
    assert not list(tmp_path.iterdir())
