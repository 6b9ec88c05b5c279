"""Angles along a move: of all turns of its drives those that go on from its start.

Turns are those of the drives, not of the readings. A drive law need not repeat after a turn, and
cranks that share an actuator need not agree on one; a place looked at for itself may then be given
at another turn than the place before.
"""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core.core_machine import known_rows
from pkmcal.kinematics.loaded import AnyCompiled

_TURN = 2.0 * np.pi


def unwrapped(machine: AnyCompiled, start: FloatArray, way: FloatArray) -> FloatArray:
    """Ways q̃ (k, drives) in their order along a move, angles continuous from those at its start.

    Out of reach there is none: they are interpolated there.

    Parameters
    ----------
    machine : Machine
        Whose drives they are.
    start : ndarray (drives,)
        Their turns where the move starts.
    way : ndarray (k, drives)
        At any turn.
    """
    out: FloatArray = way.copy()
    places = np.arange(len(way))
    for d in np.flatnonzero(machine.turning).tolist():
        known = np.isfinite(way[:, d])
        if not known.any() or not np.isfinite(start[d]):
            out[:, d] = np.nan
            continue
        angle = np.unwrap(way[known, d])
        angle += _TURN * np.rint((start[d] - angle[0]) / _TURN)
        out[:, d] = np.interp(places, places[known], angle)
    return out


def continued(
    machine: AnyCompiled, slots: FloatArray, way: FloatArray, near: FloatArray
) -> FloatArray:
    """Coordinates (N, n) where drives are at q̃ (N, drives), angles at the turns near others.

    NaN where a drive is out of reach, or its law has no reading.
    """
    with np.errstate(invalid="ignore"):  # ways that are infinite
        turned = way + _TURN * np.rint((near - way) / _TURN)
    return known_rows(machine.at_drives(slots, np.where(machine.turning, turned, way)))
