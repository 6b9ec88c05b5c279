"""The page of a machine: one file that needs nothing else, is safe, and says what it shows."""

from __future__ import annotations

import dataclasses
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.core.library import POSE
from pkmcal.files.seal import is_sealed
from pkmcal.view import page, scripts

from .. import driven
from . import pages

ROOT = Path(__file__).resolve().parents[2]
HOSTILE = "</script><img src=x onerror=alert(1)>\x1b[31m\u2028&\"'`${1}"


def renamed(name: str, machine: str = "hexapod") -> pk.Robot:
    robot = pk.load(machine)
    return pk.Robot(dataclasses.replace(robot.model, name=name))


@pytest.mark.parametrize("name", pk.machines())
def test_a_page_is_one_file_of_less_than_61_kb_that_asks_for_no_other(
    name: str, tmp_path: Path
) -> None:
    text = pk.show(pk.load(name), tmp_path / "page.html").read_text(encoding="utf-8")
    assert len(text.encode()) < 61_000
    sources = text + scripts.scripts() + scripts.style()
    asks = r"https?:|\bfetch\(|XMLHttp|@import|\bsrc=|\bhref=(?!.data:,)|url\("
    assert not re.search(asks, sources)


def test_names_are_shown_and_nothing_more(tmp_path: Path) -> None:
    ((state,),) = pages.said(tmp_path, [renamed(HOSTILE)], [[]])
    assert state["text"].startswith("</script><img src=x onerror=alert(1)>�[31m�&\"'`${1}\n")
    made = pk.show(renamed(HOSTILE), tmp_path / "page.html").read_text(encoding="utf-8")
    assert "<img" not in made and made.count("</script>") == made.count("<script") == 1


@pytest.mark.parametrize("name", ["hexapod", "3r", "exechon"])
def test_the_page_starts_without_a_word_on_the_console(name: str, tmp_path: Path) -> None:
    seen = pages.started(pk.show(pk.load(name), tmp_path / "page.html"))
    assert not seen.console
    assert "Home</button>" in seen.dom and "conditioning" in seen.dom


def test_data_end_no_script_and_begin_no_comment() -> None:
    data = {"a": "</script><!--\u2028&", "b": [1e-300, 0.1]}
    text = page.as_script(data)
    assert json.loads(text) == data
    assert not set("<>&\u2028") & set(text)


def test_what_is_written_has_a_seal_and_is_the_same_twice(tmp_path: Path) -> None:
    robot = pk.load("3rps")
    one, other = (robot.show(tmp_path / name).read_bytes() for name in ("one.html", "other.html"))
    assert one == other and is_sealed(one, ".html")


def test_only_machines_are_shown() -> None:
    with pytest.raises(TypeError, match="robot must be a Robot or a SerialArm, found str"):
        pk.show("hexapod")  # type: ignore[arg-type]


def test_without_a_path_the_page_is_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    made = pk.load("3r").show()
    try:
        assert opened == [made.as_uri()] and made.stat().st_size > 10_000
    finally:
        made.unlink()


def test_strokes_that_are_exceeded_are_named(tmp_path: Path) -> None:
    """A hexapod above all its legs' strokes, and one leg alone beyond its own."""
    moves = [["movePose", 2, 1150.0], ["movePose", 2, 1050.0], ["moveActuator", 3, 1101.0]]
    (states,) = pages.said(tmp_path, [pk.load("hexapod")], [moves])
    assert "within all limits" in states[0]["text"]
    assert "limbs 1, 2, 3, 4, 5, 6: stroke exceeded" in states[1]["text"]
    assert "within all limits" in states[2]["text"]
    assert re.findall(r"limb \d: stroke", states[3]["text"]) == ["limb 4: stroke"]


def test_cones_that_are_exceeded_are_named(tmp_path: Path) -> None:
    robot = pk.load("tricept")  # its central joint bends by at most 45 degrees
    (states,) = pages.said(tmp_path, [robot], [[["movePose", 0, 640.0], ["movePose", 2, 600.0]]])
    kept = robot.feasible(states[-1]["pose"], states[-1]["q"])
    assert not kept.base_cone[3]
    assert "limb 4: cone of the base joint exceeded" in states[-1]["text"]


def test_a_singularity_is_named(tmp_path: Path) -> None:
    """Level delta arms and rods in one plane: the platform falls (a type-2 singularity)."""
    ((state,),) = pages.said(tmp_path, [pk.load("rbt-6t03p-printed")], [[]])
    assert "near a singularity" in state["text"]
    assert (
        "near a singularity" not in pages.said(tmp_path, [pk.load("hexapod")], [[]])[0][0]["text"]
    )


def test_where_it_does_not_get_it_stays_and_says_so(tmp_path: Path) -> None:
    robot = pk.load("linear-delta")
    (states,) = pages.said(tmp_path, [robot], [[["movePose", 0, 900.0]]])
    assert states[1]["pose"] == states[0]["pose"]
    assert "does not get there: limb" in states[1]["text"]


@pytest.mark.parametrize("name", ["2tpr2tps", "3rps", "tricept"])
def test_every_assembly_mode_can_be_stepped_through(name: str, tmp_path: Path) -> None:
    """Every one that `forward` keeps: the chains' passive joints may fold over otherwise."""
    robot = pk.load(name)
    q = robot.inverse(robot.home)
    poses = robot.forward_all(q).poses
    there = robot.forward(np.repeat(q[None], len(poses), axis=0), poses).pose
    poses = poses[np.linalg.norm(there[:, :3] - poses[:, :3], axis=1) < 1e-4]
    count = len(poses)
    assert count > 1
    (states,) = pages.said(tmp_path, [robot], [[["takeMode", k] for k in range(count)]])
    shown = [state["pose"] for state in states[1:]]  # by fewer digits, which all processors give
    np.testing.assert_allclose(shown, poses, rtol=0, atol=1e-9)
    assert {tuple(state["q"]) for state in states} == {tuple(states[0]["q"])}
    assert f"{count} of {count}" in states[-1]["text"]


def test_limits_that_a_machine_does_not_have_are_not_said_to_be_kept(tmp_path: Path) -> None:
    """Nor are cones offered where no joint has one."""
    robots = [pk.load(name) for name in ("3rrr-planar", "hexapod", "2tpr2tps")]
    free, strokes, cones = (state["text"] for (state,) in pages.said(tmp_path, robots, [[]] * 3))
    assert "in reach; no limits are stated" in free and "within all limits" not in free
    assert "within all limits" in strokes and "joint cones" not in strokes
    assert "within all limits" in cones and "joint cones" in cones


def test_a_pose_that_the_inverse_kinematics_does_not_lead_to_is_named(tmp_path: Path) -> None:
    """A carriage below its rod's other end: actuators get there, commands of poses do not."""
    robot = pk.load("linear-delta")
    (states,) = pages.said(tmp_path, [robot], [[["moveActuator", 0, 60.0]]])
    pose, q = states[-1]["pose"], states[-1]["q"]
    assert robot.forward(q, pose).ok and abs(robot.inverse(pose) - q).max() > 100.0
    assert "actuator 1: the limb has passed a dead point" in states[-1]["text"]
    assert "dead point" not in states[0]["text"]


def test_actuators_that_cannot_move_alone_are_not_offered(tmp_path: Path) -> None:
    belts = pk.load(ROOT / "examples" / "belts" / "robot.toml")
    ((one,), (other,)) = pages.said(tmp_path, [belts, pk.load("hexapod")], [[], []])
    assert "more of them than ways to move" in one["text"]
    assert "Move the actuators" in other["text"] and "Move the actuators" not in one["text"]


@pytest.mark.parametrize(("name", "kinds"), [
    ("hexapod", ("quadratic", "spool", "backlash")), ("6-rus", ("harmonics", "table")),
    ("linear-delta-6", ("quadratic", "harmonics")), ("tricept", ("quadratic", "table")),
])  # fmt: skip
def test_machines_with_drive_laws_are_moved_by_their_readings(
    name: str, kinds: tuple[str, ...], tmp_path: Path
) -> None:
    robot = driven.with_laws(pk.load(name), np.random.default_rng(3), kinds)
    assert robot.model.driven
    poses = pk.sample_poses(robot, 2, seed=1, share=0.3)
    moves: list[list[Any]] = [
        ["movePose", j, float(pose[POSE.index(n)])]
        for pose in poses
        for j, n in enumerate(robot.moved)
    ]
    last = robot.inverse(poses[-1])
    step = np.where(np.array(robot.actuator_units) == "rad", 0.02, 3.0) / np.abs(slopes(robot))
    moves += [["moveActuator", a, float(q + step[a])] for a, q in enumerate(last)]
    (states,) = pages.said(tmp_path, [robot], [moves])
    for move, state in zip([["home"], *moves], states, strict=True):
        assert not state["stopped"], move
        q, pose = np.array(state["q"]), np.array(state["pose"])
        np.testing.assert_allclose(q, robot.inverse(pose), rtol=0, atol=1e-7 * (1 + abs(q).max()))
        off = np.abs(robot.forward(q, pose).pose - pose)
        assert off.max() < 1e-7
        kept = robot.feasible(pose, q)
        said = [np.inf if each["stroke"] is None else each["stroke"] for each in state["limits"]]
        np.testing.assert_allclose(said, kept.stroke_margin, atol=1e-6)


def slopes(robot: pk.Robot) -> np.ndarray:
    """How far drives go by their readings at home, those of each actuator alike."""
    q, h = robot.inverse(robot.home), 1e-4
    ways = [robot.machine.drives(robot.slots, (q + d)[None])[0] for d in (-h, h)]
    found = np.zeros(len(q))
    for drive, slope in zip(robot.model.drives, (ways[1] - ways[0]) / (2 * h), strict=True):
        found[drive.actuator] = slope
    return found


def test_a_machine_with_errors_is_shown_where_it_can_be(tmp_path: Path) -> None:
    """At the home that its file states it is not: coordinates that it does not move follow."""
    nominal = pk.load("tricept")
    errors = np.random.default_rng(2).normal(0, 1, len(nominal.model.free))
    sizes = [0.2 if name[-2:] in ("dx", "dy", "dz") else 3e-4 for name in nominal.model.free]
    robot = nominal.replace(dict(zip(nominal.model.free, errors * sizes, strict=True)))
    assert robot.violation(robot.home) > 0.01
    ((home, *modes),) = pages.said(
        tmp_path, [robot], [[["takeMode", k] for k in range(len(page_modes(robot)))]]
    )
    assert modes
    for state in (home, *modes):
        pose, q = np.array(state["pose"]), np.array(state["q"])
        np.testing.assert_allclose(robot.forward(q, pose).pose, pose, atol=1e-7)
        np.testing.assert_allclose(q, home["q"], atol=1e-9)
    assert [home["pose"][k] for k in range(3)] == pytest.approx(robot.home[:3], abs=1e-8)


def page_modes(robot: pk.Robot) -> list[list[float]]:
    found: list[list[float]] = page.machine(robot, cloud=False)["modes"]["poses"]
    return found


def framed() -> pk.Robot:
    """A 3-RPS that stands upright on a stand, with a tool."""
    base, tool = np.array([100.0, 0, 50, np.pi / 2, 0, 0]), np.array([0.0, 0, 120, 0, 0.25, 0])
    model = dataclasses.replace(pk.load("3rps").model, base_frame=base, tool_frame=tool)
    return pk.Robot(dataclasses.replace(model, match=("y", "alpha", "gamma")))


def test_poses_are_in_the_users_frames(tmp_path: Path) -> None:
    robot = framed()
    target = pk.sample_poses(robot, 1, seed=2, share=0.3)[0]
    moves = [["movePose", j, float(target[POSE.index(n)])] for j, n in enumerate(robot.moved)]
    (states,) = pages.said(tmp_path, [robot], [moves])
    np.testing.assert_allclose(states[-1]["pose"], target, atol=1e-7)
    np.testing.assert_allclose(states[-1]["q"], robot.inverse(states[-1]["pose"]), atol=1e-9)
    np.testing.assert_allclose(states[0]["pose"], robot.home, rtol=0, atol=1e-12)


def test_of_an_arm_forward_is_pythons_to_the_bit_and_inverse_leads_back(tmp_path: Path) -> None:
    arms = [pk.load("3r"), six_joints(), telescope()]
    moves = []
    for arm, theta in zip(arms, THETAS, strict=True):
        tool = pk.screw.to_pose(arm.forward(theta))
        ends = [[0, tool[0] + 9.0], [2, tool[2] - 12.0], [4, tool[4] + 0.1]][
            : arm.n_actuators // 2 + 1
        ]
        turns = [["moveActuator", a, x] for a, x in enumerate(theta)]
        moves.append(turns + [["movePose", k, float(x)] for k, x in ends])
    for arm, asked, states in zip(arms, moves, pages.said(tmp_path, arms, moves), strict=True):
        for (verb, k, value), state in zip(asked, states[1:], strict=True):
            assert not state["stopped"]
            tool = pk.screw.to_pose(arm.forward(state["q"]))
            np.testing.assert_array_equal(state["pose"], tool)
            there = state["pose"][k] if verb == "movePose" else state["q"][k]
            assert there == pytest.approx(value, abs=1e-8)
        jacobian = arm.jacobian(states[-1]["q"], frame="tip")
        jacobian[:3] *= arm.length
        rows = jacobian if arm.n_actuators == 6 else jacobian[3:]
        sigma = np.linalg.svd(rows / arm.length, compute_uv=False)
        assert states[-1]["conditioning"] == pytest.approx(sigma[-1] / sigma[0], rel=1e-8)


THETAS = [0.3, 0.9, -1.2], [0.7, -0.4, 0.6, -0.8, 0.9, 0.3], [0.4, 0.6, -0.7]


def telescope() -> pk.SerialArm:
    """A link that follows the sum of the two before it and half of a third."""
    axes, points = [[0, 0, 1], [0, 1, 0], [0, 1, 0], [0, 1, 0]], [[0, 0, 100 * i] for i in range(4)]
    follows = {3: {2: -0.5, 4: 0.25}}
    arm = pk.SerialArm(axes, points, [250, 0, 300, 0, 0, 0], name="linked", follows=follows)
    return arm.replace(np.random.default_rng(1).normal(0, [1, 1, 1, 0.01, 0.01, 0.01], (4, 6)))


def six_joints() -> pk.SerialArm:
    """An elbow arm with a spherical wrist, and joint errors."""
    arm = pk.SerialArm.from_dh(
        a=[50, 300, 30, 0, 0, 0],
        alpha=np.radians([-90, 0, -90, 90, -90, 0]),
        d=[400, 0, 0, 310, 0, 80],
        name="six joints",
    )
    return arm.replace(np.random.default_rng(0).normal(0, [1, 1, 1, 0.01, 0.01, 0.01], (6, 6)))


# --- the command ---------------------------------------------------------------------------------


def test_show_writes_beside_and_replaces_its_own(
    run: Any, refused: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = run("show", "hexapod")
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout == "hexapod.html: hexapod; open it in a browser\n"
    made = (tmp_path / "hexapod.html").read_bytes()
    run("show", "hexapod")
    assert (tmp_path / "hexapod.html").read_bytes() == made
    (tmp_path / "hexapod.html").write_bytes(made + b"mine")
    assert "would be replaced" in refused("show", "hexapod")
    assert (tmp_path / "hexapod.html").read_bytes() == made + b"mine"
    assert run("show", "3r", "--out", tmp_path / "a" / "arm.html").exit_code == 0
    assert (tmp_path / "a" / "arm.html").exists()


# --- the WebAssembly -----------------------------------------------------------------------------


def test_the_webassembly_is_what_the_sources_give() -> None:
    done = subprocess.run(
        [sys.executable, ROOT / "csrc/view/build.py", "--check"], capture_output=True, text=True
    )
    if "is needed" in done.stderr:
        pytest.skip(done.stderr.strip())
    assert done.returncode == 0, done.stderr


def test_limits_of_an_arm_are_those_of_its_urdf_file(tmp_path: Path) -> None:
    """Joints start within them; beyond, the page says so. The last joint is free."""
    joint = (
        '<joint name="j{0}" type="{1}"><parent link="l{2}"/><child link="l{0}"/>'
        '<origin xyz="0.1 0 0.3"/><axis xyz="{3}"/>{4}</joint>'
    )
    limit = '<limit lower="-4.0" upper="0.1" effort="1" velocity="1"/>'
    joints = joint.format(1, "revolute", 0, "0 0 1", limit)
    joints += joint.format(2, "revolute", 1, "0 1 0", limit)
    joints += joint.format(3, "continuous", 2, "0 1 0", "") + joint.format(
        4, "fixed", 3, "1 0 0", ""
    )
    links = "".join(f'<link name="l{i}"/>' for i in range(5))
    (tmp_path / "arm.urdf").write_text(f'<robot name="arm">{links}{joints}</robot>', "utf-8")
    arm = pk.load(tmp_path / "arm.urdf")
    drawn = page.machine(arm)["actuators"]
    assert [each["stroke"] for each in drawn] == [[-4.0, 0.1], [-4.0, 0.1], None]
    assert drawn[0]["range"] == [-4.0, np.pi]
    moves = [["moveActuator", 1, 0.5], ["moveActuator", 1, -3.9], ["moveActuator", 2, 3.0]]
    (states,) = pages.said(tmp_path, [arm], [moves])
    assert states[0]["q"][:2] == [0.1, 0.1]
    told = ["joint 2: limits exceeded" in state["text"] for state in states]
    assert told == [False, True, False, False]
    assert "within all limits" in states[0]["text"]
