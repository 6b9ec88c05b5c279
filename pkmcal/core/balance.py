"""Motion of a pose that more closures than free coordinates cannot meet at once.

It is where the rows balance, Jᵀ r = 0, with J their derivatives by the platform's steps, and moves
as this does:

    ∂pose = -(JᵀJ + Σ r ∂J)⁻¹ (Jᵀ ∂r + ∂Jᵀ r)

The second terms are what rows that are missed add: at 0.3 mm some thousandths, enough to keep a
calibration from converging. Derivatives of Jᵀ r are central differences of fourth order of it, and
not of poses, which would be solved for again. As a row is of one limb, the same number of all limbs
changes at once.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, Int32Array, IntArray
from pkmcal.core.library import COORDINATE_UNITS, MAPS, SLOTS

_STEP = 1e-4  # of the size, or rad: fifth derivatives and rounding add 1e-11 of a derivative
_OFFSET, _GAIN = SLOTS.index("offset"), SLOTS.index("gain")


class _Rows(Protocol):
    @property
    def by_step(self) -> FloatArray: ...
    @property
    def residual(self) -> FloatArray: ...


class Balanced(Protocol):
    """The interface that is asked of a machine: see `pkmcal.core.machine.Machine`."""

    struct: Any
    m: int
    rows: int
    actuators: int

    @property
    def turning(self) -> BoolArray:
        """Mask of drives that are angles."""

    @property
    def reading_rows(self) -> IntArray:
        """The first row of each limb."""

    def forward(
        self, slots: FloatArray, q: FloatArray, guess: FloatArray, threads: int | None
    ) -> tuple[FloatArray, Int32Array, Int32Array, FloatArray]:
        """Poses at coordinates."""

    def closure(self, slots: FloatArray, pose: FloatArray, q: FloatArray) -> _Rows:
        """Rows and their derivatives."""

    def moved(self, pose: FloatArray, step: FloatArray) -> FloatArray:
        """Poses moved by steps."""

    def step_twists(self, pose: FloatArray) -> FloatArray:
        """Twists by steps."""


def by_numbers(
    machine: Balanced, slots: FloatArray, pose: FloatArray, q: FloatArray, columns: Int32Array
) -> FloatArray:
    """Twist (ω, v) of the platform by numbers at `columns` of the flattened geometry.

    Parameters
    ----------
    machine : Machine
        With more rows than free coordinates.
    slots : ndarray (limbs, numbers) or (N, limbs, numbers)
        Geometry.
    pose, q : ndarray (N, 6), (N, n)
        Where it is or nearly, and its actuators.
    columns : ndarray of int (k,)
        Which numbers.

    Returns
    -------
    ndarray (N, 6, k)
        NaN where the machine does not close.
    """
    pose = machine.forward(slots, q, pose, threads=None)[0]
    answer = _answer(machine, slots, pose, q)
    limb, number = np.divmod(columns, slots.shape[-1])
    out = np.empty((len(q), 6, len(columns)))
    of_limb, of_actuator = _owners(machine)
    for each in np.unique(np.where(number == _GAIN, _OFFSET, number)).tolist():
        step = _STEP * np.where(_is_angle(machine, each), 1.0, machine.struct.size)

        def changed(share: float, at: int = each, step: FloatArray = step) -> FloatArray:
            other: FloatArray = slots.copy()
            other[..., at] += share * step
            return _balance(machine, other, pose, q)

        by_rows = _slope(changed) / step[of_limb, None]
        for c in np.flatnonzero((number == each) | ((number == _GAIN) & (each == _OFFSET))):
            mine = by_rows[:, of_limb == limb[c]].sum(axis=1)
            if number[c] == _GAIN:
                mine = mine * q[:, of_actuator[limb[c]], None]
            out[:, :, c] = (answer @ mine[..., None])[..., 0]
    return out


def by_actuators(
    machine: Balanced, slots: FloatArray, pose: FloatArray, q: FloatArray
) -> FloatArray:
    """Twist (ω, v) of the platform by actuators, (N, 6, n), as `by_numbers`."""
    limbs = np.arange(machine.struct.limbs)
    offsets = (limbs * slots.shape[-1] + _OFFSET).astype(np.int32)
    each = by_numbers(machine, slots, pose, q, offsets)
    each *= np.broadcast_to(slots[..., _GAIN], (len(q), len(limbs)))[:, None]
    of_actuator = _owners(machine)[1]
    found = [each[:, :, of_actuator == a].sum(axis=2) for a in range(machine.actuators)]
    return np.stack(found, axis=2)


def _is_angle(machine: Balanced, number: int) -> BoolArray:
    """Tell of each limb whether this number of it is an angle."""
    if number == _OFFSET:
        return machine.turning
    tilt = number < len(SLOTS) and "tilt" in SLOTS[number]
    return np.full(machine.struct.limbs, tilt)


def _owners(machine: Balanced) -> tuple[IntArray, IntArray]:
    """Return the limb of each row, and the actuator of each limb."""
    first = np.append(machine.reading_rows, machine.rows)
    of_limb = np.repeat(np.arange(machine.struct.limbs), np.diff(first))
    return of_limb, np.array(list(machine.struct.actuator[0 : machine.struct.limbs]))


def _balance(machine: Balanced, slots: FloatArray, pose: FloatArray, q: FloatArray) -> FloatArray:
    """Return the share of each row in Jᵀ r, (N, rows, m)."""
    at = machine.closure(slots, pose, q)
    return at.by_step * at.residual[..., None]


def _slope(of: Callable[[float], FloatArray]) -> FloatArray:
    """Derivative at 0 of a function of a share of a step, by the step."""
    near, far = of(1.0) - of(-1.0), of(2.0) - of(-2.0)
    slope: FloatArray = (8.0 * near - far) / 12.0
    return slope


def _answer(machine: Balanced, slots: FloatArray, pose: FloatArray, q: FloatArray) -> FloatArray:
    """Twist of the platform by what is added to Jᵀ r, (N, 6, m)."""
    free = MAPS[list(MAPS)[machine.struct.map]]
    turns = np.array([COORDINATE_UNITS[name] == "rad" for name in free])
    arcs = np.where(turns, 1.0 / machine.struct.length, 1.0)
    step = _STEP * machine.struct.size
    matrix = np.empty((len(pose), machine.m, machine.m))
    for j in range(machine.m):

        def moved(share: float, j: int = j) -> FloatArray:
            to = np.tile(share * step * arcs * (np.arange(machine.m) == j), (len(pose), 1))
            found: FloatArray = _balance(machine, slots, machine.moved(pose, to), q).sum(axis=1)
            return found

        matrix[:, :, j] = _slope(moved) / step
    twists = machine.step_twists(pose) * arcs
    good = np.isfinite(matrix).all(axis=(1, 2)) & np.isfinite(twists).all(axis=(1, 2))
    out = np.full(twists.shape, np.nan)
    out[good] = -twists[good] @ np.linalg.inv(matrix[good])
    return out
