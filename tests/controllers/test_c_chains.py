"""C headers of machines whose limbs are chains of joints: what Python has, and what it refuses."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk

from .. import robots
from ..chain_files import BOOMS, as_chains, leg_on_leg
from ..driven import content, parsed, with_laws
from ..workspaces import CHAINS
from .c_headers import FRAMES, STRICT, compiled, compiled_once, needed


def disturbed(robot: pk.Robot) -> pk.Robot:
    """With errors of every number."""
    rng = np.random.default_rng(4)
    lengths = np.array([unit == "mm" for unit in robot.geometry.units])
    errors = rng.uniform(-1, 1, len(lengths)) * np.where(lengths, 0.3, 1e-3)
    return robot.replace(robot.geometry.values + errors)


def framed(robot: pk.Robot) -> pk.Robot:
    """In frames of base and tool."""
    return parsed(content(robot) | {"frames": FRAMES})


def read(text: str) -> pk.Robot:
    """The robot of a file."""
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "robot.toml")
        path.write_text(text)
        return pk.load(path)


OVER = ("2tpr2tps-chains", "exechon", "tripteron")
CASES: dict[str, Callable[[], pk.Robot]] = {
    name: lambda name=name: disturbed(pk.load(name))  # type: ignore[misc]
    for name in CHAINS
    if name not in OVER
}
CASES |= {
    "with laws": lambda: with_laws(pk.load("eclipse"), np.random.default_rng(1)),
    "in frames": lambda: framed(pk.load("tricept")),
}
SOME = ["agile-eye", "trivariant", "delta-parallelograms", "with laws", "in frames"]


def poses_of(robot: pk.Robot) -> Any:
    """Poses that the machine takes about home."""
    q = robot.inverse(robot.home)
    room = np.array([30.0 if unit == "mm" else 0.1 for unit in robot.actuator_units])
    slope = np.abs(robot.machine.slopes(robot.slots, q[None])[0])
    ways = np.random.default_rng(1).uniform(-1, 1, (100, len(q))) * room / slope[: len(q)]
    found = robot.forward(q + ways)
    assert found.ok.mean() > 0.95
    return found.pose[found.ok]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Give the header of a case as compiled by gcc, once."""
    return compiled_once(CASES, tmp_path_factory)


@pytest.mark.parametrize("case", CASES)
def test_chains_are_where_python_has_them(case: str, library: Any) -> None:
    """From a guess beside the pose and from home; the inverse along ways that the machine goes."""
    robot, header = CASES[case](), library(case, "double")
    poses = poses_of(robot)
    want = robot.inverse(poses)
    status, q = header.inverse(poses)
    assert (status == 0).all()
    np.testing.assert_allclose(q, want, rtol=0, atol=1e-10)
    for guess in (poses + np.array([3.0, -2.0, 1.0, 0.01, -0.02, 0.01]), robot.home):
        status, found = header.forward(want, guess)
        assert (status == 0).all()
        np.testing.assert_allclose(found, robot.forward(want, guess).pose, rtol=0, atol=1e-10)
        np.testing.assert_allclose(found, poses, rtol=0, atol=1e-9)
    status, by_free = header.jacobian(poses)
    assert (status == 0).all()
    scale = np.abs(by_free).max()
    rates = robot.forward_jacobian(poses)  # of the pose by the actuators: it goes these ways
    off = by_free @ rates - np.eye(robot.n_actuators)
    assert np.abs(off).max() < 1e-9 * max(1.0, scale)


@pytest.mark.parametrize("name", ["hexapod", "6-rus", "linear-delta-6"])
def test_chains_are_the_machine_of_closed_form(name: str, tmp_path: Path) -> None:
    """The same machine written with its limbs as chains: the same actuators, the same poses."""
    plain = pk.load(name)
    header = compiled(read(as_chains(plain)), tmp_path)
    room = [20.0, 20.0, 20.0, 0.1, 0.1, 0.1]
    moved = plain.home + np.random.default_rng(2).uniform(-1, 1, (100, 6)) * room
    poses = plain.complete(moved)
    q = plain.inverse(poses)
    known = np.isfinite(q).all(axis=1)
    assert known.mean() > 0.9
    status, found = header.inverse(poses[known])
    assert (status == 0).all()
    np.testing.assert_allclose(found, q[known], rtol=0, atol=1e-9)
    status, found = header.forward(q[known], plain.home)
    assert (status == 0).all()
    np.testing.assert_allclose(found, poses[known], rtol=0, atol=1e-9)


@pytest.mark.parametrize("case", SOME)
def test_floats_of_chains_lose_no_more_than_floats_must(case: str, library: Any) -> None:
    robot, header = CASES[case](), library(case, "float")
    poses = poses_of(robot)
    want = robot.inverse(poses)
    size = robot.machine.struct.size
    status, q = header.inverse(poses)
    assert (status == 0).all()
    ways = [robot.machine.drives(robot.slots, each) for each in (q.astype(float), want)]
    assert np.abs(ways[0] - ways[1]).max() < 2e-6 * size
    status, found = header.forward(want, poses)
    assert (status == 0).all()
    assert np.abs(found - poses)[:, :3].max() < 5e-6 * size


@pytest.mark.parametrize("number", ["double", "float"])
@pytest.mark.parametrize("case", SOME)
def test_clang_has_nothing_to_say_of_chains(case: str, number: str, tmp_path: Path) -> None:
    compiled(CASES[case](), tmp_path, number, "clang")


def test_cpp_takes_chains_too(tmp_path: Path) -> None:
    needed("g++")
    pk.export.c_header(CASES["with laws"](), tmp_path / "a.h")
    (tmp_path / "a.cpp").write_text(
        '#include "a.h"\nint main() { double q[6]; return a_inverse(a_home, q); }\n'
    )
    flags = [flag.replace("c99", "c++11") for flag in STRICT]
    subprocess.run(["g++", *flags, "-o", tmp_path / "a", tmp_path / "a.cpp"], check=True)
    subprocess.run([tmp_path / "a"], check=True)


def test_what_chains_cannot_do_leaves_the_numbers_alone(library: Any) -> None:
    robot, header = CASES["five-bar"](), library("five-bar", "double")
    far = robot.home + np.array([2000.0, 0, 0, 0, 0, 0])
    assert not np.isfinite(robot.inverse(far)).any()
    bad = np.array([far, robot.home * np.nan])
    for name in ("inverse", "jacobian"):
        assert getattr(header, name)(bad)[0].tolist() == [3, 4]
    assert (header.inverse(bad, before=7.0)[1] == 7.0).all()
    q = robot.inverse(robot.home)
    away = q + np.array([[0.0, np.nan], [np.pi / 2, -np.pi / 2]])
    status, found = header.forward(away, robot.home)
    assert status[0] == 4 and status[1] in (0, 1, 2)
    np.testing.assert_array_equal(found[status != 0], np.tile(robot.home, ((status != 0).sum(), 1)))


def test_a_singular_pose_of_chains_is_not_called_good(tmp_path: Path) -> None:
    """Griffis and Duffy's platform moves by itself: its lengths do not say where it is."""
    plain = robots.griffis_duffy()
    header = compiled(read(as_chains(plain)), tmp_path)
    q = plain.inverse(plain.home)[None]
    assert header.forward(q, plain.home)[0].tolist() == [2]


@pytest.mark.parametrize("name", OVER)
def test_chains_with_more_closures_than_unknowns_are_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(pk.ArgumentError, match=r"\d closures for 6 free coordinates"):
        pk.export.c_header(pk.load(name), tmp_path / "robot.h")
    assert not (tmp_path / "robot.h").exists()


@pytest.mark.parametrize("boom", BOOMS)
def test_joints_by_which_chains_hold_each_other_are_refused(boom: str, tmp_path: Path) -> None:
    """A chain alone, as the inverse takes it, does not say where they are."""
    with pytest.raises(pk.ArgumentError, match="a leg on a leg shares joints"):
        pk.export.c_header(read(leg_on_leg(boom)), tmp_path / "robot.h")
    assert not (tmp_path / "robot.h").exists()


def test_joints_behind_the_platform_are_refused(tmp_path: Path) -> None:
    data = content(pk.load("agile-eye"))
    del data["calibration"]
    data["tail"] = [{"kind": "R", "axis": [0.6, 0.0, 0.8], "actuator": 4}]
    with pytest.raises(pk.ArgumentError, match="has joints behind its platform"):
        pk.export.c_header(parsed(data), tmp_path / "robot.h")
    assert not (tmp_path / "robot.h").exists()
