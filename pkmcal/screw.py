"""Screws: exponential and logarithm of rigid motions, the adjoint, and joint errors as screws.

A twist is (ω, v), rotation first, in rad and mm; a motion is a matrix (4, 4). Equation numbers are
those of the paper on joint structure errors, DOI 10.3969/j.issn.1673-9833.2020.05.005.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import number
from pkmcal.arrays import FloatArray, as_doubles, as_numbers, as_rows
from pkmcal.core import screws
from pkmcal.exceptions import ArgumentError
from pkmcal.result import Result

ErrorKind = Literal["helical", "rotation", "translation", "none"]

_RIGID = 1e-6  # by so much a matrix may miss being a motion
_NO_SLIDE = 1e-13  # mm along the axis per mm of v: a rotation, up to rounding


def exp(twist: ArrayLike, angle: ArrayLike = 1.0) -> FloatArray:
    """The motion exp(angle·[twist]) (eq. 2 to 4).

    Parameters
    ----------
    twist : array_like (..., 6)
        (ω, v) of any norm; rad and mm. ω = 0 is a translation.
    angle : array_like, optional
        Factor of the twist, broadcast against its leading shape: for a unit screw the angle in
        rad, or for a translation the way in mm.

    Returns
    -------
    ndarray (..., 4, 4)
        NaN where ω is NaN or turns by more than 1e5 rad.

    Raises
    ------
    ValueError, TypeError
        A wrong shape, or no numbers.

    Examples
    --------
    A quarter turn about the axis z through (100, 0, 0):

    >>> from pkmcal import screw
    >>> import numpy as np
    >>> (screw.exp([0, 0, 1, 0, -100, 0], np.pi / 2).round(9) + 0.0).tolist()[0]
    [0.0, -1.0, 0.0, 100.0]
    """
    given, shape = as_rows("twist", twist, 6)
    factor = as_numbers("angle", angle, "N")
    try:
        np.broadcast_shapes(shape, factor.shape)
    except ValueError:
        raise ArgumentError(
            f"angle has shape {factor.shape}, which does not go with twists {shape}"
        ) from None
    with np.errstate(over="ignore", invalid="ignore"):  # such a row is NaN
        rows, shape = as_rows(
            "twist", given.reshape(*shape, 6) * factor[..., None].astype(np.float64), 6
        )
    return screws.exp(rows).reshape(*shape, 4, 4)


def log(motion: ArrayLike) -> FloatArray:
    """The twist whose exponential is the motion (eq. 11 to 16, without their loss of digits).

    Parameters
    ----------
    motion : array_like (..., 4, 4)
        Rigid motions.

    Returns
    -------
    ndarray (..., 6)
        (ω, v), rad and mm, with ‖ω‖ from 0 to π. Half a turn has two logarithms: one of them.

    Raises
    ------
    ValueError, TypeError
        A wrong shape, no numbers, or no rigid motion.

    Examples
    --------
    >>> from pkmcal import screw
    >>> screw.log(screw.exp([1e-9, 0, 0, 0, 0, 5]))[[0, 5]].tolist()
    [1e-09, 5.0]
    """
    rows, shape = as_motions("motion", motion)
    return screws.log(rows).reshape(*shape, 6)


def adjoint(motion: ArrayLike) -> FloatArray:
    """The matrix that turns twists seen in a frame into twists seen from outside (eq. 18).

    Parameters
    ----------
    motion : array_like (..., 4, 4)
        Where the frame is.

    Returns
    -------
    ndarray (..., 6, 6)
        Of twists (ω, v).

    Raises
    ------
    ValueError, TypeError
        A wrong shape, no numbers, or no rigid motion.

    Examples
    --------
    >>> from pkmcal import screw
    >>> about_z = [0, 0, 1, 0, 0, 0]
    >>> (screw.adjoint(screw.from_pose([100, 0, 0, 0, 0, 0])) @ about_z + 0.0).tolist()
    [0.0, 0.0, 1.0, 0.0, -100.0, 0.0]
    """
    rows, shape = as_motions("motion", motion)
    return screws.adjoint(rows).reshape(*shape, 6, 6)


def exp_jacobian(twist: ArrayLike) -> FloatArray:
    """Differentiate the exponential by its twist: dT T⁻¹ = [J dξ] for T = exp([ξ]).

    Parameters
    ----------
    twist : array_like (..., 6)
        (ω, v), rad and mm.

    Returns
    -------
    ndarray (..., 6, 6)
        From changes of the twist to the motion's own twist, seen from outside.

    Raises
    ------
    ValueError, TypeError
        A wrong shape, or no numbers.
    """
    rows, shape = as_rows("twist", twist, 6)
    return screws.exp_jacobian(rows, inverse=False).reshape(*shape, 6, 6)


def log_jacobian(twist: ArrayLike) -> FloatArray:
    """Differentiate the logarithm by its motion: the inverse of `exp_jacobian` there.

    Parameters
    ----------
    twist : array_like (..., 6)
        The logarithm of the motion, rad and mm.

    Returns
    -------
    ndarray (..., 6, 6)
        From the motion's own twist, seen from outside, to the change of its logarithm. NaN or
        large at whole turns, where the exponential loses rank.

    Raises
    ------
    ValueError, TypeError
        A wrong shape, or no numbers.
    """
    rows, shape = as_rows("twist", twist, 6)
    return screws.exp_jacobian(rows, inverse=True).reshape(*shape, 6, 6)


def from_pose(pose: ArrayLike) -> FloatArray:
    """The motion of a pose: R = Rz(γ) Ry(β) Rx(α), then x y z.

    Parameters
    ----------
    pose : array_like (..., 6)
        x y z in mm, α β γ in rad.

    Returns
    -------
    ndarray (..., 4, 4)

    Raises
    ------
    ValueError, TypeError
        A wrong shape, or no numbers.
    """
    rows, shape = as_rows("pose", pose, 6)
    return at_points(rows, np.zeros((len(rows), 3))).reshape(*shape, 4, 4)


def to_pose(motion: ArrayLike) -> FloatArray:
    """The pose of a motion, the reverse of `from_pose`.

    Parameters
    ----------
    motion : array_like (..., 4, 4)
        Rigid motions.

    Returns
    -------
    ndarray (..., 6)
        x y z in mm, α β γ in rad, -π/2 ≤ β ≤ π/2.

    Raises
    ------
    ValueError, TypeError
        A wrong shape, no numbers, or no rigid motion.

    Examples
    --------
    >>> from pkmcal import screw
    >>> screw.to_pose(screw.from_pose([1, 2, 3, 0.1, 0.2, 0.3])).round(12).tolist()
    [1.0, 2.0, 3.0, 0.1, 0.2, 0.3]
    """
    rows, shape = as_motions("motion", motion)
    return screws.pose(rows).reshape(*shape, 6)


@dataclass(frozen=True, eq=False, repr=False)
class JointError(Result):
    """The error of a joint as one screw motion (eq. 6 to 9 and 17).

    Attributes
    ----------
    twist : ndarray (6,)
        Unit screw (ω, v): ‖ω‖ = 1, or ‖v‖ = 1 for a translation. exp(twist, magnitude) is the
        motion from the joint's nominal place to its actual one.
    magnitude : float
        Angle in rad, or way in mm for a translation.
    kind : {"helical", "rotation", "translation", "none"}
        What the error does to the joint's axis, by the motion that brings it there:
        "helical" (the axes are skew; eq. 6), "rotation" (they intersect; eq. 7), "translation"
        (they are parallel, or the joint is shifted along its axis; eq. 8 and 9), or "none".
    """

    twist: FloatArray
    magnitude: float
    kind: ErrorKind

    @property
    def pitch(self) -> float:
        """Way along the axis per angle, mm/rad: 0 for a rotation, inf for a translation."""
        if self.kind in ("rotation", "none"):
            return 0.0
        return float(self.twist[:3] @ self.twist[3:]) if self.kind == "helical" else math.inf

    def seen_from(self, frame: ArrayLike) -> JointError:
        """Transform an error to the outside of a joint whose frame is there (eq. 18).

        Parameters
        ----------
        frame : array_like (4, 4)
            Where the joint's frame is, for instance in the base.

        Raises
        ------
        ValueError, TypeError
            No rigid motion, or one that is not finite.
        """
        rows, _ = as_motions("frame", frame)
        if len(rows) != 1:
            raise ArgumentError(f"frame must have shape (4, 4), found {np.shape(frame)}")
        if not np.isfinite(rows).all():
            raise ArgumentError("frame must be finite")
        return replace(self, twist=screws.adjoint(rows).reshape(6, 6) @ self.twist)

    def _parts(self) -> Iterator[str]:
        w, v = (
            "({:.6g}, {:.6g}, {:.6g})".format(*part) for part in (self.twist[:3], self.twist[3:])
        )
        if self.kind == "none":
            yield "no error"
        elif self.kind == "translation":
            yield f"translation by {self.magnitude:.6g} mm along {v}"
        else:
            pitch = f", pitch {self.pitch:.6g} mm/rad" if self.kind == "helical" else ""
            turn = f"{self.kind} of {math.degrees(self.magnitude):.6g}°"
            yield f"{turn} about {w}, v {v}{pitch}"


def joint_error(
    dx: float = 0.0,
    dy: float = 0.0,
    dz: float = 0.0,
    dphi: float = 0.0,
    dtheta: float = 0.0,
    dpsi: float = 0.0,
) -> JointError:
    """The error screw of a joint from its six errors (eq. 10 to 17).

    E = Trans(Δx, Δy, Δz) Rz(Δψ) Ry(Δθ) Rx(Δφ), in the joint's own frame.

    Parameters
    ----------
    dx, dy, dz : float
        Shifts, mm.
    dphi, dtheta, dpsi : float
        Rotations about x, y, z, rad.

    Raises
    ------
    ValueError, TypeError
        An error that is not a finite number, or too large for its unit screw.

    Examples
    --------
    >>> from pkmcal import screw
    >>> screw.joint_error(dx=3, dy=4).kind, screw.joint_error(dx=3, dy=4).magnitude
    ('translation', 5.0)
    >>> error = screw.joint_error(dx=0.1, dphi=1e-4)  # a shift along the axis it turns about
    >>> error.kind, round(error.pitch, 6)
    ('helical', 1000.0)
    """
    given = {"dx": dx, "dy": dy, "dz": dz, "dphi": dphi, "dtheta": dtheta, "dpsi": dpsi}
    for name, value in given.items():
        number(name, value)
    twist = log(from_pose(list(given.values())))
    angle, way = math.hypot(*twist[:3]), math.hypot(*twist[3:])
    kind: ErrorKind
    if angle == 0.0:
        kind, magnitude = ("translation", way) if way else ("none", 0.0)
    else:
        slide = float(twist[:3] @ twist[3:]) / angle
        kind, magnitude = ("helical" if abs(slide) > _NO_SLIDE * way else "rotation"), angle
    with np.errstate(over="ignore"):
        unit = twist / (magnitude or 1.0)
    if not np.isfinite(unit).all():
        found = ", ".join(f"{name} {value:g}" for name, value in given.items())
        raise ArgumentError(f"joint errors are too large for a unit screw, found {found}")
    return JointError(unit, magnitude, kind)


def at_points(errors: FloatArray, points: FloatArray) -> FloatArray:
    """Motions (N, 4, 4) by joint errors (N, 6) that act at points (N, 3), mm and rad."""
    return screws.joint_motions(errors, points).reshape(-1, 4, 4)


def as_motions(name: str, motion: ArrayLike) -> tuple[FloatArray, tuple[int, ...]]:
    """Rigid motions (..., 4, 4) as contiguous rows (N, 16), and the leading shape.

    Rows with a number that is not finite come back as NaN.

    Raises
    ------
    TypeError
        Not numbers.
    ValueError
        Another shape, or a matrix that is no rigid motion.
    """
    given = as_numbers(name, motion, "4, 4")
    if given.ndim < 2 or given.shape[-2:] != (4, 4):
        raise ArgumentError(f"{name} must have shape (..., 4, 4), found {given.shape}")
    rows = as_doubles(given).reshape(-1, 4, 4)
    known = np.isfinite(rows).all(axis=(1, 2), keepdims=True)
    if not known.all():
        rows = np.where(known, rows, np.nan)
    R = rows[:, :3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        off = np.abs(R.transpose(0, 2, 1) @ R - np.eye(3)).max(axis=(1, 2), initial=0.0)
        off += np.abs(rows[:, 3] - [0.0, 0.0, 0.0, 1.0]).max(axis=1, initial=0.0)
        bad = np.flatnonzero((off > _RIGID) | (np.linalg.det(R) < 0.0))
    if bad.size:
        where = "" if given.ndim == 2 else f" in row {bad[0]}"
        fault = f"off by {off[bad[0]]:.1g}" if off[bad[0]] > _RIGID else "it is a reflection"
        raise ArgumentError(f"{name} must be rigid motions, found another matrix{where} ({fault})")
    return rows.reshape(-1, 16), given.shape[:-2]
