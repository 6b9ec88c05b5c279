"""A machine with known errors, measured by an instrument with known noise."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import checked_seed, did_you_mean, number, shown, word
from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import FloatArray
from pkmcal.display import first_rows
from pkmcal.exceptions import ArgumentError, ArgumentTypeError
from pkmcal.kinematics.calibratable import ArmMachine, Solvable
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.components import KINDS, Artefact, Kind, components
from pkmcal.measurements.fields import numbers
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.observation import corrected
from pkmcal.measurements.tracker import Tracker
from pkmcal.readings.reading import At, Reading

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
        labels: Mapping[str, Sequence[str]] | None = None,
        attachment: ArrayLike | None = None,
        other: ArrayLike | None = None,
        run: Sequence[str] | None = None,
        mounting: ArrayLike = (0.0, 0.0, 0.0),
        touched: Mapping[str, ArrayLike] | None = None,
        artefact: Artefact = "point",
        touches: Sequence[str] | None = None,
        joint: str | None = None,
        approach: ArrayLike | None = None,
        tension: ArrayLike | None = None,
    ) -> Measurements:
        """Command actuators and measure where the machine goes.

        Parameters
        ----------
        q : (N, n) or (n,) array
            Actuator coordinates, mm or rad.
        kind : str
            What the instrument reads; see `Measurements`.
        target : (3,) or (N, 3) array, optional
            The measured point in the platform frame, mm; by default the platform's origin. For
            distances the fixed point of the base frame, and required.
        attachment : (3,) or (N, 3) array, optional
            The point in the platform frame, mm, from which distances are measured.
        other : (N, n) array, optional
            Of kind "between": the actuators at the second place.
        run : (N,) sequence of str, optional
            Of kind "relative-distance": the run of each row. The first row of a run reads 0.
        mounting : (3,) array
            Of kinds "tilt" and "orientation": α β γ of the sensor on the platform, rad.
        touches : (N,) sequence of str, optional
            Of kind "touch": the name of what each row touches. The values are how far off it the
            machine stands, as the deflection of a probe reads it.
        touched : mapping of str to array, optional
            Where that is in the base frame: of a point or sphere (3,) or (4,) with the radius, of a
            line or plane a pose (6,), whose z it is along or normal to.
        artefact : {"point", "line", "plane", "sphere"}
            What it is.
        joint : str, optional
            Of kind "angle": the passive joint, a name of ``robot.passive_names``.
        approach : scalar, (n,) or (N, n) array, or "order", optional
            From where the actuators come; see `Measurements`.
        tension : scalar, (n,) or (N, n) array, optional
            Of what each actuator drives, N.

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
        n = getattr(self._machine, "n_actuators", actuators.shape[-1])
        if actuators.ndim != 2 or actuators.shape[1] != n or not actuators.size:
            raise ArgumentError(f"q must have shape (N, {n}) or ({n},); found {np.shape(q)}")
        if not isinstance(kind, Reading):
            kind = KINDS[word("kind", kind, KINDS)]
        if tension is not None:
            numbers("tension", tension)  # of what is driven it is known
        touching = kind.name == "touch"
        width = len(components(kind.name, artefact if touching else None))
        blank = Measurements(
            actuators,
            np.zeros((len(actuators), width) if width > 1 else len(actuators)),
            kind,
            target=target,
            actuator_units=getattr(self._machine, "actuator_units", None),
            attachment=attachment,
            approach=approach,
            tension=tension,
            other=other,
            run=run,
            touched=touches,
            artefact=artefact if touching else None,
            joint=joint,
            labels=labels,
        )
        exact = self._exact(blank, mounting, touched)
        if blank.run is not None:
            first = np.unique(blank.run, return_index=True, return_inverse=True)[1:]
            exact -= exact[first[0]][first[1].reshape(-1)]
        noise, sigma = self._drawn(blank, exact)
        values = corrected(kind.name, exact, noise).reshape(blank.values.shape)
        return dataclasses.replace(blank, values=values, sigma=sigma)

    def _exact(
        self, blank: Measurements, mounting: ArrayLike, touched: Mapping[str, ArrayLike] | None
    ) -> FloatArray:
        """What would be read without noise, (N, k)."""
        machine = self._machine
        if isinstance(machine, Robot):
            machine = blank.drive_state.of(machine)
        solved = _solved(machine, blank.actuators, "q")
        if blank.joint is not None:
            names = getattr(self._machine, "passive_names", ())
            if blank.joint not in names:
                known = did_you_mean(blank.joint, names)
                raise ArgumentError(f"joint: no passive joint is called {blank.joint!r}{known}")
            return np.array(solved.passive[:, [names.index(blank.joint)]])
        at = At(
            np.asarray(solved.pose),
            None if blank.other is None else _solved(machine, blank.other, "other").pose,
            along=np.full(len(blank), 2),
            artefact=blank.artefact,
        )
        return blank.instrument.predict(at, **self._arguments(blank, mounting, touched)).values

    def _arguments(
        self, blank: Measurements, mounting: ArrayLike, touched: Mapping[str, ArrayLike] | None
    ) -> dict[str, FloatArray]:
        """What the readings depend on beside the pose, as `predict` takes it."""
        truth = {"mounting": mounting, "touched": touched}
        return blank.instrument.simulated(blank, truth)

    def _drawn(self, blank: Measurements, exact: FloatArray) -> tuple[FloatArray, Any]:
        """Noise (N, k), and the sigma to state."""
        drawn = self._random.standard_normal(exact.shape)
        if isinstance(self.noise, Tracker):
            if blank.kind != "position":
                raise ArgumentError(f"kind: a tracker measures positions, found {blank.kind!r}")
            covariance = self.noise.covariance(exact)
            return (np.linalg.cholesky(covariance) @ drawn[:, :, None])[:, :, 0], self.noise
        deviations = {"rad": self.angle_noise}  # every other unit: the instrument's noise
        sigma = np.array([deviations.get(unit, self.noise) for unit in blank.units])
        return sigma * drawn, sigma if (sigma > 0).all() else None


def _solved(machine: Solvable, actuators: FloatArray, argument: str) -> Any:
    """What the machine's forward kinematics give, where they do of every row."""
    solved = machine.forward(actuators)
    failed = np.flatnonzero(~np.asarray(solved.ok)).tolist()
    if len(failed):
        raise ArgumentError(
            f"{argument}: {len(failed)} of {len(actuators)} rows have no pose on the true machine"
            f" (rows {first_rows(failed, 10)})"
        )
    return solved
