"""Rows that are left out of a calibration: named by the user, or outliers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal

import numpy as np

from pkmcal.arguments import did_you_mean, shown
from pkmcal.arrays import BoolArray, IntArray
from pkmcal.estimation.begin import estimator_at
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.estimate import Estimate
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.pose_minima import solved_in_least_minima
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.fitted.outliers import LARGE, outliers

Found = Literal["outliers", "slack"]
Drop = Found | Sequence[int | Found] | None
FOUND: tuple[Found, ...] = ("outliers", "slack")
_FEW = 0.25  # share of the rows; where more disagree it is rather units or columns
_WANTED = "'outliers', 'slack' or numbers of rows"


def left_out(drop: Drop, count: int) -> tuple[tuple[int, ...], bool, bool]:
    """Return the rows that `drop` names, of measurements with so many rows.

    Returns
    -------
    rows : tuple of int
        Rows by number.
    outliers, slack : bool
        Whether outliers are left out, and readings of slack cables.

    Raises
    ------
    ValueError, TypeError
        No row of the measurements, no such word.
    """
    if drop is not None and not isinstance(drop, str | Iterable):
        raise ArgumentTypeError(f"drop: {_WANTED}, found {shown(drop)}")
    rows, words = set[int](), set[str]()
    for each in () if drop is None else (drop,) if isinstance(drop, str) else drop:
        if isinstance(each, str):
            if each not in FOUND:
                near = did_you_mean(each, FOUND, listed=0)
                raise ArgumentTypeError(f"drop: {_WANTED}, found {shown(each)}{near}")
            words.add(each)
        elif isinstance(each, bool) or not isinstance(each, int | np.integer):
            raise ArgumentTypeError(f"drop: rows are whole numbers, found {shown(each)}")
        elif not 0 <= each < count:
            raise ArgumentError(f"drop: the measurements have rows 0 to {count - 1}, found {each}")
        else:
            rows.add(int(each))
    return tuple(sorted(rows)), "outliers" in words, "slack" in words


def without(datasets: Sequence[FitData], rows: Sequence[int]) -> list[FitData]:
    """The sets without some rows.

    Raises
    ------
    ValueError
        A set of which nothing is left.
    """
    if not len(rows):
        return list(datasets)
    found = []
    for data in datasets:
        kept = np.flatnonzero(~np.isin(data.rows, rows))
        if not len(kept):
            raise ArgumentError("drop: no row of a set is left")
        found.append(data.select(kept))
    return found


def held_without(
    held: Sequence[tuple[FitData, int]], rows: Sequence[int]
) -> list[tuple[FitData, int]]:
    """The sets that are held out, each with the fitted set it is like, without some rows."""
    some = [(data, like) for data, like in held if not np.isin(data.rows, rows).all()]
    return [(without([data], rows)[0], like) for data, like in some]


def outlying(estimator: Estimator, estimate: Estimate) -> BoolArray:
    """Mark the rows (N,) of the equations that the others contradict."""
    equations = estimator.equations
    fitted = estimate.state.fitted.rank
    odd = outliers(
        estimate.residual,
        estimate.design[:, :fitted],
        equations.blocks.components,
        estimate.weights,
        estimate.prior @ estimate.half[:, :fitted],
    )
    odd = np.union1d(odd, elsewhere(equations, estimate))
    return np.isin(equations.blocks.block_of_row, odd)


def elsewhere(equations: Equations, estimate: Estimate) -> IntArray:
    """Poses at which much was read that agrees, but not with where the actuators say it is.

    Of a picture, nearly all that is left says how good its corners are; the few numbers that say
    where the machine was are compared by themselves.
    """
    fitted = estimate.state.fitted.rank
    if equations.system is None or not (equations.blocks.components >= LARGE).any():
        return np.empty(0, dtype=np.intp)
    left = np.column_stack([estimate.residual, estimate.design[:, :fitted]])
    blocks, counts, own = equations.system.closures_alone(
        estimate.evaluation, estimate.state.noise, left, LARGE
    )
    weights = estimate.weights[blocks]
    weighted = np.sqrt(np.repeat(weights, counts))[:, None] * own[:, 1:]
    share, axes = np.linalg.eigh(np.eye(fitted) - weighted.T @ weighted)  # of all other equations
    others = np.sqrt(np.maximum(share, 0.0))[:, None] * axes.T
    odd = outliers(
        own[:, 0],
        own[:, 1:],
        counts,
        weights,
        others,
        stated=not equations.blocks.unstated[-1],
    )
    found: IntArray = blocks[odd]
    return found


def are_few(datasets: Sequence[FitData], rows: Sequence[int]) -> bool:
    """Return whether rows may be errors of their own: few of all, and not all of a set."""
    mine = [np.isin(data.rows, rows) for data in datasets]
    whole = np.concatenate(mine)
    return bool(whole.mean() <= _FEW and not any(each.all() for each in mine))


def leaves_none(datasets: Sequence[FitData], rows: Sequence[int]) -> bool:
    """Return whether nothing is left of a session, of whose own numbers others say nothing."""
    gone = [np.isin(data.rows, rows) for data in datasets]
    named = [
        np.full(len(each), "") if data.measured.session is None else data.measured.session
        for data, each in zip(datasets, gone, strict=True)
    ]
    left = {*np.concatenate([own[~each] for own, each in zip(named, gone, strict=True)]).tolist()}
    return not {*np.concatenate(named).tolist()} <= left


def robust_outliers(equations: Equations, start: Evaluation) -> tuple[int, ...]:
    """Numbers of the rows that a robust fit from this start finds outlying."""
    estimator = estimator_at(equations, start, "cauchy")
    return tuple(
        equations.table.rows[outlying(estimator, solved_in_least_minima(estimator))].tolist()
    )
