"""Write measurements to a CSV file that `read_measurements` reads back to the last bit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from os import PathLike
from typing import Any

from pkmcal.exceptions import ArgumentTypeError
from pkmcal.files.csv_writer import WrittenColumn, numbered, with_cells, write_csv
from pkmcal.measurements.field import row_fields
from pkmcal.readings.constants import columns_of_constants
from pkmcal.readings.registry import require_read_back


def write_measurements(
    measurements: Any,
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
    TypeError
        A kind of the user's own whose columns are those of another kind: read back without it, its
        values would be taken for those; two columns of one name.
    """
    require_read_back(measurements.instrument, measurements.values, measurements.actuators)
    headings, cells = headed_cells(measurements, reading)
    write_csv(path, headings, cells, comment=comment)


def headed_cells(
    measurements: Any, reading: Sequence[str] | None = None
) -> tuple[list[str], list[tuple[str, ...]]]:
    """Headings and the cells of each row, as `write_measurements` writes them."""
    own = measurements.actuator_units or ("mm",) * measurements.actuators.shape[1]
    columns = list(_columns(measurements, reading or own))
    headings = [column.heading for column in columns]
    names = [column.name for column in columns]
    for name, heading in zip(names, headings, strict=True):
        if names.count(name) > 1:
            raise ArgumentTypeError(
                f"measurements: two columns would be called {name!r}, of which only one is read"
                f" back; one of them is {heading!r}: give the component, the field or the column of"
                " a class of your own another name"
            )
    cells = list(zip(*(column.cells() for column in columns), strict=True))
    return headings, cells


def _columns(m: Any, units: Sequence[str]) -> Iterator[WrittenColumn]:
    """Columns in the order in which they are written."""
    for column in numbered("", units, m.actuators):
        yield column._replace(name=column.name[1:])
    reading = m.instrument
    yield from with_cells(reading.columns_in_file(units), len(m), reading)
    yield from columns_of_constants(m.instrument, len(m))
    yield from with_cells(reading.value_columns(m.values.reshape(len(m), -1)), len(m), reading)
    for field in row_fields(type(m)):
        yield from field.written(m, units)
