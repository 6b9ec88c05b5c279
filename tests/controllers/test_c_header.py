"""A robot's C header does what the robot does: the same bits, the same refusals."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk

from .. import generated, robots
from ..driven import with_laws
from .c_headers import FRAMES, PARALLEL, STRICT, compiled, compiled_once, needed


def poses_of(robot: pk.Robot, count: int = 200) -> Any:
    """Poses near home; on the machine's map where it constrains them."""
    rng = np.random.default_rng(1)
    moved = robot.home + rng.uniform(-1, 1, (count, 6)) * [20, 20, 20, 0.1, 0.1, 0.1]
    if robot.model.match is None and len(robot.coordinates) == 6:
        return moved
    poses = robot.complete(moved)
    assert np.isfinite(poses).all()
    return poses


def mixed() -> pk.Robot:
    """Three kinds of limbs, errors in every axis, and frames of base and tool."""
    rail = {"kind": "PUS", "slider": [0.1, 0.2, 1.0], "rod": 800.0, "branch": -1}
    crank = {"kind": "RUS", "axis": [0.3, 1.0, 0.0], "zero": [1.0, -0.3, 0.2], "branch": 1}
    crank |= {"crank": 250.0, "rod": 700.0, "axis_tilt": [0.01, -0.02], "gain": -1.01}
    rail |= {"slider_tilt": [0.02, 0.03], "offset": 3.0, "gain": 0.5}
    return robots.hexapod(rail, crank, {"offset": 20.0}, rail, frames=FRAMES)


TABLE = [[300.0, 0.0], [500.0, 0.3], [700.0, -0.2], [900.0, 0.1]]
WAVES = [{"k": 0.2, "cos": 0.05, "sin": -0.03}, {"k": 0.5, "cos": 0.01, "sin": 0.02}]


def lawful() -> pk.Robot:
    """Every drive law, alone and together, and a limb without any."""
    laws: list[dict[str, Any]] = [
        {"drive": {"quadratic": 1e-5}},
        {"drive": {"spool": 75.0, "buildup": -0.1}, "gain": -1 / 70, "offset": 2000.0},
        {"drive": {"harmonics": WAVES}},
        {"drive": {"table": TABLE, "backlash": 0.1}},
        {"drive": {"quadratic": -1e-5, "harmonics": WAVES[:1], "table": TABLE}},
    ]
    return robots.hexapod(*[law | {"stroke": [300.0, 1500.0]} for law in laws])


def turned(**law: Any) -> pk.Robot:
    """Cranks whose strokes are some whole turns from their angles at home; one drives two rods."""
    limbs = [
        {"kind": "RUS", "base": robots.ring(200.0, at), "platform": robots.ring(45.0, at)}
        | {"axis": robots.ring(1.0, at + 90.0), "zero": robots.ring(1.0, at), "branch": 1}
        | {"crank": 170.0, "rod": 400.0, "stroke": [12.0, 16.0]}
        | ({"drive": law} if law else {})
        for at in (0.0, 120.0, 240.0)
    ]
    return robots.made("translation", {"z": -350.0}, limbs)


def paired(**changes: Any) -> pk.Robot:
    """Two cranks on every actuator, side by side."""
    limbs = [
        {"kind": "RUS", "base": base + side, "platform": robots.ring(45.0, at) + side}
        | {"axis": robots.ring(1.0, at + 90.0), "zero": robots.ring(1.0, at), "branch": 1}
        | {"crank": 170.0, "rod": 400.0, "offset": turn, "actuator": i}
        for i, at in enumerate((0.0, 120.0, 240.0), 1)
        for base in [robots.ring(200.0, at)]
        for side, turn in ((robots.ring(20.0, at + 90), 0.0), (robots.ring(-20.0, at + 90), 6.3))
    ]
    limbs[3] |= changes
    return robots.made("spatial", {"z": -350.0}, limbs, match=["x", "y", "z"])


def geared(gain: float, turns: int = 0, law: dict[str, Any] | None = None) -> pk.Robot:
    """Pairs of cranks with different gears, which stand at 2 rad of their actuator.

    The first of each is given nearest to some whole turns from there, where the other may be off.
    """
    plain = paired()
    angles = plain.inverse(plain.home)
    limbs = [
        {"kind": "RUS", "base": base + side, "platform": robots.ring(45.0, at) + side}
        | {"axis": robots.ring(1.0, at + 90.0), "zero": robots.ring(1.0, at), "branch": 1}
        | {"crank": 170.0, "rod": 400.0, "actuator": i + 1}
        | {"gain": own, "offset": angles[i] + off - 2.0 * own}
        | ({"drive": law, "stroke": [angles[i] + off - 8.0, angles[i] + off + 8.0]} if law else {})
        for i, at in enumerate((0.0, 120.0, 240.0))
        for base in [robots.ring(200.0, at)]
        for side, own, off in (
            (robots.ring(20.0, at + 90), 1.0, 2 * np.pi * turns),
            (robots.ring(-20.0, at + 90), gain, 0.0),
        )
    ]
    return robots.made("spatial", {"z": -350.0}, limbs, match=["x", "y", "z"])


def pulleys(law: dict[str, Any] | None = None) -> pk.Robot:
    """A point on three cables that run over pulleys."""
    anchors = ([1500.0, 0, 2000], [-800, 1200, 2100], [-700, -1300, 1900])
    limbs = [
        {"kind": "pulley", "base": at, "platform": [0, 0, 0], "radius": 60.0, "swivel": [0, 0, 1]}
        | ({"drive": law, "stroke": [100.0, 5000.0]} if law else {})
        for at in anchors
    ]
    return robots.made("translation", {"z": 500.0}, limbs)


def pulleys_and_legs() -> pk.Robot:
    """A body on pulleys that lean, one with a drive law, among legs; in frames of base and tool."""
    waves = {"drive": {"harmonics": [{"k": 0.02, "cos": 0.3, "sin": -0.2}]}}
    limbs: list[dict[str, Any]] = [
        {"base": robots.ring(2000.0, 60 * i - 10 * (-1) ** i, 2500.0 + 200 * (i % 3))}
        | {"platform": robots.ring(200.0, 60 * i - 50 * (-1) ** i), "stroke": [100.0, 5000.0]}
        | {"gain": 1.0 + 0.01 * i, "offset": 10.0 * i}
        | ({"kind": "UPS"} if i % 3 == 1 else {"kind": "pulley", "radius": 40.0 + i})
        | ({} if i % 3 == 1 else {"swivel": [0, 0, 1], "swivel_tilt": [0.1 * i, -0.05 * i]})
        | ({} if i % 3 == 1 else {"zero": [1, 0, 0]})
        | (waves if i % 3 == 2 else {})
        for i in range(6)
    ]
    return robots.made("spatial", {"z": 1000.0}, limbs, frames=FRAMES)


def eight(**more: Any) -> pk.Robot:
    """A body on eight cables over pulleys, four above and four below."""
    limbs = []
    for i, (x, y) in enumerate([(1, 1), (-1, 1), (-1, -1), (1, -1)] * 2):
        z = 1 if i < 4 else -1
        limbs.append(
            {"kind": "pulley", "base": [2000.0 * x, 1500.0 * y, 1250.0 + 1250.0 * z]}
            | {"platform": [150.0 * x, 120.0 * y, 80.0 * z], "radius": 40.0 + i}
            | {"swivel": [0, 0, z], "swivel_tilt": [0.01 * i, -0.02 * i], "zero": [1, 0, 0]}
            | {"offset": 10.0 * i, "gain": 1.0 + 0.01 * i}
        )
    return robots.made("spatial", {"z": 1200.0}, limbs, **more)


def four() -> pk.Robot:
    """A point on four cables."""
    anchors = ([0, -1600, -120], [1400, 800, -120], [-1300, 700, -100], [0, 0, 2300])
    limbs = [{"kind": "cable", "base": at, "platform": [0, 0, 0]} for at in anchors]
    return robots.made("translation", {"z": 400.0}, limbs)


def held(weight: float = 1.0) -> pk.Robot:
    """Legs two of which keep to planes, further than six legs need."""
    plain = robots.hexapod()
    legs = plain.slots[:2, 3:6] + plain.home[:3] - plain.slots[:2, 0:3]
    across = np.cross(legs, [0.0, 0.0, 1.0])
    limbs = [{"kind": "UPR", "revolute": each, "weights": [weight]} for each in across.tolist()]
    return robots.hexapod(*limbs, closure_tolerance=20.0)


def cables() -> pk.Robot:
    """A point on three cables."""
    anchors = ([0, -1600, -120], [1400, 800, -120], [0, 0, 2300])
    limbs = [{"kind": "cable", "base": at, "platform": [0, 0, 0]} for at in anchors]
    return robots.made("translation", {"z": 400.0}, limbs)


def rails() -> pk.Robot:
    """Two rods on every carriage; its screw has a law for each."""
    table = [[-100.0, 0.0], [50.0, 0.2], [200.0, -0.1]]
    limbs = [
        {"kind": "PUS", "base": base + side, "platform": robots.ring(30.0, at) + side}
        | {"slider": [0, 0, 1], "rod": 340.0, "branch": -1, "actuator": i, "offset": 420.0}
        | ({"drive": {"table": table}} if first else {"drive": {"quadratic": 1e-5}})
        | {"stroke": [250.0, 700.0]}
        for i, at in enumerate((0.0, 120.0, 240.0), 1)
        for base in [robots.ring(160.0, at)]
        for side, first in (
            (robots.ring(20.0, at + 90), True),
            (robots.ring(-20.0, at + 90), False),
        )
    ]
    return robots.made("spatial", {"z": 100.0}, limbs, match=["x", "y", "z"])


CASES = {name: lambda name=name: pk.load(name) for name in PARALLEL}
CASES |= {
    "mixed, framed": mixed,
    "cables": cables,
    "drive laws": lawful,
    "turned": turned,
    "turned, with laws": lambda: turned(harmonics=[{"k": 1.0, "cos": 0.01, "sin": 0.02}]),
    "paired": paired,
    "pairs on rails, with laws": rails,
    "geared": lambda: geared(0.5),
    "geared, a turn apart": lambda: geared(0.5, 1),
    "geared, with laws": lambda: geared(0.5, 1, {"harmonics": [{"k": 1.0, "cos": 0.01}]}),
    "pulleys": pulleys,
    "pulleys, with laws": lambda: pulleys({"spool": 60.0, "buildup": 0.1}),
    "pulleys and legs, framed": pulleys_and_legs,
    "eight pulleys": eight,
    "four cables": four,
}
# every driver, row and pose map
SOME = [
    "2tpr2tps",
    "2tpr2tps-spatial",
    "3rps",
    "3prs",
    "3rrr-planar",
    "linear-delta",
    "mixed, framed",
    "drive laws",
    "turned, with laws",
    "pairs on rails, with laws",
    "geared",
    "geared, with laws",
    "pulleys, with laws",
    "pulleys and legs, framed",
    "eight pulleys",
]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Give the header of a case as compiled by gcc, once."""
    return compiled_once(CASES, tmp_path_factory)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("kind", ["six", "pairs", "tripod", "planar", "spherical"])
def test_machines_that_nobody_drew_turn_their_cranks_as_python_does(
    kind: str, seed: int, tmp_path: Path
) -> None:
    """Strokes of any turn, cranks near half a turn, limbs that share one; rotations either way."""
    rng = np.random.default_rng([seed, generated.KINDS.index(kind), 31])
    robot = generated.machine(kind, rng, errors=0.3)
    if seed:
        robot = with_laws(robot, rng)
    header = compiled(robot, tmp_path)
    at = robot.frames.outward(generated.poses(kind, robot, 100, rng))
    if kind in generated.CONSTRAINED:
        at = robot.complete(at)
        at = at[np.isfinite(at).all(axis=1)]
    other = at.copy()
    if kind != "planar":
        other[:, 3:] = other[:, 3:] * [1, -1, 1] + np.pi
    assert len(at) > 20
    for poses in (at, other):
        for name in ("inverse", "jacobian"):
            status, found = getattr(header, name)(poses)
            want = getattr(robot, name)(poses)
            np.testing.assert_array_equal(
                status == 0, np.isfinite(want.reshape(len(at), -1)).all(1)
            )
            np.testing.assert_array_equal(found, want)


@pytest.mark.parametrize("case", CASES)
def test_inverse_and_jacobian_have_the_bits_of_python(case: str, library: Any) -> None:
    robot = CASES[case]()
    poses = poses_of(robot) if case != "rbt-6t03p-printed" else robot.home[None]
    for name in ("inverse", "jacobian"):
        status, found = getattr(library(case, "double"), name)(poses)
        want = getattr(robot, name)(poses)
        known = np.isfinite(want).all(axis=tuple(range(1, want.ndim)))
        assert known.mean() > 0.9
        np.testing.assert_array_equal(status == 0, known)
        if name == "jacobian" and robot.model.pulleys:  # of the frame as the pose has it
            np.testing.assert_allclose(found, want, rtol=0, atol=1e-13 * np.abs(want).max())
        else:
            np.testing.assert_array_equal(found, want)


@pytest.mark.parametrize("case", [case for case in CASES if case != "rbt-6t03p-printed"])
def test_forward_agrees_with_python_and_with_the_inverse(case: str, library: Any) -> None:
    robot = CASES[case]()
    poses = poses_of(robot)
    q = robot.inverse(poses)
    known = np.isfinite(q).all(axis=1)
    guess = poses[known] + [3.0, -2.0, 1.0, 0.01, -0.02, 0.01]
    status, found = library(case, "double").forward(q[known], guess)
    assert (status == 0).all()
    np.testing.assert_allclose(found, robot.forward(q[known], guess).pose, rtol=0, atol=1e-10)
    np.testing.assert_allclose(found, poses[known], rtol=0, atol=1e-9)


@pytest.mark.parametrize("case", SOME)
def test_floats_lose_no_more_than_floats_must(case: str, library: Any) -> None:
    robot = CASES[case]()
    poses = poses_of(robot)
    q = robot.inverse(poses)
    known = np.isfinite(q).all(axis=1)
    poses, q = poses[known], q[known]
    floats = library(case, "float")
    size = np.abs(robot.slots).sum(axis=1).max()
    assert np.abs(floats.inverse(poses)[1] - q).max() < 1e-6 * size
    status, found = floats.forward(q, poses)
    assert (status == 0).all()
    assert np.abs(found - poses)[:, :3].max() < 5e-6 * size


def test_screws_of_many_turns_are_held_or_refused(tmp_path: Path) -> None:
    """Sines of periodic errors at the end of a stroke are known, or no header is written."""

    def screws(k: float) -> pk.Robot:
        law = {"drive": {"harmonics": [{"k": k, "cos": 0.05, "sin": 0.02}]}}
        return robots.hexapod(*[law | {"stroke": [300.0, 1500.0]}] * 6)

    robot = screws(3.0)
    poses = poses_of(robot)
    status, found = compiled(robot, tmp_path, "float").inverse(poses)
    assert (status == 0).all()
    np.testing.assert_allclose(found, robot.inverse(poses), rtol=0, atol=1e-2)
    fine = screws(5.0)
    pk.export.c_header(fine, tmp_path / "fine.h")
    with pytest.raises(
        pk.ArgumentError, match=r"limb 1 of .*: k q .* goes to 75\d\d rad, .* float"
    ):
        pk.export.c_header(fine, tmp_path / "no.h", "float")
    assert not (tmp_path / "no.h").exists()


@pytest.mark.parametrize("number", ["double", "float"])
@pytest.mark.parametrize("case", SOME)
def test_clang_too_has_nothing_to_say(case: str, number: str, tmp_path: Path) -> None:
    compiled(CASES[case](), tmp_path, number, "clang")  # gcc: in every test here


@pytest.mark.parametrize("case", ["mixed, framed", "drive laws", "pairs on rails, with laws"])
def test_cpp_takes_it_too(case: str, tmp_path: Path) -> None:
    needed("g++")
    for number in ("double", "float"):
        pk.export.c_header(CASES[case](), tmp_path / f"a_{number}.h", number)  # type: ignore[arg-type]
    (tmp_path / "a.cpp").write_text(
        '#include "a_double.h"\n#include "a_float.h"\nint main()\n'
        "{ double q[6]; float l[6]; return a_double_inverse(a_double_home, q)\n"
        "    + a_float_inverse(a_float_home, l); }\n"
    )
    flags = [flag.replace("c99", "c++11") for flag in STRICT]
    subprocess.run(["g++", *flags, "-o", tmp_path / "a", tmp_path / "a.cpp"], check=True)
    subprocess.run([tmp_path / "a"], check=True)


def test_a_double_that_is_a_float_is_refused_when_it_is_compiled(tmp_path: Path) -> None:
    """As on processors of eight bits."""
    needed("gcc")
    pk.export.c_header(pk.load("hexapod"), tmp_path / "robot.h")
    small = ["-U__DBL_MANT_DIG__", "-D__DBL_MANT_DIG__=24"]
    command = ["gcc", "-fsyntax-only", *small, "-x", "c", tmp_path / "robot.h"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode != 0 and "export it with --number float" in done.stderr


def test_what_is_refused_leaves_the_numbers_alone(tmp_path: Path) -> None:
    robot = pk.load("linear-delta")
    library = compiled(robot, tmp_path)
    far = np.array([[1000.0, 0, 0, 0, 0, 0], [np.nan, 0, 0, 0, 0, 0], [0, 0, np.inf, 0, 0, 0]])
    status, found = library.inverse(far, before=7.0)
    assert status.tolist() == [3, 4, 4] and (found == 7.0).all()
    status, found = library.forward([[0, 0, 1000.0], [np.nan, 0, 0]], robot.home)
    assert status[0] in (1, 2) and status[1] == 4  # no such pose; no number
    np.testing.assert_array_equal(found, np.tile(robot.home, (2, 1)))
    (tmp_path / "legs").mkdir()  # a library is loaded once from one place
    legs = compiled(pk.load("hexapod"), tmp_path / "legs")
    home = pk.load("hexapod").home
    assert legs.forward(np.zeros((1, 6)), home)[0].tolist() == [3]  # before homing
    status, found = legs.forward(np.full((1, 6), 500.0), np.zeros(6))
    np.testing.assert_array_equal(found[status != 0], np.zeros((len(found[status != 0]), 6)))


def test_a_singular_pose_is_not_called_good(tmp_path: Path) -> None:
    """Griffis and Duffy's platform moves by itself: its lengths do not say where it is."""
    robot = robots.griffis_duffy()
    status, _ = compiled(robot, tmp_path).forward(robot.inverse(robot.home)[None], robot.home)
    assert status[0] == 2


@pytest.mark.parametrize("make", [four, held, lambda: held(3.0)])
@pytest.mark.parametrize("noise", [0.01, 1.0, 10.0])
def test_more_closures_than_coordinates_have_the_pose_of_least_squares(
    make: Any, noise: float, tmp_path: Path
) -> None:
    """Where they miss each other by more than the machine's tolerance, they do not close.

    Contradictions of 10 mm leave the last steps, here as in Python, no squares of the ones before.
    """
    robot = make()
    poses = robot.home + np.random.default_rng(1).normal(size=(200, 6)) * [20, 20, 20, 0, 0, 0]
    q = robot.inverse(poses)
    q += np.random.default_rng(2).normal(size=q.shape) * noise
    status, found = compiled(robot, tmp_path).forward(q, robot.home)
    want = robot.forward(q, robot.home)
    np.testing.assert_array_equal(status, want.status)
    near = 1e-10 if noise <= 1.0 else 1e-9
    np.testing.assert_allclose(found[status == 0], want.pose[want.ok], rtol=0, atol=near)
    assert (status == 0).any() or noise > 1.0
    np.testing.assert_array_equal(
        found[status != 0], np.broadcast_to(robot.home, found[status != 0].shape)
    )


def test_redundant_pulleys_have_the_pose_of_least_squares(tmp_path: Path) -> None:
    """Of cables that contradict each other; what does not settle is said, here as in Python."""
    robot = eight()
    poses = robot.home + np.random.default_rng(1).normal(size=(100, 6)) * [20, 20, 20, 0, 0, 0]
    q = robot.inverse(poses)
    q += np.random.default_rng(2).normal(size=q.shape) * 0.02
    status, found = compiled(robot, tmp_path).forward(q, robot.home)
    want = robot.forward(q, robot.home)
    both = (status == 0) & want.ok
    assert both.mean() > 0.9 and set(status) <= {0, 1}
    np.testing.assert_allclose(found[both], want.pose[both], rtol=0, atol=1e-8)


def test_geared_cranks_get_the_turn_at_which_both_stand(tmp_path: Path) -> None:
    """The first alone would be a turn away, nearer to where it is at home; the other a third."""
    robot = geared(1 / 3, 1)
    q = 2.0 + np.linspace(-0.03, 0.03, 7)[:, None] * [1, -1, 0.5]
    poses = robot.forward(q).pose
    assert np.isfinite(poses).all()
    status, found = compiled(robot, tmp_path).inverse(poses)
    assert (status == 0).all()
    np.testing.assert_allclose(found, q, rtol=0, atol=1e-9)
    off = np.abs(found - robot.machine.reference(robot.slots))
    assert (off[:, :2] > np.pi).all()


def test_an_end_inside_its_pulley_is_refused(library: Any) -> None:
    robot = pulleys()
    header = library("pulleys", "double")
    inside = np.array([[1500.0 - 60.0, 0.0, 2000.0, 0, 0, 0]])
    assert not np.isfinite(robot.inverse(inside)).any()
    status, found = header.inverse(inside, before=7.0)
    assert status.tolist() == [3] and (found == 7.0).all()
    assert header.jacobian(inside)[0].tolist() == [3]
    status, found = header.forward(robot.inverse(robot.home)[None], inside[0])
    assert status.tolist() == [3]
    np.testing.assert_array_equal(found, inside)


def test_a_cable_over_several_points_is_refused(tmp_path: Path) -> None:
    anchors = ([0, -1600, -120], [1400, 800, -120], [0, 0, 2300])
    limbs: list[dict[str, Any]] = [
        {"kind": "cable", "base": at, "platform": [0, 0, 0]} for at in anchors
    ]
    limbs[2] |= {"kind": "tackle", "over": [[100, 0, 2300]], "parts": [1, 1]}
    robot = robots.made("translation", {"z": 400.0}, limbs)
    with pytest.raises(pk.ArgumentError, match="limb 3 of made for a test runs over several"):
        pk.export.c_header(robot, tmp_path / "robot.h")
    assert not (tmp_path / "robot.h").exists()


def test_turns_of_a_crank_are_those_of_its_stroke(library: Any) -> None:
    """Not those of an arctangent, which would jump by a whole turn between -π and π."""
    robot = turned()
    poses = poses_of(robot)
    status, found = library("turned", "double").inverse(poses)
    assert (status == 0).all() and found.min() > 12.0 and found.max() < 16.0


def test_names_come_from_the_file(tmp_path: Path) -> None:
    needed("gcc")
    pk.export.c_header(pk.load("2tpr2tps"), tmp_path / "2tpr-2tps.h")
    pk.export.c_header(pk.load("hexapod"), tmp_path / "other.h", "float")
    (tmp_path / "both.c").write_text(
        '#include "2tpr-2tps.h"\n#include "other.h"\nint main(void)\n'
        "{ double q[4]; float l[6]; return robot_2tpr_2tps_inverse(robot_2tpr_2tps_home, q)\n"
        "    + other_inverse(other_home, l) + (ROBOT_2TPR_2TPS_STEPS - OTHER_STEPS); }\n"
    )
    command = ["gcc", *STRICT, "-o", tmp_path / "both", tmp_path / "both.c", "-lm"]
    subprocess.run(command, check=True)
    subprocess.run([tmp_path / "both"], check=True)


def test_only_the_square_root_and_the_absolute_value_are_of_the_library(tmp_path: Path) -> None:
    needed("gcc", "nm")
    for number in ("double", "float"):
        compiled(mixed(), tmp_path, number)
        source = str(tmp_path / "robot.c")
        subprocess.run(["gcc", "-c", "-O0", "-o", tmp_path / "o", source], check=True)
        undefined = subprocess.run(
            ["nm", "-u", tmp_path / "o"], capture_output=True, text=True, check=True
        ).stdout
        names = {line.split()[-1] for line in undefined.splitlines()}
        allowed = {"sqrt", "fabs", "sqrtf", "fabsf", "_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail"}
        assert names <= allowed
        writable = subprocess.run(["size", tmp_path / "o"], capture_output=True, text=True)
        assert writable.stdout.splitlines()[1].split()[1:3] == ["0", "0"]  # data, bss


def test_a_hexapod_takes_four_kilobytes_of_a_controller(tmp_path: Path) -> None:
    """Code and numbers of inverse and forward on a Cortex-M7, without the C library."""
    needed("arm-none-eabi-gcc", "arm-none-eabi-size")
    pk.export.c_header(pk.load("hexapod"), tmp_path / "robot.h")
    (tmp_path / "robot.c").write_text(
        '#include "robot.h"\nint both(double *pose, double *q);\n'
        "int both(double *pose, double *q)\n"
        "{ return robot_inverse(pose, q) || robot_forward(q, pose); }\n"
    )
    command = "arm-none-eabi-gcc -std=c99 -O2 -mcpu=cortex-m7 -mthumb -mfpu=fpv5-d16"
    command += " -mfloat-abi=hard -c -o robot.o robot.c"
    subprocess.run(command.split(), cwd=tmp_path, check=True)
    size = ["arm-none-eabi-size", tmp_path / "robot.o"]
    text = subprocess.run(size, capture_output=True, text=True, check=True).stdout
    code, data, bss = map(int, text.splitlines()[1].split()[:3])
    assert code <= 4096 and data == bss == 0


SIDES = ("hexapod", "3rrr-planar", "linear-delta", "linear-delta-6", "rotary-delta", "tricept")


@pytest.mark.parametrize("name", SIDES)
def test_a_pose_from_home_in_another_mode_is_on_another_side(name: str, tmp_path: Path) -> None:
    """Where the header lands elsewhere than `Robot.forward`, and never where it does not."""
    robot = pk.load(name)
    library = compiled(robot, tmp_path)
    at = pk.sample_poses(robot, 300, seed=3, share=0.9)
    q = robot.inverse(at, match=True)
    status, found = library.forward(q, robot.home)
    home = library.side(robot.inverse(robot.home)[None], robot.home[None])[0]
    same = library.side(q, found) * home > 0
    ok, right = status == 0, np.abs(found - at).max(axis=1) < 1e-6
    assert home != 0 and same[ok & right].all() and not same[ok & ~right].any()
    assert (ok & ~right).any() or name not in ("3rrr-planar", "linear-delta", "linear-delta-6")


@pytest.mark.parametrize("name", [*SIDES, "6-rus", "3rps", "3prs", "2tpr2tps-spatial"])
def test_forward_same_side_ends_where_the_machine_is_or_says_so(name: str, tmp_path: Path) -> None:
    """From home to poses near the border: the pose they were made of, or a status and home kept."""
    robot = pk.load(name)
    library = compiled(robot, tmp_path)
    at = pk.sample_poses(robot, 300, seed=11, share=0.9)
    q = robot.inverse(at, match=True)
    plain, anywhere = library.forward(q, robot.home)
    status, found = library.forward_same_side(q, robot.home)
    ok, right = status == 0, np.abs(anywhere - at).max(axis=1) < 1e-6
    np.testing.assert_array_equal(ok, (plain == 0) & right)
    np.testing.assert_array_equal(found[ok], anywhere[ok])
    np.testing.assert_array_equal(found[~ok], np.broadcast_to(robot.home, found.shape)[~ok])
    assert set(status[(plain == 0) & ~right]) <= {7}
    np.testing.assert_array_equal(status[plain != 0], plain[plain != 0])


def test_a_guess_that_the_machine_cannot_take_has_no_side(tmp_path: Path) -> None:
    robot = pk.load("linear-delta")
    library = compiled(robot, tmp_path)
    q = robot.inverse(robot.home)[None]
    far = robot.home + np.array([0.0, 0.0, 0.0, 0.3, 0.0, 0.0])  # tilted, as it cannot be
    assert library.forward(q, far)[0] == 0
    status, found = library.forward_same_side(q, far)
    assert status == 8
    np.testing.assert_array_equal(found, far[None])


@pytest.mark.parametrize("name", [*SIDES, "3rps", "2tpr2tps-spatial"])
def test_what_a_pose_misses_is_how_far_from_it_the_machine_goes(name: str, tmp_path: Path) -> None:
    robot = pk.load(name)
    library, rng = compiled(robot, tmp_path), np.random.default_rng(5)
    way = [3.0, 3.0, 3.0, 0.02, 0.02, 0.02]
    asked = pk.sample_poses(robot, 60, seed=4) + rng.uniform(-1, 1, (60, 6)) * way
    status, missed = library.missed(asked)
    there = robot.forward(robot.inverse(asked), guess=asked)
    off = np.abs(pk.screw.from_pose(there.pose) - pk.screw.from_pose(asked))[:, :3]
    want = np.maximum(off[..., 3].max(axis=1), robot.length * off[..., :3].max(axis=(1, 2)))
    ok = (status == 0) & there.ok
    assert ok.sum() > 50
    np.testing.assert_allclose(missed[ok, 0], want[ok], atol=1e-8)
    assert np.median(want[ok]) > 0.1 or len(robot.moved) == 6
