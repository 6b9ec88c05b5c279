"""Whether a calibration can be believed, and why not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.diagnostics.displaced import DisplacedTarget
from pkmcal.diagnostics.drift import Drift
from pkmcal.diagnostics.linearity import Weak, beyond_linear
from pkmcal.diagnostics.measuring_order import MeasuringOrder
from pkmcal.diagnostics.moved import Moved
from pkmcal.diagnostics.robust_check import RobustCheck
from pkmcal.diagnostics.row_errors import likely_row_errors
from pkmcal.display import chance_text, decimals, displayed, fixed, printable
from pkmcal.estimation.estimator import FEW, LEAST_FREEDOM
from pkmcal.estimation.identifiability import listed
from pkmcal.fitted.row_names import row_names
from pkmcal.fitted.slack import listed_slack
from pkmcal.fitted.solution import Solution
from pkmcal.measurements.measurements import Measurements
from pkmcal.statistics.covariance import spare
from pkmcal.statistics.distributions import chi2_tail, deviation_interval
from pkmcal.statistics.holdout_test import CHANCE, RATIO
from pkmcal.statistics.noise import SIGNIFICANT

State = Literal["calibrated", "doubtful", "not calibrated"]

_GAIN = 0.9  # of the misfit that must not be left for a calibration to be worth it
_ABSURD = 0.02  # share of the spread of the commanded positions that no sound fit leaves
_SMALL, _LARGE = 0.5, 1.5  # times sigma, below and above which residuals are worth a word
_LONGEST = 1000  # letters of a reason: names of others may be in it


@dataclass(frozen=True)
class Verdict:
    """Whether the result can be believed.

    Attributes
    ----------
    state : {"calibrated", "doubtful", "not calibrated"}
        "calibrated": nothing that was looked at speaks against it.
    reasons : tuple of str
        Why, the gravest first.
    remarks : tuple of str
        What one should know besides.

    Examples
    --------
    >>> print(Verdict("doubtful", ("1 spare equation is too few",), ()))
    Doubtful: 1 spare equation is too few
    """

    state: State
    reasons: tuple[str, ...]
    remarks: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.state.capitalize()}: {self.reasons[0]}"


def judge(
    found: Solution,
    robust: RobustCheck | None,
    moved: tuple[Moved, ...],
    drift: Drift | None = None,
    order: MeasuringOrder | None = None,
    displaced: DisplacedTarget | None = None,
) -> Verdict:
    """Judge a calibration.

    Parameters
    ----------
    found : Solution
        The calibration.
    robust : RobustCheck or None
        A robust fit beside it, where there is one.
    moved : tuple of Moved
        What moved between the fitted points and those held out.
    drift : Drift or None
        Whether repeated poses moved with time, where any were.
    order : MeasuringOrder or None
        Whether residuals follow the order of measuring, where enough are left to say.
    displaced : DisplacedTarget or None
        Which known target of several seems to be elsewhere.
    """
    grave = _grave(found, robust)
    doubts = [*_contradicted(found, moved), *_few(found)]
    if found.at_bounds:
        doubts.append(
            f"{listed(found.at_bounds)} ended at a bound: the fit would go further; widen the"
            " bound, or see what else is wrong"
        )
    if drift is not None and drift.large:
        doubts.append(str(drift))
    order = None if grave or (drift is not None and drift.found) else order
    if order is not None and order.large:
        doubts.append(str(order))
    displaced = None if grave else displaced
    if displaced is not None and displaced.large:
        doubts.append(str(displaced))
    doubts += found.warnings
    weak = None if grave else beyond_linear(found.fit.estimate, found.fit.uncertainty)
    if weak is not None and not weak.assembled:
        doubts.append(str(weak))
    if not grave and not doubts and _little_gained(found):
        doubts.append(f"little was gained, {_change(found)}: {_other_causes(found)}")
    remarks = _remarks(found, robust, drift, weak)
    if order is not None and order.found and not order.large:
        remarks = (printable(str(order), _LONGEST), *remarks)
    if displaced is not None and displaced.found and not displaced.large:
        remarks = (printable(str(displaced), _LONGEST), *remarks)
    reasons = tuple(printable(text, _LONGEST) for text in grave + doubts)
    if grave:
        return Verdict("not calibrated", reasons, remarks)
    if doubts:
        return Verdict("doubtful", reasons, remarks)
    return Verdict("calibrated", (_change(found),), remarks)


def _grave(found: Solution, robust: RobustCheck | None) -> list[str]:
    """What makes a result no calibration."""
    reasons = []
    if not found.fit.machine_combinations() and len(found.fit.parameters.places):
        reasons.append("these measurements determine no number of the machine, which is unchanged")
    if not found.converged:
        reasons.append("the least squares did not converge")
    if robust is not None and robust.carried:
        reasons.append(_disagreement(found, robust))
    spread = _commanded_spread(found)
    left = np.nanmax([found.distances.rms_without_outliers, found.closure_rms, 0.0])
    if left > _ABSURD * spread > 0:
        other = likely_row_errors(found.fit.equations.datasets, found.fit.parameters)
        cause = "; ".join(other) or (
            "check that robot file and measurements belong together, row by row"
        )
        reasons.append(
            f"{_mm(left)} rms are left where the machine moved about by {_mm(spread)}: {cause}"
        )
    return reasons


def _commanded_spread(found: Solution) -> float:
    """Rms distance of the commanded positions, by the nominal machine, from their mean, mm."""
    start = found.fit.start
    places = start.pose[start.status == 0, :3]
    return float(np.sqrt(((places - places.mean(axis=0)) ** 2).sum(axis=1).mean()))


def _contradicted(found: Solution, moved: tuple[Moved, ...]) -> list[str]:
    """What points that were held out say against the fit."""
    reasons = []
    if found.holdout_contradicts:
        reasons.append(
            f"the held-out points contradict the fit: {_mm(found.holdout_rms)} rms where"
            f" {_mm(found.holdout_expected)} is expected ({chance_text(found.holdout_chance)})"
        )
    elif found.holdout_outliers and _off(found) > RATIO * found.holdout_expected:
        reasons.append(_few_off(found))
    if moved:
        reasons.append(_moved_text(moved))
    return reasons


def _off(found: Solution) -> float:
    """Rms of the held-out points without the outliers among them."""
    return found.holdout_distances.rms_without_outliers


def _few_off(found: Solution) -> str:
    count = len(found.holdout_outliers)
    them, are = ("them", "s are") if count > 1 else ("it", " is")
    return (
        f"{count} held-out point{are} off: {row_names(found.holdout_data, found.holdout_outliers)};"
        f" without {them} the rms is {_mm(_off(found))}, {_mm(found.holdout_expected)} is expected"
    )


def _moved_text(moved: tuple[Moved, ...]) -> str:
    parts = []
    for each in moved:
        sizes = ", ".join(map(_size, each.shift, each.stderr, each.units))
        also = f" (or as well {', '.join(each.also)})" if each.also else ""
        parts.append(f"{each} by {sizes}{also}")
    several = [repr(each) for each in dict.fromkeys(each.per_session for each in moved)]
    anew = several[0] if len(several) == 1 else f"[{', '.join(several)}]"
    options = " ".join(f"--per-session {each}" for each in several)
    return (
        "between the fitted and the held-out points moved, or the model is wrong there:"
        f" {'; '.join(parts)}; {options} (per_session={anew}) finds such numbers anew in each"
        " session"
    )


def _size(shift: float, sigma: float, unit: str) -> str:
    """A shift with its standard deviation, in the unit people read."""
    value, shown = displayed(shift, unit)
    deviation, _ = displayed(sigma, unit)
    places = decimals(deviation)
    sign, behind = "+" if value >= 0 else "", f" {shown}" if shown != "1" else ""
    return f"{sign}{fixed(value, places)} ± {fixed(deviation, places)}{behind}"


def _spare(found: Solution) -> float:
    return found.fit.uncertainty.fit.freedom


def _few(found: Solution) -> list[str]:
    """Whether enough equations are left to show the noise."""
    freedom, sure = _spare(found), found.fit.uncertainty
    if freedom >= FEW or not sure.equations.unstated.any() or (sure.mixed and not sure.known):
        return []  # a warning names the groups whose noise is not known
    heights = all(m.kind == "height" for m in found.fit.equations.sets)
    more = "probe 20 points or more" if heights else "measure more poses"
    if not sure.known:
        return (
            []
            if found.dof < LEAST_FREEDOM
            else [
                f"as many numbers as equations: nothing shows how good the fit is; {more}, or state"
                " sigma"
            ]
        )
    low, high = deviation_interval(freedom)
    one = round(freedom, 1) == 1
    spare = "1 spare equation shows" if one else f"{freedom:.2g} spare equations show"
    return [
        f"only {spare} the noise, which may be {low:.2g} to {high:.2g} times what is estimated"
        f"{_blind(found)}; {more}, or state sigma"
    ]


def _blind(found: Solution) -> str:
    """From where on points that were held out could contradict a fit of few spare equations."""
    test = found.holdout_test
    if test is None:
        return ""
    return (
        f", and held-out points contradict the fit only from {test.least_ratio:.2g} times what is"
        " expected"
    )


def _little_gained(found: Solution) -> bool:
    sure = found.fit.uncertainty
    if not sure.equations.unstated.any() and sure.covariance.scale <= RATIO:
        return False  # the residuals are what sigma says
    if found.lack_of_fit_chance > SIGNIFICANT:
        return False  # they are what repeats scatter
    before, after, _ = _misfit(found)
    return after > _GAIN * before


def _other_causes(found: Solution) -> str:
    """What else the misfit may come of where the calibration hardly lowered it."""
    if not found.fit.uncertainty.equations.unstated.any():
        return "numbers that are not free are wrong, or sigma is too small"
    if np.isfinite(found.lack_of_fit_chance):
        return "repeats scatter less, so numbers that are not free are wrong"
    return (
        "it is the noise of a machine that was good already, or comes of numbers that are not free;"
        " sigma, or every pose read again, would tell"
    )


def _misfit(found: Solution) -> tuple[float, float, str]:
    """Rms before and after of the points to judge by, without outliers, and their name."""
    held = int(np.isfinite(found.holdout_off).sum())
    if held:
        first, last = found.holdout_distances_before, found.holdout_distances
        name = _points(held, "held-out", len(found.holdout_outliers))
    elif np.isnan(found.rms):
        what = f"the closures of {len(found.rows)} rows"
        return found.closure_rms_before, found.closure_rms, what
    else:
        first, last = found.distances_before, found.distances
        points = found.rows[found.read]
        name = _points(len(points), "fitted", int(np.isin(points, found.outliers).sum()))
    return first.rms_without_outliers, last.rms_without_outliers, name


def _change(found: Solution) -> str:
    """Say how the misfit changed."""
    before, after, name = _misfit(found)
    change = f"{name} {_falls(before, after)}"
    if not found.holdout_off.size:
        return f"the misfit of {change}; none was held out"
    known = np.isfinite(found.holdout_expected)
    return f"the error of {change}" + (f" ({found.holdout_expected:.3g} expected)" if known else "")


def _points(count: int, which: str, outliers: int) -> str:
    besides = f" besides {outliers} outlier{'s' if outliers > 1 else ''}" if outliers else ""
    return f"{count - outliers} {which} point{'s' if count - outliers > 1 else ''}{besides}"


def _falls(before: float, after: float) -> str:
    first, last = f"{before:.3g}", f"{after:.3g}"
    verb = "falls" if after < before and first != last else "goes"
    return f"{verb} from {first} to {last} mm rms"


def _disagreement(found: Solution, robust: RobustCheck) -> str:
    count = len(robust.rows)
    if not count:
        return (
            f"a robust fit has {robust.ratio:.2g} times less noise: many rows disagree with the"
            " rest; fit with --loss cauchy (loss='cauchy') and look at the residuals"
        )
    rows = "row disagrees" if count == 1 else "rows disagree"
    own = found.closure_rms if np.isnan(found.rms) else found.rms
    return (
        f"{count} {rows} with the rest: {row_names(found.fit.equations.datasets, robust.rows)};"
        f" a robust fit leaves {_mm(robust.rms)} in the others, this one {_mm(own)} in all:"
        f" leave {'it' if count == 1 else 'them'} out with --drop-outliers (drop='outliers'), or"
        " fit with --loss cauchy (loss='cauchy')"
    )


def _remarks(
    found: Solution, robust: RobustCheck | None, drift: Drift | None, weak: Weak | None
) -> tuple[str, ...]:
    remarks = []
    if drift is not None and drift.found and not drift.large:
        remarks.append(str(drift))
    if found.left_out:
        remarks.append(found.left_out)
    if found.slack and found.fit.uncertainty.equations.slack_cells:
        many = f"{len(found.slack)} readings" if len(found.slack) > 1 else "1 reading"
        remarks.append(f"{many} of slack cables left out, as asked: {listed_slack(found.slack)}")
    if robust is not None and robust.disagrees and not robust.carried:
        remarks.append(_disagreement(found, robust))
    if found.holdout_outliers and not found.holdout_contradicts:
        remarks.append(_few_off(found))
    again = _fitted_again(found)
    if again:
        remarks.append(
            f"{again} of the held-out points are at poses that were fitted as well: they show how"
            " these repeat, not how good the machine is elsewhere"
        )
    stated = not found.fit.uncertainty.equations.unstated.any()
    if stated and (refuted := _refuted(found)):
        remarks.append(refuted)
    if stated and found.fit.estimate.state.loss.name == "linear" and _larger_sigma(found) < _SMALL:
        remarks.append(
            f"the residuals are only {_larger_sigma(found):.2g} times what sigma says: if it is the"
            " noise it is too large, and so are ±"
        )
    if weak is not None and weak.assembled:
        remarks.append(str(weak))
    if found.idle:
        say = "poses say" if found.idle > 1 else "pose says"
        remarks.append(
            f"{found.idle} {say} nothing: what was read there determines the pose at most"
        )
    return tuple(printable(text, _LONGEST) for text in remarks)


def _refuted(found: Solution) -> str:
    """What residuals larger than the stated sigma mean, whichever covariance counts them; or ""."""
    scale = found.fit.uncertainty.covariance.scale
    causes = "sigma is too small, or numbers that are not free are wrong"
    if found.covariance_rule == "classical" and scale > 1.0:
        also = f": {causes}" if scale > _LARGE else ""
        return (
            f"± are {scale:.2g} times as wide as sigma alone would make them, since the residuals"
            f" are that much larger{also}"
        )
    if found.covariance_rule == "cluster" and scale > _LARGE:
        return f"± allow for residuals that are {scale:.2g} times what sigma says: {causes}"
    return ""


def _larger_sigma(found: Solution) -> float:
    """Deviation of the residuals in units of sigma where that is clearly larger, else 1."""
    squares, freedom = spare(found.fit.uncertainty.fit)
    if not chi2_tail(squares, freedom) > 1.0 - CHANCE:
        return 1.0
    return float(np.sqrt(squares / freedom))


def _fitted_again(found: Solution) -> int:
    """How many rows were held out at actuators where others were fitted."""
    held = [row.tobytes() for data in found.holdout_data for row in _commands(data.measured)]
    sought = set(held)
    fitted = {
        key
        for m in found.fit.equations.sets
        for row in (_commands(m) if sought else ())
        if (key := row.tobytes()) in sought
    }
    return sum(key in fitted for key in held)


def _commands(measured: Measurements) -> FloatArray:
    """Actuators of each row, at both ends where there are two."""
    parts = [measured.actuators] + ([] if measured.other is None else [measured.other])
    return np.hstack(parts) + 0.0


def _mm(value: float) -> str:
    return f"{value:.3g} mm"
