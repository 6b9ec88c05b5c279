"""A laser tracker: how far off the points are that it measures, by where it stands."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import number
from pkmcal.arrays import FloatArray, as_rows
from pkmcal.exceptions import ArgumentError


@dataclass(frozen=True)
class Tracker:
    """The noise of an instrument that reads a range and two angles, each with its own deviation.

    Stands in for ``sigma`` of `Measurements` and for ``noise`` of `VirtualMachine`.

    Attributes
    ----------
    range : float
        Standard deviation of the distance, mm.
    azimuth, elevation : float
        Standard deviations of the angle about the vertical and of the one above the horizontal,
        rad.
    position : (float, float, float)
        Where it stands, mm, in the frame its points are given in: the base frame, or, where
        `identify` is given ``unknown="frame"``, its own, where it stands at 0. Its vertical
        axis is that frame's z.

    Examples
    --------
    >>> tracker = Tracker(range=0.01, azimuth=1e-5, elevation=2e-5, position=(3000, 0, 0))
    >>> np.sqrt(np.diagonal(tracker.covariance([0, 0, 0]))).round(3)  # x is along its line of sight
    array([0.01, 0.03, 0.06])
    """

    range: float
    azimuth: float
    elevation: float
    position: tuple[float, float, float] = field(default=(0.0, 0.0, 0.0), kw_only=True)

    def __post_init__(self) -> None:
        for name in ("range", "azimuth", "elevation"):
            number(name, getattr(self, name), above=0)
        place, shape = as_rows("position", self.position, 3)
        if shape or not np.isfinite(place).all():
            raise ArgumentError(f"position must be three finite numbers; found {self.position!r}")
        object.__setattr__(self, "position", tuple(place[0].tolist()))

    def covariance(self, points: ArrayLike) -> FloatArray:
        """Covariance of measured points.

        Parameters
        ----------
        points : array_like (..., 3)
            mm.

        Returns
        -------
        ndarray (..., 3, 3)
            mm².

        Raises
        ------
        ValueError
            A point straight above or below the tracker, where it has no azimuth.
        """
        rows, shape = as_rows("points", points, 3)
        away = rows - self.position
        distance, across = np.linalg.norm(away, axis=1), np.hypot(away[:, 0], away[:, 1])
        if (across <= 1e-9 * distance).any():
            row = int(np.argmin(across / np.maximum(distance, 1e-300)))
            raise ArgumentError(f"points: row {row} is straight above or below the tracker")
        x, y, z = away.T
        axes = np.stack([
            away / distance[:, None],
            np.stack([-y, x, 0.0 * z], axis=1) / across[:, None],
            np.stack([-x * z, -y * z, across**2], axis=1) / (across * distance)[:, None],
        ], axis=1)  # fmt: skip
        arms = np.stack([np.ones_like(distance), across, distance], axis=1)
        scaled = (arms * (self.range, self.azimuth, self.elevation))[:, :, None] * axes
        found: FloatArray = scaled.transpose(0, 2, 1) @ scaled
        return found.reshape(*shape, 3, 3)
