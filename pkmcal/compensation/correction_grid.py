"""A table of corrections over the workspace, for controllers that can only add offsets."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from os import PathLike
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from pkmcal import display
from pkmcal.arguments import word
from pkmcal.arrays import BoolArray, FloatArray, as_numbers, as_rows, rms
from pkmcal.core.library import POSE
from pkmcal.exceptions import ArgumentError
from pkmcal.files.atomic import write_whole
from pkmcal.geometry.carried import Load
from pkmcal.kinematics.kinematics import Match
from pkmcal.kinematics.perturbed import ideal
from pkmcal.kinematics.reading_units import reading_units
from pkmcal.kinematics.robot import Robot, require_parallel
from pkmcal.kinematics.workspace import require_moved
from pkmcal.result import Result

Interpolation = Literal["linear", "cubic"]

METHODS: dict[Interpolation, int] = {"linear": 2, "cubic": 4}  # nodes an axis needs


@dataclass(frozen=True, eq=False, repr=False)
class CorrectionGrid(Result):
    """Corrections of the actuator commands at the nodes of a grid of poses.

    Attributes
    ----------
    coordinates : tuple of str
        The coordinates of the pose that span the grid; the others are those of `origin`.
    axes : tuple of ndarray
        The nodes along each coordinate, mm or rad, increasing.
    origin : ndarray (6,)
        The pose whose other coordinates hold all over the grid, mm and rad.
    corrections : ndarray (nodes…, n)
        ΔL to add to the commands of the uncalibrated machine, mm or rad; NaN where a limb cannot
        reach.
    method : {"linear", "cubic"}
        How `at` interpolates.
    error : ndarray (n,)
        Error of interpolation of each actuator, mm or rad: the largest at the places half-way
        between nodes, the middles of all edges, faces and cells. No bound: it is largest there
        where the correction bends evenly; cubic interpolation has been seen a quarter further off
        beside them, and what a drive law's table or harmonics do between the nodes is not seen.
    position_error, position_error_rms : float
        Error of the position at these places, mm, by interpolation alone: largest and root mean
        square.
    checked, reached : int
        How many such places there are, and at how many the correction is known.
    actuator_units : tuple of str
        Of the corrections, "mm" or "rad".
    """

    coordinates: tuple[str, ...]
    axes: tuple[FloatArray, ...]
    origin: FloatArray
    corrections: FloatArray
    method: Interpolation
    error: FloatArray
    position_error: float
    position_error_rms: float
    checked: int
    reached: int
    actuator_units: tuple[str, ...]

    def at(self, poses: ArrayLike) -> FloatArray:
        """Corrections at poses, interpolated.

        Parameters
        ----------
        poses : array_like (..., 6)
            mm and rad; of each only the grid's coordinates are read.

        Returns
        -------
        ndarray (..., n)
            To be added to the commands; NaN outside the grid and beside nodes out of reach.
        """
        rows, shape = as_rows("poses", poses, 6)
        places = [POSE.index(name) for name in self.coordinates]
        found = _interpolator(self.axes, self.corrections, self.method)(rows[:, places])
        return np.asarray(found).reshape(*shape, -1)

    def write(self, path: str | PathLike[str]) -> None:
        """Write the table as CSV, a node a line: its coordinates, and what to add there.

        Parameters
        ----------
        path : str or path
            Coordinates in mm and degrees, corrections in mm or rad. Comments state the other
            coordinates and the error of interpolation.
        """
        text = io.StringIO()
        text.write("".join(f"# {line}\n" for line in str(self).splitlines()))
        writer = csv.writer(text, lineterminator="\n")
        angle = [POSE.index(name) >= 3 for name in self.coordinates]
        units = ["deg" if turned else "mm" for turned in angle]
        writer.writerow([
            *(f"{name} [{unit}]" for name, unit in zip(self.coordinates, units, strict=True)),
            *(f"dq{i + 1} [{unit}]" for i, unit in enumerate(self.actuator_units)),
        ])  # fmt: skip
        nodes = _poses(self.coordinates, self.axes, self.origin)
        places = [POSE.index(name) for name in self.coordinates]
        for pose, dq in zip(
            nodes[:, places], self.corrections.reshape(len(nodes), -1), strict=True
        ):
            shown = (np.degrees(v) if a else v for v, a in zip(pose, angle, strict=True))
            writer.writerow([*(f"{v:.9g}" for v in shown), *(display.fixed(v, 6) for v in dq)])
        write_whole(path, text.getvalue())

    @property
    def failed(self) -> BoolArray:
        """Nodes without a correction (nodes…,): a limb of one machine cannot reach them."""
        return np.asarray(np.isnan(self.corrections).any(axis=-1))

    def failures(self) -> str:
        """Say how many nodes have no correction; empty where all have one."""
        failed = int(self.failed.sum())
        return f"{failed} of {self.failed.size} nodes have no correction" if failed else ""

    def _parts(self) -> Iterator[str | display.Table]:
        spans = ", ".join(
            f"{name} {len(nodes)} nodes"
            for name, nodes in zip(self.coordinates, self.axes, strict=True)
        )
        held = ", ".join(
            f"{name} {display.displayed(float(value), 'rad' if k >= 3 else 'mm')[0]:.6g}"
            for k, (name, value) in enumerate(zip(POSE, self.origin, strict=True))
            if name not in self.coordinates
        )
        worst = ", ".join(f"{value:.2g}" for value in self.error)
        yield f"corrections over {spans}; other coordinates {held or 'none'} (mm, deg)"
        yield (
            f"interpolation ({self.method}), checked half-way between nodes, at {self.reached} of"
            f" {self.checked} places: largest error of the position there"
            f" {self.position_error:.2g} mm, {self.position_error_rms:.2g} mm rms; of the actuators"
            f" {worst}"
        )
        if self.failures():
            yield self.failures()


def correction_grid(
    robot: Robot,
    calibrated: Robot,
    axes: Mapping[str, ArrayLike],
    *,
    method: Interpolation = "linear",
    origin: ArrayLike | None = None,
    match: Match = None,
    load: Load | None = None,
) -> CorrectionGrid:
    """Tabulate the difference of two machines' inverse kinematics over a grid of poses.

    Parameters
    ----------
    robot : Robot
        The machine as its controller has it.
    calibrated : Robot
        The machine as identified.
    axes : mapping of str to array_like
        Nodes along the coordinates that span the grid, mm or rad, increasing: those that the
        robot moves by itself, as for `workspace`.
    method : {"linear", "cubic"}
        How to interpolate; "cubic" needs a correction at every node.
    origin : array_like (6,), optional
        The other coordinates of the pose; the robot's home. Of poses that the robot cannot take,
        the coordinates that its file declares are kept (`Robot.complete`).
    match : bool or names of coordinates, optional
        Which coordinates the calibrated machine is to keep; see `Robot.inverse`.
    load : Load, optional
        What the calibrated machine carries all over the grid, one load, in place of the payload
        that its file states.

    Returns
    -------
    CorrectionGrid
        With the error of interpolation half-way between its nodes.

    Raises
    ------
    ValueError, TypeError
        A coordinate that the robot does not move by itself, nodes that do not increase, too few
        of them, none that both machines reach, a machine of other actuators.

    Examples
    --------
    >>> import pkmcal as pk
    >>> robot = pk.load("linear-delta")
    >>> found = correction_grid(
    ...     robot,
    ...     robot.replace({"offset1": robot.geometry["offset1"] + 0.1}),
    ...     {"x": [-40, 0, 40], "y": [-40, 0, 40]},
    ... )
    >>> found.at(robot.home).round(6) + 0.0
    array([-0.1,  0. ,  0. ])
    """
    word("method", method, METHODS)
    require_parallel(robot)
    require_parallel(calibrated, "calibrated")
    if calibrated.actuator_units != robot.actuator_units:
        raise ArgumentError(
            f"calibrated must have the actuators of {robot.name}, {len(robot.actuator_units)};"
            f" {calibrated.name} has {len(calibrated.actuator_units)}"
        )
    if load is not None:
        load.rows(())
        calibrated = calibrated.under(load)
    require_moved(robot, axes)
    names = tuple(sorted(axes, key=POSE.index))
    nodes = tuple(_nodes(name, axes[name], METHODS[method]) for name in names)
    base, shape = as_rows("origin", robot.home if origin is None else origin, 6)
    if shape:
        raise ArgumentError(f"origin must have shape (6,), found {(*shape, 6)}")

    def wanted(places: tuple[FloatArray, ...]) -> tuple[FloatArray, FloatArray, FloatArray]:
        aims = ideal(robot, _poses(names, places, base[0]))
        to_command = calibrated.inverse(aims.poses, match, near=aims.actuators)
        return aims.poses, aims.actuators, to_command - aims.actuators

    corrections = wanted(nodes)[2].reshape(*(len(axis) for axis in nodes), -1)
    unknown = int(np.isnan(corrections).any(axis=-1).sum())
    if unknown and method == "cubic":  # a spline goes through all nodes
        raise ArgumentError(
            f"axes: {unknown} of {corrections[..., 0].size} nodes have no correction and"
            " method 'cubic' needs all; take fewer nodes, or method 'linear'"
        )
    between = tuple(np.sort(np.r_[axis, 0.5 * (axis[1:] + axis[:-1])]) for axis in nodes)
    poses, commands, exact = wanted(between)
    places = np.stack(np.meshgrid(*between, indexing="ij"), axis=-1).reshape(-1, len(names))
    steps = np.indices([len(axis) for axis in between]).reshape(len(names), -1)
    halfway = (steps % 2).any(axis=0)  # and no node
    poses, commands, exact, places = (each[halfway] for each in (poses, commands, exact, places))
    found = np.asarray(_interpolator(nodes, corrections, method)(places))
    known = np.asarray(np.isfinite(found - exact).all(axis=1))
    if not known.any():
        raise ArgumentError("axes: the machines cannot take the poses half-way between the nodes")
    errors = np.abs(found - exact)[known]
    reached, aimed = (
        calibrated.forward(commands[known] + dq[known], guess=poses[known]).pose
        for dq in (found, exact)
    )
    missed = np.linalg.norm((reached - aimed)[:, :3], axis=1)
    return CorrectionGrid(
        coordinates=names,
        axes=nodes,
        origin=base[0],
        corrections=corrections,
        method=method,
        error=errors.max(axis=0),
        position_error=float(missed.max()),
        position_error_rms=rms(missed),
        checked=len(known),
        reached=int(known.sum()),
        actuator_units=reading_units(robot),
    )


def _interpolator(axes: tuple[FloatArray, ...], values: FloatArray, method: Interpolation) -> Any:
    from scipy.interpolate import RegularGridInterpolator

    interpolator: Any = RegularGridInterpolator
    return interpolator(axes, values, method, bounds_error=False, fill_value=np.nan)


def _poses(names: tuple[str, ...], axes: tuple[FloatArray, ...], origin: FloatArray) -> FloatArray:
    """Every node as a pose, the last coordinate fastest."""
    grid = np.meshgrid(*axes, indexing="ij")
    poses = np.tile(origin, (grid[0].size, 1))
    for name, values in zip(names, grid, strict=True):
        poses[:, POSE.index(name)] = values.ravel()
    return poses


def _nodes(name: str, given: ArrayLike, least: int) -> FloatArray:
    nodes = as_numbers(f"axes[{name!r}]", given, "nodes")
    if nodes.ndim != 1 or len(nodes) < least:
        raise ArgumentError(
            f"axes[{name!r}] needs at least {least} nodes, found shape {nodes.shape}"
        )
    if not (np.isfinite(nodes).all() and (np.diff(nodes) > 0).all()):
        raise ArgumentError(f"axes[{name!r}] must be finite and increase, found {nodes.tolist()}")
    return nodes.astype(np.float64)
