"""`Robot`: a machine with its geometry, its inverse and forward kinematics, their derivatives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pkmcal import robotfile
from pkmcal.core import MAPS, POSE, STATUS, FloatArray, IntArray, Machine, as_rows
from pkmcal.geometry import BoolArray, Geometry
from pkmcal.limb_kinds import KINDS
from pkmcal.model import Limb, Model


@dataclass(frozen=True, eq=False)
class Forward:
    """Forward kinematics of a batch; every array has the batch's leading shape.

    Attributes
    ----------
    pose : ndarray (..., 6)
        x y z in mm, α β γ in rad; NaN where `status` is not 0.
    status : ndarray of int (...)
        0 ok, 1 not converged, 2 singular, 3 infeasible, 4 invalid input.
    iterations : ndarray of int (...)
        Newton steps taken.
    residual : ndarray (...)
        Largest closure error, mm; NaN where `status` is not 0.
    """

    pose: FloatArray
    status: IntArray
    iterations: IntArray
    residual: FloatArray

    @property
    def ok(self) -> BoolArray:
        """Which rows were solved, (...)."""
        return np.equal(self.status, 0)

    def failures(self) -> str:
        """What failed and where, in one line; empty where nothing did."""
        status = np.atleast_1d(self.status).ravel()
        parts = []
        for code, words in STATUS.items():
            rows = np.flatnonzero(status == code)
            if code and rows.size:
                shown = ", ".join(map(str, rows[:5])) + (", …" if rows.size > 5 else "")
                parts.append(f"{rows.size} of {status.size} rows {words} (rows {shown})")
        return "; ".join(parts)

    def __str__(self) -> str:
        pose = self.pose.reshape(-1, 6)
        lines = ["       x mm        y mm        z mm     α deg     β deg     γ deg  status"]
        shown = min(len(pose), 20)
        for p, code in zip(pose[:shown], np.atleast_1d(self.status).ravel(), strict=False):
            mm = "".join(f"{v:12.4f}" for v in p[:3])
            deg = "".join(f"{v:10.4f}" for v in np.degrees(p[3:]))
            lines.append(f"{mm}{deg}  {STATUS[int(code)]}")
        if len(pose) > shown:
            lines.append(f"... {len(pose) - shown} more rows")
        return "\n".join(lines)


class Robot:
    """A parallel machine: immutable; `replace` gives a changed one.

    Made by `load`. Poses are x y z in mm and α β γ in rad with R = Rz(γ) Ry(β) Rx(α), platform to
    base; actuator coordinates are mm or rad as the limbs say. All calls take any leading batch
    shape.

    Examples
    --------
    >>> import pkmcal as pk
    >>> robot = pk.load("2tpr2tps")
    >>> q = robot.inverse([0, 0, 400, 0, 0, 0])
    >>> robot.forward(q).pose.round(6) + 0.0
    array([  0.,   0., 400.,   0.,   0.,   0.])
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self._slots = np.ascontiguousarray(model.geometry.slots)
        self._home = np.ascontiguousarray(model.home, dtype=np.float64)
        limbs = [_limb(limb) for limb in model.limbs]
        self._machine = Machine(model.map, limbs, self.length, self._slots, self._home)

    # what it is ---------------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """The robot's name."""
        return self.model.name

    @property
    def geometry(self) -> Geometry:
        """The named numbers: ``.names .values .units``, ``["base1.x"]``."""
        return self.model.geometry

    @property
    def home(self) -> FloatArray:
        """Home pose (6,), mm and rad: in the middle of the workspace."""
        home: FloatArray = self._home.copy()
        return home

    @property
    def coordinates(self) -> tuple[str, ...]:
        """The m free coordinates of its pose."""
        return MAPS[self.model.map]

    @property
    def n_actuators(self) -> int:
        """Number of actuator coordinates, n."""
        return self._machine.actuators

    @property
    def actuator_units(self) -> tuple[str, ...]:
        """Unit of each actuator coordinate, "mm" or "rad"."""
        return self.model.actuator_units

    @cached_property
    def length(self) -> float:
        """Characteristic length, mm: at this radius a rotation counts as its arc.

        The root mean square distance of the platform joints from their centre, or of the base
        points where the platform joints coincide.
        """
        for joints in (self._slots[:, 3:6], self._slots[:, 0:3]):
            spread = joints - joints.mean(axis=0)
            radius = float(np.sqrt((spread**2).sum(axis=1).mean()))
            if radius > 1e-9 * (1.0 + float(np.abs(self._slots[:, :6]).max())):
                return radius
        return 1.0

    def __repr__(self) -> str:
        return f"<Robot {self.name}: {len(self.model.limbs)} limbs, {' '.join(self.coordinates)}>"

    # kinematics ---------------------------------------------------------------------------------

    def inverse(self, pose: ArrayLike) -> FloatArray:
        """Actuator coordinates of a pose, limb by limb in closed form.

        Parameters
        ----------
        pose : array_like (..., 6)
            x y z in mm, α β γ in rad; the six numbers are taken as given.

        Returns
        -------
        ndarray (..., n)
            mm or rad. A row that a limb cannot reach is NaN. Limbs that share an actuator are
            averaged.

        Raises
        ------
        ValueError, TypeError
            A wrong shape, or no numbers.

        Notes
        -----
        Length limbs: eq. 3 of the 2TPR&2TPS paper, ‖p + R b - base‖.
        """
        rows, shape = as_rows("pose", pose, 6)
        return self._machine.inverse(self._slots, rows).reshape(*shape, self.n_actuators)

    def forward(
        self, q: ArrayLike, guess: ArrayLike | None = None, threads: int | None = None
    ) -> Forward:
        """Pose at given actuator coordinates, by Newton's method on the closures (eq. 13).

        Parameters
        ----------
        q : array_like (..., n)
            Actuator coordinates, mm or rad.
        guess : array_like (6,) or (..., 6), optional
            Where to start; the home pose by default. Which assembly mode is found depends on it.
        threads : int, optional
            As many as pay by default.

        Returns
        -------
        Forward
            Pose, status, iterations and residual of each row. A row that cannot be solved is NaN
            and says why; it does not raise.

        Raises
        ------
        ValueError, TypeError
            A wrong shape, or no numbers.
        """
        rows, shape = as_rows("q", q, self.n_actuators)
        if guess is None:
            start = self._home
        else:
            start, guess_shape = as_rows("guess", guess, 6)
            if guess_shape == ():
                start = start[0]
            elif guess_shape != shape:
                start = np.broadcast_to(start.reshape(*guess_shape, 6), (*shape, 6))
                start = np.ascontiguousarray(start).reshape(-1, 6)
        result = self._machine.forward(self._slots, rows, start, threads)
        pose, status, iterations, residual = result
        return Forward(
            pose.reshape(*shape, 6),
            status.reshape(shape),
            iterations.reshape(shape),
            residual.reshape(shape),
        )

    def jacobian(self, pose: ArrayLike) -> FloatArray:
        """∂q/∂(free coordinates), limb by limb (eq. 12 for the 2TPR&2TPS).

        Parameters
        ----------
        pose : array_like (..., 6)
            On the machine's pose map: only the free coordinates are read.

        Returns
        -------
        ndarray (..., n, m)
            mm or rad of the actuator per mm or rad of the coordinate, in the order of
            `coordinates`.
        """
        rows, shape = as_rows("pose", pose, 6)
        return self._machine.jacobian(self._slots, rows).reshape(*shape, self.n_actuators, -1)

    def forward_jacobian(self, pose: ArrayLike) -> FloatArray:
        """∂(free coordinates)/∂q.

        Parameters
        ----------
        pose : array_like (..., 6)
            x y z in mm, α β γ in rad.

        Returns
        -------
        ndarray (..., m, n)
            NaN at a type-2 singularity.
        """
        rows, shape = as_rows("pose", pose, 6)
        q = self._machine.inverse(self._slots, rows)
        by_q = self._machine.forward_jacobian(self._slots, rows, q)
        free = [POSE.index(name) for name in self.coordinates]
        return by_q[:, free].reshape(*shape, len(free), self.n_actuators)

    def error_jacobian(self, pose: ArrayLike, actuators: ArrayLike | None = None) -> FloatArray:
        """∂pose/∂geometry with the actuators held: what a small error of each number does.

        Parameters
        ----------
        pose : array_like (..., 6)
            x y z in mm, α β γ in rad.
        actuators : array_like (..., n), optional
            The coordinates that lead to these poses; the inverse of the pose by default.

        Returns
        -------
        ndarray (..., 6, p)
            In the order of ``geometry.names``. The column of a tied number says what that number
            alone would do; the column of a parameter what it does through all its ties.
            NaN at a type-2 singularity.
        """
        rows, shape = as_rows("pose", pose, 6)
        if actuators is None:
            q = self._machine.inverse(self._slots, rows)
        else:
            q, q_shape = as_rows("actuators", actuators, self.n_actuators)
            if q_shape != shape:
                raise ValueError(f"actuators are a batch {q_shape}, poses a batch {shape}")
        geometry = self.geometry
        columns = geometry.slot_index.astype(np.int32)
        limb_part = self._machine.error_jacobian(self._slots, rows, q, columns)
        count = len(geometry) - len(columns)
        if count:
            named = limb_part @ geometry.chain[:, -count:]
            limb_part = np.concatenate([limb_part, named], axis=-1)
        return limb_part.reshape(*shape, 6, len(geometry))

    # changing and saving ------------------------------------------------------------------------

    def replace(self, changes: Mapping[str, float] | FloatArray) -> Robot:
        """A robot with some numbers of its geometry changed.

        Parameters
        ----------
        changes : mapping of str to float, or array (p,)
            mm and rad; a tied number cannot be replaced.

        Raises
        ------
        ValueError
            An unknown or tied name, a value that is not finite, a wrong shape.
        """
        return Robot(replace(self.model, geometry=self.geometry.replace(changes)))

    def save(self, path: str | PathLike[str]) -> None:
        """Write the robot file; `load` reads it back to the last bit."""
        robotfile.write(self.model, path)


def _limb(limb: Limb) -> dict[str, Any]:
    kind = KINDS[limb.kind]
    rows = kind.all_rows(limb.couple > 0)
    return {
        "driver": kind.driver,
        "rows": rows,
        "actuator": limb.actuator,
        "branch": limb.branch,
        "frame": limb.frame,
        "platform_frame": limb.platform_frame,
        "lever": limb.couple,
        "weights": [1.0, *(limb.weights or [1.0] * len(rows))],
    }


def load(robot: str | PathLike[str]) -> Robot:
    """A built-in machine by name, or a robot file by path.

    Parameters
    ----------
    robot : str or path
        A name of `machines`, or a path to a robot TOML.

    Raises
    ------
    ValueError
        No such machine or file, or a file with a mistake: the message says where.

    Examples
    --------
    >>> import pkmcal as pk
    >>> pk.load("hexapod").n_actuators
    6
    """
    return Robot(robotfile.read(robot))


def machines() -> tuple[str, ...]:
    """Names of the built-in machines."""
    return robotfile.builtin_names()
