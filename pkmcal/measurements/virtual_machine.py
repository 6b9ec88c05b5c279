"""A machine with known errors, measured by an instrument with known noise."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import checked_seed, number, shown
from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import FloatArray
from pkmcal.display import first_rows
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.geometry.carried import Load
from pkmcal.kinematics.arm_machine import ArmMachine
from pkmcal.kinematics.calibratable import Solvable
from pkmcal.measurements.former import OF_MEASURE, adapted
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.tracker import Tracker
from pkmcal.readings.reading import Reading
from pkmcal.readings.registry import Kind, as_reading
from pkmcal.readings.rows import numbers
from pkmcal.readings.unknowns import POINT

_ARGUMENTS = ("kind", "target", "approach", "tension", "load")  # of `measure`
_ARM = 200.0  # mm; an instrument good to 0.02 mm over it is good to 1e-4 rad


class VirtualMachine:
    """A machine that can be commanded and measured, in place of a real one.

    Parameters
    ----------
    true_robot : Robot or SerialArm
        The machine as it really is, with its errors.
    noise : float or Tracker
        Standard deviation of the instrument in mm, for every length it reads; or a tracker, which
        measures positions. 0: no noise.
    seed : int
        Of the noise. Each call of `measure` draws on; two machines with one seed read the same.
    angle_noise : float, optional
        Standard deviation of measured orientations about every axis, rad; by default that of
        `noise` on an arm of 200 mm.

    Examples
    --------
    >>> import pkmcal as pk
    >>> robot = pk.load("hexapod")
    >>> machine = pk.VirtualMachine(robot.replace({"offset1": 0.5}), noise=0.01)
    >>> print(machine.measure(robot.inverse(robot.home)).kind)
    position
    """

    def __init__(
        self,
        true_robot: Solvable | SerialArm,
        noise: float | Tracker = 0.02,
        seed: int = 0,
        *,
        angle_noise: float | None = None,
    ) -> None:
        if not hasattr(true_robot, "forward"):
            raise ArgumentTypeError(
                f"true_robot must be a Robot or SerialArm, found {shown(true_robot)}"
            )
        self.true_robot = true_robot
        self._machine: Solvable = (
            ArmMachine(true_robot) if isinstance(true_robot, SerialArm) else true_robot
        )
        self.noise = noise if isinstance(noise, Tracker) else number("noise", noise, least=0)
        if angle_noise is None:
            angle_noise = 0.0 if isinstance(noise, Tracker) else noise / _ARM
        self.angle_noise = number("angle_noise", angle_noise, least=0)
        self._random = np.random.default_rng(checked_seed(seed))

    def __repr__(self) -> str:
        noise = f"{self.noise:g} mm" if isinstance(self.noise, float) else repr(self.noise)
        return f"<VirtualMachine: {self.true_robot!r}, noise {noise}, {self.angle_noise:g} rad>"

    def measure(
        self,
        q: ArrayLike,
        kind: Kind | Reading = "position",
        target: ArrayLike | None = None,
        *,
        approach: ArrayLike | None = None,
        tension: ArrayLike | None = None,
        load: Load | None = None,
        **former: Any,
    ) -> Measurements:
        """Command actuators and measure where the machine goes.

        Parameters
        ----------
        q : (N, n) or (n,) array
            Actuator coordinates, mm or rad.
        kind : str or Reading
            What the instrument reads; see `Measurements`. Objects of `pkmcal.readings` state what
            a simulation has to know beside: how a sensor is mounted, where touched things are.
        target : (3,) or (N, 3) array, optional
            The measured point in the platform frame, mm; by default the platform's origin. For
            distances the fixed point of the base frame, and required.
        approach : scalar, (n,) or (N, n) array, or "order", optional
            From where the actuators come; see `Measurements`.
        tension : scalar, (n,) or (N, n) array, optional
            Of what each actuator drives, N.
        load : Load, optional
            What the machine carries, one for all rows or one a row.

        Returns
        -------
        Measurements
            With the instrument's noise as sigma; None where a component has no noise.

        Raises
        ------
        ValueError
            Rows that the machine cannot reach, by number; or an argument that does not fit.

        Examples
        --------
        >>> import pkmcal as pk
        >>> robot = pk.load("hexapod")
        >>> tilts = pk.readings.Tilt(mounting=[0, 0, 0.5])
        >>> pk.VirtualMachine(robot).measure(robot.inverse(robot.home), tilts).units
        ('rad', 'rad')
        """
        actuators = np.atleast_2d(numbers("q", q))
        n = getattr(self._machine, "n_actuators", actuators.shape[-1])
        if actuators.ndim != 2 or actuators.shape[1] != n or not actuators.size:
            raise ArgumentError(f"q must have shape (N, {n}) or ({n},); found {np.shape(q)}")
        instrument = adapted("measure", as_reading(kind), former, OF_MEASURE, _ARGUMENTS)
        if tension is not None:
            numbers("tension", tension)  # of what is driven it is known
        width = len(instrument.components)
        blank = Measurements(
            actuators,
            np.zeros((len(actuators), width) if width != 1 else len(actuators)),
            instrument,
            target=target,
            actuator_units=getattr(self._machine, "actuator_units", None),
            approach=approach,
            tension=tension,
            load=load,
        )
        exact = blank.instrument.simulated(blank, _Solving(self._machine, blank))
        noise, sigma = self._drawn(blank, exact)
        values = blank.instrument.corrected(exact, noise).reshape(blank.values.shape)
        known = blank.instrument.measured()
        return dataclasses.replace(blank, instrument=known, values=values, sigma=sigma)

    def _drawn(self, blank: Measurements, exact: FloatArray) -> tuple[FloatArray, Any]:
        """Noise (N, k), and the sigma to state."""
        drawn = self._random.standard_normal(exact.shape)
        if isinstance(self.noise, Tracker):
            if blank.instrument.components != POINT:
                raise ArgumentError(f"kind: a tracker measures positions, found {blank.kind!r}")
            covariance = self.noise.covariance(exact)
            return (np.linalg.cholesky(covariance) @ drawn[:, :, None])[:, :, 0], self.noise
        sigma = self.deviations(blank.units)
        return sigma * drawn, sigma if len(sigma) and (sigma > 0).all() else None

    def deviations(self, units: Sequence[str]) -> FloatArray:
        """Deviation of each component of a reading, by its unit.

        Raises
        ------
        ValueError
            A tracker's follow from where it points.
        """
        if isinstance(self.noise, Tracker):
            raise ArgumentError("noise: that of a tracker follows from where it points")
        of_unit = {"rad": self.angle_noise}  # every other unit: the instrument's noise
        return np.array([of_unit.get(unit, self.noise) for unit in units])


@dataclass(frozen=True)
class _Solving:
    """The forward kinematics of a machine in the state of its drives."""

    machine: Any
    rows: Measurements

    def __call__(self, actuators: FloatArray, argument: str) -> Any:
        state = self.rows.other_drive_state if argument == "other" else self.rows.drive_state
        solved = state.of(self.machine).forward(actuators)
        failed = np.flatnonzero(~np.asarray(solved.ok)).tolist()
        if failed:
            raise ArgumentError(
                f"{argument}: {len(failed)} of {len(actuators)} rows have no pose on the true"
                f" machine (rows {first_rows(failed, 10)})"
            )
        return solved
