"""Results as JSON: the numbers of their attributes, in mm and rad."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from pkmcal.arms.arm import SerialArm
from pkmcal.kinematics.calibratable import as_machine
from pkmcal.kinematics.robot import Robot

VERSION = 1  # of `schema.json`: keys are added to it, never taken away or changed


def as_json(result: Any, *attributes: str, schema: str | None = None) -> str:
    """A result as JSON, one attribute a line.

    Numbers are those of the result, in mm and rad; what is not finite is null.

    Parameters
    ----------
    result : dataclass or mapping
        What to print; attributes that start with ``_`` are left out.
    *attributes : str
        Properties of `result` to print as well.
    schema : str, optional
        Which part of ``schema.json`` describes it, with its version: the first key.

    Examples
    --------
    >>> print(as_json({"rms": np.float64(0.5), "noise": (math.nan,)}))
    {
      "rms": 0.5,
      "noise": [null]
    }
    """
    head = {} if schema is None else {"schema": f"pkmcal/{schema}/{VERSION}"}
    plain = head | _plain(result) | {name: _plain(getattr(result, name)) for name in attributes}
    lines = (
        f"  {json.dumps(key)}: {_escaped(json.dumps(value, ensure_ascii=False, allow_nan=False))}"
        for key, value in plain.items()
    )
    return "{\n" + ",\n".join(lines) + "\n}"


def _escaped(line: str) -> str:
    """JSON without what could steer a terminal: marks of writing direction and the like."""
    if line.isprintable():
        return line
    return "".join(c if c.isprintable() else json.dumps(c)[1:-1] for c in line)


def _plain(value: Any) -> Any:
    """Return an object as lists, dicts, numbers and text."""
    if isinstance(value, Robot | SerialArm):
        geometry = as_machine(value).geometry
        numbers = zip(geometry.names, geometry.values.tolist(), strict=True)
        return {"name": value.name, "geometry": dict(numbers)}
    if hasattr(value, "to_dict"):
        return _plain(value.to_dict())
    if dataclasses.is_dataclass(value):
        fields = (field.name for field in dataclasses.fields(value))
        return {name: _plain(getattr(value, name)) for name in fields if name[0] != "_"}
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
