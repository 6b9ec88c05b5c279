"""The arguments of a `SerialArm`: what files give, checked, as arrays the core takes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from pkmcal import screw
from pkmcal.arguments import shown, word, words
from pkmcal.arms.followers import Follows
from pkmcal.arms.joint_laws import JointLaws
from pkmcal.arrays import FloatArray, as_numbers, as_rows, furthest_axis
from pkmcal.core.screws import FRAMES
from pkmcal.exceptions import ArgumentError
from pkmcal.files.toml_table import unit_vector
from pkmcal.geometry.stated_uncertainty import Uncertain

Frame = Literal["space", "body", "tip"]
JointKind = Literal["revolute", "prismatic"]
KINDS: tuple[JointKind, ...] = ("revolute", "prismatic")


class Source(NamedTuple):
    """The URDF file that an arm was read from, and the links between which it is."""

    path: str
    tip: str | None
    base: str | None


class ArmArguments(TypedDict):
    """The arguments of `SerialArm`: what readers of files return and writers take."""

    axes: FloatArray
    points: FloatArray
    home: FloatArray
    kinds: tuple[JointKind, ...]
    name: str
    joint_errors: FloatArray
    joint_names: tuple[str, ...] | None
    source: Source | None
    laws: JointLaws | None
    follows: Follows | None
    uncertainty: Uncertain


def names_of(given: Sequence[str] | None, joints: int) -> tuple[str, ...] | None:
    """Check the names of joints: a different one for each, or None."""
    if given is None:
        return None
    names = words("joint_names", given)
    if len(names) != joints or len(set(names)) < joints:
        raise ArgumentError(f"joint_names: {joints} different names, found {shown(given)}")
    return names


def axes_and_points(axes: ArrayLike, points: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Unit directions and points, (n, 3) each."""
    directions, places = _unit(_table("axes", axes)), _table("points", points)
    if directions.shape != places.shape:
        raise ArgumentError(
            f"points must have shape {directions.shape} like axes, found {places.shape}"
        )
    return directions, places


def checked_errors(given: ArrayLike, joints: int, shape: tuple[int, ...]) -> FloatArray:
    """Errors (n, 6) as they are, or those of each row as (N, n, 6)."""
    rows, leading = as_rows("joint_errors", given, 6)
    if not leading or leading[-1] != joints or leading[:-1] not in ((), shape):
        raise ArgumentError(
            f"joint_errors must have shape ({joints}, 6)"
            + (f" or {(*shape, joints, 6)}" if shape else "")
            + f", found {np.shape(given)}"
        )
    if not np.isfinite(rows).all():
        raise ArgumentError("joint_errors must be finite")
    return rows if leading == (joints,) else rows.reshape(-1, joints, 6)


def _table(name: str, given: ArrayLike) -> FloatArray:
    rows, shape = as_rows(name, given, 3)
    if len(shape) != 1 or not len(rows):
        raise ArgumentError(f"{name} must have shape (n, 3), found {np.shape(given)}")
    if not np.isfinite(rows).all():
        raise ArgumentError(f"{name} must be finite")
    table: FloatArray = rows.copy()
    return table


def _unit(axes: FloatArray) -> FloatArray:
    for i, axis in enumerate(axes, 1):
        if not axis.any():
            raise ArgumentError(f"axes must be directions, found 0 for joint {i}")
    return np.array([unit_vector(*axis) for axis in axes.tolist()])


def kinds_of(given: str | Sequence[str] | None, joints: int) -> tuple[JointKind, ...]:
    """Check the kinds of joints: one for all, or one for each."""
    one = "revolute" if given is None else given
    said = words("kinds", one) * (joints if isinstance(one, str) else 1)
    if len(said) != joints:
        raise ArgumentError(f"kinds: one word for each of {joints} joints, found {len(said)}")
    return tuple(KINDS[KINDS.index(word("kinds", each, KINDS))] for each in said)


def motion(name: str, given: ArrayLike) -> FloatArray:
    """Check a finite motion, given as (4, 4) or as a pose (6,)."""
    given = as_numbers(name, given, "4, 4")
    pose = given.shape == (6,)
    rows, shape = screw.as_motions(name, screw.from_pose(given) if pose else given)
    if shape or not np.isfinite(rows).all():
        raise ArgumentError(
            f"{name} must be a finite motion (4, 4) or pose (6,), found shape {np.shape(given)}"
        )
    matrix: FloatArray = rows.reshape(4, 4).copy()
    return matrix


def frame_number(frame: str) -> int:
    """Index in the core of the frame that twists are seen in."""
    return FRAMES.index(word("frame", frame, FRAMES))


def joint_frames(axes: FloatArray) -> FloatArray:
    """Right-handed axes (n, 3, 3) whose third column is the joint's axis.

    The first is the coordinate axis furthest from the third (`furthest_axis`), made orthogonal to
    it: axes along coordinates get coordinate axes, without rounding.
    """
    furthest = np.eye(3)[[furthest_axis(axis) for axis in axes]]
    across = furthest - axes * (axes * furthest).sum(axis=1, keepdims=True)
    first = across / np.linalg.norm(across, axis=1, keepdims=True)
    return np.ascontiguousarray(np.stack([first, np.cross(axes, first), axes], axis=2))
