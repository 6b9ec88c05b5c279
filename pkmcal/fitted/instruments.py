"""Instruments as a calibration found them, and what pictures show beside it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.fitted.holdout import unfitted
from pkmcal.fitted.row_names import pose_name
from pkmcal.fitted.solution import Solution
from pkmcal.readings.pictures import Picture
from pkmcal.readings.reading import Reading

Use = Literal["fitted", "held out", "left out"]


@dataclass(frozen=True)
class CalibratedPicture:
    """A picture of a calibration.

    Attributes
    ----------
    name : str
        Of its pose; else the number of its first row.
    use : {"fitted", "held out", "left out"}
        What became of it.
    outliers : int
        How many of its corners the others contradict.
    camera, board : str
        Which they are, where there are several.
    seen : Picture
        What it shows.
    """

    name: str
    use: Use
    outliers: int
    camera: str
    board: str
    seen: Picture


def parts_of(
    found: Solution,
) -> Iterator[tuple[Equations, Evaluation, Evaluation, Use, tuple[int, ...]]]:
    """Equations of rows, their start and end, whether they were fitted, and outliers among them."""
    fit = found.fit
    yield fit.equations, fit.start, fit.end, "fitted", found.outliers
    later = found.holdout_later
    held = () if later is None else tuple(zip(later.data, later.like, strict=True))
    kinds: tuple[tuple[Use, tuple[int, ...]], ...] = (
        ("held out", found.holdout_outliers),
        ("left out", ()),
    )
    for (use, odd), pairs in zip(kinds, (held, found.dropped_data), strict=True):
        if pairs:
            _, equations, ends, _ = unfitted(
                pairs, fit.estimator, fit.estimate, fit.uncertainty, fit.start.theta
            )
            yield equations, *ends, use, odd


def instruments(
    equations: Equations, theta: FloatArray, i: int
) -> Iterator[tuple[IntArray, Reading]]:
    """The instrument of a set as it was found, and its rows; of each session."""
    data, chosen = equations.prediction.datasets[i], equations.parameters
    by_name = chosen.by_name(theta)
    session, count = data.measured.session, len(data.rows)
    kept = session if chosen.sessions and session is not None else np.full(count, "")
    for name in dict.fromkeys(kept.tolist()):
        numbers = dict(by_name)
        for stem, at, behind in (each.partition("@") for each in by_name):
            if at and behind in (name, data.set_name):
                numbers[stem] = by_name[f"{stem}@{behind}"]
        rows = np.flatnonzero(kept == name)
        yield rows, data.measured.select(rows).instrument.as_found(numbers)


def pictures(found: Solution) -> Iterator[CalibratedPicture]:
    """Pictures in the order of rows: fitted ones, those held out, those left out.

    How far each is off is against the machine where its actuators say that it is.
    """
    for equations, _, end, use, odd in parts_of(found):
        for i, data in enumerate(equations.prediction.datasets):
            for rows, instrument in instruments(equations, end.theta, i):
                measured = data.measured.select(rows)
                pose = end.pose[equations.table.pose_of[i][rows]]
                seen = instrument.pictures(measured, pose, end.residuals[i][rows])
                lot = instrument.lots(measured) if len(seen) else None
                if lot is None:
                    continue
                outlier = np.isin(data.rows[rows], odd)
                for each in seen:
                    first = int(rows[each.row])
                    yield CalibratedPicture(
                        name=pose_name(data, first),
                        use=use,
                        outliers=int(outlier[lot == lot[each.row]].sum()),
                        camera=getattr(instrument, "camera_name", ""),
                        board=getattr(instrument, "board_name", ""),
                        seen=each,
                    )
