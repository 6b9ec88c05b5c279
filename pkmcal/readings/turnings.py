"""Orientations, tilts and whole poses of the platform, or of what is mounted on it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arrays import FloatArray, as_rows
from pkmcal.core import instruments
from pkmcal.core.poses import NOWHERE, compose
from pkmcal.files.column_names import is_turned, orientation_in
from pkmcal.files.csv_table import Table
from pkmcal.readings import orientation
from pkmcal.readings.alignment import (
    Laid,
    Sighting,
    angles_of,
    frame_of_poses,
    nearest_rotations,
    of_directions,
)
from pkmcal.readings.dependences import always
from pkmcal.readings.measured import InFit, Measured
from pkmcal.readings.points import PLACE_TITLE, points
from pkmcal.readings.predicted import At, Predicted
from pkmcal.readings.reading import Reading, Sets
from pkmcal.readings.unknowns import ANGLES, PLACE, Dependence, Found, Nature, Start

_ORIGIN = np.zeros(3)
_UP = np.array([0.0, 0.0, 1.0])
_AXES = ("x", "y", "z")
_ALIKE = 10.0  # times the least misfit of the nominal machine, which its errors may make of it
_EXACT = 1e-6  # rad; misfits of which nothing is told


@dataclass(frozen=True, eq=False)
class Pose(Reading):
    """Position and orientation of the platform, or of a tool on it."""

    name = "pose"
    components = PLACE
    turning = 3
    unknown_with_target = ("tool",)
    framed = True
    frame_order = 1
    is_place = True

    def predict(
        self,
        at: At,
        tool: FloatArray | None = None,
        tool_origin: FloatArray = NOWHERE,
        **numbers: FloatArray,
    ) -> Predicted:
        """Pose of the platform, or of `tool` (N, 6) on it, counted from `tool_origin` (N, 6)."""
        return _poses(at.pose, tool, tool_origin, at.frame, at.origin)

    def dependences(self, data: InFit) -> Iterator[Dependence]:
        """The tool, where it is unknown."""
        if data.unknown_target:
            names = [""] * len(data.measured)
            nature = Nature("platform", pose=True)
            yield always("tool", "tool", PLACE, names, data.starts, nature=nature)

    def starts(self, machine: Any, sets: Sets, found: Found) -> None:
        """An unknown tool at the platform; `estimation.first_frames` aligns it with frames."""
        if any(data.unknown_target for data, _ in sets):
            found["tool", ""] = Start(tuple(range(6)), np.zeros(6))

    def frame(self, seen: Sighting) -> Laid:
        """The frame in which the poses are nearest."""
        return frame_of_poses(seen)

    def found_in(self, table: Table) -> list[str]:
        """A place and an orientation in any form."""
        there = not table.columns.keys().isdisjoint(_AXES)
        return [PLACE_TITLE] if there and is_turned(table.columns) else []

    def names(self, table: Table) -> set[str]:
        """A place, and the orientation in the form that is there."""
        return {*_AXES, *orientation_in(table.columns), *(name for name, _ in ANGLES)}


@dataclass(frozen=True, eq=False)
class Orientation(Reading):
    """Orientation of the platform, or of a sensor on it.

    Attributes
    ----------
    mounting : (3,) array
        Of a simulated sensor: its α β γ on the platform, rad.
    """

    mounting: ArrayLike = (0.0, 0.0, 0.0)

    name = "orientation"
    components = ANGLES
    turning: ClassVar[int | None] = 0
    framed = True
    frame_order: ClassVar[int] = 3
    starts_by_pose = True
    unknown_with_target = ("mounting",)
    truth = ("mounting",)

    def predict(self, at: At, mounting: FloatArray = _ORIGIN, **numbers: FloatArray) -> Predicted:
        """Orientation of the platform, or of a sensor at `mounting` (3,) or (N, 3) on it."""
        return _orientations(at.pose, mounting, at.frame, at.origin)

    def dependences(self, data: InFit) -> Iterator[Dependence]:
        """Return the sensor's mounting, where that is unknown."""
        if data.unknown_target:
            yield always("mounting", "mounting", ANGLES, [""] * len(data.measured), data.starts)

    def starts(self, machine: Any, sets: Sets, found: Found) -> None:
        """The mounting that fits the nominal machine best."""
        _mounted(sets, found, _of_orientations)

    def frame(self, seen: Sighting) -> Laid:
        """The frame in which the orientations are nearest."""
        return frame_of_poses(seen)

    def arguments(self, m: Measured) -> dict[str, FloatArray]:
        """The mounting as stated."""
        return {"mounting": as_rows("mounting", self.mounting, 3)[0][0]}

    def found_in(self, table: Table) -> list[str]:
        """An orientation in any form, without a place."""
        alone = table.columns.keys().isdisjoint(_AXES)
        return [PLACE_TITLE] if alone and is_turned(table.columns) else []


@dataclass(frozen=True, eq=False)
class Tilt(Orientation):
    """Tilt: how far a sensor's x and y axes point up; its mounting is not known.

    Attributes
    ----------
    mounting : (3,) array
        Of a simulated sensor: its α β γ on the platform, rad.
    """

    name = "tilt"
    components = (("tilt1", "rad"), ("tilt2", "rad"))
    turning = None
    frame_order = 4

    def frame(self, seen: Sighting) -> Laid:
        """Place the base as level as the robot file says."""
        return np.zeros(6), {}

    def predict(self, at: At, mounting: FloatArray = _ORIGIN, **numbers: FloatArray) -> Predicted:
        """Tilts of a sensor at `mounting` (3,) or (N, 3) on the platform, rad."""
        return _tilts(at.pose, mounting, at.frame, at.origin)

    def dependences(self, data: InFit) -> Iterator[Dependence]:
        """Return the sensor's mounting."""
        yield always("mounting", "mounting", ANGLES, [""] * len(data.measured), data.starts)

    def starts(self, machine: Any, sets: Sets, found: Found) -> None:
        """The mounting that fits the nominal machine best."""
        _mounted(sets, found, _of_tilts)

    def found_in(self, table: Table) -> list[str]:
        """Return where tilts are found in a table."""
        return Reading.found_in(self, table)


def _mounted(
    sets: Sets, found: Found, of: Callable[[FloatArray, FloatArray, bool], list[FloatArray]]
) -> None:
    """Find the mounting of a sensor: by orientations if any were read, else by tilts."""
    if ("mounting", "") in found:
        return
    values = np.concatenate([data.measured.values for data, _ in sets])
    pose = np.concatenate([pose for _, pose in sets])
    known = np.isfinite(values).all(axis=1) & np.isfinite(pose).all(axis=1)
    mountings = [np.zeros(3)]
    if known.any():
        mountings = of(values[known], pose[known, 3:], sets[0][0].unknown_frame)
    found["mounting", ""] = Start((0, 1, 2), mountings[0], others=tuple(mountings[1:]))


def _poses(
    pose: FloatArray,
    tool: FloatArray | None,
    tool_origin: FloatArray,
    frame: FloatArray | None,
    origin: FloatArray,
) -> Predicted:
    """Poses of the platform, or of a tool that is mounted on it."""
    whole = np.zeros_like(pose) if tool is None else compose(tool_origin, tool)
    place = points(pose, np.ascontiguousarray(whole[:, :3]), frame, origin)
    turned = _orientations(pose, None if tool is None else whole[:, 3:], frame, origin)
    by, by_frame = {}, None
    if tool is not None:  # its six numbers move and turn it in the axes of its origin
        outer = orientation.rotations(tool_origin[:, 3:])
        seen = place.by["target"] @ outer
        by["tool"] = np.zeros((len(pose), 6, 6))
        by["tool"][:, :3, :3] = seen
        by["tool"][:, 3:, 3:] = seen @ orientation.axes_of_angles(tool[:, 3:])
    if place.by_frame is not None and turned.by_frame is not None:
        by_frame = np.concatenate([place.by_frame, turned.by_frame], axis=1)
    return Predicted(
        np.concatenate([place.values, turned.values], axis=1),
        np.concatenate([place.by_twist, turned.by_twist], axis=1),
        by,
        by_frame=by_frame,
    )


def _orientations(
    pose: FloatArray, mounting: FloatArray | None, frame: FloatArray | None, origin: FloatArray
) -> Predicted:
    """Orientations of the platform, or of a sensor that is mounted on it."""
    carried = pose
    if mounting is not None:
        carried = compose(pose, np.hstack([np.zeros_like(mounting), mounting]))
    whole, by_angles = _frame_turning(frame, origin)
    seen = carried if frame is None else compose(compose(origin, frame[None])[0], carried)
    by_twist = np.zeros((len(pose), 3, 6))
    by_twist[:, :, :3] = whole
    by = {}
    if mounting is not None:
        axes = orientation.axes_of_angles(mounting.reshape(-1, 3))
        by["mounting"] = whole @ orientation.rotations(pose[:, 3:]) @ axes
    by_frame = None
    if frame is not None:
        by_frame = np.zeros((len(pose), 3, 6))
        by_frame[:, :, 3:] = by_angles
    return Predicted(seen[:, 3:], by_twist, by, by_frame=by_frame)


def _tilts(
    pose: FloatArray, mounting: FloatArray, frame: FloatArray | None, origin: FloatArray
) -> Predicted:
    whole, by_angles = _frame_turning(frame, origin)
    tilt, by_turn, by_mounting, by_up = instruments.tilts(pose, mounting, whole[2])
    by_twist = np.concatenate([by_turn, np.zeros_like(by_turn)], axis=2)
    by_frame = None
    if frame is not None:  # up = Rᵀ z, of R that turns by ω: Rᵀ (z × ω)
        by_frame = np.zeros((len(pose), 2, 6))
        by_frame[:, :, 3:] = by_up @ (whole.T @ np.cross(_UP, by_angles.T).T)
    return Predicted(tilt, by_twist, {"mounting": by_mounting}, by_frame=by_frame)


def _frame_turning(frame: FloatArray | None, origin: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the rotation from base to instrument (3, 3), and its turnings by the frame."""
    if frame is None:
        return np.eye(3), np.zeros((3, 3))
    outer = orientation.rotations(origin[None, 3:])[0]
    inner = orientation.rotations(frame[None, 3:])[0]
    by_angles: FloatArray = outer @ orientation.axes_of_angles(frame[None, 3:])[0]
    return outer @ inner, by_angles


def _of_orientations(values: FloatArray, turned: FloatArray, framed: bool) -> list[FloatArray]:
    """Mounting (3,) with which a sensor reads these orientations."""
    platform, sensor = orientation.rotations(turned), orientation.rotations(values)
    frame = np.eye(3)
    if framed:  # turnings from the first reading on do not depend on the mounting
        first = np.zeros(len(turned), dtype=np.intp)
        turnings = [orientation.between(each, each[first]) for each in (values, turned)]
        frame = of_directions(*turnings)
    mountings = platform.transpose(0, 2, 1) @ frame.T @ sensor
    return [angles_of(nearest_rotations(mountings.sum(axis=0)))]


def _of_tilts(values: FloatArray, turned: FloatArray, framed: bool) -> list[FloatArray]:
    """Mountings (3,) with which a sensor reads these tilts, whichever side up.

    The upright one first where the nominal machine cannot tell them apart.
    """
    up = orientation.rotations(turned)[:, 2, :]  # the vertical in platform axes
    level = np.sin(values)
    rest = np.sqrt(np.maximum(0.0, 1.0 - (level**2).sum(axis=1)))
    trials = []
    for side in (1.0, -1.0):
        seen = np.column_stack([level, side * rest])
        turn = of_directions(up, seen)
        trials.append((float(((seen @ turn.T - up) ** 2).sum()), turn))
    most = max(_ALIKE**2 * min(squares for squares, _ in trials), len(up) * _EXACT**2)
    return [angles_of(turn) for squares, turn in trials if squares <= most]
