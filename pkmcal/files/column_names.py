"""What columns are called here, for what instruments and controllers call them."""

from __future__ import annotations

import re

from pkmcal.core.library import POSE

_DRIVEN = re.compile(r"(?:q|j|joint|axis|leg|actuator)[ _]?([1-9][0-9]*)", re.IGNORECASE)
_ALIASES = {
    "height": "z",
    "roll": "alpha",
    "pitch": "beta",
    "yaw": "gamma",
    "dist": "distance",
    "std": "sigma",
    "reflector": "target",
    "smr": "target",
    "pose": "group",
}
BESIDE = ("index", "time", "timestamp", "date", "comment")  # not looked at
RESERVED = ("sigma", "cov", "target", "attachment", "actuator_sigma")


def known_as(name: str) -> str:
    """The name of a column here, for one as it is written.

    Examples
    --------
    >>> known_as("Joint 1"), known_as("X"), known_as("SMR 2.Z"), known_as("Rx")
    ('q1', 'x', 'SMR 2.z', 'Rx')
    """
    if driven := _DRIVEN.fullmatch(name):
        return f"q{driven[1]}"
    plain = name.lower()
    if plain in _ALIASES:
        return _ALIASES[plain]
    target, dot, axis = name.rpartition(".")
    if dot and axis.lower() in POSE[:3] and target.lower() not in RESERVED:
        return f"{target}.{axis.lower()}"
    known = (*POSE, "distance", "sigma", "group", "target", *BESIDE)
    prefixed = plain.partition(".")[0] in RESERVED
    return plain if plain in known or prefixed else name
