"""The nine numbers of a lens, and those of them that a calibration finds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arrays import FloatArray
from pkmcal.core import instruments
from pkmcal.exceptions import ArgumentError
from pkmcal.readings.board_poses import unbent
from pkmcal.readings.rows import numbers
from pkmcal.readings.unknowns import Numbers

Found = Literal["none", "focal", "all"]
LENS = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
FOUND: Mapping[Found, tuple[int, ...]] = {
    "none": (),
    "focal": (0, 1, 2, 3),
    "all": tuple(range(8)),
}
_UNITS = ("px", "px", "px", "px", "1", "1", "1", "1", "1")
_ALIKE = 1e-12  # of a covariance in units of its deviations, what is rounding
_LEAST = 1e-9  # of what a number of the lens moves pixels by, where it moves none


def numbers_of_lens(
    stem: str,
    lens: FloatArray,
    slots: tuple[int, ...],
    pixel: FloatArray,
    mm: float,
    spread: FloatArray | None = None,
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
    spread : ndarray (9, 9), optional
        Covariance of a lens that is known, and is fitted along.
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
        None if spread is None else spread[np.ix_(chosen, chosen)],
    )


def size_of_pictures(lens: FloatArray, size: tuple[int, int]) -> tuple[float, float]:
    """Width and height of pictures, px; one that is not known, 0, as if the lens were centred."""
    width, height = (
        float(end) or 2.0 * middle + 1.0
        for end, middle in zip(size, lens[2:4].tolist(), strict=True)
    )
    return width, height


def covariance_of_lens(given: ArrayLike) -> FloatArray:
    """Covariance (9, 9) of a lens, of nine deviations or of a covariance; 0 of what is exact.

    Raises
    ------
    ValueError
        Other shapes, a negative deviation, no covariance.
    """
    found = numbers("lens_sigma", given)
    if found.shape == (9,):
        if (found < 0.0).any():
            raise ArgumentError("lens_sigma: standard deviations must be 0 or above")
        return np.diag(found**2)
    if found.shape != (9, 9):
        raise ArgumentError(
            "lens_sigma must be nine standard deviations, of fx fy cx cy k1 k2 p1 p2 k3, or their"
            f" covariance (9, 9); found {found.shape}"
        )
    some = np.flatnonzero(found.any(axis=0))
    inner = found[np.ix_(some, some)]
    sigma = np.sqrt(np.maximum(np.diagonal(inner), 0.0))
    scaled = inner / np.maximum(np.outer(sigma, sigma), np.finfo(float).tiny)
    if (
        not (sigma > 0.0).all()
        or not np.allclose(scaled, scaled.T, rtol=0.0, atol=_ALIKE)
        or np.linalg.eigvalsh(scaled).min(initial=1.0) <= _ALIKE
    ):
        raise ArgumentError("lens_sigma: this is no covariance matrix (symmetric, positive)")
    return np.asarray(0.5 * (found + found.T))
