"""Columns, beside the design, of causes that are not in the model."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import numpy as np

from pkmcal import screw
from pkmcal.arrays import BoolArray, FloatArray, IntArray, lots
from pkmcal.diagnostics.columns import of_actuators, of_poses, of_rows
from pkmcal.diagnostics.visits import visits_of
from pkmcal.effects.gears import Coupling, Harmonics
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.exceptions import ArgumentError
from pkmcal.fitted.fit import Fit
from pkmcal.fitted.held_numbers import bound_names, bound_numbers
from pkmcal.fitted.left_out import effect_columns
from pkmcal.fitted.solution import Solution
from pkmcal.geometry.stated_uncertainty import SCALE, StatedUncertainty
from pkmcal.kinematics.calibratable import Calibratable, as_arm
from pkmcal.readings.predicted import Predicted
from pkmcal.readings.reading import HeldNumbers
from pkmcal.statistics.linear_fit import column_basis
from pkmcal.statistics.score_test import Columns

LAG = "lag: readings before the machine stood still"
WARMING = "a machine that grew warmer in the course of measuring"
_BY_PLACE = 0.5  # of the order's variance that the place explains, from which both look alike
_LEAST_TRAVEL = 0.02  # of the machine's length, from which a place is more than an error
_WRIST = ((5, 4), (6, 4), (6, 5))  # joints that gears couple, and those by which
_LEAST_WAY = 1e-9  # of the machine's length, below which actuators have not moved


class Cause(NamedTuple):
    """A cause that is not in the model.

    Attributes
    ----------
    name : str
        As messages say it.
    cure : str
        What helps.
    columns : callable (fit) -> Columns or None
        Its columns; None where it cannot be.
    """

    name: str
    cure: str
    columns: Callable[[Fit], Columns | None]


def _by_all_actuators(fit: Fit, factors: FloatArray) -> Columns | None:
    """Columns of actuators that all become longer, by factors (K, d) of each pose."""
    count = _at(fit).actuators.shape[1]
    return of_actuators(fit, lambda poses: np.repeat(factors[poses][:, None, :], count, axis=1))


def _by_each_actuator(fit: Fit, factors: FloatArray) -> Columns | None:
    """Columns of each actuator that becomes longer, by factors (K, n) of each pose."""
    unit = np.eye(factors.shape[1])
    return of_actuators(fit, lambda poses: factors[poses][:, :, None] * unit)


def _at(fit: Fit) -> Evaluation:
    """The solution that the design is of: poses with unknowns where they fit best."""
    return fit.estimate.evaluation


def _travelled(fit: Fit, ways: FloatArray) -> BoolArray:
    """Along which axes (d,) the machine has travelled.

    Where it was to stay, as at the height at which a probe touches, its place is the error itself.
    """
    travelled: BoolArray = np.ptp(ways, axis=0) > _LEAST_TRAVEL * _at(fit).robot.length
    return travelled


def of_lag(fit: Fit, actuators: FloatArray, place: IntArray) -> Columns:
    """Readings that are off by a share of the way to other places.

    These are actuator readings, rows `place` (N,) of `actuators` (K, n).
    """
    table, end = fit.equations.table, _at(fit)
    first = np.cumsum([0, *map(len, table.sets)])

    def change(i: int, rows: slice, seen: Predicted) -> FloatArray:
        way = actuators[place[first[i] : first[i + 1]][rows]] - table.sets[i].actuators[rows]
        twists = end.machines.actuator_twists(end.states, table.pose_of[i][rows])
        return seen.by_twist @ (twists @ way[:, :, None])

    return of_rows(fit, change)


def _of_ways(found: Solution) -> Iterator[Cause]:
    """Causes by the way that the machine came to each pose, also from those that are held out."""
    visits, table = visits_of(found), found.fit.uncertainty.equations.table
    pose, fitted = np.concatenate(table.pose_of), visits.before < len(visits.before)
    way = np.zeros_like(table.actuators)
    way[pose] = table.actuators[pose] - visits.actuators[visits.before]
    before = np.full(len(way), -1)
    before[pose[fitted]] = pose[visits.before[fitted]]

    yield Cause(LAG, "wait longer before a reading", lambda fit: _lag(fit, way, before))
    yield Cause(
        "play of the drives or hysteresis of cables",
        "state approach and find drive*.backlash, or actuator_sigma",
        lambda fit: _play(fit, way),
    )


def _lag(fit: Fit, way: FloatArray, before: IntArray) -> Columns:
    """The platform was still on its way: a part of the way back to the pose before.

    Actuators came by `way` (K, n) from pose `before` (K,), which is -1 where it was held out.
    """
    end = _at(fit)
    twist = np.empty((len(before), 6))
    for own in lots(len(before)):
        back = screw.from_pose(end.pose[before[own]]) @ np.linalg.inv(
            screw.from_pose(end.pose[own])
        )
        twist[own, :3] = screw.log(back)[:, :3]
        twist[own, 3:] = end.pose[before[own], :3] - end.pose[own, :3]
    unknown = np.flatnonzero(before < 0)
    turned = end.machines.actuator_twists(end.states, unknown) @ way[unknown][:, :, None]
    twist[unknown] = -turned[:, :, 0]
    stayed = ~_travelled(fit, twist * np.repeat([end.robot.length, 1.0], 3))
    twist[:, stayed] = 0.0
    return of_poses(fit, lambda poses: twist[poses][:, :, None])


def _play(fit: Fit, way: FloatArray) -> Columns | None:
    """Each actuator stops short of where it was to go, by the direction it came from."""
    least = _LEAST_WAY * _at(fit).robot.length
    return _by_each_actuator(fit, np.sign(np.where(np.abs(way) > least, way, 0.0)))


def _warming(fit: Fit) -> Columns | None:
    """All actuators become longer alike while it is measured."""
    return _by_all_actuators(fit, _order(fit)[:, None])


def _order(fit: Fit) -> FloatArray:
    """When each pose (K,) was measured, or in which row."""
    equations, when = fit.uncertainty.equations, np.zeros(len(_at(fit).pose))
    for i, data in enumerate(equations.prediction.datasets):
        m = data.measured
        time = data.rows.astype(float) if m.time is None else m.time
        when[equations.table.pose_of[i]] = time
    return when


def place_after_place(fit: Fit) -> bool:
    """Return whether the order of measuring is much the same as the place, as of a raster."""
    place, when = _at(fit).pose[:, :3], _order(fit)
    place, when = place - place.mean(axis=0), when - when.mean()
    products = [place[:, i] * place[:, j] for i in range(3) for j in range(i, 3)]
    basis = column_basis(np.column_stack([np.ones(len(place)), place, *products]))
    freedom, whole = len(place) - basis.shape[1], float(when @ when)
    if freedom < 1 or not whole > 0.0:
        return False
    missed = when - basis @ (basis.T @ when)
    return bool(1.0 - float(missed @ missed) / freedom / (whole / (len(place) - 1)) > _BY_PLACE)


def _by_place(fit: Fit) -> Columns | None:
    """All actuators are longer by where the machine is: along x, y and z."""
    place = _at(fit).pose[:, :3] - _at(fit).pose[:, :3].mean(axis=0)
    return _by_all_actuators(fit, np.where(_travelled(fit, place), place, 0.0))


def _curved(fit: Fit) -> Columns | None:
    """Each actuator has an error that is quadratic in its reading."""
    q = fit.uncertainty.equations.table.actuators
    return _by_each_actuator(fit, (q - q.mean(axis=0)) ** 2)


def _sag(fit: Fit) -> Columns | None:
    """Each actuator yields to the weight of the platform, a force along -z at its origin.

    Arms yield to the weight of their links: a check of its own tests that at poses left out. Of
    surplus actuators forces do not follow from the weight alone.
    """
    if fit.parameters.robot.kind == "arm" or fit.uncertainty.mixed:
        return None
    end = _at(fit)

    def yielding(poses: IntArray) -> FloatArray:
        down = -end.machines.actuator_twists(end.states, poses)[:, 5]
        return down[:, :, None] * np.eye(down.shape[1])

    return of_actuators(fit, yielding)


def _numbers(stated: StatedUncertainty) -> Callable[[Fit], Columns | None]:
    """Columns of numbers that measurements could not move."""

    def columns(fit: Fit) -> Columns | None:
        if SCALE in stated.own and fit.uncertainty.mixed:
            return None  # effects need poses that follow from the actuators
        held = bound_numbers(fit.uncertainty, _at(fit), stated)
        return None if held is None else held.columns

    return columns


def _gains(fit: Fit) -> Columns | None:
    names = fit.parameters.robot.geometry.names
    if not any(re.fullmatch(r"gain\d+", name) for name in names):
        return None
    return _numbers(StatedUncertainty({"gain*": 1.0}))(fit)


def _lean(fit: Fit) -> Columns | None:
    """All targets sit elsewhere by the same: on the platform, where they are known."""
    bound = bound_names(fit.uncertainty, _at(fit))
    known = [
        any(
            each.role == each.argument == "target"
            and all(name in bound for own in each.estimated.values() for name in own.names)
            for each in data.dependences()
        )
        for data in fit.equations.prediction.datasets
    ]

    def change(i: int, rows: slice, seen: Predicted) -> FloatArray:
        if known[i] and "target" in seen.by:
            return seen.by["target"]
        return np.zeros((*seen.values.shape, 3))

    return of_rows(fit, change) if any(known) else None


def _joints(fit: Fit) -> Columns | None:
    names = fit.parameters.robot.geometry.names
    kinds = [p for p in ("base*", "platform*", "rod*", "crank*") if _some(p, names)]
    if not kinds:
        return None
    return _numbers(StatedUncertainty(dict.fromkeys(kinds, 1.0)))(fit)


def _some(pattern: str, names: object) -> bool:
    stem = pattern.rstrip("*")
    return any(re.match(rf"{stem}\d", name) for name in names)  # type: ignore[attr-defined]


def _of_arm(fit: Fit) -> Iterator[Cause]:
    """Causes of an arm: a wave a turn of each joint, and each coupling of its wrist.

    One by one, since a test of many numbers is weak where one of them is wrong. Joints that follow
    others do so by a ratio that may be wrong, which looks like waves of both.
    """
    for cause, ratio in ratios_of_followers(fit.parameters.robot):
        yield Cause(cause, f"--effects {ratio.option}", _of_effect(ratio))
    waves = waves_a_turn(fit.parameters.robot)
    for wave in waves:
        name = f"an eccentric encoder or a tilted axis of joint {wave.joints}: a wave a turn"
        yield Cause(name, f"--effects {wave.option}", _of_effect(wave))
    for joint, other in _WRIST if waves else ():
        coupled = Coupling(((joint, other),))
        name = f"coupled joints of the wrist: joint {joint} turns along with joint {other}"
        yield Cause(name, f"--effects {coupled.option}", _of_effect(coupled))


def ratios_of_followers(machine: Calibratable) -> list[tuple[str, Coupling]]:
    """Ratios by which joints follow others, as causes and as effects that find how wrong."""
    arm = as_arm(machine)
    table = {} if arm is None else arm.followers.table() or {}
    return [
        (f"a wrong ratio by which joint {joint} follows joint {other}", Coupling(((joint, other),)))
        for joint, leaders in table.items()
        for other in leaders
    ]


def waves_a_turn(machine: Calibratable) -> list[Harmonics]:
    """A wave a turn of each joint of an arm that turns; none of another machine."""
    arm = as_arm(machine)
    kinds = () if arm is None else arm.kinds
    return [Harmonics(1, joints=i) for i, kind in enumerate(kinds, 1) if kind == "revolute"]


def _of_effect(effect: Harmonics | Coupling) -> Callable[[Fit], Columns | None]:
    """Columns of an effect of an arm's gears."""

    def columns(fit: Fit) -> Columns | None:
        try:
            return effect_columns(fit, [effect.of_machine(fit.parameters.robot)])
        except ArgumentError:  # fewer joints than it has, or the fit has these numbers
            return None

    return columns


def _of_instruments(fit: Fit) -> Iterator[Cause]:
    """Causes that instruments have: numbers of theirs that the fit holds."""
    kinds = {type(data.measured.instrument) for data in fit.equations.prediction.datasets}
    for each in dict.fromkeys(held for kind in kinds for held in kind.held):
        yield Cause(each.name, each.cure, columns_of_held(each))


def columns_of_held(held: HeldNumbers) -> Callable[[Fit], Columns | None]:
    """Columns of instruments' numbers, all moved alike, in sets that do not look for them."""

    def columns(fit: Fit) -> Columns | None:
        known = [
            held in data.measured.instrument.held
            and all(
                not any(np.isin(held.slots, own.slots).any() for own in each.estimated.values())
                for each in data.dependences()
                if each.argument == held.argument
            )
            for data in fit.equations.prediction.datasets
        ]

        def change(i: int, rows: slice, seen: Predicted) -> FloatArray:
            if known[i] and held.argument in seen.by:
                return seen.by[held.argument][:, :, list(held.slots)]
            return np.zeros((*seen.values.shape, len(held.slots)))

        return of_rows(fit, change) if any(known) else None

    return columns


CAUSES = (
    Cause(
        WARMING,
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
)  # fmt: skip


def possible(found: Solution) -> Iterator[tuple[Cause, Columns]]:
    """All causes and their columns in this fit."""
    fit = found.fit
    several = (*_of_ways(found), *CAUSES, *_of_instruments(fit), *_of_arm(fit))
    yield from _with_columns(fit, several)


def of_instruments_alone(found: Solution) -> Iterator[tuple[Cause, Columns]]:
    """The causes of instruments and their columns in this fit."""
    yield from _with_columns(found.fit, _of_instruments(found.fit))


def _with_columns(fit: Fit, several: Iterable[Cause]) -> Iterator[tuple[Cause, Columns]]:
    for cause in several:
        yield cause, _made_anew(cause, fit)


def _made_anew(cause: Cause, fit: Fit) -> Columns:
    """Columns of a cause that hold nothing between passes; none where it cannot be."""

    def columns() -> Iterator[tuple[slice, FloatArray]]:
        own = cause.columns(fit)
        if own is not None:
            yield from own()

    return columns


def usable(end: Evaluation) -> bool:
    """Return whether all poses are solved."""
    return bool((end.status == 0).all())
