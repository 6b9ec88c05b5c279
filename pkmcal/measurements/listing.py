"""Measurements as they are printed: a line of what they are, and a table."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from pkmcal import display
from pkmcal.arrays import FloatArray
from pkmcal.display import Table
from pkmcal.measurements.components import noun
from pkmcal.measurements.kind_columns import columns_read
from pkmcal.measurements.measurement_writer import Writable

_LISTED_ROWS = 12  # a longer list of measurements is printed with its middle left out


class Listed(Writable, Protocol):
    """What is printed of `Measurements`, each as it describes them."""

    def __len__(self) -> int:
        """Number of rows."""

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the components of one value."""

    @property
    def sessions(self) -> tuple[str, ...]:
        """The different sessions."""


def deviations(m: Listed) -> FloatArray | None:
    """Standard deviations (N, k), also where covariance matrices were given."""
    if m.sigma is None or m.sigma.ndim == 2:
        return m.sigma
    variances: FloatArray = np.diagonal(m.sigma, axis1=1, axis2=2)
    return np.sqrt(variances)


def table(m: Listed) -> Table:
    """The rows, of many the first and the last."""
    units = m.actuator_units or ("",) * m.actuators.shape[1]
    heads, columns = ["row"], [[str(row) for row in range(len(m))]]
    for i, unit in enumerate(units):
        heads.append(_heading(f"q{i + 1}", unit))
        columns.append(_column(m.actuators[:, i], unit, None))
    if m.other is not None:
        for i, unit in enumerate(units):
            heads.append(_heading(f"to.q{i + 1}", unit))
            columns.append(_column(m.other[:, i], unit, None))
    for name, labels in (("run", m.run), ("touch", m.touched)):
        if labels is not None:
            heads.append(name)
            columns.append([display.printable(label) for label in labels])
    sigmas = deviations(m)
    for i, (name, unit, column) in enumerate(columns_read(m)):
        heads.append(_heading(name, unit))
        columns.append(_column(column, unit, None if sigmas is None else sigmas[:, i]))
    if m.target_index is not None and m.target_names is not None:
        heads.append("target")
        columns.append([m.target_names[i] for i in m.target_index])
    if m.group is not None:
        heads.append("group")
        columns.append([str(number) for number in m.group])
    if m.session is not None and len(m.sessions) > 1:
        heads.append("session")
        columns.append([display.printable(name) for name in m.session])
    rows = list(zip(*columns, strict=True))
    if len(rows) > _LISTED_ROWS:
        rows[_LISTED_ROWS - 4 : -3] = [("⋮",) * len(heads)]
    return Table(heads, rows)


def title(m: Listed) -> str:
    """How many of what they are, and what is known of them."""
    n = m.actuators.shape[1]
    what = f"{len(m)} measured {noun(m.kind, len(m))}"
    if m.kind == "closure":
        what = f"{len(m)} row{'' if len(m) == 1 else 's'} of actuators alone"
    elif missing := int(np.isnan(m.values.reshape(len(m), -1)).all(axis=1).sum()):
        what += f" ({missing} not read)"
    if m.touched is not None:
        count = len(np.unique(m.touched))
        what += f" of {count} {m.artefact}{'' if count == 1 else 's'}"
    parts = [what, f"{n} actuator{'' if n == 1 else 's'}"]
    if m.kind != "closure":
        parts.append("sigma " + _sigma_text(m))
    if m.actuator_sigma is not None:
        parts.append("actuator_sigma stated")
    if m.approach is not None:
        parts.append("approach stated")
    if m.tension is not None:
        parts.append("tension stated" if m.tension_sigma is None else "tension read")
    if m.sessions:
        many = "s" if len(m.sessions) > 1 else ""
        parts.append(f"session{many} {', '.join(map(display.printable, m.sessions))}")
    if m.target_names is not None:
        known = "" if m.target is not None else " (places not known)"
        parts.append(f"targets {' '.join(m.target_names)}{known}")
    elif m.target is not None and m.target.ndim == 1:
        parts.append("target ({:g}, {:g}, {:g}) mm".format(*m.target))
    return ", ".join(parts)


def _sigma_text(m: Listed) -> str:
    sigmas = deviations(m)
    if sigmas is None:
        return "not known"
    texts = []
    for unit in dict.fromkeys(m.units):
        of_unit = sigmas[:, [u == unit for u in m.units]]
        ends = dict.fromkeys(_sigma_number(s, unit) for s in (of_unit.min(), of_unit.max()))
        texts.append(" to ".join(ends) + " " + display.displayed(0.0, unit)[1])
    return " and ".join(texts)


def _sigma_number(sigma: float, unit: str) -> str:
    shown, _ = display.displayed(float(sigma), unit)
    return display.fixed(shown, display.decimals(shown))


def _heading(name: str, unit: str) -> str:
    shown = display.displayed(0.0, unit)[1]
    return f"{name} [{shown}]" if shown else name


def _column(values: FloatArray, unit: str, sigma: FloatArray | None) -> list[str]:
    """Numbers to the digits their sigma supports, else to 0.1 µm and 0.0001 degrees."""
    places = 4
    if sigma is not None:
        places = display.decimals(display.displayed(float(sigma.min()), unit)[0])
    return [
        "" if np.isnan(value) else display.fixed(display.displayed(float(value), unit)[0], places)
        for value in values
    ]
