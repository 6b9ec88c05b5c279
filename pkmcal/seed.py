"""Seeds of random draws."""

from __future__ import annotations

import numpy as np


def checked_seed(seed: int) -> int:
    """A seed that numpy and the core take.

    Raises
    ------
    ValueError
        It is no whole number from 0 to 2⁶⁴ - 1.
    """
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or not 0 <= seed < 2**64:
        raise ValueError(f"seed must be a whole number from 0 to 2**64 - 1, found {seed!r}")
    return int(seed)
