"""Inverse and forward kinematics of a machine with their derivatives, in the user's frames."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import instance
from pkmcal.arrays import FloatArray, as_numbers, as_rows
from pkmcal.core.library import MAPS, POSE
from pkmcal.core.machine import Machine
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.geometry.model import Limb, Model
from pkmcal.kinematics.complete import complete, matched_coordinates
from pkmcal.kinematics.forward import Forward
from pkmcal.kinematics.frames import Frames
from pkmcal.modes.find import AssemblyProblem

Match = bool | str | Sequence[str] | None


class Kinematics:
    """What a `Robot` computes at its present geometry: poses, actuators and their rates.

    Parameters
    ----------
    model : Model
        Read from a robot file.

    Attributes
    ----------
    model : Model
        What the robot file says.
    machine : pkmcal.core.machine.Machine
        The compiled machine. Its calls take `slots` and poses in the machine's own frames.
    slots : ndarray (limbs, SLOTS)
        The numbers of the geometry as the compiled machine takes them, mm and rad.
    frames : Frames
        From the user's frames to the machine's own (`inward`) and back (`outward`).
    own_home : ndarray (6,)
        The home pose in the machine's own frames, mm and rad.
    """

    def __init__(self, model: Model) -> None:
        self.model = instance("model", model, Model, " (see pkmcal.load)")
        self.slots = np.ascontiguousarray(model.geometry.slots)
        self.frames = Frames(model.base_frame, model.tool_frame)
        self.own_home = np.ascontiguousarray(model.home, dtype=np.float64)
        limbs = [_limb(limb) for limb in model.limbs]
        if sum(len(limb["weights"]) for limb in limbs) == len(self.coordinates):
            for limb in limbs:  # nothing to weigh: all closures hold
                limb["weights"] = [1.0] * len(limb["weights"])
        self.machine = Machine(model.map, limbs, self.length, self.slots, self.own_home)

    @property
    def home(self) -> FloatArray:
        """Home pose (6,), mm and rad: in the middle of the workspace."""
        home: FloatArray = self.frames.outward(self.own_home[None])[0].copy()
        return home

    @property
    def coordinates(self) -> tuple[str, ...]:
        """The m free coordinates of its pose, in the machine's own frame."""
        return MAPS[self.model.map]

    @property
    def n_actuators(self) -> int:
        """Number of actuator coordinates, n."""
        return self.machine.actuators

    @cached_property
    def length(self) -> float:
        """Characteristic length, mm: at this radius a rotation counts as its arc.

        The root mean square distance of the platform joints from their centre, or of the base
        points where the platform joints coincide.
        """
        for joints in (self.slots[:, 3:6], self.slots[:, 0:3]):
            spread = joints - joints.mean(axis=0)
            radius = float(np.sqrt((spread**2).sum(axis=1).mean()))
            if radius > 1e-9 * (1.0 + float(np.abs(self.slots[:, :6]).max())):
                return radius
        return 1.0

    def inverse(self, pose: ArrayLike, match: Match = None) -> FloatArray:
        """Actuator coordinates of a pose, limb by limb in closed form.

        Parameters
        ----------
        pose : array_like (..., 6)
            x y z in mm, α β γ in rad.
        match : bool or names of coordinates, optional
            By default the six numbers are taken as given. Where limbs constrain the pose, `match`
            names the coordinates to keep and the machine determines the others (`complete`);
            True takes those the robot file declares.

        Returns
        -------
        ndarray (..., n)
            mm or rad. A row that a limb cannot reach is NaN. Limbs that share an actuator are
            averaged.

        Raises
        ------
        ValueError, TypeError
            A wrong shape, no numbers, unknown coordinates to match.

        Notes
        -----
        Length limbs: eq. 3 of the 2TPR&2TPS paper, ‖p + R b - base‖.
        """
        rows, shape = self.own_rows(pose)
        if match is None:
            q = self.machine.inverse(self.slots, rows)
        else:
            q = self._completed(rows, match)[1]
        return q.reshape(*shape, self.n_actuators)

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
            Pose, status, iterations and residual of each row; conditioning when asked for. A row
            that cannot be solved is NaN and says why; it does not raise.

        Raises
        ------
        ValueError, TypeError
            A wrong shape, or no numbers.
        """
        rows, shape = as_rows("q", q, self.n_actuators)
        if guess is None:
            start = self.own_home
        else:
            start, guess_shape = self.own_rows(guess, "guess")
            if guess_shape == ():
                start = start[0]
            elif guess_shape != shape:
                try:
                    start = np.broadcast_to(start.reshape(*guess_shape, 6), (*shape, 6))
                except ValueError:
                    wanted, found = (*shape, 6), (*guess_shape, 6)
                    raise ArgumentError(
                        f"guess must be (6,) or broadcast to {wanted}, found {found}"
                    ) from None
                start = np.ascontiguousarray(start).reshape(-1, 6)
        own, status, iterations, residual = self.machine.forward(
            self.slots, rows, start, threads, shape
        )
        pose = self.frames.outward(own)
        return Forward(pose, status, iterations, residual, self, own, rows, start)

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
            `coordinates`. NaN where a limb does not reach, and at a type-1 singularity: a rod at
            right angles to its slider, or in line with its crank. The coordinates are those of the
            machine's own frames, without the base and tool frames that its file may state.
        """
        rows, shape = self.own_rows(pose)
        n, m = self.n_actuators, len(self.coordinates)
        return self.machine.jacobian(self.slots, rows).reshape(*shape, n, m)

    def forward_jacobian(self, pose: ArrayLike) -> FloatArray:
        """∂(free coordinates)/∂q.

        Parameters
        ----------
        pose : array_like (..., 6)
            x y z in mm, α β γ in rad.

        Returns
        -------
        ndarray (..., m, n)
            NaN at a type-2 singularity. The coordinates are those of the machine's own frames,
            without the base and tool frames that its file may state.
        """
        rows, shape = self.own_rows(pose)
        q = self.machine.inverse(self.slots, rows)
        by_q = self.machine.forward_jacobian(self.slots, rows, q)
        free = [POSE.index(name) for name in self.coordinates]
        return by_q[:, free].reshape(*shape, len(free), self.n_actuators)

    def rates(self, motion: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Velocity and acceleration of the actuators as the platform moves, limb by limb.

        The closed-form inverse differentiated twice by time: exact, with dJ/dt in it.

        Parameters
        ----------
        motion : array_like (..., 3, 4, 4)
            The platform's homogeneous matrix and its first and second derivative by time; mm, s.

        Returns
        -------
        velocity, acceleration : ndarray (..., n)
            mm or rad, and s. Limbs that share an actuator are averaged, as by `inverse`; NaN out
            of reach.

        Raises
        ------
        ValueError, TypeError
            A wrong shape, or no numbers.

        Examples
        --------
        Straight up at 10 mm/s, which six vertical sliders follow:

        >>> import pkmcal as pk
        >>> motion = np.zeros((3, 4, 4))
        >>> motion[0], motion[1, 2, 3] = np.eye(4), 10.0
        >>> velocity, acceleration = pk.load("rbt-6t03p").rates(motion)
        >>> bool(abs(velocity - 10).max() < 1e-9), bool(abs(acceleration).max() < 1e-9)
        (True, True)
        """
        given = as_numbers("motion", motion, "3, 4, 4")
        if given.shape[-3:] != (3, 4, 4):
            raise ArgumentError(f"motion must have shape (..., 3, 4, 4), found {given.shape}")
        rows, _ = as_rows("motion", given, 4)
        own = self.frames.motion_inward(rows.reshape(-1, 3, 4, 4))
        velocity, acceleration = self.machine.rates(self.slots, np.ascontiguousarray(own))
        shape = (*given.shape[:-3], self.n_actuators)
        return velocity.reshape(shape), acceleration.reshape(shape)

    # ----------------------------------------------------------------------------------------------

    def own_rows(self, pose: ArrayLike, name: str = "pose") -> tuple[FloatArray, tuple[int, ...]]:
        """Poses in the user's frames (..., 6) as rows (N, 6) in the machine's own, and the shape.

        What the compiled `machine` takes.
        """
        rows, shape = as_rows(name, pose, 6)
        return self.frames.inward(rows), shape

    def _completed(self, rows: FloatArray, match: Match) -> tuple[FloatArray, FloatArray]:
        if match is None:
            raise ArgumentError("match must be True or names of coordinates, found None")
        places = matched_coordinates(match, self.model.match, self.coordinates)
        return complete(self.machine, self.model.map, self.slots, rows, places)

    def assembly_problem(self, q: FloatArray) -> AssemblyProblem:
        """The closures at coordinates (n,) or (N, n), for certificates and searches for modes."""
        limbs = self.model.limbs
        return AssemblyProblem(
            self.machine,
            self.model.map,
            [KINDS[limb.kind].all_rows(limb.couple > 0) for limb in limbs],
            [limb.couple for limb in limbs],
            self.length,
            self.slots,
            q,
        )

    def closure_by_twist(self, own: FloatArray, q: FloatArray) -> FloatArray:
        """Closure rows by a scaled twist, (N, rows, m), at own poses (N, 6) and q (N, n)."""
        return self.machine.closure(self.slots, own, q).by_step


def _limb(limb: Limb) -> dict[str, Any]:
    kind = KINDS[limb.kind]
    rows = kind.all_rows(limb.couple > 0)
    return {
        "driver": kind.driver,
        "rows": rows,
        "actuator": limb.actuator,
        "branch": limb.branch,
        "frames": limb.frames,
        "lever": limb.couple,
        "weights": [1.0, *(limb.weights or [1.0] * len(rows))],
    }
