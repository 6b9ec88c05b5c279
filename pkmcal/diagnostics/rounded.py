"""Doubts from readings in steps: nothing measured, too few steps, an instrument at its stop."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.diagnostics.check import Check, Level, Remedy
from pkmcal.display import displayed
from pkmcal.estimation.coarse_readings import DITHERED, Coarse
from pkmcal.estimation.cut_readings import Cut
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.misfits import rounding_of
from pkmcal.estimation.uncertainty import ROUNDED
from pkmcal.fitted.row_names import row_names
from pkmcal.fitted.solution import Solution
from pkmcal.measurements.measurements import Measurements
from pkmcal.statistics.distributions import chi2_tail
from pkmcal.statistics.extremes import tied_extremes
from pkmcal.statistics.steps import LEAST_ROWS, step_of

_CHANCE = 1e-3  # of residuals as small, were rounding errors independent
_SIGNAL = 0.5  # of a step: deviation of what a fit changed, below which these errors are alike
_WIDER = 1.2  # times, from which wider ± are worth a word


# nothing was measured ---------------------------------------------------------------------------


def _nothing_measured(found: Solution) -> tuple[str, ...]:
    """Describe how exactly every reading is the nominal machine's; () if some are not."""
    start, equations = found.fit.start, found.fit.equations
    if found.fit.uncertainty.mixed or not equations.whitening.any_read or not start.ok:
        return ()
    reach = _reach_of_actuators(found, start)
    steps = []
    for i, m in enumerate(equations.table.sets):
        residual = start.residuals[i]
        values = m.values.reshape(residual.shape)
        own = np.array([step_of(values[:, k], unit) for k, unit in enumerate(m.units)])
        exact = rounding_of(m, start.robot.length, equations.mm[i])
        limit = _half(m, own) + reach[i] + ROUNDED * exact
        off = np.stack(
            [_but_for_a_shift(*each) for each in zip(values.T, residual.T, strict=True)], axis=1
        )
        if (np.abs(off) > limit).any():
            return ()
        steps += [_shown(step, unit) for step, unit in zip(own, m.units, strict=True) if step]
    return (max(steps, default=(0.0, ""))[1],)


def _half(measured: Measurements, steps: FloatArray) -> FloatArray:
    """Return the effect of rounding to steps (k,) on each component (k,): of angles, of a turn."""
    half = 0.5 * steps
    for family in measured.instrument.families:
        if family.unit == "rad":
            half[list(family.columns)] = half[list(family.columns)].sum()
    return half


def _but_for_a_shift(values: FloatArray, residual: FloatArray) -> FloatArray:
    """Residuals (N,) beside their median where all readings are equal: on a display, say.

    A machine that is off by as much everywhere shows no more than that.
    """
    read = np.isfinite(values)
    constant = read.sum() >= LEAST_ROWS and np.ptp(values[read]) == 0.0
    return residual - np.median(residual[read]) if constant else residual


def _shown(step: float, unit: str) -> tuple[float, str]:
    value, name = displayed(step, unit)
    return step, f"{value:.3g} {name}"


def _reach_of_actuators(found: Solution, at: Evaluation) -> list[FloatArray]:
    """Return how far half a step of all actuators moves each reading (N, k) of each set."""
    equations, units = found.fit.equations, at.robot.actuator_units
    read = equations.table.actuators
    half = np.array([0.5 * step_of(read[:, a], unit) for a, unit in enumerate(units)])
    table, reach = equations.table, []
    for i, residual in enumerate(at.residuals):
        whole, other = np.empty(residual.shape), table.other_of[i]
        for rows, seen in equations.prediction.lots_of(i, at):
            twists = at.machines.actuator_twists(at.states, table.pose_of[i][rows])
            whole[rows] = np.abs(seen.by_twist @ twists) @ half
            if other is not None and seen.by_other is not None:
                twists = at.machines.actuator_twists(at.states, other[rows])
                whole[rows] += np.abs(seen.by_other @ twists) @ half
        reach.append(whole)
    return reach


def _nothing_text(found: Solution, step: str) -> str:
    rounded = f", rounded to {step}" if step else ""
    return (
        f"nothing was measured: every reading is what the nominal machine has there{rounded}."
        " Where commanded values stand in place of measured ones, measure; where an instrument"
        " showed no more than that, take a finer one"
    )


# steps that are coarse beside the residuals -------------------------------------------------------


@dataclass(frozen=True)
class CoarseSteps:
    """A component whose residuals are no larger than rounding to its steps explains.

    Attributes
    ----------
    name, unit : str
        The component and its unit.
    coarse : Coarse
        Its step, and what the fit shows.
    alike : bool
        Whether rounding errors of different rows are alike, so that no mean is better than one.
    """

    name: str
    unit: str
    coarse: Coarse
    alike: bool


def _coarse_steps(found: Solution) -> Iterator[CoarseSteps]:
    fit = found.fit
    for each in fit.uncertainty.coarse:
        m = fit.equations.table.sets[each.set]
        yield CoarseSteps(
            m.components[each.component], m.units[each.component], each, _alike(found, each)
        )


def _alike(found: Solution, coarse: Coarse) -> bool:
    """Return whether rounding errors go together: they do not average out then."""
    if not coarse.residual < DITHERED * coarse.floor:
        return False  # noise spreads the readings over several steps
    values, fit = found.fit.equations.prediction.values, found.fit
    start, end = (values(each)[coarse.set] for each in (fit.start, fit.end))
    changed = (end - start)[:, coarse.component]
    if float(np.std(changed[np.isfinite(changed)])) < _SIGNAL * coarse.step:
        return True
    squares = coarse.freedom * (coarse.residual / coarse.floor) ** 2
    return 1.0 - chi2_tail(squares, coarse.freedom) < _CHANCE


def _level_of_steps(found: Solution, seen: CoarseSteps) -> Level | None:
    if seen.alike:
        return "doubt"
    return "remark" if seen.coarse.widening > _WIDER else None


def _steps_text(found: Solution, seen: CoarseSteps) -> str:
    step, floor, residual = (
        _shown(each, seen.unit)[1]
        for each in (seen.coarse.step, seen.coarse.floor, seen.coarse.residual)
    )
    what = f"readings of {seen.name} are multiples of {step}, and their residuals of {residual} are"
    if seen.alike:
        return (
            f"{what} less than such steps hide: rounding errors of different rows are alike, and"
            " many rows are no better than one; read finer, or over more of the workspace"
        )
    return f"{what} below the {floor} of rounding alone, which ± allow for"


# steps that were cut ------------------------------------------------------------------------------


def _cut(found: Solution) -> Iterator[Cut]:
    """Readings that were cut; those of which it cannot be told, where that matters."""
    sure = found.fit.uncertainty
    seen = [each for each in sure.cut if each.seen]
    if seen or not sure.known:
        yield from (max(each, key=lambda cut: cut.size / cut.deviation) for each in _by_set(seen))
        return
    noise = np.diagonal(sure.covariance.of(sure.reported))
    for several in _by_set([each for each in sure.cut if not each.refuted]):
        offsets = np.array([sure.reported @ each.error for each in several])
        with np.errstate(divide="ignore", invalid="ignore"):
            wider = np.sqrt(1.0 + (offsets**2).sum(axis=0) / noise)
        if np.nanmax(np.where(noise > 0.0, wider, np.nan), initial=0.0) > _WIDER:
            yield several[0]


def _by_set(several: Sequence[Cut]) -> list[list[Cut]]:
    return [
        [each for each in several if each.set == i]
        for i in dict.fromkeys(each.set for each in several)
    ]


def _cut_text(found: Solution, cut: Cut) -> str:
    m = found.fit.equations.table.sets[cut.set]
    named = [
        (m.components[each.component], m.units[each.component], each) for each in cut.components
    ]
    what = ", ".join(f"{name} ({_shown(each.step, unit)[1]})" for name, unit, each in named)
    if not cut.seen:
        return (
            f"whether readings in steps, {what}, were rounded or cut cannot be told from them: ±"
            " allow for half a step in all rows alike"
        )
    way = "towards zero" if cut.to_zero else "to the step below"
    return (
        f"readings in steps, {what}, are as if cut {way}, not rounded: they are off by"
        f" {cut.size:.2g} ± {cut.deviation:.1g} half steps; add half a step to what was cut"
    )


# readings at a stop -------------------------------------------------------------------------------


@dataclass(frozen=True)
class AtStop:
    """Readings that are all equal to the largest, or the smallest, of their component.

    Attributes
    ----------
    name, unit : str
        The component and its unit.
    value : float
        What was read.
    highest : bool
        Whether it is the largest.
    rows : tuple of int
        Where, by number.
    count : int
        Of how many rows.
    """

    name: str
    unit: str
    value: float
    highest: bool
    rows: tuple[int, ...]
    count: int


def _at_stop(found: Solution) -> Iterator[AtStop]:
    equations = found.fit.equations
    first = 0
    for m, pose in zip(equations.table.sets, equations.table.pose_of, strict=True):
        numbers = equations.table.rows[first : first + len(m)]
        first += len(m)
        values = m.values.reshape(len(m), -1)
        for k, (name, unit) in enumerate(zip(m.components, m.units, strict=True)):
            step = step_of(values[:, k], unit)
            for value, mine in tied_extremes(values[:, k], pose, step):
                yield AtStop(
                    name, unit, value, value == np.nanmax(values[:, k]),
                    tuple(numbers[mine].tolist()), len(m),
                )  # fmt: skip


def _stop_text(found: Solution, seen: AtStop) -> str:
    value, unit = displayed(seen.value, seen.unit)
    which = "highest" if seen.highest else "lowest"
    where = row_names(found.fit.equations.prediction.datasets, seen.rows)
    return (
        f"{len(seen.rows)} of {seen.count} readings of {seen.name} are {value:.6g} {unit}, the"
        f" {which} of all ({where}): was the instrument at its stop there? Leave them out,"
        f" {Remedy('drop', seen.rows)}, or measure with more room"
    )


CHECKS = (
    Check(
        name="nothing-measured",
        about="every reading is what the nominal machine shows, but for rounding",
        levels=("grave",), run=_nothing_measured, say=_nothing_text,
    ),
    Check(
        name="coarse-readings",
        about="residuals are smaller than the steps in which was read hide",
        unless=("nothing-measured",), levels=("doubt", "remark"), run=_coarse_steps,
        level_of=_level_of_steps, say=_steps_text,
    ),
    Check(
        name="cut-readings", about="readings in steps were cut, not rounded; or nothing tells it",
        unless=("nothing-measured",), levels=("doubt", "remark"), run=_cut,
        level_of=lambda found, cut: "doubt" if cut.seen else "remark", say=_cut_text,
    ),
    Check(
        name="at-stop", about="many readings equal the largest or the smallest one", run=_at_stop,
        unless=("nothing-measured",),
        say=_stop_text, remedies=lambda found, seen: (Remedy("drop", seen.rows),),
    ),
)  # fmt: skip
