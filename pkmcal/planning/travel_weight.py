"""Exchanges of a plan's poses that weigh their information against the travel to them.

What is made least is ln σ + w ln T, of the standard deviation σ that the criterion is about and the
length T of the tour: with weight w a tour that is 1 % shorter is worth a σ that is w % larger.
"""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import TIED, FloatArray, IntArray, first_largest
from pkmcal.planning.optimal_design import Design
from pkmcal.planning.tour import short_tour, tour_length

# Exchanges end in a local optimum. So the best of several is taken: with the weight at once, and
# with smaller or larger ones before.
_WAYS = (np.array([1.0]), np.array([4.0, 2.0, 1.0]))
_NEAR = 1e-9  # share of the tour by which places to insert a pose are alike


def with_travel(
    design: Design,
    chosen: IntArray,
    places: FloatArray,
    start: FloatArray,
    weight: float,
    most: float = np.inf,
) -> tuple[IntArray, float]:
    """Exchange candidates while that lowers ln σ + weight ln T.

    Parameters
    ----------
    design : Design
        The candidates.
    chosen : ndarray of int (k,)
        Where the exchanges begin.
    places : ndarray (N, n)
        Actuator coordinates of each candidate, in one unit.
    start : ndarray (n,)
        Where the tour begins.
    weight : float
        What a shorter tour is worth.
    most : float
        Predicted error (mm) that is not exceeded, by the criterion of that name.

    Returns
    -------
    path : ndarray of int (k,)
        In the order of the tour.
    length : float
        Of the tour.
    """
    found = [_descended(design, chosen, places, start, weight * way, most) for way in _WAYS]
    costs = np.array([cost for _, cost in found])
    path = found[first_largest(-costs, TIED)][0]
    return path, tour_length(np.vstack([start, places[path]]))


def _descended(
    design: Design,
    path: IntArray,
    places: FloatArray,
    start: FloatArray,
    weights: FloatArray,
    most: float,
) -> tuple[IntArray, float]:
    """Exchanges with one weight after another until none is left; what the sum is then."""
    cost = np.inf
    for weight in weights:
        cost = np.inf
        while True:
            order, length = short_tour(places[path], start)
            if length < (1.0 - _NEAR) * tour_length(np.vstack([start, places[path]])):
                path = path[order]
            path, least = _swept(design, path, places, start, weight, most)
            if not least < cost - TIED:
                break
            cost = least
    return path, cost


def _swept(
    design: Design,
    path: IntArray,
    places: FloatArray,
    start: FloatArray,
    weight: float,
    most: float,
) -> tuple[IntArray, float]:
    """Replace each member once by the best of all; return the sum."""
    cost = np.inf
    for member in path.tolist():
        k = int(np.flatnonzero(path == member)[0])
        rest = np.delete(path, k)
        length, entry = _insertions(places, np.vstack([start, places[rest]]))
        tour = tour_length(np.vstack([start, places[path]]))
        deviations = design.exchanged_for(path, member)
        now = deviations[member] + weight * float(np.log(max(tour, np.finfo(float).tiny)))
        deviations[np.exp(deviations) > most] = np.inf
        sums = deviations + weight * np.log(np.maximum(length, np.finfo(float).tiny))
        best = first_largest(-sums, TIED)
        new = np.insert(rest, entry[best], best)
        cost = now
        if sums[best] < now - TIED and design.predicted(new) <= most:
            path, cost = new, float(sums[best])
    return path, cost


def _insertions(places: FloatArray, way: FloatArray) -> tuple[FloatArray, IntArray]:
    """Length of the tour through `way` and each place (N,), and behind how many it comes."""
    legs = np.abs(np.diff(way, axis=0)).max(axis=1)
    total = float(legs.sum())
    length, entry = np.full(len(places), np.inf), np.zeros(len(places), dtype=np.intp)
    before = np.abs(places - way[0]).max(axis=1)
    for k in range(len(way)):
        more = before
        if k < len(legs):
            after = np.abs(places - way[k + 1]).max(axis=1)
            more, before = before + after - legs[k], after
        shorter = total + more < (1.0 - _NEAR) * length
        length[shorter], entry[shorter] = (total + more)[shorter], k
    return length, entry
