"""Results with rows become data frames where pandas is installed."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk

DELTA = Path(__file__).resolve().parents[1] / "examples" / "linear-delta"


def test_rows_become_a_data_frame() -> None:
    pytest.importorskip("pandas")
    robot = pk.load(DELTA / "robot.toml")
    measured = pk.read_measurements(DELTA / "probe.csv", robot)
    frame = measured.to_pandas()
    assert list(frame) == ["q1", "q2", "q3", "z", "sigma.z"] and len(frame) == len(measured)
    np.testing.assert_array_equal(frame["z"], measured.values)
    found = pk.identify(robot, measured)
    table = found.to_pandas().set_index("name")
    assert table.loc["radius", "value"] == found.parameters["radius"]["value"]
    poses = robot.forward(np.vstack([measured.actuators, [[1e6, 1e6, 1e6]]])).to_pandas()
    assert poses["status"].iloc[-1] != 0 and np.isnan(poses["z"].iloc[-1])
    np.testing.assert_array_equal(
        poses["z"].iloc[:-1], robot.forward(measured.actuators).pose[:, 2]
    )


@pytest.mark.parametrize("name", ["hexapod", "linear-delta", "five-bar"])
@pytest.mark.parametrize("kind", ["position", "pose", "height", "orientation"])
def test_a_data_frame_is_read_back_to_the_last_bit(name: str, kind: str) -> None:
    pytest.importorskip("pandas")
    robot = pk.load(name)
    q = robot.inverse(pk.sample_poses(robot, 12, seed=1))
    read = pk.VirtualMachine(robot, noise=0.02, seed=2).measure(q, kind=kind)
    again = pk.Measurements.from_pandas(read.to_pandas(), robot)
    assert again.kind == read.kind
    np.testing.assert_array_equal(again.actuators, read.actuators)
    np.testing.assert_array_equal(again.values, read.values)


def test_columns_of_a_data_frame_are_those_of_files() -> None:
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(
        {"Leg 1 [cm]": [45.0], "Leg 2 [mm]": [451.0], "z [um]": [120.0], "t": ["a"]}
    )
    read = pk.Measurements.from_pandas(frame, ignore="t")
    assert read.actuators.tolist() == [[450.0, 451.0]] and read.values.tolist() == [0.12]
    with pytest.raises(ValueError, match=r"frame.*line 2"):
        pk.Measurements.from_pandas(frame.astype(object).replace(451.0, "high"), ignore="t")
    with pytest.raises(TypeError, match="data frame"):
        pk.Measurements.from_pandas([[1.0]])


def test_what_has_no_rows_says_so() -> None:
    with pytest.raises(pk.ArgumentError, match="has no rows"):
        pk.check_geometry(pk.load("hexapod")).to_pandas()


def test_without_pandas_the_import_says_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match="pandas"):
        pk.load("hexapod").forward([880.0] * 6).to_pandas()
