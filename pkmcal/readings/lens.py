"""The nine numbers of a lens, and those of them that a calibration finds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.core import instruments
from pkmcal.readings.board_poses import unbent
from pkmcal.readings.unknowns import Numbers

Found = Literal["none", "focal", "all"]
LENS = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
FOUND: Mapping[Found, tuple[int, ...]] = {
    "none": (),
    "focal": (0, 1, 2, 3),
    "all": tuple(range(8)),
}
_UNITS = ("px", "px", "px", "px", "1", "1", "1", "1", "1")
_LEAST = 1e-9  # of what a number of the lens moves pixels by, where it moves none


def numbers_of_lens(
    stem: str, lens: FloatArray, slots: tuple[int, ...], pixel: FloatArray, mm: float
) -> Numbers:
    """Numbers of a lens that are found, counted by how much they move what is seen.

    Parameters
    ----------
    stem : str
        Of their names.
    lens : ndarray (9,)
        Where the search for them begins.
    slots : tuple of int
        Which.
    pixel : ndarray (N, 2)
        What is seen; NaN where nothing is.
    mm : float
        A pixel at the board, mm.
    """
    known = np.isfinite(pixel).all(axis=1)
    rate = np.ones(9)
    if known.any():
        each = np.tile(lens, (int(known.sum()), 1))
        ahead = np.column_stack([unbent(pixel[known], each), np.ones(len(each))])
        by_lens = instruments.pixels(np.zeros((len(ahead), 6)), ahead, each)[2]
        rate = np.sqrt(np.nanmean(by_lens**2, axis=(0, 1)))
    chosen = list(slots)
    return Numbers(
        tuple(f"{stem}.{LENS[slot]}" for slot in slots),
        tuple(_UNITS[slot] for slot in slots),
        np.array(chosen, dtype=np.intp),
        lens[chosen],
        1.0 / mm / np.maximum(rate, _LEAST)[chosen],
    )
