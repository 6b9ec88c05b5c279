"""The example of a hexapod under two payloads: its rows, and what is found of them."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

import pkmcal as pk

FOLDER = Path(__file__).parents[2] / "examples" / "hexapod-payloads"


@pytest.fixture(scope="module")
def script() -> dict[str, Any]:
    return runpy.run_path(str(FOLDER / "make_rows.py"))


def test_rows_are_what_the_script_makes(script: dict[str, Any], tmp_path: Path) -> None:
    script["rows"]().write(tmp_path / "rows.csv")
    again = pk.read_measurements(tmp_path / "rows.csv", pk.load("hexapod"))
    kept = pk.read_measurements(FOLDER / "rows.csv", pk.load("hexapod"))
    np.testing.assert_array_equal(again.load, kept.load)
    np.testing.assert_allclose(again.values, kept.values, atol=1e-9)


def test_the_true_machine_is_found(script: dict[str, Any]) -> None:
    robot, true = pk.load("hexapod"), script["true_machine"]()
    rows = pk.read_measurements(FOLDER / "rows.csv", robot)
    found = pk.identify(robot, rows, effects=[pk.Elasticity("offset*")])
    assert found.verdict.state == "calibrated"
    off = found.values - [true.geometry[name] for name in found.free]
    assert off @ np.linalg.solve(found.covariance, off) < chi2.isf(1e-4, len(off))
    compliances = np.array(script["COMPLIANCE"])
    assert (found.stderr[-6:] < 0.03 * compliances).all()
    assert (np.abs(off[-6:]) < 0.06 * compliances).all()
