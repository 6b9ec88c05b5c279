"""Uncertainty of an estimate: covariance and noise, by its linear model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, IntArray
from pkmcal.estimation.chosen_covariance import chosen_covariance, own_deviations
from pkmcal.estimation.coarse_readings import Coarse, coarse_readings, component_of
from pkmcal.estimation.cut_readings import Cut, cut_readings
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.estimate import Estimate
from pkmcal.estimation.estimator import Estimator
from pkmcal.estimation.linear_model import prior_residual
from pkmcal.estimation.misfits import rounding, rounding_of_readings
from pkmcal.estimation.row_blocks import RowBlocks
from pkmcal.estimation.set_noise import slipped
from pkmcal.estimation.solving import FEW, unknown_noise
from pkmcal.measurements.measurements import Measurements
from pkmcal.result import ReadOnly, read_only
from pkmcal.statistics.covariance import Covariance, CovarianceRule
from pkmcal.statistics.linear_fit import (
    LinearFit,
    Solved,
    met_exactly,
    numbered,
    reweighted,
)
from pkmcal.statistics.noise import Noise, Split, joined, noise, split
from pkmcal.statistics.weighed import Weighed

ROUNDED = 1e3  # times errors of rounding, below which residuals may be nothing else


def stated_variances(measured: Measurements, family: int = 0) -> FloatArray | None:
    """Mean variance of one family of each row (N,), in its unit, as sigma says; None without it."""
    sigma = measured.sigma
    if sigma is None or not measured.instrument.families:
        return None
    squares = sigma**2 if sigma.ndim == 2 else np.diagonal(sigma, axis1=1, axis2=2)
    columns = measured.instrument.families[family].columns
    means: FloatArray = squares[:, list(columns)].mean(axis=1)
    return means


@dataclass(frozen=True, eq=False)
class Uncertainty(ReadOnly):
    """Covariance, degrees of freedom and noise of an estimate.

    Attributes
    ----------
    fit : LinearFit
        The linear fit at the solution, whitened.
    covariance : Covariance
        By the rule that was asked for or that the residuals call for.
    reported : ndarray (n, p)
        The reported parameters, mm and rad, by the basis of the fit.
    unknown : ndarray of bool (G,)
        Groups of equations whose noise is neither stated nor shown by spare equations.
    equations : Equations
        What was fitted.
    factors : ndarray (G,)
        `IterationState.noise`.
    slips : ndarray
        Of each set, `slipped`.
    coarse : tuple of Coarse
        Components that were read in steps which matter beside the residuals.
    cut : tuple of Cut
        Whether these were cut, as far as the fit tells.
    prior_residual : ndarray (q,)
        Residuals of the prior's rows.
    information : ndarray (G, G)
        What the residuals inform of the noise of the groups: see `pose_system.Shares`.
    considered : ndarray (p, k) or None
        How the basis follows numbers that are not fitted along, in their stated deviations.
    noise_share : float
        Of the residuals' variance, what these numbers do not explain.
    allowed : (LinearFit, ndarray) or None
        The fit with these numbers fitted along, and residuals of its prior's rows.
    """

    fit: LinearFit
    covariance: Covariance
    reported: FloatArray
    unknown: BoolArray
    equations: Equations
    factors: FloatArray
    slips: FloatArray
    coarse: tuple[Coarse, ...]
    cut: tuple[Cut, ...]
    prior_residual: FloatArray
    information: FloatArray
    considered: FloatArray | None = None
    noise_share: float = 1.0
    allowed: Solved | None = None

    @property
    def known(self) -> bool:
        """True if there is noise to state the uncertainty: stated, or shown by spare equations."""
        return not self.unknown.any()

    @cached_property
    def rounded(self) -> bool:
        """True if the residuals are nothing but rounding errors.

        Components that were read as exactly 0 and are met, as the height of a plane, do not count
        beside others: without noise of their own, rounding alone is much of them.
        """
        residual = self.fit.residual
        if np.linalg.norm(residual) >= ROUNDED * rounding(self.equations, self.factors):
            return False
        use = self.fit.without_idle(np.arange(len(residual)))
        readings = self.equations.system is None and self.equations.whole is None
        if not readings or not len(use) or len(use) == len(residual):
            return True
        errors = rounding_of_readings(self.equations, self.factors)[use]
        return bool(np.linalg.norm(residual[use]) < ROUNDED * np.linalg.norm(errors))

    @property
    def blocks(self) -> RowBlocks:
        """The rows, poses and components that the equations are of."""
        return self.equations.blocks

    @property
    def mixed(self) -> bool:
        """True if equations are mixtures of readings and closures."""
        return bool(self.equations.machines.unknowns)

    @cached_property
    def matrix(self) -> FloatArray:
        """Covariance (n, n) of the reported parameters; inf where the noise is not known."""
        if not self.known:
            return read_only(np.full((len(self.reported),) * 2, np.inf))
        return read_only(self.covariance.of(self.reported) + self._beside(self.reported))

    @cached_property
    def scaled(self) -> FloatArray:
        """Covariance (n, n) of the scaled parameters."""
        return self.covariance.of(self.fit.back) + self._beside(self.fit.back)

    @property
    def tested(self) -> LinearFit:
        """The fit for tests of the model: without what considered numbers explain of residuals."""
        return self.tested_with_prior[0]

    @property
    def tested_with_prior(self) -> Solved:
        """The tested fit, and residuals of its prior's rows."""
        return (self.fit, self.prior_residual) if self.allowed is None else self.allowed

    @cached_property
    def own_deviations(self) -> FloatArray | None:
        """Deviation of each equation (M,) in units of the present one, by its component.

        None where those that they have will do. Where a stated sigma is right for some of the
        components and too small for others, tests of the linear model take what these miss for
        what they look for.
        """
        if self.mixed or self.equations.blocks.unstated.all():
            return None  # where none is stated, they have their own already
        return own_deviations(*self.tested_with_prior, self.blocks, self._place)

    @cached_property
    def of_own_deviations(self) -> Solved:
        """The tested fit with each component in units of its own deviation, as `Solved`."""
        fit, beyond = self.tested_with_prior
        own = self.own_deviations
        return (fit, beyond) if own is None else reweighted(fit, own, beyond)

    @cached_property
    def weighed(self) -> Weighed:
        """The tested fit with the deviations of `of_own_deviations`, of equations not mixed."""
        return Weighed(self.of_own_deviations[0], self.own_deviations)

    def _beside(self, contrasts: FloatArray) -> FloatArray | float:
        """Return the covariance of contrasts (q, p) by offsets and numbers not fitted."""
        if self._offsets is None:
            return 0.0
        follow = contrasts @ self._offsets
        added: FloatArray = follow @ follow.T
        return added

    @cached_property
    def _offsets(self) -> FloatArray | None:
        """Differentiate the basis (p, k) by errors that are no noise, in their deviations."""
        cut = [each.error for each in self.cut if not each.refuted]
        columns = [*([] if self.considered is None else self.considered.T), *cut]
        return np.array(columns).T if columns else None

    @cached_property
    def freedom(self) -> FloatArray:
        """Degrees of freedom (n,) of the variances of the reported parameters."""
        if not self.known:
            return np.zeros(len(self.reported))
        own = self.covariance.freedom(self.reported)
        if self._offsets is None:
            return own
        data = np.diagonal(self.covariance.of(self.reported))
        known = ((self.reported @ self._offsets) ** 2).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            widened: FloatArray = own * (1.0 + known / data) ** 2  # what is stated is known
        return np.where(data > 0.0, widened, own)

    @cached_property
    def by_cluster(self) -> FloatArray:
        """Covariance (p, p) in the basis that allows for whatever rows of a pose share."""
        prior = self.fit.prior.T @ self.fit.prior
        matrix: FloatArray = self.covariance.by_cluster * self.noise_share + prior
        return matrix

    @cached_property
    def by_rule(self) -> FloatArray:
        """Covariance (p, p) in the basis by the rule that ± have.

        The sandwich of few poses is a rough estimate: tests by it find too much.
        """
        if self.covariance.rule == "cluster":
            return self.by_cluster
        prior = self.fit.prior.T @ self.fit.prior
        matrix: FloatArray = self.covariance.of(np.eye(len(prior)))
        return matrix

    def in_units(self, whitened: FloatArray) -> FloatArray:
        """Whitened values (M,) in mm, angles as their arcs."""
        parts = self.equations.whitening.unwhiten(whitened, self.factors)
        arcs = self.equations.arcs
        every = [(arc * part).ravel() for arc, part in zip(arcs, parts, strict=True)]
        return np.concatenate(every)[self.equations.whitening.present]

    @cached_property
    def adjusted(self) -> FloatArray:
        """Residuals (M,) with the variance of the errors, mm."""
        return self.in_units(self.covariance.sandwich.residual)

    def lengths_of(self, i: int) -> BoolArray:
        """Equations (M,) of set `i` that are lengths."""
        chosen: BoolArray = self.blocks.length & (self.blocks.set_of == i)
        return chosen

    @cached_property
    def idle(self) -> BoolArray:
        """Equations (M,) of components that are met exactly, such as the height of a plane."""
        if self.mixed:
            return np.zeros(len(self.fit.residual), dtype=bool)
        return met_exactly(self.fit.residual, self.fit.component)

    def noise_of_moving(self, i: int, family: int = 0) -> float:
        """Variance of `noise_of` of the equations that are not idle."""
        total = self.noise_of(i, family)[0]
        if not self.idle.any():
            return total
        mine = self.family_of(i, family) if family else self.lengths_of(i)
        return total / ((1.0 - float(self.idle[mine].mean())) or 1.0)

    def family_of(self, i: int, family: int) -> BoolArray:
        """Equations (M,) of one family of set `i`, by its number there."""
        columns = self.equations.table.sets[i].instrument.families[family].columns
        mine: BoolArray = (self.blocks.set_of == i) & np.isin(self._place, columns)
        return mine

    @cached_property
    def _place(self) -> IntArray:
        """Component of its row for each equation (M,)."""
        place = component_of(self.equations)
        return self.blocks.component if np.array_equal(place, self.blocks.component) else place

    def freedom_of_noise(self, shares: FloatArray) -> float:
        """Degrees of freedom of a variance of which groups make these shares (G,).

        inf where all of them are stated.
        """
        mine = self.equations.blocks.unstated & (shares > 0.0)
        known = self.information[np.ix_(mine, mine)]
        spread = float(shares[mine] @ np.linalg.lstsq(known, shares[mine], rcond=None)[0])
        return 1.0 / spread if spread > 0.0 else float("inf")

    @cached_property
    def noises(self) -> tuple[Noise, ...]:
        """Variances in mm² of a length of each set; NaN where nothing shows them."""
        return tuple(self.noise_of(i) for i in range(len(self.equations.table.sets)))

    def _rounding(self, i: int, family: int) -> float:
        """The largest variance that rounding alone gives one family of set `i`, mm²."""
        columns = self.equations.table.sets[i].instrument.families[family].columns
        arcs = self.equations.arcs[i]
        floors = [
            float(arcs[each.component]) * each.floor
            for each in self.coarse
            if each.set == i and each.component in columns
        ]
        return max(floors, default=0.0) ** 2

    @cached_property
    def excess(self) -> Noise:
        """Variances of an equation in units of what it was whitened by."""
        if self.equations.blocks.unstated.any() or self.fit.freedom >= FEW:
            sandwich = self.covariance.sandwich
            total, shared = noise(sandwich.residual, sandwich.retained, self.fit.key())
            shown = 1.0 - self.fit.exact / float(sandwich.retained.sum())
            return total / shown, shared / shown
        return 1.0, 0.0

    def noise_of(self, i: int, family: int = 0) -> Noise:
        """Variances in mm² of one family of set `i`; NaN where nothing shows them."""
        total, shared = self._noise(i, family)
        return total * self.noise_share, shared * self.noise_share

    def _noise(self, i: int, family: int) -> Noise:
        stated = self.stated_variances(i, family)
        if self.mixed:
            families = self.equations.table.sets[i].instrument.families
            if not families:
                return float("nan"), 0.0
            group = self.equations.whitening.groups[i][families[family].columns[0]]
            own = float(self.factors[group] ** 2 if stated is None else stated.mean())
            return float("nan") if self.unknown[group] else own * self.excess[0], 0.0
        if stated is not None and self.fit.freedom < FEW:
            return float(stated.mean()), 0.0
        mine = self.family_of(i, family) if family else self.lengths_of(i)
        retained = self.covariance.sandwich.retained[mine]
        total, shared = noise(self.adjusted[mine], retained, numbered(self.fit.key()[mine]))
        return max(total, self._rounding(i, family)), shared

    def stated_variances(self, i: int, family: int = 0) -> FloatArray | None:
        """`stated_variances` of set `i` in mm², of angles those of their arcs."""
        m = self.equations.table.sets[i]
        stated = stated_variances(m, family)
        if stated is None:
            return None
        first = m.instrument.families[family].columns[0]
        variances: FloatArray = self.equations.arcs[i][first] ** 2 * stated
        return variances

    @cached_property
    def _repeated(self) -> IntArray | None:
        """Number of the reading of each equation (M,): repeats of it have the same.

        None where nothing was read again.
        """
        key = self.fit.key()
        if int(key.max()) + 1 < len(key):
            key = numbered(key, self.blocks.target)
        return key if int(key.max()) + 1 < len(key) else None

    def repeats(self, plain: bool = False) -> Split:
        """Pure error and lack of fit, whitened; `plain`: of lengths in mm.

        None of mixtures: poses take part in what their repeats scatter.
        """
        if self.mixed:
            return joined([])
        key = self._repeated
        if key is None:
            return joined([])
        values = self.in_units(self.fit.residual) if plain else self.fit.residual
        leverages, parts = self.fit.leverage(), []
        for i in range(len(self.equations.table.sets)):
            mine = self.lengths_of(i) if plain else self.blocks.set_of == i
            leverage = float(leverages[mine].sum())
            if mine.any():
                parts.append(split(values[mine], numbered(key[mine]), leverage))
        return joined(parts)


def uncertainty(
    estimator: Estimator,
    estimate: Estimate,
    fit: LinearFit,
    rule: CovarianceRule,
    classes: IntArray | None = None,
) -> Uncertainty:
    """Say how sure an estimate is, of which `solved` made the linear model `fit`.

    `classes` (M,) are those of equations whose variances were estimated apart: see
    `unlike_components`.
    """
    equations, state = estimator.equations, estimate.state
    chosen = equations.parameters
    rates = chosen.reported_rates(estimate.evaluation.theta) * chosen.scale
    slips = slipped(estimator, estimate)
    beyond = prior_residual(estimator, estimate)
    found = chosen_covariance(estimator, fit, rule, beyond, slips, classes)
    coarse = coarse_readings(equations, fit, state.noise, found)
    widening = max((each.widening for each in coarse), default=1.0)
    return Uncertainty(
        fit=fit,
        covariance=found if widening == 1.0 else replace(found, widening=widening),
        reported=rates @ fit.back,
        unknown=unknown_noise(estimator, estimate),
        equations=equations,
        factors=state.noise,
        slips=slips,
        coarse=coarse,
        cut=tuple(cut_readings(equations, fit, state.noise, coarse)),
        prior_residual=beyond,
        information=estimate.shares[2],
    )
