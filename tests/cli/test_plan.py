"""`pkmcal plan`, and what `pkmcal calibrate` takes of trackers and wires."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.jobs.calibrating import read_tracker
from pkmcal.measurements.command_csv import read_commands
from pkmcal.measurements.pose_csv import read_poses

from ..simulated import hexapod_poses


def test_plan_prints_and_writes_what_plan_poses_finds(run: Any, tmp_path: Path) -> None:
    result = run("plan", "hexapod", "--kind", "pose", "--count", "12", "--out", "plan")
    assert (result.exit_code, result.stderr) == (0, "")
    robot = pk.load("hexapod")
    expected = pk.plan_poses(robot, pk.sample_poses(robot, 500, share=0.9), 12, kind="pose")
    assert result.stdout.startswith(str(expected))
    poses = read_poses(tmp_path / "plan" / "poses.csv", robot)
    np.testing.assert_allclose(poses, expected.poses, atol=1e-6)
    commands = read_commands(tmp_path / "plan" / "commands.csv", robot.actuator_units)
    np.testing.assert_array_equal(commands, expected.actuators)


def test_a_plan_stays_within_what_is_stated(run: Any, refused: Any) -> None:
    command = ("plan", "linear-delta", "--kind", "height", "--free", "offset*", "--count", "8")
    result = run(*command, "--within", "z=0:120,x=-40:40", "--within", "y=-10:90", "--json")
    poses = np.array(json.loads(result.stdout)["poses"])
    for k, (low, high) in enumerate([(-40, 40), (-10, 90), (0, 120)]):
        assert (low <= poses[:, k]).all() and (poses[:, k] <= high).all()
    assert "expected NAME=LO:HI" in refused(*command, "--within", "z=5")
    assert "'w' is no coordinate" in refused(*command, "--within", "w=5:6")
    assert "from 9 to 2 is nothing" in refused(*command, "--within", "z=9:2")
    assert "its middle is no pose that the machine can take" in refused(
        *command, "--within", "z=5000:6000"
    )


def test_a_plan_near_the_bed_needs_no_home_there(run: Any) -> None:
    """Printers have home far above the bed on which they probe."""
    command = ("plan", "linear-delta", "--kind", "height", "--free", "offset*", "--count", "6")
    home = pk.load("linear-delta").home[2]
    low, high = home - 60.0, home - 57.0
    poses = np.array(
        json.loads(run(*command, "--within", f"z={low}:{high}", "--json").stdout)["poses"]
    )
    assert len(poses) == 6 and (poses[:, 2] >= low).all() and (poses[:, 2] <= high).all()
    assert np.ptp(poses[:, 2]) > 0.5 * (high - low) and np.ptp(poses[:, 0]) > 100


def test_an_arm_stays_within_the_limits_of_its_urdf_file(
    run: Any, refused: Any, tmp_path: Path
) -> None:
    joint = (
        '<joint name="{0}" type="revolute"><parent link="l{1}"/><child link="l{2}"/>'
        '<origin xyz="0 0 0.3" rpy="0 0 0"/><axis xyz="{3}"/>{4}</joint>'
    )
    limit = '<limit lower="-0.5" upper="0.25" effort="1" velocity="1"/>'
    joints = [
        joint.format("a", 0, 1, "0 0 1", limit),
        joint.format("b", 1, 2, "0 1 0", limit),
        joint.format("c", 2, 3, "0 1 0", ""),
        '<joint name="tip" type="fixed"><parent link="l3"/><child link="l4"/>'
        '<origin xyz="0 0.1 0.3" rpy="0 0 0"/></joint>',
    ]
    links = "".join(f'<link name="l{i}"/>' for i in range(5))
    (tmp_path / "arm.urdf").write_text(f'<robot name="arm">{links}{"".join(joints)}</robot>')
    command = ("plan", "arm.urdf", "--free", "joint2.dx", "--free", "joint3.dx", "--count", "4")
    assert "the limits of q3 are not known" in refused(*command)
    q = np.array(json.loads(run(*command, "--within", "q3=-20:10", "--json").stdout)["actuators"])
    low, high = [-0.5, -0.5, np.radians(-20)], [0.25, 0.25, np.radians(10)]
    assert (low <= q).all() and (q <= high).all()


def test_commands_with_what_was_measured_beside_them_can_be_calibrated(
    run: Any, tmp_path: Path
) -> None:
    assert run("plan", "2tpr2tps", "--count", "12", "--prior", "0.5", "--out", ".").exit_code == 0
    robot = pk.load("2tpr2tps")
    written = (tmp_path / "commands.csv").read_text().splitlines()
    lines = [line for line in written if not line.startswith("#")]
    q = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])
    points = robot.replace({"offset1": 0.3}).forward(q).pose[:, :3]
    seen = [",".join(map(repr, point)) for point in points.tolist()]
    rows = map(",".join, zip(lines, ["x [mm],y [mm],z [mm]", *seen], strict=True))
    (tmp_path / "m.csv").write_text("\n".join(rows))
    result = run("calibrate", "2tpr2tps", "m.csv", "--free", "offset*", "--json")
    assert result.exit_code == 0
    assert json.loads(result.stdout)["parameters"]["offset1"]["value"] == pytest.approx(0.3)


def test_accuracy_finds_how_many_and_json_stands_alone(run: Any) -> None:
    options = ["--accuracy", "0.05", "--free", "offset*", "--json"]
    found = json.loads(run("plan", "rotary-delta", *options).stdout)
    assert found["predicted"] <= 0.05 and len(found["indices"]) == len(found["poses"])


def test_too_few_poses_are_not_to_be_trusted(run: Any) -> None:
    result = run("plan", "hexapod", "--count", "3")
    assert result.exit_code == 1
    assert "too few" in result.stdout


def test_candidates_and_targets_come_from_files(run: Any, tmp_path: Path) -> None:
    (tmp_path / "p.csv").write_text("x [mm],y [mm]\n0,0\n50,0\n0,50\n-50,-50\n60,10\n")
    arguments = ["--poses", "p.csv", "--targets", "p.csv", "--count", "3", "--free", "offset*"]
    result = run("plan", "linear-delta", *arguments, "--json")
    assert result.exit_code == 0
    assert set(json.loads(result.stdout)["indices"]) < set(range(5))


def test_postures_of_an_arm_are_chosen_from_a_file_of_joint_coordinates(
    run: Any, tmp_path: Path
) -> None:
    arm, degrees = pk.load("3r"), np.random.default_rng(0).uniform(-100, 100, (40, 3))
    rows = [",".join(map(repr, row)) for row in degrees.tolist()]
    (tmp_path / "c.csv").write_text("\n".join(["q1 [deg],q2 [deg],q3 [deg]", *rows]))
    arguments = ["3r", "--poses", "c.csv", "--targets", "c.csv", "--count", "8", "--kind", "pose"]
    result = run("plan", *arguments, "--out", "plan")
    assert (result.exit_code, result.stderr) == (0, "")
    # degrees of the file become radians, now and then another last bit: the same plan
    expected = pk.plan_poses(arm, np.radians(degrees), 8, kind="pose")
    assert result.stdout.startswith(str(expected))
    commands = read_commands(tmp_path / "plan" / "commands.csv", arm.actuator_units)
    np.testing.assert_allclose(commands, expected.actuators, rtol=1e-15)
    assert json.loads(run("plan", *arguments, "--json").stdout)["robot"]["name"] == "3R arm"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["hexapod", "--count", "0"], "count must be a whole number from 1 to"),
        (["hexapod", "--accuracy", "1e-9"], "accuracy: all"),
        (["hexapd"], "did you mean 'hexapod'"),
        (["3r"], "--poses: 3R arm is a serial arm"),
        (["hexapod", "--criterion", "E"], "criterion must be one of prediction, D, A"),
        (["hexapod", "--free", "ofset1"], "did you mean 'offset1'"),
        (["hexapod", "--poses", "none.csv"], "none.csv: no such file"),
    ],
)
def test_wrong_input_is_one_line_and_exit_code_2(
    run: Any, arguments: list[str], words: str
) -> None:
    result = run("plan", *arguments)
    assert result.exit_code == 2
    assert words in result.stderr and len(result.stderr.splitlines()) == 1


def test_calibrate_takes_a_trackers_noise(run: Any, tmp_path: Path) -> None:
    robot = pk.load("hexapod")
    q = robot.inverse(hexapod_poses(robot, 20, np.random.default_rng(0)))
    pk.VirtualMachine(robot).measure(q).write("m.csv")
    options = ["--tracker", "0.01,0.001,0.002,3000,0,0", "--free", "offset*", "--json"]
    found = json.loads(run("calibrate", "hexapod", "m.csv", *options).stdout)
    measured = pk.read_measurements("m.csv")
    tracker = pk.Tracker(0.01, *np.radians([0.001, 0.002]), position=(3000, 0, 0))
    stated = pk.Measurements(q, measured.values, sigma=tracker)
    expected = pk.identify(robot, stated, free="offset*")
    np.testing.assert_allclose(found["stderr"], expected.stderr, rtol=1e-9)
    assert read_tracker("0.01,0.001,0.002").position == (0, 0, 0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("0.01", "--tracker 0.01: expected RANGE,AZIMUTH,ELEVATION"),
        ("0.01,a,b", "expected RANGE,AZIMUTH,ELEVATION"),
        ("0.01,0,1", "--tracker 0.01,0,1: azimuth must be above 0"),
    ],
)
def test_a_tracker_that_is_none_is_named(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        read_tracker(text)


def test_calibrate_finds_where_wires_end(run: Any, tmp_path: Path) -> None:
    robot = pk.load("hexapod")
    q = robot.inverse(hexapod_poses(robot, 40, np.random.default_rng(1)))
    wire = pk.readings.Distance(attachment=[60, 20, 0])
    measured = pk.VirtualMachine(robot, 0.01).measure(q, wire, target=[400, 300, -100])
    measured.write("wire.csv")
    options = ["--free", "offset2", "--attachment", "unknown", "--json"]
    found = json.loads(run("calibrate", "hexapod", "wire.csv", *options).stdout)
    end = found["parameters"]["attachment1.x"]
    assert end["value"] == pytest.approx(60, abs=5 * end["stderr"])


def test_a_plan_of_two_instruments_has_commands_for_each(run: Any, refused: Any) -> None:
    arguments = (
        "plan", "hexapod", "--kind", "position=8,distance=5", "--target", "distance=0,0,-300",
        "--noise", "position=0.02,distance=0.005", "--free", "offset*",
    )  # fmt: skip
    done = run(*arguments, "--out", "plan")
    assert done.exit_code == 0 and "hexapod: measure 13 poses for 6 parameters" in done.stdout
    rows = {
        kind: len(read_commands(Path("plan") / f"commands-{kind}.csv", ("mm",) * 6))
        for kind in ("position", "distance")
    }
    assert rows == {"position": 8, "distance": 5} and not Path("plan/commands.csv").exists()
    table = Path("plan/poses.csv").read_text().splitlines()
    heads = next(line for line in table if not line.startswith("#"))
    assert heads.endswith(",gamma [deg],kind")
    assert sorted(line.rpartition(",")[2] for line in table[-13:]) == [
        *["distance"] * 5, *["position"] * 8,
    ]  # fmt: skip
    assert len(read_poses("plan/poses.csv", pk.load("hexapod"))) == 13
    lines = Path("plan/commands-distance.csv").read_text().splitlines()
    assert lines[-6].endswith(",target.x [mm],target.y [mm],target.z [mm]")
    assert all(line.endswith(",0.0,0.0,-300.0") for line in lines[-5:])
    assert "target" not in Path("plan/commands-position.csv").read_text().split("q1")[1]
    assert "without --count and --accuracy" in refused(*arguments, "--count", "3")
    assert "expected KIND=N" in refused("plan", "hexapod", "--kind", "position=x")
    assert "the plan has position; found 'pose'" in refused(
        "plan", "hexapod", "--kind", "position=3", "--noise", "pose=1"
    )
    assert "expected X,Y,Z in mm" in refused("plan", "hexapod", "--target", "1,2")
    assert "stands alone" in refused(
        "plan", "hexapod", "--kind", "pose=3", "--target", "1,2,3", "--target", "pose=1,2,3"
    )


def test_what_a_plan_of_two_reflectors_lists_is_calibrated_with_what_was_read(run: Any) -> None:
    """A row for each of them at each pose, with its place: only x, y and z have to be added."""
    arguments = ("plan", "hexapod", "--count", "8", "--free", "offset*")
    reflectors = ("--target", "100,0,50", "--target", "-80,60,50")
    assert run(*arguments, *reflectors, "--out", "plan").exit_code == 0
    lines = Path("plan/commands.csv").read_text().splitlines()
    heads = next(i for i, line in enumerate(lines) if line.startswith("q1"))
    robot = pk.load("hexapod")
    q = read_commands("plan/commands.csv", ("mm",) * 6)
    places = np.tile([[100.0, 0, 50], [-80, 60, 50]], (8, 1))
    assert len(q) == 16 and (q[::2] == q[1::2]).all()
    true = robot.replace({"offset2": robot.geometry["offset2"] + 0.7})
    seen = pk.VirtualMachine(true, 0.005).measure(q, "position", places).values
    cells = [",".join(map(repr, row)) for row in seen.tolist()]
    added = [*lines[:heads], lines[heads] + ",x [mm],y [mm],z [mm]"]
    added += [f"{line},{cell}" for line, cell in zip(lines[heads + 1 :], cells, strict=True)]
    Path("measured.csv").write_text("\n".join(added) + "\n")
    found = json.loads(
        run("calibrate", "hexapod", "measured.csv", "--free", "offset*", "--json").stdout
    )
    there = found["parameters"]["offset2"]
    assert there["value"] - robot.geometry["offset2"] == pytest.approx(0.7, abs=5 * there["stderr"])


def test_a_shorter_tour_has_its_price(run: Any) -> None:
    plain, short = (
        json.loads(run("plan", "2tpr2tps", "--prior", "0.5", "--travel-weight", w, "--json").stdout)
        for w in ("0", "1")
    )
    assert short["travel"] < 0.8 * plain["travel"] and short["predicted"] > plain["predicted"]
    assert short["travel_unweighted"] == plain["travel"] == plain["travel_unweighted"]


def test_a_plan_is_for_poses_beside_rows_of_a_file(run: Any, refused: Any, tmp_path: Path) -> None:
    robot = pk.load("hexapod")
    poses = pk.sample_poses(robot, 500, share=0.9)
    there = pk.VirtualMachine(robot, 0.03, seed=1).measure(robot.inverse(poses[:12]), "pose")
    there.write(tmp_path / "there.csv")
    command = ("plan", "hexapod", "--kind", "pose", "--noise", "0.03", "--count", "5")
    expected = pk.plan_poses(robot, poses, 5, kind="pose", noise=0.03, measured=there)
    assert run(*command, "--measured", "there.csv").stdout.startswith(str(expected))
    replace(there, sigma=None).write(tmp_path / "bare.csv")  # as what --noise says
    assert run(*command, "--measured", "bare.csv").stdout.startswith(str(expected))
    along = pk.plan_poses(robot, poses, 5, kind="pose", noise=0.03, direction=(0, 0, 1))
    assert run(*command, "--direction", "z").stdout.startswith(str(along))
    assert run(*command, "--direction", "0,0,1").stdout.startswith(str(along))
    assert "expected x, y or z" in refused(*command, "--direction", "up")
    assert "not all 0" in refused(*command, "--direction", "0,0,0")
