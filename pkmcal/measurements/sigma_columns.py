"""Columns of a table that say how good what was read is: deviations, covariances."""

from __future__ import annotations

import itertools

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.files.csv_table import Table
from pkmcal.files.units import UNITS, plain
from pkmcal.measurements.actuator_columns import columns_of_actuators
from pkmcal.measurements.components import Kind, noun
from pkmcal.measurements.kind_columns import components_in, value_columns


def read_sigma(table: Table, kind: Kind) -> FloatArray | None:
    """Deviations (rows, 1) or (rows, k), or covariances (rows, k, k)."""
    given = [name for name in table.columns if name.partition(".")[0] in ("sigma", "cov")]
    if not given:
        return None
    if kind == "closure":
        raise table.header_error(f"column {given[0]!r}: nothing was read that it could be of")
    names, units = zip(*components_in(table, kind), strict=True)
    pairs = list(itertools.combinations_with_replacement(range(len(names)), 2))
    forms = {
        "one": ["sigma"],
        "each": [f"sigma.{name}" for name in names],
        "covariance": [f"cov.{names[i]}.{names[j]}" for i, j in pairs],
    }
    form = "covariance" if given[0].startswith("cov") else "each" if "." in given[0] else "one"
    if form == "one" and len(set(units)) > 1:
        raise table.header_error(
            f"column 'sigma' for {noun(kind)}: expected {forms['each'][0]!r} to"
            f" {forms['each'][-1]!r}"
        )
    table.require(forms[form])
    for name in given:
        if name not in forms[form]:
            raise table.header_error(
                f"column {name!r} does not go with {given[0]!r} and {noun(kind)}"
            )
    if form == "covariance":
        sigma = np.empty((len(table), len(names), len(names)))
        for name, (i, j) in zip(forms[form], pairs, strict=True):
            sigma[:, i, j] = sigma[:, j, i] = table.numbers(name, f"{units[i]}*{units[j]}")[0]
        return sigma
    of, read = units if form == "each" else units[:1], [n for n, _ in value_columns(table, kind)]
    columns = [
        table.numbers(sigma, unit, like=read[0] if read and form == "one" else name)[0]
        for sigma, unit, name in zip(forms[form], of, names, strict=False)
    ]
    for name, column in zip(forms[form], columns, strict=True):
        if not (column > 0).all():
            row = int(np.argmin(column > 0))
            raise table.cell_error(name, row, f"must be positive, found {column[row]:g}")
    return np.stack(columns, axis=1)


def read_actuator_sigma(table: Table, units: tuple[str, ...]) -> FloatArray | None:
    """Deviations (rows, n) of what the actuators read."""
    names = columns_of_actuators(table, "actuator_sigma", len(units))
    if not names:
        return None
    if names == ["actuator_sigma"] and len(set(units)) > 1:
        raise table.header_error(
            "column 'actuator_sigma' for lengths and angles: expected"
            f" 'actuator_sigma.q1' to 'actuator_sigma.q{len(units)}'"
        )
    columns = [
        _like_the_reading(table, name, i, unit)
        for i, (name, unit) in enumerate(zip(names, units, strict=False))
    ]
    return np.broadcast_to(np.stack(columns, axis=1), (len(table), len(units)))


def _like_the_reading(table: Table, name: str, i: int, unit: str) -> FloatArray:
    """Deviations of actuator i: in steps where its readings are, for a gain converts both."""
    of_reading = table.columns[f"q{i + 1}"]
    of = plain(of_reading.unit or unit)
    counted = of in UNITS["count"] and of not in UNITS[unit]
    values, quantity = table.numbers(name, *(("count", unit) if counted else (unit,)))
    if counted and quantity != "count":
        raise table.header_error(
            f"column {table.columns[name].name!r} has unit [{table.columns[name].unit}], and"
            f" {of_reading.name!r} [{of_reading.unit}]: expected the same"
        )
    return values
