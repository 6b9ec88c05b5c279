"""Limits of limbs at poses: reach, strokes and joint cones."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, Unit
from pkmcal.display import Table, first_rows
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.geometry.limbs import Cone, Limb
from pkmcal.result import Result

AT_LIMIT = 1e-10  # of the machine's size, or rad: so near a limit it is kept


@dataclass(frozen=True, eq=False, repr=False)
class Feasibility(Result):
    """Limits kept, for each pose and limb; arrays are (..., limbs), that of the workspace is (...).

    Joints behind the platform are one more, the last, in a machine that has such a tail.

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
        limb states none, NaN where it is not known.
    workspace : ndarray of bool (...)
        The pose is in the box of the robot file, ``[workspace]``; True where it states none.
    tail : bool
        Whether the last column is that of joints behind the platform.
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
    tail: bool = False

    LIMITS = ("reach", "stroke", "base_cone", "platform_cone")

    @property
    def ok(self) -> BoolArray:
        """True where every limb keeps every limit, (...)."""
        kept = self.reach & self.stroke & self.base_cone & self.platform_cone
        return np.asarray(kept.all(axis=-1) & self.workspace)

    def broken(self) -> list[str]:
        """List broken limits, a line for each limit and limb, or the tail, over all poses."""
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
                    place = "tail" if self.is_tail(limb) else f"limb {limb + 1}"
                    lines.append(f"{place}: {what} broken in rows {first_rows(rows)}")
        return lines

    def is_tail(self, column: int) -> bool:
        """Return whether a column, counted from 0, is that of the tail."""
        return self.tail and column == self.reach.shape[-1] - 1

    def _parts(self) -> Iterator[str | Table]:
        yield f"{int(self.ok.sum())} of {self.ok.size} poses keep all limits"
        yield from self.broken()


def feasibility(
    limbs: tuple[Limb, ...],
    reach: BoolArray,
    drive: FloatArray,
    on_base: FloatArray,
    on_platform: FloatArray,
    size: float,
) -> Feasibility:
    """Compare limbs at N poses with their limits.

    Parameters
    ----------
    limbs : tuple of Limb
        With strokes and cones, or without.
    reach : ndarray of bool (N, limbs)
        Whether a limb reaches the pose.
    drive : ndarray (N, limbs)
        q̃, NaN where it is not known.
    on_base, on_platform : ndarray (N, limbs, 3)
        Unit vectors from anchor to platform joint, in base and platform axes.
    size : float
        Of the machine, mm: what rounding is measured against.
    """
    stroke, base_cone, platform_cone = (np.full(drive.shape, np.inf) for _ in range(3))
    in_stroke = np.ones(drive.shape, dtype=bool)
    for i, limb in enumerate(limbs):
        if limb.stroke is not None:
            unit = KINDS[limb.kind].actuator_unit
            stroke[:, i] = margin_of(limb.stroke, drive[:, i])
            in_stroke[:, i] = kept(stroke[:, i], unit, size)
        for cone, margin, direction in (
            (limb.base_cone, base_cone, on_base),
            (limb.platform_cone, platform_cone, on_platform),
        ):
            if cone is not None:
                margin[:, i] = _inside(cone, direction[:, i])
    return Feasibility(
        reach,
        in_stroke,
        kept(base_cone, "rad", size),
        kept(platform_cone, "rad", size),
        np.where(reach, drive, np.nan),
        stroke,
        base_cone,
        platform_cone,
    )


def margin_of(stroke: tuple[float, float] | None, drive: FloatArray) -> FloatArray:
    """Return the distance of each q̃ (N,) from the ends of its stroke; infinite without one."""
    low, high = stroke or (-np.inf, np.inf)
    return np.minimum(drive - low, high - drive)


def kept(margin: FloatArray, unit: Unit, size: float) -> BoolArray:
    """Return whether limits are kept with these margins, up to rounding.

    Examples
    --------
    >>> kept(np.array([1.0, -1e-9, -1e-6]), "mm", 1000.0)
    array([ True,  True, False])
    """
    return np.asarray(margin >= -AT_LIMIT * (size if unit == "mm" else 1.0))


def _inside(cone: Cone, direction: FloatArray) -> FloatArray:
    across = np.linalg.norm(np.cross(cone.axis, direction), axis=-1)
    return np.asarray(cone.angle - np.arctan2(across, direction @ cone.axis))
