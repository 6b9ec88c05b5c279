"""What causes that are not in the model would do to the readings: columns beside the design."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from pkmcal import screw
from pkmcal.arrays import BoolArray, FloatArray, IntArray
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.fitted.fit import Fit
from pkmcal.fitted.held_numbers import held_numbers
from pkmcal.geometry.stated_uncertainty import SCALE, StatedUncertainty

_LEAST_TRAVEL = 0.02  # of the machine's length, from which a place is more than an error
_LEAST_WAY = 1e-9  # of the machine's length, below which actuators have not moved


class Cause(NamedTuple):
    """One cause.

    Attributes
    ----------
    name : str
        As messages say it.
    cure : str
        What helps.
    columns : callable (fit) -> ndarray (M, d) or None
        Its columns, whitened; None where it cannot be.
    """

    name: str
    cure: str
    columns: Callable[[Fit], FloatArray | None]


def _moved(fit: Fit, twists: FloatArray) -> FloatArray:
    """Whitened readings (M, d) of a platform that moves by twists (K, 6, d) of its poses."""
    equations, sure = fit.equations, fit.uncertainty
    table, parts = equations.table, []
    for i, seen in enumerate(equations.prediction.predicted(fit.end)):
        part = seen.by_twist @ twists[table.pose_of[i]]
        other = table.other_of[i]
        if seen.by_other is not None and other is not None:
            part = part + seen.by_other @ twists[other]
        parts.append(part)
    return sure.equations.whitening.whitened(parts, sure.factors)


def _by_actuators(fit: Fit) -> FloatArray:
    """Twists (K, 6, n) of the platform by its actuators."""
    return fit.end.machines.actuator_twists(fit.end.states)


def _before(fit: Fit) -> IntArray:
    """The pose from which the machine came to each, in the order of measuring; itself at first."""
    equations = fit.equations
    before = np.arange(len(fit.end.pose))
    for i, data in enumerate(equations.prediction.datasets):
        m, pose = data.measured, equations.table.pose_of[i]
        time = np.arange(len(m)) if m.time is None else m.time
        session = (
            np.zeros(len(m)) if m.session is None else np.unique(m.session, return_inverse=True)[1]
        )
        order = np.lexsort((time, session))
        last, current, own = -1, -1, -1.0
        for row in order.tolist():
            if session[row] != own:
                last, current, own = -1, -1, session[row]
            if pose[row] != current:
                last, current = current, int(pose[row])
            if last >= 0:
                before[current] = last
    return before


def _travelled(fit: Fit, ways: FloatArray) -> BoolArray:
    """Along which axes (d,) the machine has travelled.

    Where it was to stay, as at the height at which a probe touches, its place is the error itself.
    """
    travelled: BoolArray = np.ptp(ways, axis=0) > _LEAST_TRAVEL * fit.end.robot.length
    return travelled


def _lag(fit: Fit) -> FloatArray | None:
    """The platform was still on its way: a part of the way back to the pose before."""
    before, motions = _before(fit), screw.from_pose(fit.end.pose)
    back = motions[before] @ np.linalg.inv(motions)
    turn = screw.log(back)[:, :3]
    way = fit.end.pose[before, :3] - fit.end.pose[:, :3]
    twist = np.concatenate([turn, way], axis=1)
    arcs = twist * np.repeat([fit.end.robot.length, 1.0], 3)
    return _moved(fit, np.where(_travelled(fit, arcs), twist, 0.0)[:, :, None])


def _play(fit: Fit) -> FloatArray | None:
    """Each actuator stops short of where it was to go, by the direction it came from."""
    q = fit.end.actuators
    way = q - q[_before(fit)]
    sign = np.sign(np.where(np.abs(way) > _LEAST_WAY * fit.end.robot.length, way, 0.0))
    return _moved(fit, _by_actuators(fit) * sign[:, None, :])


def _warming(fit: Fit) -> FloatArray | None:
    """All actuators become longer alike while it is measured."""
    equations, count = fit.equations, len(fit.end.pose)
    when = np.zeros(count)
    for i, data in enumerate(equations.prediction.datasets):
        m = data.measured
        time = data.rows.astype(float) if m.time is None else m.time
        when[equations.table.pose_of[i]] = time
    return _moved(fit, _by_actuators(fit).sum(axis=2, keepdims=True) * when[:, None, None])


def _by_place(fit: Fit) -> FloatArray | None:
    """All actuators are longer by where the machine is: along x, y and z."""
    place = fit.end.pose[:, :3] - fit.end.pose[:, :3].mean(axis=0)
    place = np.where(_travelled(fit, place), place, 0.0)
    return _moved(fit, _by_actuators(fit).sum(axis=2, keepdims=True) * place[:, None, :])


def _curved(fit: Fit) -> FloatArray | None:
    """Each actuator has an error that is quadratic in its reading."""
    off = fit.end.actuators - fit.end.actuators.mean(axis=0)
    return _moved(fit, _by_actuators(fit) * off[:, None, :] ** 2)


def _sag(fit: Fit) -> FloatArray | None:
    """Each actuator yields to the weight of the platform, a force along -z at its origin."""
    twists = _by_actuators(fit)
    return _moved(fit, twists * -twists[:, 5:6, :])


def _numbers(stated: StatedUncertainty) -> Callable[[Fit], FloatArray | None]:
    """Columns of numbers that the fit held."""

    def columns(fit: Fit) -> FloatArray | None:
        held = held_numbers(fit.uncertainty, fit.end, stated)
        return None if held is None else held.columns

    return columns


def _gains(fit: Fit) -> FloatArray | None:
    names = fit.parameters.robot.geometry.names
    if not any(re.fullmatch(r"gain\d+", name) for name in names):
        return None
    return _numbers(StatedUncertainty({"gain*": 1.0}))(fit)


def _lean(fit: Fit) -> FloatArray | None:
    """All targets sit elsewhere by the same: on the platform, where they are known."""
    sure, parts = fit.uncertainty, []
    for data, seen in zip(
        fit.equations.prediction.datasets, fit.equations.prediction.predicted(fit.end), strict=True
    ):
        known = any(
            each.role == each.argument == "target" and not each.estimated
            for each in data.dependences()
        )
        shape = (*seen.values.shape, 3)
        parts.append(seen.by["target"] if known and "target" in seen.by else np.zeros(shape))
    if not any(part.any() for part in parts):
        return None
    return sure.equations.whitening.whitened(parts, sure.factors)


def _joints(fit: Fit) -> FloatArray | None:
    names = fit.parameters.robot.geometry.names
    kinds = [p for p in ("base*", "platform*", "rod*", "crank*") if _some(p, names)]
    if not kinds:
        return None
    return _numbers(StatedUncertainty(dict.fromkeys(kinds, 1.0)))(fit)


def _some(pattern: str, names: object) -> bool:
    stem = pattern.rstrip("*")
    return any(re.match(rf"{stem}\d", name) for name in names)  # type: ignore[attr-defined]


CAUSES = (
    Cause("lag: readings before the machine stood still", "wait longer before a reading", _lag),
    Cause(
        "play of the drives", "state approach and find drive*.backlash, or actuator_sigma", _play
    ),
    Cause(
        "a machine that grew warmer in the course of measuring",
        "warm it up, or repeat poses and find offsets per session",
        _warming,
    ),
    Cause("warmth by place", "let the machine settle at each place", _by_place),
    Cause("a curved law of the drives", "find drive*.quadratic or a table of each", _curved),
    Cause(
        "sag under the platform's weight", "state stiffness and mass, and find compliances", _sag
    ),
    Cause("gains", "--free 'gain*' beside the others, or --uncertainty 'gain*=…'", _gains),
    Cause(
        "the scale of the instrument",
        "--uncertainty scale=… (uncertainty={'scale': …})",
        _numbers(StatedUncertainty({SCALE: 1.0})),
    ),
    Cause("targets elsewhere on the platform", "--target unknown (unknown='target')", _lean),
    Cause("joints elsewhere", "--free them, or --uncertainty 'base*=…'", _joints),
)


def possible(fit: Fit) -> Iterator[tuple[Cause, FloatArray]]:
    """The causes that there may be in this fit, and their columns."""
    for cause in CAUSES:
        columns = cause.columns(fit)
        if columns is not None and columns.any():
            yield cause, columns


def usable(end: Evaluation) -> bool:
    """Whether all poses are solved."""
    return bool((end.status == 0).all())
