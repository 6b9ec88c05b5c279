"""Check whether poses that were measured again moved meanwhile: drift of machine or instrument."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.diagnostics.check import CHANCE
from pkmcal.display import chance_text
from pkmcal.effects.expansion import stated, temperatures
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.fit_data import FitData
from pkmcal.fitted.fit import Fit
from pkmcal.fitted.holdout import HeldOut
from pkmcal.measurements import repeats
from pkmcal.measurements.measurements import Measurements
from pkmcal.statistics.drift_test import LEAST, trend
from pkmcal.statistics.linear_fit import means, numbered

_HOUR = 3600.0  # s


@dataclass(frozen=True)
class Drift:
    """Drift of repeated poses, each from its first visit to its last.

    Attributes
    ----------
    components : tuple of str
        What was tested: x, y, z of positions.
    shift : tuple of float
        By how much each moved, mm; rad where angles alone were read.
    scatter : tuple of float
        Standard deviation of one visit of a pose beside that.
    chance : float
        How likely that is without drift, by the test of `statistics.drift_test`.
    poses, visits : int
        How many poses were measured again, and how often in all.
    hours : float
        How long that was, of the pose for which it was longest; NaN where the measurements have no
        time.
    temperatures : (float, float)
        The lowest and the highest of the machine, °C, where it was read and not allowed for; else
        NaN.
    """

    components: tuple[str, ...]
    shift: tuple[float, ...]
    scatter: tuple[float, ...]
    chance: float
    poses: int
    visits: int
    hours: float
    temperatures: tuple[float, float]

    @property
    def found(self) -> bool:
        """True if repeated poses drift."""
        return self.chance < CHANCE

    @property
    def large(self) -> bool:
        """True if repeated poses drift by more than single visits scatter."""
        return self.found and float(np.linalg.norm(self.shift)) > float(
            np.linalg.norm(self.scatter)
        )

    def __str__(self) -> str:
        times = f"measured {self.visits} times"
        which = f"a pose {times} drifts"
        if self.poses > 1:
            which = f"{self.poses} poses, {times} in all, drift"
        most = self.components[int(np.argmax(np.abs(self.shift)))]
        size = float(np.linalg.norm(self.shift))
        within = "" if np.isnan(self.hours) else f" within {self.hours:.2g} h"
        low, high = self.temperatures
        if np.isnan(low):
            advice = "let the machine warm up, or measure its temperature"
        else:
            advice = (
                f"its temperature went from {low:.3g} to {high:.3g} °C: state how it expands,"
                " --expansion (effects=[pk.Expansion(…)])"
            )
        along = "" if len(self.components) == 1 else f", most of it {most}"
        return (
            f"{which} by {size:.3g} mm{along}, from the first time to the last{within}"
            f" ({chance_text(self.chance)}): {advice}"
        )


@dataclass(frozen=True, eq=False)
class _Rows:
    """Rows of one set, fitted and held out, in the order in which they were measured."""

    values: FloatArray
    pose: IntArray
    target: IntArray
    time: FloatArray


def drift(fit: Fit, held: HeldOut, odd: Collection[int]) -> Drift | None:
    """Test repeated poses for drift; None where none was measured often enough.

    Parameters
    ----------
    fit : Fit
        Its residuals, which are without what actuators and temperature account for.
    held : HeldOut
        Rows that were held out, likewise.
    odd : collection of int
        Outliers, which are left out.
    """
    found = []
    equations = fit.equations
    apart = held.holdout_later is not None and not held.holdout_drawn
    for i, data in enumerate(equations.prediction.datasets):
        parts = [(data, fit.end.residuals[i])]
        if held.holdout_later is not None and held.holdout_end is not None and held.holdout_drawn:
            parts += _alike(held, held.holdout_end, i)
        found.append(_tested(parts, odd))
    if apart and held.holdout_later is not None and held.holdout_end is not None:
        for i in range(len(fit.equations.prediction.datasets)):
            found += [
                _tested([part], held.holdout_outliers) for part in _alike(held, held.holdout_end, i)
            ]
    known = [each for each in found if each is not None]
    return min(known, key=lambda each: each.chance, default=None)


def _alike(held: HeldOut, end: Evaluation, i: int) -> list[tuple[FitData, FloatArray]]:
    """The sets held out that are like fitted set `i`, with their residuals."""
    assert held.holdout_later is not None
    sets = zip(held.holdout_later.data, end.residuals, held.holdout_later.like, strict=True)
    return [(data, residual) for data, residual, like in sets if like == i]


def _tested(parts: Sequence[tuple[FitData, FloatArray]], odd: Collection[int]) -> Drift | None:
    measured = parts[0][0].measured
    lengths = [k for k, unit in enumerate(measured.units) if unit == "mm"]
    if not lengths:
        return None
    poses = [_poses(data.measured) for data, _ in parts]
    if sum(len(pose) - len(np.unique(pose)) for pose in poses) <= LEAST:
        return None
    rows = _rows(parts, poses, odd, lengths)
    if len(rows.pose) <= len(np.unique(rows.pose)) + LEAST:
        return None  # no visit is a second one, or too few are
    visit = _visits(rows)
    if not len(visit):
        return None
    place = numbered(rows.pose, rows.target)
    apart = rows.values - means(rows.values, place)[place]
    first = np.unique(visit, return_index=True)[1]
    found = trend(means(apart, visit), rows.pose[first], means(rows.time[:, None], visit)[:, 0])
    if found is None:
        return None
    pose = rows.pose[first]
    again = np.bincount(pose)[pose] > 1
    times = rows.time[first]
    span = max(float(np.ptp(times[pose == each])) for each in np.unique(pose[again]))
    timed = measured.time is not None
    return Drift(
        components=tuple(measured.components[k] for k in lengths),
        shift=tuple((found.slope * span).tolist()),
        scatter=tuple(found.scatter.tolist()),
        chance=found.chance,
        poses=len(np.unique(pose[again])),
        visits=int(again.sum()),
        hours=span / _HOUR if timed else float("nan"),
        temperatures=_unused([data for data, _ in parts]),
    )


def _rows(
    parts: Sequence[tuple[FitData, FloatArray]],
    poses_of: Sequence[IntArray],
    odd: Collection[int],
    lengths: Sequence[int],
) -> _Rows:
    first, values, poses, targets, times, order = 0, [], [], [], [], []
    for (data, residual), own in zip(parts, poses_of, strict=True):
        m, pose = data.measured, own + first
        first = int(pose.max()) + 1
        use = np.isfinite(residual[:, lengths]).all(axis=1) & ~np.isin(data.rows, list(odd))
        values.append(residual[use][:, lengths])
        poses.append(pose[use])
        targets.append(repeats.targets(m)[use])
        times.append((data.rows.astype(float) if m.time is None else m.time)[use])
        order.append(data.rows[use])
    by_time = np.lexsort((np.concatenate(order), np.concatenate(times)))
    return _Rows(*(np.concatenate(each)[by_time] for each in (values, poses, targets, times)))


def _poses(m: Measurements) -> IntArray:
    """The pose of each row (N,), of each session for itself."""
    if m.session is None:
        return m.pose_index
    return numbered(m.pose_index, np.unique(m.session, return_inverse=True)[1].reshape(-1))


def _visits(rows: _Rows) -> IntArray:
    """The visit of each row (N,): targets read in one go, or the machine comes back to a pose.

    Readings between which it was nowhere else are one visit, unless it never came back.
    """
    bursts = list(_bursts(rows.pose))
    count = np.bincount(rows.pose[[burst[0] for burst in bursts]]) if bursts else np.empty(0)
    visit = np.empty(len(rows.pose), dtype=np.intp)
    number = 0
    for burst in bursts:
        seen: set[int] = set()
        for row in burst:
            target = int(rows.target[row])
            if target in seen and count[rows.pose[row]] == 1:
                number, seen = number + 1, set()
            seen.add(target)
            visit[row] = number
        number += 1
    return visit


def _bursts(pose: IntArray) -> Iterator[range]:
    edges = np.flatnonzero(np.diff(pose, prepend=-1, append=-1))
    yield from (range(a, b) for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))


def _unused(sets: Sequence[FitData]) -> tuple[float, float]:
    """Between which temperatures the machine was, where that is not allowed for."""
    read = None if stated(sets[0].effects) else temperatures(data.measured for data in sets)
    return read or (float("nan"), float("nan"))
