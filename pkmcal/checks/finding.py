"""One suspected mistake, in words and numbers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from pkmcal.display import Table
from pkmcal.result import Result


@dataclass(frozen=True, repr=False)
class Finding(Result):
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

    def _parts(self) -> Iterator[str | Table]:
        yield f"{self.kind}: {self.what}"
        yield f"-> {self.suggestion}"


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
