"""Shifts of parameters between fitted data and later data.

Both are described by common parameters and, one after the other, a shift of the parameter that
lowers the sum of squares most, as long as its score test says so (G. C. Chow, Tests of equality
between sets of coefficients in two linear regressions, Econometrica 28 (1960); tests by cluster as
in `clusters`). Model errors shift parameters too, where the poses differ: shifts are therefore
sought only if the first brings the later data nearer, and named only if they are a good part of the
disagreement. Smaller ones are estimated along, for the sizes of those that are named lean on them;
so are the others of their kind, whether or not they are found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import FloatArray, IntArray, largest_first
from pkmcal.statistics.clusters import Sandwich
from pkmcal.statistics.distributions import f_tail
from pkmcal.statistics.linear_fit import ROUNDING, LinearFit, column_basis, triangle
from pkmcal.statistics.prior_test import data_alone
from pkmcal.statistics.score_test import LEFT
from pkmcal.statistics.singular_values import svd

_CHANCE = 0.01  # among all candidates, below which one has shifted …
_SHARE, _FALL = 0.05, 0.03  # … if it is so much of the disagreement, and the rms falls so much
_EQUAL = 1e-6  # share by which drops and chances differ that are not equal
# Drop in units of the variance by which candidates differ that can be told apart: χ² of one degree
# of freedom, exceeded by chance in 1 of 100.
TOLD_APART = 6.63
_FEW = 30  # equations up to which clusters are too few for their own variances
_TOLD = 0.01  # share of the others of a kind that must be left of each, to be estimated along


@dataclass(frozen=True, eq=False)
class Shift:
    """One candidate that shifted.

    Attributes
    ----------
    candidate : int
        Which.
    size, deviation : ndarray (d,)
        Of the shift along each of its directions, with all shifts taken.
    chance : float
        How likely its effect would be without a shift, among so many candidates.
    also : tuple of int
        Candidates that would explain the same as well.
    rms : float
        Of the later data after it.
    """

    candidate: int
    size: FloatArray
    deviation: FloatArray
    chance: float
    also: tuple[int, ...]
    rms: float


@dataclass(frozen=True, eq=False)
class _Trial:
    candidate: int
    drop: float
    chance: float
    basis: FloatArray


@dataclass(frozen=True, eq=False)
class _Taken:
    trial: _Trial
    also: tuple[int, ...]
    rms: float
    named: bool


def shifted(
    first: tuple[FloatArray, FloatArray, IntArray],
    later: tuple[FloatArray, FloatArray, IntArray],
    basis: FloatArray,
    candidates: Sequence[FloatArray],
    most: int = 8,
) -> list[Shift]:
    """Search forward for shifts.

    Parameters
    ----------
    first, later : (ndarray (M, n), ndarray (M,), ndarray of int (M,))
        Whitened Jacobian, residuals at the fit of the first data, and the cluster of each equation.
    basis : ndarray (n, p)
        Combinations that are fitted.
    candidates : sequence of ndarray (n, d)
        Directions of the parameters that each candidate may shift.
    most : int
        Shifts to look for.
    """
    (x1, r1, c1), (x2, r2, c2) = first, later
    y = np.concatenate([r1, r2])
    late = np.arange(len(y)) >= len(r1)
    cluster = np.concatenate([c1, c2 + c1.max() + 1])
    common = column_basis(np.vstack([x1, x2]) @ basis)
    apart = data_alone(x1 @ basis, r1)[0] + data_alone(x2 @ basis, r2)[0]
    zero = np.zeros(len(r1))
    raw = [  # column by column, so that those of a kind are to the last bit those alone
        np.column_stack([np.concatenate([zero, x2 @ column]) for column in d.T]) for d in candidates
    ]
    few = len(y) <= _FEW
    taken: list[_Taken] = []
    disagreement = None
    while len(taken) < most:
        left = y - common @ (common.T @ y)
        now = float(left @ left)
        disagreement = now - apart if disagreement is None else disagreement
        done = {each.trial.candidate for each in taken}
        trials = [
            trial
            for j, columns in enumerate(raw)
            if j not in done and (trial := _trial(j, columns, common, y, left)) is not None
        ]
        if not trials:
            break
        best = _best(trials, few, left, common, cluster)
        share = best.drop / max(disagreement, 1e-300)
        after = left - best.basis @ (best.basis.T @ left)
        fall = 1.0 - np.sqrt((after[late] ** 2).sum() / max((left[late] ** 2).sum(), 1e-300))
        if not best.chance * len(trials) < _CHANCE:
            break
        named = few or share >= _SHARE
        if not taken and not (named and (few or fall >= _FALL)):
            break
        freedom = max(len(y) - common.shape[1] - best.basis.shape[1], 1)
        variance = (now - best.drop) / freedom
        same = best.basis.shape[1]
        also = tuple(
            other.candidate
            for other in (trials[i] for i in _most(trials))
            if other.candidate != best.candidate
            and other.basis.shape[1] <= same
            and best.drop - other.drop < TOLD_APART * variance
        )
        common = np.column_stack([common, best.basis])
        rms = float(np.sqrt((after[late] ** 2).mean()))
        chance = min(1.0, best.chance * len(trials))
        trial = _Trial(best.candidate, best.drop, chance, best.basis)
        taken.append(_Taken(trial, also, rms, named))
    design = np.vstack([x1, x2]) @ basis
    found = _together(taken, raw, design, y, cluster, few)
    return found if few else _each_of_its_kind(found, raw, design, y, cluster)


def _trial(
    j: int, columns: FloatArray, common: FloatArray, y: FloatArray, left: FloatArray
) -> _Trial | None:
    """Return the fall of the sum of squares by candidate `j`; None if it adds nothing."""
    beside = columns - common @ (common.T @ columns)
    turn, singular, _ = svd(beside)
    basis = turn[:, singular > LEFT * float(np.linalg.norm(columns))]
    freedom = len(y) - common.shape[1] - basis.shape[1]
    if not basis.shape[1] or freedom < 1:
        return None
    drop = float(((basis.T @ y) ** 2).sum())
    rest = max(float(left @ left) - drop, 0.0) / freedom
    ratio = drop / basis.shape[1] / rest if rest > 0 else np.inf
    return _Trial(j, drop, f_tail(min(ratio, 1e300), basis.shape[1], freedom), basis)


def _most(trials: Sequence[_Trial]) -> IntArray:
    """Order of candidates by what they explain; of those alike, as they come."""
    drops = np.array([trial.drop for trial in trials])
    return largest_first(drops, _EQUAL * float(drops.max()))


def _best(
    trials: Sequence[_Trial], few: bool, left: FloatArray, common: FloatArray, cluster: IntArray
) -> _Trial:
    """The candidate that explains most, and its chance by cluster where there are enough."""
    if few:
        least = min(trial.chance for trial in trials) * (1 + _EQUAL)
        alike = [trial for trial in trials if trial.chance <= least]
        return alike[int(_most(alike)[0])]
    alone = [trial for trial in trials if trial.basis.shape[1] == 1] or list(trials)
    best = alone[int(_most(alone)[0])]
    design = np.column_stack([common, best.basis])
    after = left - best.basis @ (best.basis.T @ left)
    sandwich = Sandwich(_fit(design, after, cluster))
    contrast = np.eye(design.shape[1])[-1:]
    freedom = float(sandwich.freedom(contrast)[0])
    variance = float(sandwich.data[-1, -1])
    chance = f_tail(best.drop / variance, 1, freedom) if variance > 0 and freedom > 0 else 1.0
    return _Trial(best.candidate, best.drop, chance, best.basis)


def _together(
    taken: Sequence[_Taken],
    raw: Sequence[FloatArray],
    design: FloatArray,
    y: FloatArray,
    cluster: IntArray,
    few: bool,
) -> list[Shift]:
    """Sizes and deviations of those named, estimated with all and with the common parameters."""
    if not taken:
        return []
    named = [each for each in taken if each.named]
    columns = [raw[each.trial.candidate] for each in named]
    n = design.shape[1]
    whole = np.hstack([design, *columns])
    if not few:
        whole = np.hstack([whole, _beside(columns, raw, whole)])
    for each in taken:
        along = raw[each.trial.candidate]
        if not each.named and _left(along, whole) > LEFT:  # else it is told by the others
            whole = np.hstack([whole, along])
    _, singular, rows = svd(triangle(whole))
    keep = singular > ROUNDING * singular[0]
    half = rows[keep].T / singular[keep]
    basis = whole @ half
    solution = half @ (basis.T @ y)
    fit = _fit(basis, y - basis @ (basis.T @ y), cluster)
    if few:
        freedom = max(fit.freedom, 1.0)
        matrix = fit.squares / freedom * half @ half.T
    else:
        matrix = half @ Sandwich(fit).data @ half.T
    deviation = np.sqrt(np.maximum(np.diagonal(matrix), 0.0))
    found, start = [], n
    for each, part in zip(named, columns, strict=True):
        mine, trial = slice(start, start + part.shape[1]), each.trial
        start = mine.stop
        size = solution[mine], deviation[mine]
        found.append(Shift(trial.candidate, *size, trial.chance, each.also, each.rms))
    return found


def _each_of_its_kind(
    found: list[Shift],
    raw: Sequence[FloatArray],
    design: FloatArray,
    y: FloatArray,
    cluster: IntArray,
) -> list[Shift]:
    """Add the other numbers of a kind that shifted, where one of them is named.

    The search ends at a share of the disagreement; once a kind has shifted, its others are tested
    with all of the kind free. So are all of them where a shift of all alike was found beside that
    of one, whose sizes are then parts of what each shifted by. Nothing changes where the numbers of
    the kind cannot be told apart.
    """
    single = {each.tobytes(): j for j, each in enumerate(raw) if each.shape[1] == 1}
    for kind in (each for each in raw if each.shape[1] > 1):
        own = [j for column in kind.T if (j := single.get(column.tobytes())) is not None]
        first = next((each for each in found if each.candidate in own), None)
        if first is None or len(own) < kind.shape[1] or not _left(kind, design) > _TOLD:
            continue
        solution, deviation, freedom = _estimated(np.hstack([design, kind]), y, cluster)
        n = design.shape[1]
        chances = [
            min(1.0, len(own) * f_tail(float((solution[k] / deviation[k]) ** 2), 1, freedom[k]))
            for k in range(n, len(solution))
        ]
        together = [
            each
            for each in found
            if each.candidate not in own and _is_of_all(raw[each.candidate], kind)
        ]
        kept = [each for each in found if each not in together]
        if together:
            kept = [each for each in kept if each.candidate not in own]
        there = {each.candidate for each in kept}
        others = [
            Shift(j, solution[[n + k]], deviation[[n + k]], chances[k], (), first.rms)
            for k, j in enumerate(own)
            if j not in there and chances[k] < _CHANCE
        ]
        others.sort(key=lambda each: -abs(float(each.size[0])))
        found = [*others, *kept] if together else [*kept, *others]
    return found


def _is_of_all(candidate: FloatArray, kind: FloatArray) -> bool:
    """Return whether a candidate is the shift of all numbers of a kind, alike or each its own."""
    whole = kind.sum(axis=1, keepdims=True) if candidate.shape[1] == 1 else kind
    if candidate.shape != whole.shape:
        return False
    return bool(np.linalg.norm(candidate - whole) <= LEFT * np.linalg.norm(whole))


def _estimated(
    whole: FloatArray, y: FloatArray, cluster: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Least squares: sizes, their deviations by cluster, and the degrees of freedom of these."""
    _, singular, rows = svd(triangle(whole))
    keep = singular > ROUNDING * singular[0]
    half = rows[keep].T / singular[keep]
    basis = whole @ half
    solution = half @ (basis.T @ y)
    sandwich = Sandwich(_fit(basis, y - basis @ (basis.T @ y), cluster))
    variance = np.maximum(np.diagonal(half @ sandwich.data @ half.T), 0.0)
    return solution, np.sqrt(variance), sandwich.freedom(half)


def _beside(
    columns: Sequence[FloatArray], raw: Sequence[FloatArray], whole: FloatArray
) -> FloatArray:
    """Return other shifts of a kind in which several shifted.

    Each may be too small to be found, or a shift of all alike is found in their place, beside which
    one that is named has shifted by less than its own. Nothing where they cannot be told apart.
    """
    found = {column.tobytes() for each in columns for column in each.T}
    others = {
        column.tobytes(): column
        for each in raw
        if each.shape[1] > 1 and found & {column.tobytes() for column in each.T}
        for column in each.T
        if column.tobytes() not in found
    }
    if not others:
        return whole[:, :0]
    beside = np.column_stack(list(others.values()))
    return beside if _left(beside, whole) > _TOLD else whole[:, :0]


def _left(columns: FloatArray, whole: FloatArray) -> float:
    """Share of columns that is left, beside others, of the combination that these take most of."""
    common = column_basis(whole)
    singular = svd(columns - common @ (common.T @ columns))[1]
    return float(singular[-1]) / float(np.linalg.norm(columns))


def _fit(design: FloatArray, residual: FloatArray, cluster: IntArray) -> LinearFit:
    p = design.shape[1]
    return LinearFit(design, residual, np.zeros((0, p)), np.eye(p), cluster, np.zeros_like(cluster))
