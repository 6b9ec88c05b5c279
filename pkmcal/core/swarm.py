"""The compiled particle swarm of eq. 19 as Python sees it: its factors, its steps, and eq. 18."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pkmcal._core import ffi, lib
from pkmcal.arguments import number, whole
from pkmcal.arrays import FloatArray
from pkmcal.core.library import ISA, call, in_threads, part, processors

SWARMS_PER_THREAD = 16  # fewer do not pay for a thread


@dataclass(frozen=True)
class SwarmSettings:
    """Size of a swarm and the factors of eq. 19; the defaults are the paper's.

    Attributes
    ----------
    particles, iterations : int
        N and T.
    inertia, cognitive, social : float
        ω, c1 and c2.

    Raises
    ------
    ValueError
        No particle, negative iterations, a factor that is not finite.

    Examples
    --------
    >>> SwarmSettings().spread_growth > 1 > CONSTRICTION.spread_growth
    True
    """

    particles: int = 100
    iterations: int = 200
    inertia: float = 0.8
    cognitive: float = 1.5
    social: float = 1.5

    def __post_init__(self) -> None:
        for name, least in (("particles", 1), ("iterations", 0)):
            whole(name, getattr(self, name), least)
        for name in ("inertia", "cognitive", "social"):
            number(name, getattr(self, name))

    @property
    def spread_growth(self) -> float:
        """Factor by which a particle's variance changes an iteration while pBest and gBest rest.

        The largest eigenvalue of the recurrence of (E x², E x·x₋₁, E x₋₁²), where
        x₊₁ = (1 + ω - θ) x - ω x₋₁ and θ = c1 rand1 + c2 rand2. Below 1 a particle settles
        (order-2 stability); for c1 = c2 that is c1 + c2 < 24 (1 - ω²)/(7 - 5 ω).
        """
        w, mean = self.inertia, 0.5 * (self.cognitive + self.social)
        variance = (self.cognitive**2 + self.social**2) / 12
        keep = 1 + w - mean
        moments = [[keep**2 + variance, -2 * w * keep, w**2], [keep, -w, 0.0], [1.0, 0.0, 0.0]]
        return float(np.abs(np.linalg.eigvals(np.array(moments))).max())


PAPER = SwarmSettings()
CONSTRICTION = SwarmSettings(inertia=0.7298, cognitive=1.49618, social=1.49618)


class Swarm:
    """A swarm step by step, for objectives that Python evaluates.

    Parameters
    ----------
    settings : SwarmSettings
        Size and factors.
    lower, upper : ndarray (n,)
        Bounds.
    seed : int
        From 0 to 2⁶⁴ - 1.
    isa : int
        Index into `pkmcal.core.ISAS`; the bits are the same.
    """

    def __init__(
        self,
        settings: SwarmSettings,
        lower: FloatArray,
        upper: FloatArray,
        seed: int,
        isa: int = ISA,
    ) -> None:
        self._struct = _struct(settings, len(lower))
        self._isa = isa
        self._bounds = (lower, upper)
        self._state = np.empty(lib.pkm_swarm_size(self._struct))
        dims, width = len(lower), -(-settings.particles // 8) * 8
        self._x = self._state[: dims * width].reshape(dims, width)[:, : settings.particles]
        self._values = self._state[-dims - 1 - width : -dims - 1][: settings.particles]
        call("swarm_start", self._struct, seed, lower, upper, self._state, isa=isa)

    @property
    def positions(self) -> FloatArray:
        """Positions of the particles, a copy (particles, n)."""
        positions: FloatArray = self._x.T.copy()
        return positions

    @property
    def best(self) -> tuple[FloatArray, float]:
        """GBest (n,), a copy, and its value: infinite while no particle had a number."""
        dims = len(self._x)
        return self._state[-dims - 1 : -1].copy(), float(self._state[-1])

    def update_best(self, values: FloatArray) -> None:
        """Take the particles' values (particles,), which decide pBest and gBest."""
        self._values[:] = values
        call("swarm_update_best", self._struct, self._state, isa=self._isa)

    def move(self) -> None:
        """Eq. 19. A particle that would leave the bounds stops there, at rest in that direction."""
        call("swarm_move", self._struct, *self._bounds, self._state, isa=self._isa)


def minimise_eq18(
    settings: SwarmSettings,
    off: FloatArray,
    half_width: FloatArray,
    seed: int,
    isa: int = ISA,
    threads: int | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Minimise eq. 18 by swarms in the core, one for each set of poses.

    Parameters
    ----------
    settings : SwarmSettings
        Of each swarm.
    off : ndarray (N, rows, n)
        L* - L of the poses of each set. A set with a NaN has no solution.
    half_width : ndarray (n,)
        The swarm searches between minus and plus this.
    seed : int
        From 0 to 2⁶⁴ - 1; the swarm of a set is distinguished by its number.
    isa : int
        Index into `pkmcal.core.ISAS`; the bits are the same.
    threads : int, optional
        As many as pay by default; the bits are the same.

    Returns
    -------
    correction : ndarray (N, n)
        ΔL; NaN where there is none.
    history : ndarray (N, iterations + 1)
        The lowest E of the swarm so far, before the first and after every iteration; NaN likewise.
    """
    sets, rows, dims = off.shape
    struct = _struct(settings, dims)
    correction = np.empty((sets, dims))
    history = np.empty((sets, settings.iterations + 1))
    off = np.ascontiguousarray(off)
    lower, upper = np.ascontiguousarray(-half_width), np.ascontiguousarray(half_width)

    def run(start: int, stop: int) -> None:
        state = np.empty(lib.pkm_swarm_size(struct))
        own = [part(each, start, stop) for each in (off, correction, history)]
        size = (settings.iterations, seed, start, stop - start, rows)
        call("swarm_eq18", struct, *size, own[0], lower, upper, state, *own[1:], isa=isa)

    if sets:
        if threads is None:
            threads = max(1, min(processors(), sets // SWARMS_PER_THREAD))
        in_threads(run, sets, threads)
    unreached = ~np.isfinite(off).all(axis=(1, 2))
    correction[unreached] = np.nan
    history[unreached] = np.nan
    return correction, history


def _struct(settings: SwarmSettings, dims: int) -> Any:
    struct = ffi.new("pkm_swarm *")
    struct.particles, struct.dims = settings.particles, dims
    struct.inertia, struct.cognitive = settings.inertia, settings.cognitive
    struct.social = settings.social
    return struct
