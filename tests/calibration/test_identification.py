"""The result of a calibration: one source for its texts, and the names users know."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.exceptions import CalibrationWarning
from pkmcal.report.as_json import as_json
from pkmcal.result import Result

from ..simulated import hexapod_poses


@pytest.fixture(scope="module")
def found(hexapod: pk.Robot) -> pk.Identification:
    rng = np.random.default_rng(0)
    measured = pk.VirtualMachine(hexapod.replace({"offset1": 0.3})).measure(
        hexapod.inverse(hexapod_poses(hexapod, 20, rng))
    )
    return pk.identify(hexapod, measured, free="offset*", holdout=0.25)


def results(found: pk.Identification) -> Iterator[Result]:
    hexapod = pk.load("hexapod")
    yield hexapod
    yield pk.load("3r")
    yield found
    yield pk.bootstrap(found, 20)
    yield found.fit.equations.table.sets[0]
    yield pk.plan_poses(hexapod, pk.sample_poses(hexapod, 20), 12, kind="pose")


def test_every_result_has_one_line_and_one_table_for_terminal_and_notebook(
    found: pk.Identification,
) -> None:
    for result in results(found):
        line, page = repr(result), result._repr_html_()
        assert "\n" not in line and line.startswith(f"<{type(result).__name__}: ")
        cells = re.findall(r"<t[hd][^>]*>([^<]*)</t[hd]>", page)
        assert cells and all(cell.strip() in str(result) for cell in cells)
        assert not re.search(r"<p>\s|\n\s", page)  # lines are broken for the terminal alone


def test_the_change_of_every_parameter_is_shown_and_the_table_fits_the_terminal() -> None:
    robot = pk.load("2tpr2tps")
    q = robot.inverse(pk.sample_poses(robot, 20))
    measured = pk.VirtualMachine(robot, noise=0.02).measure(q, kind="pose")
    found = pk.identify(robot, measured, free="*")
    lines = found.summary().splitlines()
    assert max(map(len, lines)) <= 100
    shown = re.findall(r"(\S+\d\S*) \[(?:mm|1)\] +(\S+ ± \S+) +(-?\d\S*)", "\n".join(lines))
    change = {name: number for name, _, number in shown}
    assert len(found.free) == 32 and set(change) == set(found.free)
    for name, value in zip(found.free, found.values, strict=True):
        last = 10.0 ** -len(change[name].partition(".")[2])  # digit that is shown
        assert abs(float(change[name]) - (value - robot.geometry[name])) <= 0.501 * last


def test_names_of_lmfit_and_scipy_stand_for_the_same(found: pk.Identification) -> None:
    assert found.success is found.converged
    assert found.nfev == found.evaluations > 0
    assert found.covar is found.covariance
    assert found.redchi == found.chi2_per_dof
    assert found.params == found.parameters


def test_redchi_is_the_weighted_sum_of_squares_per_degree_of_freedom(
    found: pk.Identification,
) -> None:
    (measured,) = found.fit.equations.table.sets
    assert measured.sigma is not None
    squares = float(((found.residuals[0] / measured.sigma) ** 2).sum())
    assert found.dof == measured.values.size - len(found.free)
    assert found.redchi == pytest.approx(squares / found.dof, rel=1e-12)


@pytest.mark.parametrize(
    ("more", "first"), [(1e-13, "offset2"), (3e-10, "offset2"), (3e-9, "offset3")]
)
def test_strong_correlations_are_in_the_order_of_size_then_of_parameters(
    found: pk.Identification, more: float, first: str
) -> None:
    """Of equal ones rounding does not say which is the first."""
    matrix = np.eye(6)
    matrix[0, 1] = matrix[1, 0] = 0.97
    matrix[0, 2] = matrix[2, 0] = -0.97 - more
    matrix[3, 4] = matrix[4, 3] = 0.99
    matrix[3, 5] = matrix[5, 3] = 0.94
    pairs = replace(found, correlation_matrix=matrix).correlations
    second = "offset3" if first == "offset2" else "offset2"
    assert [(a, b) for a, b, _ in pairs] == [
        ("offset4", "offset5"), ("offset1", first), ("offset1", second)
    ]  # fmt: skip


def test_numbers_of_the_misfit_stand_below_the_end_of_their_heads(found: pk.Identification) -> None:
    lines = str(found).splitlines()
    (at,) = (k for k, line in enumerate(lines) if line.startswith("misfit [mm]"))
    head, *rows = lines[at : at + 3]
    assert [row.split("  ")[0] for row in rows] == ["fitted", "held out"]
    for name in ("rms before", "rms after", "median", "95 %"):
        end = head.index(name) + len(name)
        assert all(row[end - 1].isdigit() and not row[end : end + 1].strip() for row in rows)


def test_correlations_are_the_covariance_over_both_deviations(found: pk.Identification) -> None:
    expected = found.covariance / np.outer(found.stderr, found.stderr)
    np.testing.assert_allclose(found.correlation_matrix, expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(np.diagonal(expected), 1.0)


def test_json_has_every_name_of_the_result(found: pk.Identification) -> None:
    keys = re.findall(r'^  "(\w+)":', as_json(found, "parameters"), re.MULTILINE)
    assert keys[:4] == ["verdict", "robot", "free", "units"] and keys[-1] == "parameters"
    assert {"stderr", "holdout_rms", "lack_of_fit", "observability", "history"} <= set(keys)
    assert all(hasattr(found, key) for key in keys)


def test_a_result_is_not_changed(found: pk.Identification) -> None:
    for name in ("rank", "success", "robot", "fit"):
        with pytest.raises(AttributeError):
            setattr(found, name, None)


def test_what_identify_doubts_is_a_calibration_warning(hexapod: pk.Robot) -> None:
    q = np.repeat(hexapod.inverse(hexapod.home)[None], 3, axis=0)
    measured = pk.VirtualMachine(hexapod).measure(q)
    with pytest.warns(CalibrationWarning, match="all rows have the same actuators"):
        pk.identify(hexapod, measured, free=["offset1", "offset2"])


@pytest.mark.filterwarnings("ignore:residuals are")
def test_standard_errors_at_an_active_bound_say_that_they_ignore_it() -> None:
    robot = pk.load("hexapod")
    q = robot.inverse(pk.sample_poses(robot, 20))
    measured = pk.VirtualMachine(robot.replace({"offset1": 0.5})).measure(q, "pose")
    found = pk.identify(robot, measured, free="offset*", bounds={"offset1": (-0.1, 0.1)})
    assert found.at_bounds == ("offset1",)
    assert "at a bound, ± as if it were not there: offset1" in str(found)
