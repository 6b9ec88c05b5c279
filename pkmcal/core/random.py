"""Normally distributed numbers from the core: the same bits on every processor."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core.library import ISA, call

_GENERATORS = 8  # of xoshiro256+, four words each


class Normals:
    """Standard normal numbers, one batch after the other.

    Eight generators xoshiro256+ (Blackman, Vigna 2021) fill an array by turns, each number pair by
    the transform of Box and Muller (1958); uniform numbers with 52 bits end it at ±8.5.

    Parameters
    ----------
    seed : SeedSequence
        Where the generators start.
    isa : int, optional
        Of the core.

    Examples
    --------
    >>> import numpy as np
    >>> numbers = Normals(np.random.SeedSequence(1)).fill(np.empty((1000, 4)))
    >>> bool(abs(numbers.mean()) < 0.05 and abs(numbers.std() - 1) < 0.05)
    True
    """

    def __init__(self, seed: np.random.SeedSequence, isa: int = ISA) -> None:
        self._state = seed.generate_state(4 * _GENERATORS, np.uint64)
        self._isa = isa

    def fill(self, out: FloatArray) -> FloatArray:
        """Fill a contiguous array of any shape, and return it."""
        call("normals", out.size, self._state, out, isa=self._isa)
        return out
