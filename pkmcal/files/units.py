"""Units of length and angle as instruments write them, and what they are in mm and rad."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable

# What one unit is in mm, in rad: (multiply by, divide by), so that 1 um is 1/1000 mm exactly.
INCH = 25.4  # mm
METRE = 1000.0  # mm
UNITS: dict[str, dict[str, tuple[float, float]]] = {
    "mm": {
        "mm": (1.0, 1.0),
        "um": (1.0, 1000.0),
        "µm": (1.0, 1000.0),
        "cm": (10.0, 1.0),
        "m": (1000.0, 1.0),
        "in": (25.4, 1.0),
        '"': (25.4, 1.0),
    },
    "rad": {
        "rad": (1.0, 1.0),
        "mrad": (1.0, 1000.0),
        "deg": (math.pi, 180.0),
        "°": (math.pi, 180.0),
        "rev": (2.0 * math.pi, 1.0),
        "arcmin": (math.pi, 10_800.0),
        "arcsec": (math.pi, 648_000.0),
        "″": (math.pi, 648_000.0),
        '"': (math.pi, 648_000.0),
        "′": (math.pi, 10_800.0),
        "'": (math.pi, 10_800.0),
    },
    "°C": {"°C": (1.0, 1.0)},
    "K": {"K": (1.0, 1.0)},
    "°F": {"°F": (1.0, 1.0)},
    "N": {"N": (1.0, 1.0), "kN": (1000.0, 1.0), "lbf": (4.4482216152605, 1.0)},
    "N mm": {"N mm": (1.0, 1.0), "N m": (1000.0, 1.0), "Nmm": (1.0, 1.0), "Nm": (1000.0, 1.0)},
    "kg": {"kg": (1.0, 1.0), "g": (1.0, 1000.0), "t": (1000.0, 1.0), "lb": (0.45359237, 1.0)},
    "count": {"steps": (1.0, 1.0), "counts": (1.0, 1.0), "rev": (1.0, 1.0)},
}
# Other spellings of units; a unit may also be in capitals.
SPELLINGS = {
    "millimeter": "mm", "millimeters": "mm", "millimetre": "mm", "millimetres": "mm",
    "millimeter(s)": "mm", "centimeter": "cm", "centimeters": "cm", "centimetres": "cm",
    "meter": "m", "meters": "m", "metre": "m", "metres": "m",
    "inch": "in", "inches": "in", "inch(es)": "in",
    "micron": "um", "microns": "um", "micrometer": "um", "micrometers": "um",
    "micrometre": "um", "micrometres": "um",
    "degree": "deg", "degrees": "deg", "º": "deg",
    "radian": "rad", "radians": "rad", "milliradian": "mrad", "milliradians": "mrad",
    "arc sec": "arcsec", "arcseconds": "arcsec", "arc seconds": "arcsec", "arcminutes": "arcmin",
    "revs": "rev", "revolution": "rev", "revolutions": "rev", "turns": "rev",
    "c": "°C", "degc": "°C", "deg c": "°C", "ºc": "°C", "celsius": "°C", "k": "K", "kelvin": "K",
    "degf": "°F", "deg f": "°F", "ºf": "°F", "f": "°F", "fahrenheit": "°F",
    "step": "steps", "microsteps": "steps", "count": "counts", "increments": "counts",
    "ticks": "counts", "pulses": "counts",
}  # fmt: skip
_KNOWN = {unit for units in UNITS.values() for unit in units}
_LETTERS = {
    "K",
    "k",
    "N",
    "n",
    "c",
    "f",
    "g",
    "t",
    '"',
    "'",
}  # behind a name they may be a part of it


def _pattern(without: Collection[str] = ()) -> str:
    words = {*_KNOWN, "\u03bcm", *SPELLINGS} - {*without}
    return "|".join(sorted(map(re.escape, words), key=lambda word: (-len(word), word)))


PATTERN, IN_BRACKETS = _pattern(_LETTERS), _pattern()
_STATED = re.compile(r"\bunits?\b", re.IGNORECASE)
_WORD = re.compile(r"[^\W\d_]+|[°º″]")
_BETWEEN = re.compile(
    "of|for|in|is|are|and|the|lengths?|linear|distances?|angles?|angular|coordinates"
)  # words between "units" and the unit


def plain(unit: str, known: Collection[str] = _KNOWN) -> str:
    """A unit as it is known here, else as it is.

    Examples
    --------
    >>> plain("Millimeters"), plain("DEG"), plain("furlong")
    ('mm', 'deg', 'furlong')
    """
    unit = unit.strip().replace("\u03bc", "\u00b5")  # the Greek mu for the micro sign
    lower = SPELLINGS.get(unit.lower(), unit.lower())
    return lower if unit not in known and lower in known else unit


def factors(quantity: str) -> dict[str, tuple[float, float]]:
    """Units of a quantity; those of a product are products of mm and rad alone."""
    return UNITS.get(quantity, {quantity: (1.0, 1.0)})


def quantity_of(unit: str) -> str | None:
    """Return "mm" or "rad", whichever quantity a unit is of; None for any other word."""
    known = plain(unit)
    return next((quantity for quantity in ("mm", "rad") if known in UNITS[quantity]), None)


def stated_in(texts: Iterable[tuple[int, str]]) -> dict[str, tuple[str, int]]:
    """Units that lines above a table state, as "Length Units, Meters" does, with their lines.

    A quantity for which two different units are stated has none.

    Examples
    --------
    >>> stated_in([(1, "Take 7"), (2, "Units: Millimeters, Degrees")])
    {'mm': ('mm', 2), 'rad': ('deg', 2)}
    """
    found: dict[str, set[tuple[str, int]]] = {}
    for line, text in texts:
        for match in _STATED.finditer(text):
            words = _WORD.findall(text[match.end() :])
            for i, word in enumerate(words):
                quantity = quantity_of(word)
                follows = i + 1 < len(words) and quantity_of(words[i + 1])
                if quantity and not (word.lower() == "in" and follows):  # "units in mm"
                    found.setdefault(quantity, set()).add((plain(word), line))
                elif not _BETWEEN.fullmatch(word.lower()):
                    break
    first = {quantity: min(units, key=lambda each: each[1]) for quantity, units in found.items()}
    return {q: first[q] for q, units in found.items() if len({unit for unit, _ in units}) == 1}
