"""The summary of a calibration: everything a person should know, on one screen."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from pkmcal import display
from pkmcal.calibration.fit_statistics import Identifiability, Misfit, ParameterTable, Repeats
from pkmcal.calibration.holdout import HeldOut
from pkmcal.display import Table, first_rows
from pkmcal.measurements.lack_of_fit import SIGNIFICANT

_WIDTH = 100  # letters on a line of the terminal
_SHORT = 12  # rows of a table that is not set side by side
_BETWEEN = 3  # letters between tables side by side


def misfit_table(misfit: Misfit, holdout: HeldOut) -> Table:
    """Misfit before and after, of fitted points and of those held out."""
    rows = [["fitted", _short(misfit.rms_before), _short(misfit.rms), ""]]
    if np.isnan(misfit.rms):  # nothing but the actuators was read
        rows = []
    if np.isfinite(misfit.closure_rms):
        pair = _short(misfit.closure_rms_before), _short(misfit.closure_rms)
        rows.append(["closures", *pair, "of the actuators"])
    if np.isfinite(holdout.rms):
        pair = _short(holdout.rms_before), _short(holdout.rms)
        rows.append(["held out", *pair, f"expected {_short(holdout.expected)}"])
    return Table(["rms [mm]", "before", "after", ""], rows, left=1)


def quality(misfit: Misfit, repeats: Repeats, observability: dict[str, float]) -> str:
    """χ² per degree of freedom, noise, lack of fit and observability in one paragraph."""
    facts = []
    chi2 = misfit.chi2_per_dof
    if np.isfinite(chi2):
        shown = f"{chi2:.2f}" if chi2 < 100 else f"{chi2:.2g}"
        facts.append(f"chi²/dof {shown} (1 ± {np.sqrt(2 / misfit.dof):.2f} expected)")
    misses = repeats.lack_of_fit_chance < SIGNIFICANT
    estimated = [_short(noise) for noise in misfit.noise if np.isfinite(noise)]
    if np.isfinite(misfit.actuator_noise):
        estimated.append(f"of the actuators {_short(misfit.actuator_noise)}")
    if estimated:
        included = ", lack of fit included" if misses else ""
        facts.append(f"noise {', '.join(estimated)} mm, estimated from the residuals{included}")
    if np.isfinite(repeats.repeatability):
        text = f"repeats scatter by {_short(repeats.repeatability)} mm"
        if misses:
            text += f", lack of fit beyond that {_short(repeats.lack_of_fit)} mm"
        elif np.isfinite(repeats.lack_of_fit_chance):
            text += f", no lack of fit beyond that (p {repeats.lack_of_fit_chance:.2g})"
        facts.append(text)
    facts.append(" ".join(f"{key} {value:.2g}" for key, value in observability.items()))
    return filled("", "; ".join(facts))


def limits(
    identifiability: Identifiability,
    parameters: int,
    correlations: Sequence[tuple[str, str, float]],
    outliers: Sequence[int],
    at_bounds: Sequence[str],
    idle: int,
) -> Iterator[str]:
    """Where the result has limits: rank, correlations, outliers, bounds."""
    yield from (filled("", text) for text in identifiability.gauges)
    if identifiability.rank < parameters:
        gap = f", gap {identifiability.gap:.0e}" if np.isfinite(identifiability.gap) else ""
        told = "; unidentifiable combinations:" if identifiability.unidentifiable else ""
        yield f"rank {identifiability.rank} of {parameters}{gap}{told}"
        yield from (filled("  ", text) for text in identifiability.unidentifiable[:4])
        if len(identifiability.unidentifiable) > 4:
            yield f"  and {len(identifiability.unidentifiable) - 4} more"
    if correlations:
        shown = ", ".join(f"{a} / {b} {value:+.3f}" for a, b, value in correlations[:3])
        more = f" and {len(correlations) - 3} more" if len(correlations) > 3 else ""
        yield filled("correlated: ", shown + more)
    if idle:
        yield (
            f"{idle} {'poses say' if idle > 1 else 'pose says'} nothing: what was read there"
            " determines the pose at most"
        )
    if outliers:
        yield filled("outliers: ", f"rows {first_rows(outliers, 10)}")
    if at_bounds:
        yield filled("at a bound, ± as if it were not there: ", ", ".join(at_bounds))


def parameter_rows(table: ParameterTable) -> Table:
    """The parameters with their uncertainty, in as many columns as one screen takes."""
    rows = []
    for name, unit, value, sigma, start in zip(
        table.free, table.units, table.values, table.stderr, table.start, strict=True
    ):
        number, shown_unit = display.displayed(float(value), unit)
        deviation, _ = display.displayed(float(sigma), unit)
        change, _ = display.displayed(float(value - start), unit)
        places = display.decimals(deviation) if np.isfinite(deviation) else 4
        label = f"{name} [{shown_unit}]" if shown_unit != "mm" else name
        text = display.with_uncertainty(number, deviation)
        if not np.isfinite(deviation):
            text = f"{display.fixed(number, places)} ± {deviation:g}"
        rows.append([label, text, display.fixed(change, places)])
    one = Table(["parameter", "value", "change"], rows, left=1)
    width = max(map(len, str(one).splitlines())) + _BETWEEN
    columns = min((_WIDTH + _BETWEEN) // width, -(-len(rows) // _SHORT))
    return replace(one, columns=max(columns, 1))


def filled(lead: str, text: str) -> str:
    """A paragraph that begins with `lead`, its further lines indented below."""
    return textwrap.fill(lead + text, _WIDTH, subsequent_indent=" " * max(len(lead), 2))


def _short(value: float) -> str:
    return f"{value:.3g}"
