"""Measurement files: units are converted once, nothing is lost, and errors say where they are."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import pkmcal as pk
from pkmcal.files import atomic as whole_file
from pkmcal.measurements.measurement_csv import read_measurements
from pkmcal.measurements.measurements import Measurements
from pkmcal.readings import Distance

from .kinds import ARTEFACTS, OF_ORIENTATIONS, PUBLIC, needed, takes_target, width

NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
POSITIVE = st.floats(1e-90, 1e90)  # a sigma beyond 1e-100 to 1e100 is refused


def read(tmp_path: Path, text: str, robot: Any = None) -> Measurements:
    path = tmp_path / "m.csv"
    path.write_bytes(text.encode("utf-8"))
    return read_measurements(path, robot)


# --- what is read ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("unit", "mm"),
    [
        ("mm", 1.0),
        ("cm", 10.0),
        ("m", 1000.0),
        ("um", 1e-3),
        ("µm", 1e-3),
        ("μm", 1e-3),
        ("in", 25.4),
    ],
)
def test_lengths_become_mm(tmp_path: Path, unit: str, mm: float) -> None:
    m = read(tmp_path, f"q1 [{unit}],z [{unit}],sigma [{unit}]\n3,-7,2\n")
    assert (m.actuators[0, 0], m.values[0], m.sigma[0, 0]) == (3 * mm, -7 * mm, 2 * mm)
    assert m.actuator_units == ("mm",)


@pytest.mark.parametrize(
    ("unit", "rad"), [("rad", 1.0), ("mrad", 1e-3), ("deg", math.pi / 180), ("°", math.pi / 180)]
)
def test_angles_become_rad(tmp_path: Path, unit: str, rad: float) -> None:
    head = f"q1 [{unit}],x [mm],y [mm],z [mm],alpha [{unit}],beta [{unit}],gamma [{unit}]"
    m = read(tmp_path, head + "\n90,1,2,3,4,5,6\n")
    assert m.kind == "pose" and m.actuator_units == ("rad",)
    expected = [90 * rad, 4 * rad, 5 * rad, 6 * rad]
    np.testing.assert_allclose([m.actuators[0, 0], *m.values[0, 3:]], expected, rtol=3e-16)


def test_columns_come_in_any_order_among_comments_and_empty_lines(tmp_path: Path) -> None:
    head = "# a tracker\n\n z[mm] , q2 [mm],x [mm],group,q1 [mm],y [mm]\n"
    m = read(tmp_path, head + "3,20,1,7,10,2\n # end\n,,,,,\n")
    assert m.kind == "position"
    np.testing.assert_array_equal(m.actuators, [[10, 20]])
    np.testing.assert_array_equal(m.values, [[1, 2, 3]])
    np.testing.assert_array_equal(m.group, [7])
    assert m.sigma is None and m.target is None


@pytest.mark.parametrize(
    "text",
    [
        "\ufeffq1 [mm],z [mm]\r\n1.5,-2.5\r\n",
        "q1 [mm];z [mm]\n1,5;-2,5\n",
        "q1 [mm]\tz [mm]\n1,5\t-2.5\n",
        "q1 [mm];z [mm]\n1.5;-2,50\n",
        '"q1 [mm]","z [mm]"\n"1.5","-2.5"\n',
    ],
)
def test_what_spreadsheets_write_is_read(tmp_path: Path, text: str) -> None:
    m = read(tmp_path, text)
    assert (m.actuators[0, 0], m.values[0]) == (1.5, -2.5)


def test_several_targets_share_their_actuators_row_by_row(tmp_path: Path) -> None:
    head = "q1 [mm],A.x [m],A.y [m],A.z [m],B.x [mm],B.y [mm],B.z [mm],sigma [mm],group\n"
    m = read(tmp_path, head + "10,1,2,3,4,5,6,0.1,1\n20,,,,7,8,9,0.2,1\n")
    np.testing.assert_array_equal(m.actuators[:, 0], [10, 10, 20])
    np.testing.assert_array_equal(m.values, [[1000, 2000, 3000], [4, 5, 6], [7, 8, 9]])
    assert m.target_names == ("A", "B")
    np.testing.assert_array_equal(m.target_index, [0, 1, 1])
    np.testing.assert_array_equal(m.sigma[:, 0], [0.1, 0.1, 0.2])
    np.testing.assert_array_equal(m.group, [1, 1, 1])
    assert m.target is None


def test_targets_of_one_row_are_held_out_together(tmp_path: Path) -> None:
    head = "q1 [mm]," + ",".join(f"{t}.{c} [mm]" for t in "AB" for c in "xyz")
    rows = "\n".join(f"{i},1,2,3,4,5,6" for i in range(10))
    fit, held = read(tmp_path, f"{head}\n{rows}\n").split(3)
    assert len(held) == 6 and not set(fit.actuators[:, 0]) & set(held.actuators[:, 0])


def test_a_constant_place_of_the_target_is_one_target(tmp_path: Path) -> None:
    head = "q1 [mm],distance [mm],target.x [mm],target.y [mm],target.z [mm]\n"
    m = read(tmp_path, head + "1,10,0,0,5\n2,20,0,0,5\n")
    assert m.kind == "distance"
    np.testing.assert_array_equal(m.target, [0, 0, 5])
    moving = read(tmp_path, head + "1,10,0,0,5\n2,20,0,1,5\n")
    np.testing.assert_array_equal(moving.target, [[0, 0, 5], [0, 1, 5]])


def test_distances_may_end_anywhere_on_the_platform(tmp_path: Path) -> None:
    ends = "attachment.x [mm],attachment.y [mm],attachment.z [cm]"
    head = f"q1 [mm],distance [mm],target.x [mm],target.y [mm],target.z [mm],{ends}\n"
    m = read(tmp_path, head + "1,10,0,0,5,1,2,3\n2,20,0,0,5,1,2,3\n")
    np.testing.assert_array_equal(m.attachment, [1, 2, 30])
    moving = read(tmp_path, head + "1,10,0,0,5,1,2,3\n2,20,0,0,5,1,2,4\n")
    np.testing.assert_array_equal(moving.attachment, [[1, 2, 30], [1, 2, 40]])
    named = head.replace("q1 [mm]", "q1 [mm],target")
    two = read(tmp_path, named + "1,A,10,0,0,5,1,2,3\n2,B,20,0,9,5,1,2,4\n3,A,11,0,0,5,1,2,3\n")
    np.testing.assert_array_equal(two.attachment, [[1, 2, 30], [1, 2, 40]])
    np.testing.assert_array_equal(two.target_index, [0, 1, 0])


def test_the_robot_says_how_many_actuators_and_in_which_unit(tmp_path: Path) -> None:
    text = "q1 [mm],q2 [mm],z [mm]\n1,2,3\n"
    robot = SimpleNamespace(actuator_units=("mm", "mm"))
    assert len(read(tmp_path, text, robot)) == 1
    with pytest.raises(ValueError, match=r"line 1: 2 actuator columns, q1 to q2; the robot has 3"):
        read(tmp_path, text, SimpleNamespace(actuator_units=("mm",) * 3))
    with pytest.raises(ValueError, match=r"line 1: column 'q2' is a length; .* an angle"):
        read(tmp_path, text, SimpleNamespace(actuator_units=("mm", "rad")))


# --- round trips -------------------------------------------------------------------------------


def same(one: Measurements, other: Measurements) -> None:
    assert one.kind == other.kind
    for name in ("target_names", "artefact", "joint"):
        assert getattr(one, name) == getattr(other, name), name
    stated = [
        {(frozenset(each[:2]), *each[2:]) for each in m.touch_distances} for m in (one, other)
    ]
    assert stated[0] == stated[1]
    for name in ("run", "touched"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name
    for name in (
        "actuators",
        "values",
        "sigma",
        "group",
        "target_index",
        "actuator_sigma",
        "other",
    ):
        a, b = getattr(one, name), getattr(other, name)
        assert (a is None) == (b is None), name
        if a is not None:
            assert a.shape == b.shape, name
            read = ~np.isnan(a)  # any NaN says that it was not read
            assert a[read].tobytes() == b[read].tobytes() and np.isnan(b[~read]).all(), name
    for name in ("target", "attachment"):
        assert (getattr(one, name) is None) == (getattr(other, name) is None)
        if getattr(one, name) is not None:
            assert getattr(one, name + "s").tobytes() == getattr(other, name + "s").tobytes()


@st.composite
def measurements(draw: st.DrawFn) -> Measurements:
    kind, artefact = draw(st.sampled_from(PUBLIC)), draw(st.sampled_from(ARTEFACTS))
    artefact = artefact if kind == "touch" else None
    rows, n, k = draw(st.integers(1, 4)), draw(st.integers(1, 3)), width(kind, artefact)
    fields: dict[str, Any] = needed(kind, rows, n, artefact or "point")
    if artefact in ("point", "sphere") and rows > 1 and draw(st.booleans()):
        known = {("no 1", "no 2"): draw(POSITIVE), ("no 2", "a third"): 5.0}
        fields["instrument"] = replace(fields["instrument"], distances=known)
    if k and draw(st.booleans()):
        shape = draw(st.sampled_from([(), (rows, 1), (rows, k)]))
        fields["sigma"] = draw(arrays(float, shape, elements=POSITIVE))
    if draw(st.booleans()):
        fields["group"] = draw(st.lists(st.integers(-9, 9), min_size=rows, max_size=rows))
    if draw(st.booleans()):
        shape = draw(st.sampled_from([(), (n,), (rows, n)]))
        fields["actuator_sigma"] = draw(arrays(float, shape, elements=POSITIVE))
    of_base = kind in ("distance", "relative-distance")
    if of_base or (takes_target(kind) and draw(st.booleans())):
        shape = draw(st.sampled_from([(3,), (rows, 3)]))
        fields["target"] = draw(arrays(float, shape, elements=NUMBERS))
    if of_base and draw(st.booleans()):
        shape = draw(st.sampled_from([(3,), (rows, 3)]))
        own = fields.get("instrument", Distance())
        fields["instrument"] = replace(own, attachment=draw(arrays(float, shape, elements=NUMBERS)))
    values = draw(arrays(float, (rows, k) if k != 1 else (rows,), elements=NUMBERS))
    if kind not in OF_ORIENTATIONS and draw(st.booleans()):
        values[0] = np.nan  # not read
    units = draw(st.lists(st.sampled_from(["mm", "rad"]), min_size=n, max_size=n))
    return Measurements(
        draw(arrays(float, (rows, n), elements=NUMBERS)),
        values,
        kind,
        actuator_units=units,
        **fields,
    )


@settings(max_examples=150)
@given(m=measurements())
def test_what_is_written_is_read_back_to_the_last_bit(
    m: Measurements, tmp_path_factory: Any
) -> None:
    path = tmp_path_factory.getbasetemp() / "round trip.csv"
    m.write(path)
    again = read_measurements(path)
    same(m, again)
    assert again.actuator_units == m.actuator_units


@pytest.mark.parametrize("kind", ["position", "pose"])
def test_covariances_are_read_back_to_the_last_bit(tmp_path: Path, kind: str) -> None:
    k = width(kind)
    half = np.random.default_rng(0).normal(size=(3, k, k)) / 7
    covariance = half @ half.transpose(0, 2, 1) + np.eye(k)
    covariance = (covariance + covariance.transpose(0, 2, 1)) / 2
    m = Measurements(np.ones((3, 2)), np.ones((3, k)), kind, sigma=covariance)
    m.write(tmp_path / "m.csv")
    same(m, read_measurements(tmp_path / "m.csv"))


@pytest.mark.parametrize("target", [None, np.array([[1, 2, 3], [4, 5, 6.1]])])
def test_several_targets_keep_their_names_and_places(tmp_path: Path, target: Any) -> None:
    m = Measurements(
        np.ones((3, 2)), np.ones((3, 3)), target=target, target_index=[0, 1, 0],
        target_names=["SMR 1", 'a "high", far one'],
    )  # fmt: skip
    m.write(tmp_path / "m.csv")
    same(m, read_measurements(tmp_path / "m.csv"))


def test_a_comment_stands_at_the_head_and_is_not_read(tmp_path: Path) -> None:
    m = Measurements([[1.0]], [[1.0, 2, 3]])
    m.write(tmp_path / "m.csv", "# made of nothing\n")
    assert (tmp_path / "m.csv").read_text().startswith("# made of nothing\nq1 [mm],")
    same(m, read_measurements(tmp_path / "m.csv"))


def test_angles_of_actuators_are_written_as_angles_where_the_machine_is_given(
    tmp_path: Path,
) -> None:
    robot = pk.load("rotary-delta")
    q = robot.inverse(pk.sample_poses(robot, 4, seed=1))
    m, path = pk.Measurements(q, np.zeros((4, 3)), "position"), tmp_path / "m.csv"
    m.write(path, robot=robot)
    np.testing.assert_array_equal(read_measurements(path, robot).actuators, q)
    m.write(path)
    with pytest.raises(ValueError, match="is a length; the robot's actuator is an angle"):
        read_measurements(path, robot)
    with pytest.raises(ValueError, match="robot has 6 actuators"):
        m.write(path, robot=pk.load("hexapod"))


def test_a_failed_write_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "m.csv"
    path.write_text("old")

    def full(*_: object) -> None:
        raise OSError("no space left")

    monkeypatch.setattr(whole_file.os, "replace", full)
    with pytest.raises(OSError, match="no space left"):
        Measurements([[1.0]], [[1.0, 2, 3]]).write(path)
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"the folder .*absent does not exist"):
        Measurements([[1.0]], [[1.0, 2, 3]]).write(tmp_path / "absent" / "m.csv")


# --- errors ------------------------------------------------------------------------------------

POSITION = "q1 [mm],x [mm],y [mm],z [mm]"
POSE = "q1 [mm],x [mm],y [mm],z [mm],alpha [deg],beta [deg],gamma [deg]"
AB = "q1 [mm]," + ",".join(f"{t}.{c} [mm]" for t in "AB" for c in "xyz")
PLACED = "q1 [mm],z [mm],target,target.x [mm],target.y [mm],target.z [mm]"

ERRORS = [
    ("", "the file is empty"),
    ("# only a comment\n\n", "the file is empty"),
    (POSITION + "\n", "no rows below the column names of line 1"),
    (POSITION + "\n,,,\n", "no rows below"),
    ("q1 [mm],x [mm],y [mm]\n1,2,3\n", "line 1: missing column 'z'"),
    ("# c\nq2 [mm],z [mm]\n1,2\n", "line 2: missing column 'q1'"),
    ("q1 [mm],q3 [mm],z [mm]\n1,2,3\n", "line 1: missing column 'q2'"),
    ("x [mm],y [mm],z [mm]\n1,2,3\n", "line 1: missing column 'q1'"),
    (POSE.replace(",beta [deg]", "") + "\n1,2,3,4,5,6\n", "line 1: missing column 'beta'"),
    (AB.replace(",B.z [mm]", "") + "\n1,1,1,1,1,1\n", "line 1: missing column 'B.z'"),
    ("q1,z [mm]\n1,2\n", "line 1: column 'q1' has no unit: expected 'q1 [mm]'"),
    ("q1 [mm],z []\n1,2\n", "line 1: column 'z' has no unit"),
    ("q1 [mm],z [deg]\n1,2\n", "line 1: column 'z' has unit [deg]: expected one of mm, um"),
    ("q1 [steps],z [mm]\n1,2\n", "line 1: column 'q1' has unit [steps]"),
    ("q1 [mm],z [mm],group [mm]\n1,2,3\n", "line 1: column 'group' takes no unit"),
    ("q1 [mm],z [mm],q1 [mm]\n1,2,3\n", "line 1: column 'q1' appears twice (columns 1 and 3)"),
    ("q1 [mm],z [mm],\n1,2,3\n", "line 1: column 3 is headed ''"),
    (",q1 [mm],z [mm]\n0.5,1,2\n", "line 1: column 1 is headed ''"),
    (",q1 [mm],z [mm]\n7,1,2\n7,2,3\n", "line 1: column 1 is headed ''"),
    ("q1 [mm],z mm]\n1,2\n", "line 1: column 2 is headed 'z mm]'"),
    ("qq1 [mm],z [mm]\n1,2\n", "line 1: unknown column 'qq1'"),
    ("q1 [mm],z [mm],sigmas [mm]\n1,2,3\n", "unknown column 'sigmas'; did you mean 'sigma'?"),
    ("q1 [mm],hight [mm]\n1,2\n", "line 1: unknown column 'hight'"),
    ("q1 [mm],z [mm],distance [mm]\n1,2,3\n", "more than one thing measured"),
    (AB + ",z [mm]\n1,1,1,1,1,1,1,1\n", "more than one thing measured"),
    (AB + ",target\n1,1,1,1,1,1,1,1\n", "column 'target' does not go with 'A.x'"),
    (
        "q1 [mm],z [mm],tension.q1 [N],tension.q2 [N]\n1,2,3,4\n",
        "line 1: column 'tension.q2' goes with no actuator: the last is q1",
    ),
    (
        "q1 [mm],z [mm],tension [N],tension.q1 [N]\n1,2,3,4\n",
        "line 1: column 'tension' does not go with those of actuators",
    ),
    (AB + "\n1,1,1,1,1,,1\n", "line 2, column 'B.y': found an empty cell beside"),
    (POSITION + "\n1,2,3,4\n1,2,3\n", "line 3: 3 cells under 4 column names"),
    (POSITION + "\n1,5,2,3,4\n", "line 2: 5 cells under 4 column names (a decimal comma"),
    (POSITION + "\n1,2,3,4\n#\n1,2,abc,4\n", "line 4, column 'y': expected a number, found 'abc'"),
    (POSITION + "\n,2,3,4\n", "line 2, column 'q1': expected a number, found an empty cell"),
    (POSITION + "\n1,2,1_000,4\n", "line 2, column 'y': expected a number, found '1_000'"),
    (POSITION + "\n1,2,nan,4\n", "line 2, column 'y': expected a finite number, found 'nan'"),
    (POSITION + "\n1,2,3,1e999\n", "line 2, column 'z': expected a finite number"),
    (
        "q1 [mm];z [mm]\n1;1.234,5\n1;12.34\n",
        "line 3, column 'z': expected a number, found '12.34'",
    ),
    ("q1 [mm],z [mm],sigma [mm]\n1,2,0.1\n1,2,0\n", "line 3, column 'sigma': must be positive"),
    ("q1 [mm],z [mm],group\n1,2,3.5\n", "line 2, column 'group': expected a whole number"),
    (POSE + ",sigma [mm]\n1,2,3,4,5,6,7,1\n", "expected 'sigma.x' to 'sigma.gamma'"),
    (POSITION + ",sigma.x [mm]\n1,2,3,4,5\n", "line 1: missing column 'sigma.y'"),
    (POSITION + ",sigma [mm],sigma.x [mm]\n1,2,3,4,5,6\n", "'sigma.x' does not go with 'sigma'"),
    ("q1 [mm],z [mm],cov.z.z [mm*mm]\n1,2,-1\n", "sigma: row 0 is not a covariance matrix"),
    ("q1 [mm],distance [mm]\n1,2\n", "line 1: missing column 'target.x'"),
    (POSE + ",target\n1,2,3,4,5,6,7,A\n", "columns of a target do not go with poses"),
    (PLACED + "\n1,2,A,0,0,0\n1,2,A,0,0,1\n", "line 3, column 'target': 'A' has another place"),
    (
        "q1 [mm],z [mm],attachment.x [mm],attachment.y [mm],attachment.z [mm]\n1,2,3,4,5\n",
        "column 'attachment.x' goes with distances, not with heights",
    ),
    (PLACED + "\n1,2,,0,0,0\n", "line 2, column 'target': found an empty cell"),
    ('q1 [mm],z [mm]\n1,"2\n', "line 2: unexpected end of data"),
]


@pytest.mark.parametrize(("text", "message"), ERRORS)
def test_errors_are_one_line_that_names_file_line_and_column(
    tmp_path: Path, text: str, message: str
) -> None:
    with pytest.raises(ValueError) as caught:
        read(tmp_path, text)
    assert message in str(caught.value)
    assert str(caught.value).startswith(str(tmp_path / "m.csv")) and "\n" not in str(caught.value)


def test_bytes_that_are_not_text_are_an_error(tmp_path: Path) -> None:
    path = tmp_path / "m.csv"
    path.write_bytes(b"q1 [mm],z [\xb5m]\n1,2\x00\n")
    with pytest.raises(ValueError, match="not a UTF-8 text file"):
        read_measurements(path)


def test_text_of_windows_is_read_and_that_is_said(tmp_path: Path) -> None:
    path = tmp_path / "m.csv"
    path.write_bytes("q1 [mm],z [µm]\n1,2\n".encode("cp1252"))
    m = read_measurements(path)
    assert m.values.tolist() == [0.002]
    assert m.notes == (f"{path}: not UTF-8, read as Windows-1252",)


def test_a_column_of_sessions_is_read_and_written(tmp_path: Path) -> None:
    names = ["mon", "thu, evening", "mon"]
    m = Measurements([[1, 2], [3, 4], [5, 6]], [7.0, 8.0, 9.0], "height", session=names)
    m.write(tmp_path / "log.csv")
    again = read_measurements(tmp_path / "log.csv")
    assert again.session is not None and again.session.tolist() == names
    text = "q1 [mm],q2 [mm],A.x [mm],A.y [mm],A.z [mm],B.x [mm],B.y [mm],B.z [mm],Session ID\n"
    (tmp_path / "two.csv").write_text(text + "1,2,3,4,5,6,7,8,mon\n1,2,3,4,5,,,,thu\n")
    seen = read_measurements(tmp_path / "two.csv")
    assert seen.session is not None and seen.session.tolist() == ["mon", "mon", "thu"]
    (tmp_path / "blank.csv").write_text("q1 [mm],z [mm],session\n1,2,mon\n3,4,\n")
    with pytest.raises(ValueError, match=r"blank\.csv, line 3, column 'session': found an empty"):
        read_measurements(tmp_path / "blank.csv")


def test_the_index_of_a_data_frame_is_left_out_with_a_word(tmp_path: Path) -> None:
    """`DataFrame.to_csv` puts it first, without a name; of chosen rows it has gaps."""
    path = tmp_path / "frame.csv"
    path.write_text(",q1_mm,z_mm\n4,1.0,2.0\n0,1.5,2.5\n17,2.0,3.0\n")
    read = read_measurements(path)
    np.testing.assert_array_equal(read.actuators, [[1.0], [1.5], [2.0]])
    assert any("numbers the rows: left out" in note for note in read.notes)


def test_units_that_are_expected_are_each_named_once(tmp_path: Path) -> None:
    """A turn is a unit of angles and of counts."""
    path = tmp_path / "m.csv"
    path.write_text("q1,z [mm]\n1,2\n")
    with pytest.raises(ValueError, match="column 'q1' has no unit") as raised:
        read_measurements(path)
    units = str(raised.value).partition("another of ")[2].partition(")")[0].split(", ")
    assert "rev" in units and len(set(units)) == len(units)
