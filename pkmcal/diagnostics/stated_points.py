"""Check whether points that several readings show are where they are stated: corners of a board.

A corner that a printer put elsewhere is off alike in all pictures. A fit takes that for noise, of
which more pictures leave less and less, and states the machine better than it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import identity
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.diagnostics.cause_columns import of_instruments_alone
from pkmcal.diagnostics.check import RARE, Check, Level, at_most_one
from pkmcal.diagnostics.columns import Change, of_rows
from pkmcal.display import chance_text
from pkmcal.fitted.fit import Fit
from pkmcal.fitted.machine_accuracy import times_stated
from pkmcal.fitted.solution import Solution
from pkmcal.readings.predicted import Predicted
from pkmcal.statistics.causes import taken_along
from pkmcal.statistics.linear_fit import LinearFit
from pkmcal.statistics.score_test import Beside, beside

_HARMFUL = 0.25  # times its ± by which such errors move a machine; smooth ones do so more
_SAME = 1e-3  # of the way of each actuator, within which two pictures are at one pose
_ALIKE = 2.3  # deviations: a chance of 1 in 100
_READINGS = 4  # of a point, from which its own error is told from noise
_MOST = 400  # points that are tested


@dataclass(frozen=True)
class StatedPoints:
    """Points that are not where they are stated.

    Attributes
    ----------
    noun : str
        What they are.
    count : int
        How many were tested.
    chance : float
        How likely they would seem as far off if all were where they are stated.
    off : float
        Estimated standard deviation of a coordinate, mm.
    shift : float
        How far the errors move the machine, over how well it is stated to be known.
    """

    noun: str
    count: int
    chance: float
    off: float
    shift: float


def stated_points(found: Solution) -> StatedPoints | None:
    """Test the points of all sets; None where none are stated, or too little is left to tell."""
    fit = found.fit
    if fit.uncertainty.rounded or not fit.uncertainty.known:
        return None
    which, noun, count = _points(fit)
    if not count:
        return None
    columns = found.weighed.columns(of_rows(fit, _moved(fit, which, count)))
    beside_lens = beside(_beside_instruments(found), columns)
    if beside_lens is None or beside_lens.chance >= RARE:
        return None
    if _alike_everywhere(fit, beside_lens) < _ALIKE:
        return None
    taken = beside(found.weighed.fit, columns)
    if taken is None:
        return None
    off, errors = _errors(taken)
    moved = fit.parameters.scale[:, None] * taken.fit.back @ taken.by_basis @ errors
    return StatedPoints(noun, count, beside_lens.chance, off, times_stated(fit, moved))


def _alike_everywhere(fit: Fit, taken: Beside) -> float:
    """How alike the errors are that different poses tell, in deviations of what is no error at all.

    Pictures at one pose may share errors of finding corners, which are those of no other pose.
    """
    blocks = fit.uncertainty.blocks
    at = blocks.table.actuators / np.maximum(np.ptp(blocks.table.actuators, axis=0), 1e-300)
    near = cKDTree(at).sparse_distance_matrix(cKDTree(at), _SAME, p=np.inf)
    places = connected_components(near + identity(len(at)), directed=False)[1]
    place = np.repeat(places[blocks.pose_of_block], blocks.components)
    told = np.zeros((int(places.max()) + 1, len(taken.along)))
    np.add.at(told, place, taken.own * taken.fit.residual[:, None])
    products = told @ told.T
    np.fill_diagonal(products, 0.0)
    scatter = np.sqrt(2.0 * np.square(products).sum())
    return float(products.sum() / scatter) if scatter > 0.0 else 0.0


def _beside_instruments(found: Solution) -> LinearFit:
    """The fit with numbers of the instruments, such as a lens, which move many points alike."""
    linear = found.weighed.fit
    for _, columns in of_instruments_alone(found):
        taken = beside(linear, found.weighed.columns(columns))
        linear = linear if taken is None else taken_along(taken)
    return linear


def _points(fit: Fit) -> tuple[dict[int, IntArray], str, int]:
    """Which point each row of a set shows, -1 where none that several do; what and how many."""
    which, noun, before = dict[int, IntArray](), "", 0
    for i, m in enumerate(fit.uncertainty.equations.table.sets):
        points = m.instrument.shown_points
        if points is None:
            continue
        places = np.broadcast_to(points.places, (len(m), 3))
        own, counts = np.unique(places, axis=0, return_inverse=True, return_counts=True)[1:]
        often = np.flatnonzero(counts >= _READINGS)[: _MOST - before]
        number = np.full(len(counts), -1)
        number[often] = before + np.arange(len(often))
        which[i], noun, before = number[own.reshape(-1)], points.noun, before + len(often)
    return which, noun, before


def _moved(fit: Fit, which: dict[int, IntArray], count: int) -> Change:
    """Changes of what is read where each point is elsewhere, along three axes."""
    prediction = fit.uncertainty.equations.prediction

    def change(i: int, rows: slice, seen: Predicted) -> FloatArray:
        readings, components = seen.values.shape
        found = np.zeros((readings, components, count, 3))
        points = prediction.table.sets[i].instrument.shown_points
        if i in which and points is not None:
            by = seen.by_frame if points.on_frame else seen.by.get(prediction.carried[i])
            at = np.flatnonzero(which[i][rows] >= 0)
            if by is not None:
                found[at, :, which[i][rows][at]] = by[at, :, :3]
        return found.reshape(readings, components, 3 * count)

    return change


def _errors(taken: Beside) -> tuple[float, FloatArray]:
    """Estimate the deviation of a coordinate, mm, and what all errors are (3 K, 1 + 3 K).

    The first column has what they are by the readings, if as large ones were likely for all; the
    others what is not known of them: their squares add up to what is expected.
    """
    fit, k = taken.fit, len(taken.along)
    noise = max(fit.squares - taken.drop, 0.0) / max(fit.freedom - k, 1.0)
    size, axes = np.linalg.eigh(taken.half @ taken.half.T)
    size, axes = size[-k:], axes[:, -k:]
    tells = taken.half.T @ (axes / size) @ axes.T  # (k, 3 K), what `along` has of each
    variance = max(taken.drop - k * noise, 0.0) / float((1.0 / size).sum())
    told = np.linalg.solve(
        variance * tells @ tells.T + noise * np.eye(k), variance * tells
    ).T  # (3 K, k)
    left = variance * (np.eye(len(told)) - told @ tells)
    values, ways = np.linalg.eigh(left)
    rest = ways * np.sqrt(np.maximum(values, 0.0))
    return float(np.sqrt(variance)), np.column_stack([told @ taken.along, rest])


def _level(found: Solution, seen: StatedPoints) -> Level:
    return "doubt" if seen.shift > _HARMFUL else "remark"


def _say(found: Solution, seen: StatedPoints) -> str:
    return (
        f"{seen.noun} are not where they are stated ({chance_text(seen.chance)}): each is some"
        f" {seen.off:.2g} mm off along an axis, alike in all readings, which puts the machine off"
        f" by {seen.shift:.2g} times its ± or more; measure where they are and state that, or take"
        " a better one, or another detector"
    )


CHECKS = (
    Check(
        name="stated-points", about="corners of a board are not where they are stated",
        levels=("doubt", "remark"), level_of=_level,
        unless=("grave",),
        run=lambda found: at_most_one(stated_points(found)), say=_say,
    ),
)  # fmt: skip
