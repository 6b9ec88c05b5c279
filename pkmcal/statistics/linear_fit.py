"""A least-squares fit at its solution: the linear model on which all statistics here rest.

The design is kept in a basis in which its normal matrix, that of the prior included, is the
identity: sums over rows then need no inverse, and numbers that the data hardly determine do not
spoil the others.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray, lots
from pkmcal.result import ReadOnly
from pkmcal.statistics.robust_scale import MET
from pkmcal.statistics.singular_values import svd

ROUNDING = 1e-9  # a singular value below this share of the largest is zero
_WHOLE = 9  # decimals from which degrees of freedom are whole: limits on them are
_IN_ONE_THREAD = 8192  # numbers
_COLUMNS_AT_ONCE = 32  # of a factorisation
_FEW_COLUMNS = 4  # of one with many columns
_KEYS = 4096  # of rows that are added up at once
_DENSE = 4  # times as many numbers as equations, below which those there are are ticked off


@dataclass(frozen=True, eq=False)
class LinearFit(ReadOnly):
    """M equations and p parameters, y = A b + e, with prior rows R b ~ N(0, 1).

    Attributes
    ----------
    design : ndarray (M, p)
        Whitened; AᵀA + RᵀR = 1.
    residual : ndarray (M,)
        Whitened; of a robust loss the pseudo-residuals.
    prior : ndarray (q, p)
        Rows of the prior, in units of its deviation.
    back : ndarray (n, p)
        The n parameters by the p of the basis: their contrasts.
    cluster : ndarray of int (M,)
        Which equations may share an error: those of one pose have one number, from 0.
    component : ndarray of int (M,)
        Which may share the same: x, y, z, …, by number.
    exact : float
        Degrees of freedom of equations that are met exactly: these show no noise of the others.
    """

    design: FloatArray
    residual: FloatArray
    prior: FloatArray
    back: FloatArray
    cluster: IntArray
    component: IntArray
    exact: float = 0.0

    def leverage(self) -> FloatArray:
        """Share of each equation that its own value decides, (M,); computed at each call."""
        shares: FloatArray = np.einsum("ij,ij->i", self.design, self.design)
        return shares

    @cached_property
    def freedom(self) -> float:
        """Equations less the parameters that went into them, and less those met exactly."""
        return round(float(len(self.residual) - self.leverage().sum()) - self.exact, _WHOLE)

    @property
    def squares(self) -> float:
        """Sum of squares of the residuals."""
        return float(self.residual @ self.residual)

    @property
    def clusters(self) -> int:
        """Number of clusters."""
        return int(self.cluster.max()) + 1

    def key(self) -> IntArray:
        """Number of cluster and component of each equation, (M,); computed at each call."""
        return numbered(self.cluster, self.component)

    def without_idle(self, use: IntArray) -> IntArray:
        """Equations `use` without those of a component that was read as exactly 0 and is met.

        Such are angles of a delta in files of its controller, and the height of a plane, which a
        frame that is found meets as well: no noise, and no degrees of freedom.
        """
        met = met_exactly(self.residual[use], self.component[use])
        still = self.residual[use] == 0.0
        still[still] = ~(self.design[use[still]] != 0.0).any(axis=1)  # few: no copy of the design
        kept: IntArray = use[~(met | still)]
        return kept


Solved = tuple[LinearFit, FloatArray]  # a fit, and residuals (q,) of its prior's rows


def met_exactly(residual: FloatArray, component: IntArray) -> BoolArray:
    """Mark equations (M,) of components (M,) whose residuals are nothing but rounding errors.

    Examples
    --------
    >>> met_exactly(np.array([0.3, 1e-17, -0.2, 0.0]), np.array([0, 1, 0, 1])).tolist()
    [False, True, False, True]
    """
    size = np.abs(residual)
    largest = size.max(initial=0.0)  # where all are 0, no component is unlike the others
    open_ones = np.bincount(component, size > MET * largest)
    met: BoolArray = (open_ones[component] == 0.0) & (largest > 0.0)
    return met


def reweighted(fit: LinearFit, deviations: FloatArray, prior_residual: FloatArray) -> Solved:
    """Solve a fit again with other deviations (M,) of its equations, in units of the present ones.

    `prior_residual` (q,) are the residuals of the prior's rows.
    """
    design, residual = fit.design / deviations[:, None], fit.residual / deviations
    back = unit_basis(design, fit.prior, np.eye(design.shape[1]))
    return solved_again(fit, design, residual, prior_residual, back)


def solved_again(
    fit: LinearFit,
    design: FloatArray,
    residual: FloatArray,
    prior_residual: FloatArray,
    back: FloatArray,
) -> Solved:
    """Solve a fit again, whose design (M, p) and residuals (M,) have other weights.

    `back` (p, p) are the combinations of its basis in which the normal matrix is the identity then.
    """
    design, prior = design @ back, fit.prior @ back
    step = design.T @ residual + prior.T @ prior_residual
    found = replace(
        fit, design=design, residual=residual - design @ step, prior=prior, back=fit.back @ back
    )
    return found, prior_residual - prior @ step


def allowing(
    fit: LinearFit, columns: FloatArray, deviation: float, prior_residual: FloatArray
) -> Solved:
    """Solve a fit again with further numbers, each of a prior with deviation 1 about 0.

    Parameters
    ----------
    fit : LinearFit
        The fit.
    columns : ndarray (M, k)
        Derivatives of the whitened predicted values by these numbers.
    deviation : float
        Of the noise, in units of what equations were whitened by.
    prior_residual : ndarray (q,)
        Residuals of the prior's rows.

    Returns
    -------
    LinearFit
        Of p + k numbers, and residuals of its q + k rows of a prior.

    Examples
    --------
    >>> rows = np.arange(6)
    >>> y, slope = np.array([0.0, 1, 2, 3, 4, 5]), np.arange(6.0)[:, None]
    >>> level = linear_fit(np.ones((6, 1)), y - y.mean(), np.zeros((0, 1)), np.eye(1), rows, rows)
    >>> found, known = allowing(level, slope, 0.01, np.zeros(0))
    >>> bool(np.abs(found.residual).max() < 1e-4), found.design.shape
    (True, (6, 2))
    """
    k = columns.shape[1]
    follow = fit.design.T @ columns
    matrix = columns.T @ columns - follow.T @ follow + deviation**2 * np.eye(k)
    half = np.linalg.inv(np.linalg.cholesky(matrix)).T
    own = columns - fit.design @ follow
    size = half @ (half.T @ (columns.T @ fit.residual))
    prior = np.block([
        [fit.prior, -fit.prior @ follow @ half],
        [np.zeros((k, fit.design.shape[1])), deviation * half],
    ])  # fmt: skip
    found = replace(
        fit,
        design=np.hstack([fit.design, own @ half]),
        residual=fit.residual - own @ size,
        prior=prior,
        back=np.hstack([fit.back, -fit.back @ follow @ half]),
    )
    return found, np.concatenate([prior_residual + fit.prior @ follow @ size, -deviation * size])


def linear_fit(
    jacobian: FloatArray,
    residual: FloatArray,
    prior: FloatArray,
    basis: FloatArray,
    cluster: IntArray,
    component: IntArray,
) -> LinearFit:
    """Bring a fit into its basis.

    Parameters
    ----------
    jacobian : ndarray (M, n)
        Derivative of the predicted values to the parameters, whitened.
    residual : ndarray (M,)
        Measured less predicted, whitened.
    prior : ndarray (q, n)
        A row for each parameter with a prior, in units of its deviation.
    basis : ndarray (n, p)
        Orthonormal combinations that jacobian and prior determine.
    cluster, component : ndarray of int (M,)
        See `LinearFit`.

    Examples
    --------
    >>> import numpy as np
    >>> x, y = np.arange(4.0), np.array([0.0, 1.1, 1.9, 3.0])
    >>> jacobian, none = np.column_stack([np.ones(4), x]), np.zeros((0, 2))
    >>> left = y - jacobian @ np.linalg.lstsq(jacobian, y, rcond=None)[0]
    >>> rows = np.arange(4)
    >>> fit = linear_fit(jacobian, left, none, np.eye(2), rows, 0 * rows)
    >>> round(fit.freedom, 9)
    2.0
    >>> bool(np.allclose(fit.back @ fit.back.T, np.linalg.inv(jacobian.T @ jacobian)))
    True
    """
    back = unit_basis(jacobian, prior, basis)
    return in_unit_basis(jacobian @ back, residual, prior, back, cluster, component)


def in_unit_basis(
    design: FloatArray,
    residual: FloatArray,
    prior: FloatArray,
    back: FloatArray,
    cluster: IntArray,
    component: IntArray,
) -> LinearFit:
    """`linear_fit` where its `unit_basis` is known, `back` (n, p), and the design in it."""
    return LinearFit(
        design=design,
        residual=residual,
        prior=prior @ back,
        back=back,
        cluster=_shared(numbered(cluster), cluster),
        component=component,
    )


def _shared(numbers: IntArray, known: IntArray) -> IntArray:
    """Return `known` where it has these numbers, so that they are in memory once."""
    return known if np.array_equal(numbers, known) else numbers


def unit_basis(jacobian: FloatArray, prior: FloatArray, basis: FloatArray) -> FloatArray:
    """Combinations (n, p) in which the normal matrix is the identity, the best determined first.

    Arguments are those of `linear_fit`.
    """
    whole = few_rows(jacobian, prior) @ basis
    _, singular, turned = svd(whole)
    back: FloatArray = basis @ (turned.T / singular)
    return back


def numbered(*keys: IntArray) -> IntArray:
    """Number each distinct combination of whole numbers from 0 on, (M,), from 0."""
    combined = keys[0]
    for key in keys[1:]:
        combined = combined * (int(key.max()) + 1) + key
    if len(combined) and int(combined.min()) >= 0 and int(combined.max()) < _DENSE * len(combined):
        there = np.zeros(int(combined.max()) + 1, dtype=bool)  # quicker than to sort them
        there[combined] = True
        return np.asarray((np.cumsum(there) - 1)[combined])
    return np.unique(combined, return_inverse=True)[1].reshape(-1)


def means(rows: FloatArray, key: IntArray) -> FloatArray:
    """Means of rows (M, k) that have the same key (M,), one of 0, 1 …, in its order."""
    return sums(rows, key) / np.bincount(key)[:, None]


def sums(rows: FloatArray, key: IntArray) -> FloatArray:
    """Sums of rows (M, ...) that have the same key (M,), in its order."""
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    in_order = rows[order]
    if len(first) == len(order):
        return in_order  # each key has one row
    total: FloatArray = np.add.reduceat(in_order, first, axis=0)
    return total


def grouped(key: IntArray) -> Iterator[IntArray]:
    """Rows in lots that have all rows of a key (M,), in its order.

    Examples
    --------
    >>> [rows.tolist() for rows in grouped(np.array([1, 0, 1]))]
    [[1, 0, 2]]
    """
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    for lot in lots(len(first), _KEYS):
        yield order[first[lot.start] : first[lot.stop] if lot.stop < len(first) else None]


def alike(key: IntArray, most: int) -> Iterator[IntArray]:
    """Rows (g, m) of keys that have m rows each, in lots of at most about `most` rows.

    Examples
    --------
    >>> [rows.tolist() for rows in alike(np.array([1, 0, 1, 2]), 10)]
    [[[1], [3]], [[0, 2]]]
    """
    order = np.argsort(key, kind="stable")
    sizes = np.bincount(key)
    first = np.cumsum(sizes) - sizes
    for size in np.unique(sizes[sizes > 0]).tolist():
        of_size = first[sizes == size, None] + np.arange(size)
        for lot in lots(len(of_size), max(most // size, 1)):
            yield order[of_size[lot]]


def column_basis(matrix: FloatArray, factor: FloatArray | None = None) -> FloatArray:
    """Orthonormal basis (M, r) of the columns; `factor` is the matrix's, where it is known."""
    turn = orthonormal(matrix) if factor is None else _orthonormal(factor)
    basis: FloatArray = matrix @ turn
    return basis


def orthonormal(matrix: FloatArray | Sequence[FloatArray]) -> FloatArray:
    """Return the factor (n, r) that makes columns (M, n) an orthonormal basis.

    The matrix may be several side by side.
    """
    return _orthonormal(triangle(matrix))


def _orthonormal(factor: FloatArray) -> FloatArray:
    """`orthonormal` of a matrix with this factor (k, n): the same AᵀA."""
    _, singular, rows = svd(factor)
    keep = singular > ROUNDING * singular.max(initial=0.0)  # none of no columns
    found: FloatArray = rows[keep].T / singular[keep]
    return found


def multiply_in_place(matrix: FloatArray, square: FloatArray) -> None:
    """Multiply a matrix (M, n) by a square one (n, n) from the right, without another matrix."""
    for first in range(0, len(matrix), _IN_ONE_THREAD):
        rows = slice(first, first + _IN_ONE_THREAD)
        matrix[rows] = matrix[rows] @ square


def few_rows(*stacked: FloatArray) -> FloatArray:
    """A matrix with the same AᵀA as all of these below each other, and at most 2 n rows.

    The factor of `triangle` unless they have no more as they are.
    """
    few = sum(map(len, stacked)) <= 2 * stacked[0].shape[1]
    return np.concatenate(stacked) if few else triangle(*stacked)


def triangle(*stacked: FloatArray | Sequence[FloatArray]) -> FloatArray:
    """Triangular factor R of a QR factorisation: RᵀR = AᵀA.

    A consists of matrices below each other, each one matrix or several side by side.

    Rows enter in blocks so small that the linear algebra library does not spread them over
    threads, which on a busy computer takes a hundred times as long as the work itself, and makes
    the last bits depend on how many there are. LAPACK is called directly: around small blocks
    NumPy takes five times as long. Where columns are so many that no block would be small, rows
    join a factor by few columns at a time.
    """
    from scipy.linalg.lapack import dgeqrf, dtpqrt

    matrices = ([each] if isinstance(each, np.ndarray) else each for each in stacked)
    below = [[p[:, None] if p.ndim == 1 else p for p in parts] for parts in matrices]
    n = sum(part.shape[1] for part in below[0])
    block = max(n, _IN_ONE_THREAD // max(n, 1) - n)
    wide = n * (n + block) > _IN_ONE_THREAD
    factor: FloatArray = np.zeros((0, n))
    for beside in below:
        for start in range(0, len(beside[0]), block):
            rows = [part[start : start + block] for part in beside]
            whole = rows[0] if len(rows) == 1 else np.concatenate(rows, axis=1)
            if wide and len(factor) == n:
                factor = dtpqrt(0, _FEW_COLUMNS, factor, whole)[0]
                continue
            whole = np.concatenate([factor, whole]) if len(factor) else whole
            factor = dgeqrf(whole, lwork=_COLUMNS_AT_ONCE * n or 1)[0][:n]
            factor[_below(*factor.shape)] = 0.0
    return factor


@cache
def _below(rows: int, columns: int) -> BoolArray:
    """The places below the diagonal."""
    return np.tri(rows, columns, -1, dtype=bool)
