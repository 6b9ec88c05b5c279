"""Turns of cranks whose drives have laws: which of them has a reading, and suits all its limbs.

As `agreed_turn` of ``csrc/inverse.h`` has it for gains.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal.arrays import FloatArray, wrapped
from pkmcal.core.laws import Laws

MOST_TURNS = 8  # either way
AGREE = 1e-7  # rad of the first drive: rounding of a pose that the machine takes
PER_TURN = 1e-2  # rad that drives have to agree better for each turn that is farther


def agreed_turns(
    laws: Laws,
    slots: FloatArray,
    driven: Sequence[Sequence[int]],
    way: FloatArray,
    about: FloatArray,
    approach: FloatArray | None,
) -> FloatArray:
    """Ways (N, drives) with whole turns added to that of the first drive of each actuator.

    Of the turns at which there is a reading and the other drives stand as well, the nearest.

    Parameters
    ----------
    laws : Laws
        Of the drives.
    slots : ndarray
        Geometry.
    driven : sequence of sequence of int
        The drives of each actuator; none where its way is to stay.
    way : ndarray (N, drives)
        Where they are.
    about : ndarray (1 or N, drives)
        Near which they are to be.
    approach : ndarray (drives,) or (N, drives), or None
        As for `Laws.ways`.
    """
    out: FloatArray = way.copy()
    for a, drives in enumerate(driven):
        if not drives:
            continue
        d = drives[0]
        nearest = way[:, d] + 2 * np.pi * np.rint((about[:, d] - way[:, d]) / (2 * np.pi))
        out[:, d] = nearest
        rows, least = np.flatnonzero(np.isfinite(nearest)), np.full(len(way), np.inf)
        for k in sorted(range(-MOST_TURNS, MOST_TURNS + 1), key=abs):
            at = nearest[rows] + 2 * np.pi * k
            come = approach if approach is None or approach.ndim == 1 else approach[rows]
            q = np.zeros((len(rows), len(driven)))
            q[:, a] = laws.reading(slots, at, d, come)
            apart = np.where(np.isnan(q[:, a]), np.nan, 0.0)
            if drives[1:]:
                there = laws.ways(slots, q, come)
                for j in drives[1:]:
                    off = way[rows, j] - there.way[:, j]
                    off = wrapped(off) if laws.drives[j].angle else off
                    as_first = np.abs(off * there.slope[:, d] / there.slope[:, j])
                    apart = np.maximum(apart, as_first)
            cost = np.where(np.isnan(apart), np.inf, apart + PER_TURN * (1 + abs(k)))
            cost[apart <= AGREE] = 0.0
            better = cost < least[rows]
            out[rows[better], d], least[rows[better]] = at[better], cost[better]
            rows = rows[cost > 0.0]
            if not rows.size:
                break
    return out
