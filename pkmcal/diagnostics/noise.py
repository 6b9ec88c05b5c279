"""Check whether residuals are what the stated sigma says, and enough of them show the noise."""

from __future__ import annotations

import numpy as np

from pkmcal.diagnostics.check import Check, Remedy, at_most_one
from pkmcal.estimation.set_noise import apart
from pkmcal.estimation.solving import FEW, LEAST_FREEDOM
from pkmcal.fitted.solution import Solution
from pkmcal.readings.reading import Reading
from pkmcal.statistics.covariance import spare
from pkmcal.statistics.distributions import chi2_tail, deviation_interval

NOISY = 9.0  # chi²/dof that a slip in sigma does not explain
_CHANCE = 0.01  # of residuals so small, if sigma is right
_SMALL, _LARGE = 0.5, 1.5  # times sigma, below and above which residuals are worth a word
_CAUCHY = Remedy("loss", "cauchy")


def _few_spare(found: Solution) -> tuple[float, ...]:
    """Spare equations where they are few, and the noise has to be estimated from them."""
    sure = found.fit.uncertainty
    if sure.fit.freedom >= FEW or not sure.blocks.unstated.any():
        return ()
    # of mixtures `noise-unknown` names the groups, and `too-few-rows` says that nothing is left
    said_elsewhere = not sure.known and (sure.mixed or found.dof < LEAST_FREEDOM)
    return () if said_elsewhere else (sure.fit.freedom,)


def _few_spare_text(found: Solution, freedom: float) -> str:
    advice = {measured.instrument.more for measured in found.fit.equations.table.sets}
    more = advice.pop() if len(advice) == 1 else Reading.more
    if not found.fit.uncertainty.known:
        return (
            f"as many numbers as equations: nothing shows how good the fit is; {more}, or state"
            " sigma"
        )
    low, high = deviation_interval(freedom)
    one = round(freedom, 1) == 1
    equations = "1 spare equation shows" if one else f"{freedom:.2g} spare equations show"
    blind = ""
    if found.holdout_test is not None:
        blind = (
            ", and held-out points contradict the fit only from"
            f" {found.holdout_test.least_ratio:.2g} times what is expected"
        )
    return (
        f"only {equations} the noise, which may be {low:.2g} to {high:.2g} times what is estimated"
        f"{blind}; {more}, or state sigma"
    )


def _too_noisy(found: Solution) -> tuple[float, ...]:
    """Residuals in units of sigma, where that is far too much."""
    scale = float(np.sqrt(found.chi2_per_dof))
    if found.loss != "linear" and found.fit.equations.sigma_stated:
        # of pseudo-residuals: rows that are weighed down say nothing about sigma
        scale = found.fit.uncertainty.covariance.scale
    return at_most_one(scale if scale**2 > NOISY else None)


def _too_noisy_text(found: Solution, scale: float) -> str:
    """Describe what is wrong and what helps: repeats decide between the two causes."""
    wrong = f"residuals are {scale:.3g} times what sigma says"
    scatter = found.fit.uncertainty.repeats().scatter
    if scatter**2 > NOISY:
        first = ": look at the outliers; without any," if found.outliers else ","
        return (
            f"{wrong}: repeats of a pose scatter {scatter:.3g} times as much as it{first} state the"
            " true sigma"
        )
    cure = "free more parameters"
    if not np.isfinite(scatter):
        cure += ", or state the true sigma"
    if found.outliers:
        robust = "" if found.loss == "cauchy" else f" fit with {_CAUCHY},"
        cure = f"look at the outliers,{robust} or {cure}"
    return f"{wrong}: {cure}"


def _against_noise(found: Solution, scale: float) -> tuple[Remedy, ...]:
    if found.fit.uncertainty.repeats().scatter ** 2 > NOISY:
        return ()  # sigma stands in the measurements
    robust = found.outliers and found.loss != "cauchy"
    return (_CAUCHY, Remedy("free")) if robust else (Remedy("free"),)


def _unlike_sets(found: Solution) -> tuple[dict[int, float], ...]:
    """Sets by number of which residuals in units of sigma are unlike those of the others."""
    slips = found.fit.uncertainty.slips.tolist()
    return at_most_one({i: ratio for i, ratio in enumerate(slips) if apart(ratio)} or None)


def _unlike_sets_text(found: Solution, ratios: dict[int, float]) -> str:
    sets = found.fit.equations.table.sets
    parts = " and ".join(
        f"{sets[i].instrument.argument or f'measurements {i + 1}'} are {ratio:.2g}"
        for i, ratio in ratios.items()
    )
    return (
        f"the residuals of {parts} times what sigma says: the sets are weighted wrongly beside each"
        " other; state the true sigma, or none"
        + (", or look at the outliers first" if found.outliers else "")
    )


def _unestimated(found: Solution) -> tuple[tuple[str, ...], ...]:
    """Groups of equations the noise of which is neither stated nor shown."""
    sure, equations = found.fit.uncertainty, found.fit.equations
    if not (sure.mixed and sure.unknown.any()):
        return ()
    names = []
    for i, m in enumerate(equations.table.sets):
        several = len(m.instrument.families) > 1
        names += [
            f"of {family.noun} of measurements {i + 1}" if several else f"of measurements {i + 1}"
            for family in m.instrument.families
        ]
    names += ["of the load cells"] if equations.machines.cells else []
    groups = zip([*names, "of the actuators"], sure.unknown, strict=True)
    return (tuple(name for name, unknown in groups if unknown),)


def _unestimated_text(found: Solution, groups: tuple[str, ...]) -> str:
    cells = found.fit.equations.machines.cells
    sigmas = "sigma, actuator_sigma and tension_sigma" if cells else "sigma and actuator_sigma"
    return f"too little is left over to estimate the noise {' and '.join(groups)}: state {sigmas}"


def _stated(found: Solution) -> bool:
    return not found.fit.uncertainty.equations.blocks.unstated.any()


def _widened(found: Solution) -> tuple[float, ...]:
    """Return the factor by which ± exceed those of sigma alone, where that is worth a word."""
    scale = found.fit.uncertainty.covariance.scale
    least = {"classical": 1.0, "cluster": _LARGE}[found.covariance_rule]
    return at_most_one(scale if _stated(found) and scale > least else None)


def _widened_text(found: Solution, scale: float) -> str:
    causes = "sigma is too small, or numbers that are not free are wrong"
    if found.covariance_rule == "cluster":
        return f"± allow for residuals that are {scale:.2g} times what sigma says: {causes}"
    also = f": {causes}" if scale > _LARGE else ""
    return (
        f"± are {scale:.2g} times as wide as sigma alone would make them, since the residuals are"
        f" that much larger{also}"
    )


def _too_quiet(found: Solution) -> tuple[float, ...]:
    """Residuals in units of sigma, where they are clearly smaller."""
    if not _stated(found) or found.loss != "linear":
        return ()
    squares, freedom = spare(found.fit.uncertainty.fit)
    if not chi2_tail(squares, freedom) > 1.0 - _CHANCE:
        return ()
    ratio = float(np.sqrt(squares / freedom))
    return at_most_one(ratio if ratio < _SMALL else None)


CHECKS = (
    Check(
        name="few-spare-equations", about="few equations are left over to show the noise",
        run=_few_spare, say=_few_spare_text,
    ),
    Check(
        name="sigma", about="residuals are far larger than sigma says", at_once=True,
        run=_too_noisy, say=_too_noisy_text, remedies=_against_noise,
    ),
    Check(
        name="sets-unlike", about="the sigma of some sets is wrong beside that of the others",
        at_once=True, run=_unlike_sets, say=_unlike_sets_text,
    ),
    Check(
        name="noise-unknown",
        about="too little is left over to estimate the noise of some readings", at_once=True,
        run=_unestimated, say=_unestimated_text,
    ),
    Check(
        name="sigma-too-small", about="residuals are larger than sigma says, which ± count",
        levels=("remark",), run=_widened, say=_widened_text,
    ),
    Check(
        name="sigma-too-large", about="residuals are clearly smaller than sigma says",
        levels=("remark",), run=_too_quiet,
        say=lambda found, ratio: (
            f"the residuals are only {ratio:.2g} times what sigma says: if it is the noise it is"
            " too large, and so are ±"
        ),
    ),
)  # fmt: skip
