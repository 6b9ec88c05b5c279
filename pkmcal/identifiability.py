"""Which combinations of the parameters measurements can tell, and how well.

Everything here is in scaled parameters: 1 means about 1 mm at the machine.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

ROUNDING = 1e-9  # a singular value below this share of the largest is zero
CLEAR = 0.01  # share of the machine's size to which a combination must be told to count after all


@dataclass(frozen=True, eq=False)
class Directions:
    """Combinations of the parameters, split by what the measurements tell.

    Attributes
    ----------
    told, untold : ndarray (n, r), (n, n - r)
        Orthonormal columns.
    singular : ndarray (n,)
        Singular values of the scaled, whitened Jacobian, largest first.
    """

    told: FloatArray
    untold: FloatArray
    singular: FloatArray

    @property
    def rank(self) -> int:
        """How many combinations are told."""
        return int(self.told.shape[1])

    @property
    def gap(self) -> float:
        """Singular value of the last combination told over that of the first untold."""
        if self.rank in (0, len(self.singular)):
            return float("inf")
        last, next_one = self.singular[self.rank - 1], self.singular[self.rank]
        return float(last / next_one) if next_one > 0 else float("inf")


Decomposed = tuple[FloatArray, FloatArray]  # singular values (n,), directions (n, n)


def decompose(jacobian: FloatArray) -> Decomposed:
    """Singular values (n,), zeros where there are fewer rows, and all directions (n, n)."""
    n = jacobian.shape[1]
    if len(jacobian) > 2 * n:  # the triangular factor has the same
        jacobian = np.asarray(np.linalg.qr(jacobian, mode="r"))
    _, singular, rows = np.linalg.svd(jacobian, full_matrices=len(jacobian) < n)
    return np.concatenate([singular, np.zeros(n - len(singular))]), rows.T


def directions(
    before: Decomposed,
    after: Decomposed | None,
    size: float,
) -> Directions:
    """Split the combinations by the Jacobians before and after the fit (from `decompose`).

    A combination is told if its singular value is not zero and its standard deviation, one over
    the singular value, is below `size`. The Jacobian before the fit, with the machine as drawn,
    decides: there the gap is clean. Its errors blur the gap, so the one after the fit overrules
    it only where it shows as many combinations to `CLEAR` of the size, or fewer to `size`.

    Parameters
    ----------
    before, after : tuple
        `decompose` of the scaled, whitened Jacobians.
    size : float
        Of the machine, mm; inf where the noise is not known yet.
    """
    rank, deciding = _able(before[0], size), before
    if after is not None:
        clear = min(_able(after[0], CLEAR * size), len(after[0]))
        able = _able(after[0], size)
        if clear > rank or able < rank:
            rank, deciding = (clear if clear > rank else able), after
    singular, basis = deciding
    return Directions(basis[:, :rank], basis[:, rank:], singular)


def _able(singular: FloatArray, size: float) -> int:
    floor = max(ROUNDING * float(singular[0]), 1.0 / size)
    return int(np.count_nonzero(singular > floor))


def observability(jacobian: FloatArray, poses: int, rank: int) -> dict[str, float]:
    """Observability indices O1 … O5 of a scaled Jacobian, over the combinations that are told.

    Parameters
    ----------
    jacobian : ndarray (M, n)
        In mm of the measured quantity per mm of the parameters, not whitened.
    poses : int
        Number of measured poses.
    rank : int
        How many combinations are told.

    Notes
    -----
    With singular values σ1 ≥ … ≥ σr and m poses: O1 = (σ1…σr)^(1/r)/√m, O2 = σr/σ1, O3 = σr,
    O4 = σr²/σ1, O5 = 1/Σ(1/σ) (Y. Sun and J. M. Hollerbach, Observability index selection for robot
    calibration, ICRA 2008).
    """
    singular = np.linalg.svd(jacobian, compute_uv=False)[:rank]
    if rank == 0 or singular[-1] <= 0:
        return dict.fromkeys(("O1", "O2", "O3", "O4", "O5"), 0.0)
    largest, least = float(singular[0]), float(singular[-1])
    return {
        "O1": float(np.exp(np.log(singular).mean()) / np.sqrt(poses)),
        "O2": least / largest,
        "O3": least,
        "O4": least**2 / largest,
        "O5": float(1.0 / np.sum(1.0 / singular)),
    }


def sparse_basis(untold: FloatArray) -> FloatArray:
    """The same combinations, each of few parameters: (n, d), the largest entry of each 1."""
    basis = untold.copy()
    d = basis.shape[1]
    pivots: list[int] = []
    for k in range(d):
        rest = basis[:, k:]
        sizes = np.abs(rest).max(axis=1)
        sizes[pivots] = 0.0
        row = int(np.argmax(sizes > sizes.max() * (1 - 1e-9)))
        column = k + int(np.argmax(np.abs(rest[row])))
        basis[:, [k, column]] = basis[:, [column, k]]
        basis[:, k] /= basis[row, k]
        others = [j for j in range(d) if j != k]
        basis[:, others] -= np.outer(basis[:, k], basis[row, others])
        pivots.append(row)
    largest = basis[np.abs(basis).argmax(axis=0), np.arange(d)]
    scaled: FloatArray = basis / largest
    return scaled


def in_words(combination: FloatArray, names: Sequence[str]) -> str:
    """One combination that cannot be told, such as "base1.z, base2.z together".

    Parameters
    ----------
    combination : ndarray (n,)
        Its largest entry is 1.
    names : sequence of str
        Of the parameters.
    """
    groups: dict[float, list[str]] = {}
    for value, name in zip(combination, names, strict=True):
        if abs(value) > 0.01:
            groups.setdefault(float(f"{value:.2g}"), []).append(name)
    if len(groups) == 1:
        (only,) = groups.values()
        return f"{listed(only)} together" if len(only) > 1 else f"{only[0]} by itself"
    ordered = sorted(groups.items(), key=lambda item: -abs(item[0]))
    texts = [f"{value:+g} ({listed(members)})" for value, members in ordered[:6]]
    left_out = sum(len(members) for _, members in ordered[6:])
    return " ".join(texts) + (f" and {left_out} more" if left_out else "")


def listed(names: Sequence[str]) -> str:
    """Names in a row; three and more that only count on, as "base1.x … base4.x"."""
    texts: list[str] = []
    run: list[str] = []
    for name in [*names, ""]:
        if run and _follows(run[-1], name):
            run.append(name)
            continue
        texts += [f"{run[0]} … {run[-1]}"] if len(run) > 2 else run
        run = [name]
    return ", ".join(texts)


def _follows(name: str, next_name: str) -> bool:
    number = re.search(r"\d+", name)
    if number is None:
        return False
    counted = name[: number.start()] + str(int(number.group()) + 1) + name[number.end() :]
    return counted == next_name
