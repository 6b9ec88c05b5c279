"""The summary of a calibration: everything a person should know, on one screen."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from pkmcal import display
from pkmcal.arrays import BoolArray, FloatArray, rms
from pkmcal.display import Table, first_rows, printable
from pkmcal.estimation.identifiability import listed
from pkmcal.fitted.distances import Distances
from pkmcal.fitted.holdout import HeldOut
from pkmcal.fitted.instruments import CalibratedPicture
from pkmcal.fitted.nuisances import Nuisance
from pkmcal.fitted.solution import Solution
from pkmcal.statistics.distributions import FEW
from pkmcal.statistics.noise import SIGNIFICANT

_WIDTH = 100  # letters on a line of the terminal
_SHORT = 12  # rows of a table that is not set side by side
_BETWEEN = 3  # letters between tables side by side
_REMARKS = 3  # of a verdict that are shown; the report has all
_SHARED = 0.5  # of a reading's own noise, from which what its pose shares is said
WIDER = (
    "± of loss 'cauchy' are for gross rows among sound ones; where the model itself is wrong, 95 %"
    " intervals held 73 to 84 % on a real arm, those of loss 'linear' 89 to 96 %"
)


def notes(remarks: Sequence[str]) -> Iterator[str]:
    """Remarks of a verdict, as many as a screen takes, and how many more there are."""
    yield from (filled("  note: ", text) for text in remarks[:_REMARKS])
    more = len(remarks) - _REMARKS
    if more > 0:
        yield f"  {more} more note{'s' * (more > 1)}: in the report (verdict.remarks)"


def misfit_table(found: Solution) -> Table:
    """Misfit before and after, of fitted points and of those held out."""
    rows = []
    if np.isfinite(found.rms):
        rows.append(
            ["fitted", *_cells(found.distances_before, found.distances, found.outliers), ""]
        )
    if np.isfinite(found.closure_rms):
        pair = _short(found.closure_rms_before), _short(found.closure_rms)
        rows.append(["closures", *pair, "", "", "", "of the actuators"])
    if np.isfinite(found.holdout_rms):
        known = np.isfinite(found.holdout_expected)
        expected = f"rms {_short(found.holdout_expected)} expected" if known else ""
        cells = _cells(
            found.holdout_distances_before, found.holdout_distances, found.holdout_outliers
        )
        rows.append(["held out", *cells, expected])
    heads = ["misfit [mm]", "rms before", "rms after", "median", "95 %", "rms without outliers", ""]
    odd = found.outliers or found.holdout_outliers
    kept = [
        k for k in range(len(heads)) if k < 5 or (k == 5 and odd)
        or (k == 6 and any(row[6] for row in rows))
    ]  # fmt: skip
    return Table([heads[k] for k in kept], [[row[k] for k in kept] for row in rows], left=1)


def counts(read: BoolArray) -> str:
    """Count the fitted rows, and those in which more was read than the actuators."""
    points, others = int(read.sum()), int((~read).sum())
    found = []
    if points:
        found.append(f"{points} measured point{'s' if points > 1 else ''}")
    if others:
        found.append(f"{others} row{'s' if others > 1 else ''}")
        if points:
            found[-1] += " where only actuators were read"
    return " and ".join(found)


def _cells(before: Distances, after: Distances, outliers: Sequence[int]) -> list[str]:
    numbers = before.rms, after.rms, after.median, after.quantile95, after.rms_without_outliers
    cells = [_short(number) for number in numbers]
    if outliers:
        left = cells[-1] if np.isfinite(numbers[-1]) else "none is left"
        cells[-1] = f"{left} ({len(outliers)})"
    return cells


def quality(found: Solution) -> str:
    """χ² per degree of freedom, noise, lack of fit and observability in one paragraph."""
    facts = []
    chi2 = found.chi2_per_dof
    if np.isfinite(chi2):
        shown = f"{chi2:.2f}" if chi2 < 100 else f"{chi2:.2g}"
        expected = f"1 ± {np.sqrt(2 / found.dof):.2f} expected, dof {_count(found.dof)}"
        facts.append(f"chi²/dof {shown} ({expected})")
    facts += _noise(found)
    misses = found.lack_of_fit_chance < SIGNIFICANT
    if np.isfinite(found.repeatability):
        text = f"repeats scatter by {_short(found.repeatability)} mm"
        if misses:
            text += f", lack of fit beyond that {_short(found.lack_of_fit)} mm"
        elif np.isfinite(found.lack_of_fit_chance):
            text += f", no lack of fit beyond that (p {found.lack_of_fit_chance:.2g})"
        facts.append(text)
    facts.append(" ".join(f"{key} {value:.2g}" for key, value in found.observability.items()))
    return filled("", "; ".join(facts))


def pictures(listed: Sequence[CalibratedPicture]) -> str:
    """Distances of pictured boards from where the machine is, rms, and the worst picture."""
    facts = []
    for use in ("fitted", "held out"):
        own = [each for each in listed if each.use == use and np.isfinite(each.seen.across)]
        if own:
            across, along, corners = (
                rms(np.array([getattr(each.seen, name) for each in own]))
                for name in ("across", "along", "off")
            )
            facts.append(
                f"of {len(own)} pictures {use} the board is off by {_short(across)} mm across the"
                f" line of sight and {_short(along)} along it, corners by {_short(corners)} px"
                " beyond that"
            )
    worst = max(listed, key=lambda each: np.nan_to_num(each.seen.off_commanded, nan=-1.0))
    shown = f"worst {printable(worst.name)}, {_short(worst.seen.off_commanded)} px in all"
    return filled("", "; ".join([*facts, shown])) if facts else ""


def by_itself(deviation: FloatArray) -> str:
    """Standard deviation of the machine at the measured poses, wherever its frames lie."""
    sure = deviation[np.isfinite(deviation)]
    if not len(sure):
        return filled("", "how the machine moves is not determined at the measured poses")
    unknown = len(deviation) - len(sure)
    beyond = f"; not determined at {unknown} of them" if unknown else ""
    return filled(
        "",
        f"the machine is known to ± {_short(rms(sure))} mm at the measured poses, wherever its base"
        f" and platform are{beyond}",
    )


def _count(dof: float) -> str:
    return f"{dof:.3g}" if dof < 100 else f"{dof:.0f}"


def _noise(misfit: Solution) -> Iterator[str]:
    """The noise that was estimated, what of it a pose shares, and how components differ."""
    split = [
        (own, pose)
        for own, pose in zip(misfit.reading_noise, misfit.pose_noise, strict=True)
        if np.isfinite(own)
    ]
    own = zip(misfit.noise, misfit.component_noise, misfit.component_units, strict=True)
    estimated = [_with_pixels(*each) for each in own if np.isfinite(each[0])]
    if np.isfinite(misfit.actuator_noise):
        estimated.append(f"of the actuators {_short(misfit.actuator_noise)}")
    if any(pose > _SHARED * own for own, pose in split):
        parts = [
            f"{_short(np.hypot(own, pose))} mm a coordinate, {_short(own)} of a reading and"
            f" {_short(pose)} that rows of a pose share"
            for own, pose in split
        ]
        yield f"noise {', '.join(parts)}"
    elif estimated:
        how = f"estimated from the residuals (dof {_count(misfit.dof)})"
        yield f"noise {', '.join(estimated)} mm, {how}"
    if np.isfinite(misfit.tension_noise):
        yield f"noise of the load cells {_short(misfit.tension_noise)} N, estimated likewise"
    elif np.isfinite(misfit.tension_rms):
        yield f"load cells off by {_short(misfit.tension_rms)} N rms"
    if not misfit.told_apart:
        return
    several = misfit.components, misfit.component_noise, misfit.component_units
    for names, deviations, units in zip(*several, strict=True):
        each = [_of_component(*own) for own in zip(names, deviations, units, strict=True)]
        yield f"noise of {', '.join(each)}"


def _with_pixels(noise: float, deviations: Sequence[float], units: Sequence[str]) -> str:
    """A deviation in mm, of pixels in px before it."""
    pixels = [each for each, unit in zip(deviations, units, strict=True) if unit == "px"]
    shown = f"{_short(float(np.sqrt(np.mean(np.square(pixels)))))} px or " if pixels else ""
    return shown + _short(noise)


def _of_component(name: str, deviation: float, unit: str) -> str:
    value, shown = display.displayed(deviation, unit)
    return f"{name} {_short(value)} {shown}"


def limits(
    identifiability: Solution,
    parameters: int,
    correlations: Sequence[tuple[str, str, float]],
    odd: str,
    outliers: Sequence[int],
    frames: bool,
) -> Iterator[str]:
    """List the limits of the result: rank, correlations, outliers; `odd` names the last.

    `frames`: whether a datum may be what is missing.
    """
    yield from (filled("", text) for text in identifiability.gauges)
    if identifiability.rank < parameters:
        gap = f", gap {identifiability.gap:.0e}" if np.isfinite(identifiability.gap) else ""
        heading = "; unidentifiable combinations:" if identifiability.unidentifiable else ""
        yield f"rank {identifiability.rank} of {parameters}{gap}{heading}"
        yield from (filled("  ", text) for text in identifiability.unidentifiable[:4])
        if len(identifiability.unidentifiable) > 4:
            yield f"  and {len(identifiability.unidentifiable) - 4} more"
        if frames and identifiability.unidentifiable:
            yield filled(
                "  ",
                "--datum auto (fix='datum') holds the numbers that only say where frames lie;"
                " the others then have finite ±",
            )
    if correlations:
        shown = ", ".join(f"{a} / {b} {value:+.3f}" for a, b, value in correlations[:3])
        more = f" and {len(correlations) - 3} more" if len(correlations) > 3 else ""
        yield filled("correlated: ", shown + more)
    if outliers:
        where = "" if odd.startswith("row ") else f": {odd}"
        yield filled(
            "outliers: ", f"row{'s' * (len(outliers) > 1)} {first_rows(outliers, 10)}{where}"
        )


def sessions(names: Sequence[str]) -> str:
    """Name the sessions, and the one that the robot is of."""
    shown = ", ".join(map(display.printable, names))
    last = display.printable(names[-1])
    return filled("sessions: ", f"{shown}; numbers without an @ are common, the robot is {last}'s")


def own_numbers(found: HeldOut) -> Table:
    """Numbers of sessions that were held out."""
    rows = []
    for name, (value, sigma) in found.holdout_own.items():
        unit = found.holdout_units[name]
        number, shown = display.displayed(value, unit)
        deviation, _ = display.displayed(sigma, unit)
        label = f"{name} [{shown}]"
        text = display.with_uncertainty(number, deviation)
        if not np.isfinite(deviation):
            text = f"{display.fixed(number, 4)} ± {deviation:g}"
        rows.append([label, text])
    return Table(["found for the points held out", "value"], rows, left=1)


def fitted_along(beside: Sequence[Nuisance]) -> str:
    """Count the uncertain numbers that were fitted as well, and name those that moved."""
    far = [each.name for each in beside if each.moved]
    shown = f"; in the table those that moved by more than twice it: {listed(far)}" if far else ""
    many = "1 number was" if len(beside) == 1 else f"{len(beside)} numbers were"
    within = "its" if len(beside) == 1 else "their"
    return filled("", f"{many} fitted along within {within} stated uncertainty{shown}")


def bounds(names: Sequence[str]) -> str:
    """Name the parameters that ended at a bound."""
    return filled("at a bound, ± as if it were not there: ", ", ".join(names))


def parameter_rows(table: Solution) -> Iterator[str | Table]:
    """The parameters with their uncertainty, in as many columns as one screen takes.

    Where few degrees of freedom are left, half widths of 95 % intervals, and a line that says so.
    """
    sure = np.isfinite(table.stderr)
    least = float(table.parameter_dof[sure].min()) if sure.any() else np.inf
    half = (table.interval95[:, 1] - table.interval95[:, 0]) / 2.0
    wide = least < FEW
    rows = []
    for name, unit, value, sigma, start in zip(
        table.free,
        table.units,
        table.values,
        half if wide else table.stderr,
        table.start,
        strict=True,
    ):
        number, shown_unit = display.displayed(float(value), unit)
        deviation, _ = display.displayed(float(sigma), unit)
        change, _ = display.displayed(display.changed(float(value), float(start), unit), unit)
        places = display.decimals(deviation) if np.isfinite(deviation) else 4
        label = f"{name} [{shown_unit}]"
        text = display.with_uncertainty(number, deviation)
        if not np.isfinite(deviation):
            text = f"{display.fixed(number, places)} ± {deviation:g}"
        rows.append([label, text, display.rounded(change, places)])
    one = Table(["parameter", "value ± 95 %" if wide else "value", "change"], rows, left=1)
    width = max(map(len, str(one).splitlines())) + _BETWEEN
    columns = min((_WIDTH + _BETWEEN) // width, -(-len(rows) // _SHORT))
    yield replace(one, columns=max(columns, 1))
    if wide:
        yield filled(
            "",
            "± are half widths of 95 % intervals, by Student's t: as few as"
            f" {least:.2g} degrees of freedom are left",
        )
    if table.loss == "cauchy":
        yield filled("", WIDER)


def filled(lead: str, text: str) -> str:
    """A paragraph that begins with `lead`, its further lines indented below."""
    return textwrap.fill(lead + text, _WIDTH, subsequent_indent=" " * max(len(lead), 2))


def _short(value: float) -> str:
    return f"{value:.3g}"
