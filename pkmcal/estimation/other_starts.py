"""Other places from which the search may start: what the nominal machine alone cannot tell apart.

A sensor on a machine whose poses turn but little, or about one axis, may be mounted either side up:
the nominal machine then misses about as much with both, and which of them is smaller is chance. The
fits with all unknowns tell, or what is stated of the mounting, or nothing does. Where each session
has a mounting of its own, each may be the other side up.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray
from pkmcal.estimation.begin import estimator_at
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.estimate import Estimate
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.fit_data import Start
from pkmcal.estimation.loss import LossName
from pkmcal.estimation.parameters import Parameters
from pkmcal.estimation.solving import solve
from pkmcal.exceptions import ArgumentError

_MORE = 1e-6  # of the squares, by which a fit is better than another
_REFUTED = 9.0  # squares of priors, by which they tell one start from another: 3 deviations
_TURN = 2.0 * np.pi  # rad, after which an angle is what it was


@dataclass(frozen=True, eq=False)
class OtherFit:
    """A fit from another start.

    Attributes
    ----------
    role, name : str
        Of what starts elsewhere.
    columns : ndarray of int
        Its parameters.
    estimate : Estimate
        Where the search ended.
    more : float
        By how much its squares, in those that noise leaves, exceed the squares of the fit.
    """

    role: str
    name: str
    columns: IntArray
    estimate: Estimate
    more: float


def likelier_start(equations: Equations, start: Evaluation, loss: LossName) -> Evaluation:
    """The start from which the fit is best, of those that the nominal machine leaves open.

    What priors state of a mounting decides before any fit.
    """
    start = _as_stated(equations, start)
    if not any(_open(equations, start)):
        return start
    for _ in range(len(equations.parameters)):
        try:
            estimator = estimator_at(equations, start, loss)
            estimate = solve(estimator)
        except ArgumentError:  # the search itself says so
            return start
        state = estimate.state
        squares = estimator.cost(estimate.evaluation, state.noise, state.width)
        better = [
            (least, there)
            for there, other in _fits(estimator, estimate, start)
            if (least := other.more) < -_MORE * max(squares, 1.0)
        ]
        if not better:
            break
        start = min(better, key=lambda each: each[0])[1]
    return start


def other_fits(estimator: Estimator, estimate: Estimate, start: Evaluation) -> Iterator[OtherFit]:
    """The fits from the other places that the nominal machine leaves open."""
    for _, other in _fits(estimator, estimate, start):
        yield other


def elsewhere(equations: Equations, start: Evaluation, own: BoolArray) -> Iterator[Evaluation]:
    """Other starts that the nominal machine leaves open, of parameters `own` (n,) alone."""
    for *_, there in _open(equations, start):
        if own[there.theta != start.theta].all():
            yield there


def _fits(
    estimator: Estimator, estimate: Estimate, start: Evaluation
) -> Iterator[tuple[Evaluation, OtherFit]]:
    noise, width = estimate.state.noise, estimate.state.width
    squares = estimator.cost(estimate.evaluation, noise, width)
    usual = max(1.0, squares / max(float(estimate.freedom.sum()), 1.0))
    for role, name, columns, there in _open(estimator.equations, start):
        try:
            other = solve(estimator_at(estimator.equations, there, estimator.loss))
        except ArgumentError:  # no fit begins there
            continue
        more = (estimator.cost(other.evaluation, noise, width) - squares) / usual
        if np.isfinite(more):
            yield there, OtherFit(role, name, columns, other, more)


def _as_stated(equations: Equations, start: Evaluation) -> Evaluation:
    """The start that priors expect, of the places that it may have and whole turns from them."""
    chosen = start.parameters
    if not len(chosen.prior_left(start.theta)):
        return start
    for _, _, columns, places in _places(equations, chosen):
        here = _expected(chosen, start.theta, columns)
        least = min(
            (here, *(_expected(chosen, _moved(start.theta, *place), columns) for place in places)),
            key=lambda theta: _prior_squares(chosen, theta),
        )
        refuted = _prior_squares(chosen, here) - _prior_squares(chosen, least) > _REFUTED
        theta = least if refuted else here
        if not np.array_equal(theta, start.theta):
            there = _at(equations, start, theta)
            start = there if there.ok else start
    return start


def _open(
    equations: Equations, start: Evaluation
) -> Iterator[tuple[str, str, IntArray, Evaluation]]:
    """What may start elsewhere: role, name, its parameters, and the start with it there."""
    chosen = start.parameters
    lower, upper = chosen.bounds
    most = _prior_squares(chosen, start.theta) + _REFUTED
    for role, name, columns, places in _places(equations, chosen):
        for own, values in places:
            theta = _expected(chosen, _moved(start.theta, own, values), columns)
            outside = ((theta < lower) | (theta > upper)).any()
            if outside or np.array_equal(theta, start.theta):
                continue
            if _prior_squares(chosen, theta) > most:
                continue
            there = _at(equations, start, theta)
            if there.ok:
                yield role, name, columns, there


def _places(
    equations: Equations, chosen: Parameters
) -> Iterator[tuple[str, str, IntArray, list[tuple[IntArray, FloatArray]]]]:
    """What has several places: role, name, its parameters, and which of these may be where.

    Of all sessions at once, and of each that has numbers of its own.
    """
    for (role, name), begun in _starts(equations).items():
        columns = _columns(chosen, role, name, begun)
        if not begun.others or not columns.size or chosen.uncertain[columns].any():
            continue
        together = [columns] if len(columns) > 1 else []
        each = [*together, *columns]
        values = (begun.values, *begun.others)
        yield role, name, columns, [(own, value) for own in each for value in values]


def _moved(theta: FloatArray, columns: IntArray, values: FloatArray) -> FloatArray:
    """Parameters (n,) with other values of some."""
    moved: FloatArray = theta.copy()
    moved[columns] = values
    return moved


def _expected(chosen: Parameters, theta: FloatArray, columns: IntArray) -> FloatArray:
    """The same place with angles a whole turn further where priors expect them there."""
    if not len(chosen.prior_left(theta)):
        return theta
    for i in columns.ravel().tolist():
        trials = [theta, *(_moved(theta, np.array(i), theta[i] + by) for by in (-_TURN, _TURN))]
        if chosen.units[i] == "rad":
            squares = [_prior_squares(chosen, each) for each in trials]
            theta = trials[int(np.argmin(squares))]
    return theta


def _prior_squares(chosen: Parameters, theta: FloatArray) -> float:
    """Squares of what priors miss at these parameters, in variances."""
    left = chosen.prior_left(theta)
    return float(left @ left)


def _at(equations: Equations, start: Evaluation, theta: FloatArray) -> Evaluation:
    """The start with other parameters."""
    exact = equations.with_exact_actuators().with_parameters(start.parameters)
    there = exact.at(theta, near=start)
    return replace(there, begun=there.states)


def _starts(equations: Equations) -> dict[tuple[str, str], Start]:
    """All starts of the readings, by role and name."""
    found: dict[tuple[str, str], Start] = {}
    for data in equations.prediction.datasets:
        found |= data.starts
    return found


def _columns(chosen: Parameters, role: str, name: str, begun: Start) -> IntArray:
    """Parameters (s, w) of what starts somewhere, a row for each session that has its own."""
    first = chosen.nuisance.get((role, name))
    if first is None:
        return np.empty((0, len(begun.slots)), dtype=np.intp)
    numbers = [np.flatnonzero(chosen.number_of == first + k) for k in range(len(begun.slots))]
    return np.column_stack(numbers)
