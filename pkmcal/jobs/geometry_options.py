"""Options that speak of numbers of the geometry: which are free, and their standard deviations."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from pkmcal.estimation.prior_functions import terms
from pkmcal.exceptions import ArgumentError
from pkmcal.files.units import UNITS
from pkmcal.geometry.stated_uncertainty import COMMON, CONSIDER, unit_of
from pkmcal.kinematics.calibratable import Calibratable

DEFAULT = "default"  # stands for the numbers that the robot file frees
_PAIR = re.compile(r"(?P<name>[^=]+)=\s*(?P<value>[^=±]*?)\s*(?:±|\+-)\s*(?P<sigma>.*)")
_DEVIATION = re.compile(
    r"(?:(?P<name>[^=]+)=)?\s*"
    r"(?P<number>[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)\s*(?P<unit>\D*)"
)


def free_names(robot: Calibratable, given: Sequence[str] | None) -> list[str]:
    """Names that ``--free`` chooses; the robot's default set without it, and for the word default.

    Raises
    ------
    ValueError
        A name that the robot does not have, or that a parameter drives.
    """
    default = list(robot.model.free)
    if not given:
        return default
    names = [name.strip() for text in given for name in text.split(",")]
    others = [name for name in names if name != DEFAULT]
    chosen = matching("--free", robot, others) if others else []
    return list(dict.fromkeys([*default, *chosen])) if DEFAULT in names else chosen


def matching(option: str, robot: Calibratable, given: Sequence[str]) -> list[str]:
    """Names of the geometry that an option chooses: repeated, with commas, or wildcards.

    Raises
    ------
    ValueError
        A name that the robot does not have, or that a parameter drives.
    """
    patterns = [name.strip() for text in given for name in text.split(",")]
    try:
        return robot.geometry.match(patterns)
    except ValueError as error:
        raise ArgumentError(f"{option}: {error}") from None


def read_deviations(
    option: str, given: Sequence[str], robot: Calibratable, names: Sequence[str]
) -> float | Mapping[str, float] | None:
    """Standard deviations from the command line; None where none is given.

    Parameters
    ----------
    option : str
        Which option gave them, for messages: ``--prior`` of identification, ``--sigma`` of
        tolerances.
    given : sequence of str
        "σ" for all numbers in mm, or "NAME=σ"; σ may have a unit, and for angles must.
    robot : Calibratable
        The machine.
    names : sequence of str
        The numbers of its geometry that may have one.

    Raises
    ------
    ValueError
        No number, a unit that does not fit, a wildcard over lengths and angles.
    """
    sigmas: dict[str, float] = {}
    for text in given:
        try:
            name, sigma = _deviation(text, robot, names)
            if not name and len(given) > 1:
                raise ArgumentError("a number without a name stands alone, for all")
        except ValueError as error:
            raise ArgumentError(f"{option} {text}: {error}") from None
        if not name:
            return sigma
        sigmas[name] = sigma
    return sigmas or None


def read_coefficients(option: str, given: Sequence[str]) -> float | Mapping[str, float] | None:
    """Coefficients from the command line: "NUMBER" for all, or "PART=NUMBER"; None without.

    Raises
    ------
    ValueError
        No number, a part twice, a number for all beside others.
    """
    found: dict[str, float] = {}
    for text in [part.strip() for each in given for part in each.split(",")]:
        match = _DEVIATION.fullmatch(text)
        name = "" if match is None else (match["name"] or "").strip()
        if match is None or match["unit"] or name in found:
            raise ArgumentError(f"{option} {text}: expected PART=NUMBER, such as base=11.5e-6")
        found[name] = float(match["number"])
    if "" in found and len(found) > 1:
        raise ArgumentError(f"{option}: a number without a part stands alone, for all")
    return found.get("", found or None)


def read_prior(
    given: Sequence[str], robot: Calibratable, names: Sequence[str]
) -> float | Mapping[str, float | tuple[float, float]] | None:
    """Read ``--prior``: deviations, and functions such as "|base1 - base2|=3000±1".

    Raises
    ------
    ValueError
        As `read_deviations`.
    """
    plain = [text for text in given if "±" not in text and "+-" not in text]
    found = read_deviations("--prior", plain, robot, names)
    if len(plain) == len(given):
        return found
    if isinstance(found, float):
        raise ArgumentError(f"--prior {plain[0]}: a number without a name stands alone, for all")
    stated: dict[str, float | tuple[float, float]] = dict(found or {})
    for text in given:
        if text not in plain:
            pair = _PAIR.fullmatch(text)
            try:
                name, value, sigma = _pair(pair, robot)
            except ValueError as error:
                raise ArgumentError(f"--prior {text}: {error}") from None
            stated[name] = value, sigma
    return stated


def read_uncertainty(
    given: Sequence[str], consider: Sequence[str], robot: Calibratable
) -> dict[str, float | Mapping[str, float]]:
    """Read ``--uncertainty`` and ``--consider``, as `identify` takes them.

    Raises
    ------
    ValueError
        No number, a unit that does not fit, a wildcard over lengths and angles, no name.
    """
    parts: dict[bool, list[str]] = {True: [], False: []}
    for text in given:
        stated, _, word = text.partition(",")
        if word.strip() not in ("", COMMON):
            raise ArgumentError(f"--uncertainty {text}: expected NAME=σ or NAME=σ,{COMMON}")
        parts[bool(word)].append(stated)
    found: dict[str, float | Mapping[str, float]] = {}
    found |= _named("--uncertainty", parts[False], robot)
    beside = {
        COMMON: _named("--uncertainty", parts[True], robot),
        CONSIDER: _named("--consider", consider, robot),
    }
    return found | {key: own for key, own in beside.items() if own}


def _named(option: str, given: Sequence[str], robot: Calibratable) -> Mapping[str, float]:
    """Deviations, each with a name."""
    found = read_deviations(option, given, robot, robot.geometry.names)
    if isinstance(found, float):
        raise ArgumentError(f"{option} {given[0]}: expected NAME=NUMBER, such as 'gain*=1e-3'")
    return found or {}


def _pair(pair: re.Match[str] | None, robot: Calibratable) -> tuple[str, float, float]:
    """Name or function, value and σ in mm, rad or 1; a value without a unit has that of σ."""
    parts = [_DEVIATION.fullmatch(pair[key].strip()) for key in ("value", "sigma")] if pair else []
    if pair is None or None in parts:
        raise ArgumentError("expected NAME=VALUE±σ, such as '|base1 - base2|=3000±1'")
    name = pair["name"].strip()
    first = "" if name.startswith("|") else next(iter(terms(name, name)))[1]
    unit = _unit_of(first, robot, robot.geometry.names)
    (value, of_value), (sigma, of_sigma) = (
        (float(part["number"]), part["unit"].strip()) for part in parts if part
    )
    return (
        name,
        _in_unit(value, of_value or of_sigma, unit, name),
        _in_unit(sigma, of_sigma, unit, name),
    )


def _deviation(text: str, robot: Calibratable, names: Sequence[str]) -> tuple[str, float]:
    """Name or wildcard, "" for all, and σ in mm, rad or 1."""
    match = _DEVIATION.fullmatch(text.strip())
    if match is None:
        raise ArgumentError("expected NAME=NUMBER, such as base1.x=0.5")
    name = (match["name"] or "").strip()
    unit = _unit_of(name, robot, names) if name else "mm"
    return name, _in_unit(float(match["number"]), match["unit"].strip(), unit, name)


def _unit_of(pattern: str, robot: Calibratable, names: Sequence[str]) -> str:
    """Unit of the numbers that a pattern covers; what is not known is a length."""
    units = dict(zip(robot.geometry.names, robot.geometry.units, strict=True))
    return unit_of(pattern, {name: str(units[name]) for name in names})


def _in_unit(number: float, unit: str, quantity: str, name: str) -> float:
    """A number in mm, rad or 1."""
    factors = UNITS.get(quantity, {})
    if not unit and quantity == "rad":
        raise ArgumentError(f"{name} is an angle; give it a unit, such as 0.1deg")
    if not unit:
        return number
    if unit not in factors:
        expected = f"one of {', '.join(u for u in factors if u.isascii())}" if factors else "none"
        raise ArgumentError(f"unit {unit!r}; expected {expected}")
    times, over = factors[unit]
    return number * times / over
