"""`check_geometry` finds the mistakes that tables have, and nothing where there is none."""

from __future__ import annotations

import ast
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.cli.new import template

from ..mutations import BASE, MUTATIONS, PLATFORM, manufactured, similar, with_model, with_slots
from ..workspaces import CHAINS

MACHINES = tuple(name for name in pk.machines() if name not in ("3r", *CHAINS))
GOOD = tuple(name for name in MACHINES if name != "rbt-6t03p-printed")
# True findings: what the papers state about their machines and what they tabulate.
EXPECTED = {
    "2tpr2tps": [f"base{i}.x is 294.2 mm; 292.4 mm is stated" for i in (1, 2)],
    "rbt-6t03p": [
        "base_diameter is 259.48 mm; 129.74 mm is stated",
        "platform_diameter is 131 mm; 65.5 mm is stated",
    ],
}


def found(robot: pk.Robot) -> set[str]:
    return {finding.what for finding in pk.check_geometry(robot).findings}


@pytest.mark.parametrize("name", GOOD)
def test_good_machines_have_only_their_true_findings(name: str) -> None:
    check = pk.check_geometry(pk.load(name))
    assert [finding.what for finding in check.findings] == EXPECTED.get(name, [])
    assert all(finding.kind == "stated" for finding in check.findings)


def test_the_diameters_of_the_paper_are_radii() -> None:
    for finding in pk.check_geometry(pk.load("rbt-6t03p")).findings:
        assert "a radius, where a diameter is named?" in finding.suggestion


def test_the_mistake_of_table_1_is_found() -> None:
    check = pk.check_geometry(pk.load("rbt-6t03p-printed"))
    assert check.kinds == ("angle", "alike", "singular", "stated")
    angle, alike, singular = check.findings[:3]
    assert "27.82 to 27.82 deg apart" in angle.what
    assert "circles of radius 129.74 and 65.5 mm all legs are 223.00035" in angle.suggestion
    assert alike.limbs == (3,)
    assert "514.126 mm in limb 3, 212.57 mm with the others" in alike.what
    assert "every one of" in singular.what


def test_every_finding_has_numbers_and_a_suggestion() -> None:
    rng = np.random.default_rng(0)
    for mutation in MUTATIONS.values():
        made = mutation(pk.load("hexapod"), rng) or mutation(pk.load("rbt-6t03p"), rng)
        for finding in pk.check_geometry(made).findings if made is not None else ():
            assert finding.suggestion
            assert re.search(r"\d", finding.what) or finding.kind in ("order", "stroke")


# --- mutations -----------------------------------------------------------------------------------


def rate(name: str, machines: tuple[str, ...], count: int) -> tuple[int, int]:
    """How often one kind of mistake is found, and how often it was made."""
    hits = made = 0
    for machine in machines:
        robot, rng = pk.load(machine), np.random.default_rng(7)
        for _ in range(count):
            wrong = MUTATIONS[name](robot, rng)
            if wrong is not None:
                made += 1
                hits += bool(found(wrong) - set(EXPECTED.get(machine, [])))
    return hits, made


@pytest.mark.parametrize("name", MUTATIONS)
def test_mistakes_are_found(name: str) -> None:
    hits, made = rate(name, ("hexapod", "rbt-6t03p", "rotary-delta"), 4)
    assert hits == made > 0


# What each mistake is called, where it is one thing.
KIND = {
    "copied": "double",
    "exchanged_rows": "order",
    "swapped": "swapped",
    "mirrored": "order",
    "metres": "unit",
    "inches": "unit",
    "stroke_in_metres": "unit",
    "degrees_as_coordinates": "angle",
    "radians_as_degrees": "angle",
    "similar": "singular",
}


@pytest.mark.parametrize("name", KIND)
def test_mistakes_are_called_what_they_are(name: str) -> None:
    for machine in ("hexapod", "rbt-6t03p", "2tpr2tps", "linear-delta"):
        wrong = MUTATIONS[name](pk.load(machine), np.random.default_rng(5))
        if wrong is not None:
            assert KIND[name] in pk.check_geometry(wrong).kinds


@pytest.mark.parametrize("shared", ["platform", "both"])
def test_hexapods_whose_limbs_share_joints_are_good(shared: str) -> None:
    """6-3 and 3-3: limbs meet in pairs at the platform, 6 with 1 too; and at the base, shifted."""
    robot = pk.load("hexapod")
    slots = robot.geometry.slots.copy()
    upper = np.radians([0, 120, 120, 240, 240, 0])
    slots[:, 3:5] = 125.0 * np.column_stack([np.cos(upper), np.sin(upper)])
    lower = np.radians([60, 60, 180, 180, 300, 300] if shared == "both" else
                       [50, 70, 170, 190, 290, 310])  # fmt: skip
    slots[:, 0:2] = 325.0 * np.column_stack([np.cos(lower), np.sin(lower)])
    assert pk.check_geometry(with_slots(robot, slots)).ok


@pytest.mark.slow
@pytest.mark.parametrize("name", MUTATIONS)
def test_mistakes_are_found_on_all_machines(name: str) -> None:
    hits, made = rate(name, GOOD, 30)
    assert hits >= 0.99 * made > 0


@pytest.mark.parametrize(("share", "most"), [(0.001, 0.0), (0.002, 0.0), (0.005, 0.25)])
def test_errors_of_manufacture_raise_no_alarm(share: float, most: float) -> None:
    """Every length in error, by this share of the machine's size as sigma."""
    alarms, made = 0, 0
    for machine in GOOD:
        robot, rng = pk.load(machine), np.random.default_rng(3)
        for _ in range(4):
            check = pk.check_geometry(manufactured(robot, rng, share))
            made += 1
            alarms += any(kind != "stated" for kind in check.kinds)
    assert alarms <= most * made


# --- single checks -------------------------------------------------------------------------------


@pytest.mark.parametrize("machine", ["3rps", "3prs"])
@pytest.mark.parametrize("normal", ["[1.0, 0.0, 0.0]", "[0.0, 1.0, 0.2]", "[-0.866, -0.5, 0.0]"])
def test_a_limb_that_its_plane_keeps_from_home_is_named(
    machine: str, normal: str, tmp_path: Path
) -> None:
    """A plane that is radial, oblique or another limb's, where limb 1 has the one of y = 0."""
    text = template(machine).replace("normal = [0.0, 1.0, 0.0]", f"normal = {normal}", 1)
    (tmp_path / "robot.toml").write_text(text, encoding="utf-8")
    robot = pk.load(tmp_path / "robot.toml")
    n = np.array(ast.literal_eval(normal)) / np.linalg.norm(ast.literal_eval(normal))
    drive = robot.inverse(robot.home)[0] if machine == "3prs" else 0.0
    joint = robot.home[:3] + robot.geometry.slots[0, PLATFORM] - robot.geometry.slots[0, BASE]
    missed = abs(n @ (joint - [0.0, 0.0, drive]))
    homes = [each for each in pk.check_geometry(robot).findings if each.kind == "home"]
    assert [each.limbs for each in homes] == [(1,)]
    assert f"limb 1 cannot close: {missed:.4g} mm" in homes[0].what


def test_a_joint_off_its_circle_is_named_with_its_distance() -> None:
    robot = pk.load("hexapod")
    x = robot.geometry["base2.x"]
    y = robot.geometry["base2.y"] - 40
    check = pk.check_geometry(robot.replace({"base2.x": -x, "base2.y": y}))
    circle = next(finding for finding in check.findings if finding.kind == "circle")
    away = 325.0 - np.hypot(x, y)
    assert circle.limbs == (2,)
    assert f"is {away:.4g} mm off the circle of radius 325 mm" in circle.what


def test_a_circle_need_not_be_about_the_axis() -> None:
    robot = pk.load("hexapod")
    slots = robot.geometry.slots.copy()
    slots[:, 0] += 500.0
    slots[4, 1] += 60.0
    check = pk.check_geometry(with_slots(robot, slots))
    circles = [finding for finding in check.findings if finding.kind == "circle"]
    assert [finding.limbs for finding in circles] == [(5,)]
    assert "about (500, " in circles[0].what


def test_similar_platforms_are_singular_in_every_pose() -> None:
    wrong = similar(pk.load("hexapod"), np.random.default_rng(0))
    assert wrong is not None
    singular = next(f for f in pk.check_geometry(wrong).findings if f.kind == "singular")
    assert "every one of 201 poses" in singular.what
    assert "affine image of the base joints" in singular.what


def test_affine_images_that_are_not_similar_are_singular_too() -> None:
    robot = pk.load("hexapod")
    slots = robot.geometry.slots.copy()
    slots[:, 3:5] = slots[:, 0:2] @ np.array([[0.4, 0.1], [-0.05, 0.3]])
    assert "singular" in pk.check_geometry(with_slots(robot, slots)).kinds


def test_a_singular_home_is_distinguished_from_a_singular_machine() -> None:
    robot = pk.load("hexapod")
    home = np.array([0, 0, 800, 0, 0, np.pi / 2])  # a quarter turn: Fichter's singularity
    check = pk.check_geometry(with_model(robot, home=home, limbs=tuple(
        _without_stroke(limb) for limb in robot.model.limbs
    )))  # fmt: skip
    singular = next(finding for finding in check.findings if finding.kind == "singular")
    assert singular.what.startswith("home is singular")


def _without_stroke(limb: Any) -> Any:
    from dataclasses import replace

    return replace(limb, stroke=None)


def test_home_in_another_unit_is_named() -> None:
    robot = pk.load("hexapod")
    home = robot.model.home.copy()
    home[2] = 800.0 / 25.4
    unit = next(
        f for f in pk.check_geometry(with_model(robot, home=home)).findings if f.kind == "unit"
    )
    assert "home in inches" in unit.what


def test_degrees_where_radians_are_meant_are_named() -> None:
    robot = pk.load("rotary-delta").replace({"offset1": 45.0})
    angle = next(f for f in pk.check_geometry(robot).findings if f.kind == "angle")
    assert angle.what == "offset1 is 45 rad, 2578.31 deg"


@pytest.mark.parametrize("degrees", [-30.0, 25.4, 180.0])
def test_a_home_in_degrees_where_radians_are_meant_is_named(degrees: float) -> None:
    robot = pk.load("3rrr-planar")
    for turn, found in ((degrees, True), (np.radians(degrees), False)):
        home = (*robot.model.home[:5], turn)
        angles = [
            f.what
            for f in pk.check_geometry(with_model(robot, home=home)).findings
            if f.kind == "angle"
        ]
        assert any(what.startswith("home gamma is") for what in angles) is found


def test_stated_numbers_name_the_likely_unit(tmp_path: Path) -> None:
    text = (
        (Path(pk.__file__).parent / "builtin" / "machines")
        .joinpath("linear-delta.toml")
        .read_text()
    )
    for stated, words in (("0.215", "metres"), ("107.5", "radius"), ("216.5", "contradict")):
        file = tmp_path / "delta.toml"
        file.write_text(text.replace("rod = 215.0", f"rod = {stated}", 1))
        (finding,) = pk.check_geometry(pk.load(file)).findings
        assert words in finding.suggestion


@pytest.mark.parametrize("name", MACHINES)
def test_nonsense_is_checked_without_a_failure(name: str) -> None:
    robot, rng = pk.load(name), np.random.default_rng(0)
    points = robot.geometry.slots[:, :6]
    for nonsense in (
        np.zeros_like(points),
        np.ones_like(points),
        rng.normal(size=points.shape) * 1e-8,
        rng.normal(size=points.shape) * 1e8,
    ):
        slots = robot.geometry.slots.copy()
        slots[:, :6] = nonsense
        check = pk.check_geometry(with_slots(robot, slots))
        assert not check.ok and str(check)


# --- serial arms -----------------------------------------------------------------------------


def test_nothing_is_found_in_built_in_arms_nor_in_calibrated_ones() -> None:
    arm, rng = pk.load("3r"), np.random.default_rng(0)
    assert pk.check_geometry(arm).ok
    for _ in range(20):
        errors = rng.normal(0.0, [1.0, 1.0, 1.0, 0.01, 0.01, 0.01], (3, 6))
        assert pk.check_geometry(arm.replace(errors)).ok
        assert pk.check_geometry(arm.replace(errors).corrected()).ok


def test_an_arm_of_which_all_axes_meet_has_no_length_of_another_unit() -> None:
    """A positioner: its numbers are angles alone."""
    turns = pk.SerialArm.from_dh(a=[0, 0], d=[0, 0], alpha=[np.pi / 2, 0], theta=np.zeros(2))
    assert "unit" not in {each.kind for each in pk.check_geometry(turns).findings}


def test_an_arm_in_metres_is_found() -> None:
    arm = pk.load("3r")
    home = arm.home
    home[:3, 3] /= 1000.0
    found = pk.check_geometry(pk.SerialArm(arm.axes, arm.points / 1000.0, home))
    assert found.kinds == ("unit",)
    assert "is 0.794 mm" in str(found) and "metres" in str(found)  # the tool: hypot(0.6, 0.52)


@pytest.mark.parametrize(
    ("place", "value", "kind", "words"),
    [
        ((1, 3), 0.5, "angle", "joint2.dphi is 0.5 rad, 28.6479 deg"),
        ((2, 5), -1.0, "angle", "joint3.dpsi is -1 rad"),
        ((0, 1), 150.0, "unit", "joint1.dy is 150 mm"),
    ],
)
def test_a_joint_error_in_another_unit_is_found(
    place: tuple[int, int], value: float, kind: str, words: str
) -> None:
    arm = pk.load("3r")
    errors = np.zeros((3, 6))
    errors[place] = value
    check = pk.check_geometry(arm.replace(errors))
    assert check.kinds == (kind,) and check.findings[0].limbs == (place[0] + 1,)
    assert words in str(check)


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_neighbours_on_one_axis_are_found_and_lose_a_rank(kind: str, sense: float) -> None:
    along = np.array([1.0, 2.0, 2.0]) / 3.0
    axes, points = [[0, 0, 1], along, sense * along], [[0, 0, 0], [0, 0, 520], [0, 0, 520]]
    points[2] = points[1] + 200.0 * along
    kinds = ["revolute", kind, kind]
    arm = pk.SerialArm(axes, points, [0, 600, 520, 0, 0, 0], kinds=kinds)
    assert np.linalg.matrix_rank(arm.jacobian([0.1, 0.2, 0.3])) == 2
    found = pk.check_geometry(arm).findings
    assert [(each.kind, each.limbs) for each in found] == [("double", (2, 3))]
    points[2] = points[2] + np.array([0.0, 0.1, -0.1])  # beside it: for a slide it is the same
    beside = pk.check_geometry(pk.SerialArm(axes, points, [0, 600, 520, 0, 0, 0], kinds=kinds))
    assert beside.ok == (kind == "revolute")


# --- the command -----------------------------------------------------------------------------


def test_exit_code_says_whether_something_was_found(run: Any) -> None:
    good, bad = run("check", "hexapod"), run("check", "rbt-6t03p-printed")
    assert (good.exit_code, good.stdout) == (0, "hexapod: no problems found\n")
    assert bad.exit_code == 1
    assert bad.stdout == f"{pk.check_geometry(pk.load('rbt-6t03p-printed'))}\n"
    assert run("check", "hexapd").exit_code == 2
    arm = run("check", "3r")
    assert (arm.exit_code, arm.stdout) == (0, "3R arm: no problems found\n")


def test_json_has_the_findings(run: Any) -> None:
    result = json.loads(run("check", "rbt-6t03p-printed", "--json").stdout)
    assert result["ok"] is False
    assert [each["kind"] for each in result["findings"]][:2] == ["angle", "alike"]
    assert result["measurements"] is None


def test_measurements_are_read_by_line_and_column(run: Any, tmp_path: Path) -> None:
    file = tmp_path / "m.csv"
    columns = ",".join(f"q{i} [mm]" for i in range(1, 7))
    file.write_text(f"{columns},z [mm]\n800,800,800,800,800,800,750\n")
    result = run("check", "hexapod", str(file))
    assert result.exit_code == 0
    assert "1 row of kind height" in result.stdout
    found = json.loads(run("check", "hexapod", str(file), "--json").stdout)
    assert found["measurements"] == {"kind": "height", "rows": 1, "without_pose": []}
    file.write_text(f"{columns},z [mm]\n800,800,x8,800,800,800,750\n")
    wrong = run("check", "hexapod", str(file))
    assert (wrong.exit_code, wrong.stdout) == (2, "")
    assert "line 2" in wrong.stderr and "q3" in wrong.stderr


def test_rows_without_a_pose_are_listed_in_json_too(run: Any, tmp_path: Path) -> None:
    log = tmp_path / "m.csv"
    log.write_text("q1 [rad],q2 [rad],q3 [rad],z [mm]\n0,0,0,520\n0,1e6,0,520\n")
    found = run("check", "3r", str(log), "--json")
    assert found.exit_code == 1
    assert json.loads(found.stdout)["measurements"]["without_pose"] == [1]
