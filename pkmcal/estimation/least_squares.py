"""Least squares through scipy."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pkmcal.arrays import FloatArray

FTOL = 1e-10  # of the cost: 1e-4 of a standard deviation; rounding moves it by less
_TOLERANCES = {"ftol": FTOL, "xtol": 1e-10, "gtol": 1e-15}
MOST = 200  # evaluations
_CONVERGED = (1, 2, 3, 4)  # as MINPACK says it

Function = Callable[[FloatArray], FloatArray]
Bounds = tuple[FloatArray, FloatArray]  # lower and upper ones, (n,) each


def minimised(
    residual: Function, jacobian: Function, u: FloatArray, bounds: Bounds | None
) -> tuple[FloatArray, float, bool]:
    """Minimise half the sum of squares of `residual` (M,) by `u` (n,), from there on.

    Returns
    -------
    u : ndarray (n,)
        Where it is least.
    cost : float
        What it is there.
    converged : bool
        Whether the steps ended.
    """
    from scipy.optimize import least_squares, leastsq

    if bounds is None:
        # `least_squares` calls the same code, and takes longer than it: copies and checks
        twice = [jacobian(u)] * 2  # which `leastsq` asks for as often

        def once(at: FloatArray) -> FloatArray:
            return twice.pop() if twice and same_bits(at, u) else jacobian(at)

        found, _, said, _, end = leastsq(
            residual,
            u,
            Dfun=once,
            full_output=True,
            **_TOLERANCES,
            maxfev=MOST,
            diag=np.ones(len(u)),
        )
        return found, 0.5 * float(said["fvec"] @ said["fvec"]), end in _CONVERGED
    trf = least_squares(
        residual,
        u,
        jacobian,
        bounds=bounds,
        method="trf",
        x_scale=1.0,
        **_TOLERANCES,
        max_nfev=MOST,
    )
    return trf.x, float(trf.cost), bool(trf.status > 0)


def same_bits(one: FloatArray, other: FloatArray) -> bool:
    """Return whether two arrays hold the same numbers, to the last bit."""
    return one is other or one.tobytes() == other.tobytes()
