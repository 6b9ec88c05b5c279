"""One mistake that was found, in words and numbers."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """One thing that a table of geometry probably gets wrong.

    Attributes
    ----------
    kind : str
        What kind of mistake; `check_geometry` lists them.
    limbs : tuple of int
        The limbs it is about, of an arm the joints, counted from 1; empty for the machine as a
        whole.
    what : str
        What was found, with its numbers in mm and degrees.
    suggestion : str
        What to look at or to write instead.
    """

    kind: str
    limbs: tuple[int, ...]
    what: str
    suggestion: str


def named(limbs: Iterable[int], one: str = "limb") -> str:
    """Limbs in words, counted from 1.

    Examples
    --------
    >>> named([2]), named([0, 1, 4])
    ('limb 3', 'limbs 1, 2 and 5')
    """
    numbers = [str(limb + 1) for limb in limbs]
    if len(numbers) == 1:
        return f"{one} {numbers[0]}"
    return f"{one}s {', '.join(numbers[:-1])} and {numbers[-1]}"
