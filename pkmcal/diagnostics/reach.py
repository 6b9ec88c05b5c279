"""Bounds on a machine's numbers beyond those of a linear fit.

Touches of a place fit any machine that is small enough: what keeps its size is a known distance.
Numbers that are found without that, for some of the rows or for another reading of it, shrink the
machine to nothing, and the residuals with it.
"""

from __future__ import annotations

from pkmcal.arrays import FloatArray
from pkmcal.estimation.uncertainty import Uncertainty

_MOST = 0.5  # of the machine's size


def reach(sure: Uncertainty) -> FloatArray:
    """Numbers (n, p) by parameters of the linear fit, in units of how far they can be off."""
    return sure.fit.back / (_MOST * sure.equations.parameters.robot.length)
