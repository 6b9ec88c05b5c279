"""`pkmcal calibrate` on a real printer's bed-probe log."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pkmcal.measurements.measurements import Measurements

ROOT = Path(__file__).parents[2]
LOG = ROOT.parent / "shared" / "data" / "linear-delta" / "probe41.csv"
STEP = 60 / 6400  # mm
RODS = "radius,angle[12],offset*,rod*"

pytestmark = pytest.mark.skipif(
    not LOG.exists(), reason="the probe log is not beside this checkout (../shared/data)"
)


@pytest.fixture
def probe(tmp_path: Path) -> Path:
    """The log with units, as `pkmcal calibrate` reads it."""
    log = np.genfromtxt(LOG, delimiter=",", names=True)
    steps = np.column_stack([log[f"steps_{carriage}"] for carriage in "abc"])
    heights = Measurements(-steps * STEP, log["height_mm"], "height", actuator_units="mm")
    heights.write(tmp_path / "probe.csv")
    return tmp_path / "probe.csv"


@pytest.fixture
def calibrate(run: Any, probe: Path) -> Callable[..., str]:
    """What calibrating the linear delta from the log prints, with these options."""

    def printed(*options: str) -> str:
        robot = ROOT / "examples" / "linear-delta" / "robot.toml"
        result = run("calibrate", robot, probe, *options)
        assert (result.exit_code in (0, 1), result.stderr) == (True, "")  # 1: doubtful
        return str(result.stdout)

    return printed


@pytest.fixture
def as_json(calibrate: Callable[..., str]) -> Callable[..., Any]:
    return lambda *options: json.loads(calibrate("--json", *options))


def test_six_parameters_fit_the_log(as_json: Any) -> None:
    assert as_json()["rms"] <= 0.0392


def test_three_rods_more_fit_better_but_are_hardly_known(calibrate: Any, as_json: Any) -> None:
    found = as_json("--free", RODS)
    assert found["rms"] <= 0.0311
    sigmas = [found["parameters"][f"rod{i}"]["stderr"] for i in (1, 2, 3)]
    assert sigmas == pytest.approx([1.37] * 3, abs=0.03)
    assert re.search(r"rod1 \[mm\] +334\.7 ± 1\.4", calibrate("--free", RODS))
