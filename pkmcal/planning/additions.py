"""What candidates add to a choice.

Of a candidate's block B beside a choice whose information has the inverse C, all that counts is
G = B C Bᵀ and, where the criterion is tr E C, S = B C E C Bᵀ: the gain is tr (1 + G)⁻¹ S, or
ln det(1 + G) where it is the determinant of the information.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pkmcal.arrays import FloatArray, lots

_TOGETHER = 1536  # rows of blocks that are looked at at once, as many as caches hold
_Floats = NDArray[np.floating[Any]]  # in double or single precision


def gains(blocks: FloatArray, information: FloatArray, cost: FloatArray | None) -> FloatArray:
    """What the criterion improves by with each candidate (N,).

    Parameters
    ----------
    blocks : ndarray (N, k, n)
        Of the candidates.
    information : ndarray (n, n)
        Of the choice, positive definite.
    cost : ndarray (n, n) or None
        E, where a candidate takes tr E C down; None where it adds to ln det C⁻¹.

    Examples
    --------
    >>> gains(np.array([[[3.0, 0.0]]]), np.eye(2), np.eye(2)).round(12)
    array([0.9])
    """
    return _changes(blocks, information, cost, 1.0)


def losses(blocks: FloatArray, information: FloatArray, cost: FloatArray | None) -> FloatArray:
    """What the criterion loses without each of these members of the choice (N,)."""
    return _changes(blocks, information, cost, -1.0)


def _changes(
    blocks: FloatArray, information: FloatArray, cost: FloatArray | None, sign: float
) -> FloatArray:
    """Of each block by itself: ln det(1 ± G) or tr (1 ± G)⁻¹ S."""
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    spread = None if cost is None else covariance @ cost @ covariance
    found = np.empty(len(blocks))
    for some in in_tiles(blocks):
        few = blocks[some]
        across = few.transpose(0, 2, 1)
        own = (times(few, covariance) @ across).transpose(1, 2, 0).copy()
        if spread is None:
            found[some] = change(sign * own, None)
        else:
            of_cost = times(few, spread) @ across
            found[some] = change(sign * own, of_cost.transpose(1, 2, 0).copy())
    return sign * found if cost is None else found


def in_tiles(blocks: FloatArray) -> Iterator[slice]:
    """Slices of blocks (N, k, n) that are looked at at once."""
    return lots(len(blocks), -(-_TOGETHER // blocks.shape[1]))


def weighed_root(
    information: FloatArray, cost: FloatArray | None
) -> tuple[FloatArray, FloatArray | None]:
    """A root K of the inverse, K Kᵀ, in which the cost is diagonal: its sizes, or None."""
    root = np.linalg.inv(np.linalg.cholesky(information)).T
    if cost is None:
        return root, None
    sizes, axes = np.linalg.eigh(root.T @ cost @ root)
    return root @ axes, sizes


def shares(through: _Floats, sizes: _Floats | None) -> tuple[_Floats, _Floats | None]:
    """G and S (k, k, m) of blocks times the root (n, k, m); no S without a cost."""
    spread = None if sizes is None else _squares(through, sizes[:, None, None] * through)
    return _squares(through, through), spread


def _squares(left: _Floats, right: _Floats) -> _Floats:
    """Symmetric products (k, k, m) of rows (n, k, m): sums over the first axis."""
    k = left.shape[1]
    found = np.empty((k, k, left.shape[2]), left.dtype)
    for a, b in itertools.combinations_with_replacement(range(k), 2):
        found[a, b] = found[b, a] = np.einsum("im,im->m", left[:, a], right[:, b])
    return found


def change(own: _Floats, spread: _Floats | None) -> _Floats:
    """Return tr (1 + G)⁻¹ S of each pair of symmetric matrices (k, k, m), or ln det(1 + G).

    By elimination in all pairs at once: LAPACK, called once a pair, takes several times as long.
    """
    matrices = own + np.eye(len(own), dtype=own.dtype)[:, :, None]
    found = np.zeros(own.shape[2], own.dtype)
    while len(matrices):
        pivot, across = matrices[0, 0], matrices[0, 1:]
        down = across / pivot
        matrices = matrices[1:, 1:] - down[:, None] * across
        if spread is None:
            found += np.log(pivot)
            continue
        found += spread[0, 0] / pivot
        mixed = down[:, None] * (spread[0, 1:] - np.float32(0.5) * spread[0, 0] * down)
        spread = spread[1:, 1:] - mixed - mixed.transpose(1, 0, 2)
    return found


def times(blocks: FloatArray, matrix: FloatArray) -> FloatArray:
    """Blocks (..., n) times a matrix (n, m), in one product, which takes less time than many."""
    product: FloatArray = blocks.reshape(-1, len(matrix)) @ matrix
    return product.reshape(*blocks.shape[:-1], -1)
