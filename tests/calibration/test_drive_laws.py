"""Numbers of drive laws are found like others: as sure as the readings allow, needed or not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import f as f_distribution
from scipy.stats import t as t_distribution

import pkmcal as pk

from ..robots import hexapod

SIGMA = 0.02  # mm, and as an angle over 1000 mm
LAWS: dict[str, tuple[dict[str, Any], dict[str, float], list[str]]] = {
    # the law of the file, what the true machine has, what is free
    "quadratic": ({"quadratic": 0.0}, {"quadratic": 3e-6}, ["drive*", "offset*", "gain*"]),
    "spool": (
        {"spool": 40.0, "buildup": 0.05},
        {"spool": 40.3, "buildup": 0.07},
        ["drive*", "offset*"],
    ),
    "harmonics": (
        {"harmonics": [{"k": 0.31}, {"k": 1.3}]},
        {"cos1": 0.05, "sin1": -0.02, "cos2": 0.01, "sin2": 0.03},
        ["drive*", "offset*"],
    ),
    "table": (
        {"table": [[q, 0.0] for q in range(700, 1000, 50)]},
        {"table2": 0.05, "table3": -0.02, "table4": 0.08, "table5": 0.03},
        ["drive*.table[2345]", "offset*"],
    ),
    "backlash": ({"backlash": 0.0}, {"backlash": 0.08}, ["drive*", "offset*"]),
}


def machines(kind: str) -> tuple[pk.Robot, pk.Robot, list[str]]:
    """The robot as its file has it, the true one, and what is free."""
    law, true, free = LAWS[kind]
    gain = {"gain": 1.0 / 40.0} if kind == "spool" else {}
    robot = hexapod(*[{"drive": law, "stroke": [600.0, 1100.0]} | gain] * 6)
    rng = np.random.default_rng(1)
    changed = {
        f"drive{i}.{key}": value * rng.uniform(0.7, 1.3) if key != "spool" else value
        for i in range(1, 7)
        for key, value in true.items()
    }
    return robot, robot.replace(changed), free


def rows(robot: pk.Robot, count: int = 60) -> np.ndarray:
    poses = robot.home + np.random.default_rng(0).uniform(-1, 1, (count, 6)) * (
        [80.0, 80.0, 110.0, 0.25, 0.25, 0.25]
    )
    return robot.inverse(poses)


def bound(true: pk.Robot, q: np.ndarray, free: list[str], approach: Any) -> np.ndarray:
    """Deviations of the best unbiased estimator, by differences of the forward kinematics."""
    names = true.geometry.match(free)
    columns = []
    for name in names:
        unit = true.geometry.units[true.geometry.names.index(name)]
        step = {"mm": 1e-3, "1": 1e-7, "1/mm": 1e-10}[unit]
        ends = []
        for e in (-step, step):
            robot = true.replace({name: true.geometry[name] + e})
            robot = robot if approach is None else robot.approaching(approach)
            ends.append(robot.forward(q).pose)
        off = (ends[1] - ends[0]) / (2 * step)
        columns.append((off / ([SIGMA] * 3 + [SIGMA / 1000.0] * 3)).ravel())
    J = np.array(columns).T
    scale = np.linalg.norm(J, axis=0)
    return np.sqrt(np.diag(np.linalg.inv((J / scale).T @ (J / scale)))) / scale


def found_in(kind: str, runs: int) -> tuple[np.ndarray, np.ndarray]:
    """Errors of the law's numbers in many calibrations, over the bound; and whether covered."""
    robot, true, free = machines(kind)
    q = rows(true)
    approach = np.random.default_rng(2).choice([-1.0, 1.0], q.shape) if kind == "backlash" else None
    names = robot.geometry.match(free)
    best = bound(true, q, free, approach)
    law = [i for i, name in enumerate(names) if name.startswith("drive")]
    truth = np.array([true.geometry[name] for name in names])
    errors, covered = [], []
    for seed in range(runs):
        instrument = pk.VirtualMachine(true, noise=SIGMA, angle_noise=SIGMA / 1000.0, seed=seed)
        measured = instrument.measure(q, kind="pose", approach=approach)
        found = pk.identify(robot, measured, free=free)
        assert list(found.free) == names
        errors.append(((found.values - truth) / best)[law])
        inside = (found.interval95[:, 0] <= truth) & (truth <= found.interval95[:, 1])
        covered.append(inside[law])
    return np.array(errors), np.array(covered)


@pytest.mark.parametrize("kind", LAWS)
def test_numbers_of_laws_are_as_sure_as_they_can_be(kind: str) -> None:
    errors, covered = found_in(kind, 12)
    ratio = np.sqrt((errors**2).mean())
    spread = 3.0 / np.sqrt(2.0 * 12 * 6)  # three deviations of it, of the limbs' numbers
    assert abs(ratio - 1.0) < spread
    assert covered.mean() > 0.95 - 3.0 * np.sqrt(0.05 * 0.95 / (12 * 6))


@pytest.mark.slow
@pytest.mark.parametrize("kind", LAWS)
def test_errors_of_laws_are_within_5_percent_of_the_bound(kind: str) -> None:
    errors, covered = found_in(kind, 300)
    ratio, share = np.sqrt((errors**2).mean()), covered.mean()
    print(f"{kind}: {ratio:.3f} of the bound, {100 * share:.1f} % covered")
    assert abs(ratio - 1.0) < 0.05
    assert 0.93 < share < 0.97


# needed or not ------------------------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore:residuals are")  # of the fit without the law
@pytest.mark.parametrize("kind", ["quadratic", "harmonics", "backlash"])
def test_the_f_test_is_that_of_two_fits(kind: str) -> None:
    """Sums of squares with and without the law, which the test does not use."""
    robot, true, free = machines(kind)
    q = rows(true)
    approach = np.random.default_rng(2).choice([-1.0, 1.0], q.shape) if kind == "backlash" else None
    for machine, needed in ((true, True), (robot, False)):
        instrument = pk.VirtualMachine(machine, noise=SIGMA, angle_noise=SIGMA / 1000.0, seed=3)
        measured = instrument.measure(q, kind="pose", approach=approach)
        found = pk.identify(robot, measured, free=free)
        if kind != "harmonics":
            (test,) = found.law_tests
            law = test.names
            assert len(law) == 6
            without = pk.identify(robot, measured, free=[n for n in found.free if n not in law])
            sums = [
                ((r.residuals[0] / ([SIGMA] * 3 + [SIGMA / 1000.0] * 3)) ** 2).sum()
                for r in (without, found)
            ]
            ratio = (sums[0] - sums[1]) / len(law)  # the deviations are stated
            assert abs(test.ratio - ratio) < 0.02 * ratio + 0.02
            if np.isfinite(test.freedom[1]):
                chance = f_distribution.sf(test.ratio, *test.freedom)
                assert abs(chance - test.chance) < 1e-9
        assert len(found.law_tests) == (2 if kind == "harmonics" else 1)
        for test in found.law_tests:
            assert test.needed == needed
            assert ("not needed" in str(found).replace("\n", " ")) != needed


def test_a_law_that_is_not_there_is_called_needed_in_5_of_100() -> None:
    robot, _, free = machines("quadratic")
    q = rows(robot, 40)
    said = []
    for seed in range(60):
        instrument = pk.VirtualMachine(robot, noise=SIGMA, angle_noise=SIGMA / 1000.0, seed=seed)
        found = pk.identify(robot, instrument.measure(q, kind="pose"), free=free)
        said.append(found.law_tests[0].needed)
    assert sum(said) <= 9  # of 60 at 5 %, with a chance of 0.2 % of more


def test_of_deviations_by_the_spread_of_poses_the_test_is_hotellings() -> None:
    """T² (ν - k + 1)/(ν k) is as F(k, ν - k + 1): few poses are no sure measure of many numbers."""
    robot, _, free = machines("quadratic")
    q = rows(robot, 30)
    measured = pk.VirtualMachine(robot, noise=SIGMA, angle_noise=SIGMA / 1000.0, seed=4).measure(
        q, kind="pose"
    )
    found = pk.identify(robot, measured, free=free, loss="cluster")
    (test,) = found.law_tests
    columns = [found.free.index(name) for name in test.names]
    values, covariance = found.values[columns], found.covariance[np.ix_(columns, columns)]
    count, rest = test.freedom
    nu = rest + count - 1.0
    assert count == len(columns) == 6 and 6.0 < nu < len(q)
    squares = values @ np.linalg.solve(covariance, values)
    assert test.ratio == pytest.approx(squares / count * rest / nu, rel=1e-6)
    assert test.chance == pytest.approx(f_distribution.sf(test.ratio, count, rest), rel=1e-9)


def test_of_numbers_known_unlike_well_the_test_has_the_least_degrees_of_freedom() -> None:
    """Of variances that were estimated apart: F and the widest of the numbers' own t agree."""
    robot, true, free = machines("quadratic")
    instrument = pk.VirtualMachine(true, noise=SIGMA, angle_noise=SIGMA / 20.0, seed=5)
    measured = replace(instrument.measure(rows(true, 20), kind="pose"), sigma=None)
    found = pk.identify(robot, measured, free=free, loss="classical")
    (test,) = found.law_tests
    columns = [found.free.index(name) for name in test.names]
    factor = np.ptp(found.interval95[columns], axis=1) / 2 / found.stderr[columns]
    assert np.ptp(factor) > 1e-3
    assert t_distribution.ppf(0.975, test.freedom[1]) == pytest.approx(factor.max(), rel=1e-6)
    assert test.chance == pytest.approx(f_distribution.sf(test.ratio, *test.freedom), rel=1e-9)


def test_of_numbers_with_a_prior_nothing_is_said() -> None:
    robot, true, free = machines("quadratic")
    measured = pk.VirtualMachine(true, noise=SIGMA, angle_noise=SIGMA / 1000.0).measure(
        rows(true), kind="pose"
    )
    assert pk.identify(robot, measured, free=free, prior={"drive*": 1e-5}).law_tests == ()


# tables -------------------------------------------------------------------------------------------


def test_a_smooth_table_is_found_where_nothing_was_measured_between() -> None:
    """Corrections that no row reaches lie on the line through their neighbours."""
    places = np.linspace(700.0, 980.0, 15)
    law = {"table": np.column_stack([places, 0.0 * places]).tolist(), "smoothness": 0.01}
    robot = hexapod(*[{"drive": law, "stroke": [600.0, 1100.0]}] * 6)
    wave = 0.1 * np.sin((places - 700.0) / 90.0)
    true = robot.replace({
        f"drive{i}.table{j + 1}": float(wave[j]) for i in range(1, 7) for j in range(15)
    })  # fmt: skip
    measured = pk.VirtualMachine(true, noise=0.005, angle_noise=5e-6).measure(
        rows(true, 90), kind="pose"
    )
    found = pk.identify(robot, measured, free=["drive*"])
    assert found.rank <= len(found.free)
    table = found.values.reshape(6, 15)
    reached = (rows(true, 90).min(axis=0)[:, None] <= places) & (
        places <= rows(true, 90).max(axis=0)[:, None]
    )
    assert abs(table - wave)[reached].max() < 0.02
    rough = pk.identify(robot, measured, free=["drive*"], prior={"drive*": 10.0})
    assert rough.converged
    assert found.law_tests == ()  # what is known before decides beside the measurements
    bends = np.diff(table, 2, axis=1)
    assert abs(bends).max() < 0.05


def test_scale_alone_is_no_news_to_a_machine_of_spools() -> None:
    """Belts that say nothing of their scale: radius and build-up grow with all anchors."""
    from pkmcal.estimation.gauges import _motions

    law = {"spool": 40.0, "buildup": 0.05, "backlash": 0.1, "harmonics": [{"k": 1.0, "cos": 0.2}]}
    robot = hexapod(*[{"drive": law, "gain": 0.025, "stroke": [500.0, 1300.0]}] * 6)
    grown = robot.slots + 1e-3 * _motions(robot)[..., 6]
    geometry = robot.geometry
    larger = robot.replace({
        n.name: grown.flat[p] for n, p in zip(geometry.numbers, geometry.slot_index, strict=True)
    })  # fmt: skip
    at = robot.home + 30.0 * np.eye(6)[:3]
    wide = at.copy()
    wide[:, :3] *= 1.001
    assert abs(larger.inverse(wide) - robot.inverse(at)).max() < 1e-9


def test_a_table_that_is_less_smooth_than_was_said_contradicts_that() -> None:
    places = np.linspace(700.0, 980.0, 15)
    law = {"table": np.column_stack([places, 0.0 * places]).tolist(), "smoothness": 0.001}
    robot = hexapod(*[{"drive": law, "stroke": [600.0, 1100.0]}] * 6)
    true = robot.replace({f"drive3.table{j}": 0.03 * (j % 2) for j in range(1, 16)})
    measured = pk.VirtualMachine(true, noise=0.005, angle_noise=5e-6).measure(
        rows(true, 90), kind="pose"
    )
    with pytest.warns(
        pk.CalibrationWarning, match=r"contradict the prior .* pull the smoothness at drive3\.table"
    ):
        pk.identify(robot, replace(measured, sigma=None), free=["drive*"])


# from where actuators came ------------------------------------------------------------------------


def test_the_direction_of_approach_is_written_and_read(tmp_path: Path) -> None:
    q = np.array([[1.0, 5.0], [2.0, 5.0], [1.5, 4.0], [1.5, 6.0]])
    measured = pk.Measurements(q, np.zeros((4, 3)), approach="order")
    assert measured.approach is not None
    assert measured.approach.tolist() == [[0, 0], [1, 0], [-1, -1], [-1, 1]]
    measured.write(tmp_path / "m.csv")
    again = pk.read_measurements(tmp_path / "m.csv")
    assert again.approach is not None and (again.approach == measured.approach).all()
    assert (again.select([2, 1]).approach == measured.approach[[2, 1]]).all()
    text = (tmp_path / "m.csv").read_text(encoding="utf-8")
    (tmp_path / "half.csv").write_text(text.replace("approach.q2", "heat"), encoding="utf-8")
    with pytest.raises(ValueError, match=r"approach\.q2"):
        pk.read_measurements(tmp_path / "half.csv")


def test_rows_from_both_sides_are_two_poses() -> None:
    q = np.array([[1.0, 5.0]] * 3)
    measured = pk.Measurements(q, np.zeros((3, 3)), approach=[[1, 1], [-1, 1], [1, 1]])
    assert measured.pose_index.tolist() == [1, 0, 1]


@pytest.mark.parametrize(("approach", "message"), [
    (0.5, "approach must be 1, -1 or 0"),
    ("sideways", "approach must be 'order' or numbers"),
    ([1, 1, 1], r"approach must be one number or have shape \(2,\) or \(4, 2\)"),
])  # fmt: skip
def test_no_other_direction_is_taken(approach: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        pk.Measurements(np.zeros((4, 2)), np.zeros((4, 3)), approach=approach)


def test_a_batch_of_directions_goes_with_as_many_rows() -> None:
    robot = hexapod({"drive": {"backlash": 0.1}})
    q = robot.inverse(robot.home)
    from_both = robot.approaching(np.outer([1, -1], np.ones(6)))
    ways = from_both.machine.drives(robot.slots, np.stack([q, q]))
    assert np.allclose(ways[1] - ways[0], [0.1, 0, 0, 0, 0, 0])
    with pytest.raises(ValueError, match="approach is of 2 rows, but 1 were asked for"):
        from_both.forward(q)


def test_a_node_beyond_all_rows_is_as_smooth_as_the_nodes_that_are_held_let_it_be() -> None:
    """Bends are those of held corrections, too: a node is off the line through its neighbours."""
    places = np.array([300.0, 400.0, 520.0, 700.0, 1000.0])
    values = np.array([0.3, 0.0, 0.1, -0.05, 0.0])
    law = {"table": np.column_stack([places, values]).tolist(), "smoothness": 0.01}
    robot = hexapod(*[{"drive": law, "stroke": [250.0, 1100.0]}] * 6)
    q = rows(robot, 20)
    assert q.min() > 520.0
    measured = pk.VirtualMachine(robot, noise=0.005, angle_noise=5e-6).measure(q, kind="pose")
    found = pk.identify(robot, measured, free=["offset*", "drive*.table2"])

    def bends(second: float) -> np.ndarray:
        table = values.copy()
        table[1] = second
        return np.array([
            table[j] - np.interp(places[j], places[[j - 1, j + 1]], table[[j - 1, j + 1]])
            for j in (1, 2, 3)
        ])  # fmt: skip

    constant, slope = bends(0.0), bends(1.0) - bends(0.0)
    wanted = -(slope @ constant) / (slope @ slope)
    assert abs(wanted) > 0.1
    nodes = [v for name, v in zip(found.free, found.values, strict=True) if "table2" in name]
    np.testing.assert_allclose(nodes, wanted, atol=1e-6)
