"""The division of units into two groups, each with parameters of its own, that fits best.

Nobody says which units are of which group, so all divisions are possible: what is found is a local
best of several starts, and a test of it has to count the 2^(N−1) that there are.
"""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray

_STARTS = 6  # directions of the parameters in which units are divided at first
_TURNS = 30  # of finding parameters and groups in turn
_HELD = 1e-6  # weight of the common parameters, for those that a group does not determine


def best_division(design: FloatArray, residual: FloatArray, unit: IntArray) -> BoolArray:
    """Mark units (N,) of the smaller of two groups.

    Parameters
    ----------
    design, residual : ndarray (M, p), (M,)
        Of equal variance; the residuals of a fit with common parameters.
    unit : ndarray of int (M,)
        Of each equation, from 0: those of a unit are of one group.

    Examples
    --------
    >>> place = np.linspace(-1.0, 1.0, 12)
    >>> other = np.arange(12) % 3 == 0
    >>> residual = np.where(other, 2.0, -1.0) * place
    >>> best_division(place[:, None], residual, np.arange(12)).tolist() == other.tolist()
    True
    """
    count, p = int(unit.max()) + 1, design.shape[1]
    normal, along = np.zeros((count, p, p)), np.zeros((count, p))
    np.add.at(normal, unit, design[:, :, None] * design[:, None, :])
    np.add.at(along, unit, design * residual[:, None])
    whole, held = normal.sum(axis=0), _HELD * np.eye(p)
    ways = np.linalg.eigh(along.T @ along)[1][:, ::-1].T[:_STARTS]
    best, least = np.zeros(count, dtype=bool), np.inf
    for way in ways:
        mine = along @ way > 0.0
        for _ in range(_TURNS):
            of_mine = normal[mine].sum(axis=0)
            first = np.linalg.solve(of_mine + held, along[mine].sum(axis=0))
            second = np.linalg.solve(whole - of_mine + held, along[~mine].sum(axis=0))
            squares = np.stack([
                np.einsum("p,npq,q->n", b, normal, b) - 2.0 * (along @ b) for b in (first, second)
            ])  # fmt: skip
            before, mine = mine, squares[0] < squares[1]
            if np.array_equal(before, mine):
                break
        total = float(squares.min(axis=0).sum())
        if total < least:
            best, least = mine, total
    return best if 2 * best.sum() <= count else ~best
