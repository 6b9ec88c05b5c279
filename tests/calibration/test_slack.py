"""Cables that were slack: found, said, and left out without the rest of their rows."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import norm

import pkmcal as pk

CORNERS = np.array(
    [
        [x, y, z]
        for z in (0.0, 2500)
        for x, y in ((-2000.0, -1500), (2000, -1500), (2000, 1500), (-2000, 1500))
    ]
)
NOISE = 0.3  # mm
FREE = [f"base{i}.{c}" for i in range(1, 9) for c in "xyz"]
HELD = ("base1.x", "base1.y", "base1.z", "base2.y", "base2.z", "base3.z")  # where it stands


def machine_on(corners: np.ndarray, path: Path) -> pk.Robot:
    limbs = "".join(
        f'[[limb]]\nkind = "cable"\nbase = {corner.tolist()}\nplatform = [0, 0, 0]\n'
        for corner in corners
    )
    path.write_text(
        'name = "camera on cables"\nunits = { length = "mm", angle = "deg" }\n'
        '[pose]\nmap = "translation"\nhome = { z = 1100 }\n' + limbs
    )
    return pk.load(path)


@pytest.fixture(scope="module")
def eight(tmp_path_factory: pytest.TempPathFactory) -> pk.Robot:
    return machine_on(CORNERS, tmp_path_factory.mktemp("eight") / "eight.toml")


def drawn(
    corners: np.ndarray, seed: int, rows: int, share: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Anchors, readings (rows, n), and which cables are slack, at most one a row."""
    rng = np.random.default_rng(seed)
    anchors = corners + rng.normal(0, 10, corners.shape)
    anchors[0], anchors[1, 1:], anchors[2, 2] = corners[0], corners[1, 1:], corners[2, 2]
    at = rng.uniform([-1200, -900, 300], [1200, 900, 2000], (rows, 3))
    q = np.linalg.norm(at[:, None] - anchors, axis=2) + rng.normal(0, NOISE, (rows, len(corners)))
    slack = np.zeros(q.shape, dtype=bool)
    loose = rng.choice(rows, int(share * rows), replace=False)
    slack[loose, rng.integers(0, len(corners), len(loose))] = True
    q[slack] += rng.uniform(5.0, 80.0, int(slack.sum()))
    return anchors, q, slack


def fitted(
    robot: pk.Robot, q: np.ndarray, slack: str, sigma: float | None = NOISE
) -> pk.Identification:
    log = pk.Measurements(q, None, "closure", actuator_sigma=sigma)
    free = [name for name in FREE if int(name[4]) <= q.shape[1]]
    return pk.identify(robot, log, free, fix=HELD, drop="slack" if slack == "drop" else None)  # type: ignore[arg-type]


def cells(found: pk.Identification) -> set[tuple[int, int]]:
    return {(row, each.actuators[0] - 1) for each in found.slack for row in each.rows}


@pytest.mark.parametrize("sigma", [NOISE, None])
def test_slack_cables_are_found_and_the_fit_is_that_of_the_rest(
    eight: pk.Robot, sigma: float | None
) -> None:
    anchors, q, slack = drawn(CORNERS, 0, 40, 0.3)
    found = fitted(eight, q, "drop", sigma)
    assert cells(found) == set(zip(*map(np.ndarray.tolist, np.nonzero(slack)), strict=True))
    names = [name for name in FREE if name not in HELD]

    def residual(x: np.ndarray) -> np.ndarray:
        values = dict(zip(names, x, strict=False))
        there = np.array(
            [
                [values.get(f"base{i + 1}.{c}", CORNERS[i, k]) for k, c in enumerate("xyz")]
                for i in range(8)
            ]
        )
        off = np.linalg.norm(x[18:].reshape(-1, 1, 3) - there, axis=2) - q
        return np.asarray(off[~slack] / NOISE)

    start = np.concatenate([
        [CORNERS[int(n[4]) - 1]["xyz".index(n[-1])] for n in names],
        *(least_squares(lambda p, i=i: (np.linalg.norm(p - CORNERS, axis=1) - q[i])[~slack[i]],
                        [0.0, 0, 1100]).x for i in range(40)),
    ])  # fmt: skip
    best = least_squares(residual, start, "3-point", xtol=1e-14, ftol=1e-14)
    deviation = np.sqrt(np.diag(np.linalg.inv(best.jac.T @ best.jac)))[:18]
    at = [found.free.index(name) for name in names]
    np.testing.assert_allclose((found.values[at] - best.x[:18]) / deviation, 0.0, atol=2e-3)
    # 8 lengths a row less those of slack cables, 3 for the place, 18 for the anchors
    assert found.dof == 40 * 5 - int(slack.sum()) - 18
    assert len(anchors) == 8


def test_amounts_are_in_mm_and_said(eight: pk.Robot) -> None:
    _, q, slack = drawn(CORNERS, 1, 30, 0.2)
    clean = q.copy()
    clean[slack] = np.nan
    found = fitted(eight, q, "drop")
    pose = found.fit.estimate.evaluation.pose[:, :3]
    corners = np.array([[found.robot.geometry[f"base{i}.{c}"] for c in "xyz"] for i in range(1, 9)])
    order = [
        int(np.argmin(np.abs(found.fit.equations.table.actuators - row).sum(axis=1))) for row in q
    ]
    for each in found.slack:
        (row,), (actuator,) = each.rows, each.actuators
        way = np.linalg.norm(pose[order[row]] - corners[actuator - 1])
        assert abs(each.longer - (q[row, actuator - 1] - way)) < 1e-6
    assert f"{len(found.slack)} readings of slack cables left out, as asked: q" in str(found)
    assert found.closure_rms < 2 * NOISE


@pytest.mark.filterwarnings("ignore:residuals are")
def test_without_dropping_they_are_said(eight: pk.Robot) -> None:
    _, q, slack = drawn(CORNERS, 2, 30, 0.05)
    (row,) = np.flatnonzero(slack.any(axis=1)).tolist()
    with pytest.warns(pk.CalibrationWarning, match="cables read longer than the others allow"):
        found = fitted(eight, q, "keep")
    assert (row, int(slack[row].argmax())) in cells(found)


def test_several_cables_of_one_pose_may_be_slack(eight: pk.Robot) -> None:
    """The longest hides the others until it is left out."""
    _, q, _ = drawn(CORNERS, 12, 30, 0.0)
    loose = {(5, 1): 60.0, (5, 6): 25.0, (17, 3): 80.0, (17, 4): 40.0, (17, 0): 15.0}
    for cell, longer in loose.items():
        q[cell] += longer
    found = fitted(eight, q, "drop")
    assert cells(found) == loose.keys()
    for each in found.slack:
        assert each.longer == pytest.approx(loose[each.rows[0], each.actuators[0] - 1], abs=3.0)


def test_the_same_readings_are_left_out_where_a_datum_is_chosen(eight: pk.Robot) -> None:
    """What says where the base frame lies is held by the user or by the package."""
    _, q, slack = drawn(CORNERS, 0, 40, 0.3)
    by_user = fitted(eight, q, "drop")
    log = pk.Measurements(q, None, "closure", actuator_sigma=NOISE)
    chosen = pk.identify(eight, log, FREE, fix="datum", drop="slack")
    assert len(chosen.datum.names) == len(HELD)
    wanted = set(zip(*map(np.ndarray.tolist, np.nonzero(slack)), strict=True))
    assert cells(chosen) == cells(by_user) == wanted
    assert chosen.dof == by_user.dof
    assert chosen.chi2_per_dof == pytest.approx(by_user.chi2_per_dof, rel=1e-4)


def test_deviations_are_honest_where_cables_are_slack(eight: pk.Robot) -> None:
    z, right, wrong = [], 0, 0
    for seed in range(25):
        anchors, q, slack = drawn(CORNERS, 100 + seed, 30, 0.25)
        found = fitted(eight, q, "drop")
        wanted = set(zip(*map(np.ndarray.tolist, np.nonzero(slack)), strict=True))
        right += len(cells(found) & wanted)
        wrong += len(cells(found) - wanted)
        true = np.array([anchors[int(n[4]) - 1]["xyz".index(n[-1])] for n in found.free])
        z.append((found.values - true) / found.stderr)
    assert right == 25 * 7 and wrong <= 2  # 5 mm and more, of 0.3 mm of noise
    assert 0.8 < np.mean(np.square(z)) < 1.25


def test_taut_machines_have_no_slack_cables(eight: pk.Robot) -> None:
    false = 0
    for seed in range(15):
        _, q, _ = drawn(CORNERS, 300 + seed, 30, 0.0)
        plain, dropped = fitted(eight, q, "keep"), fitted(eight, q, "drop")
        false += len(plain.slack) + len(dropped.slack)
        if not dropped.slack:
            np.testing.assert_array_equal(plain.values, dropped.values)
    assert false <= 2


@pytest.mark.parametrize(("row", "cable"), [(4, 0), (9, 5)])
def test_a_cable_is_slack_from_where_one_of_100_taut_machines_has_one(
    eight: pk.Robot, row: int, cable: int
) -> None:
    """Of readings without noise: what the place does not take up, over sigma, against a quantile.

    Lengths change with the place along the cables; the anchor that is free has 30 rows.
    """
    at = np.random.default_rng(3).uniform([-1200, -900, 300], [1200, 900, 2000], (30, 3))
    exact = np.linalg.norm(at[:, None] - CORNERS, axis=2)
    along = (at[row] - CORNERS) / exact[row, :, None]
    left = 1.0 - along[cable] @ np.linalg.solve(along.T @ along, along[cable])
    for share in (0.95, 1.05):
        q = exact.copy()
        q[row, cable] += share * norm.isf(0.01 / q.size) * NOISE / np.sqrt(left)
        log = pk.Measurements(q, None, "closure", actuator_sigma=NOISE)
        found = pk.identify(eight, log, ["base8.x"], drop="slack")
        assert cells(found) == ({(row, cable)} if share > 1.0 else set())


@pytest.mark.filterwarnings("ignore:residuals are")
def test_what_residuals_show_of_the_noise_says_from_where_on_cables_are_slack(
    eight: pk.Robot,
) -> None:
    """Taut cables with five times the noise that is stated, and slack ones where it is right."""
    _, q, _ = drawn(CORNERS, 310, 30, 0.0)
    assert len(fitted(eight, q, "drop", NOISE / 5.0).slack) <= 1
    _, q, slack = drawn(CORNERS, 311, 30, 0.2)
    as_stated, wider = (fitted(eight, q, "drop", sigma) for sigma in (NOISE, NOISE / 5.0))
    assert cells(as_stated) == cells(wider) == set(zip(*np.nonzero(slack), strict=True))


@pytest.mark.filterwarnings("ignore:residuals are")
def test_a_reading_that_is_too_short_is_no_slack_cable(eight: pk.Robot) -> None:
    _, q, _ = drawn(CORNERS, 4, 30, 0.0)
    q[7, 3] -= 20.0
    found = fitted(eight, q, "drop")
    assert not found.slack
    assert 7 in found.outliers


@pytest.mark.parametrize("first", range(0, 8, 3))
def test_readings_may_count_backwards_and_in_other_units(
    eight: pk.Robot, tmp_path: Path, first: int
) -> None:
    """Drums wound the other way and winches in steps: slack is in mm of cable."""
    _, q, _ = drawn(CORNERS, 16, 30, 0.2)
    gain = np.roll([1.0, -1.0, 0.01, -20.0, 1.0, -1.0, 2.0, -0.5], first)
    path = tmp_path / "counts.toml"
    machine_on(CORNERS, path)
    head, *limbs = path.read_text().split("[[limb]]\n")
    each = (f"[[limb]]\ngain = {g}\n{limb}" for g, limb in zip(gain, limbs, strict=True))
    path.write_text(head + "".join(each))
    sigma = np.tile(NOISE / np.abs(gain), (len(q), 1))
    log = pk.Measurements(q / gain, None, "closure", actuator_sigma=sigma)
    found = pk.identify(pk.load(path), log, FREE, fix=HELD, drop="slack")
    plain = fitted(eight, q, "drop")
    assert len(plain.slack) == 6 and cells(found) == cells(plain)
    for one, other in zip(found.slack, plain.slack, strict=True):
        assert abs(one.longer - other.longer) < 1e-5


def test_with_one_cable_more_than_needed_it_cannot_be_told_which(tmp_path: Path) -> None:
    """All that is left of such a row is one number, whose sign names the cables that it may be."""
    corners = CORNERS[[0, 1, 2, 3]] * [1, 1, 0] + [0, 0, 2500.0]
    corners[3, 2] = 2600.0
    robot = machine_on(corners, tmp_path / "four.toml")
    rng = np.random.default_rng(5)
    at = rng.uniform([-1200, -900, 300], [1200, 900, 1500], (40, 3))
    q = np.linalg.norm(at[:, None] - corners, axis=2) + rng.normal(0, NOISE, (40, 4))
    q[11, 2] += 40.0
    log = pk.Measurements(q, None, "closure", actuator_sigma=NOISE)
    found = pk.identify(robot, log, ["base4.x", "base4.y"], drop="slack")
    (cable,) = found.slack
    assert cable.rows == (11,) and 3 in cable.actuators and len(cable.actuators) > 1
    assert found.idle == 1
    assert " or q" in str(cable)


@pytest.mark.filterwarnings("ignore:residuals are")
@pytest.mark.parametrize("smaller", [1.0, 10.0])  # than the noise is the sigma that is stated
def test_the_slack_cable_is_among_those_named_where_others_would_do_as_well(
    smaller: float,
) -> None:
    """Two cables more than needed: at some poses two pull nearly alike, and noise hides which."""
    robot = pk.load(Path(__file__).parents[2] / "examples" / "cable-robot" / "robot.toml")
    gain = np.array([robot.geometry[f"gain{i}"] for i in range(1, 9)])
    alone = several = 0
    for seed in range(2):
        rng = np.random.default_rng([seed, 9])
        box = np.array([900, 600, 500, 0.1, 0.1, 0.1])
        at = robot.home + rng.uniform(-1, 1, (40, 6)) * box
        q = robot.inverse(at) + rng.normal(0, 0.2, (40, 8)) / gain
        rows, cables = rng.choice(40, 5, replace=False), rng.integers(8, size=5)
        loose = dict(zip(rows.tolist(), cables.tolist(), strict=True))
        for row, cable in loose.items():
            q[row, cable] += rng.uniform(5, 60) / gain[cable]
        sigma = 0.2 / smaller / np.abs(gain)
        log = pk.Measurements(q, None, "closure", actuator_sigma=sigma)
        found = pk.identify(robot, log, "offset*", drop="slack")
        named = {row: each.actuators for each in found.slack for row in each.rows}
        assert named.keys() == loose.keys()
        for row, cable in loose.items():
            assert cable + 1 in named[row]
        alone += sum(len(each) == 1 for each in named.values())
        several += sum(len(each) > 1 for each in named.values())
    assert alone >= 3 and several >= 1


def test_legs_that_push_are_never_slack(tmp_path: Path) -> None:
    path = tmp_path / "legs.toml"
    machine_on(CORNERS, path)
    path.write_text(path.read_text().replace('"cable"', '"UPS"'))
    _, q, _ = drawn(CORNERS, 6, 30, 0.1)
    log = pk.Measurements(q, None, "closure", actuator_sigma=NOISE)
    with pytest.warns(pk.CalibrationWarning):
        found = pk.identify(pk.load(path), log, FREE, fix=HELD, drop="slack")
    assert not found.slack


def test_the_bootstrap_leaves_out_the_same_readings(eight: pk.Robot) -> None:
    _, q, slack = drawn(CORNERS, 9, 30, 0.2)
    found = fitted(eight, q, "drop")
    assert len(found.slack) == int(slack.sum())
    spread = pk.bootstrap(found, 40, seed=1)
    ratio = spread.stderr / found.stderr
    assert 0.8 < np.sqrt(np.mean(ratio**2)) < 1.25  # 18 deviations from 40 replicates


def test_words_are_checked(eight: pk.Robot) -> None:
    _, q, _ = drawn(CORNERS, 7, 20, 0.0)
    log = pk.Measurements(q, None, "closure", actuator_sigma=NOISE)
    with pytest.raises(pk.ArgumentTypeError, match="drop: 'outliers', 'slack' or numbers of rows"):
        pk.identify(eight, log, FREE, fix=HELD, drop="loose")  # type: ignore[arg-type]


def test_the_command_line_leaves_them_out_and_writes_them(run: Any, tmp_path: Path) -> None:
    machine_on(CORNERS, tmp_path / "eight.toml")
    _, q, slack = drawn(CORNERS, 8, 30, 0.1)
    head = ",".join(f"q{i} [mm]" for i in range(1, 9)) + ",actuator_sigma [mm]"
    np.savetxt(
        tmp_path / "log.csv", np.column_stack([q, np.full(len(q), NOISE)]), delimiter=",",
        header=head, comments="", fmt="%.17g",
    )  # fmt: skip
    given = ("calibrate", tmp_path / "eight.toml", tmp_path / "log.csv", "--free", ",".join(FREE))
    fixed = ("--fix", ",".join(HELD), "--json")
    found = json.loads(run(*given, *fixed, "--drop-slack").stdout)
    wanted = {(int(r), int(a) + 1) for r, a in zip(*np.nonzero(slack), strict=True)}
    assert {(each["rows"][0], each["actuators"][0]) for each in found["slack"]} == wanted
    assert all(each["longer"] > 3.0 for each in found["slack"])
    kept = json.loads(run(*given, *fixed).stdout)
    assert any("--drop-slack" in text for text in kept["warnings"])
    run(*given, "--fix", ",".join(HELD), "--drop-slack", "--report", tmp_path / "sheet")
    page = (tmp_path / "sheet" / "report.html").read_text("utf-8")
    assert f"q{min(a for _, a in wanted)} of row" in page
