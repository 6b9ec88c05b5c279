"""Bootstrap of a calibration: the scatter of its parameters over resampled residuals.

The wild bootstrap by pose: where the model says a pose is, the residuals of that pose are added
again, corrected for what the fit has taken from them, with a sign drawn at random. Nothing is
assumed of the noise but that poses are independent of each other and that its sign is arbitrary:
rows of one pose may have anything in common (C. F. J. Wu, Jackknife, bootstrap and other resampling
methods in regression analysis, Annals of Statistics 14 (1986) 1261-1295; A. C. Cameron, J. B.
Gelbach and D. L. Miller, Bootstrap-based improvements for inference with clustered errors, Review
of Economics and Statistics 90 (2008) 414-427). A prior's centre is drawn from the prior.
SciPy's bootstrap draws observations anew, which changes the poses that were measured.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from pkmcal import arguments, display
from pkmcal.arguments import checked_seed, instance, whole
from pkmcal.arrays import FloatArray
from pkmcal.calibration.identification import Identification
from pkmcal.display import Table
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.redrawn import redrawn
from pkmcal.exceptions import ArgumentError
from pkmcal.fitted.fit import Fit
from pkmcal.progress import Progress
from pkmcal.result import Result

_TOGETHER = 20  # replicates that one task computes
_LEFT = 1e-6  # share of the noise below which a residual says nothing of it


@dataclass(frozen=True, eq=False, repr=False)
class Bootstrap(Result):
    """Parameters of many calibrations; in the order of `free`, mm and rad.

    Attributes
    ----------
    free, units : tuple of str, n
        The parameters.
    values : ndarray (replicates, n)
        NaN where a replicate did not converge.
    stderr : ndarray (n,)
        Standard deviation of the replicates; inf where the parameter is not determined.
    interval95 : ndarray (n, 2)
        Between these lie 95 % of the replicates.
    bias : ndarray (n,)
        Mean of the replicates less what was identified: what is not linear shows here.
    linear : ndarray (n,)
        `Identification.stderr`, to compare.
    """

    free: tuple[str, ...]
    units: tuple[str, ...]
    values: FloatArray
    stderr: FloatArray
    interval95: FloatArray
    bias: FloatArray
    linear: FloatArray

    @property
    def n_failed(self) -> int:
        """Number of replicates that did not converge."""
        return int(np.isnan(self.values).any(axis=1).sum())

    @property
    def failed(self) -> int:
        """The former name of `n_failed`."""
        return self.n_failed

    def failures(self) -> str:
        """Say how many replicates failed; empty where none did."""
        count = f"{self.n_failed} of {len(self.values)}"
        return f"{count} replicates did not converge" if self.n_failed else ""

    def _parts(self) -> Iterator[str | Table]:
        rows = []
        for i, (name, unit) in enumerate(zip(self.free, self.units, strict=True)):
            numbers = (self.stderr[i], self.linear[i], self.bias[i], *self.interval95[i])
            sigma, linear, bias, low, high = (
                display.displayed(float(number), unit)[0] for number in numbers
            )
            places = display.decimals(sigma)
            shown = display.displayed(0.0, unit)[1]
            rows.append([
                name if shown == "mm" else f"{name} [{shown}]",
                *(display.fixed(number, places) for number in (sigma, linear, bias, low, high)),
            ])  # fmt: skip
        failed = f", {self.n_failed} did not converge" if self.n_failed else ""
        heads = ["parameter", "stderr", "linear", "bias", "2.5 %", "97.5 %"]
        yield f"{len(self.values)} bootstrap replicates{failed}"
        yield Table(heads, rows, left=1)


def bootstrap(
    found: Identification,
    replicates: int = 1000,
    seed: int = 0,
    *,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Bootstrap:
    """Repeat a calibration to see how far its parameters scatter.

    Standard errors that do not rest on the stated noise, on residuals being Gaussian, on rows of
    one pose being independent or on the model being linear.

    Parameters
    ----------
    found : Identification
        The calibration.
    replicates : int
        How many times it is repeated.
    seed : int
        Of the draws; each replicate has its own, so that the numbers do not depend on how many
        workers there are. Other processes may stop at another of the points that all are the
        least to rounding, within 1e-4 of a standard deviation.
    executor : concurrent.futures.Executor, optional
        Where replicates are computed: threads, processes, or whatever else hands out tasks this
        way. None: here.
    progress : callable, optional
        Called now and then as ``progress(done, total)``, replicates. What it raises ends the work.

    Returns
    -------
    Bootstrap
        ``.stderr``, ``.interval95``, ``.bias`` and all values.

    Raises
    ------
    ValueError
        Fewer than two replicates, or no residuals to draw from: as many parameters as equations.

    Examples
    --------
    >>> import pkmcal as pk
    >>> robot = pk.load("hexapod")
    >>> q = robot.inverse(pk.sample_poses(robot, 20))
    >>> found = pk.identify(robot, pk.VirtualMachine(robot).measure(q), free="offset*")
    >>> bool((abs(pk.bootstrap(found, 200).stderr / found.stderr - 1) < 0.5).all())
    True
    """
    instance("found", found, Identification)
    whole("replicates", replicates, 2)
    freedom = found.fit.estimate.freedom
    left = freedom.sum() if found.fit.uncertainty.mixed else freedom.min()
    if not left > _LEFT or not np.isfinite(found.fit.covariance).all():
        raise ArgumentError("found: no degrees of freedom are left, so no residuals to draw from")
    seeds = np.random.SeedSequence(checked_seed(seed)).spawn(replicates)
    parts = [seeds[k : k + _TOGETHER] for k in range(0, replicates, _TOGETHER)]
    workers = arguments.executor(executor)
    replicate = Replicate(found.fit)
    done: Iterable[FloatArray] = (workers.map if workers else map)(replicate, parts)
    told = _told(done, replicates, progress)
    values = np.concatenate(list(told))[:, found.columns]
    good = values[np.isfinite(values).all(axis=1)]
    if len(good) < 2:
        raise ArgumentError("found: its replicates do not converge, the fit is not to be trusted")
    finite = np.isfinite(found.stderr)
    interval = np.quantile(good, (0.025, 0.975), axis=0).T
    interval[~finite] = -np.inf, np.inf
    return Bootstrap(
        free=found.free,
        units=found.units,
        values=values,
        stderr=np.where(finite, good.std(axis=0, ddof=1), np.inf),
        interval95=interval,
        bias=good.mean(axis=0) - found.values,
        linear=found.stderr,
    )


def _told(
    done: Iterable[FloatArray], replicates: int, progress: Progress | None
) -> Iterator[FloatArray]:
    """Parts as they are done, told of."""
    count = 0
    for each in done:
        yield each
        count += len(each)
        if progress is not None:
            progress(count, replicates)


class Replicate:
    """A calibration with other signs of its residuals; called with seeds, in any process.

    Parameters
    ----------
    fit : Fit
        Of the calibration.
    """

    def __init__(self, fit: Fit) -> None:
        self._equations, self._estimate = fit.uncertainty.equations, fit.estimate
        self._pose = self._equations.blocks.pose  # equations of one pose take one sign
        self._left = self._corrected()

    def _corrected(self) -> FloatArray:
        """Whitened residuals (M,) with the deviation that the noise has."""
        estimate = self._estimate
        root = np.sqrt(np.repeat(estimate.weights, self._equations.blocks.components))
        taken = root[:, None] * estimate.change(estimate.half)
        out = np.empty_like(estimate.residual)
        for pose in range(int(self._pose.max()) + 1):
            mine = np.flatnonzero(self._pose == pose)
            left = np.eye(len(mine)) - taken[mine] @ taken[mine].T
            size, axes = np.linalg.eigh(left)
            factor = np.where(size > _LEFT, 1.0 / np.sqrt(np.maximum(size, _LEFT)), 0.0)
            out[mine] = axes @ (factor * (axes.T @ estimate.residual[mine]))
        return out

    def __call__(self, seeds: Iterable[np.random.SeedSequence]) -> FloatArray:
        """Parameters of one replicate for each seed, (seeds, n)."""
        return np.array([self._one(np.random.default_rng(seed)) for seed in seeds])

    def _one(self, random: np.random.Generator) -> FloatArray:
        equations, at = self._equations, self._estimate.evaluation
        prior = equations.parameters.prior
        chosen = equations.parameters
        stated = np.isfinite(prior) & ~chosen.uncertain
        centre = at.theta.copy()
        centre[stated] += random.standard_normal(int(stated.sum())) * prior[stated]
        if len(chosen.spread):
            root = np.linalg.cholesky(chosen.spread)
            centre[chosen.uncertain] += root @ random.standard_normal(len(root))
        signs = np.where(random.integers(0, 2, int(self._pose.max()) + 1), 1.0, -1.0)
        left = signs[self._pose] * self._left
        drawn, _ = equations.parameters.off_functions(at.theta)
        drawn = drawn + random.standard_normal(len(drawn))
        return self._solved(
            *redrawn(equations, at, self._estimate.state.noise, left, centre, drawn)
        )

    def _solved(self, equations: Equations, at: Evaluation) -> FloatArray:
        state = self._estimate.state
        search = Estimator.of(equations, at, state.loss)
        kept = state.fitted.unidentifiable
        pins = state.fitted.singular[0] * kept.T
        best = search.best(np.zeros(len(at.theta)), state.noise, state.width, pins)
        theta = at.theta + search.scale * (best.u - kept @ (kept.T @ best.u))
        found = equations.parameters.reported(theta)
        return found if best.converged else np.full_like(found, np.nan)
