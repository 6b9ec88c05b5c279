"""An exported FMU, compiled and run by FMPy, has the poses and actuators of the robot."""

from __future__ import annotations

import subprocess
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

import numpy as np
import pytest

import pkmcal as pk

from .c_headers import STRICT, needed
from .test_c_header import lawful, pulleys

POSE = ("x", "y", "z", "alpha", "beta", "gamma")
CASES = {
    "hexapod": lambda: pk.load("hexapod"),
    "rotary-delta": lambda: pk.load("rotary-delta"),
    "drive laws": lawful,
    "pulleys": pulleys,
    "chains": lambda: pk.load("trivariant"),
}


def described(path: Path) -> tuple[dict[str, int], Any]:
    """Value references by name, and the description."""
    with zipfile.ZipFile(path) as archive:
        top = Xml.fromstring(archive.read("modelDescription.xml"))
    variables = top.find("ModelVariables")
    assert variables is not None
    return {each.get("name", ""): int(each.get("valueReference", "")) for each in variables}, top


def test_what_is_written_describes_itself(tmp_path: Path) -> None:
    robot = pk.load("rotary-delta")
    pk.export.fmu(robot, tmp_path / "delta-1.fmu")
    places, top = described(tmp_path / "delta-1.fmu")
    assert list(places.values()) == list(range(len(places)))  # as the sources number them
    assert [*places][1:4] == ["q1", "q2", "q3"] and [*places][-2:] == ["status", "to.status"]
    assert top.find("CoSimulation").get("modelIdentifier") == "delta_1"
    again = tmp_path / "again" / "delta-1.fmu"
    again.parent.mkdir()
    pk.export.fmu(robot, again)
    assert again.read_bytes() == (tmp_path / "delta-1.fmu").read_bytes()


@pytest.mark.filterwarnings("ignore::ResourceWarning")  # FMPy leaves a folder to be collected
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("case", CASES)
def test_fmpy_finds_nothing_wrong_and_the_poses_of_the_robot(case: str, tmp_path: Path) -> None:
    fmpy = pytest.importorskip("fmpy")
    fmi3 = pytest.importorskip("fmpy.fmi3")
    needed("cmake", "gcc")
    robot = CASES[case]()
    pk.export.fmu(robot, tmp_path / "machine.fmu")
    assert pytest.importorskip("fmpy.validation").validate_fmu(tmp_path / "machine.fmu") == []
    folder = Path(fmpy.extract(str(tmp_path / "machine.fmu"), str(tmp_path / "open")))
    headers = Path(fmpy.__file__).parent / "c-code"
    command = ["gcc", *STRICT, "-fsyntax-only", f"-I{headers}", folder / "sources" / "fmu.c"]
    subprocess.run(command, check=True)
    pytest.importorskip("fmpy.build").build_platform_binary(folder)
    description = fmpy.read_model_description(str(tmp_path / "machine.fmu"))
    places = {each.name: each.valueReference for each in description.modelVariables}
    q = [places[f"q{i}"] for i in range(1, robot.n_actuators + 1)]
    to_q = [places[f"to.q{i}"] for i in range(1, robot.n_actuators + 1)]
    pose, to_pose = [places[axis] for axis in POSE], [places[f"to.{axis}"] for axis in POSE]
    slave = fmi3.FMU3Slave(
        guid=description.guid,
        unzipDirectory=str(folder),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="one",
    )
    slave.instantiate()
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    np.testing.assert_allclose(slave.getFloat64(pose), robot.home, rtol=0, atol=1e-9)
    rng = np.random.default_rng(1)
    poses = robot.complete(robot.home + rng.uniform(-1, 1, (20, 6)) * [20, 20, 20, 0.1, 0.1, 0.1])
    for step, want in enumerate(poses):
        actuators = robot.inverse(want)
        slave.setFloat64(q, actuators.tolist())
        slave.setFloat64(to_pose, want.tolist())
        slave.doStep(0.01 * step, 0.01)
        np.testing.assert_allclose(slave.getFloat64(pose), want, rtol=0, atol=1e-9)
        off = np.abs(slave.getFloat64(to_q) - actuators).max()
        assert off == 0.0 or (case == "chains" and off < 1e-10)
        assert slave.getInt32([places["status"], places["to.status"]]) == [0, 0]
    slave.setFloat64(to_pose, [1e6, 0.0, 0.0, 0.0, 0.0, 0.0])
    slave.setFloat64(q, [float("nan")] * robot.n_actuators)
    assert slave.getInt32([places["status"]]) == [4]
    np.testing.assert_allclose(slave.getFloat64(pose), poses[-1], rtol=0, atol=1e-9)  # it stays
    slave.reset()
    np.testing.assert_allclose(slave.getFloat64(pose), robot.home, rtol=0, atol=1e-9)
    slave.terminate()
    slave.freeInstance()


def test_machines_that_no_header_holds_are_refused(refused: Any, tmp_path: Path) -> None:
    out = tmp_path / "x.fmu"
    assert "8 closures for 6" in refused("export", "exechon", "--as", "fmu", "--out", out)
    with pytest.raises(pk.ArgumentError, match="cannot reach its home"):
        pk.export.fmu(pk.load("linear-delta").replace({"rod1": 10.0}), out)
    assert not out.exists()
