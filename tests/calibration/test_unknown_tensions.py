"""Tensions as unknowns of each row: load cells that err, a load that is balanced; against a twin.

The twin eliminates the balance in another way, three tensions by the fourth, and fits all poses,
tensions and numbers at once in SciPy, with derivatives by complex steps.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

import pkmcal as pk
from pkmcal.exceptions import ArgumentError, FileError
from pkmcal.kinematics.equilibrium import equilibrium
from tests.robots import hexapod, made

ANCHORS = np.array([
    [2000.0, 1500, 2500], [-2000, 1400, 2600], [-1900, -1500, 2400], [2100, -1400, 2500],
])  # fmt: skip
WEIGHT, STRETCH, CABLE = 196.2, 2e-5, 0.2
FREE = {
    "base2.x": (1, 0), "base3.x": (2, 0), "base3.y": (2, 1),
    "base4.x": (3, 0), "base4.y": (3, 1), "base4.z": (3, 2),
}  # fmt: skip
FORCES = ("drive1.stretch", "drive2.stretch", "drive3.stretch", "drive4.stretch", "load.force.z")


def four(
    balance: bool = True, stretch: float | None = STRETCH, kind: str = "cable", **beside: object
) -> pk.Robot:
    load = {"force": [0.0, 0.0, -WEIGHT]} | ({"balance": True} if balance else {})
    limbs = [{"kind": kind, "base": a, "platform": [0.0, 0, 0], **beside} for a in ANCHORS]
    if stretch is not None:
        limbs = [limb | {"drive": {"stretch": stretch}} for limb in limbs]
    sections = {"load": load} if kind == "cable" else {}
    return made("translation", {"z": 800.0}, limbs, **sections)


def directions(anchors: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    away = anchors - at[:, None]
    length = np.sqrt((away**2).sum(axis=2))
    return length, away / length[:, :, None]


def carried(u: np.ndarray, fourth: np.ndarray, weight: float) -> np.ndarray:
    """Tensions (N, 4) that carry a weight where the fourth is given."""
    rest = np.array([0.0, 0.0, 1.0]) * weight - u[:, 3] * fourth[:, None]
    three = np.linalg.solve(u[:, :3].transpose(0, 2, 1), rest[:, :, None])[:, :, 0]
    return np.column_stack([three, fourth])


def simulated(seed: int, cell: float, count: int = 40, off: float = 20.0) -> dict[str, np.ndarray]:
    """What is read of cables and load cells, and the truth."""
    rng = np.random.default_rng(seed)
    anchors = ANCHORS.copy()
    for place in FREE.values():
        anchors[place] += rng.normal(0, off)
    at = rng.uniform([-600, -600, 200], [700, 600, 1600], (count, 3))
    length, u = directions(anchors, at)
    tension = carried(u, rng.uniform(80, 250, count), WEIGHT)
    q = length / (1.0 + STRETCH * tension) + rng.normal(0, CABLE, length.shape)
    cells = tension + rng.normal(0, cell, tension.shape)
    true = np.array([anchors[place] for place in FREE.values()])
    return {"q": q, "cells": cells, "at": at, "tension": tension, "true": true}


def rows(data: dict[str, np.ndarray], sigma: float | None, **beside: object) -> pk.Measurements:
    return pk.Measurements(
        data["q"], None, "closure",
        **{"actuator_sigma": CABLE, "tension": data["cells"], "tension_sigma": sigma} | beside,
    )  # fmt: skip


def twin(
    data: dict[str, np.ndarray], sigma: float, read: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """Numbers, their deviations and the cost of all unknowns at once."""
    count, n = len(data["q"]), len(FREE) + len(FORCES) + 1
    units = np.array([1.0] * len(FREE) + [1e-5] * 4 + [1.0, 1.0])

    def residual(v: np.ndarray) -> np.ndarray:
        numbers, own = v[:n] * units, v[n:].reshape(count, 4)
        anchors = ANCHORS.astype(v.dtype)
        for value, place in zip(numbers, FREE.values(), strict=False):
            anchors[place] = value
        length, u = directions(anchors, own[:, :3])
        tension = carried(u, 10.0 * own[:, 3], -numbers[-2])
        closures = (length / (1.0 + numbers[6:10] * tension) - data["q"]) / CABLE
        gains = np.array([1.0, 1.0, numbers[-1], 1.0])
        cells = ((gains * tension - data["cells"]) / sigma)[read]
        return np.concatenate([closures.ravel(), cells, [(numbers[-1] - 1.0) / 0.05]])

    def jacobian(v: np.ndarray) -> np.ndarray:
        row = np.repeat(np.arange(count), 4)
        row_of = np.concatenate([row, row[read.ravel()], [-1]])
        found = np.zeros((len(row_of), len(v)))
        for j in range(n + 4):
            moved = v.astype(complex)
            moved[[j] if j < n else slice(j, None, 4)] += 1e-30j
            column = residual(moved).imag / 1e-30
            if j < n:
                found[:, j] = column
            else:
                k = np.flatnonzero(row_of >= 0)
                found[k, n + 4 * row_of[k] + j - n] = column[k]
        return found

    first = [ANCHORS[place] for place in FREE.values()]
    own = np.column_stack([data["at"], data["tension"][:, 3] / 10.0])
    begin = np.concatenate([first, [STRETCH / 1e-5] * 4, [-WEIGHT, 1.0], own.ravel()])
    end = least_squares(
        residual, begin, jacobian, x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15
    )
    normal = jacobian(end.x)
    deviations = np.sqrt(np.diag(np.linalg.inv(normal.T @ normal)))
    return end.x[:n] * units, deviations[:n] * units, 2.0 * end.cost


def test_all_unknowns_at_once_say_the_same() -> None:
    """Anchors, stretch, weight and a gain with a prior; some cells were not read."""
    data, read = simulated(3, 2.0, 30), np.ones((30, 4), dtype=bool)
    read[3, 1] = read[5, 2] = read[5, 0] = False
    log = rows(data, 2.0, tension=np.where(read, data["cells"], np.nan))
    names = [*FREE, *FORCES, "load.cell3"]
    found = pk.identify(four(), log, names, prior={"load.cell3": 0.05}, loss="classical")
    values, deviations, cost = twin(data, 2.0, read)
    lengths = slice(len(FREE))
    assert np.abs(found.values - values)[lengths].max() < 1e-4
    assert np.abs((found.values - values) / deviations).max() < 1e-5
    np.testing.assert_allclose(found.stderr, deviations, rtol=1e-6)
    assert found.chi2_per_dof * found.dof == pytest.approx(cost, rel=1e-9)
    assert found.dof == 30 * 4 + read.sum() + 1 - 30 * 4 - len(names)
    assert sum(found.redundancy) + 1 == pytest.approx(found.dof, abs=1.0)  # and the prior


def test_cells_without_error_are_those_that_are_exact() -> None:
    data = simulated(4, 2.0)
    exact = pk.identify(four(False), rows(data, None), [*FREE])
    sure = pk.identify(four(False), rows(data, 1e-5), [*FREE])
    assert np.abs((sure.values - exact.values) / exact.stderr).max() < 1e-5
    np.testing.assert_allclose(sure.stderr, exact.stderr, rtol=1e-5)


def test_a_balanced_load_tells_what_tensions_alone_do_not() -> None:
    data = simulated(5, 0.3)
    without = pk.identify(four(False), rows(data, 0.3), [*FREE])
    balanced = pk.identify(four(), rows(data, 0.3), [*FREE])
    ratio = np.sqrt(np.mean(without.stderr**2) / np.mean(balanced.stderr**2))
    assert ratio > 3.0
    assert np.abs((balanced.values - data["true"]) / balanced.stderr).max() < 4.5


@pytest.mark.slow
@pytest.mark.parametrize("cell", [0.3, 2.0, 10.0])
def test_stated_deviations_are_honest(cell: float) -> None:
    z, held = [], []
    for seed in range(300):
        data = simulated(seed, cell)
        found = pk.identify(four(), rows(data, cell), [*FREE], loss="classical")
        z.append((found.values - data["true"]) / found.stderr)
        ends = found.interval95
        held.append((ends[:, 0] < data["true"]) & (data["true"] < ends[:, 1]))
    rms, share = np.sqrt(np.mean(np.square(z))), np.mean(held)
    print(f"{cell} N: rms z {rms:.3f}, 95 % intervals hold {share:.3f}")
    assert 0.9 < rms < 1.1 and 0.93 < share < 0.97


def test_noise_of_load_cells_is_estimated_as_a_group_of_its_own() -> None:
    data = simulated(6, 2.0)
    found = pk.identify(four(), rows(data, None, actuator_sigma=None), [*FREE])
    assert 1.7 < found.tension_noise < 2.3 and 0.13 < found.actuator_noise < 0.27
    _, of_cells, of_cables = found.redundancy
    assert of_cells + of_cables == pytest.approx(found.dof) and of_cells > 3 * of_cables
    assert "noise of the load cells" in str(found)
    assert found.to_dict()["tension_noise"] == found.tension_noise


def test_as_many_cables_as_coordinates_hold_their_load() -> None:
    """Three cables that carry a point: cells and balance find anchors, where cables say nothing."""
    limbs = [
        {"kind": "cable", "base": a, "platform": [0.0, 0, 0], "drive": {"stretch": 0.0}}
        for a in ANCHORS[:3]
    ]
    robot = made(
        "translation", {"z": 800.0}, limbs, load={"force": [0.0, 0, -WEIGHT], "balance": True}
    )
    true = robot.replace({"base3.x": -1880.0, "load.force.z": -190.0})
    at = np.random.default_rng(1).uniform([-600, -500, 200], [500, 600, 1600], (30, 3))
    u = directions(
        np.vstack([[true.geometry[f"base{i}.{x}"] for x in "xyz"] for i in (1, 2, 3)]), at
    )[1]
    tension = np.linalg.solve(u.transpose(0, 2, 1), np.tile([0, 0, 190.0], (30, 1))[:, :, None])[
        :, :, 0
    ]
    rng = np.random.default_rng(2)
    q = true.inverse(np.hstack([at, np.zeros((30, 3))])) + rng.normal(0, 0.1, (30, 3))
    log = pk.Measurements(
        q, None, "closure", actuator_sigma=0.1,
        tension=tension + rng.normal(0, 0.2, tension.shape), tension_sigma=0.2,
    )  # fmt: skip
    found = pk.identify(robot, log, ["base3.x", "load.force.z"])
    assert found.rank == 2 and found.dof == 30 * 3 - 2
    assert np.abs((found.values - [-1880.0, -190.0]) / found.stderr).max() < 4.5


def test_the_load_alone_is_found() -> None:
    """No number that cables or their ways depend on is free."""
    data = simulated(12, 2.0, off=0.0)
    for name, true in (("load.force.z", -WEIGHT), ("load.cell3", 1.0)):
        found = pk.identify(four(), rows(data, 2.0), name)
        assert abs(found.values[0] - true) < 4.5 * found.stderr[0] < 0.02 * abs(true)


def test_one_length_for_all_says_nothing_of_forces() -> None:
    """A prior of 1 mm is none of the mass or a gain; errors of 0.1 mm are none of the load."""
    names = [*FREE, "load.force.z", "load.cell3"]
    log = rows(simulated(13, 2.0), 2.0)
    one = pk.identify(four(), log, names, prior=50.0)
    other = pk.identify(four(), log, names, prior=dict.fromkeys(FREE, 50.0))
    np.testing.assert_array_equal(one.values, other.values)
    np.testing.assert_array_equal(one.stderr, other.stderr)
    home = four().home
    asked = [
        pk.tolerance(four(), home, 0.1, samples=100).names,
        pk.allocate_tolerance(four(), home, 0.1).joints,
        pk.sensitivity(four(), home).cases,
    ]
    assert not [name for each in asked for name in each if name.startswith("load")]


def eight() -> pk.Robot:
    """A platform on eight cables, from the corners of a frame."""
    corners = [(x, y, z) for z in (2500.0, 0.0) for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    limbs = [
        {
            "kind": "cable", "base": [2000.0 * x, 1500.0 * y, z],
            "platform": [-150.0 * x, 120.0 * y, 80.0 if z else -80.0],
            "drive": {"stretch": STRETCH},
        }
        for x, y, z in corners
    ]  # fmt: skip
    load = {"force": [0.0, 0, -98.1], "at": [0.0, 0, -20], "balance": True}
    return made("spatial", {"z": 1200.0}, limbs, load=load)


def test_six_freedoms_are_found_where_little_was_read() -> None:
    """Anchors 30 mm off, a centre of mass and a weight: 20 positions, 10 of them with angles."""
    robot, rng = eight(), np.random.default_rng(2)
    at = rng.uniform(-1, 1, (40, 6)) * [900, 600, 500, 0.1, 0.1, 0.1] + robot.home
    moved = {
        name: robot.geometry[name] + rng.uniform(-30, 30) for name in robot.geometry.match("base*")
    }
    true = robot.replace(moved | {"load.at.x": 8.0, "load.at.y": -5.0, "load.force.z": -101.0})
    held = pk.tensions(true, at, least=20.0)
    at, tension = at[held.ok], held.tension[held.ok]
    q = true.tensioned(tension).inverse(at) + rng.normal(0, CABLE, tension.shape)
    sigma = np.array([0.5] * 3 + [5e-3] * 3)
    seen = at + rng.normal(0, 1, at.shape) * sigma
    seen[10:, 3:] = seen[20:] = np.nan
    log = pk.Measurements(
        q, seen, "pose", sigma=sigma, actuator_sigma=CABLE,
        tension=tension + rng.normal(0, 1, tension.shape), tension_sigma=1.0,
    )  # fmt: skip
    found = pk.identify(robot, log, ["base*", "load.at.x", "load.at.y", "load.force.z"])
    assert found.converged and found.rank == len(found.free) == 27
    z = (found.values - [true.geometry[name] for name in found.free]) / found.stderr
    assert np.abs(z).max() < 4.5 and 0.7 < found.chi2_per_dof < 1.3


def test_what_forces_leave_open_is_named() -> None:
    data = simulated(7, 2.0)
    found = pk.identify(four(), rows(data, 2.0), [*FREE, *FORCES, "load.cell*"])
    assert any(text.startswith("the scale of forces") for text in found.gauges)
    assert not found.unidentifiable and found.rank == len(found.free) - 1
    upright = pk.identify(four(), rows(data, 2.0), ["base*", "gain*", "drive*"])
    assert "along x, y and z and turned about z:" in upright.gauges[0]
    assert "common scale" in upright.gauges[1] and not upright.unidentifiable
    tilted = pk.identify(four(), rows(data, 2.0), ["base*", "load.force.*"])
    assert "turned about x, y and z" in tilted.gauges[0] and not tilted.unidentifiable


def test_the_bootstrap_draws_load_cells_too() -> None:
    found = pk.identify(four(), rows(simulated(8, 2.0, 25), 2.0), [*FREE])
    drawn = pk.bootstrap(found, 40, seed=1)
    ratio = drawn.stderr / found.stderr
    assert ratio.min() > 0.6 and ratio.max() < 1.6


def test_the_balance_and_its_derivatives() -> None:
    """At tensions that `pk.tensions` finds nothing is left; derivatives by differences."""
    points = [{"over": [(a + np.array([50.0, 80, 0])).tolist()], "parts": [1, 2]} for a in ANCHORS]
    load = {"force": [1.0, 2, -WEIGHT], "at": [0.0, 0, -30], "balance": True}
    frames = {"base": {"x": 10.0, "y": -5.0, "alpha": 0.1, "beta": -0.2, "gamma": 0.3}}
    limbs = [
        {"kind": "tackle", "base": a, "platform": [0.0, 0, 0], **beside}
        for a, beside in zip(ANCHORS, points, strict=True)
    ]
    robot = made("translation", {"z": 800.0}, limbs, load=load, frames=frames)
    at = np.random.default_rng(0).uniform([-600, -600, 200], [700, 600, 1600], (5, 3))
    poses = robot.frames.outward(np.hstack([at, np.zeros((5, 3))]))
    tension, none = pk.tensions(robot, poses).tension, np.empty(0, dtype=np.intp)

    def left(machine: pk.Robot) -> np.ndarray:
        load = machine.model.load
        assert load is not None
        return equilibrium(machine, poses, tension, load, none).off

    assert np.abs(left(robot)).max() < 1e-9
    names, load_now = robot.geometry.names, robot.model.load
    assert load_now is not None
    found = equilibrium(robot, poses, tension, load_now, np.arange(len(names))).by_number
    for name in ("base2.x", "over3.1.y", "load.force.z", "load.force.x", "gain1", "load.cell2"):
        k, step = names.index(name), 1e-3
        ends = [left(robot.replace({name: robot.geometry[name] + sign * step})) for sign in (1, -1)]
        numeric = (ends[0] - ends[1]) / (2 * step)
        np.testing.assert_allclose(found[:, :, k], numeric, atol=1e-7)


def test_the_load_is_written_back(tmp_path: Path) -> None:
    text = four().save(tmp_path / "four.toml") or (tmp_path / "four.toml").read_text("utf-8")
    (tmp_path / "mine.toml").write_text(text.replace("cells = [1.0, 1.0, 1.0, 1.0]\n", ""), "utf-8")
    robot = pk.load(tmp_path / "mine.toml").replace({"load.force.z": -190.5, "load.cell2": 1.25})
    assert robot.model.load is not None and robot.model.load.force == (0.0, 0.0, -190.5)
    robot.save(
        tmp_path / "kept.toml", like=tmp_path / "mine.toml", deviations={"load.force.z": 0.25}
    )
    robot.save(tmp_path / "new.toml")
    for name in ("kept.toml", "new.toml"):
        again = pk.load(tmp_path / name)
        np.testing.assert_array_equal(again.geometry.values, robot.geometry.values)
        assert again.model.load == robot.model.load
    assert "± fixed, fixed, 0.25" in (tmp_path / "kept.toml").read_text("utf-8")


def test_deviations_of_load_cells_are_written_and_read_back(tmp_path: Path) -> None:
    data = simulated(9, 2.0, 5)
    cells = data["cells"].copy()
    cells[1, 2] = np.nan
    log = rows(data, 2.0, tension=cells)
    log.write(tmp_path / "log.csv")
    again = pk.read_measurements(tmp_path / "log.csv", four())
    assert again.tension_sigma is not None and "tension read" in str(again)
    np.testing.assert_array_equal(again.tension, cells)
    np.testing.assert_array_equal(again.tension_sigma, log.tension_sigma)
    assert log.select([1]).tension_sigma.shape == (1, 4)


def test_what_cannot_be_is_refused_by_name() -> None:
    data = simulated(10, 2.0, 12)
    few = data["cells"].copy()
    few[2] = np.nan
    for robot, log, why in (
        (
            four(),
            rows(data, 2.0, tension=few),
            "1 or more must be read in each row, 3 follow .* row 2",
        ),
        (four(False), rows(data, 2.0, tension=few), "of 4 tensions 4 or more must be read"),
        (four(False), rows(data, None, tension=few), "was not read everywhere"),
        (four(), rows(data, None, tension=None), "1 or more must be read in each row"),
        (four(kind="UPS"), rows(data, 2.0), "limb 1 is a UPS, no cable"),
        (four(), rows(data, 2.0, actuator_sigma=[0.0, 0.2, 0.2, 0.2]), "must be positive where"),
    ):
        with pytest.raises(ArgumentError, match=why):
            pk.identify(robot, log, ["base4.x"])
    with pytest.raises(ArgumentError, match="holdout: rows whose tensions are unknown"):
        pk.identify(four(), rows(data, 2.0), ["base4.x"], holdout=0.25)
    with pytest.raises(ArgumentError, match=r"slack: .* tensions are unknown"):
        pk.identify(four(), rows(data, 2.0), ["base4.x"], drop="slack")
    with pytest.raises(ArgumentError, match="plans know no load cells"):
        pk.plan_poses(four(), np.hstack([data["at"], 0 * data["at"]]), 8, actuator_noise=0.2)
    with pytest.raises(ArgumentError, match="state tension_sigma of all sets"):
        pk.identify(four(), [rows(data, 2.0), rows(data, None)], ["base4.x"])
    with pytest.raises(ArgumentError, match="tension_sigma must be positive"):
        rows(data, 0.0)
    with pytest.raises(ArgumentError, match="tension_sigma: no tension was read"):
        rows(data, 2.0, tension=None)
    with pytest.raises(ArgumentError, match="tension must be finite"):
        pk.VirtualMachine(hexapod()).measure(hexapod().inverse(hexapod().home), tension=np.nan)
    for load, why in (
        ({"force": [0.0, 0, -1], "balance": 1}, "balance: must be true or false"),
        ({"force": [0.0, 0, -1], "cells": [1.0] * 4}, "cells: are gains"),
        ({"force": [0.0, 0, -1], "balance": True, "cells": [1.0]}, "must be 4 numbers"),
        ({"least": 5.0, "balance": True}, "there is nothing to balance"),
    ):
        limbs = [{"kind": "cable", "base": a, "platform": [0.0, 0, 0]} for a in ANCHORS]
        with pytest.raises(FileError, match=why):
            made("translation", {"z": 800.0}, limbs, load=load)


def test_a_balance_that_says_nothing_changes_nothing() -> None:
    """No tension was read and nothing stretches: poses are those without."""
    data = simulated(11, 2.0)
    with pytest.warns(pk.CalibrationWarning, match="times what sigma says"):  # cables do stretch
        one, other = (
            pk.identify(four(balance, None), rows(data, None, tension=None), [*FREE])
            for balance in (True, False)
        )
    np.testing.assert_array_equal(one.values, other.values)
    assert np.isnan(one.tension_rms) and len(one.redundancy) == 2
