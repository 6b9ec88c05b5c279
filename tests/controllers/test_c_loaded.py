"""Headers of machines that yield: their loaded kinematics are those of the package (A22)."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from tests.kinematics.test_loaded import load_at, poses_of
from tests.robots import hexapod

from .c_headers import FRAMES, STRICT, needed

_LIBRARY = """\
#include "robot.h"
int inverse(const double *pose, const double *load, double *q);
int forward(const double *q, const double *load, double *pose);
int inverse(const double *pose, const double *load, double *q)
{ return robot_inverse_loaded(pose, load, q); }
int forward(const double *q, const double *load, double *pose)
{ return robot_forward_loaded(q, load, pose); }
"""


def heavy() -> pk.Robot:
    """Weights, balancers, gravity that leans, frames, legs that yield more where they are long."""
    keys = {"stiffness": 4e3, "mass": 6.0}
    grows = {"stiffness": {"value": 3e3, "at": 700.0, "per_length": 2e-7}, "gain": -1.01}
    return hexapod(
        *([keys] * 3 + [grows] * 3),
        gravity=[0.4, -0.2, -9.7],
        gravity_tilt=[0.02, -0.03],
        platform={"mass": 30.0, "centre": [10.0, -5.0, 40.0]},
        balancer=[
            {"base": [0.0, 0.0, 1400.0], "platform": [0.0, 10.0, 5.0], "rate": 0.6, "free": 300.0}
        ],
        frames=FRAMES,
    )


def carriages() -> pk.Robot:
    """Sliders whose carriages and rods are heavy."""
    return _weighed("rbt-6t03p", {"stiffness": 2e3, "mass": 0.5, "anchor_mass": 2.0})


def cranks() -> pk.Robot:
    """Cranks that are heavy at their ends."""
    return _weighed("6-rus", {"stiffness": 5e3, "anchor_mass": 1.5})


def _weighed(name: str, keys: dict[str, float]) -> pk.Robot:
    from pkmcal.files.toml_lines import Source
    from pkmcal.geometry import robot_file, robot_file_writer

    text = robot_file_writer.text_of(pk.load(name).model)
    lines = "".join(f"{key} = {value}\n" for key, value in keys.items())
    text = text.replace("[[limb]]\n", "[[limb]]\n" + lines)
    return pk.Robot(robot_file.parse(Source(text.encode(), "weighed.toml"), None))


CASES = {
    "heavy": heavy,
    "carriages": carriages,
    "cranks": cranks,
    "rotary-delta": lambda: pk.load("rotary-delta").yielding({"offset*": 2e-8}),
    "2tpr2tps": lambda: pk.load("2tpr2tps").yielding({"offset*": 1e-4}),
    "2tpr2tps-spatial": lambda: pk.load("2tpr2tps-spatial").yielding({"offset*": 1e-4}),
    "3prs": lambda: pk.load("3prs").yielding({"offset*": 1e-4}),
    "3rrr-planar": lambda: pk.load("3rrr-planar").yielding({"offset*": 1e-8}),
}


def compiled(robot: pk.Robot, folder: Path) -> Any:
    needed("gcc")
    assert pk.export.c_header(robot, folder / "robot.h") is None
    (folder / "robot.c").write_text(_LIBRARY)
    built = folder / "robot.so"
    command = ["gcc", *STRICT, "-shared", "-fPIC", "-o", built, folder / "robot.c", "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return ctypes.CDLL(str(built))


def run(call: Any, given: np.ndarray, load: np.ndarray, written: np.ndarray) -> tuple[int, Any]:
    arrays = [np.array(each, dtype=np.float64) for each in (given, load, written)]
    status = call(*(each.ctypes.data_as(ctypes.c_void_p) for each in arrays))
    return status, arrays[2]


@pytest.mark.parametrize("case", CASES)
def test_loaded_kinematics_of_a_header_are_those_of_the_package(case: str, tmp_path: Path) -> None:
    robot = CASES[case]()
    library = compiled(robot, tmp_path)
    poses, load = poses_of(robot, 15), load_at(15)
    q = robot.inverse(poses, load=load)
    found = robot.forward(q, guess=poses, load=load)
    assert found.ok.all()
    assert np.abs(robot.rigid.inverse(poses) - q).max() > 1e-6
    for i, row in enumerate(load.rows((15,))):
        status, mine = run(library.inverse, poses[i], row, np.zeros(q.shape[1]))
        assert status == 0 and np.abs(mine - q[i]).max() < 1e-9
        status, pose = run(library.forward, q[i], row, poses[i])
        assert status == 0 and np.abs(pose - found.pose[i]).max() < 1e-9


def test_a_header_says_where_a_machine_gives_way(tmp_path: Path) -> None:
    robot = pk.load("hexapod").yielding({"offset*": 1.0 / 30.0})
    library = compiled(robot, tmp_path)
    load = pk.Load(mass=100.0, centre=(20.0, -10.0, 50.0))
    pose, row = robot.home + np.array([150, 100, 50, 0.2, 0.1, 0.3]), load.rows(())
    q = robot.rigid.inverse(pose)
    assert robot.forward(q, guess=pose, load=load).status == 6
    status, after = run(library.forward, q, row, pose)
    assert status == 6 and np.array_equal(after, pose)
    status, after = run(library.inverse, pose, np.full(10, np.nan), q)
    assert status == 4 and np.array_equal(after, q)
    row[0] = -5.0  # kg
    status, after = run(library.inverse, pose, row, q)
    assert status == 4 and np.array_equal(after, q)
    status, after = run(library.forward, q, row, pose)
    assert status == 4 and np.array_equal(after, pose)


def test_what_a_header_does_not_hold_is_said(tmp_path: Path) -> None:
    robot = pk.load("hexapod").yielding({"offset*": 1e-4, "base*": 1e-5})
    robot = robot.carrying(pk.Load(mass=20.0))
    loss = pk.export.c_header(robot, tmp_path / "robot.h")
    assert loss is not None and 1e-3 < loss.rms < loss.worst < 10.0
    assert "yields" in str(loss)
    assert "_loaded" not in (tmp_path / "robot.h").read_text()
    rigid = pk.export.c_header(robot.rigid, tmp_path / "robot.h")
    assert rigid is None
    for export in (pk.export.mjcf, pk.export.fmu):
        assert export(robot, tmp_path / "robot.out").worst == loss.worst
    with pytest.raises(pk.ArgumentError, match="its `rigid` can be exported"):
        pk.export.linuxcnc(robot, tmp_path / "mill")
    light = pk.load("hexapod").yielding({"offset*": 1e-4}).carrying(pk.Load(mass=20.0))
    assert pk.export.linuxcnc(light, tmp_path / "mill").worst > 1e-3
    assert "payload.mass" in (tmp_path / "mill" / "pkm_mill.c").read_text()
    assert not (tmp_path / "mill" / "genhexkins.hal").exists()
