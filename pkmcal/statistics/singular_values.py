"""The singular value decomposition, also where LAPACK's fast method gives up."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray


def svd(matrix: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Left vectors (M, k), singular values (k,) and right vectors (k, n) of a matrix (M, n).

    LAPACK divides and conquers (gesdd), which does not converge for some matrices whose columns
    are orthonormal up to rounding, as designs here are; its QR iteration (gesvd) does.

    Raises
    ------
    numpy.linalg.LinAlgError
        The matrix is not finite.

    Examples
    --------
    >>> svd(np.array([[3.0, 0.0], [0.0, 4.0], [0.0, 0.0]]))[1]
    array([4., 3.])
    """
    try:
        left, singular, rows = np.linalg.svd(matrix, full_matrices=False)
    except np.linalg.LinAlgError:
        if not np.isfinite(matrix).all():
            raise
        from scipy.linalg import svd as by_iteration

        left, singular, rows = by_iteration(matrix, full_matrices=False, lapack_driver="gesvd")
    return left, singular, rows
