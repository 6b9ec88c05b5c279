"""Rows that were read almost where another was, with almost the same error.

Rows with equal actuators are of one pose and share what the model misses there. Those of almost
equal ones count as poses of their own: copies with other digits, or a pose that was read again
before the machine had left it, then make ± too small and a hold-out too good.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray
from pkmcal.diagnostics.check import Check, at_most_one
from pkmcal.display import chance_text, first_rows
from pkmcal.estimation.row_blocks import RowBlocks
from pkmcal.fitted.solution import Solution
from pkmcal.measurements import repeats
from pkmcal.statistics.distributions import f_tail
from pkmcal.statistics.linear_fit import numbered

_NEAR = 1e-3  # of the spread of every actuator, within which rows are near
_LEAST = 5  # such rows
_CHANCE = 1e-4  # of differences as small, were errors independent
_HARMLESS = 0.5  # times as large as those of independent errors, below which it matters …
_COPIED = 0.1  # … and they are copies: a model that is wrong alike shows more
_DISTINCT = 0.5  # of the readings: all touches of a plate read the same


@dataclass(frozen=True)
class NearCopies:
    """Rows that are near others.

    Attributes
    ----------
    rows : tuple of int
        The later ones by number.
    share : float
        Deviation of what readings or residuals differ by, over that of independent errors: equal
        readings are as unlikely, wherever the machine went meanwhile.
    chance : float
        How likely a share as small would be if they were independent.
    """

    rows: tuple[int, ...]
    share: float
    chance: float


def near_copies(found: Solution) -> NearCopies | None:
    """Find rows near others, if their residuals are alike."""
    sure = found.fit.uncertainty
    if sure.mixed or sure.rounded or not sure.equations.whitening.any_read:
        return None
    first, later = _pairs(found)
    if len(later) < _LEAST or not sure.fit.freedom > 0:
        return None
    table, end = sure.equations.table, found.fit.end
    values = [m.values.reshape(r.shape) for m, r in zip(table.sets, end.residuals, strict=True)]
    alone = 2.0 * float(np.square(sure.fit.residual).sum()) / sure.fit.freedom
    seen = []
    for errors in (sure.fit.residual, sure.equations.whitening.whitened(values, sure.factors)):
        for family in np.unique(sure.blocks.family):
            mine = sure.blocks.family == family
            one, other = (_by_row(sure.blocks, mine, errors, rows) for rows in (first, later))
            apart = (other - one)[np.isfinite(other - one).any(axis=1)]
            if len(apart) < _LEAST or len(np.unique(one, axis=0)) < _DISTINCT * len(one):
                continue
            count = int(np.isfinite(apart).sum())
            ratio = float(np.nansum(apart**2)) / count / alone
            seen.append((ratio, f_tail(1.0 / max(ratio, 1e-300), sure.fit.freedom, count)))
    if not seen:
        return None
    ratio, chance = min(seen)
    chance, share = min(1.0, len(seen) * chance), float(np.sqrt(ratio))
    rows = np.unique(table.rows[later]).tolist()
    return (
        NearCopies(tuple(rows), share, chance) if chance < _CHANCE and share < _HARMLESS else None
    )


def _by_row(blocks: RowBlocks, mine: BoolArray, errors: FloatArray, rows: IntArray) -> FloatArray:
    """Errors of some equations (M,) by rows (n,) and component, NaN where there are none."""
    column = numbered(blocks.component)
    table = np.full((int(max(blocks.row.max(), rows.max())) + 1, int(column.max()) + 1), np.nan)
    table[blocks.row[mine], column[mine]] = errors[mine]
    return table[rows]


def _pairs(found: Solution) -> tuple[IntArray, IntArray]:
    """Rows near one another, of the same set and target but not at the same actuators."""
    from scipy.spatial import cKDTree

    firsts, laters, start = [np.zeros(0, np.intp)], [np.zeros(0, np.intp)], 0
    for m in found.fit.uncertainty.equations.table.sets:
        at = m.actuators if m.other is None else np.hstack([m.actuators, m.other])
        spread = at.std(axis=0)
        at = at[:, spread > 0.0] / spread[spread > 0.0]
        target = repeats.targets(m)
        for each in np.unique(target) if at.shape[1] and m.components else ():
            mine = np.flatnonzero(target == each)
            off, nearest = cKDTree(at[mine]).query(at[mine], k=min(2, len(mine)), p=np.inf)
            if len(mine) < 2:
                continue
            near = (off[:, 1] > 0.0) & (off[:, 1] < _NEAR)
            pair = np.sort(np.column_stack([mine[near], mine[nearest[near, 1]]]), axis=1)
            pair = np.unique(pair, axis=0) + start
            firsts.append(pair[:, 0])
            laters.append(pair[:, 1])
        start += len(m)
    return np.concatenate(firsts), np.concatenate(laters)


def _text(found: Solution, seen: NearCopies) -> str:
    return (
        f"{len(seen.rows)} rows are almost at the actuators of another"
        f" ({first_rows(list(seen.rows), 6)}), and what was read there differs by"
        f" {seen.share:.2g} of what independent errors do ({chance_text(seen.chance)}):"
        " copied, or one pose read again. They count as poses of their own, so ± are too small;"
        " give them the actuators of the other row, or leave them out"
    )


CHECKS = (
    Check(
        name="near-copies", about="rows almost where another was read have almost the same error",
        unless=("grave", "copies"), levels=("doubt", "remark"),
        run=lambda found: at_most_one(near_copies(found)),
        level_of=lambda found, seen: "doubt" if seen.share < _COPIED else "remark", say=_text,
    ),
)  # fmt: skip
