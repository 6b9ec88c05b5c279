"""Check whether a calibration was worth it: how the misfit changed."""

from __future__ import annotations

import numpy as np

from pkmcal.diagnostics.check import Check
from pkmcal.fitted.solution import Solution
from pkmcal.statistics.holdout_test import RATIO
from pkmcal.statistics.noise import SIGNIFICANT

_GAIN = 0.9  # of the misfit that must not be left for a calibration to be worth it


def _little_gained(found: Solution) -> bool:
    sure = found.fit.uncertainty
    if not sure.blocks.unstated.any() and sure.covariance.scale <= RATIO:
        return False  # the residuals are what sigma says
    if found.lack_of_fit_chance > SIGNIFICANT:
        return False  # they are what repeats scatter
    before, after, _ = _misfit(found)
    if not after > _GAIN * before:
        return False
    # of pictures single corners scatter by more than machines are off: actuators then tell the gain
    return not found.closure_rms < _GAIN * found.closure_rms_before


def _other_causes(found: Solution) -> str:
    """Name other causes of a misfit that the calibration hardly lowered."""
    if not found.fit.uncertainty.equations.blocks.unstated.any():
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


def change(found: Solution) -> str:
    """Say how the misfit changed."""
    before, after, name = _misfit(found)
    changed = f"{name} {_falls(before, after)}"
    if not found.holdout_off.size:
        return f"the misfit of {changed}; none was held out"
    known = np.isfinite(found.holdout_expected)
    return f"the error of {changed}" + (
        f" ({found.holdout_expected:.3g} expected)" if known else ""
    )


def _points(count: int, which: str, outliers: int) -> str:
    besides = f" besides {outliers} outlier{'s' if outliers > 1 else ''}" if outliers else ""
    return f"{count - outliers} {which} point{'s' if count - outliers > 1 else ''}{besides}"


def _falls(before: float, after: float) -> str:
    first, last = f"{before:.3g}", f"{after:.3g}"
    verb = "falls" if after < before and first != last else "goes"
    return f"{verb} from {first} to {last} mm rms"


CHECKS = (
    Check(
        name="little-gained", about="the misfit hardly fell, and nothing else says why",
        unless=("grave", "doubt"),
        run=lambda found: (change(found),) if _little_gained(found) else (),
        say=lambda found, changed: f"little was gained, {changed}: {_other_causes(found)}",
    ),
)  # fmt: skip
