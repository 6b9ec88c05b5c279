"""The search for the parameters that fit best: least squares through scipy, step by step."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray
from pkmcal.estimation.equations import Batch, Equations
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.loss import Loss
from pkmcal.estimation.misfits import progress, rounding
from pkmcal.exceptions import FitError
from pkmcal.statistics.linear_fit import triangle

_FTOL = 1e-10  # of the cost: 1e-4 of a standard deviation; rounding moves it by less
_TOLERANCES = {"ftol": _FTOL, "xtol": 1e-10, "gtol": 1e-15}
_MOST = 200  # evaluations
_BARRED = 5  # steps that rows bar, from which on a search walks in steps too small to arrive
_CONVERGED = (1, 2, 3, 4)  # as MINPACK says it

Function = Callable[[FloatArray], FloatArray]


class SingularError(FitError):
    """A search came to parameters with which the machine is singular in some pose."""


class _BarredError(Exception):
    """Rows bar the way of a search again and again."""

    def __init__(self, trail: Trail, blocks: BoolArray) -> None:
        super().__init__()
        self.trail, self.blocks = trail, blocks  # so far, and the blocks (B,) of these rows


@dataclass(frozen=True, eq=False)
class Trail:
    """The course of a search.

    Attributes
    ----------
    near : Evaluation
        The last step taken: where poses are looked for.
    u, noise : ndarray (n,), ndarray (G,)
        Where the equations were evaluated last, and with which noise.
    here : Evaluation
        The equations there.
    evaluations : int
        How often the machine was solved for all rows.
    converged : bool
        Whether the last search did.
    history : tuple of float
        Misfit of the rows that were reached at the start and after every step taken, rms in mm; of
        the closures where nothing else was read.
    """

    near: Evaluation
    u: FloatArray
    noise: FloatArray
    here: Evaluation
    evaluations: int = 0
    converged: bool = False
    history: tuple[float, ...] = ()

    def after(self, step: Evaluation, misfit: float) -> Trail:
        """The trail with another step; poses follow the parameters from there."""
        if self.near is not step:
            self.near.cache.pop("following", None)
        history, count = (*self.history, misfit), self.evaluations
        return Trail(step, self.u, self.noise, self.here, count, self.converged, history)


class Search:
    """Least squares in scaled parameters, u = (θ - θ0)/scale.

    Parameters
    ----------
    equations : Equations
        What is fitted.
    start : Evaluation
        θ0, where all rows are reached.
    columns : ndarray of int, optional
        The parameters that are found, n of them; all by default. The others stay at θ0.

    Attributes
    ----------
    scale : ndarray (n,)
        That of `Parameters`.
    """

    def __init__(
        self, equations: Equations, start: Evaluation, columns: IntArray | None = None
    ) -> None:
        parameters = equations.parameters
        self._found: IntArray | slice = slice(None) if columns is None else columns
        self.equations, self.start = equations, start
        self.scale = parameters.scale[self._found]
        rows = parameters.prior_rows(start.theta)[:, self._found]
        self._stated = np.flatnonzero(rows.any(axis=1))
        lower, upper = ((end - start.theta)[self._found] / self.scale for end in parameters.bounds)
        bounded = bool(np.isfinite([lower, upper]).any())
        self._bounds = (lower, upper) if bounded else None
        self._equations = int(equations.blocks.components.sum())
        self._cache: dict[str, tuple[Evaluation, FloatArray, FloatArray]] = {}  # a Jacobian

    def begin(self) -> Trail:
        """The trail of a search that has not begun."""
        u, ones = np.zeros(len(self.scale)), np.ones(len(self.equations.blocks.unstated))
        return Trail(self.start, u, ones, self.start)

    def at(self, trail: Trail, u: FloatArray, noise: FloatArray) -> Trail:
        """Evaluate the equations at scaled parameters (n,), poses found with this noise (G,)."""
        same = not self.equations.machines.unknowns or _same(noise, trail.noise)
        if same and _same(u, trail.u):
            return trail
        there = self.equations.at(self._theta(u), noise, trail.near)
        if there.ok:  # what it began with is needed of rows that failed alone, and takes memory
            there = replace(there, begun=there.states)
        count, near, history = trail.evaluations + 1, trail.near, trail.history
        return Trail(near, u.copy(), noise, there, count, trail.converged, history)

    def prior(self, theta: FloatArray) -> FloatArray:
        """A row (p, n) for each prior at all parameters `theta`, in units of its deviation."""
        if not len(self._stated):
            return np.empty((0, len(self.scale)))
        rows: FloatArray = self.equations.parameters.prior_rows(theta)[self._stated]
        found: FloatArray = rows[:, self._found]
        return found

    def _pulled(self, theta: FloatArray) -> FloatArray:
        """Return the misfit of each prior (p,) at all parameters."""
        if not len(self._stated):
            return np.empty(0)
        pulled: FloatArray = self.equations.parameters.prior_left(theta)[self._stated]
        return pulled

    def _theta(self, u: FloatArray) -> FloatArray:
        theta: FloatArray = self.start.theta.copy()
        theta[self._found] += self.scale * u
        return theta

    def jacobian(self, evaluation: Evaluation, noise: FloatArray) -> FloatArray:
        """Derivative (M, n) of the predicted values, scaled and whitened.

        The last one is kept until another is asked for.

        Raises
        ------
        SingularError
            It does not exist, at a singularity of the machine.
        """
        found = self.own_jacobian(evaluation, noise)
        self.keep(evaluation, noise, found)
        return found

    def keep(self, evaluation: Evaluation, noise: FloatArray, jacobian: FloatArray) -> None:
        """Know the Jacobian there until another is asked for; who gives it leaves it as it is."""
        self._cache["jacobian"] = evaluation, noise, jacobian

    def own_jacobian(self, evaluation: Evaluation, noise: FloatArray) -> FloatArray:
        """Return `jacobian` in memory of its own, which the caller may change."""
        found = np.empty((self._equations, len(self.scale)))
        for _, some, by_u in self._batches(evaluation, noise):
            if len(by_u) == len(found):
                return _finite(by_u)
            found[some] = _finite(by_u)
        return found

    def triangle(self, evaluation: Evaluation, noise: FloatArray) -> FloatArray:
        """R of a QR factorisation of the Jacobian. Of several batches none is kept."""
        factor = np.zeros((0, len(self.scale)))
        for _, _, by_u in self._batches(evaluation, noise):
            factor = triangle(factor, _finite(by_u))
            if len(by_u) == self._equations:
                self._cache["jacobian"] = evaluation, noise, by_u
        return factor

    def end(self, trail: Trail) -> None:
        """Forget what the next step would need: it takes memory."""
        self._cache.clear()
        for evaluation in (self.start, trail.near, trail.here):
            evaluation.cache.pop("following", None)
            evaluation.cache.pop("derivatives", None)

    def _batches(self, evaluation: Evaluation, noise: FloatArray) -> Iterator[Batch]:
        """`own_jacobian` in batches, finite or not."""
        last = self._cache.pop("jacobian", None)
        if last is not None and last[0] is evaluation and _same(last[1], noise):
            yield (
                slice(0, len(self.equations.blocks.components)),
                slice(0, self._equations),
                last[2],
            )
            return
        del last
        for blocks, some, by_parameters in self.equations.batches(evaluation, noise):
            by_u: FloatArray = by_parameters[:, self._found]
            by_u *= self.scale
            yield blocks, some, by_u

    def best(
        self, trail: Trail, u: FloatArray, noise: FloatArray, loss: Loss, pins: FloatArray
    ) -> tuple[FloatArray, Trail]:
        """Return the place of least cost from `u` (n,) on, and the trail there.

        Rows that the machine cannot reach bar the way of a step. Where that happened, the search
        goes round: first without those rows, then from there with all of them. Where it happens
        again and again, it does so before it is at an end, and goes on only if that leads nowhere.

        `noise` (G,) is as in `Whitening`; `pins` (d, n) are rows that hold the combinations that
        measurements and prior do not identify.
        """
        everything = np.zeros(len(self.equations.blocks.components), dtype=bool)
        try:
            found = self._minimum(trail, u, noise, loss, pins, everything, _BARRED)
        except _BarredError as error:
            begun = replace(trail, evaluations=error.trail.evaluations)
            trail, around, other = self._around(begun, u, noise, loss, pins, error.blocks)
            if trail.converged and np.isfinite(other):
                return around, trail
            begun = replace(begun, evaluations=trail.evaluations)
            found = self._minimum(begun, u, noise, loss, pins, everything)
        trail, straight, cost, barred = found
        if not barred.any() or barred.all():
            return straight, trail
        first = self.at(trail, straight, noise)
        trail, around, other = self._around(first, u, noise, loss, pins, barred)
        if other < cost:
            return around, trail
        back = replace(first, near=first.here, noise=noise, u=straight)
        return straight, replace(back, evaluations=trail.evaluations, history=trail.history)

    def _around(
        self,
        first: Trail,
        u: FloatArray,
        noise: FloatArray,
        loss: Loss,
        pins: FloatArray,
        barred: BoolArray,
    ) -> tuple[Trail, FloatArray, float]:
        """A minimum with all blocks, found from that without some; cost inf: it has none."""
        trail, around, _, _ = self._minimum(first, u, noise, loss, pins, barred)
        trail = self.at(trail, around, noise)
        if not trail.here.ok:
            return trail, around, np.inf
        everything = np.zeros_like(barred)
        trail, around, cost, _ = self._minimum(trail, around, noise, loss, pins, everything)
        return trail, around, cost

    def _minimum(
        self,
        trail: Trail,
        u: FloatArray,
        noise: FloatArray,
        loss: Loss,
        pins: FloatArray,
        aside: BoolArray,
        most: int = _MOST,
    ) -> tuple[Trail, FloatArray, float, BoolArray]:
        """A minimum of the cost of the blocks not set aside, the cost, and the blocks in its way.

        Those are the blocks (B,) of rows that some step could not reach. `_BarredError`: `most`
        steps could not be taken.
        """
        equations = self.equations
        without = np.repeat(aside, equations.blocks.components)
        last: tuple[Evaluation, FloatArray] | None = None
        refused, times = np.zeros_like(aside), 0

        def data(evaluation: Evaluation) -> FloatArray:
            nonlocal last
            if last is None or last[0] is not evaluation:
                whitened = equations.residual(evaluation, noise)
                whitened[without] = 0.0
                last = evaluation, whitened
            return last[1]

        # a cost that nothing lowers: by less than rounding it need not fall
        floor = rounding(equations, noise) / np.sqrt(_FTOL)
        trail = self.at(trail, u, noise)
        first = data(trail.here)
        worse = 10.0 * (1.0 + float(np.linalg.norm(first)))
        rows = min(len(first), len(u) + 1)
        count = rows + len(self._stated) + len(pins) + 1

        def residual(u: FloatArray) -> FloatArray:
            nonlocal trail, times
            trail = self.at(trail, u, noise)
            evaluation = trail.here
            if not evaluation.ok:
                missed = (evaluation.status[equations.blocks.pose_of_block] != 0) & ~aside
                if missed.any():  # worse than any step that is taken
                    refused[missed] = True
                    times += 1
                    if times == most and not refused.all():
                        raise _BarredError(trail, refused)
                    return np.full(count, worse + floor)
            turned = np.zeros(rows)
            turned[0] = np.linalg.norm(loss.residual(data(evaluation)))
            return np.concatenate([turned, -self._pulled(evaluation.theta), pins @ u, [floor]])

        taken: Evaluation | None = None
        still = np.zeros((1, len(u)))  # the derivative of `floor`

        def take() -> Evaluation:
            """A step goes on from here."""
            nonlocal taken, trail
            if trail.here is not taken:
                taken = trail.here
                trail = trail.after(taken, progress(equations, taken))
            return trail.here

        def jacobian(u: FloatArray) -> FloatArray:
            nonlocal trail
            trail = self.at(trail, u, noise)
            evaluation = take()
            whitened = data(evaluation)
            left, factor = -loss.residual(whitened), np.zeros((0, 1 + len(u)))
            for blocks, some, by_u in self._batches(evaluation, noise):
                by_u[without[some]] = 0.0
                by_u = loss.of(blocks).jacobian(whitened[some], _finite(by_u))
                factor = triangle(factor, [left[some], by_u])
            turned = _turned(factor)
            return np.concatenate([turned, self.prior(evaluation.theta), pins, still])

        found, cost, converged = self._searched(residual, jacobian, u)
        trail = self.at(trail, found, noise)
        take()
        return replace(trail, converged=converged), found, cost, refused

    def _searched(
        self, residual: Function, jacobian: Function, u: FloatArray
    ) -> tuple[FloatArray, float, bool]:
        """Minimise half the sum of squares of `residual`; say whether the steps ended."""
        from scipy.optimize import least_squares, leastsq

        if self._bounds is None:
            # `least_squares` calls the same code, and takes longer than it: copies and checks
            twice = [jacobian(u)] * 2  # which `leastsq` asks for as often

            def once(at: FloatArray) -> FloatArray:
                return twice.pop() if twice and _same(at, u) else jacobian(at)

            found, _, said, _, end = leastsq(
                residual,
                u,
                Dfun=once,
                full_output=True,
                **_TOLERANCES,
                maxfev=_MOST,
                diag=np.ones(len(u)),
            )
            return found, 0.5 * float(said["fvec"] @ said["fvec"]), end in _CONVERGED
        trf = least_squares(
            residual,
            u,
            jacobian,
            bounds=self._bounds,
            method="trf",
            x_scale=1.0,
            **_TOLERANCES,
            max_nfev=_MOST,
        )
        return trf.x, float(trf.cost), bool(trf.status > 0)


def _turned(factor: FloatArray) -> FloatArray:
    """Derivative (min(M, n + 1), n) of residuals (M,) turned so that the first has all of them.

    `factor` is R of the residuals and their derivative, side by side. Squares, gradient and
    Gauss-Newton matrix are those of all M rows, so are the steps of a search.
    """
    factor[0] *= np.copysign(1.0, factor[0, 0])
    return factor[:, 1:]


def _same(one: FloatArray, other: FloatArray) -> bool:
    return one is other or one.tobytes() == other.tobytes()


def _finite(jacobian: FloatArray) -> FloatArray:
    if not np.isfinite(jacobian).all():
        raise SingularError(
            "no geometry near the present one agrees: the fit runs into poses"
            " where the actuators do not hold the machine (type-2 singular)"
        )
    return jacobian
