"""Measurements of a pandas data frame: read as the file that it would be written to."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pkmcal.arguments import shown
from pkmcal.exceptions import ArgumentError, ArgumentTypeError, FileError
from pkmcal.kinematics.reading_units import Actuated
from pkmcal.measurements.measurement_csv import read_measurements
from pkmcal.measurements.measurements import Measurements

_OWN_UNITS = ("mm", "rad")  # those of `Measurements.to_pandas`


def measurements_of_frame(
    frame: Any,
    robot: Actuated | None = None,
    units: str | Sequence[str] = _OWN_UNITS,
    **options: Any,
) -> Measurements:
    """Read a data frame; see `Measurements.from_pandas`."""
    if not hasattr(frame, "to_csv"):
        raise ArgumentTypeError(f"frame must be a data frame, found {shown(frame)}")
    with tempfile.TemporaryDirectory(prefix="pkmcal-") as folder:
        path = Path(folder, "frame")
        frame.to_csv(path, index=False, encoding="utf-8")
        try:
            found = read_measurements(path, robot, units=units, **options)
        except FileError as error:
            raise ArgumentError(str(error).replace(str(path), "frame")) from None
    return replace(found, file="")
