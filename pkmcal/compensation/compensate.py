"""Corrections of the actuator commands that bring a machine to the desired poses (eq. 18)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import checked_seed, flag, instance, whole, word
from pkmcal.arrays import BoolArray, FloatArray, as_numbers, as_rows, rms
from pkmcal.core.swarm import PAPER, SwarmSettings, minimise_eq18
from pkmcal.display import Table, first_rows, fixed
from pkmcal.exceptions import ArgumentError
from pkmcal.kinematics.kinematics import Match
from pkmcal.kinematics.reading_units import reading_units
from pkmcal.kinematics.robot import Robot, require_parallel
from pkmcal.result import Result

Measured = ArrayLike | Callable[[FloatArray], ArrayLike]

Method = Literal["exact", "pso"]
Orientation = Literal["measured", "assumed", "from-position"]
_ASSUMED = {
    "measured": "orientation as measured",
    "assumed": "orientation assumed as desired: its error stays, taken for one of the position",
    "from-position": "beta from the position, the other angles assumed as desired",
}
_LISTED = 12  # a longer list of poses is printed with its middle left out


@dataclass(frozen=True, eq=False, repr=False)
class Compensation(Result):
    """Corrected commands, of poses of any leading shape; one that a limb cannot reach is NaN.

    Attributes
    ----------
    actuators : ndarray (..., n)
        What to command: the ideal commands with the correction added, mm or rad.
    correction : ndarray (..., n)
        ΔL of eq. 18, mm or rad.
    objective : ndarray (...)
        E of eq. 18 at the correction of the last pass: 0 for the exact method unless one
        correction serves all poses, and the remainder of the swarm.
    history : ndarray (..., passes) or (..., passes · (iterations + 1))
        Exact: E with the correction that was in force at each measurement, which is the error of
        the actuators' readings, as the ideal machine sees them. Of a swarm: its lowest E
        before the first and after every iteration, pass by pass; with one correction for all
        poses, the root mean square of E over them.
    gross : ndarray of bool (...)
        The error of the position exceeds ``robot.length``: not one of the geometry but of units,
        of the frame of the measurements, or of the order of their rows.
    method, orientation : str
        The arguments of these names.
    units : tuple of str, n
        Of the actuators, "mm" or "rad".
    """

    actuators: FloatArray
    correction: FloatArray
    objective: FloatArray
    history: FloatArray
    gross: BoolArray
    method: Method
    orientation: Orientation
    units: tuple[str, ...]

    @property
    def failed(self) -> BoolArray:
        """Rows without a command (...): a limb cannot reach the desired or the measured pose."""
        return np.asarray(np.isnan(self.actuators).any(axis=-1))

    def failures(self) -> str:
        """Say which rows have no command, or an implausible error; empty where there are none."""
        count, parts = self.gross.size, []
        for rows, why in (
            (self.failed, "have no command, because a limb cannot reach them"),
            (self.gross, "have implausible errors: check units, frame and order of the rows"),
        ):
            if rows.any():
                parts.append(
                    f"{rows.sum()} of {count} {why} (rows {first_rows(np.flatnonzero(rows))})"
                )
        return "; ".join(parts)

    def _parts(self) -> Iterator[str | Table]:
        count = self.gross.size
        title = f"{count} pose{'s' * (count != 1)}"
        history = self.history.reshape(count, -1)
        known = history[np.isfinite(history).all(axis=1)]
        if not len(known):
            yield f"{title}; no pose that was both desired and measured is within reach"
            return
        each = [rms(column) for column in known.T]
        unit = " and ".join(sorted(set(self.units)))
        if self.method == "exact":
            errors = ", ".join(f"{value:.3g}" for value in each)
            yield f"{title}; error {errors} {unit} (rms of the actuators, pass by pass)"
        else:
            yield f"{title}; swarm from {each[0]:.3g} to {each[-1]:.3g} {unit} (rms of E)"
        yield _ASSUMED[self.orientation]
        heads = ["row"]
        heads += [f"{q}{i} [{u}]" for q in ("q", "dq") for i, u in enumerate(self.units, 1)]
        columns = (each.reshape(count, -1) for each in (self.actuators, self.correction))
        rows = [
            [str(row), *(fixed(float(value), 4) for value in (*q, *dq))]
            for row, (q, dq) in enumerate(zip(*columns, strict=True))
        ]
        if len(rows) > _LISTED:
            rows[_LISTED - 4 : -3] = [["⋮"] * len(heads)]
        yield Table(heads, rows)
        if self.failures():
            yield self.failures()


def compensate(
    robot: Robot,
    desired: ArrayLike,
    measured: Measured,
    *,
    method: Method = "exact",
    orientation: Orientation = "measured",
    match: Match = None,
    common: bool = False,
    passes: int = 1,
    seed: int = 0,
    bounds: ArrayLike | None = None,
    swarm: SwarmSettings = PAPER,
) -> Compensation:
    """Correct the commands of a machine by the poses that were measured.

    Eq. 18 of the 2TPR&2TPS paper asks for the ΔL that makes E = √Σ(L* - L - ΔL)² least, with L*
    the actuators of the desired pose and L those of the measured one, both through the inverse
    kinematics of the ideal machine. Its minimiser is ΔL = L* - L.

    Parameters
    ----------
    robot : Robot
        The ideal machine: the one whose inverse kinematics makes the commands.
    desired : array_like (..., 6)
        Desired poses, mm and rad.
    measured : array_like (..., 6) or (..., 3), or callable
        Poses or positions that were reached with the ideal commands; or a function that takes
        commands (..., n), has them carried out and returns what was measured.
    method : {"exact", "pso"}
        The minimiser in closed form; or a particle swarm that looks for it (eq. 19), as published.
        The closed form gives the same answer without the swarm's remainder and in no time.
    orientation : {"measured", "assumed", "from-position"}
        Where the orientation of the measured pose comes from. "measured": from the six numbers.
        "assumed": it is the desired one. "from-position": of the 2TPR&2TPS, whose β follows from
        the position by x = z tan β (eq. 7); the other angles are the desired ones.
    match : bool or names of coordinates, optional
        Which coordinates count, as for `Robot.inverse`; all six by default. A real machine of
        fewer than six degrees of freedom leaves the manifold of the ideal one, and six numbers
        cannot all be met: then match as many as there are degrees of freedom, the position
        first, such as ("x", "y", "z", "alpha").
    common : bool
        One correction for all poses, the mean, in place of one for each.
    passes : int
        How often to measure and correct; more than once needs a callable.
    seed : int
        Of the swarms, from 0 to 2⁶⁴ - 1; not used by the exact method.
    bounds : array_like () or (n,), optional
        The swarm looks for the correction of a pass between minus and plus this, mm or rad; by
        default twice the largest difference L* - L of any pose.
    swarm : SwarmSettings
        Size and factors of the swarms; by default the paper's. `pkmcal.core.swarm.CONSTRICTION`
        are stable ones.

    Returns
    -------
    Compensation
        Corrected commands, corrections, and E pass by pass or iteration by iteration.

    Raises
    ------
    ValueError, TypeError
        An argument that does not fit.

    Examples
    --------
    >>> import pkmcal as pk
    >>> robot = pk.load("hexapod")
    >>> real = robot.replace({"offset1": 0.2})
    >>> found = pk.compensate(
    ...     robot, [[0, 0, 850, 0, 0, 0]], lambda q: real.forward(q).pose, passes=3
    ... )
    >>> found.correction.round(6) + 0.0
    array([[-0.2,  0. ,  0. ,  0. ,  0. ,  0. ]])
    """
    require_parallel(robot)
    word("method", method, get_args(Method))
    word("orientation", orientation, get_args(Orientation))
    flag("common", common)
    instance("swarm", swarm, SwarmSettings)
    if orientation == "from-position" and robot.model.map != "2tpr2tps":
        raise ArgumentError(
            "orientation='from-position' is for machines whose position determines their"
            f" orientation, those of the pose map 2tpr2tps; {robot.name} has the map"
            f" {robot.model.map}"
        )
    if whole("passes", passes, 1) > 1 and not callable(measured):
        raise ArgumentError("passes: more than one needs measured to be a function of the commands")
    poses, shape = as_rows("desired", desired, 6)
    if not len(poses):
        raise ArgumentError(f"desired must be at least one pose, found shape {(*shape, 6)}")
    ideal = robot.inverse(poses, match)
    seed = checked_seed(seed)
    half_width = None if bounds is None else _half_width(bounds, ideal.shape[1])
    correction = np.zeros_like(ideal)
    gross = np.zeros(len(poses), dtype=bool)
    history = []
    for _ in range(passes):
        sent = (ideal + correction).reshape(*shape, -1)
        reached: Any = measured(sent) if callable(measured) else measured
        at = _pose_of(reached, poses, shape, orientation)
        gross |= np.linalg.norm((at - poses)[:, :3], axis=1) > robot.length
        off = ideal - robot.inverse(at, match, near=ideal)  # at the turn that is commanded
        if common:
            off = about_their_mean(robot.turns, off)
        if method == "pso":
            step, of_pass = _by_swarm(off, common, half_width, seed, swarm)
        else:
            step = np.broadcast_to(_mean(off), off.shape) if common else off
            of_pass = np.linalg.norm(off, axis=1)[:, None]
        history.append(of_pass)
        correction = correction + step
    return Compensation(
        actuators=(ideal + correction).reshape(*shape, -1),
        correction=correction.reshape(*shape, -1),
        objective=np.linalg.norm(off - step, axis=1).reshape(shape),
        history=np.concatenate(history, axis=1).reshape(*shape, -1),
        gross=gross.reshape(shape),
        method=method,
        orientation=orientation,
        units=reading_units(robot),
    )


def about_their_mean(turns: FloatArray, off: FloatArray) -> FloatArray:
    """Differences (N, n) of angles at the turn nearest to their mean on the circle."""
    off, known = off.copy(), np.isfinite(off).all(axis=1)
    for i in np.flatnonzero(np.isfinite(turns)) if known.any() else ():
        to_angle = 2 * np.pi / turns[i]
        about = np.angle(np.exp(1j * to_angle * off[known, i]).mean()) / to_angle
        off[:, i] -= turns[i] * np.rint((off[:, i] - about) / turns[i])
    return off


def _mean(off: FloatArray) -> FloatArray:
    """Return the mean over the rows that were reached (n,); NaN where there is none."""
    reached = off[np.isfinite(off).all(axis=1)]
    mean: FloatArray = reached.mean(axis=0) if len(reached) else np.full(off.shape[1], np.nan)
    return mean


def _half_width(bounds: ArrayLike, n: int) -> FloatArray:
    given = as_numbers("bounds", bounds, n)
    if given.shape not in ((), (n,)):
        raise ArgumentError(f"bounds must be a number or have shape ({n},), found {bounds!r}")
    if not (np.isfinite(given) & (given > 0)).all():
        raise ArgumentError(f"bounds must be finite and positive, found {bounds!r}")
    return np.array(np.broadcast_to(given, (n,)), dtype=np.float64)


def _by_swarm(
    off: FloatArray,
    common: bool,
    half_width: FloatArray | None,
    seed: int,
    settings: SwarmSettings,
) -> tuple[FloatArray, FloatArray]:
    """Corrections (N, n) and the swarms' history (N, iterations + 1)."""
    reached = np.isfinite(off).all(axis=1)
    if half_width is None:
        widest = 2 * float(np.abs(off[reached]).max(initial=0.0))
        half_width = np.full(off.shape[1], widest)
    sets = off[None, reached] if common and reached.any() else off[:, None]
    step, history = minimise_eq18(settings, sets, half_width, seed)
    return (
        np.broadcast_to(step, off.shape),
        np.broadcast_to(history, (len(off), history.shape[1])),
    )


def _pose_of(
    reached: ArrayLike, desired: FloatArray, batch: tuple[int, ...], orientation: Orientation
) -> FloatArray:
    """The measured poses, their orientation from where `orientation` says."""
    given = as_numbers("measured", reached, 6)
    width = given.shape[-1] if given.ndim else 0
    if orientation != "measured" and width == 3:
        rows, shape = as_rows("measured", given, 3)
    elif width == 3:
        raise ArgumentError(
            "measured: positions do not determine the orientation; give poses (N, 6), or"
            " orientation='assumed'"
        )
    else:
        rows, shape = as_rows("measured", given, 6)
    if shape != batch:
        raise ArgumentError(
            f"measured must have one row for each of {len(desired)} poses, found {given.shape}"
        )
    if orientation == "measured":
        return rows
    pose: FloatArray = desired.copy()
    pose[:, :3] = rows[:, :3]
    if orientation == "from-position":
        pose[:, 4] = np.arctan2(pose[:, 0], pose[:, 2])
    return pose
