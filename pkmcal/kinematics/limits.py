"""Which limits of which limbs a pose keeps: reach, strokes and joint cones."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray
from pkmcal.display import Table, first_rows
from pkmcal.geometry.model import Cone, Limb
from pkmcal.result import Result

ROUNDING = 1e-12  # relative: a pose at a limit keeps it


@dataclass(frozen=True, eq=False, repr=False)
class Feasibility(Result):
    """Limits kept, for each pose and limb; every array but the last is (..., limbs).

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
    stroke_margin, base_cone_margin, platform_cone_margin : ndarray
        How far inside its limit each is, mm or rad; below 0 where it is broken, infinite where the
        limb states none.
    workspace : ndarray of bool (...)
        The pose is in the box of the robot file, ``[workspace]``; True where it states none.
    """

    reach: BoolArray
    stroke: BoolArray
    base_cone: BoolArray
    platform_cone: BoolArray
    drive: FloatArray
    stroke_margin: FloatArray
    base_cone_margin: FloatArray
    platform_cone_margin: FloatArray
    workspace: BoolArray = field(default_factory=lambda: np.array(True))

    LIMITS = ("reach", "stroke", "base_cone", "platform_cone")

    @property
    def ok(self) -> BoolArray:
        """Whether every limb keeps every limit, (...)."""
        kept = self.reach & self.stroke & self.base_cone & self.platform_cone
        return np.asarray(kept.all(axis=-1) & self.workspace)

    def broken(self) -> list[str]:
        """What is broken, one line per limit and limb, over all poses."""
        lines = []
        outside = np.flatnonzero(~self.workspace.reshape(-1))
        if outside.size:
            lines.append(f"outside the workspace of the file in rows {first_rows(outside)}")
        for limit in self.LIMITS:
            kept = getattr(self, limit).reshape(-1, self.reach.shape[-1])
            for limb in range(kept.shape[1]):
                rows = np.flatnonzero(~kept[:, limb])
                if rows.size:
                    what = limit.replace("_", " ")
                    lines.append(f"limb {limb + 1}: {what} broken in rows {first_rows(rows)}")
        return lines

    def _parts(self) -> Iterator[str | Table]:
        yield f"{int(self.ok.sum())} of {self.ok.size} poses keep all limits"
        yield from self.broken()


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
    stroke, base_cone, platform_cone = (np.full(drive.shape, np.inf) for _ in range(3))
    room = np.zeros((3, drive.shape[1]))
    for i, limb in enumerate(limbs):
        if limb.stroke is not None:
            room[0, i] = abs(limb.stroke[0]) + abs(limb.stroke[1])
            stroke[:, i] = stroke_margin(limb, drive[:, i])
        for k, cone, margin, direction in (
            (1, limb.base_cone, base_cone, on_base),
            (2, limb.platform_cone, platform_cone, on_platform),
        ):
            if cone is not None:
                room[k, i] = cone.angle
                margin[:, i] = _inside(cone, direction[:, i])
    margins = (stroke, base_cone, platform_cone)
    kept = [margin >= -ROUNDING * size for margin, size in zip(margins, room, strict=True)]
    return Feasibility(
        np.isfinite(drive), kept[0], kept[1], kept[2], drive, stroke, base_cone, platform_cone
    )


def stroke_margin(limb: Limb, drive: FloatArray) -> FloatArray:
    """How far inside its limb's stroke each q̃ (N,) is; infinite where the limb states none."""
    low, high = limb.stroke or (-np.inf, np.inf)
    return np.minimum(drive - low, high - drive)


def _inside(cone: Cone, direction: FloatArray) -> FloatArray:
    across = np.linalg.norm(np.cross(cone.axis, direction), axis=-1)
    return np.asarray(cone.angle - np.arctan2(across, direction @ cone.axis))
