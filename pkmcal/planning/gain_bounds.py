"""Bounds of what candidates add to a choice, in single precision: a gain itself takes longer."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal.arrays import FloatArray
from pkmcal.planning.additions import change, in_tiles, shares, weighed_root

_EPSILON = float(np.finfo(np.float32).eps)
_COARSE = 0.5  # share that rounding may change, from which on nothing is known
_ROUNDED = 1e-6  # share that rounding in double precision may change


@dataclass(frozen=True, eq=False)
class Bounds:
    """Between what each candidate (N,) adds to a choice."""

    least: FloatArray
    most: FloatArray


class Screen:
    """Candidates in single precision.

    Parameters
    ----------
    blocks : ndarray (N, k, n)
        What each tells.
    """

    def __init__(self, blocks: FloatArray) -> None:
        self._shape = blocks.shape[1:]
        self._tiles = [
            blocks[some].transpose(2, 1, 0).astype(np.float32, order="C")
            for some in in_tiles(blocks)
        ]
        # a sum of n products, each of two rounded numbers, is rounded by less than its share
        lengths = np.sqrt(np.einsum("nij,nij->n", blocks, blocks))
        self._rounding = 2.0 * blocks.shape[2] * _EPSILON * lengths

    def bounds(self, information: FloatArray, cost: FloatArray | None) -> Bounds:
        """Bounds of `gains`.

        With the rows T = B K of a block, K the root of C in which the cost is diag τ, the gain is
        tr τ (1 − (1 + TᵀT)⁻¹), which d T changes by at most |τ| |d T|, for
        |T (1 + TᵀT)⁻¹| ≤ ½; ln det(1 + T Tᵀ) by √k |d T|. Of the sums and the elimination behind,
        the relative error grows with 1 + tr G: by so much an inverse of 1 + G, scaled to a
        diagonal of ones, is larger than 1.
        """
        root, sizes = weighed_root(information, cost)
        k, n = self._shape
        coarse = None if sizes is None else sizes.astype(np.float32)
        of_tiles = [shares(each, coarse) for each in self._products(root)]
        found = np.concatenate([change(*each) for each in of_tiles]).astype(np.float64)
        traces = np.concatenate([np.einsum("aam->m", own) for own, _ in of_tiles])
        inexact = 2.0 * (n + k) * k * _EPSILON * (1.0 + traces.astype(np.float64))
        steep = np.sqrt(k) if sizes is None else float(np.linalg.norm(sizes))
        moved = steep * float(np.linalg.norm(root)) * self._rounding
        moved += inexact if sizes is None else 2.0 * inexact * found
        known = inexact < _COARSE
        return Bounds(
            np.where(known, np.maximum(found - moved, 0.0), 0.0),
            np.where(known, found + moved, np.inf),
        )

    def most_without(
        self,
        most: FloatArray,
        member: FloatArray,
        information: FloatArray,
        cost: FloatArray | None,
    ) -> FloatArray:
        """Upper bounds of `gains` (N,) beside a choice without a member.

        Without it C is larger by a matrix W Wᵀ with Wᵀ E W = diag η, and B C by Z Wᵀ, Z = B W. Of
        the gain, the square of a norm, the root grows at most by that of
        tr (1 + Z Zᵀ)⁻¹ Z η Zᵀ ≤ Σ η s/(1 + s), s being squares of the columns of Z; the logarithm
        of the determinant by at most Σ ln(1 + s).

        Parameters
        ----------
        most : ndarray (N,)
            Of the gains beside the choice.
        member : ndarray (k, n)
            Its block.
        information : ndarray (n, n)
            Without it.
        cost : ndarray (n, n) or None
            As `gains` takes it.
        """
        through = np.linalg.solve(information, member.T)
        own = np.linalg.cholesky(np.eye(len(member)) + member @ through)
        added = np.linalg.solve(own, through.T).T
        worth = np.ones(len(member))
        if cost is not None:
            worth, axes = np.linalg.eigh(added.T @ cost @ added)
            added, worth = added @ axes, np.maximum(worth, 0.0)
        each, found = worth.astype(np.float32), []
        for along in self._products(added):
            squares = np.einsum("ckm,ckm->cm", along, along)
            if cost is None:
                found.append(np.log1p(squares).sum(axis=0))
            else:
                found.append(each @ (squares / (1.0 + squares)))
        grown = np.concatenate(found).astype(np.float64)
        rounding = self._rounding * np.sqrt((worth * (added**2).sum(axis=0)).sum())
        if cost is None:  # d ln(1 + s) is less than d √s, of which there are k
            return np.asarray((most + grown + np.sqrt(len(member)) * rounding) * (1.0 + _ROUNDED))
        grown = (1.0 + len(added) * _EPSILON) * np.sqrt(grown)
        return np.asarray((np.sqrt(most) + grown + rounding) ** 2 * (1.0 + _ROUNDED))

    def _products(self, matrix: FloatArray) -> Iterator[NDArray[np.float32]]:
        """Blocks, transposed, times a matrix (n, c): (c, k, m) of each tile."""
        coarse = matrix.T.astype(np.float32)
        for tile in self._tiles:
            yield (coarse @ tile.reshape(len(tile), -1)).reshape(-1, *tile.shape[1:])
