"""Which limits of which limbs a pose keeps: reach, strokes and joint cones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.core import FloatArray
from pkmcal.geometry import BoolArray
from pkmcal.model import Cone, Limb

ROUNDING = 1e-12  # relative: a pose at a limit keeps it


@dataclass(frozen=True, eq=False)
class Feasibility:
    """Limits kept, for each pose and limb; every array is (..., limbs).

    Attributes
    ----------
    reach : ndarray of bool
        The limb has an actuator coordinate there at all.
    stroke : ndarray of bool
        q̃ is within its stroke; True where the limb states none.
    base_cone, platform_cone : ndarray of bool
        The joint's cone is kept; True where the limb states none.
    drive : ndarray
        q̃ of each limb, mm or rad; NaN out of reach.
    """

    reach: BoolArray
    stroke: BoolArray
    base_cone: BoolArray
    platform_cone: BoolArray
    drive: FloatArray

    LIMITS = ("reach", "stroke", "base_cone", "platform_cone")

    @property
    def ok(self) -> BoolArray:
        """Whether every limb keeps every limit, (...)."""
        kept = self.reach & self.stroke & self.base_cone & self.platform_cone
        return np.asarray(kept.all(axis=-1))

    def broken(self) -> list[str]:
        """What is broken, one line per limit and limb, over all poses."""
        lines = []
        for limit in self.LIMITS:
            kept = getattr(self, limit).reshape(-1, self.reach.shape[-1])
            for limb in range(kept.shape[1]):
                rows = np.flatnonzero(~kept[:, limb])
                if rows.size:
                    what = limit.replace("_", " ")
                    shown = ", ".join(map(str, rows[:5])) + (", …" if rows.size > 5 else "")
                    lines.append(f"limb {limb + 1}: {what} broken in rows {shown}")
        return lines

    def __str__(self) -> str:
        ok = np.atleast_1d(self.ok)
        return "\n".join([f"{int(ok.sum())} of {ok.size} poses keep all limits", *self.broken()])


def feasibility(
    limbs: tuple[Limb, ...], drive: FloatArray, on_base: FloatArray, on_platform: FloatArray
) -> Feasibility:
    """Compare limbs at N poses with their limits.

    Parameters
    ----------
    limbs : tuple of Limb
        With strokes and cones, or without.
    drive : ndarray (N, limbs)
        q̃, NaN out of reach.
    on_base, on_platform : ndarray (N, limbs, 3)
        Unit vectors from anchor to platform joint, in base and platform axes.
    """
    stroke = np.ones(drive.shape, dtype=bool)
    base_cone, platform_cone = stroke.copy(), stroke.copy()
    for i, limb in enumerate(limbs):
        if limb.stroke is not None:
            low, high = limb.stroke
            room = ROUNDING * (abs(low) + abs(high))
            stroke[:, i] = (drive[:, i] >= low - room) & (drive[:, i] <= high + room)
        base_cone[:, i] = _within(limb.base_cone, on_base[:, i])
        platform_cone[:, i] = _within(limb.platform_cone, on_platform[:, i])
    return Feasibility(np.isfinite(drive), stroke, base_cone, platform_cone, drive)


def _within(cone: Cone | None, direction: FloatArray) -> BoolArray:
    if cone is None:
        return np.ones(len(direction), dtype=bool)
    across = np.linalg.norm(np.cross(cone.axis, direction), axis=-1)
    angle = np.arctan2(across, direction @ cone.axis)
    return np.asarray(angle <= cone.angle * (1.0 + ROUNDING))
