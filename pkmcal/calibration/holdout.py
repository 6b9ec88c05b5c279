"""Points that are not fitted, only compared: the honest measure of a calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pkmcal.calibration.equations import Equations
from pkmcal.calibration.estimator import Estimate, Estimator
from pkmcal.calibration.parameters import Share
from pkmcal.measurements.measurements import Measurements


@dataclass(frozen=True)
class HeldOut:
    """How far off points are that were held out, mm; NaN where there are none.

    Attributes
    ----------
    rms_before, rms : float
        Root mean square distances with the start's parameters and with the estimate's.
    expected : float
        What `rms` should be if noise and covariance are right.
    unreached : str
        Rows that were left out because the machine does not reach them, in words.
    off_before, off : ndarray (N,)
        The distances themselves.
    """

    rms_before: float = float("nan")
    rms: float = float("nan")
    expected: float = float("nan")
    unreached: str = ""
    off_before: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    off: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))


def drawn(share: Share, holdout: float) -> tuple[Share, Share]:
    """The rows to fit and the rows to hold out, as `Measurements.split` draws them."""
    measured = share.measured
    numbered = Measurements(
        measured.actuators, np.arange(len(measured)), "height", group=measured.pose_index
    )
    kept, out = (part.values.astype(np.intp) for part in numbered.split(holdout))
    return _rows(share, kept), _rows(share, out)


def _rows(share: Share, chosen: NDArray[np.intp]) -> Share:
    return replace(share, measured=share.measured.select(chosen), rows=share.rows[chosen])


def compare(held: Sequence[tuple[Share, int]], estimator: Estimator, estimate: Estimate) -> HeldOut:
    """How far off points that were not fitted are, and should be.

    Parameters
    ----------
    held : sequence of (Share, int)
        With each, the fitted set whose noise it has where its own is not stated.
    estimator, estimate : Estimator, Estimate
        Of the fit.
    """
    if not held:
        return HeldOut()
    equations = Equations([share for share, _ in held], estimator.equations.parameters)
    before, after = equations.at(estimator.start.theta), equations.at(estimate.point.theta)
    scaled = estimate.covariance * np.outer(estimator.scale, estimator.scale)
    variances = []
    for part, (share, like) in zip(equations.jacobian(after), held, strict=True):
        lengths = part[:, :3]  # of a pose its position
        model = np.einsum("nij,jk,nik->n", lengths, scaled, lengths, optimize=True)
        variances.append(model + _noise(share.measured, estimate.setting.noise[like]))
    return HeldOut(
        rms_before=equations.rms(before),
        rms=equations.rms(after),
        expected=float(np.sqrt(np.nanmean(np.concatenate(variances)))),
        unreached=equations.unreached(after),
        off_before=equations.distances(before),
        off=equations.distances(after),
    )


def _noise(measured: Measurements, estimated: float) -> NDArray[np.float64]:
    """Variance of the measured point of each row, mm² (N,)."""
    sigma = measured.sigma
    if sigma is None:
        lengths = min(len(measured.components), 3)
        return np.full(len(measured), lengths * estimated**2)
    if sigma.ndim == 2:
        squares: NDArray[np.float64] = (sigma[:, :3] ** 2).sum(axis=1)
        return squares
    traces: NDArray[np.float64] = np.trace(sigma[:, :3, :3], axis1=1, axis2=2)
    return traces
