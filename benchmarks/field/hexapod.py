"""A hexapod with spools and motion capture, 108 poses: pkmcal, and SciPy leg by leg."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import pkmcal as pk
from benchmarks.field.case import DATA, Clock, Scored, Stated, agreeing, halves, scored
from pkmcal.arrays import FloatArray, IntArray

LOG = DATA / "jugglebot" / "session1.csv"
TURNS = np.array([13.21144, 14.0456, 13.8233, 14.124109, 14.16007, 14.03256]) * 1e-3  # per mm
N = np.arange(6)


def circle(radius: float, degrees: FloatArray) -> FloatArray:
    turned = np.radians(degrees)
    return radius * np.column_stack([np.cos(turned), np.sin(turned), 0 * turned])


BASE = circle(410.0, 200 + 100 * (N // 2) + 20 * ((N + 1) // 2))
PLATFORM = circle(219.075, 154.3012223 + 8.6024446 * (N // 2) + 111.3975554 * ((N + 1) // 2))
ZERO = np.linalg.norm(PLATFORM - BASE + np.array([0.0, 0.0, 565.0]), axis=1)
Predict = Callable[[FloatArray], FloatArray]  # travel (N, 6) -> places (N, 3)
FREE = ("base*", "platform*", "offset*", "gain*")


def nominal(folder: Path, drive: str) -> pk.Robot:
    """Return the hexapod as drawn, its legs in mm of travel; `drive` is its drive law."""
    lines = [
        'name = "hexapod with spools"',
        'units = { length = "mm", angle = "deg" }',
        "[pose]",
        'map = "spatial"',
        "home = { z = 780.0 }",
    ]
    for b, p, zero in zip(BASE.tolist(), PLATFORM.tolist(), ZERO.tolist(), strict=True):
        lines += ["[[limb]]", 'kind = "UPS"', f"base = {b}", f"platform = {p}", f"offset = {zero}"]
        lines += [drive] * bool(drive)
    (folder / "robot.toml").write_text("\n".join(lines), encoding="utf-8")
    return pk.load(folder / "robot.toml")


Fit = Callable[[FloatArray, FloatArray, FloatArray], tuple[Predict, Stated, str]]


def by_pkmcal(drive: str) -> Fit:
    """Return a fit of travel (N, 6), places (N, 3) and rotations (N, 3, 3)."""

    def fit(
        travel: FloatArray, place: FloatArray, turned: FloatArray
    ) -> tuple[Predict, Stated, str]:
        with TemporaryDirectory() as folder:
            robot = nominal(Path(folder), drive)
        free = [*FREE, *["drive*"] * bool(drive)]
        found = pk.identify(robot, measured(travel, place, turned), free)
        half = (found.interval95[:, 1] - found.interval95[:, 0]) / 2
        where = found.robot.forward
        return lambda q: where(q).pose[:, :3], (found.values, half), found.verdict.state

    return fit


def measured(travel: FloatArray, place: FloatArray, turned: FloatArray) -> pk.Measurements:
    motion = np.tile(np.eye(4), (len(travel), 1, 1))
    motion[:, :3, :3], motion[:, :3, 3] = turned, place
    return pk.Measurements(travel, pk.screw.to_pose(motion), "pose")


def by_scipy(
    travel: FloatArray, place: FloatArray, turned: FloatArray
) -> tuple[Predict, Stated, str]:
    """Fit 8 numbers a leg to its own lengths, and solve poses by `least_squares`, row by row."""
    legs, half = [], []
    for i in range(6):

        def off(n: FloatArray, i: int = i) -> FloatArray:
            reach = np.linalg.norm(place + turned @ n[3:6] - n[:3], axis=1)
            return reach - n[6] - n[7] * travel[:, i]

        best = least_squares(off, [*BASE[i], *PLATFORM[i], ZERO[i], 1.0], x_scale="jac")
        noise = 2 * best.cost / (len(travel) - 8)
        legs.append(best.x)
        half.append(1.984 * np.sqrt(noise * np.diag(np.linalg.inv(best.jac.T @ best.jac))))
    b, p, zero, gain = (np.array(legs)[:, part] for part in
                        (slice(3), slice(3, 6), 6, 7))  # fmt: skip

    def forward(q: FloatArray) -> FloatArray:
        places = []
        for row in q:

            def closure(pose: FloatArray, row: FloatArray = row) -> FloatArray:
                reach = pose[:3] + Rotation.from_rotvec(pose[3:]).apply(p) - b
                return np.linalg.norm(reach, axis=1) - zero - gain * row

            places.append(least_squares(closure, [0, 0, 780.0, 0, 0, 0], x_scale="jac").x[:3])
        return np.array(places)

    return forward, (np.array(legs).ravel(), np.array(half).ravel()), ""


def rows() -> Iterator[Scored]:
    """Yield the rows of the table: distances of the platform's place at poses left out."""
    if not LOG.exists():
        return
    log = np.genfromtxt(LOG, delimiter=",", skip_header=1)
    given = log[:, :6] / TURNS, log[:, 6:9], Rotation.from_quat(log[:, 9:13]).as_matrix()
    each = np.arange(len(log))
    name = "hexapod with spools, motion capture, 108 poses"
    for tool, fit in (
        ("pkmcal", by_pkmcal("")),
        ("pkmcal, quadratic drives", by_pkmcal("drive = { quadratic = 0.0 }")),
        ("SciPy by hand, leg by leg", by_scipy),
    ):

        def errors(left_out: IntArray) -> tuple[float, FloatArray]:
            with Clock() as clock:
                forward, *_ = fit(*(part[~left_out] for part in given))
            travel, place, _ = (part[left_out] for part in given)
            return clock.seconds, np.linalg.norm(forward(travel) - place, axis=1)

        half = halves(each)
        stated = [fit(*(part[mask] for part in given))[1] for mask in (half, ~half)]
        says = fit(*given)[2]
        yield scored(name, tool, "mm", each, errors, agreeing(*stated), says)
