"""Single arguments of public calls: as they are wanted, or an error that names them.

Without NumPy, whose numbers are `numbers.Real`: who serves the window computes nothing.
"""

from __future__ import annotations

import difflib
import functools
import math
import os
import sys
import warnings
from collections.abc import Callable, Collection, Iterable
from concurrent.futures import Executor
from numbers import Integral, Real
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

from pkmcal.exceptions import ArgumentError, ArgumentTypeError

P = ParamSpec("P")
T = TypeVar("T")
W = TypeVar("W", bound=str)  # of a Literal

_SQUARED = 1e150  # of numbers up to this one squares are numbers


def earlier_keywords(
    *names: str, now: Callable[[dict[str, Any], dict[str, Any]], dict[str, Any]]
) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Let a function take keywords of the version before, with a warning that says the new ones.

    Parameters
    ----------
    names : str
        The keywords of the version before.
    now : callable
        What it returns replaces them: today's keywords, from those of before that were given, and
        from the others beside them.
    """

    def decorated(function: Callable[P, T]) -> Callable[P, T]:
        @functools.wraps(function)
        def called(*positional: P.args, **given: P.kwargs) -> T:
            before = {name: given.pop(name) for name in names if name in given}
            if before:
                new = now(before, given)
                written = ", ".join(f"{name}={value!r}" for name, value in new.items())
                warnings.warn(
                    f"{function.__name__}: {', '.join(f'{name}=' for name in before)} will go in"
                    f" the next version; {f'write {written}' if written else 'leave it out'}",
                    DeprecationWarning,
                    stacklevel=2,
                )
                given.update(new)
            return function(*positional, **given)

        return called

    return decorated


def number(name: str, value: object, least: float = -math.inf, above: float = -math.inf) -> float:
    """A finite number, `least` or more, above `above`; if above 0, one whose square is one, too.

    Raises
    ------
    TypeError
        No number, or a truth value.
    ValueError
        Not finite, or too small.
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        raise ArgumentTypeError(f"{name} must be a number, found {shown(value)}")
    # limits are not numbers of lower precision
    size: int | float = value if isinstance(value, int) else float(value)
    if not abs(size) <= sys.float_info.max:
        raise ArgumentError(f"{name} must be finite, found {shown(value)}")
    if not size >= least:
        raise ArgumentError(f"{name} must be {least:g} or more, found {size}")
    if not size > above:
        raise ArgumentError(f"{name} must be above {above:g}, found {size}")
    if above == 0.0 and not 1.0 / _SQUARED <= size <= _SQUARED:
        raise ArgumentError(f"{name} must be from 1e-150 to 1e150, found {size}")
    return float(size)


def whole(name: str, value: object, least: int, most: float = math.inf, note: str = "") -> int:
    """A whole number from `least` to `most`; `note` is for the message.

    Raises
    ------
    ValueError
        Anything else.
    """
    counted = isinstance(value, Integral) and not isinstance(value, bool)
    if counted and cast(int, value) > sys.maxsize:
        most = min(most, sys.maxsize)
    if not counted or not least <= cast(int, value) <= most:
        span = f"from {least}" + (f" to {most}" if most < math.inf else "") + note
        raise ArgumentError(f"{name} must be a whole number {span}, found {shown(value)}")
    return int(cast(int, value))


def word(name: str, value: object, known: Collection[W]) -> W:
    """Check that an argument is one of the known words.

    Raises
    ------
    ValueError
        Anything else.
    """
    if not isinstance(value, str) or value not in known:
        near = did_you_mean(value, known, listed=0)
        raise ArgumentError(f"{name} must be one of {', '.join(known)}; found {shown(value)}{near}")
    return cast(W, value)


def words(name: str, value: object) -> tuple[str, ...]:
    """A name, or several: each a str.

    Raises
    ------
    TypeError
        Anything else.
    """
    if isinstance(value, str):
        return (value,)
    try:
        several = tuple(cast(Iterable[object], value))
    except TypeError:
        raise ArgumentTypeError(f"{name} must be a name or several, found {shown(value)}") from None
    for each in several:
        if not isinstance(each, str):
            raise ArgumentTypeError(
                f"{name} must be a name or several, found {shown(each)} among them"
            )
    return cast(tuple[str, ...], several)


def instance(name: str, value: object, wanted: type[T], note: str = "") -> T:
    """An object of one class; `note` is for the message.

    Raises
    ------
    TypeError
        Anything else.
    """
    if not isinstance(value, wanted):
        article = "an" if wanted.__name__[0] in "AEIOU" else "a"
        raise ArgumentTypeError(
            f"{name} must be {article} {wanted.__name__}{note}, found {kind(value)}"
        )
    return value


def flag(name: str, value: object) -> bool:
    """True or False.

    Raises
    ------
    TypeError
        Anything else.
    """
    truths = bool | sys.modules["numpy"].bool_ if "numpy" in sys.modules else bool
    if not isinstance(value, truths):
        raise ArgumentTypeError(f"{name} must be True or False, found {shown(value)}")
    return bool(value)


def function(name: str, value: T) -> T:
    """Something that can be called.

    Raises
    ------
    TypeError
        Anything else.
    """
    if not callable(value):
        raise ArgumentTypeError(f"{name} must be a function, found {shown(value)}")
    return value


def executor(value: Executor | None) -> Executor | None:
    """Return the executor that an argument gives, or None.

    Raises
    ------
    TypeError
        Anything else; of Dask the executor is asked for, not the client.
    """
    if value is None:
        return None
    return instance("executor", value, Executor, " of concurrent.futures or alike, or None")


def path(name: str, value: object) -> Path:
    """Return an argument as the path of a file or folder.

    Raises
    ------
    TypeError
        No str or path.
    """
    if not isinstance(value, str | os.PathLike):
        raise ArgumentTypeError(f"{name} must be a str or path, found {shown(value)}")
    return Path(value)


def comment(value: object) -> str:
    """Lines for the head of a file, each with its ``#``.

    Raises
    ------
    TypeError
        No str.
    ValueError
        A line without its ``#``, or an end in the middle of a line.
    """
    text = instance("comment", value, str)
    for line in text.splitlines():
        if line and not line.startswith("#"):
            raise ArgumentError(f"comment: each of its lines must start with #, found {line!r:.60}")
    return text if not text or text.endswith("\n") else text + "\n"


def kind(value: object) -> str:
    """Name the class of an argument, for messages."""
    return type(value).__name__


def shown(value: object) -> str:
    """An argument as a message shows it: what is long, by its class."""
    text = repr(value)
    return text if len(text) <= 60 and "\n" not in text else kind(value)


def checked_seed(seed: int) -> int:
    """A seed that numpy and the core take.

    Raises
    ------
    ValueError
        It is no whole number from 0 to 2⁶⁴ - 1.
    """
    if isinstance(seed, bool) or not isinstance(seed, Integral) or not 0 <= seed < 2**64:
        raise ArgumentError(f"seed must be a whole number from 0 to 2**64 - 1, found {seed!r}")
    return int(seed)


def did_you_mean(name: object, known: Iterable[str], listed: int = 12) -> str:
    """Say which known name is near, or list the known ones where they are few.

    Parameters
    ----------
    name : str
        What was found; anything else is near to nothing.
    known : iterable of str
        What would have been right.
    listed : int
        Up to so many known names are listed when none is near.

    Returns
    -------
    str
        The end of a sentence, empty when there is nothing to say.

    Examples
    --------
    >>> did_you_mean("ofset1", ["base1.x", "offset1"])
    "; did you mean 'offset1'?"
    >>> did_you_mean("q", ["mm", "rad"])
    '; known: mm, rad'
    """
    names = list(dict.fromkeys(known))
    by_lower = {each.lower(): each for each in reversed(names)}
    found = name if isinstance(name, str) else ""
    near = difflib.get_close_matches(found.lower(), list(by_lower), n=1, cutoff=0.6)
    if near and len(found) > 2:  # two letters are near to too much
        return f"; did you mean {by_lower[near[0]]!r}?"
    if 0 < len(names) <= listed:
        return f"; known: {', '.join(names)}"
    return ""
