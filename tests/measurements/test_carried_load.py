"""Loads of rows: what they are, and how files state them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pkmcal as pk

Q = np.arange(12.0).reshape(2, 6) + 800.0


def measured(load: object) -> pk.Measurements:
    return pk.Measurements(Q, np.zeros((2, 3)), sigma=0.1, load=load)


numbers = st.floats(-1e6, 1e6).filter(lambda x: x == 0 or abs(x) > 1e-6)


@settings(max_examples=25)
@given(rows=st.lists(st.lists(numbers, min_size=10, max_size=10), min_size=2, max_size=2))
def test_a_file_is_read_back_to_the_last_bit(
    tmp_path_factory: pytest.TempPathFactory, rows: list[list[float]]
) -> None:
    numbers = np.array(rows)
    numbers[:, 0] = abs(numbers[:, 0])
    path = tmp_path_factory.mktemp("loads") / "rows.csv"
    measured(numbers).write(path)
    again = pk.read_measurements(path, pk.load("hexapod"))
    np.testing.assert_array_equal(again.load, numbers)


def test_units_of_masses_forces_and_moments_are_converted(tmp_path: Path) -> None:
    heads = [*(f"q{i} [mm]" for i in range(1, 7)), "x [mm]", "y [mm]", "z [mm]"]
    heads += ["payload [lb]", "payload.z [in]", "force.x [kN]", "moment.y [N m]"]
    row = ",".join(["800"] * 9 + ["2", "10", "0.5", "-3"])
    path = tmp_path / "rows.csv"
    path.write_text(",".join(heads) + f"\n{row}\n", encoding="utf-8")
    found = pk.read_measurements(path, pk.load("hexapod")).load
    assert found is not None
    expected = [0.90718474, 0.0, 0.0, 254.0, 500.0, 0.0, 0.0, 0.0, -3000.0, 0.0]
    np.testing.assert_allclose(found[0], expected, rtol=1e-15)


@pytest.mark.parametrize(
    ("columns", "cells", "message"),
    [
        (["payload [kg]"], ["-1"], r"rows.csv.*line 2.*a mass is not negative"),
        (["payload.x [mm]"], ["5"], "centre of a payload without a column"),
        (["payload [kg]"], [""], r"line 2.*payload"),
        (["payload [mm]"], ["1"], r"\[mm\]: expected one of kg"),
        (["payload"], ["1"], r"no unit: expected 'payload \[kg\]'"),
    ],
)
def test_what_does_not_fit_is_refused_with_its_place(
    tmp_path: Path, columns: list[str], cells: list[str], message: str
) -> None:
    heads = [*(f"q{i} [mm]" for i in range(1, 7)), "x [mm]", "y [mm]", "z [mm]", *columns]
    path = tmp_path / "rows.csv"
    text = ",".join(heads) + "\n" + ",".join(["800"] * 9 + cells) + "\n"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(pk.FileError, match=message):
        pk.read_measurements(path, pk.load("hexapod"))


def test_one_load_is_that_of_all_rows_and_rows_keep_theirs() -> None:
    both = measured(pk.Load(mass=[2.0, 5.0], force=(0, 0, -3)))
    assert both.select([1]).load.tolist() == [[5.0, 0, 0, 0, 0, 0, -3.0, 0, 0, 0]]
    assert measured(pk.Load(mass=2)).load[:, 0].tolist() == [2.0, 2.0]
    assert "payload 2 to 5 kg" in str(both)
    with pytest.raises(ValueError, match=r"load: .* rows"):
        measured(pk.Load(mass=[1.0, 2.0, 3.0]))
    with pytest.raises(ValueError, match="load must be a Load"):
        measured(5.0)


def test_rows_at_equal_actuators_under_other_loads_are_other_poses() -> None:
    rows = pk.Measurements(Q[[0, 0, 0]], np.zeros((3, 3)), load=pk.Load(mass=[0.0, 5.0, 0.0]))
    assert rows.pose_index.tolist() == [0, 1, 0]


def test_sets_without_a_load_beside_others_are_refused_where_the_file_states_a_payload() -> None:
    robot = pk.load("hexapod").yielding({"offset*": 1e-4}).carrying(pk.Load(mass=5))
    q = robot.inverse(pk.sample_poses(robot.rigid, 20, seed=1))
    machine = pk.VirtualMachine(robot, 0.01)
    sets = [machine.measure(q, "pose"), machine.measure(q, "pose", load=pk.Load(mass=9))]
    with pytest.raises(ValueError, match="set 1 states no load"):
        pk.identify(robot, sets, free="offset*")
