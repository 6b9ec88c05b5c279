"""The arguments of single kinds that measurements took until version 0.1, as instruments.

They go on working for one version, each with a warning that states the new form.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Collection, Mapping
from typing import Any

from pkmcal.arguments import did_you_mean
from pkmcal.exceptions import ArgumentError
from pkmcal.readings.reading import Reading
from pkmcal.readings.registry import KINDS

# Argument: the field of an instrument that it has become.
OF_MEASUREMENTS = {
    "attachment": "attachment",
    "other": "other",
    "run": "run",
    "touched": "touched",
    "artefact": "artefact",
    "touch_distances": "distances",
    "joint": "joint",
}
OF_MEASURE = {
    "attachment": "attachment",
    "other": "other",
    "run": "run",
    "touches": "touched",
    "artefact": "artefact",
    "joint": "joint",
    "mounting": "mounting",
    "touched": "places",
}


def adapted(
    call: str,
    instrument: Reading,
    given: Mapping[str, Any],
    known: Mapping[str, str],
    present: Collection[str],
) -> Reading:
    """The instrument with fields that were given as arguments of `call`.

    Parameters
    ----------
    given : mapping of str to object
        The arguments by name; those that are None are not given.
    known : mapping of str to str
        `OF_MEASUREMENTS` or `OF_MEASURE`.
    present : collection of str
        The arguments of today, one of which may have been meant.

    Raises
    ------
    TypeError
        An argument that never was.
    ValueError
        One that goes with another kind.
    """
    for name in given:
        if name not in known:
            near = did_you_mean(name, present, listed=0)
            raise TypeError(f"{call}() got an unexpected argument {name!r}{near}")
    fields = {known[name]: value for name, value in given.items() if value is not None}
    fields = {k: v for k, v in fields.items() if not (isinstance(v, tuple) and not v)}
    own = _fields_of(instrument)
    words = {field: name for name, field in known.items()}
    for field in fields:
        if field not in own:
            kinds = [repr(each.name) for each in KINDS.values() if field in _fields_of(each)]
            raise ArgumentError(
                f"{words[field]}: goes with values of kind {' or '.join(kinds)}, not of"
                f" {instrument.name!r}"
            )
    if fields:
        new = ", ".join(f"{field}=…" for field in fields)
        warnings.warn(
            f"{call}({', '.join(f'{words[field]}=…' for field in fields)}) is now"
            f" kind=pkmcal.readings.{type(instrument).__name__}({new})",
            DeprecationWarning,
            stacklevel=3,
        )
    return dataclasses.replace(instrument, **fields) if fields else instrument  # type: ignore[type-var]


def _fields_of(instrument: Reading) -> Collection[str]:
    return [each.name for each in dataclasses.fields(instrument)]  # type: ignore[arg-type]
