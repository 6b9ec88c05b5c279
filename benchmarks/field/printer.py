"""A delta printer and the log of its bed probe: pkmcal, Klipper's own calibration, SciPy by hand."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t

import pkmcal as pk
from benchmarks.field.case import DATA, ROOT, Clock, Scored, agreeing, halves, scored
from pkmcal.arrays import FloatArray, IntArray

STEP = 60 / 6400  # mm
ROD = 340.0
START = np.array([170.0, 210.0, 330.0, 625.0, 625.0, 625.0])  # radius, two angles, three heights
TRUE = np.array([171.4, 209.7, 330.2, 624.2, 625.6, 624.7])  # examples/linear-delta/README.md


@dataclass(frozen=True)
class Log:
    """Carriages' travel from their end stops (N, 3), downwards negative, and heights (N,), mm."""

    name: str
    travel: FloatArray
    height: FloatArray
    true: FloatArray | None = None

    def rows(self, kept: IntArray) -> Log:
        return Log(self.name, self.travel[kept], self.height[kept], self.true)


@dataclass(frozen=True)
class Fitted:
    """Numbers, half widths of their 95 % intervals, and the heights at actuators (N, 3)."""

    values: FloatArray
    half: FloatArray | None
    height: Callable[[FloatArray], FloatArray]
    says: str = ""


def logs() -> Iterator[Log]:
    """Yield the example, which is simulated, and a real printer's log where it is there."""
    table = np.genfromtxt(ROOT / "examples" / "linear-delta" / "probe.csv", delimiter=",",
                          skip_header=1, comments="#")  # fmt: skip
    yield Log("delta printer, 41 heights, simulated", table[:, :3], table[:, 3], TRUE)
    real = DATA / "linear-delta" / "probe41.csv"
    if real.exists():
        table = np.genfromtxt(real, delimiter=",", names=True)
        steps = np.column_stack([table[f"steps_{carriage}"] for carriage in "abc"])
        yield Log("delta printer, 41 heights", -STEP * steps, table["height_mm"])


def by_pkmcal(log: Log) -> Fitted:
    """Fit as the command line does."""
    robot = pk.load(ROOT / "examples" / "linear-delta" / "robot.toml")
    found = pk.identify(robot, pk.Measurements(log.travel, log.height, "height"))
    order = [found.free.index(name) for name in
             ("radius", "angle1", "angle2", "offset1", "offset2", "offset3")]  # fmt: skip
    unit = np.array([1.0, *np.degrees([1.0, 1.0]), 1.0, 1.0, 1.0])
    half = (found.interval95[:, 1] - found.interval95[:, 0])[order] / 2
    values = found.values[order] * unit
    height = found.robot.forward
    return Fitted(values, half * unit, lambda q: height(q).pose[:, 2], found.verdict.state)


def heights(numbers: FloatArray, travel: FloatArray) -> FloatArray:
    """Height of the nozzle: three spheres about the carriages meet there (trilateration)."""
    radius, first, second, *ends = numbers
    angle = np.radians([first, second, 90.0])
    towers = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    top = np.array(ends) + travel  # (N, 3)
    # differences of the spheres are linear in x and y at a given z
    a = 2 * (towers[1:] - towers[0])
    squares = (towers**2).sum(axis=1) + top**2
    flat = np.linalg.solve(a, (squares[:, 1:] - squares[:, :1]).T).T
    slope = np.linalg.solve(a, -2 * (top[:, 1:] - top[:, :1]).T).T
    away = flat - towers[0]
    qa = 1 + (slope**2).sum(axis=1)
    qb = 2 * (slope * away).sum(axis=1) - 2 * top[:, 0]
    qc = (away**2).sum(axis=1) + top[:, 0] ** 2 - ROD**2
    return (-qb - np.sqrt(qb**2 - 4 * qa * qc)) / (2 * qa)


def by_scipy(log: Log) -> Fitted:
    """Trilateration and `least_squares`, derivatives by differences: some thirty lines."""
    best = least_squares(lambda n: heights(n, log.travel) - log.height, START, x_scale="jac")
    dof = len(log.height) - len(START)
    covariance = np.linalg.inv(best.jac.T @ best.jac) * 2 * best.cost / dof
    half = t.ppf(0.975, dof) * np.sqrt(np.diag(covariance))
    return Fitted(best.x, half, lambda q: heights(best.x, q))


def by_klipper(log: Log) -> Fitted:
    """What DELTA_CALIBRATE does: the firmware's own geometry and its coordinate descent."""
    from klippy.kinematics.delta import DeltaCalibration
    from klippy.mathutil import coordinate_descent

    radius, first, second, *ends = START.tolist()
    down = np.sqrt(ROD**2 - radius**2)
    start = DeltaCalibration(radius, [first, second, 90.0], [ROD] * 3,
                             [end - down for end in ends], [1.0] * 3)  # fmt: skip
    names, numbers = start.coordinate_descent_params(False)
    stable, wanted = (-log.travel).tolist(), log.height.tolist()

    def error(tried: dict[str, float]) -> float:
        try:
            here = start.new_calibration(tried).get_position_from_stable
            return sum((here(row)[2] - z) ** 2 for row, z in zip(stable, wanted, strict=True))
        except ValueError:
            return 1e13

    found = start.new_calibration(coordinate_descent(names, numbers, error))
    values = np.array([found.radius, *found.angles[:2], *found.abs_endstops])
    where = found.get_position_from_stable
    return Fitted(values, None, lambda q: np.array([where(row)[2] for row in (-q).tolist()]))


TOOLS = {"pkmcal": by_pkmcal, "Klipper": by_klipper, "SciPy by hand": by_scipy}


def rows() -> Iterator[Scored]:
    """Yield the rows of the table: errors are those of heights over the bed."""
    for log in logs():
        for tool, fit in TOOLS.items():
            if tool == "Klipper" and not find_spec("klippy"):
                continue
            whole, each, inside = fit(log), np.arange(len(log.height)), None
            if whole.half is not None and log.true is not None:
                off = np.abs(whole.values - log.true)
                inside = int((off <= whole.half).sum()), len(off)
            elif whole.half is not None:
                part = halves(each)
                inside = agreeing(*((made.values, made.half) for made in
                                    (fit(log.rows(part)), fit(log.rows(~part)))))  # fmt: skip

            def errors(left_out: IntArray) -> tuple[float, FloatArray]:
                with Clock() as clock:
                    made = fit(log.rows(~left_out))
                held = log.rows(left_out)
                return clock.seconds, made.height(held.travel) - held.height

            yield scored(log.name, tool, "mm", each, errors, inside, whole.says)
