"""The search for the parameters that fit best, step by step."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray
from pkmcal.estimation.equations import Batch, Equations
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.least_squares import FTOL, MOST, minimised, same_bits
from pkmcal.estimation.loss import LossName, limits, scaled, scaled_jacobian
from pkmcal.estimation.machine_size import machine_size
from pkmcal.estimation.misfits import progress, rounding
from pkmcal.exceptions import FitError
from pkmcal.progress import step
from pkmcal.statistics.linear_fit import triangle

_BARRED = 5  # steps that rows bar, from which on a search walks in steps too small to arrive

Cache = dict[str, tuple[Evaluation, FloatArray, FloatArray]]  # a Jacobian, where and of what noise


class SingularError(FitError):
    """A search came to parameters with which the machine is singular in some pose."""


class _BarredError(Exception):
    """Rows bar the way of a search again and again."""

    def __init__(self, search: Estimator, blocks: BoolArray) -> None:
        super().__init__()
        self.search, self.blocks = search, blocks  # so far, and the blocks (B,) of these rows


@dataclass(frozen=True, eq=False)
class Estimator:
    """Least squares in scaled parameters, u = (θ - θ0)/scale, and where their search has come to.

    Attributes
    ----------
    equations : Equations
        What is fitted.
    start : Evaluation
        θ0, where all rows are reached, and what unidentifiable combinations keep.
    loss : str
        A name in `loss.LIMITS`.
    columns : ndarray of int or slice
        The parameters that are found, n of them. The others stay at θ0.
    scale : ndarray (n,)
        That of `Parameters`.
    near : Evaluation
        The last step taken: where poses are looked for.
    u, noise : ndarray (n,), ndarray (G,)
        Where the equations were evaluated last, and with which noise.
    here : Evaluation
        The equations there.
    evaluations : int
        How often the machine was solved for all rows.
    converged : bool
        Whether the search did.
    history : tuple of float
        Misfit of the rows that were reached at the start and after every step taken, rms in mm; of
        the closures where nothing else was read.
    priors : ndarray of int (p,)
        The rows of priors that say something of these parameters.
    cache : dict
        The last Jacobian.
    """

    equations: Equations
    start: Evaluation
    loss: LossName
    columns: IntArray | slice
    scale: FloatArray
    near: Evaluation
    u: FloatArray
    noise: FloatArray
    here: Evaluation
    evaluations: int = 0
    converged: bool = False
    history: tuple[float, ...] = ()
    priors: IntArray = field(kw_only=True)
    cache: Cache = field(default_factory=dict, repr=False, kw_only=True)

    @classmethod
    def of(
        cls,
        equations: Equations,
        start: Evaluation,
        loss: LossName = "linear",
        columns: IntArray | None = None,
    ) -> Estimator:
        """A search that has not begun; of all parameters by default."""
        found: IntArray | slice = slice(None) if columns is None else columns
        scale = equations.parameters.scale[found]
        rows = equations.parameters.prior_rows(start.theta)[:, found]
        u, ones = np.zeros(len(scale)), np.ones(len(equations.blocks.unstated))
        stated = np.flatnonzero(rows.any(axis=1))
        return cls(equations, start, loss, found, scale, start, u, ones, start, priors=stated)

    def at(self, u: FloatArray, noise: FloatArray) -> Estimator:
        """Evaluate the equations at scaled parameters (n,), poses found with this noise (G,)."""
        same = not self.equations.machines.unknowns or same_bits(noise, self.noise)
        if same and same_bits(u, self.u):
            return self
        there = self.equations.at(self._theta(u), noise, self.near)
        if there.ok:  # what it began with is needed of rows that failed alone, and takes memory
            there = replace(there, begun=there.states)
        return replace(self, u=u.copy(), noise=noise, here=there, evaluations=self.evaluations + 1)

    def after(self, step: Evaluation, misfit: float) -> Estimator:
        """The search after another step; poses follow the parameters from there."""
        if self.near is not step:
            self.near.cache.pop("following", None)
        return replace(self, near=step, history=(*self.history, misfit))

    @property
    def unstated(self) -> BoolArray:
        """Whether the deviation of each group (G,) is not known."""
        return self.equations.blocks.unstated

    @cached_property
    def size(self) -> float:
        """The machine's size, mm."""
        return machine_size(self.equations, self.start.theta)

    @cached_property
    def _bounds(self) -> tuple[FloatArray, FloatArray] | None:
        ends = self.equations.parameters.bounds
        lower, upper = ((end - self.start.theta)[self.columns] / self.scale for end in ends)
        return (lower, upper) if np.isfinite([lower, upper]).any() else None

    @cached_property
    def _equations(self) -> int:
        return int(self.equations.blocks.components.sum())

    def prior(self, theta: FloatArray) -> FloatArray:
        """A row (p, n) for each prior at all parameters `theta`, in units of its deviation."""
        if not len(self.priors):
            return np.empty((0, len(self.scale)))
        rows: FloatArray = self.equations.parameters.prior_rows(theta)[self.priors]
        return rows[:, self.columns]

    def _pulled(self, theta: FloatArray) -> FloatArray:
        """Return the misfit of each prior (p,) at all parameters."""
        if not len(self.priors):
            return np.empty(0)
        return self.equations.parameters.prior_left(theta)[self.priors]

    def cost(self, evaluation: Evaluation, noise: FloatArray, width: FloatArray) -> float:
        """Squares of residuals, as the loss counts them, and of all that priors miss."""
        blocks = self.equations.blocks
        limit = limits(self.loss, blocks.stands_for, width)
        whitened = self.equations.residual(evaluation, noise)
        residual = scaled(self.loss, whitened, blocks.components, limit)
        missed = self.equations.parameters.prior_left(evaluation.theta)
        return float(residual @ residual + missed @ missed)

    def _theta(self, u: FloatArray) -> FloatArray:
        theta: FloatArray = self.start.theta.copy()
        theta[self.columns] += self.scale * u
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
        self.cache["jacobian"] = evaluation, noise, jacobian

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
                self.keep(evaluation, noise, by_u)
        return factor

    def end(self) -> None:
        """Forget what the next step would need: it takes memory."""
        self.cache.clear()
        for evaluation in (self.start, self.near, self.here):
            evaluation.cache.pop("following", None)
            evaluation.cache.pop("derivatives", None)

    def _batches(self, evaluation: Evaluation, noise: FloatArray) -> Iterator[Batch]:
        """`own_jacobian` in batches, finite or not."""
        last = self.cache.pop("jacobian", None)
        if last is not None and last[0] is evaluation and same_bits(last[1], noise):
            yield (
                slice(0, len(self.equations.blocks.components)),
                slice(0, self._equations),
                last[2],
            )
            return
        del last
        for blocks, some, by_parameters in self.equations.batches(evaluation, noise):
            by_u: FloatArray = by_parameters[:, self.columns]
            by_u *= self.scale
            yield blocks, some, by_u

    def best(
        self, u: FloatArray, noise: FloatArray, width: FloatArray, pins: FloatArray
    ) -> Estimator:
        """The search at the place of least cost from `u` (n,) on.

        Rows that the machine cannot reach bar the way of a step. Where that happened, the search
        goes round: first without those rows, then from there with all of them. Where it happens
        again and again, it does so before it is at an end, and goes on only if that leads nowhere.

        `noise` (G,) is as in `Whitening`, `width` (B,) as in `loss.limits`; `pins` (d, n) are rows
        that hold the combinations that measurements and prior do not identify.
        """
        everything = np.zeros(len(self.equations.blocks.components), dtype=bool)
        try:
            found = self._minimum(u, noise, width, pins, everything, _BARRED)
        except _BarredError as error:
            begun = replace(self, evaluations=error.search.evaluations)
            around, other = begun._around(u, noise, width, pins, error.blocks)
            if around.converged and np.isfinite(other):
                return around
            begun = replace(begun, evaluations=around.evaluations)
            found = begun._minimum(u, noise, width, pins, everything)
        straight, cost, barred = found
        if not barred.any() or barred.all():
            return straight
        first = straight.at(straight.u, noise)
        around, other = first._around(u, noise, width, pins, barred)
        if other < cost:
            return around
        back = replace(first, near=first.here, noise=noise)
        return replace(back, evaluations=around.evaluations, history=around.history)

    def _around(
        self,
        u: FloatArray,
        noise: FloatArray,
        width: FloatArray,
        pins: FloatArray,
        barred: BoolArray,
    ) -> tuple[Estimator, float]:
        """A minimum with all blocks, found from that without some; cost inf: it has none."""
        search, _, _ = self._minimum(u, noise, width, pins, barred)
        search = search.at(search.u, noise)
        if not search.here.ok:
            return search, np.inf
        search, cost, _ = search._minimum(search.u, noise, width, pins, np.zeros_like(barred))
        return search, cost

    def _minimum(
        self,
        u: FloatArray,
        noise: FloatArray,
        width: FloatArray,
        pins: FloatArray,
        aside: BoolArray,
        most: int = MOST,
    ) -> tuple[Estimator, float, BoolArray]:
        """A minimum of the cost of the blocks not set aside, the cost, and the blocks in its way.

        Those are the blocks (B,) of rows that some step could not reach. `_BarredError`: `most`
        steps could not be taken.
        """
        equations, search = self.equations, self.at(u, noise)
        components = equations.blocks.components
        limit = limits(self.loss, equations.blocks.stands_for, width)
        without = np.repeat(aside, components)
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
        floor = rounding(equations, noise) / np.sqrt(FTOL)
        first = data(search.here)
        worse = 10.0 * (1.0 + float(np.linalg.norm(first)))
        rows = min(len(first), len(u) + 1)
        count = rows + len(self.priors) + len(pins) + 1

        def residual(u: FloatArray) -> FloatArray:
            nonlocal search, times
            search = search.at(u, noise)
            evaluation = search.here
            if not evaluation.ok:
                missed = (evaluation.status[equations.blocks.pose_of_block] != 0) & ~aside
                if missed.any():  # worse than any step that is taken
                    refused[missed] = True
                    times += 1
                    if times == most and not refused.all():
                        raise _BarredError(search, refused)
                    return np.full(count, worse + floor)
            turned = np.zeros(rows)
            turned[0] = np.linalg.norm(scaled(self.loss, data(evaluation), components, limit))
            return np.concatenate([turned, -self._pulled(evaluation.theta), pins @ u, [floor]])

        taken: Evaluation | None = None
        still = np.zeros((1, len(u)))  # the derivative of `floor`

        def take() -> Evaluation:
            """A step goes on from here."""
            nonlocal taken, search
            if search.here is not taken:
                taken = search.here
                search = search.after(taken, progress(equations, taken))
                step()
            return search.here

        def jacobian(u: FloatArray) -> FloatArray:
            nonlocal search
            search = search.at(u, noise)
            evaluation = take()
            whitened = data(evaluation)
            left = -scaled(self.loss, whitened, components, limit)
            factor = np.zeros((0, 1 + len(u)))
            for blocks, some, by_u in self._batches(evaluation, noise):
                by_u[without[some]] = 0.0
                of_blocks = _finite(by_u), components[blocks], limit[blocks]
                by_u = scaled_jacobian(self.loss, whitened[some], *of_blocks)
                factor = triangle(factor, [left[some], by_u])
            turned = _turned(factor)
            return np.concatenate([turned, self.prior(evaluation.theta), pins, still])

        found, cost, converged = minimised(residual, jacobian, u, self._bounds)
        search = search.at(found, noise)
        take()
        return replace(search, converged=converged), cost, refused


def _turned(factor: FloatArray) -> FloatArray:
    """Derivative (min(M, n + 1), n) of residuals (M,) turned so that the first has all of them.

    `factor` is R of the residuals and their derivative, side by side. Squares, gradient and
    Gauss-Newton matrix are those of all M rows, so are the steps of a search.
    """
    factor[0] *= np.copysign(1.0, factor[0, 0])
    return factor[:, 1:]


def _finite(jacobian: FloatArray) -> FloatArray:
    if not np.isfinite(jacobian).all():
        raise SingularError(
            "no geometry near the present one agrees: the fit runs into poses"
            " where the actuators do not hold the machine (type-2 singular)"
        )
    return jacobian
