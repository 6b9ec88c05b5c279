"""A Maslow's four belts, no pose measured: pkmcal, and SciPy over all places at once.

Left out are places; with anchors of the others, a place is what the four belts agree on best, and
what they disagree by is the error.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from scipy.optimize import least_squares

import pkmcal as pk
from benchmarks.field.case import DATA, ROOT, Clock, Scored, Stated, agreeing, scored
from pkmcal.arrays import FloatArray, IntArray

RUNS = [DATA / "maslow" / f"run{k}.csv" for k in (1, 2)]
REPEATS = 4
ANCHORS = np.array([0.0, 2000.0, 3000.0, 2000.0, 3000.0])  # tl.x tl.y tr.x tr.y br.x, roughly


def frame(numbers: FloatArray) -> FloatArray:
    """Return the anchors tl, tr, bl, br (4, 2)."""
    a, b, c, d, e = numbers
    return np.array([[a, b], [c, d], [0.0, 0.0], [e, 0.0]])


def places_off(numbers: FloatArray, lengths: FloatArray) -> FloatArray:
    """Return by how much the belts of each row disagree where they do so least, (N, 4) mm."""
    anchors, off = frame(numbers), []
    for row in lengths:
        best = least_squares(
            lambda p, row=row: np.linalg.norm(p - anchors, axis=1) - row, [1500.0, 1000.0]
        )
        off.append(best.fun)
    return np.array(off)


def by_scipy(lengths: FloatArray) -> Stated:
    """Fit 5 numbers of the anchors and 2 of each row, derivatives by differences."""

    def off(unknowns: FloatArray) -> FloatArray:
        places = unknowns[5:].reshape(-1, 1, 2)
        return (np.linalg.norm(places - frame(unknowns[:5]), axis=2) - lengths).ravel()

    start = np.concatenate([ANCHORS, np.tile([1500.0, 1000.0], len(lengths))])
    best = least_squares(off, start, x_scale="jac")
    dof = lengths.size - len(start)
    deviation = np.sqrt(np.diag(np.linalg.inv(best.jac.T @ best.jac))[:5] * 2 * best.cost / dof)
    return best.x[:5], 1.96 * deviation


def by_pkmcal(lengths: FloatArray) -> tuple[FloatArray, FloatArray, str]:
    robot = pk.load(ROOT / "benchmarks" / "field" / "belts.toml")
    found = pk.identify(robot, pk.Measurements(lengths, None, "closure"))
    half = (found.interval95[:, 1] - found.interval95[:, 0]) / 2
    return found.values, half, found.verdict.state


def rows() -> Iterator[Scored]:
    """Yield the rows of the table."""
    if not all(run.exists() for run in RUNS):
        return
    first, second = (np.loadtxt(run, delimiter=",", skiprows=1) for run in RUNS)
    place = np.arange(len(first)) // REPEATS
    tools: dict[str, Callable[[FloatArray], tuple[FloatArray, FloatArray, str]]] = {
        "pkmcal": by_pkmcal,
        "SciPy by hand": lambda lengths: (*by_scipy(lengths), ""),
    }
    for tool, fit in tools.items():

        def errors(left_out: IntArray) -> tuple[float, FloatArray]:
            with Clock() as clock:
                numbers, *_ = fit(first[~left_out])
            return clock.seconds, places_off(numbers, first[left_out]).ravel()

        whole, other = fit(first), fit(second)
        name = "Maslow, belts alone, 100 rows"
        yield scored(name, tool, "mm", place, errors, agreeing(whole[:2], other[:2]), whole[2])
