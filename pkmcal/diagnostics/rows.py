"""Rows that are wrong: some carry the fit, were copied, stand beside others, or are of slack."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import rms
from pkmcal.diagnostics.check import Check, Level, Remedy, at_most_one
from pkmcal.diagnostics.copies import copies
from pkmcal.diagnostics.robust_check import RobustCheck, robust_check
from pkmcal.diagnostics.row_errors import likely_row_errors
from pkmcal.estimation.machine_size import stated_size
from pkmcal.fitted.row_names import row_names
from pkmcal.fitted.slack import SlackCable, listed_slack
from pkmcal.fitted.solution import Solution
from pkmcal.readings.orientation import between

_ABSURD = 0.02  # share of the spread of the commanded positions that no sound fit leaves
_CAUCHY = Remedy("loss", "cauchy")
_OUTLIERS, _SLACK = Remedy("drop", "outliers"), Remedy("drop", "slack")


def _robust(found: Solution) -> tuple[RobustCheck, ...]:
    return at_most_one(robust_check(found.fit) if found.loss == "linear" else None)


def _level_of_robust(found: Solution, robust: RobustCheck) -> Level | None:
    return "grave" if robust.carried else "remark" if robust.disagrees else None


def _disagreement(found: Solution, robust: RobustCheck) -> str:
    count = len(robust.rows)
    if not count:
        return (
            f"a robust fit has {robust.ratio:.2g} times less noise: many rows disagree with the"
            f" rest; fit with {_CAUCHY} and look at the residuals"
        )
    rows = "row disagrees" if count == 1 else "rows disagree"
    own = found.closure_rms if np.isnan(found.rms) else found.rms
    names = row_names(found.fit.equations.prediction.datasets, robust.rows)
    return (
        f"{count} {rows} with the rest: {names};"
        f" a robust fit leaves {robust.rms:.3g} mm in the others, this one {own:.3g} mm in all:"
        f" leave {'it' if count == 1 else 'them'} out with {_OUTLIERS}, or fit with {_CAUCHY}"
    )


def _against_disagreement(found: Solution, robust: RobustCheck) -> tuple[Remedy, ...]:
    return (Remedy("drop", robust.rows), _OUTLIERS, _CAUCHY) if robust.rows else (_CAUCHY,)


def _much_left(found: Solution) -> tuple[tuple[float, float], ...]:
    """Rms of the residuals and of the commanded positions, mm, where the first is absurd."""
    start = found.fit.start
    if np.isinf(stated_size(found.fit.equations)):
        return ()  # positions of an arm without lengths are its errors
    places = start.pose[np.asarray(start.status == 0), :3]
    spread = float(np.sqrt(((places - places.mean(axis=0)) ** 2).sum(axis=1).mean()))
    left = float(np.nanmax([found.distances.rms_without_outliers, found.closure_rms, 0.0]))
    return at_most_one((left, spread) if left > _ABSURD * spread > 0 else None)


def _much_left_text(found: Solution, sizes: tuple[float, float]) -> str:
    left, spread = sizes
    moved = f"{left:.3g} mm rms are left where the machine moved about by {spread:.3g} mm"
    return f"{moved}: {_likely_cause(found)}"


def _likely_cause(found: Solution) -> str:
    """Say why rows may not fit at all."""
    likely = likely_row_errors(found.fit.equations.prediction.datasets, found.fit.parameters)
    return "; ".join(likely) or "check that robot file and measurements belong together, row by row"


def _much_turned(found: Solution) -> tuple[tuple[float, float], ...]:
    """Rms of the angles' residuals and of the turnings, rad, of an arm without lengths."""
    start, end, equations = found.fit.start, found.fit.end, found.fit.equations
    if not np.isinf(stated_size(equations)):
        return ()
    off = [
        end.residuals[i][:, list(family.columns)].ravel()
        for i, m in enumerate(equations.table.sets)
        for family in m.instrument.families
        if family.unit == "rad" and m.instrument.turning is not None
    ]
    if not off:
        return ()
    turned = start.pose[np.asarray(start.status == 0), 3:]
    about = between(turned, np.repeat(turned[:1], len(turned), axis=0))
    spread = rms(np.linalg.norm(about - about.mean(axis=0), axis=1))
    left = float(np.sqrt(3.0) * np.sqrt(np.nanmean(np.concatenate(off) ** 2)))
    return at_most_one((left, spread) if left > _ABSURD * spread > 0 else None)


def _much_turned_text(found: Solution, sizes: tuple[float, float]) -> str:
    left, spread = np.degrees(sizes)
    turned = f"{left:.3g} deg rms are left where the machine turned about by {spread:.3g} deg"
    return f"{turned}: {_likely_cause(found)}"


def _slack(found: Solution, left_out: bool) -> tuple[tuple[SlackCable, ...], ...]:
    asked = bool(found.fit.uncertainty.equations.slack_cells)
    return at_most_one(found.slack if found.slack and asked == left_out else None)


def _slack_left_out(found: Solution, cables: tuple[SlackCable, ...]) -> str:
    many = f"{len(cables)} readings" if len(cables) > 1 else "1 reading"
    return f"{many} of slack cables left out, as asked: {listed_slack(cables)}"


CHECKS = (
    Check(
        name="rows-disagree",
        about="some rows carry the least squares: a robust fit is made beside it",
        levels=("grave", "remark"), run=_robust, level_of=_level_of_robust, say=_disagreement,
        remedies=_against_disagreement,
    ),
    Check(
        name="much-left", about="the residuals are larger than any sound fit leaves",
        levels=("grave",), run=_much_left, say=_much_left_text,
    ),
    Check(
        name="much-turned", about="angles of an arm without lengths are off by more than any sound"
        " fit leaves",
        levels=("grave",), run=_much_turned, say=_much_turned_text,
    ),
    Check(
        name="rows-left-out", about="rows were left out as asked", levels=("remark",),
        run=lambda found: at_most_one(found.left_out or None), say=lambda found, text: text,
    ),
    Check(
        name="slack-left-out", about="readings of slack cables were left out as asked",
        levels=("remark",), run=lambda found: _slack(found, left_out=True), say=_slack_left_out,
    ),
    Check(
        name="copies", about="rows, or whole sets, equal others to the last digit", at_once=True,
        run=lambda found: copies(found.fit.uncertainty.equations),
        say=lambda found, copied: str(copied),
    ),
    Check(
        name="slack-fitted",
        about="cables that the others show to be slack were fitted as if they were taut",
        at_once=True, run=lambda found: _slack(found, left_out=False),
        say=lambda found, cables: (
            f"cables read longer than the others allow, {listed_slack(cables)}: where they were"
            f" slack, {_SLACK} leaves these readings out"
        ),
        remedies=lambda found, cables: (_SLACK,),
    ),
)  # fmt: skip
