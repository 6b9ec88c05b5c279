"""A suspended printer on four lines: 44 rows of its motors, nine of them with a camera's positions.

Numbers of its owner, under the MIT licence, read in place. The file has lengths that the printer's
firmware computed with spools of 75 mm that the line builds up; its motors' turns follow from them.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

import pkmcal as pk
from pkmcal.arrays import FloatArray

DATA = Path(__file__).parents[3] / "shared" / "data" / "hangprinter" / "all44.csv"
RADIUS, BUILDUP = 75.0, -0.06875  # mm, and mm² of a spool per mm of line that leaves it
ADVANTAGE = np.array([2.0, 2, 2, 4])  # turns of a spool per length of its line
ANCHORS = np.array([[0, -1597, -120], [1550, 900, -120], [-1370, 790, -120], [0, 0, 2355.0]])

pytestmark = [
    pytest.mark.skipif(not DATA.is_file(), reason="../shared/data/hangprinter is absent"),
    pytest.mark.filterwarnings("ignore::pkmcal.CalibrationWarning"),
]


@pytest.fixture(scope="module")
def printer(tmp_path_factory: pytest.TempPathFactory) -> pk.Robot:
    """A point on four cables: 12 anchors, 4 spools and 4 zeros."""
    limbs = "".join(
        f'[[limb]]\nkind = "cable"\nbase = {anchor.tolist()}\nplatform = [0, 0, 0]\n'
        f"offset = {np.linalg.norm(anchor)}\ngain = {n / RADIUS}\n"
        f"drive = {{ spool = {RADIUS / n}, buildup = {BUILDUP / n} }}\n"
        for anchor, n in zip(ANCHORS, ADVANTAGE, strict=True)
    )
    path = tmp_path_factory.mktemp("hangprinter") / "printer.toml"
    path.write_text(
        'name = "four lines"\nunits = { length = "mm", angle = "deg" }\n'
        '[pose]\nmap = "translation"\nhome = { z = 500 }\n'
        '[calibration]\nfree = ["base*", "offset*", "drive*.spool"]\n' + limbs
    )
    return pk.load(path)


@pytest.fixture(scope="module")
def rows() -> tuple[FloatArray, FloatArray]:
    """Turns of the spools, in mm of line at 75 mm, and positions, NaN where nobody measured."""
    table = np.genfromtxt(DATA, delimiter=",", skip_header=1)
    grown = np.sqrt(RADIUS**2 + BUILDUP * ADVANTAGE * table[:, :4]) - RADIUS
    return 2.0 * grown / BUILDUP * RADIUS / ADVANTAGE, table[:, 4:7]


def fitted(printer: pk.Robot, turned: FloatArray, seen: FloatArray) -> pk.Identification:
    log = pk.Measurements(turned, seen, "position", sigma=1.0, actuator_sigma=1.0)
    return pk.identify(printer, log)


def test_it_is_the_least_squares_of_all_positions_and_numbers(
    printer: pk.Robot, rows: tuple[FloatArray, FloatArray]
) -> None:
    turned, seen = rows
    has = np.isfinite(seen)

    def residual(unknowns: FloatArray) -> FloatArray:
        anchors, zero, radius = np.split(unknowns[:20], [12, 16])
        at = unknowns[20:].reshape(-1, 3)
        out = np.linalg.norm(at[:, None] - anchors.reshape(4, 3), axis=2) - zero
        # ((R + u)² - R²) / (c n) = out, u = c w / 2, of a spool that turns by w
        grown = np.sqrt(radius**2 + BUILDUP * ADVANTAGE * out) - radius
        needed = 2.0 * grown / BUILDUP * RADIUS / ADVANTAGE
        return np.concatenate([(needed - turned).ravel(), (at - seen)[has]])

    zeros = np.linalg.norm(ANCHORS, axis=1)
    at = np.where(has, seen, np.nan_to_num(printer.forward(turned).pose[:, :3], nan=500.0))
    start = np.concatenate([ANCHORS.ravel(), zeros, np.full(4, RADIUS), at.ravel()])
    best = least_squares(residual, start, x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    found = fitted(printer, turned, seen)
    assert found.rank == 20 and found.dof == 4 * 44 + 27 - 3 * 44 - 20
    assert 0.5 * found.chi2_per_dof * found.dof == pytest.approx(best.cost, rel=1e-7)
    spools = [found.robot.geometry[f"drive{i}.spool"] for i in range(1, 5)]
    np.testing.assert_allclose(spools * ADVANTAGE, best.x[16:20], atol=1e-3)


def test_rows_that_nobody_measured_place_what_was_left_out(
    printer: pk.Robot, rows: tuple[FloatArray, FloatArray]
) -> None:
    """Each position in turn is left out, with its row: the others say where the lines lead."""
    turned, seen = rows
    known = np.isfinite(seen).all(axis=1)
    off: dict[str, list[float]] = {"all": [], "measured": []}
    for i in np.flatnonzero(known):
        for name, chosen in (("all", np.ones_like(known)), ("measured", known.copy())):
            chosen[i] = False
            found = fitted(printer, turned[chosen], seen[chosen]).robot
            there = found.forward(turned[i], guess=[*seen[i], 0, 0, 0]).pose[:3]
            off[name].append(float(np.linalg.norm(there - seen[i])))
    assert np.sqrt(np.mean(np.square(off["all"]))) < 1.75  # mm; self-calibration.md says 1.7
    highest = int(np.argmax(seen[known, 2]))
    assert off["all"][highest] <= 5.6
    assert not off["measured"][highest] < 50.0  # far above the others; none is found at all


def test_no_line_is_called_slack_until_one_is(
    printer: pk.Robot, rows: tuple[FloatArray, FloatArray]
) -> None:
    """The lines of the log were taut; 40 mm more of one are found where a camera looked."""
    turned, seen = rows
    log = {"kind": "position", "sigma": 1.0, "actuator_sigma": 1.0}
    taut = pk.identify(printer, pk.Measurements(turned, seen, **log), drop="slack")  # type: ignore[arg-type]
    assert taut.slack == ()
    row = int(np.flatnonzero(np.isfinite(seen).all(axis=1))[2])
    loose = turned.copy()
    loose[row, 1] += 40.0 * 2  # of spools with two turns per length of line
    found = pk.identify(printer, pk.Measurements(loose, seen, **log), drop="slack")  # type: ignore[arg-type]
    (line,) = found.slack
    assert line.rows == (row,) and line.actuators == (2,)
    np.testing.assert_allclose(found.values, taut.values, atol=0.25 * taut.stderr.max())
