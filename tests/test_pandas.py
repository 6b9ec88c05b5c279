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


def test_what_has_no_rows_says_so() -> None:
    with pytest.raises(pk.ArgumentError, match="has no rows"):
        pk.check_geometry(pk.load("hexapod")).to_pandas()


def test_without_pandas_the_import_says_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match="pandas"):
        pk.load("hexapod").forward([880.0] * 6).to_pandas()
