"""Screws and serial arms of the compiled core as Python sees them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from pkmcal._core import ffi, lib
from pkmcal.arrays import FloatArray, Int32Array
from pkmcal.core.library import ISA, ensure, in_threads, int_pointer, pointer

FRAMES = ("space", "body", "tip")  # PKM_SPACE, ...


def _rows(call: Callable[..., int], given: FloatArray, width: int, isa: int) -> FloatArray:
    """``call(isa, n, in, out)`` over rows (N, k), to (N, width)."""
    out = np.empty((len(given), width))
    if len(given):
        ensure(call(isa, len(given), pointer(given), pointer(out)))
    return out


def exp(twist: FloatArray, isa: int = ISA) -> FloatArray:
    """Twists (N, 6) to motions (N, 16)."""
    return _rows(lib.pkm_exp, twist, 16, isa)


def log(motion: FloatArray, isa: int = ISA) -> FloatArray:
    """Motions (N, 16) to twists (N, 6)."""
    return _rows(lib.pkm_log, motion, 6, isa)


def adjoint(motion: FloatArray, isa: int = ISA) -> FloatArray:
    """Motions (N, 16) to their adjoints (N, 36)."""
    return _rows(lib.pkm_adjoint, motion, 36, isa)


def pose(motion: FloatArray, isa: int = ISA) -> FloatArray:
    """Motions (N, 16) to poses x y z α β γ (N, 6)."""
    return _rows(lib.pkm_motion_pose, motion, 6, isa)


def exp_jacobian(twist: FloatArray, inverse: bool, isa: int = ISA) -> FloatArray:
    """At twists (N, 6): how the motion follows the twist, or inversely, (N, 36)."""

    def call(isa: int, n: int, given: Any, out: Any) -> int:
        return int(lib.pkm_exp_jacobian(isa, int(inverse), n, given, out))

    return _rows(call, twist, 36, isa)


def joint_motions(errors: FloatArray, points: FloatArray, isa: int = ISA) -> FloatArray:
    """Errors (N, 6) at points (N, 3) to motions in the base (N, 16)."""

    def call(isa: int, n: int, given: Any, out: Any) -> int:
        return int(lib.pkm_joint_motions(isa, n, given, pointer(points), out))

    return _rows(call, errors, 16, isa)


class Links(NamedTuple):
    """What is between the joints of an arm: shared by all rows, or of each row.

    Attributes
    ----------
    errors : ndarray (n, 6) or (N, n, 6)
        The joint errors they are made with.
    numbers : ndarray (n + 1, 12) or (N, n + 1, 12)
        Rotation and displacement from each joint's frame to the next.
    """

    errors: FloatArray
    numbers: FloatArray

    def start(self, first: int) -> tuple[Any, Any]:
        """C arguments for the rows from `first`: the links, and a pointer to the errors."""
        by_row = self.numbers.ndim == 3
        first = first if by_row else 0
        numbers = pointer(self.numbers[first:])  # kept as long as it is used
        links = ffi.new("pkm_links *", (by_row, numbers))
        return (links, numbers), pointer(self.errors[first:])


class Arm:
    """A serial arm in the core.

    Parameters
    ----------
    prismatic : ndarray of int32 (n,)
        1 for a prismatic joint, 0 for a revolute one.
    axes : ndarray (n, 3, 3)
        Frame of each joint at zero; its third column is the joint's axis.
    points : ndarray (n, 3)
        Where the axes pass and the joints' errors are given.
    home : ndarray (4, 4)
        The tool at zero.
    isa : int
        Index into `pkmcal.core.ISAS`.
    """

    def __init__(
        self,
        prismatic: Int32Array,
        axes: FloatArray,
        points: FloatArray,
        home: FloatArray,
        isa: int = ISA,
    ) -> None:
        struct = ffi.new("pkm_arm *")
        struct.joints = len(axes)
        self.arrays = (prismatic, axes, points, home)
        self._held = (int_pointer(prismatic), *map(pointer, self.arrays[1:]))
        struct.prismatic, struct.axes, struct.point, struct.home = self._held
        self.struct = struct
        self.joints = len(axes)
        self.isa = isa

    def links(self, errors: FloatArray) -> Links:
        """Links of an arm with errors (n, 6) or (N, n, 6)."""
        by_row = errors.ndim == 3
        rows = len(errors) if by_row else 1
        numbers = np.empty((rows, self.joints + 1, 12))
        if rows:
            given = pointer(errors)
            ensure(lib.pkm_arm_links(self.struct, self.isa, rows, given, pointer(numbers)))
        return Links(errors, numbers if by_row else numbers[0])

    def forward(self, theta: FloatArray, links: Links, threads: int | None) -> FloatArray:
        """Coordinates (N, n) to the tool (N, 4, 4)."""
        out = np.empty((len(theta), 4, 4))

        def call(start: int, stop: int) -> int:
            held, _ = links.start(start)
            return int(
                lib.pkm_arm_forward(
                    self.struct,
                    held[0],
                    self.isa,
                    stop - start,
                    pointer(theta[start:]),
                    pointer(out[start:]),
                )
            )

        if len(theta):
            in_threads(call, len(theta), threads)
        return out

    def jacobian(self, theta: FloatArray, links: Links, frame: int) -> FloatArray:
        """Coordinates (N, n) to twists by them, (N, 6, n)."""
        out = np.empty((len(theta), 6, self.joints))

        def call(start: int, stop: int) -> int:
            held, _ = links.start(start)
            return int(
                lib.pkm_arm_jacobian(
                    self.struct,
                    held[0],
                    self.isa,
                    frame,
                    stop - start,
                    pointer(theta[start:]),
                    pointer(out[start:]),
                )
            )

        if len(theta):
            in_threads(call, len(theta), None)
        return out

    def error_jacobian(self, theta: FloatArray, links: Links, frame: int) -> FloatArray:
        """Coordinates (N, n) to twists by the joint errors, (N, 6, 6 n)."""
        out = np.empty((len(theta), 6, 6 * self.joints))

        def call(start: int, stop: int) -> int:
            held, errors = links.start(start)
            return int(
                lib.pkm_arm_error_jacobian(
                    self.struct,
                    held[0],
                    errors,
                    self.isa,
                    frame,
                    stop - start,
                    pointer(theta[start:]),
                    pointer(out[start:]),
                )
            )

        if len(theta):
            in_threads(call, len(theta), None)
        return out
