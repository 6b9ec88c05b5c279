"""Inverse and forward kinematics of a machine with their derivatives, in the user's frames."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pkmcal import modes
from pkmcal.arguments import instance
from pkmcal.complete import complete, matched_coordinates
from pkmcal.core import MAPS, POSE, FloatArray, as_numbers, as_rows
from pkmcal.core_machine import Machine
from pkmcal.forward import Forward
from pkmcal.frames import Frames
from pkmcal.limb_kinds import KINDS
from pkmcal.model import Limb, Model

Match = bool | str | Sequence[str] | None


class Kinematics:
    """What a `Robot` computes at its present geometry: poses, actuators and their rates.

    Parameters
    ----------
    model : Model
        Read from a robot file.
    """

    def __init__(self, model: Model) -> None:
        self.model = instance("model", model, Model, " (see pkmcal.load)")
        self._slots = np.ascontiguousarray(model.geometry.slots)
        self._frames = Frames(model.base_frame, model.tool_frame)
        self._own_home = np.ascontiguousarray(model.home, dtype=np.float64)
        limbs = [_limb(limb) for limb in model.limbs]
        if sum(len(limb["weights"]) for limb in limbs) == len(self.coordinates):
            for limb in limbs:  # nothing to weigh: all closures hold
                limb["weights"] = [1.0] * len(limb["weights"])
        self._machine = Machine(model.map, limbs, self.length, self._slots, self._own_home)

    @property
    def home(self) -> FloatArray:
        """Home pose (6,), mm and rad: in the middle of the workspace."""
        home: FloatArray = self._frames.outward(self._own_home[None])[0].copy()
        return home

    @property
    def coordinates(self) -> tuple[str, ...]:
        """The m free coordinates of its pose, in the machine's own frame."""
        return MAPS[self.model.map]

    @property
    def n_actuators(self) -> int:
        """Number of actuator coordinates, n."""
        return self._machine.actuators

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
        rows, shape = self._own_rows(pose)
        if match is None:
            q = self._machine.inverse(self._slots, rows)
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
            start = self._own_home
        else:
            start, guess_shape = self._own_rows(guess, "guess")
            if guess_shape == ():
                start = start[0]
            elif guess_shape != shape:
                try:
                    start = np.broadcast_to(start.reshape(*guess_shape, 6), (*shape, 6))
                except ValueError:
                    wanted, found = (*shape, 6), (*guess_shape, 6)
                    raise ValueError(
                        f"guess must be (6,) or broadcast to {wanted}, found {found}"
                    ) from None
                start = np.ascontiguousarray(start).reshape(-1, 6)
        own, status, iterations, residual = self._machine.forward(
            self._slots, rows, start, threads, shape
        )
        pose = self._frames.outward(own)
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
        rows, shape = self._own_rows(pose)
        n, m = self.n_actuators, len(self.coordinates)
        return self._machine.jacobian(self._slots, rows).reshape(*shape, n, m)

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
        rows, shape = self._own_rows(pose)
        q = self._machine.inverse(self._slots, rows)
        by_q = self._machine.forward_jacobian(self._slots, rows, q)
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
            raise ValueError(f"motion must have shape (..., 3, 4, 4), found {given.shape}")
        rows, _ = as_rows("motion", given, 4)
        own = self._frames.motion_inward(rows.reshape(-1, 3, 4, 4))
        velocity, acceleration = self._machine.rates(self._slots, np.ascontiguousarray(own))
        shape = (*given.shape[:-3], self.n_actuators)
        return velocity.reshape(shape), acceleration.reshape(shape)

    # ----------------------------------------------------------------------------------------------

    def _own_rows(self, pose: ArrayLike, name: str = "pose") -> tuple[FloatArray, tuple[int, ...]]:
        """Poses of the user as rows of the machine's own, and the batch's shape."""
        rows, shape = as_rows(name, pose, 6)
        return self._frames.inward(rows), shape

    def _completed(self, rows: FloatArray, match: Match) -> tuple[FloatArray, FloatArray]:
        if match is None:
            raise ValueError("match must be True or names of coordinates, found None")
        places = matched_coordinates(match, self.model.match, self.coordinates)
        return complete(self._machine, self.model.map, self._slots, rows, places)

    def _subject(self, q: FloatArray) -> modes.Subject:
        """What certificates and searches for modes need, at coordinates (n,) or (N, n)."""
        limbs = self.model.limbs
        return modes.Subject(
            self._machine,
            self.model.map,
            [KINDS[limb.kind].all_rows(limb.couple > 0) for limb in limbs],
            [limb.couple for limb in limbs],
            self.length,
            self._slots,
            q,
        )

    def _steps(self, own: FloatArray, q: FloatArray) -> FloatArray:
        """Closure rows by a scaled twist, (N, rows, m)."""
        return self._machine.closure(self._slots, own, q).by_step


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
