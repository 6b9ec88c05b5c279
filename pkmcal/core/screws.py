"""Screws and serial arms of the compiled core as Python sees them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pkmcal._core import ffi
from pkmcal.arrays import FloatArray, Int32Array
from pkmcal.core.library import ISA, call, in_threads, part, pointer, rows

FRAMES = ("space", "body", "tip")  # PKM_SPACE, ...


def exp(twist: FloatArray, isa: int | None = None) -> FloatArray:
    """Twists (N, 6) to motions (N, 16)."""
    return rows("exp", twist, isa=isa)[0].reshape(-1, 16)


def turnings(vectors: FloatArray) -> FloatArray:
    """Rotation vectors (N, 3) to rotations (N, 3, 3)."""
    twists = np.hstack([vectors, np.zeros_like(vectors)])
    turns: FloatArray = exp(twists).reshape(-1, 4, 4)[:, :3, :3]
    return turns


def skew_vectors(matrix: FloatArray) -> FloatArray:
    """Half the vectors (N, 3) of the skew parts of matrices (N, 3, 3): 0 of no turning."""
    m = matrix
    found = [m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]]
    return np.stack(found, axis=1) / 2.0


def log(motion: FloatArray, isa: int | None = None) -> FloatArray:
    """Motions (N, 16) to twists (N, 6)."""
    return rows("log", motion, isa=isa)[0]


def adjoint(motion: FloatArray, isa: int | None = None) -> FloatArray:
    """Motions (N, 16) to their adjoints (N, 36)."""
    return rows("adjoint", motion, isa=isa)[0].reshape(-1, 36)


def pose(motion: FloatArray, isa: int | None = None) -> FloatArray:
    """Motions (N, 16) to poses x y z α β γ (N, 6)."""
    return rows("motion_pose", motion, isa=isa)[0]


def exp_jacobian(twist: FloatArray, inverse: bool, isa: int | None = None) -> FloatArray:
    """Differentiate motions by twists (N, 6), or inversely, (N, 36)."""
    name = "log_jacobian" if inverse else "exp_jacobian"
    return rows(name, twist, isa=isa)[0].reshape(-1, 36)


def joint_motions(errors: FloatArray, points: FloatArray, isa: int | None = None) -> FloatArray:
    """Errors (N, 6) at points (N, 3) to motions in the base (N, 16)."""
    return rows("joint_motions", errors, points, isa=isa)[0].reshape(-1, 16)


def frames(pose: FloatArray) -> FloatArray:
    """Poses (N, 6) to matrices (N, 4, 4): those of joint errors at the origin."""
    points = np.zeros((len(pose), 3))
    return joint_motions(np.ascontiguousarray(pose), points).reshape(-1, 4, 4)


class Links(NamedTuple):
    """The links between the joints of an arm: shared by all rows, or of each row.

    Attributes
    ----------
    errors : ndarray (n, 6) or (N, n, 6)
        The joint errors they are made with.
    numbers : ndarray (n + 1, 12) or (N, n + 1, 12)
        Rotation and displacement from each joint's frame to the next.
    """

    errors: FloatArray
    numbers: FloatArray

    def part(self, start: int, stop: int) -> tuple[Any, FloatArray]:
        """C arguments for some rows: the links, and the errors."""
        if self.numbers.ndim < 3:
            return ffi.new("pkm_links *", (False, pointer(self.numbers))), self.errors
        own = pointer(part(self.numbers, start, stop))
        return ffi.new("pkm_links *", (True, own)), part(self.errors, start, stop)


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
        self._held = tuple(pointer(array) for array in self.arrays)
        struct.prismatic, struct.axes, struct.point, struct.home = self._held
        self.struct = struct
        self.joints = len(axes)
        self.isa = isa

    def links(self, errors: FloatArray) -> Links:
        """Links of an arm with errors (n, 6) or (N, n, 6)."""
        by_row = errors.ndim == 3
        rows = len(errors) if by_row else 1
        numbers = np.empty((rows, self.joints + 1, 12))
        call("arm_links", self.struct, rows, errors, numbers, isa=self.isa)
        return Links(errors, numbers if by_row else numbers[0])

    def forward(self, theta: FloatArray, links: Links, threads: int | None) -> FloatArray:
        """Coordinates (N, n) to the tool (N, 4, 4)."""
        out = np.empty((len(theta), 4, 4))

        def run(start: int, stop: int) -> None:
            own, _ = links.part(start, stop)
            given, found = part(theta, start, stop), part(out, start, stop)
            call("arm_forward", self.struct, own, stop - start, given, found, isa=self.isa)

        in_threads(run, len(theta), threads)
        return out

    def jacobian(self, theta: FloatArray, links: Links, frame: int) -> FloatArray:
        """Coordinates (N, n) to twists by them, (N, 6, n)."""
        out = np.empty((len(theta), 6, self.joints))

        def run(start: int, stop: int) -> None:
            own, _ = links.part(start, stop)
            given, found = part(theta, start, stop), part(out, start, stop)
            call("arm_jacobian", self.struct, own, frame, stop - start, given, found, isa=self.isa)

        in_threads(run, len(theta), None)
        return out

    def error_jacobian(self, theta: FloatArray, links: Links, frame: int) -> FloatArray:
        """Coordinates (N, n) to twists by the joint errors, (N, 6, 6 n)."""
        out = np.empty((len(theta), 6, 6 * self.joints))

        def run(start: int, stop: int) -> None:
            own, errors = links.part(start, stop)
            given, found = part(theta, start, stop), part(out, start, stop)
            arguments = (self.struct, own, errors, frame, stop - start, given, found)
            call("arm_error_jacobian", *arguments, isa=self.isa)

        in_threads(run, len(theta), None)
        return out
