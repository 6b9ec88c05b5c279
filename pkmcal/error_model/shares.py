"""Standard deviations of joints that use up an allowed variance, by linear propagation.

SciPy's SLSQP finds those of least cost; around it stands own code that hands over only those limits
that some trial broke, since there is one for each pose.
"""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray

_SLACK = 1e-6  # of a limit, by which shares may overdraw it before they are scaled to it


def equal(use: FloatArray) -> FloatArray:
    """Share the budget equally where each joint matters most; then widen all as far as they may.

    `use` (N, g) is what 1 mm² or rad² of each joint adds to each limited variance, of 1 allowed.
    """
    sigma = 1 / np.sqrt(use.max(axis=0))
    return np.asarray(sigma / np.sqrt((use @ sigma**2).max()))


def cheapest(use: FloatArray, cost: FloatArray) -> FloatArray:
    """Least sum of cost/sigma with use @ sigma² ≤ 1 in every row.

    Convex in log sigma. Only rows that some trial broke are taken as conditions.
    """
    from scipy.optimize import NonlinearConstraint, minimize

    logs = np.log(equal(use))
    cost = cost / (cost * np.exp(-logs)).sum()
    rows: list[int] = []

    def price(s: FloatArray) -> float:
        return float((cost * np.exp(-s)).sum())

    def price_by_logs(s: FloatArray) -> FloatArray:
        return -cost * np.exp(-s)

    def spent(s: FloatArray) -> FloatArray:
        return np.asarray(np.log(use[rows] @ np.exp(2 * s)))

    def spent_by_logs(s: FloatArray) -> FloatArray:
        each = use[rows] * np.exp(2 * s)
        return np.asarray(2 * each / each.sum(axis=1, keepdims=True))

    for _ in range(len(use)):
        total = use @ np.exp(2 * logs)
        if rows and total.max() <= 1 + _SLACK:
            break
        rows.append(int(np.argmax(total)))
        logs = minimize(
            price,
            logs,
            jac=price_by_logs,
            method="SLSQP",
            constraints=NonlinearConstraint(spent, -np.inf, 0.0, jac=spent_by_logs),
            options={"maxiter": 500, "ftol": 1e-13},
        ).x
    return np.asarray(np.exp(logs) / np.sqrt((use @ np.exp(2 * logs)).max()))
