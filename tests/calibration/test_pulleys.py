"""Calibration of cables over pulleys, with swivel angles: against all places as unknowns."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from scipy.optimize import least_squares

import pkmcal as pk

ENTRY = np.array(
    [[1500.0, 1000, 2000], [-1500, 1000, 2000], [-1500, -1000, 2000], [1500, -1000, 2000]]
)
RADIUS, NOISE, TURNED = 50.0, 0.3, 1e-3  # mm, of lengths [mm] and of swivels [rad]
ENDS = ["base2.x", "base2.z", *(f"base{i}.{c}" for i in (3, 4) for c in "xyz")]
FREE = [*ENDS, "radius*"]
ORDER = [*FREE[:8], *(f"radius{i}" for i in range(1, 5))]
ORDER += ["angle.swivel1.zero", "angle.swivel3.zero"]
OWN = [3, 5, 6, 7, 8, 9, 10, 11]  # of the flattened entry points, those of ENDS
READ = (0, 2)  # the pulleys whose swivels are read


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> pk.Robot:
    """A point on four cables over pulleys: one more than it has coordinates."""
    limbs = "".join(
        f'[[limb]]\nkind = "pulley"\nbase = {a}\nplatform = [0, 0, 0]\nradius = {RADIUS}\n'
        "swivel = [0, 0, 1]\nzero = [1, 0, 0]\n"
        for a in ENTRY.tolist()
    )
    path: Path = tmp_path_factory.mktemp("pulleys") / "pulleys.toml"
    path.write_text(
        'name = "four pulleys"\nunits = { length = "mm", angle = "deg" }\n'
        '[pose]\nmap = "translation"\nhome = { z = 700 }\n' + limbs
    )
    return pk.load(path)


def cables(entry: np.ndarray, radius: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lengths and swivels (N, 4) at places (N, 3), swivel axes upright."""
    away = at[:, None] - entry
    across, along = np.hypot(away[..., 0], away[..., 1]) - radius, away[..., 2]
    far = np.hypot(across, along)
    leaves = np.arctan2(along, across) + np.arccos(radius / far)
    length = radius * (np.pi - leaves) + np.sqrt(far**2 - radius**2)
    return length, np.arctan2(away[..., 1], away[..., 0])


class Drawn(NamedTuple):
    lengths: np.ndarray
    swivels: np.ndarray
    true: np.ndarray  # in the order of ORDER


def drawn(seed: int, rows: int) -> Drawn:
    rng = np.random.default_rng(seed)
    entry, radius = ENTRY + rng.normal(0, 10, (4, 3)), RADIUS + rng.normal(0, 3, 4)
    entry[0], entry[1, 1] = ENTRY[0], ENTRY[1, 1]  # where the machine stands
    zeros = rng.normal(0, 0.05, 2)
    at = rng.uniform([-1200, -800, 0], [1200, 800, 1850], (rows, 3))
    length, swivel = cables(entry, radius, at)
    return Drawn(
        length + rng.normal(0, NOISE, length.shape),
        swivel[:, READ] - zeros + rng.normal(0, TURNED, (rows, 2)),
        np.concatenate([entry.ravel()[OWN], radius, zeros]),
    )


def fitted(machine: pk.Robot, log: Drawn) -> pk.Identification:
    """Lengths in every row, and the swivels of two pulleys with unknown zeros."""
    sets = [
        pk.Measurements(
            log.lengths, log.swivels[:, k], pk.readings.Angle(f"swivel{limb + 1}"), sigma=TURNED,
            actuator_sigma=NOISE,
        )
        for k, limb in enumerate(READ)
    ]  # fmt: skip
    return pk.identify(machine, sets, FREE)


def ordered(found: pk.Identification) -> list[int]:
    return [found.free.index(name) for name in ORDER]


def test_it_is_the_least_squares_with_all_places_among_the_unknowns(machine: pk.Robot) -> None:
    log = drawn(0, 18)

    def residual(x: np.ndarray) -> np.ndarray:
        entry = ENTRY.ravel().copy()
        entry[OWN] = x[:8]
        length, swivel = cables(entry.reshape(4, 3), x[8:12], x[14:].reshape(-1, 3))
        of_cables = (length - log.lengths) / NOISE
        return np.concatenate(
            [of_cables.ravel(), ((swivel[:, READ] - x[12:14] - log.swivels) / TURNED).ravel()]
        )

    radius = np.full(4, RADIUS)
    places = [
        least_squares(lambda p, q=q: cables(ENTRY, radius, p[None])[0][0] - q, [0.0, 0, 700]).x
        for q in log.lengths
    ]
    start = np.concatenate([ENTRY.ravel()[OWN], radius, np.zeros(2), *places])
    best = least_squares(residual, start, "3-point", x_scale="jac", xtol=1e-14, ftol=1e-14)
    found = fitted(machine, log)
    at = ordered(found)
    scale = np.linalg.norm(best.jac, axis=0)
    by = best.jac / scale
    deviation = np.sqrt(np.diag(np.linalg.inv(by.T @ by)))[:14] / scale[:14]
    np.testing.assert_allclose((found.values[at] - best.x[:14]) / deviation, 0.0, atol=2e-3)
    ratio = found.stderr[at] / deviation
    np.testing.assert_allclose(ratio, ratio[0], rtol=2e-3)  # a Birge ratio, common to all
    assert 0.5 < ratio[0] < 2.0


def test_deviations_are_honest(machine: pk.Robot) -> None:
    z, covered = [], []
    for seed in range(30):
        log = drawn(50 + seed, 18)
        found = fitted(machine, log)
        at = ordered(found)
        z.append((found.values[at] - log.true) / found.stderr[at])
        covered.append((found.interval95[at, 0] < log.true) & (log.true < found.interval95[at, 1]))
    # 30 machines of 14 correlated numbers
    assert 0.75 < np.mean(np.square(z)) < 1.3
    assert 0.90 < np.mean(covered) < 0.99


@pytest.mark.filterwarnings("ignore:.*hardly determined")  # by lengths alone
def test_swivels_make_every_number_surer(machine: pk.Robot) -> None:
    log = drawn(7, 40)
    lengths = pk.Measurements(log.lengths, None, "closure", actuator_sigma=NOISE)
    alone = pk.identify(machine, lengths, FREE, loss="classical")
    both = fitted(machine, log)
    assert alone.rank == 12 and both.rank == 14
    at = [both.free.index(name) for name in alone.free]
    assert (both.stderr[at] < 0.9 * alone.stderr).all()


def test_other_angles_are_still_refused(machine: pk.Robot) -> None:
    log = drawn(8, 5)
    with pytest.raises(pk.ArgumentError, match="no passive joint 'swivel9'"):
        pk.identify(
            machine, pk.Measurements(log.lengths, log.swivels[:, 0], pk.readings.Angle("swivel9"))
        )
