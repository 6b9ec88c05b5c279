"""Bounds on a machine's numbers beyond those of a linear fit.

Touches of a place fit any machine that is small enough: what keeps its size is a known distance.
Numbers that are found without that, for some of the rows or for another reading of it, shrink the
machine to nothing, and the residuals with it.
"""

from __future__ import annotations

from pkmcal.arrays import FloatArray
from pkmcal.estimation.machine_size import sizes
from pkmcal.estimation.uncertainty import Uncertainty
from pkmcal.statistics.linear_fit import LinearFit

_MOST = 0.5  # of the machine's size


def reach(sure: Uncertainty, fit: LinearFit) -> FloatArray:
    """Return numbers (n, p) by parameters of a linear fit, in units of how far they can be off.

    Lengths of an arm without any may be anything: no size bounds them.
    """
    return fit.back / (_MOST * sizes(sure.equations))[:, None]
