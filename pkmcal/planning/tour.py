"""A short tour through the poses of a plan: the order in which they are measured.

Between two poses the actuator that has farthest to go takes the time. SciPy has no travelling
salesman; the nearest pose first, then reversals of parts of the way while they shorten it (2-opt),
is within some per cent of the best tour of so few places.
"""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import TIED_CLOSELY, FloatArray, IntArray


def short_tour(places: FloatArray, start: FloatArray) -> tuple[IntArray, float]:
    """Order places so that the way through them is short.

    Parameters
    ----------
    places : ndarray (N, n)
        Actuator coordinates, in one unit.
    start : ndarray (n,)
        Where the way begins.

    Returns
    -------
    order : ndarray of int (N,)
        The places in the order of the tour.
    length : float
        The largest travel of an actuator between neighbours, summed.

    Examples
    --------
    >>> short_tour(np.array([[3.0], [1.0], [2.0]]), np.array([0.0]))
    (array([1, 2, 0]), 3.0)
    """
    points = np.vstack([start, places])
    way = np.abs(points[:, None] - points[None]).max(axis=2)
    order, left = [0], list(range(1, len(points)))
    while left:
        order.append(min(left, key=lambda i: (round(float(way[order[-1], i]), 9), i)))
        left.remove(order[-1])
    tour = np.array(order)
    least = TIED_CLOSELY * float(way.max(initial=0.0))
    shorter = True
    while shorter:
        shorter = False
        for i in range(1, len(tour) - 1):
            # of the part from i to k reversed: k may be the last
            k = np.arange(i + 1, len(tour))
            after = np.append(tour[i + 2 :], -1)
            now = way[tour[i - 1], tour[i]] + np.where(after < 0, 0.0, way[tour[k], after])
            new = way[tour[i - 1], tour[k]] + np.where(after < 0, 0.0, way[tour[i], after])
            best = int(np.argmax(np.round((now - new) / max(least, 1e-300))))
            if (now - new)[best] > least:
                tour[i : k[best] + 1] = tour[i : k[best] + 1][::-1].copy()
                shorter = True
    length = float(way[tour[:-1], tour[1:]].sum())
    return tour[1:] - 1, length


def tour_length(way: FloatArray) -> float:
    """The largest travel of an actuator between neighbours of a way (N, n), summed."""
    return float(np.abs(np.diff(way, axis=0)).max(axis=1).sum())
