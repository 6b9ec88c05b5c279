"""Minimisation by a particle swarm (eq. 19 of the 2TPR&2TPS paper), for any objective.

Own code, because one swarm in C serves this function and `compensate`: the published iteration, and
the same bits on every processor for one seed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import checked_seed, function, number, whole
from pkmcal.arrays import FloatArray, as_numbers
from pkmcal.core.swarm import Swarm, SwarmSettings
from pkmcal.display import Table
from pkmcal.exceptions import ArgumentError
from pkmcal.result import Result

_WIDEST = 1e150  # of a bound, so that no step of the swarm overflows

Objective = Callable[[FloatArray], ArrayLike]


@dataclass(frozen=True, eq=False, repr=False)
class SwarmResult(Result):
    """The best that a swarm found.

    Attributes
    ----------
    position : ndarray (n,)
        gBest.
    value : float
        The objective there; infinite where it never was a number.
    history : ndarray (iterations done + 1,)
        The lowest value so far, before the first and after every iteration.
    evaluations : int
        Positions at which the objective was evaluated.
    stagnated : bool
        Whether the swarm stopped because it got no better.
    """

    position: FloatArray
    value: float
    history: FloatArray
    evaluations: int
    stagnated: bool

    def _parts(self) -> Iterator[str | Table]:
        position = ", ".join(f"{x:.6g}" for x in self.position)
        why = ", then stagnation" if self.stagnated else ""
        yield (
            f"{self.value:.6g} at ({position}) after {len(self.history) - 1} iterations"
            f" ({self.evaluations} evaluations){why}"
        )


def pso(
    objective: Objective,
    lower: ArrayLike,
    upper: ArrayLike,
    *,
    particles: int = 100,
    iterations: int = 200,
    inertia: float = 0.8,
    cognitive: float = 1.5,
    social: float = 1.5,
    seed: int = 0,
    patience: int | None = None,
    tolerance: float = 0.0,
    progress: Callable[[int, float], object] | None = None,
) -> SwarmResult:
    """Minimise a function within bounds by a particle swarm.

    Particles start anywhere within the bounds, at rest, and move by eq. 19 with random numbers of
    their own in each dimension. A particle that would leave the bounds stops at the bound: that
    component of its velocity becomes zero. One seed gives one result, to the last bit, on every
    processor, as far as the objective does.

    Parameters
    ----------
    objective : callable
        Takes positions (particles, n), a copy, and returns values (particles,). NaN is never best.
    lower, upper : array_like (n,)
        Bounds, finite, each lower one at most the upper one.
    particles, iterations : int
        N and T.
    inertia, cognitive, social : float
        ω, c1, c2. The defaults are the paper's, which lie outside order-2 stability
        (c1 + c2 < 2.88 at ω = 0.8): the swarm shrinks slowly and not surely. The constriction
        values 0.7298, 1.49618, 1.49618 lie inside.
    seed : int
        From 0 to 2⁶⁴ - 1.
    patience : int, optional
        Stop after this number of iterations in which the lowest value fell by no more than
        `tolerance` in all.
    tolerance : float
        See `patience`.
    progress : callable, optional
        Called with the iteration and the lowest value after every iteration.

    Returns
    -------
    SwarmResult
        Position, value, history, evaluations.

    Raises
    ------
    ValueError, TypeError
        Bounds, settings or values of the objective that do not fit.

    Examples
    --------
    >>> def bowl(x):
    ...     return ((x - [1.0, 2.0]) ** 2).sum(axis=1)
    >>> pso(bowl, [-5, -5], [5, 5], inertia=0.7298).position.round(4)
    array([1., 2.])
    """
    settings = SwarmSettings(particles, iterations, inertia, cognitive, social)
    low, high = _bounds(lower, upper)
    function("objective", objective)
    if patience is not None:
        whole("patience", patience, 1, note=" or None")
    number("tolerance", tolerance, least=0)
    if progress is not None:
        function("progress", progress)
    swarm = Swarm(settings, low, high, checked_seed(seed))
    history: list[float] = []
    stagnated = False
    while True:
        swarm.update_best(_values(objective, swarm.positions))
        history.append(swarm.best[1])
        done = len(history) - 1
        if progress is not None and done:
            progress(done, history[-1])
        if patience is not None and done >= patience:
            stagnated = not history[-1] < history[-1 - patience] - tolerance
        if stagnated or done == iterations:
            break
        swarm.move()
    position, value = swarm.best
    return SwarmResult(position, value, np.array(history), particles * len(history), stagnated)


def _bounds(lower: ArrayLike, upper: ArrayLike) -> tuple[FloatArray, FloatArray]:
    given = []
    for name, bound in (("lower", lower), ("upper", upper)):
        array = as_numbers(name, bound, "n")
        if array.ndim != 1 or not len(array):
            raise ArgumentError(f"{name} must have shape (n,), found {array.shape}")
        if not np.isfinite(array).all():
            raise ArgumentError(f"{name} must be finite, found {array.tolist()}")
        given.append(np.array(array, dtype=np.float64))
    low, high = given
    if low.shape != high.shape:
        raise ArgumentError(f"lower has {len(low)} entries, upper {len(high)}")
    if (low > high).any():
        place = int(np.flatnonzero(low > high)[0])
        raise ArgumentError(
            f"lower[{place}] = {low[place]} is above upper[{place}] = {high[place]}"
        )
    if max(-low.min(), high.max()) > _WIDEST:
        raise ArgumentError(f"lower and upper must be within ±{_WIDEST:g}, or the swarm overflows")
    return low, high


def _values(objective: Objective, positions: FloatArray) -> FloatArray:
    count = len(positions)
    values = as_numbers("what objective returns", objective(positions), count)
    if values.shape != (count,):
        raise ArgumentError(
            f"objective must return one value for each of {count} particles, shape ({count},);"
            f" found {values.shape}"
        )
    return values.astype(np.float64)
