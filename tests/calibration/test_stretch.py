"""Cables that stretch by their tension: simulated machines whose equilibrium is solved in NumPy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.exceptions import ArgumentError, FileError
from tests.robots import made

THREE = np.array([[2000.0, 0, 2500], [-1100, 1700, 2600], [-900, -1800, 2400]])
FOUR = np.array([[2000.0, 1500, 2500], [-2000, 1400, 2600], [-1900, -1500, 2400], [2100, -1400, 0]])
STRETCH, WEIGHT, NOISE, CABLE = 2e-5, (0.0, 0.0, -196.2), 0.1, 0.2
STRETCHES = ("drive1.stretch", "drive2.stretch", "drive3.stretch")


def hung(anchors: np.ndarray, kind: str = "cable") -> pk.Robot:
    limbs = [
        {"kind": kind, "base": a, "platform": [0, 0, 0], "drive": {"stretch": 0.0}} for a in anchors
    ]
    return made("translation", {"z": 800.0}, limbs)


@pytest.fixture(scope="module")
def three() -> pk.Robot:
    return hung(THREE)


@pytest.fixture(scope="module")
def four() -> pk.Robot:
    return hung(FOUR)


def ways(anchors: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distances (N, c), and unit vectors to the anchors (N, c, 3)."""
    away = anchors - at[:, None]
    length = np.linalg.norm(away, axis=2)
    return length, away / length[:, :, None]


def carried(anchors: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Tensions (N, 3) of three cables that carry the weight."""
    _, u = ways(anchors, at)
    return np.linalg.solve(
        u.transpose(0, 2, 1), np.tile(-np.array(WEIGHT), (len(at), 1))[:, :, None]
    )[:, :, 0]


def let_out(
    anchors: np.ndarray, at: np.ndarray, tension: np.ndarray, stretch: np.ndarray
) -> np.ndarray:
    return ways(anchors, at)[0] / (1.0 + stretch * tension)


def places(seed: int, count: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.uniform([-600, -600, 200], [700, 600, 1600], (count, 3))


def test_a_cable_is_longer_by_its_tension(three: pk.Robot) -> None:
    """Every call at given tensions, row by row; unstretched without."""
    at = places(0, 12)
    pose = np.hstack([at, np.zeros((12, 3))])
    tension = carried(THREE, at)
    stretch = np.array([1.0, 2.0, 3.0]) * 1e-5
    robot = three.replace(dict(zip(STRETCHES, stretch, strict=True)))
    pulled = robot.tensioned(tension)
    q = let_out(THREE, at, tension, stretch)
    np.testing.assert_allclose(pulled.inverse(pose), q, rtol=1e-14)
    np.testing.assert_allclose(pulled.forward(q).pose[:, :3], at, atol=1e-9)
    np.testing.assert_allclose(robot.inverse(pose), ways(THREE, at)[0], rtol=1e-14)
    np.testing.assert_allclose(
        pulled.jacobian(pose),
        -ways(THREE, at)[1] / (1.0 + stretch * tension)[:, :, None],
        rtol=1e-12,
    )
    slots, own = robot.slots, np.ascontiguousarray(pose)
    places_of = robot.geometry.slot_index.astype(np.int32)
    values = robot.geometry.values
    found = pulled.machine.readings(slots, own, q, places_of)[2]
    assert found is not None
    for name in ("drive2.stretch", "offset2", "gain2", "base2.x"):
        k = robot.geometry.names.index(name)
        step = 1e-8 if "stretch" in name else 1e-4
        ends = []
        for side in (1, -1):
            changed = values.copy()
            changed[k] += side * step
            ends.append(robot.with_values(changed).tensioned(tension).inverse(pose))
        numeric = (ends[0] - ends[1]) / (2 * step)
        np.testing.assert_allclose(
            found[:, :, k], numeric, rtol=1e-6, atol=1e-6 * abs(numeric).max()
        )


def balanced(robot: pk.Robot, q: np.ndarray) -> np.ndarray:
    """Tensions where the robot hangs, from one pose to the next."""
    tension = np.zeros(q.shape)
    for _ in range(4):
        tension = carried(THREE, robot.tensioned(tension).forward(q).pose[:, :3])
    return tension


def test_balance_is_found_in_a_few_rounds(three: pk.Robot) -> None:
    at = places(1, 6)
    tension = carried(THREE, at)
    robot = three.replace(dict.fromkeys(STRETCHES, STRETCH))
    q = let_out(THREE, at, tension, np.full(3, STRETCH))
    np.testing.assert_allclose(balanced(robot, q), tension, rtol=1e-6)
    poses = robot.tensioned(tension).forward(q).pose
    np.testing.assert_allclose(pk.tensions(robot, poses, WEIGHT).tension, tension, rtol=1e-9)


def by_weight(robot: pk.Robot, seed: int, kind: str, count: int = 30) -> pk.Identification:
    """Positions or heights of a machine whose mass is known; tensions from where it hangs."""
    rng = np.random.default_rng(seed)
    at = places(seed + 1000, count)
    q = let_out(THREE, at, carried(THREE, at), np.full(3, STRETCH))
    seen = at + rng.normal(0, NOISE, at.shape)
    values = seen if kind == "position" else seen[:, 2]
    found = robot
    for _ in range(3):
        log = pk.Measurements(q, values, kind, sigma=NOISE, tension=balanced(found, q))
        fit = pk.identify(robot, log, ["drive*"], loss="classical")
        found = fit.robot
    return fit


def checked(found: list[pk.Identification], true: float | np.ndarray) -> tuple[float, float]:
    """Rms of errors over their deviations, and how often an interval holds the truth."""
    z = np.array([(f.values - true) / f.stderr for f in found])
    held = np.array([(f.interval95[:, 0] < true) & (true < f.interval95[:, 1]) for f in found])
    return float(np.sqrt(np.mean(z**2))), float(held.mean())


@pytest.mark.parametrize("kind", ["position", "height"])
def test_stretch_is_found_by_a_known_mass(three: pk.Robot, kind: str) -> None:
    z, held = checked([by_weight(three, seed, kind, 15) for seed in range(8)], STRETCH)
    assert 0.5 < z < 1.5 and held > 0.8


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["position", "height"])
def test_deviations_of_stretch_are_honest(three: pk.Robot, kind: str) -> None:
    z, held = checked([by_weight(three, seed, kind) for seed in range(200)], STRETCH)
    print(f"{kind}: rms z {z:.3f}, 95 % intervals hold {held:.3f}")
    assert 0.9 < z < 1.1 and 0.93 < held < 0.97


MOVED = {"base4.x": (3, 0), "base4.y": (3, 1), "base3.x": (2, 0)}
MORE = MOVED | {"base4.z": (3, 2), "base3.z": (2, 2), "base2.z": (1, 2)}  # hardly determined


def by_cells(
    robot: pk.Robot, seed: int, numbers: dict[str, tuple[int, int]]
) -> tuple[pk.Identification, np.ndarray]:
    """Nothing but cables and load cells read, of a machine with a cable more than needed."""
    rng = np.random.default_rng(seed)
    anchors = FOUR.copy()
    for place in numbers.values():
        anchors[place] += rng.normal(0, 10)
    at = places(seed + 2000, 40)
    length, u = ways(anchors, at)
    tension = np.empty(length.shape)
    for row in range(len(at)):  # what carries the weight, and a preload of its own
        alone = np.linalg.lstsq(u[row].T, -np.array(WEIGHT), rcond=None)[0]
        against = np.linalg.svd(u[row].T)[2][-1]
        against *= np.sign(against.sum())
        tension[row] = alone + rng.uniform(50, 350) * against / np.abs(against).max()
    stretch = np.full(4, STRETCH)
    q = length / (1.0 + stretch * tension) + rng.normal(0, CABLE, length.shape)
    cells = tension + rng.normal(0, 0.5, tension.shape)
    log = pk.Measurements(q, None, "closure", actuator_sigma=CABLE, tension=cells)
    found = pk.identify(robot, log, [*numbers, "drive*"], loss="classical")
    true = {name: anchors[place] for name, place in numbers.items()}
    true |= {f"drive{i}.stretch": STRETCH for i in (1, 2, 3, 4)}
    return found, np.array([true[name] for name in found.free])


def test_load_cells_and_cables_alone_find_anchors_and_stretch(four: pk.Robot) -> None:
    found, true = by_cells(four, 3, MOVED)
    assert found.rank == len(found.free) == 7
    assert np.abs((found.values - true) / found.stderr).max() < 4.5
    read = found.fit.equations.table.sets[0].actuators
    blind = pk.Measurements(read, None, "closure", actuator_sigma=CABLE)
    with pytest.warns(pk.CalibrationWarning, match="times what sigma says"):
        pk.identify(four, blind, [*MOVED])


def test_combinations_at_the_limit_of_what_is_determined_are_kept_out() -> None:
    """With them in the fit they are not determined, without them they are: it does not go round."""
    found, _ = by_cells(hung(FOUR, "UPS"), 9, MORE)
    assert found.evaluations < 100 and found.rank == 9 < len(found.free)


@pytest.mark.slow
def test_deviations_with_load_cells_are_honest() -> None:
    legs = hung(FOUR, "UPS")  # what is no cable is not looked at for slack
    pairs = [by_cells(legs, seed, MOVED) for seed in range(200)]
    z = np.array([(found.values - true) / found.stderr for found, true in pairs])
    held = np.array([
        (found.interval95[:, 0] < true) & (true < found.interval95[:, 1]) for found, true in pairs
    ])  # fmt: skip
    print(f"cells: rms z {np.sqrt(np.mean(z**2)):.3f}, 95 % intervals hold {held.mean():.3f}")
    assert 0.9 < np.sqrt(np.mean(z**2)) < 1.1 and 0.93 < held.mean() < 0.97


def test_tensions_are_written_and_read_back(three: pk.Robot, tmp_path: Path) -> None:
    at = places(2, 5)
    q, tension = ways(THREE, at)[0], carried(THREE, at)
    log = pk.Measurements(q, at, "position", sigma=NOISE, tension=tension)
    assert "tension stated" in str(log)
    log.write(tmp_path / "log.csv")
    again = pk.read_measurements(tmp_path / "log.csv", three)
    assert again.tension is not None
    np.testing.assert_array_equal(again.tension, tension)
    assert "tension.q1 [N]" in (tmp_path / "log.csv").read_text("utf-8").splitlines()[0]
    np.testing.assert_array_equal(log.select([1, 2]).tension, tension[1:3])


def test_rows_under_other_tension_are_other_poses(three: pk.Robot) -> None:
    at = places(2, 1)
    q = np.tile(ways(THREE, at)[0], (3, 1))
    tension = [[10.0, 10, 10], [10, 10, 10], [10, 20, 10]]
    log = pk.Measurements(q, np.tile(at, (3, 1)), "position", tension=tension)
    assert log.pose_index.tolist() == [0, 0, 1]


def test_what_is_no_tension_is_refused(three: pk.Robot) -> None:
    q = np.full((2, 3), 1500.0)
    with pytest.raises(pk.ArgumentError, match="tension must be one number or have shape"):
        pk.Measurements(q, None, "closure", tension=[1.0, 2.0])
    with pytest.raises(pk.ArgumentError, match="tension must be finite"):
        three.tensioned([1.0, np.nan, 2.0])
    with pytest.raises(pk.ArgumentError, match="tension is of 2 rows, but 3 were asked for"):
        three.tensioned(np.ones((2, 3))).forward(np.full((3, 3), 1500.0))
    with pytest.raises(pk.ArgumentError, match="under tension, which the page cannot draw"):
        pk.show(three.tensioned([1.0, 1.0, 1.0]), "page.html")


def test_without_tensions_it_is_said_what_is_missing(three: pk.Robot) -> None:
    at = places(2, 10)
    rows = pk.Measurements(ways(THREE, at)[0], at, "position", sigma=0.1)
    with pytest.raises(ArgumentError, match=r"no row states a tension: columns tension\.q1 \[N\]"):
        pk.identify(three, rows, "drive*")


def test_what_turns_does_not_stretch() -> None:
    crank = {
        "kind": "RUS", "base": [100, 0, 0], "platform": [50, 0, 0], "axis": [0, 1, 0],
        "zero": [1, 0, 0], "crank": 80.0, "rod": 200.0, "branch": 1, "drive": {"stretch": 1e-5},
    }  # fmt: skip
    with pytest.raises(FileError, match="this actuator turns the limb"):
        made("translation", {"z": -150.0}, [crank] * 3)
