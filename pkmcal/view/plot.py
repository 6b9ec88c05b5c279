"""`Robot.plot` and `SerialArm.plot`: a machine as lines in matplotlib axes, for papers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import FloatArray, as_rows
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.robot import Robot
from pkmcal.view.skeleton import Skeleton, skeleton

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SLENDER = 0.4  # of the longest side: a shorter one gets room, so that its ticks do not collide
_TICKS = 4  # an axis in space
_FLAT = ("planar", "xy")  # pose maps of machines that are seen from above


def of_robot(
    robot: Robot, axes: Axes | None, pose: ArrayLike | None, numbers: bool, colour: str | None
) -> Axes:
    """Draw a robot at a pose, by default home, and return the axes."""
    at = robot.home if pose is None else as_rows("pose", pose, 6)[0][0]
    q = robot.inverse(at)
    drawn = skeleton(robot, q, at) if np.isfinite(q).all() else None
    if drawn is None:
        raise ArgumentError(f"pose: {robot.name} does not get there")
    return _drawn(drawn, axes, numbers, colour, flat=robot.model.map in _FLAT)


def of_arm(arm: SerialArm, axes: Axes | None, theta: ArrayLike | None, colour: str | None) -> Axes:
    """Draw an arm at joint coordinates, by default zero, and return the axes."""
    q = (
        np.zeros(arm.n_actuators)
        if theta is None
        else as_rows("theta", theta, arm.n_actuators)[0][0]
    )
    drawn = skeleton(arm, q, np.zeros(6))
    assert drawn is not None  # an arm is somewhere at all coordinates
    return _drawn(drawn, axes, False, colour)


def lines(axes: Any, drawn: Skeleton, colour: str | None, label: str) -> str:
    """Draw limbs and outlines in axes of three dimensions, or in two from above."""
    dimensions = 3 if hasattr(axes, "get_zlim") else 2
    for k, limb in enumerate(drawn.limbs):
        once = label if k == 0 else None
        (line,) = axes.plot(
            *limb.T[:dimensions], color=colour, lw=2, marker="o", ms=3.5, label=once
        )
        colour = line.get_color()
    for outline in (drawn.base, drawn.platform):
        style = ":" if outline is drawn.base else "-"
        axes.plot(*outline.T[:dimensions], color=colour, lw=1, ls=style)
    assert colour is not None
    return colour


def widen(axes: Any) -> None:
    """Room for the ticks of a side that is much shorter than the others."""
    ends = [getattr(axes, f"get_{name}lim")() for name in "xyz"]
    least = _SLENDER * max(high - low for low, high in ends)
    for name, (low, high) in zip("xyz", ends, strict=True):
        more = max(least - (high - low), 0.0) / 2
        getattr(axes, f"set_{name}lim")(low - more, high + more)


def _drawn(
    drawn: Skeleton, axes: Any, numbers: bool, colour: str | None, flat: bool = False
) -> Axes:
    if axes is None:
        from matplotlib import pyplot

        space = {} if flat else {"projection": "3d", "proj_type": "ortho"}
        axes = pyplot.figure().add_subplot(**space)
    used = lines(axes, drawn, colour, "_")
    dimensions = 3 if hasattr(axes, "get_zlim") else 2
    names = "xyz"[:dimensions]
    if numbers:
        for k, limb in enumerate(drawn.limbs):
            at = _middle(limb)[:dimensions]
            axes.text(*at, f" {k + 1}", color=used)
    for name in names:
        getattr(axes, f"set_{name}label")(f"{name} [mm]")
    if dimensions == 3:
        widen(axes)
        for name in names:
            getattr(axes, f"{name}axis").get_major_locator().set_params(nbins=_TICKS)
    axes.set_aspect("equal")
    result: Axes = axes
    return result


def _middle(limb: FloatArray) -> FloatArray:
    """The middle of a limb's longest part."""
    k = int(np.argmax(np.linalg.norm(np.diff(limb, axis=0), axis=1)))
    middle: FloatArray = (limb[k] + limb[k + 1]) / 2
    return middle
