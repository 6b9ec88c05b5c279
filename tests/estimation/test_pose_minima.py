"""Rows of machines with more actuators than ways to move are fitted in their least minimum."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np

import pkmcal as pk

from ..sweeps import sweep

NOISE = 0.2  # mm
# kind, sides of the platform against those of the frame (x, y; upper cables at its top or bottom),
# half widths of the platform, mm: how cables cross decides how many false minima there are
HUNG = {
    "crossed": ("cable", (-1, 1, 1), (300.0, 250.0, 200.0)),
    "crossed, upside down": ("cable", (-1, 1, -1), (300.0, 250.0, 200.0)),
    "pulleys, upside down": ("pulley", (1, 1, -1), (150.0, 120.0, 80.0)),
}


def hung(kind: str, sides: tuple[int, int, int], half: tuple[float, ...], path: Path) -> pk.Robot:
    """A platform on eight cables from the corners of a frame."""
    limbs = ""
    for up in (1, -1):
        for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
            ends = np.multiply([x, y, up], sides) * half
            limbs += (
                f'[[limb]]\nkind = "{kind}"\nbase = [{2000.0 * x}, {1500.0 * y},'
                f" {1250.0 * (1 + up)}]\nplatform = {ends.tolist()}\n"
            )
            if kind == "pulley":
                limbs += f"swivel = [0, 0, {up}]\nradius = 40.0\n"
    path.write_text(
        'name = "hung"\nunits = { length = "mm", angle = "deg" }\n'
        '[pose]\nmap = "spatial"\nhome = { z = 1200.0 }\n' + limbs
    )
    return pk.load(path)


def measured(
    name: str, seed: int, path: Path, sigma: float | None = NOISE
) -> tuple[pk.Robot, pk.Robot, pk.Measurements, np.ndarray]:
    """The machine as drawn, the true one, 70 rows of which 20 have a position, and the poses."""
    nominal, rng = hung(*HUNG[name], path / "hung.toml"), np.random.default_rng(seed)
    names = nominal.geometry.match("base*")
    true = nominal.replace({each: nominal.geometry[each] + rng.normal(0, 5) for each in names})
    at = np.array([0, 0, 1200, 0, 0, 0]) + rng.uniform(-1, 1, (70, 6)) * [
        900, 600, 500, 0.2, 0.2, 0.2,
    ]  # fmt: skip
    q = true.inverse(at) + rng.normal(0, NOISE, (70, 8))
    seen = at[:, :3] + rng.normal(0, 0.1, (70, 3))
    seen[20:] = np.nan
    stated = None if sigma is None else 0.1
    log = pk.Measurements(q, seen, "position", sigma=stated, actuator_sigma=sigma)
    return nominal, true, log, at


def in_false_minima(robot: pk.Robot, log: pk.Measurements, at: np.ndarray) -> int:
    """Rows that forward kinematics from home does not find at the minimum next to the truth."""
    from_home, near = robot.forward(log.actuators), robot.forward(log.actuators, guess=at)
    same = np.abs(from_home.pose - near.pose).max(axis=1) < 1.0
    return int((~same).sum())


@sweep(
    "name, exact, drop",
    [
        ("crossed", True, None),
        ("crossed", False, "slack"),
        ("crossed, upside down", True, "slack"),
        ("pulleys, upside down", False, None),
    ],
    quick=[("crossed", True, None), ("crossed, upside down", True, "slack")],
)
def test_sound_cables_are_not_called_slack_where_forward_ends_in_false_minima(
    name: str, exact: bool, drop: Literal["slack"] | None, tmp_path: Path
) -> None:
    nominal, true, log, at = measured(name, 2, tmp_path)
    begin = true if exact else nominal
    assert in_false_minima(begin, log, at) >= 5  # else the test shows nothing
    found = pk.identify(begin, log, "base*", drop=drop)
    assert found.slack == () and found.outliers == ()
    assert found.verdict.state == "calibrated"
    off = found.values - [true.geometry[each] for each in found.free]
    assert np.abs(off / found.stderr).max() < 5.0
    poses = found.robot.forward(log.actuators, guess=at).pose
    end = found.fit.end.pose[found.fit.equations.table.pose_of[0]]
    np.testing.assert_allclose(end, poses, atol=1e-2)


@sweep("name", ["crossed", "pulleys, upside down"], quick=["crossed"])
def test_cables_that_are_slack_are_found_beside_rows_in_false_minima(
    name: str, tmp_path: Path
) -> None:
    _, true, log, _ = measured(name, 2, tmp_path)
    q, loose = log.actuators.copy(), [(3, 0), (30, 4), (31, 6), (50, 2), (60, 7)]
    for row, cable in loose:
        q[row, cable] += 40.0
    log = pk.Measurements(q, log.values, "position", sigma=0.1, actuator_sigma=NOISE)
    found = pk.identify(true, log, "base*", drop="slack")
    named = {(each.rows[0], actuator - 1) for each in found.slack for actuator in each.actuators}
    assert len(found.slack) == len(loose) and set(loose) <= named
    off = found.values - [true.geometry[each] for each in found.free]
    assert np.abs(off / found.stderr).max() < 5.0


def test_rows_held_out_are_compared_in_their_least_minima(tmp_path: Path) -> None:
    _, true, log, at = measured("crossed", 2, tmp_path)
    assert in_false_minima(true, log, at) >= 5
    whole = true.forward(log.actuators, guess=at).pose
    log = pk.Measurements(log.actuators, whole[:, :3], "position", sigma=0.1, actuator_sigma=NOISE)
    found = pk.identify(true, log, "base*", holdout=0.4)
    assert found.holdout_outliers == ()
    assert found.holdout_rms < 1.5 * found.holdout_expected


def test_no_sigma_need_be_stated(tmp_path: Path) -> None:
    nominal, true, log, _ = measured("pulleys, upside down", 0, tmp_path, None)
    found = pk.identify(nominal, log, "base*")
    assert found.slack == () and found.verdict.state == "calibrated"
    off = found.values - [true.geometry[each] for each in found.free]
    assert np.abs(off / found.stderr).max() < 5.0
