"""Mistakes that show in a serial arm: units of lengths and joint errors, joints on one axis."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from pkmcal.arms.arm import SerialArm
from pkmcal.checks.finding import Finding
from pkmcal.checks.function import USUAL, whole_size
from pkmcal.geometry.chain_joints import ERRORS

_TURNED = 0.2  # rad: no joint is turned so far from its place by error
_SHIFTED = 0.1  # of the arm's length: none is shifted so far
_STEP = 5.0  # deg: twists of drawings are its multiples
_EXACTLY = 1e-6  # rad
_ONE_AXIS = 1e-6  # of the arm's length, or rad: so near to each other two axes are one


def wrong_length(arm: SerialArm) -> Iterator[Finding]:
    """An arm that is too small or too large to be one."""
    places = np.vstack([arm.points, arm.home[None, :3, 3]])
    yield from whole_size(float(np.linalg.norm(places, axis=1).max()), USUAL)


def wrong_errors(arm: SerialArm) -> Iterator[Finding]:
    """Joint errors that are no errors of manufacture."""
    for i, errors in enumerate(arm.joint_errors.tolist(), 1):
        for name, value in zip(ERRORS, errors, strict=True):
            if name in ("dx", "dy", "dz"):
                if abs(value) > _SHIFTED * arm.length:
                    yield Finding(
                        "unit",
                        (i,),
                        f"joint{i}.{name} is {value:.6g} mm, on an arm of {arm.length:.4g} mm",
                        "is it in micrometres? See length under [units]",
                    )
            elif abs(value) > _TURNED:
                yield Finding(
                    "angle",
                    (i,),
                    f"joint{i}.{name} is {value:.6g} rad, {np.degrees(value):.6g} deg",
                    f"is {value:.6g} in degrees? See angle under [units]",
                )


def twists_in_degrees(arm: SerialArm) -> Iterator[Finding]:
    """Angles between neighbouring axes that are round numbers of degrees, taken for radians."""
    typed = np.arange(_STEP, 360.0, _STEP)
    axes = np.vstack([[0.0, 0.0, 1.0], arm.axes, arm.home[:3, 2]])
    for i, (one, other) in enumerate(pairwise(axes)):
        twist = float(np.arctan2(np.linalg.norm(np.cross(one, other)), one @ other))
        meant = typed[np.abs(np.arccos(np.cos(typed)) - twist) <= _EXACTLY]
        if not meant.size:
            continue
        ends = [f"joint {k}" if 1 <= k <= len(arm.axes) else "" for k in (i, i + 1)]
        first, second = ends[0] or "the base's z axis", ends[1] or "the tool's z axis"
        yield Finding(
            "angle",
            tuple(k for k, end in zip((i, i + 1), ends, strict=True) if end),
            f"{first} and {second} are {np.degrees(twist):.6g} deg apart, which is"
            f" {meant[0]:g} rad less full turns",
            f"was {meant[0]:g} deg meant? Denavit-Hartenberg angles are in rad",
        )


def coaxial(arm: SerialArm) -> Iterator[Finding]:
    """Neighbours on one axis, of which the second moves nothing that the first does not."""
    screws = arm.screws / np.array([1.0, 1.0, 1.0, *(arm.length,) * 3])
    for i, (one, other) in enumerate(pairwise(screws), 1):
        if arm.kinds[i - 1] != arm.kinds[i] or i not in arm.followers.driven:
            continue
        turning = arm.kinds[i] == "revolute"
        size = 1.0 if turning else 1.0 / arm.length
        if min(np.abs(one - other).max(), np.abs(one + other).max()) <= _ONE_AXIS * size:
            how = "turn about one axis" if turning else "slide in one direction"
            yield Finding(
                "double",
                (i, i + 1),
                f"joints {i} and {i + 1} {how}",
                "one of them moves nothing that the other does not: check their axes and points",
            )


ARM_CHECKS = (wrong_length, wrong_errors, twists_in_degrees, coaxial)
