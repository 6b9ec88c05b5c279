"""Repairs of measurements that do not fit: units, columns, rows, targets; found by trials."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.diagnostics.check import Remedy
from pkmcal.diagnostics.families import GROSS
from pkmcal.diagnostics.meant import Meant, joined_later, renamed
from pkmcal.diagnostics.other_readings import exchanges, other_readings
from pkmcal.diagnostics.units import MISFIT_RATIO, likely_unit_errors
from pkmcal.display import printable
from pkmcal.estimation.equations import Equations
from pkmcal.estimation.evaluation import Evaluation
from pkmcal.estimation.fit_data import FitData
from pkmcal.estimation.machine_size import compared_by
from pkmcal.estimation.misfits import of_read
from pkmcal.estimation.parameters import Parameters
from pkmcal.fitted.dropped import are_few
from pkmcal.fitted.row_names import row_names
from pkmcal.measurements.measurements import Measurements

_SHIFTS = (1, -1, 2, -2)  # rows by which readings are tried
_LEAST_ROWS = 6
_LEAST_SHARE = 0.25  # of the rows, for which a moved reading is there
_MOST_TARGETS = 4  # whose orders are tried


def contradicting(datasets: Sequence[FitData], rows: Sequence[int]) -> list[str]:
    """Name rows whose readings and actuators agree at no pose, and what helps; none of many."""
    if not are_few(datasets, rows):
        return []
    return [
        f"{row_names(datasets, rows)}: what was read there contradicts the actuators, as where they"
        " are of another row, a picture is mirrored or numbered from the other end of its board,"
        " the instrument stood elsewhere, or its lens is another at the edge of pictures; leave"
        " these rows out with"
        f" {Remedy('drop', 'outliers')}"
    ]


def likely_mistakes(
    datasets: Sequence[FitData], parameters: Parameters, evaluation: Evaluation | None
) -> list[str]:
    """Suspect units and columns, else rows and targets; two of them where one explains too little.

    Readings of data that fit far better are named. Of those that were refused before anything was
    evaluated units and columns are suspected.
    """
    tensions = [data.measured.tension for data in datasets]
    pulled = any(tension is not None and tension.any() for tension in tensions)
    if not pulled and all(name.endswith(".stretch") for name in parameters.names):
        return ["no row states a tension: columns tension.q1 [N] … (tension=)"]
    found = likely_unit_errors(datasets, parameters, evaluation)
    if evaluation is None:
        return found
    found = found or likely_row_errors(datasets, parameters)
    size = GROSS * parameters.robot.length
    sets = [data.measured for data in datasets]
    both = []
    for i, data in enumerate(datasets):
        if not data.measured.components or len(data.measured) < _LEAST_ROWS:
            continue
        present = _median(data, parameters)
        units = parameters.robot.actuator_units
        single = [*other_readings(data.measured, units), *_readings(data)]
        alone = min(_median(replace(data, measured=m), parameters) for _, m in single)
        if present <= size or alone <= size:
            continue
        trials = {
            first.and_also(second): _median(replace(data, measured=other), parameters)
            for first, exchanged in exchanges(data.measured)
            for second, other in _shifted(replace(data, measured=exchanged))
        }
        meant = min(trials, key=lambda each: trials[each], default=None)
        if meant is not None and trials[meant] < MISFIT_RATIO * min(alone, present):
            which = f"measurements {i + 1}: " if len(datasets) > 1 else ""
            both.append(which + _better(present, trials[meant], meant.among(sets)))
    return both or found


def likely_row_errors(
    datasets: Sequence[FitData], parameters: Parameters, *, near: FloatArray | None = None
) -> list[str]:
    """Suspect readings beside the wrong rows and exchanged targets.

    A reading of the data that fits far better is named, at the present machine or at parameters
    `near` (n,) it.
    """
    found, sets = [], [data.measured for data in datasets]
    for i, data in enumerate(datasets):
        if not data.measured.components:
            continue
        present = _median(data, parameters, near)
        trials = {
            meant: _median(replace(data, measured=other), parameters, near)
            for meant, other in _readings(data)
        }
        if not trials:
            continue
        meant = min(trials, key=lambda each: trials[each])
        if trials[meant] < MISFIT_RATIO * present:
            which = f"measurements {i + 1}: " if len(datasets) > 1 else ""
            found.append(which + _better(present, trials[meant], meant.among(sets)))
    return found


def _better(given: float, otherwise: float, words: str) -> str:
    return f"off by {_off(given)} as given, but by {_off(otherwise)} if {words}"


def _off(value: float) -> str:
    return f"{value:.4g} mm" if np.isfinite(value) else "more than the machine reaches"


def _median(data: FitData, parameters: Parameters, near: FloatArray | None = None) -> float:
    """Median distance of the readings from the machine, mm; inf where most fail."""
    try:
        start = Equations.of([data], parameters).with_exact_actuators().start(near)
    except ValueError:
        return float("inf")
    read = np.isfinite(data.measured.values.reshape(start.residuals[0].shape)).any(axis=1)
    whole = of_read(data.measured, start.residuals[0])
    off = np.linalg.norm(whole * compared_by(parameters.robot, data.measured), axis=1)[read]
    return float(np.median(np.where(np.isfinite(off), off, np.inf))) if read.any() else np.inf


def _shifted(data: FitData) -> Iterator[tuple[Meant, Measurements]]:
    """Read measurements with values moved along the rows, as they were numbered before any left.

    Rows that were held out or left out, and targets that were not seen, leave gaps.
    """
    measured = data.measured
    step = len(measured.target_names or ("1",))
    what = "row" if step == 1 else "pose"
    least = max(_LEAST_ROWS, round(_LEAST_SHARE * len(measured)))
    for shift in _SHIFTS:
        moved = data.rows + shift * step
        _, kept, read = np.intersect1d(moved, data.rows, return_indices=True)
        if measured.target_index is not None:
            same = measured.target_index[kept] == measured.target_index[read]
            kept, read = kept[same], read[same]
        if len(kept) < least:
            continue
        values = measured.values[read]
        sigma = None if measured.sigma is None else measured.sigma[read]
        where = "before" if shift > 0 else "after"  # where its actuators stand
        words = f"each reading belongs to the {what} {abs(shift)} {where} it"
        yield (
            Meant(words, joined_later(measured, -shift)),
            replace(measured.select(kept), values=values, sigma=sigma),
        )


def _readings(data: FitData) -> Iterator[tuple[Meant, Measurements]]:
    """Read measurements with values moved along the rows and with targets exchanged."""
    yield from _shifted(data)
    measured = data.measured
    names = measured.target_names or ("1",)
    step = len(names)
    if measured.target is None or measured.target_index is None or step > _MOST_TARGETS:
        return
    for order in itertools.permutations(range(step)):
        if order != tuple(range(step)):
            index = np.array(order)[measured.target_index]
            shown = ", ".join(
                f"{printable(names[a])} is {printable(names[b])}"
                for a, b in enumerate(order)
                if a != b
            )
            columns = {
                f"{names[a]}.{axis}": f"{names[b]}.{axis}"
                for a, b in enumerate(order) for axis in "xyz" if a != b
            }  # fmt: skip
            meant = Meant(f"target {shown}", renamed(measured, columns))
            yield meant, replace(measured, target_index=index)
