"""Write measurements to a CSV file that `read_measurements` reads back to the last bit."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from os import PathLike
from typing import Protocol

from pkmcal.arrays import FloatArray, Int64Array, TextArray
from pkmcal.files.csv_writer import write_csv
from pkmcal.measurements.components import components
from pkmcal.measurements.kind_columns import OfAKind, columns_read, kind_cells
from pkmcal.measurements.temperature_columns import temperature_cells


class Writable(OfAKind, Protocol):
    """The fields of `Measurements` that are written, each as it describes them."""

    @property
    def actuators(self) -> FloatArray:
        """Actuator coordinates (N, n)."""

    @property
    def actuator_units(self) -> tuple[str, ...] | None:
        """Their units."""

    @property
    def sigma(self) -> FloatArray | None:
        """Deviations (N, k) or covariances (N, k, k)."""

    @property
    def target(self) -> FloatArray | None:
        """Targets as given."""

    @property
    def targets(self) -> FloatArray:
        """The target of every row (N, 3)."""

    @property
    def target_index(self) -> Int64Array | None:
        """Which of several targets each row measured."""

    @property
    def target_names(self) -> tuple[str, ...] | None:
        """Their names."""

    @property
    def attachment(self) -> FloatArray | None:
        """Attachments as given."""

    @property
    def attachments(self) -> FloatArray:
        """The attachment of every row (N, 3)."""

    @property
    def temperature(self) -> FloatArray | None:
        """Temperatures (N, 2 + n)."""

    @property
    def time(self) -> FloatArray | None:
        """Seconds of each row."""

    @property
    def actuator_sigma(self) -> FloatArray | None:
        """Deviations (N, n) of the actuators."""

    @property
    def group(self) -> Int64Array | None:
        """Which rows repeat one pose."""

    @property
    def approach(self) -> FloatArray | None:
        """From where each actuator came."""

    @property
    def tension(self) -> FloatArray | None:
        """Of what each actuator drives, N."""

    @property
    def tension_sigma(self) -> FloatArray | None:
        """Deviations (N, n) of that, N."""

    @property
    def session(self) -> TextArray | None:
        """When each row was measured."""


def write_measurements(
    measurements: Writable,
    path: str | PathLike[str],
    comment: str = "",
    reading: Sequence[str] | None = None,
) -> None:
    """Write measurements in mm and rad, one row each, so that they are read back to the last bit.

    Several targets are written as the columns ``target`` and ``target.x`` …; of the targets, those
    that no row measured are left out.

    Parameters
    ----------
    measurements : Measurements
        What to write.
    path : str or path
        The file; replaced as a whole or not at all.
    comment : str, optional
        Lines for its head, each with its ``#``.
    reading : sequence of str, optional
        Units of the actuators, of `reading_units`, for what is not in mm and rad.

    Raises
    ------
    OSError
        The file cannot be written; one that was there before is untouched.
    """
    own = measurements.actuator_units or ("mm",) * measurements.actuators.shape[1]
    headings, columns = zip(*_columns(measurements, reading or own), strict=True)
    write_csv(path, headings, zip(*columns, strict=True), comment=comment)


def _columns(m: Writable, units: Sequence[str]) -> Iterator[tuple[str, Sequence[str]]]:
    """Headings and cells, in the order in which they are written."""
    for i, unit in enumerate(units):
        yield f"q{i + 1} [{unit}]", _exact(m.actuators[:, i])
    yield from kind_cells(m, units)
    for name, unit, column in columns_read(m):
        yield f"{name} [{unit}]", _exact(column)
    yield from _actuator_sigma(m, units)
    read = components(m.kind, m.artefact)
    units_read = [unit for _, unit in read]
    if m.sigma is not None and m.sigma.ndim == 3:
        for i, j in itertools.combinations_with_replacement(range(len(read)), 2):
            (a, of_a), (b, of_b) = read[i], read[j]
            yield f"cov.{a}.{b} [{of_a}*{of_b}]", _exact(m.sigma[:, i, j])
    elif m.sigma is not None and len(set(units_read)) == 1 and (m.sigma == m.sigma[:, :1]).all():
        yield f"sigma [{units_read[0]}]", _exact(m.sigma[:, 0])
    elif m.sigma is not None:
        for i, (name, unit) in enumerate(read):
            yield f"sigma.{name} [{unit}]", _exact(m.sigma[:, i])
    if m.target_index is not None and m.target_names is not None:
        yield "target", [m.target_names[i] for i in m.target_index]
    places = {} if m.target is None else {"target": m.targets}
    if m.attachment is not None:
        places["attachment"] = m.attachments
    for point, rows in places.items():
        for axis, name in enumerate("xyz"):
            yield f"{point}.{name} [mm]", _exact(rows[:, axis])
    if m.group is not None:
        yield "group", [str(number) for number in m.group]
    if m.session is not None:
        yield "session", m.session.tolist()
    if m.temperature is not None:
        yield from temperature_cells(m.temperature)
    if m.time is not None:
        yield "time", _exact(m.time)
    if m.approach is not None:
        for i, each in enumerate(m.approach.T):
            yield f"approach.q{i + 1}", [f"{direction:.0f}" for direction in each]
    if m.tension is not None:
        for i, each in enumerate(m.tension.T):
            yield f"tension.q{i + 1} [N]", _exact(each)
    if m.tension_sigma is not None:
        for i, each in enumerate(m.tension_sigma.T):
            yield f"tension_sigma.q{i + 1} [N]", _exact(each)


def _actuator_sigma(m: Writable, units: Sequence[str]) -> Iterator[tuple[str, Sequence[str]]]:
    if m.actuator_sigma is None:
        return
    if len(set(units)) == 1 and (m.actuator_sigma == m.actuator_sigma[:, :1]).all():
        yield f"actuator_sigma [{units[0]}]", _exact(m.actuator_sigma[:, 0])
        return
    for i, unit in enumerate(units):
        yield f"actuator_sigma.q{i + 1} [{unit}]", _exact(m.actuator_sigma[:, i])


def _exact(values: FloatArray) -> list[str]:
    """The shortest decimals that are read back to the same bits; nothing where it was not read."""
    return ["" if math.isnan(value) else repr(float(value)) for value in values]
