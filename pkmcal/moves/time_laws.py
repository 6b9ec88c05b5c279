"""Time laws of a move: cubic, quintic and jerk-limited, from rest to rest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import number
from pkmcal.arrays import FloatArray, as_numbers
from pkmcal.exceptions import ArgumentError

Sample = tuple[FloatArray, FloatArray, FloatArray]

# s(τ) from 0 to 1 over τ = t/duration, lowest power first
CUBIC = (0.0, 0.0, 3.0, -2.0)
QUINTIC = (0.0, 0.0, 0.0, 10.0, -15.0, 6.0)


@dataclass(frozen=True, eq=False)
class Polynomial:
    """A move from rest to rest along a polynomial.

    Attributes
    ----------
    start, end : ndarray (...)
        Where it begins and ends, in any unit.
    duration : float
        s.
    coefficients : tuple of float
        Of s(τ), which goes from 0 to 1 as τ = t/duration does; lowest power first.
    """

    start: FloatArray
    end: FloatArray
    duration: float
    coefficients: tuple[float, ...]

    def sample(self, t: ArrayLike) -> Sample:
        """Position, velocity and acceleration at times.

        Parameters
        ----------
        t : array_like (...)
            s. Before 0 and after `duration` it is at rest; at both ends the values are those of
            the move.

        Returns
        -------
        position, velocity, acceleration : ndarray
            Time first: the shape of `t`, then that of `start`; units of `start` and s.

        Examples
        --------
        >>> law = cubic(0.0, 10.0, 2.0)
        >>> [float(each) for each in law.sample(1.0)]
        [5.0, 7.5, 0.0]
        """
        times = seconds(t)
        inside = ~((times < 0) | (times > self.duration))  # NaN stays NaN
        tau = np.clip(times / self.duration, 0.0, 1.0)
        curve = np.polynomial.Polynomial(self.coefficients)
        way = self.end - self.start
        found = []
        for order in range(3):
            share = curve.deriv(order)(tau) if order else curve(tau)
            if order:
                share = np.where(inside, share, 0.0) / self.duration**order
            found.append(np.multiply.outer(share, way))
        return self.start + found[0], found[1], found[2]


def cubic(start: ArrayLike, end: ArrayLike, duration: float) -> Polynomial:
    """A move along s = 3τ² - 2τ³: at rest at both ends, with a jump in acceleration there.

    Parameters
    ----------
    start, end : array_like (...)
        In any unit; a scalar or one number an actuator.
    duration : float
        s.

    Returns
    -------
    Polynomial
        ``.sample(t)`` gives position, velocity and acceleration.

    Raises
    ------
    ValueError
        Shapes that differ, numbers that are not finite, a duration that is not positive.

    Examples
    --------
    >>> import pkmcal as pk
    >>> position, velocity, acceleration = pk.trajectory.cubic([0, 0], [10, 20], 2.0).sample([0, 1])
    >>> acceleration.tolist()
    [[15.0, 30.0], [0.0, 0.0]]
    """
    return _polynomial(start, end, duration, CUBIC)


def quintic(start: ArrayLike, end: ArrayLike, duration: float) -> Polynomial:
    """A move along s = 10τ³ - 15τ⁴ + 6τ⁵: at rest at both ends, and no jump in acceleration.

    Parameters
    ----------
    start, end : array_like (...)
        In any unit; a scalar or one number an actuator.
    duration : float
        s.

    Returns
    -------
    Polynomial
        ``.sample(t)`` gives position, velocity and acceleration.

    Raises
    ------
    ValueError
        Shapes that differ, numbers that are not finite, a duration that is not positive.

    Examples
    --------
    >>> import pkmcal as pk
    >>> position, velocity, acceleration = pk.trajectory.quintic(0, 10, 2.0).sample([0, 1, 2])
    >>> velocity.tolist(), acceleration.tolist()
    ([0.0, 9.375, 0.0], [0.0, 0.0, 0.0])
    """
    return _polynomial(start, end, duration, QUINTIC)


def _polynomial(
    start: ArrayLike, end: ArrayLike, duration: float, coefficients: tuple[float, ...]
) -> Polynomial:
    first, last = ends(start, end)
    return Polynomial(first, last, number("duration", duration, above=0), coefficients)


def ends(start: ArrayLike, end: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Both ends as arrays of one shape; raises ValueError where they are not."""
    first = as_numbers("start", start, "n").astype(np.float64)
    last = as_numbers("end", end, "n").astype(np.float64)
    if first.shape != last.shape:
        raise ArgumentError(f"start and end must have one shape, found {first.shape}, {last.shape}")
    for name, place in (("start", first), ("end", last)):
        if not np.isfinite(place).all():
            raise ArgumentError(f"{name} must be finite, found {place.tolist()}")
    return first, last


@dataclass(frozen=True, eq=False)
class JerkLimited:
    """The fastest move from rest to rest within limits of velocity, acceleration and jerk.

    Attributes
    ----------
    start, end : ndarray (k,)
        Where it begins and ends.
    duration : float
        s; all axes take as long.
    """

    start: FloatArray
    end: FloatArray
    duration: float
    _trajectory: Any

    def sample(self, t: ArrayLike) -> Sample:
        """Position, velocity and acceleration at times (...), each (..., k)."""
        times = seconds(t)
        found = np.full((times.size, 3, len(self.start)), np.nan)
        for row, each in enumerate(np.clip(times, 0, self.duration).flat):
            if not np.isnan(each):  # ruckig crashes there
                found[row] = self._trajectory.at_time(each)
        shape = (*times.shape, len(self.start))
        position, velocity, acceleration = (found[:, k].reshape(shape) for k in range(3))
        return position, velocity, acceleration


def jerk_limited(
    start: ArrayLike,
    end: ArrayLike,
    velocity: ArrayLike,
    acceleration: ArrayLike,
    jerk: ArrayLike,
) -> JerkLimited:
    """The fastest move from rest to rest within limits, with limited jerk.

    Needs the package ``ruckig``: ``pip install ruckig``.

    Parameters
    ----------
    start, end : array_like (k,)
        Actuator coordinates, in any unit.
    velocity, acceleration, jerk : array_like () or (k,)
        Limits, in that unit and s; one for all or one an actuator.

    Returns
    -------
    JerkLimited
        ``.duration`` and ``.sample(t)``.

    Raises
    ------
    ValueError
        Shapes that differ, a limit that is not positive.
    ImportError
        ``ruckig`` is not installed.
    """
    first, last = (np.atleast_1d(place) for place in ends(start, end))
    limits = {
        name: limit(name, value, len(first))
        for name, value in (("velocity", velocity), ("acceleration", acceleration), ("jerk", jerk))
    }
    try:
        import ruckig
    except ImportError as error:
        raise ImportError("a jerk-limited move needs ruckig: pip install ruckig") from error
    wanted = ruckig.InputParameter(len(first))
    wanted.current_position, wanted.target_position = first.tolist(), last.tolist()
    wanted.max_velocity = limits["velocity"].tolist()
    wanted.max_acceleration = limits["acceleration"].tolist()
    wanted.max_jerk = limits["jerk"].tolist()
    trajectory = ruckig.Trajectory(len(first))
    result = ruckig.Ruckig(len(first)).calculate(wanted, trajectory)
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise ArgumentError(f"ruckig finds no such move: {result}")
    return JerkLimited(first, last, float(trajectory.duration), trajectory)


def seconds(t: ArrayLike) -> FloatArray:
    """Times as numbers; raises TypeError where they are none."""
    return np.asarray(as_numbers("t", t, "N"), dtype=np.float64)


def limit(name: str, value: ArrayLike, count: int) -> FloatArray:
    """A limit for each of `count` actuators; raises ValueError where it is none."""
    given = as_numbers(name, value, count).astype(np.float64)
    if given.shape not in ((), (count,)):
        raise ArgumentError(f"{name} must be one limit or {count}, found shape {given.shape}")
    if not (given > 0).all():
        raise ArgumentError(f"{name} must be positive, found {given.tolist()}")
    return np.broadcast_to(given, (count,))
