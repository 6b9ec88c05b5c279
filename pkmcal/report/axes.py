"""Deviations of a machine along and about each axis of its base, scored after two standards."""

from __future__ import annotations

from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray, IntArray, rms
from pkmcal.calibration.identification import Identification
from pkmcal.measurements.iso230 import axis_performance
from pkmcal.measurements.iso9283 import SIGMAS
from pkmcal.measurements.repeats import targets
from pkmcal.statistics.linear_fit import numbered

_AXES = (("x", "mm"), ("y", "mm"), ("z", "mm"), ("a", "rad"), ("b", "rad"), ("c", "rad"))
_FLAT = 1e-6  # of the largest singular value: targets on a line do not show how a platform turns


def axes(found: Identification) -> list[dict[str, Any]]:
    """Score each axis, and turning about each, before and after; without outliers.

    Turning is seen in poses, and in positions of three targets or more that are not on a line.
    E, A and R are ISO 230-2's; mean, the mean size of the deviation of a pose, and spread, three
    standard deviations, are ISO 9283's of an angle (7.2.1, 7.2.2).
    """
    equations, ends = found.fit.equations, (found.fit.start, found.fit.end)
    by_twists = [[seen.by_twist for seen in equations.prediction.predicted(at)] for at in ends]
    before, after = list[FloatArray](), list[FloatArray]()
    poses = list[IntArray]()
    for i, measured in enumerate(equations.table.sets):
        if not measured.instrument.is_place:
            continue
        rows = equations.table.rows[equations.table.set_of == i]
        good = np.isfinite(measured.values).all(axis=1) & ~np.isin(rows, found.outliers)
        run = _runs(equations.table.pose_of[i], targets(measured))
        run[~good] = -1
        if not good.any():  # partly read rows alone
            continue
        first, last = (
            _deviations(at.residuals[i], by_twist[i], run)
            for at, by_twist in zip(ends, by_twists, strict=True)
        )
        before.append(first)
        after.append(last)
        kept = np.array([np.flatnonzero(run == k)[0] for k in np.unique(run[run >= 0])])
        poses.append(equations.table.pose_of[i][kept] + 1_000_000 * i)
    if not before or not sum(map(len, before)):
        return []
    first, last = np.concatenate(before), np.concatenate(after)
    pose = numbered(np.concatenate(poses))
    table = []
    for k, (name, unit) in enumerate(_AXES):
        seen = np.isfinite(first[:, k]) & np.isfinite(last[:, k])
        if not seen.any():
            continue
        row: dict[str, Any] = {"name": name, "unit": unit}
        for when, values in (("before", first[seen, k]), ("after", last[seen, k])):
            scored = axis_performance(values, pose[seen])
            row[f"E_{when}"], row[f"A_{when}"] = scored.systematic, scored.accuracy
            row[f"R_{when}"] = scored.repeatability
            row[f"mean_{when}"] = _mean_size(values, pose[seen])
            row[f"rms_{when}"] = rms(values)
            row["targets"], row["repeated"] = scored.targets, scored.repeated
            row["spread"] = SIGMAS / 4.0 * scored.repeatability
        table.append(row)
    return table


def _mean_size(values: FloatArray, pose: IntArray) -> float:
    """Mean over poses of the size of the mean deviation."""
    _, group, count = np.unique(pose, return_inverse=True, return_counts=True)
    return float(np.abs(np.bincount(group, values) / count).mean())


def _runs(pose: IntArray, target: IntArray) -> IntArray:
    """Number of the run of each row (N,): rows of different targets at one pose are one."""
    order, seen = np.zeros(len(pose), dtype=np.intp), dict[tuple[int, int], int]()
    for row, key in enumerate(zip(pose.tolist(), target.tolist(), strict=True)):
        order[row] = seen.get(key, 0)
        seen[key] = order[row] + 1
    return numbered(pose, order)


def _deviations(residual: FloatArray, by_twist: FloatArray, run: IntArray) -> FloatArray:
    """Shift and turning (R, 6) in base axes of each run, mm and rad; NaN where not seen."""
    found = []
    for k in np.unique(run[run >= 0]):
        rows = np.flatnonzero(run == k)
        turn = by_twist[rows[0], :3, 3:]  # from base axes to those that were read in
        out = np.full(6, np.nan)
        out[:3] = (residual[rows, :3] @ turn).mean(axis=0)
        if residual.shape[1] == 6:
            out[3:] = residual[rows, 3:].mean(axis=0) @ turn
        else:
            design = by_twist[rows, :3].reshape(-1, 6)
            design = np.hstack([design[:, 3:], design[:, :3]])
            size = np.linalg.norm(design[:, 3:]) / np.linalg.norm(design[:, :3])
            scaled = design / [1, 1, 1, size, size, size] if size > 0 else design
            if len(rows) > 2 and np.linalg.cond(scaled) < 1.0 / _FLAT:
                twist = np.linalg.lstsq(design, residual[rows, :3].ravel(), rcond=None)[0]
                out[3:] = twist[3:]
        found.append(out)
    return np.array(found).reshape(-1, 6)
