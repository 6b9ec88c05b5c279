"""Files as instruments and controllers write them lead to the same measurements."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from tests.files.instruments import LOGS, POINTS, POSES, TARGETS, Truth, log_struts, truth

TRUTH = truth()
ROBOT = pk.load("hexapod")
STATED = {"qualisys_markers": "mm", "abb_quaternions": ()}


def written(folder: Path, name: str, content: bytes) -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


def points_read(m: pk.Measurements) -> np.ndarray:
    """Positions (N, 3) in the order of poses and targets."""
    assert m.target_index is not None and m.target_names is not None
    by_name = [m.target_names[i].removeprefix("Plate:") for i in m.target_index]
    place = [list(TARGETS).index(name) for name in by_name]
    pose = np.array([int(np.argmin(np.abs(TRUTH.actuators - q).sum(axis=1))) for q in m.actuators])
    return m.values[np.lexsort((place, pose))]


@pytest.mark.parametrize("log", LOGS)
@pytest.mark.parametrize("instrument", POINTS)
def test_points_of_every_instrument_join_every_log(
    instrument: str, log: str, tmp_path: Path
) -> None:
    points = written(tmp_path, "points.txt", POINTS[instrument](TRUTH))
    logged = written(tmp_path, "log.csv", LOGS[log](TRUTH))
    units = STATED.get(instrument, ())
    m = pk.read_measurements(points, ROBOT, controller=logged, units=units)
    assert m.kind == "position" and len(m) == 3 * len(TRUTH.poses)
    np.testing.assert_allclose(
        np.unique(m.actuators, axis=0), np.unique(TRUTH.actuators, axis=0), atol=2e-6
    )
    np.testing.assert_allclose(points_read(m), TRUTH.points.reshape(-1, 3), atol=2e-5)
    assert any("joined with" in note for note in m.notes)


@pytest.mark.parametrize("instrument", POSES)
def test_poses_of_every_system_join_a_log(instrument: str, tmp_path: Path) -> None:
    poses = written(tmp_path, "poses.csv", POSES[instrument](TRUTH))
    logged = written(tmp_path, "log.csv", log_struts(TRUTH))
    m = pk.read_measurements(poses, ROBOT, controller=logged, join="row")
    assert m.kind == "pose"
    np.testing.assert_allclose(m.values, TRUTH.poses, atol=2e-5)


# --- what files do not say -----------------------------------------------------------------------


def read(folder: Path, text: str, robot: object = None, **how: object) -> pk.Measurements:
    return pk.read_measurements(written(folder, "m.csv", text.encode()), robot, **how)  # type: ignore[arg-type]


def quaternions(order: str, heads: str) -> str:
    """Poses with a quaternion whose parts are in this order under those headings."""
    parts = TRUTH.turns.as_quat()[:, [3, 0, 1, 2] if order == "wxyz" else [0, 1, 2, 3]]
    lines = [",".join(f"J{i} [mm]" for i in range(1, 7)) + ",x [mm],y [mm],z [mm]," + heads]
    rows = np.hstack([TRUTH.actuators, TRUTH.poses[:, :3], parts])
    return "\n".join(lines + [",".join(f"{v:.9f}" for v in row) for row in rows])


@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
def test_the_order_of_a_quaternion_is_told_by_the_machine_and_said(
    order: str, tmp_path: Path
) -> None:
    m = read(tmp_path, quaternions(order, "Q1,Q2,Q3,Q4"), ROBOT)
    np.testing.assert_allclose(m.values, TRUTH.poses, atol=1e-6)
    assert f"'Q4' taken as {order}: off by" in m.notes[0]


def test_without_a_machine_the_order_of_a_quaternion_has_to_be_stated(tmp_path: Path) -> None:
    text = quaternions("xyzw", "Q1,Q2,Q3,Q4")
    with pytest.raises(pk.FileError, match=r"line 1: columns 'Q1' .* --rotation, such as wxyz or"):
        read(tmp_path, text)
    np.testing.assert_allclose(read(tmp_path, text, rotation="xyzw").values, TRUTH.poses, atol=1e-6)


def test_a_quaternion_under_headings_of_another_order_is_refused_by_its_residual(
    tmp_path: Path,
) -> None:
    with pytest.raises(pk.FileError, match=r"'qw' 'qx' .* as wxyz, by .* deg as .*xyzw"):
        read(tmp_path, quaternions("xyzw", "qw,qx,qy,qz"), ROBOT)


def test_a_quaternion_of_the_inverse_is_named(tmp_path: Path) -> None:
    turned = Truth(TRUTH.poses.copy(), TRUTH.actuators, TRUTH.points)
    turned.poses[:, 3:] = TRUTH.turns.inv().as_euler("xyz")
    rows = np.hstack([TRUTH.actuators, TRUTH.poses[:, :3], turned.turns.as_quat()])
    head = ",".join(f"J{i} [mm]" for i in range(1, 7)) + ",x [mm],y [mm],z [mm],qx,qy,qz,qw"
    text = "\n".join([head] + [",".join(f"{v:.9f}" for v in row) for row in rows])
    with pytest.raises(pk.FileError, match=r"turned round \(--invert-poses\)"):
        read(tmp_path, text, ROBOT)


@pytest.mark.parametrize("order", ["XYZ", "ZYX", "zyx", "xyz", "YXZ", "rotvec"])
def test_angles_of_any_order_are_read_as_stated(order: str, tmp_path: Path) -> None:
    """Rx, Ry, Rz are about x, y, z, whichever is turned first."""
    turns = TRUTH.turns
    if order == "rotvec":
        angles = turns.as_rotvec()
    else:
        angles = turns.as_euler(order)[:, [order.lower().index(axis) for axis in "xyz"]]
    rows = np.hstack([TRUTH.actuators, TRUTH.poses[:, :3], np.degrees(angles)])
    head = ",".join(f"J{i} [mm]" for i in range(1, 7))
    head += ",X [mm],Y [mm],Z [mm],Rx [deg],Ry [deg],Rz [deg]"
    text = "\n".join([head] + [",".join(f"{v:.9f}" for v in row) for row in rows])
    m = read(tmp_path, text, ROBOT, rotation=order)
    np.testing.assert_allclose(m.values, TRUTH.poses, atol=1e-6)
    with pytest.raises(pk.FileError, match="makers mean different angles") as refused:
        read(tmp_path, text, ROBOT)
    assert f"{order} (" in str(refused.value)


def test_a_wrong_order_of_angles_is_refused_with_the_one_that_fits(tmp_path: Path) -> None:
    """R = Rz Ry Rx is not R = Rx Ry Rz: far enough apart where all three are large."""
    robot = pk.SerialArm.from_dh(a=[0, 300, 50], alpha=[1.5, 0, 1.5], d=[200, 0, 100])
    q = np.random.default_rng(1).uniform(-1.5, 1.5, (20, 3))
    motions = robot.forward(q)
    from scipy.spatial.transform import Rotation

    angles = Rotation.from_matrix(motions[:, :3, :3]).as_euler("ZYX")
    rows = np.hstack([q, motions[:, :3, 3], angles])
    text = "j1 [rad],j2 [rad],j3 [rad],x [mm],y [mm],z [mm],A [rad],B [rad],C [rad]\n"
    text += "\n".join(",".join(f"{v:.9f}" for v in row) for row in rows)
    assert read(tmp_path, text, robot, rotation="ZYX").kind == "pose"
    with pytest.raises(pk.FileError, match=r"as XYZ, by .* deg as "):
        read(tmp_path, text, robot, rotation="XYZ")


def test_lengths_in_steps_are_those_that_the_gains_make_of_them(tmp_path: Path) -> None:
    robot = pk.load("linear-delta").replace({f"gain{i}": -0.0125 for i in (1, 2, 3)})
    m = read(tmp_path, "q1 [steps],q2 [steps],q3 [steps],z [mm]\n1000,2000,3000,0\n", robot)
    assert m.actuators.tolist() == [[1000, 2000, 3000]]
    assert "converted by the robot's gain (-0.0125 mm each)" in m.notes[0]
    with pytest.raises(pk.FileError, match="does not state how much one is: set the gain"):
        read(tmp_path, "q1 [steps],q2 [mm],q3 [mm],z [mm]\n1,2,3,0\n", pk.load("linear-delta"))


def test_revolutions_of_a_turning_joint_are_angles(tmp_path: Path) -> None:
    m = read(tmp_path, "q1 [rev],q2 [arcsec],z [mm]\n0.25,3600,0\n")
    np.testing.assert_allclose(m.actuators, [[np.pi / 2, np.radians(1)]], rtol=1e-15)


def test_unknown_columns_are_left_out_in_one_line(tmp_path: Path) -> None:
    m = read(tmp_path, "q1 [mm],z [mm],Humidity,Operator\n1,2,40,someone\n")
    assert m.notes == (f"{tmp_path / 'm.csv'}: unknown columns left out: 'Humidity', 'Operator'",)


@pytest.mark.parametrize("head", ["sigmas [mm]", "taget", "grp1,groups"])
def test_a_column_that_is_nearly_a_known_one_is_refused(head: str, tmp_path: Path) -> None:
    cells = ",1" * (head.count(",") + 1)
    with pytest.raises(pk.FileError, match=r"unknown column .*did you mean"):
        read(tmp_path, f"q1 [mm],z [mm],{head}\n1,2{cells}\n")
    names = [name.partition(" ")[0] for name in head.split(",")]
    assert read(tmp_path, f"q1 [mm],z [mm],{head}\n1,2{cells}\n", ignore=names).sigma is None


def test_a_sigma_without_unit_has_that_of_its_coordinates(tmp_path: Path) -> None:
    m = read(tmp_path, "q1 [mm],x [um],y [um],z [um],Std\n1,2,3,4,10\n")
    assert m.sigma is not None and m.sigma.tolist() == [[0.01] * 3]
    assert "'Std' has no unit, taken as [um] like 'x'" in m.notes[0]


def test_columns_are_renamed_and_given_units(tmp_path: Path) -> None:
    m = read(tmp_path, "Lg,Ht\n1,2\n", rename={"Lg": "q1 [mm]", "Ht": "z"}, units="cm")
    assert (m.actuators.tolist(), m.values.tolist()) == ([[1.0]], [20.0])
    with pytest.raises(pk.FileError, match="no column 'Lh' to ignore or rename"):
        read(tmp_path, "Lg,Ht\n1,2\n", rename={"Lh": "q1 [mm]"})


def test_a_file_without_column_names_takes_stated_ones(tmp_path: Path) -> None:
    with pytest.raises(pk.FileError, match="line 1: found 2 cells with numbers"):
        read(tmp_path, "1,2\n3,4\n")
    m = read(tmp_path, "1,2\n3,4\n", header=["q1 [mm]", "z [mm]"])
    assert (m.actuators[:, 0].tolist(), m.values.tolist()) == ([1, 3], [2, 4])


def test_an_unstated_unit_is_never_guessed(tmp_path: Path) -> None:
    with pytest.raises(pk.FileError, match="'z' has no unit"):
        read(tmp_path, "# Units: mm and inches, who knows\nq1 [mm],z\n1,2\n# unit in\n")


# --- two files -----------------------------------------------------------------------------------


def two(folder: Path, points: str, log: str, join: str = "auto") -> pk.Measurements:
    logged = written(folder, "log.csv", log.encode())
    return read(folder, points, controller=logged, join=join)


def test_rows_are_joined_by_the_last_log_before_a_time_stamp(tmp_path: Path) -> None:
    points = "Time,z [mm]\n2026-03-02 10:00:07,1\n2026-03-02 10:00:13.5,2\n2026-03-02 10:00:29,3\n"
    log = "Timestamp;q1 [mm]\n02.03.2026 10:00:00;10\n02.03.2026 10:00:10;20\n"
    m = two(tmp_path, points, log + "02.03.2026 10:00:20;30\n02.03.2026 10:00:30;40\n")
    assert m.actuators[:, 0].tolist() == [10, 20, 30]
    assert "by time: each point has the last row at or before it, 3.5 to 9 s earlier" in m.notes[0]


def test_reference_points_without_a_row_of_the_log_are_left_out(tmp_path: Path) -> None:
    points = "Point ID,z [mm]\nREF1,0\nP1,1\nP2,2\nP3,3\nREF2,0\n"
    m = two(tmp_path, points, "Name,q1 [mm]\nP3,30\nP1,10\nP2,20\nP4,40\n")
    assert m.actuators[:, 0].tolist() == [10, 20, 30] and m.values.tolist() == [1, 2, 3]
    assert (
        "2 of 5 points without a row left out: lines 2, 6; 1 of its 4 rows not used" in m.notes[0]
    )


def test_rows_are_joined_in_order_only_where_nothing_else_fits(tmp_path: Path) -> None:
    m = two(tmp_path, "z [mm]\n1\n2\n", "q1 [mm]\n10\n20\n")
    assert m.actuators[:, 0].tolist() == [10, 20] and "by row: 2 rows in the same" in m.notes[0]
    with pytest.raises(pk.FileError, match=r"by name: .*; by time: .*; by row: 3 and 2 rows"):
        two(tmp_path, "z [mm]\n1\n2\n3\n", "q1 [mm]\n10\n20\n")


def test_a_number_in_a_targets_name_is_no_pose(tmp_path: Path) -> None:
    """P01_SMR2 is pose 1: the 2 would join every point of SMR2 with one row."""
    points = "Point,x [mm],y [mm],z [mm]\n"
    points += "".join(f"P0{i}_SMR{k},0,0,{i}\n" for i in (1, 2, 3) for k in (1, 2))
    m = two(tmp_path, points, "No,Pose,q1 [mm]\n" + "".join(f"9,{i},{i}0\n" for i in (1, 2, 3)))
    assert m.actuators[:, 0].tolist() == [10, 10, 20, 20, 30, 30]


def test_times_that_count_from_different_starts_are_not_joined_unasked(tmp_path: Path) -> None:
    points, log = "Time (s),z [mm]\n5,1\n6,2\n7,3\n", "Time (s),q1 [mm]\n0,10\n6.5,20\n"
    with pytest.raises(pk.FileError, match="by time: seconds may count from different starts"):
        two(tmp_path, points, log)
    assert two(tmp_path, points, log, join="time").actuators[:, 0].tolist() == [10, 10, 20]


# --- met in files that nobody had seen -----------------------------------------------------------


def test_a_spreadsheet_in_german_with_titles_and_units_below(tmp_path: Path) -> None:
    rows = "".join(
        f"{i};" + ";".join(f"{v:.5f}" for v in (*q, *pose[:3])).replace(".", ",") + ";\n"
        for i, (q, pose) in enumerate(zip(TRUTH.actuators, TRUTH.poses, strict=True), 1)
    )
    heads = "Nr.;" + ";".join(f"Bein {i}" for i in range(1, 7)) + ";X;Y;Z;Bemerkung\n"
    text = (
        "Messprotokoll;;;;;;;;;;\nPrüfer: M;;;;;;;;;;\n" + heads + ";" + "(mm);" * 9 + "\n" + rows
    )
    m = pk.read_measurements(written(tmp_path, "m.csv", text.encode("cp1252")), ROBOT)
    np.testing.assert_allclose(m.values, TRUTH.poses[:, :3], atol=1e-5)
    np.testing.assert_array_equal(m.actuators, TRUTH.actuators)


@pytest.mark.parametrize(
    "name", ["Cable {}", "Winch {}", "winch_{}", "Belt{}", "Rope {}", "Seil {}", "Winch {} length"]
)
def test_cables_and_what_winds_them_are_actuators(name: str, tmp_path: Path) -> None:
    heads = ",".join(f"{name.format(i)} [mm]" for i in (1, 2, 3))
    m = read(tmp_path, f"{heads},z [mm]\n1,2,3,4\n")
    assert m.actuators.tolist() == [[1.0, 2.0, 3.0]] and m.values.tolist() == [4.0]


def test_a_heading_that_comes_once_more_is_left_out_and_said(tmp_path: Path) -> None:
    m = read(tmp_path, "q1 [mm],z [mm]\n1,2\nq1 [mm],z [mm]\n3,4\n")
    assert len(m) == 2 and "line 3 repeats the column names" in m.notes[0]


def test_a_target_that_was_not_seen_may_be_dashes(tmp_path: Path) -> None:
    heads = ",".join(f"{name} {axis} [mm]" for name in "AB" for axis in "XYZ")
    m = read(tmp_path, f"q1 [mm],{heads}\n1,1,2,3,---,---,---\n2,1,2,3,4,5,6\n")
    assert len(m) == 3 and "cells with '---' taken as not measured" in m.notes[0]
    with pytest.raises(pk.FileError, match="expected a number, found '---'"):
        read(tmp_path, "q1 [mm],z [mm]\n1,---\n")


def test_actual_and_target_actuators_are_not_mixed(tmp_path: Path) -> None:
    text = "actual_q_0 [mm],target_q_0 [mm],z [mm]\n1,2,3\n"
    with pytest.raises(pk.FileError, match="are both 'q1'; ignore one"):
        read(tmp_path, text)
    assert read(tmp_path, text, ignore="target_q_*").actuators.tolist() == [[1.0]]


def test_units_for_all_are_those_that_the_machine_has(tmp_path: Path) -> None:
    """--units mm,deg: a leg is a length, a crank an angle; without a machine it is not known."""
    text = "J1,J2,J3,z\n1,2,3,4\n"
    legs = read(tmp_path, text, pk.load("linear-delta"), units=("cm", "deg"))
    cranks = read(tmp_path, text, pk.load("rotary-delta"), units=("cm", "deg"))
    assert legs.actuators.tolist() == [[10, 20, 30]] and legs.values.tolist() == [40]
    np.testing.assert_allclose(cranks.actuators, np.radians([[1, 2, 3]]))
    with pytest.raises(pk.FileError, match="'J1' has no unit"):
        read(tmp_path, text, units=("cm", "deg"))


def test_what_is_wrong_in_a_log_is_named_in_the_log(tmp_path: Path) -> None:
    with pytest.raises(pk.FileError, match=r"log\.csv, line 1: column 'q1' has no unit"):
        two(tmp_path, "z [mm]\n1\n", "q1\n10\n")
    with pytest.raises(pk.FileError, match=r"log\.csv, line 3, column 'q1': expected a number"):
        two(tmp_path, "z [mm]\n1\n2\n", "q1 [mm]\n10\nten\n")


def test_a_sampled_log_says_at_how_many_points_the_machine_moved(tmp_path: Path) -> None:
    points = "Time,z [mm]\n10:00:03,1\n10:00:12,2\n"
    log = "Clock,q1 [mm]\n" + "".join(f"10:00:{s:02},{min(s, 10)}\n" for s in range(0, 20, 2))
    assert (
        "at 1 of them the actuators change until the next row"
        in two(tmp_path, points, log).notes[0]
    )


def test_a_missing_column_names_what_was_not_known(tmp_path: Path) -> None:
    with pytest.raises(
        pk.FileError,
        match=r"missing column 'q1'; not known: 'Foo', 'Bar'; if one of them is it: --rename",
    ):
        read(tmp_path, "Foo [mm],Bar [mm],z [mm]\n1,2,3\n")


def test_a_name_that_a_log_has_twice_is_told_by_its_lines(tmp_path: Path) -> None:
    points = "Image,z [mm]\n" + "".join(f"{i}.png,{i}\n" for i in (1, 1, 2, 3))
    log = "Image,q1 [mm]\n" + "".join(f"{i}.png,{i}\n" for i in (1, 2, 3, 2, 4))
    with pytest.raises(pk.FileError, match=r"lines 3 and 5 are both called '2\.png'"):
        two(tmp_path, points, log)
    with pytest.raises(pk.FileError, match=r"names such as '1\.png' and 'A1' are not the same"):
        two(tmp_path, points, "Image,q1 [mm]\nA1,1\nA1,2\n")


def test_poses_from_one_and_rows_from_zero_are_not_joined_by_number(tmp_path: Path) -> None:
    """By number all but the last would be shifted by one; the order of the poses is right."""
    points = "Point,z [mm]\n" + "".join(f"P{i},{i}\n" for i in (1, 2, 3))
    m = two(tmp_path, points, "Pose,q1 [mm]\n" + "".join(f"{i},{i + 1}0\n" for i in (0, 1, 2)))
    assert m.actuators[:, 0].tolist() == [10, 20, 30] and "by row" in m.notes[0]
    with pytest.raises(pk.FileError, match="names such as 'P1' and '0' are not the same"):
        two(tmp_path, points, "Pose,q1 [mm]\n0,10\n1,20\n2,30\n", join="name")


def test_names_with_and_without_leading_zeros_are_all_joined(tmp_path: Path) -> None:
    """P10 is spelled alike in both; that is no reason to leave P1 to P9 out."""
    points = "Point,z [mm]\n" + "".join(f"P{i},{i}\n" for i in range(1, 21))
    m = two(tmp_path, points, "Pose,q1 [mm]\n" + "".join(f"P{i:02},{i}0\n" for i in range(1, 21)))
    assert m.actuators[:, 0].tolist() == [10.0 * i for i in range(1, 21)]


# --- what people do ------------------------------------------------------------------------------


def test_a_rigid_body_that_is_called_by_a_number_is_no_data(tmp_path: Path) -> None:
    """Motive writes the ID of a body above each column; `1` there is not a measurement."""
    text = POSES["motive"](TRUTH).replace(b'"7F3A"', b'"1"')
    poses = written(tmp_path, "poses.csv", text)
    logged = written(tmp_path, "log.csv", LOGS["log_struts"](TRUTH))
    m = pk.read_measurements(poses, ROBOT, controller=logged, join="row")
    np.testing.assert_allclose(m.values, TRUTH.poses, atol=2e-5)


@pytest.mark.parametrize("head", ["Pos", "Pose", "Position No", "Pos Nr", "Pos-ID"])
def test_poses_are_counted_as_their_names_are(head: str, tmp_path: Path) -> None:
    m = read(tmp_path, f"{head},q1 [mm],z [mm]\nP07,1,2\nP18,3,4\nP07,1.001,2\n")
    assert m.group is not None and m.group.tolist() == [7, 18, 7]
    m = read(tmp_path, f"{head},q1 [mm],z [mm]\nhome,1,2\nleft,3,4\nhome,1.001,2\n")
    assert m.group is not None and m.group.tolist() == [0, 1, 0]
    m = read(tmp_path, f"{head},q1 [mm],z [mm]\nA1,1,2\nB1,3,4\nA1,1.001,2\n")
    assert m.group is not None and m.group.tolist() == [0, 1, 0]


def test_home_by_another_name_is_the_same_pose(tmp_path: Path) -> None:
    m = read(tmp_path, "Pose,q1 [mm],z [mm]\nP1,1,2\nP2,3,4\nP3,1,2\nP2,3.001,4\n")
    assert m.pose_index.tolist() == [0, 1, 0, 1]


def test_seconds_of_arc_are_written_as_two_strokes(tmp_path: Path) -> None:
    m = read(
        tmp_path,
        "q1 [mm],X [mm],Y [mm],Z [mm],Roll [\"],Pitch [''],Yaw [']\n1,2,3,4,3600,0,60\n".replace(
            "['']", "[″]"
        ),
    )
    np.testing.assert_allclose(m.values[0, 3:], np.radians([1, 0, 1]), rtol=1e-14)
    assert read(tmp_path, 'q1 ["],z [mm]\n1,2\n').actuators.tolist() == [[25.4]]


@pytest.mark.parametrize("x", ["rot_vec_x [rad]", "rvec_x [rad]", "Rotation Vector X [rad]"])
def test_rotation_vectors_are_known_by_name(x: str, tmp_path: Path) -> None:
    heads = ",".join(x.replace("x", axis).replace("X", axis) for axis in "xyz")
    m = read(tmp_path, f"q1 [mm],X [mm],Y [mm],Z [mm],{heads}\n1,2,3,4,0.1,0,0\n")
    np.testing.assert_allclose(m.values[0, 3:], [0.1, 0, 0], atol=1e-15)


def test_what_was_assumed_of_the_log_names_the_log(tmp_path: Path) -> None:
    points = written(tmp_path, "points.csv", b"Point,X [mm],Y [mm],Z [mm]\nP1,1,2,3\nP2,1,2,4\n")
    log = written(tmp_path, "log.csv", "Tür\nPoint,q1 [mm]\nP1,1\nP2,2\n".encode("cp1252"))
    notes = pk.read_measurements(points, controller=log).notes
    assert notes[0] == f"{log}: not UTF-8, read as Windows-1252"
    assert notes[-1].startswith(f"{points}: joined with {log} by name")


def test_columns_of_a_log_that_nothing_is_taken_of_are_named(tmp_path: Path) -> None:
    """A tension that is misspelt is not missing in silence."""
    points = written(tmp_path, "points.csv", b"Point,X [mm],Y [mm],Z [mm]\nP1,1,2,3\nP2,1,2,4\n")
    heads = b"idx,Point,q1 [mm],tensoin.q1 [N],lag,speed,load"
    log = written(tmp_path, "log.csv", heads + b"\n1,P1,1,5,0,0,0\n2,P2,2,5,0,0,0\n")
    notes = pk.read_measurements(points, controller=log).notes
    assert notes[0] == f"{log}: not used: 'tensoin.q1', 'lag', 'speed' and 1 more"
