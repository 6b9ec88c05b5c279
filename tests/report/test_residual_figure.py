"""The picture of what a calibration leaves over: of every kind of measurement, always the same."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from matplotlib.quiver import Quiver

import pkmcal as pk
from pkmcal.calibration.identification import Identification
from pkmcal.readings.touches import TOUCHES, Artefact
from pkmcal.report.drawing import MOST_DRAWN, sample
from pkmcal.report.residual_figure import _look, residuals

from ..simulated import hexapod_poses

ANCHOR = [400.0, 300.0, -100.0]


@pytest.fixture(scope="module")
def found() -> Identification:
    """Poses, heights and distances together, the fourth row far off."""
    robot = pk.load("hexapod")
    q = robot.inverse(hexapod_poses(robot, 15, np.random.default_rng(0)))
    machine = pk.VirtualMachine(robot)
    sets = [
        machine.measure(q, "pose"),
        machine.measure(q, "height"),
        machine.measure(q, "distance", ANCHOR),
    ]
    wrong = sets[0].values.copy()
    wrong[3, 0] += 0.2
    sets[0] = dataclasses.replace(sets[0], values=wrong)
    return pk.identify(robot, sets, free="offset*", loss="cauchy")


def marks(panel: object) -> dict[str, np.ndarray]:
    lines = panel.get_lines()  # type: ignore[attr-defined]
    return {line.get_label(): line.get_ydata() for line in lines}


def test_every_residual_is_drawn_in_its_unit(found: Identification) -> None:
    lengths, angles, *_ = residuals(found).axes
    drawn = marks(lengths)
    np.testing.assert_array_equal(drawn["x"], found.residuals[0][:, 0])
    np.testing.assert_array_equal(drawn["distance"], found.residuals[2][:, 0])
    np.testing.assert_allclose(marks(angles)["beta"], np.degrees(found.residuals[0][:, 4]))
    assert "[mm]" in lengths.get_ylabel() and "[deg]" in angles.get_ylabel()


def test_outliers_are_ringed(found: Identification) -> None:
    assert found.outliers == (3,)
    rings = [line for line in residuals(found).axes[0].get_lines() if line.get_markersize() > 10]
    assert {row for ring in rings for row in ring.get_xdata().tolist()} == {3}


def test_an_outlier_does_not_hide_the_others() -> None:
    """It is marked at the edge with its value; the others fill the panels."""
    robot = pk.load("hexapod")
    q = robot.inverse(hexapod_poses(robot, 30, np.random.default_rng(0)))
    measured = pk.VirtualMachine(robot, noise=0.01).measure(q)
    wrong = measured.values.copy()
    wrong[11, 1] += 3.0
    found = pk.identify(
        robot, dataclasses.replace(measured, values=wrong), free="offset*", loss="cauchy"
    )
    figure = residuals(found)
    rows, over, quantiles = (
        next(panel for panel in figure.axes if panel.get_ylabel().startswith(name))
        for name in ("measured", "y [mm]", "residual over")
    )
    assert max(rows.get_ylim()) < 0.2 and "3" in {text.get_text() for text in rows.texts}
    (ring,) = (line for line in rows.get_lines() if line.get_markersize() > 10)
    assert all(abs(y) < max(rows.get_ylim()) for y in ring.get_ydata())
    arrows = next(each for each in over.collections if isinstance(each, Quiver))
    lengths = np.sort(np.hypot(arrows.U, arrows.V))
    assert lengths[-1] < 10.0 * np.median(lengths)
    assert "1 of" in quantiles.get_title() and max(quantiles.get_ylim()) < 15.0


def readings(kind: str) -> Identification:
    """A hexapod of which only such readings were taken."""
    robot, tip = pk.load("hexapod"), [40.0, -30.0, 120.0]
    q = robot.inverse(hexapod_poses(robot, 40, np.random.default_rng(0)))
    other = robot.inverse(hexapod_poses(robot, 40, np.random.default_rng(1)))
    machine = pk.VirtualMachine(robot, noise=0.01)
    known = {
        "relative-distance": pk.readings.RelativeDistance(run=["A"] * len(q)),
        "between": pk.readings.Between(other),
    }
    target = {"distance": ANCHOR, "relative-distance": ANCHOR, "between": tip}.get(kind)
    measured = machine.measure(q, known.get(kind, kind), target=target)
    return pk.identify(robot, measured, free="offset*")


@pytest.mark.parametrize("kind", [
    "pose", "position", "height", "distance", "between", "relative-distance", "orientation", "tilt",
])  # fmt: skip
def test_readings_of_every_kind_are_drawn(kind: str) -> None:
    found = readings(kind)
    figure = residuals(found)
    measured = found.fit.equations.table.sets[0]
    drawn = {name for panel in figure.axes for name in marks(panel)}
    assert set(measured.components) <= drawn
    labels = {panel.get_ylabel() for panel in figure.axes}
    assert ("z [mm]" in labels) == ("mm" in measured.units)
    assert ("angle off [deg]" in labels) == ("mm" not in measured.units)


@pytest.mark.parametrize("artefact", TOUCHES)
def test_components_of_touches_are_told_apart(artefact: Artefact) -> None:
    components = TOUCHES[artefact]
    looks = {_look(len(components), k, name) for k, (name, _) in enumerate(components)}
    assert len(looks) == len(components)


def test_rows_are_marked_at_whole_numbers() -> None:
    robot = pk.load("hexapod")
    q = robot.inverse(hexapod_poses(robot, 18, np.random.default_rng(3)))
    few = pk.identify(robot, pk.VirtualMachine(robot).measure(q), free="offset*")
    panel = residuals(few).axes[0]
    ticks = panel.get_xticks()
    assert len(ticks) > 2 and (ticks == np.round(ticks)).all()


def test_arrows_end_inside_their_panel_even_of_an_outlier() -> None:
    robot = pk.load("hexapod")
    q = robot.inverse(hexapod_poses(robot, 30, np.random.default_rng(0)))
    measured = pk.VirtualMachine(robot).measure(q)
    wrong = measured.values.copy()
    edge = int(np.argmax(wrong[:, 0]))
    wrong[edge, 0] += 3.0  # away from the middle
    figure = residuals(
        pk.identify(
            robot, dataclasses.replace(measured, values=wrong), free="offset*", loss="cauchy"
        )
    )
    figure.draw_without_rendering()
    (panel,) = (axes for axes in figure.axes if axes.get_ylabel() == "y [mm]")
    arrows = next(each for each in panel.collections if isinstance(each, Quiver))
    begin = panel.transData.transform(arrows.XY)
    way = np.stack([arrows.U, arrows.V], axis=1)
    ahead = panel.transData.transform(arrows.XY + way) - begin
    ahead /= np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-30)
    box = panel.get_window_extent()
    tips = begin + ahead * np.linalg.norm(way, axis=1, keepdims=True) / arrows.scale * box.width
    assert np.linalg.norm(tips - begin, axis=1).max() > 0.2 * box.width
    out = [tips.min(axis=0) - box.min, box.max - tips.max(axis=0)]
    assert np.min(out) > -1.0, out


def test_good_residuals_lie_on_the_line_of_normal_quantiles() -> None:
    robot = pk.load("hexapod")
    q = robot.inverse(hexapod_poses(robot, 80, np.random.default_rng(1)))
    good = pk.identify(robot, pk.VirtualMachine(robot).measure(q))
    points = residuals(good).axes[-1].get_lines()[0]
    normal, scaled = points.get_xdata(), points.get_ydata()
    assert np.abs(scaled - normal)[np.abs(normal) < 1.5].max() < 0.35


def test_of_very_many_rows_a_sample_is_drawn_and_the_title_says_so() -> None:
    robot, rng = pk.load("linear-delta"), np.random.default_rng(2)
    poses = np.pad(
        rng.uniform([-50, -50, 50], [50, 50, 150], (3 * MOST_DRAWN, 3)), ((0, 0), (0, 3))
    )
    measured = pk.VirtualMachine(robot).measure(robot.inverse(poses), "height")
    wrong = measured.values.copy()
    wrong[[17, 2503]] += 1.0
    measured = dataclasses.replace(measured, values=wrong)
    many = pk.identify(robot, measured, free="offset*", loss="cauchy")
    assert {17, 2503} <= set(many.outliers)
    figure = residuals(many)
    assert figure.get_suptitle().endswith(f"{MOST_DRAWN} of {3 * MOST_DRAWN} rows drawn")
    lines = {line.get_label(): line for line in figure.axes[0].get_lines()}
    assert len(lines["z"].get_xdata()) == MOST_DRAWN
    assert {0, 17, 2503, 3 * MOST_DRAWN - 1} <= set(lines["z"].get_xdata().tolist())
    residual = many.residuals[0][:, 0]
    np.testing.assert_array_equal(lines["z"].get_ydata(), residual[lines["z"].get_xdata()])


@pytest.mark.parametrize("count", [0, 1, MOST_DRAWN, MOST_DRAWN + 1, 10 * MOST_DRAWN])
@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 1.0])
def test_a_sample_has_the_rows_that_must_be_in_it_and_is_spread_over_the_others(
    count: int, share: float
) -> None:
    first = np.random.default_rng(count).random(count) < share
    rows = sample(count, first)
    assert len(rows) == min(count, MOST_DRAWN)
    assert (np.diff(rows) > 0).all()
    assert len(np.intersect1d(rows, np.flatnonzero(first))) == min(first.sum(), MOST_DRAWN)
    if count > len(rows) and share < 0.1:
        assert rows[0] == 0 and rows[-1] == count - 1
        assert np.diff(rows).max() <= 2 * count / len(rows)


@pytest.mark.parametrize(("ending", "start"), [("png", b"\x89PNG"), ("svg", b"<?xml")])
def test_a_file_of_the_wanted_kind_is_written_always_the_same(
    found: Identification, tmp_path: Path, ending: str, start: bytes
) -> None:
    contents = []
    for name in ("one", "two"):
        found.plot(tmp_path / f"{name}.{ending}")
        contents.append((tmp_path / f"{name}.{ending}").read_bytes())
    assert contents[0] == contents[1]
    assert contents[0].startswith(start)


def test_without_a_path_the_figure_is_returned_to_be_shown(found: Identification) -> None:
    figure = found.plot()
    assert figure.get_suptitle().endswith("residuals of the calibration")
    assert figure.get_facecolor() == (1.0, 1.0, 1.0, 1.0)  # dark notebooks too


def test_another_ending_is_refused_and_nothing_is_written(
    found: Identification, tmp_path: Path
) -> None:
    with pytest.raises(ValueError, match=r"path must end in .png or .svg, found .*residuals.gif"):
        found.plot(tmp_path / "residuals.gif")
    assert not list(tmp_path.iterdir())
