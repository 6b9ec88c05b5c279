"""A robot's base and tool frames: poses in the user's frames and in the machine's own."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core.poses import NOWHERE, compose, compose_rates, compose_twists, invert


class Frames:
    """T = B T_machine C, with B the machine's base in the user's frame and C the tool.

    Parameters
    ----------
    base, tool : ndarray (6,) or None
        x y z in mm, α β γ in rad.
    """

    def __init__(self, base: FloatArray | None, tool: FloatArray | None) -> None:
        self.trivial = base is None and tool is None
        self._base = np.ascontiguousarray(NOWHERE if base is None else base, dtype=np.float64)
        self._tool = np.ascontiguousarray(NOWHERE if tool is None else tool, dtype=np.float64)
        self._base_inverse, self._tool_inverse = invert(self._base), invert(self._tool)

    def inward(self, pose: FloatArray) -> FloatArray:
        """Poses (N, 6) in the user's frames to the machine's own."""
        if self.trivial:
            return pose
        return compose(compose(self._base_inverse, pose), self._tool_inverse)

    def outward(self, pose: FloatArray) -> FloatArray:
        """Poses (..., 6) of the machine's own to the user's frames."""
        if self.trivial:
            return pose
        return compose(compose(self._base, pose.reshape(-1, 6)), self._tool).reshape(pose.shape)

    def motion_inward(self, motion: FloatArray) -> FloatArray:
        """Motions with their derivatives (N, 3, 4, 4), from the user's frames to the machine's."""
        if self.trivial:
            return motion
        from pkmcal.screw import from_pose

        inward: FloatArray = from_pose(self._base_inverse) @ motion @ from_pose(self._tool_inverse)
        return inward

    def motion_outward(self, motion: FloatArray) -> FloatArray:
        """The reverse of `motion_inward`."""
        if self.trivial:
            return motion
        from pkmcal.screw import from_pose

        outward: FloatArray = from_pose(self._base) @ motion @ from_pose(self._tool)
        return outward

    def rates_outward(self, own: FloatArray, pose: FloatArray, rates: FloatArray) -> FloatArray:
        """Rates (N, 6, k) of the machine's own poses to those of the user's poses."""
        if self.trivial:
            return rates
        outward: FloatArray = compose_rates(self._base, own, self._tool, pose) @ rates
        return outward

    def twists_outward(self, own: FloatArray, twists: FloatArray) -> FloatArray:
        """Twists (N, 6, k) of the machine's own poses to those of the user's poses."""
        if self.trivial:
            return twists
        outward: FloatArray = compose_twists(self._base, own, self._tool) @ twists
        return outward
