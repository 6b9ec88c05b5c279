"""Rows of the same pose."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal.arrays import FloatArray, Int64Array, IntArray


def pose_index(
    actuators: FloatArray, driven: Sequence[FloatArray | None], group: Int64Array | None
) -> Int64Array:
    """The pose of each row (N,), from 0: rows of one group are one, and rows at equal actuators.

    `driven` are approach and tension (N, n), where known: drives are elsewhere where these differ.

    Readings of actuators may differ by their last digit where a group says that they are repeats,
    and home that is measured again has the name of another point.

    Examples
    --------
    >>> home, other, near = [1.0], [2.0], [2.001]
    >>> pose_index(np.array([home, other, home, near]), (), np.array([1, 2, 3, 2])).tolist()
    [0, 1, 0, 1]
    """
    parts = [actuators, *(each for each in driven if each is not None)]
    places = parts[0] if len(parts) == 1 else np.hstack(parts)
    pose = np.unique(places, axis=0, return_inverse=True)[1].reshape(-1)
    if group is not None:
        pose = joined(np.unique(group, return_inverse=True)[1].reshape(-1), pose)
    return pose.astype(np.int64)


def joined(one: IntArray, other: IntArray) -> IntArray:
    """Rows that either of two numberings puts together, in the order of the first.

    Examples
    --------
    >>> joined(np.array([0, 1, 1, 2, 3]), np.array([0, 0, 1, 2, 2])).tolist()
    [0, 0, 0, 1, 1]
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    size = int(one.max()) + 1
    nodes = size + int(other.max()) + 1
    # of 32 bits: before SciPy 1.12 graphs of longer ones had no links, and said so on stderr alone
    ends = one.astype(np.int32), (size + other).astype(np.int32)
    links = coo_array((np.ones(len(one)), ends), (nodes, nodes))
    found = connected_components(links, directed=False)[1][:size]
    return np.unique(found, return_inverse=True)[1].reshape(-1)[one]
