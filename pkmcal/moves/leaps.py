"""Leaps of a move from one assembly mode to another, which no platform makes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.modes.find import frames_of
from pkmcal.moves.peaks import STEPS

_HALVINGS = 30  # of a step
_FAST = 4.0  # times what the larger speed at its ends explains: a step that goes further may leap
_SMALL = 1e-5  # of the machine's length: a step that goes less far does not
_KEPT = 0.01  # share of a step that is left after all halvings where it leaps


class Sample(Protocol):
    """A machine at times of a move."""

    @property
    def pose(self) -> FloatArray:
        """Poses (N, 6)."""

    @property
    def twist(self) -> FloatArray:
        """Return the platform's twists (ω, v) at times, (N, 6)."""


def apart(poses: FloatArray, others: FloatArray, length: float) -> FloatArray:
    """Distances of poses (N, 6) from others, mm: of p, and the largest entry of R times length."""
    difference = frames_of(poses) - frames_of(others)
    difference[:, :9] *= length
    return np.asarray(np.abs(difference).max(axis=1))


def same(pose: FloatArray, other: FloatArray, length: float) -> bool:
    """Return whether two poses (6,) are of one assembly mode: one place, for the same actuators."""
    return not float(apart(pose[None], other[None], length)[0]) > _SMALL * length


def leap(sample: Callable[[FloatArray], Sample], duration: float, length: float) -> float | None:
    """First time at which the poses of a move leap; None where they do not.

    2001 times are looked at. Of a step that goes further than speeds at its ends explain, the half
    that goes further is halved again; on a continuous path that becomes small, even as slowly as
    near a singularity, where it goes with the root of time. Times without a pose are no leaps, but
    those between two poses of a step are.
    """
    times = np.linspace(0.0, duration, STEPS + 1)
    at = sample(times)
    way = apart(at.pose[1:], at.pose[:-1], length)
    speed = np.abs(at.twist[:, 3:]).max(axis=1) + length * np.abs(at.twist[:, :3]).max(axis=1)
    explained = np.fmax(np.nan_to_num(speed[1:]), np.nan_to_num(speed[:-1])) * np.diff(times)
    odd = np.flatnonzero(way > _FAST * explained + _SMALL * length)  # NaN is beyond nothing
    low, high = times[odd], times[odd + 1]
    before, after = at.pose[odd], at.pose[odd + 1]
    for _ in range(_HALVINGS if odd.size else 0):
        middle = 0.5 * (low + high)
        between = sample(middle).pose
        first, second = apart(between, before, length), apart(after, between, length)
        left = np.isnan(first) | (first > second)
        low, high = np.where(left, low, middle), np.where(left, middle, high)
        stays = left[:, None] & np.isfinite(between)
        before, after = (
            np.where(left[:, None], before, between),
            np.where(stays, between, after),
        )
    left_over = apart(after, before, length)
    leaps = low[left_over > np.maximum(_KEPT * way[odd], _SMALL * length)]
    return float(leaps.min()) if leaps.size else None
