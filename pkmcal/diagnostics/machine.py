"""Check whether what was found is a machine as it can be: sizes, strokes, assembly modes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from pkmcal.arguments import instance
from pkmcal.arrays import BoolArray, FloatArray, IntArray, rms
from pkmcal.diagnostics.check import Check, Remedy, at_most_one
from pkmcal.display import displayed, first_rows, printable
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.identifiability import listed
from pkmcal.estimation.machine_size import sizes
from pkmcal.estimation.mode_slips import in_other_modes
from pkmcal.fitted.solution import Solution
from pkmcal.geometry.elastic import is_kinematic
from pkmcal.kinematics.calibratable import Calibratable, as_arm, as_parallel
from pkmcal.kinematics.robot import Robot
from pkmcal.readings.unknowns import PLAIN
from pkmcal.statistics.distributions import t_factor

FAR = 0.25  # share of the machine's size by which errors of manufacture do not move a parameter
_BEYOND = 0.01  # share of a stroke by which errors of a machine may carry it beyond its ends
_SHRUNK = 0.02  # share of its size by which errors of manufacture do not shrink a machine
_REMOTE = 3.0  # times a machine's reach within which a point of its platform is


def far_numbers(found: Solution) -> dict[str, float]:
    """Numbers of the geometry that moved further than errors of manufacture explain, and how far.

    In mm at the machine; numbers of a load, and of what yields, may be anything.
    """
    chosen = found.fit.parameters
    change = found.fit.estimate.evaluation.theta - found.fit.start.theta
    moved = np.abs(change / chosen.scale)[chosen.geometry]
    moved[[not is_kinematic(name) for name in chosen.names[chosen.geometry]]] = 0.0
    far = np.flatnonzero(moved > FAR * sizes(found.fit.equations)[chosen.geometry])
    return {chosen.names[i]: float(moved[i]) for i in far}


def _surely_far(found: Solution) -> dict[str, float]:
    """Return `far_numbers` that are far wherever within their ± they are.

    What readings hardly tell may end far away without a fault, and its ± says so.
    """
    far = far_numbers(found)
    if not far:
        return far
    names, scale = found.fit.parameters.names, found.fit.parameters.scale
    half = np.ptp(found.interval95, axis=1) / 2.0
    if np.isinf(half).any():
        half = np.where(np.isfinite(half), half, _of_what_is_told(found))
    own = dict(zip(found.free, half.tolist(), strict=True))
    reach = FAR * sizes(found.fit.equations)
    return {
        name: moved
        for name, moved in far.items()
        if not np.isfinite(own.get(name, 0.0))
        or moved - own.get(name, 0.0) / scale[names.index(name)] > reach[names.index(name)]
    }


def _of_what_is_told(found: Solution) -> FloatArray:
    """Half widths (n,) of intervals of what was determined of each number.

    Of one that is determined together with others alone a part moved; the other is as it was.
    """
    sure = found.fit.uncertainty
    told = np.sqrt(np.maximum(np.diagonal(sure.matrix), 0.0))
    factor = t_factor(sure.freedom)
    shown = np.isfinite(factor)
    half = np.full(len(told), np.inf)
    half[shown] = factor[shown] * told[shown]
    return half[found.columns]


def _far_text(found: Solution, moved: dict[str, float]) -> str:
    """Say how far numbers moved: in their unit, or in mm at the machine where they have several."""
    chosen, most = found.fit.parameters, max(moved, key=lambda name: moved[name])
    units = {chosen.units[chosen.names.index(name)] for name in moved}
    value, unit = moved[most], "mm"
    if units == {"rad"}:
        value, unit = displayed(value * chosen.scale[chosen.names.index(most)], "rad")
    return (
        f"{listed(list(moved))} moved by up to {value:.3g} {unit}, further than errors of a"
        " machine: check that the robot file describes this one, or free fewer parameters"
    )


class DistantPoint(NamedTuple):
    """A point of the platform, and how far from its origin it was found, mm."""

    role: str
    name: str
    distance: float


def _platform_size(found: Solution) -> float:
    """Return the largest distance of a platform point from its origin that is possible, mm."""
    robot = found.fit.parameters.robot
    reach = float(np.linalg.norm(found.fit.end.pose[:, :3], axis=1).max())
    geometry = robot.geometry
    lengths = np.abs(geometry.values[np.array(geometry.units) == "mm"]).max(initial=0.0)
    return _REMOTE * max(reach, robot.length, float(lengths))


def _distant_points(found: Solution) -> Iterator[DistantPoint]:
    """Points that were looked for near the platform and found far away.

    Poses that hardly turn do not determine where a target is; noise may then carry it anywhere.
    On an arm without lengths a target may be anywhere.
    """
    arm = as_arm(found.fit.parameters.robot)
    if arm is not None and arm.without_lengths:
        return
    parameters, theta = found.fit.parameters, found.fit.end.theta
    size = _platform_size(found)
    for (role, point), number in parameters.nuisance.items():
        if parameters.natures.get((role, point), PLAIN).point_of != "platform":
            continue
        for first in np.flatnonzero(parameters.number_of == number).tolist():
            place = theta[first : first + 3]
            moved = float(np.linalg.norm(place - parameters.start[first : first + 3]))
            far = float(np.linalg.norm(place))
            if min(moved, far) > size:
                behind = parameters.names[first].partition("@")[2]
                name = f"{point} of {printable(behind)}" if behind else point
                yield DistantPoint(role, name, far)


def _distant_text(found: Solution, point: DistantPoint) -> str:
    return (
        f"{point.role} {point.name} was found {point.distance:.3g} mm from the platform's origin,"
        f" beyond the machine's size ({_platform_size(found):.0f} mm): measure poses that turn"
        " more, or state where it is"
    )


def _shrunk(found: Solution) -> tuple[float, ...]:
    """Return the share by which poses moved closer, where touches alone state the size.

    Touches of a point, a line or a plane do not: a smaller machine makes all their misfits smaller.
    """
    fit = found.fit
    sets = fit.equations.table.sets
    pairs = zip(sets, fit.equations.table.pose_of, strict=True)
    touching = [place for measured, place in pairs if measured.instrument.shrinks]
    lengths = any(set(m.instrument.units) - {"rad"} for m in sets if not m.instrument.shrinks)
    if lengths or not touching:
        return ()
    rows = np.concatenate(touching)
    spans = []
    for evaluation in (fit.start, fit.end):
        places = evaluation.pose[rows, :3]
        spans.append(rms(np.linalg.norm(places - places.mean(axis=0), axis=1)))
    share = 1.0 - spans[1] / spans[0]
    return () if share < _SHRUNK else (share,)


class OutOfStroke(NamedTuple):
    """Rows with actuators out of stroke; the limbs, with the least and the most of each."""

    rows: tuple[int, ...]
    limbs: dict[int, tuple[float, float]]


def _out_of_stroke(found: Solution) -> tuple[OutOfStroke, ...]:
    """Rows whose actuators are out of the strokes that the robot file states.

    Both with the nominal machine, whose offsets may be unknown, and with the identified one,
    which may have been misled.
    """
    start, end, equations = found.fit.start, found.fit.end, found.fit.equations
    robot = as_parallel(start.robot)
    if robot is None or all(limb.stroke is None for limb in robot.model.limbs):
        return ()  # the file of an arm states no strokes
    out = _beyond(robot, _drives(end))
    if not out.any():
        return ()
    drive = _drives(start)
    out &= _beyond(robot, drive)
    limbs = {
        i: (float(drive[out[:, i], i].min()), float(drive[out[:, i], i].max()))
        for i in np.flatnonzero(out.any(axis=0)).tolist()
    }
    broken = np.asarray(out.any(axis=1))[np.concatenate(equations.table.pose_of)]
    return at_most_one(
        OutOfStroke(tuple(equations.table.rows[broken].tolist()), limbs) if limbs else None
    )


def _out_of_stroke_text(found: Solution, seen: OutOfStroke) -> str:
    robot = instance("robot", found.fit.start.robot, Robot)
    limbs = []
    for i, (least, most) in seen.limbs.items():
        low, high = robot.model.limbs[i].stroke or (0.0, 0.0)
        limbs.append(
            f"limb {i + 1} at {least:.4g} to {most:.4g}, its stroke is {low:g} to {high:g}"
        )
    more = f" and {len(limbs) - 2} more limbs" if len(limbs) > 2 else ""
    return (
        f"actuators out of stroke in {len(seen.rows)} of {len(found.fit.equations.table.rows)} rows"
        f" (rows {first_rows(seen.rows, 10)}): {'; '.join(limbs[:2])}{more}; check units,"
        " signs and columns of the actuators, or the strokes in the robot file"
    )


def _drives(evaluation: Evaluation) -> FloatArray:
    """The way of the first drive of each limb at the poses, (K, limbs), 0 of none.

    Each of its session's machine.
    """

    def ways(machine: Calibratable, own: IntArray) -> FloatArray:
        robot = instance("robot", machine, Robot)
        inward = robot.frames.inward(evaluation.pose[own])
        first = np.array(robot.model.mechanism.first_drives)
        every = robot.machine.drives_at(robot.slots, inward)
        return np.where(first >= 0, every[:, np.maximum(first, 0)], 0.0)

    return evaluation.machines.joined(ways)


def _beyond(robot: Robot, drive: FloatArray) -> BoolArray:
    """Mark the drives (K, limbs) that are beyond their strokes by more than errors explain."""
    strokes = [limb.stroke or (-np.inf, np.inf) for limb in robot.model.limbs]
    low, high = np.array(strokes).T
    room = np.where(np.isfinite(low), _BEYOND * (high - low), 0.0)
    out: BoolArray = (drive < low - room) | (drive > high + room)
    return out


CHECKS = (
    Check(
        name="implausible-changes",
        about="numbers moved further than errors of manufacture explain", unless=("unit-errors",),
        at_once=True, run=lambda found: at_most_one(_surely_far(found) or None),
        say=_far_text,
        remedies=lambda found, moved: (Remedy("fix", tuple(moved)),),
    ),
    Check(
        name="other-modes",
        about="rows fit another assembly mode than the one that the fit has for them", at_once=True,
        run=lambda found: in_other_modes(found.fit.equations, found.fit.end),
        say=lambda found, text: text,
    ),
    Check(
        name="distant-points", about="points of the platform were found far away from it",
        at_once=True, run=_distant_points, say=_distant_text,
    ),
    Check(
        name="shrunk", about="a machine of which only touches were read became smaller",
        at_once=True, run=_shrunk,
        say=lambda found, share: (
            f"the poses lie {100 * share:.2g} % closer together than before: touches alone do not"
            " say how large a machine is, state touch_distances or measure a length as well"
        ),
    ),
    Check(
        name="beyond-strokes", about="actuators are out of the strokes that the robot file states",
        at_once=True, run=_out_of_stroke, say=_out_of_stroke_text,
    ),
)  # fmt: skip
