"""Standard deviations or covariances of the readings of every row."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator, Sequence
from typing import Any

import numpy as np

from pkmcal import display
from pkmcal.arrays import FloatArray
from pkmcal.exceptions import ArgumentError
from pkmcal.files.csv_table import Table
from pkmcal.files.csv_writer import WrittenColumn
from pkmcal.measurements.field import Field
from pkmcal.measurements.tracker import Tracker
from pkmcal.readings.reading import Reading
from pkmcal.readings.rows import numbers
from pkmcal.readings.unknowns import POINT

_LEAST, _MOST = 1e-100, 1e100  # whose squares are numbers
_ROUNDED = 1e-9  # share by which a covariance may miss symmetry, as what was computed or typed does


class Sigma(Field):
    """Standard deviations (N, k) of the values in their units, or covariances (N, k, k)."""

    def kept(self, given: Any, m: Any) -> FloatArray:
        """Given for all, for each component, for each row or both; or a tracker's."""
        kind, rows, k = m.instrument.name, len(m), len(m.instrument.components)
        if not k:
            raise ArgumentError(f"sigma: nothing was read of kind {kind!r}; see actuator_sigma")
        if isinstance(given, Tracker):
            if m.instrument.components != POINT:
                raise ArgumentError(
                    f"sigma: a tracker measures positions, not values of kind {kind!r}"
                )
            covariance = given.covariance(m.values)
            return np.asarray(0.5 * (covariance + covariance.transpose(0, 2, 1)))
        sigma = numbers("sigma", given)
        if rows == 1 and k > 1 and sigma.shape == (k, k):
            sigma = sigma[None]
        if sigma.ndim == 3 and sigma.shape == (rows, k, k):
            return _covariances(sigma)
        if k == 1 and sigma.shape == (rows,):
            sigma = sigma[:, None]
        if sigma.shape not in ((), (k,), (rows, 1), (rows, k)):
            raise ArgumentError(
                f"sigma for {rows} measurements of kind {kind!r} must be a number or have shape"
                f" ({k},), ({rows}, 1), ({rows}, {k}) or ({rows}, {k}, {k}); found {sigma.shape}"
            )
        if not (sigma > 0).all():
            raise ArgumentError(
                f"sigma must be positive; found {sigma.min()} (None means not known)"
            )
        if sigma.min(initial=1.0) < _LEAST or sigma.max(initial=1.0) > _MOST:
            raise ArgumentError(
                f"sigma must lie between {_LEAST:g} and {_MOST:g}; found"
                f" {sigma.min():g} to {sigma.max():g}"
            )
        return np.array(np.broadcast_to(sigma, (rows, k)))

    def names(self, actuators: Collection[str], components: Collection[str]) -> set[str]:
        """Return the names of the columns: one sigma for all, one a component, or covariances."""
        pairs = itertools.product(components, repeat=2)
        each = (f"{self.name}.{name}" for name in components)
        return {self.name, *each, *(f"cov.{a}.{b}" for a, b in pairs)}

    def read(self, table: Table, instrument: Reading, units: Sequence[str]) -> FloatArray | None:
        """Deviations (rows, 1) or (rows, k), or covariances (rows, k, k)."""
        given = [name for name in table.columns if name.partition(".")[0] in (self.name, "cov")]
        if not given:
            return None
        if not instrument.components:
            raise table.header_error(f"column {given[0]!r}: nothing was read that it could be of")
        names, units = zip(*instrument.components, strict=True)
        pairs = list(itertools.combinations_with_replacement(range(len(names)), 2))
        forms = {
            "one": [self.name],
            "each": [f"{self.name}.{name}" for name in names],
            "covariance": [f"cov.{names[i]}.{names[j]}" for i, j in pairs],
        }
        form = "covariance" if given[0].startswith("cov") else "each" if "." in given[0] else "one"
        if form == "one" and len(set(units)) > 1:
            raise table.header_error(
                f"column 'sigma' for {instrument.noun()}: expected {forms['each'][0]!r} to"
                f" {forms['each'][-1]!r}"
            )
        table.require(forms[form])
        for name in given:
            if name not in forms[form]:
                raise table.header_error(
                    f"column {name!r} does not go with {given[0]!r} and {instrument.noun()}"
                )
        if form == "covariance":
            sigma = np.empty((len(table), len(names), len(names)))
            for name, (i, j) in zip(forms[form], pairs, strict=True):
                sigma[:, i, j] = sigma[:, j, i] = table.numbers(name, f"{units[i]}*{units[j]}")[0]
            return sigma
        of, read = units if form == "each" else units[:1], instrument.columns_read(table)
        columns = [
            table.numbers(sigma, unit, like=read[0][0] if read and form == "one" else name)[0]
            for sigma, unit, name in zip(forms[form], of, names, strict=False)
        ]
        for name, column in zip(forms[form], columns, strict=True):
            if not (column > 0).all():
                row = int(np.argmin(column > 0))
                raise table.cell_error(name, row, f"must be positive, found {column[row]:g}")
        return np.stack(columns, axis=1)

    def columns(self, m: Any, units: Sequence[str]) -> Iterator[WrittenColumn]:
        """Write one column where all components have the same, else one each; or covariances."""
        if (sigma := m.sigma) is None:
            return
        read = m.instrument.components
        if sigma.ndim == 3:
            for i, j in itertools.combinations_with_replacement(range(len(read)), 2):
                (a, of_a), (b, of_b) = read[i], read[j]
                yield WrittenColumn(f"cov.{a}.{b}", f"{of_a}*{of_b}", sigma[:, i, j])
        elif len(set(m.units)) == 1 and (sigma == sigma[:, :1]).all():
            yield WrittenColumn(self.name, m.units[0], sigma[:, 0])
        else:
            yield from self._of_each(m)

    def framed(self, m: Any) -> Iterator[WrittenColumn]:
        """Return a column for each component."""
        return iter(()) if m.sigma is None else self._of_each(m)

    def _of_each(self, m: Any) -> Iterator[WrittenColumn]:
        sigmas = deviations(m)
        assert sigmas is not None
        for (name, unit), column in zip(m.instrument.components, sigmas.T, strict=True):
            yield WrittenColumn(f"{self.name}.{name}", unit, column)

    def said(self, m: Any) -> str:
        """The least and the greatest deviation of each unit."""
        sigmas = deviations(m)
        if not m.units:
            return ""
        if sigmas is None:
            return "sigma not known"
        texts = []
        for unit in dict.fromkeys(m.units):
            of_unit = sigmas[:, [u == unit for u in m.units]]
            ends = dict.fromkeys(_shown(s, unit) for s in (of_unit.min(), of_unit.max()))
            texts.append(" to ".join(ends) + " " + display.displayed(0.0, unit)[1])
        return "sigma " + " and ".join(texts)


def deviations(m: Any) -> FloatArray | None:
    """Standard deviations (N, k), also where covariance matrices were given."""
    if m.sigma is None or m.sigma.ndim == 2:
        return None if m.sigma is None else np.asarray(m.sigma)
    variances: FloatArray = np.diagonal(m.sigma, axis1=1, axis2=2)
    return np.sqrt(variances)


def _covariances(given: FloatArray) -> FloatArray:
    """Symmetric matrices (N, k, k)."""
    mirrored = given.transpose(0, 2, 1)
    odd = np.abs(given - mirrored).max(axis=(1, 2)) > _ROUNDED * np.abs(given).max(axis=(1, 2))
    sigma: FloatArray = np.asarray(0.5 * (given + mirrored))
    for row, matrix in enumerate(sigma):
        if odd[row] or np.linalg.eigvalsh(matrix)[0] <= 0:
            raise ArgumentError(
                f"sigma: row {row} is not a covariance matrix (symmetric, positive)"
            )
    return sigma


def _shown(sigma: float, unit: str) -> str:
    number, _ = display.displayed(float(sigma), unit)
    return display.fixed(number, display.decimals(number))
