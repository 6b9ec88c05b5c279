"""A machine with known errors, measured by an instrument with known noise."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pkmcal.measurement_fields import numbers
from pkmcal.measurements import COMPONENTS, Measurements

_ARM = 200.0  # mm; an instrument good to 0.02 mm over it is good to 1e-4 rad


class Solvable(Protocol):
    """What a virtual machine asks of a robot."""

    def forward(self, q: NDArray[np.float64]) -> Any:
        """A result with `pose` (N, 6) and `ok` (N,) for actuators (N, n)."""
        ...


class VirtualMachine:
    """A machine that can be commanded and measured, in place of a real one.

    Parameters
    ----------
    true_robot : Robot
        The machine as it really is, with its errors.
    noise : float
        Standard deviation of the instrument in mm, for every length it reads. 0: no noise.
    seed : int
        Of the noise. Each call of `measure` draws on; two machines with one seed read the same.
    angle_noise : float, optional
        Standard deviation of measured angles in rad; by default that of `noise` on an arm of
        200 mm.

    Examples
    --------
    >>> import pkmcal as pk                                               # doctest: +SKIP
    >>> machine = pk.VirtualMachine(pk.load("hexapod"), noise=0.01)       # doctest: +SKIP
    >>> m = machine.measure(pk.load("hexapod").inverse([0, 0, 400, 0, 0, 0]))  # doctest: +SKIP
    """

    def __init__(
        self,
        true_robot: Solvable,
        noise: float = 0.02,
        seed: int = 0,
        angle_noise: float | None = None,
    ) -> None:
        self.true_robot = true_robot
        self.noise = _deviation("noise", noise)
        angles = noise / _ARM if angle_noise is None else angle_noise
        self.angle_noise = _deviation("angle_noise", angles)
        self._random = np.random.default_rng(seed)

    def measure(
        self, q: ArrayLike, kind: str = "position", target: ArrayLike | None = None
    ) -> Measurements:
        """Command actuators and measure where the machine goes.

        Parameters
        ----------
        q : (N, n) or (n,) array
            Actuator coordinates, mm or rad.
        kind : {"position", "pose", "height", "distance"}
            What the instrument reads; see `Measurements`.
        target : (3,) or (N, 3) array, optional
            The measured point in the platform frame, mm; by default the platform's origin. For
            distances the fixed point of the base frame, and required.

        Returns
        -------
        Measurements
            With the instrument's noise as sigma; None where a component has no noise.

        Raises
        ------
        ValueError
            Rows that the machine cannot reach, by number; or an argument that does not fit.
        """
        actuators = np.atleast_2d(numbers("q", q))
        if actuators.ndim != 2:
            raise ValueError(f"q must have shape (N, n) or (n,); found {actuators.shape}")
        solved = self.true_robot.forward(actuators)
        failed = np.flatnonzero(~np.asarray(solved.ok))
        if len(failed):
            rows = ", ".join(map(str, failed[:10])) + (", …" if len(failed) > 10 else "")
            raise ValueError(
                f"q: {len(failed)} of {len(actuators)} rows have no pose on the true machine"
                f" (rows {rows})"
            )
        exact = Measurements(
            actuators,
            _readings(np.asarray(solved.pose), kind, target),
            kind,
            target=target,
            actuator_units=getattr(self.true_robot, "actuator_units", None),
        )
        sigma = np.array([self.angle_noise if u == "rad" else self.noise for u in exact.units])
        drawn = sigma * self._random.standard_normal((len(exact), len(sigma)))
        return Measurements(
            actuators,
            exact.values + drawn.reshape(exact.values.shape),
            kind,
            sigma=sigma if (sigma > 0).all() else None,
            target=target,
            actuator_units=exact.actuator_units,
        )


def _readings(
    pose: NDArray[np.float64], kind: str, target: ArrayLike | None
) -> NDArray[np.float64]:
    """What an instrument without noise reads; the checks of the arguments are Measurements'."""
    if kind not in COMPONENTS or kind == "pose":
        return pose
    position = pose[:, :3]
    if target is None:
        if kind == "distance":
            raise ValueError("target: a distance needs the fixed point (3,) it is measured to")
        return position[:, 2] if kind == "height" else position
    point = numbers("target", target)
    if point.shape not in ((3,), position.shape):
        raise ValueError(f"target must have shape (3,) or {position.shape}; found {point.shape}")
    if kind == "distance":
        distance: NDArray[np.float64] = np.linalg.norm(position - point, axis=1)
        return distance
    from scipy.spatial.transform import Rotation

    # about the fixed axes x, y, z in turn: R = Rz(gamma) Ry(beta) Rx(alpha)
    placed: NDArray[np.float64] = position + Rotation.from_euler("xyz", pose[:, 3:]).apply(point)
    return placed[:, 2] if kind == "height" else placed


def _deviation(name: str, value: float) -> float:
    if not (np.isfinite(value) and value >= 0):
        raise ValueError(f"{name} must be a finite number, zero or more; found {value!r}")
    return float(value)
