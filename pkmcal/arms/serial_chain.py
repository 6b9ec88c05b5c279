"""`SerialChain`: what an open chain of joints computes from its screws and joint errors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import instance
from pkmcal.arms.followers import Followers, Follows
from pkmcal.arms.inputs import (
    ArmArguments,
    Frame,
    JointKind,
    Source,
    axes_and_points,
    checked_errors,
    frame_number,
    joint_frames,
    kinds_of,
    motion,
    names_of,
)
from pkmcal.arms.inverse import ArmInverse, Part, damped_least_squares
from pkmcal.arms.joint_laws import JointLaws
from pkmcal.arrays import FloatArray, IntArray, Unit, as_rows
from pkmcal.core.screws import Arm, Links
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.stated_uncertainty import StatedUncertainty, Uncertain, stated_uncertainty

Chain = TypeVar("Chain", bound="SerialChain")


class SerialChain:
    """The computations of a `SerialArm`: tool frame, twists by joints and errors, inverse.

    Its parameters are those of `SerialArm`.

    Attributes
    ----------
    core : pkmcal.core.screws.Arm
        The arm as the core has it.
    """

    def __init__(
        self,
        axes: ArrayLike,
        points: ArrayLike,
        home: ArrayLike,
        *,
        kinds: str | Sequence[str] | None = None,
        name: str = "serial arm",
        joint_errors: ArrayLike | None = None,
        joint_names: Sequence[str] | None = None,
        source: Source | None = None,
        laws: JointLaws | None = None,
        follows: Follows | None = None,
        uncertainty: Uncertain = None,
    ) -> None:
        self._name = instance("name", name, str)
        self._axes, self._points = axes_and_points(axes, points)
        self._kinds = kinds_of(kinds, len(self._axes))
        self._joint_names = names_of(joint_names, len(self._axes))
        self._source = source
        self._laws = laws
        self._followers = Followers(follows, len(self._axes))
        self._uncertainty = stated_uncertainty(uncertainty)
        self._home = motion("home", home)
        prismatic = np.array([kind == "prismatic" for kind in self._kinds], dtype=np.int32)
        self.core = Arm(prismatic, joint_frames(self._axes), self._points, self._home)
        self._errors, self._links = self._linked(joint_errors)

    @property
    def name(self) -> str:
        """The arm's name."""
        return self._name

    @property
    def kinds(self) -> tuple[JointKind, ...]:
        """Kind of each joint, "revolute" or "prismatic"."""
        return self._kinds

    @property
    def joint_names(self) -> tuple[str, ...] | None:
        """Names of the joints, as in a URDF file and in logs of controllers."""
        return self._joint_names

    @property
    def source(self) -> Source | None:
        """The URDF file it was read from (path, tip, base), for `save_urdf`."""
        return self._source

    @property
    def laws(self) -> JointLaws | None:
        """Laws that joints add to their commands: sag, gears; None where there are none."""
        return self._laws

    @property
    def uncertainty(self) -> StatedUncertainty:
        """Stated uncertainty of numbers that a calibration does not look for."""
        return self._uncertainty

    @property
    def n_joints(self) -> int:
        """Number of joints, n."""
        return len(self.kinds)

    @property
    def n_actuators(self) -> int:
        """Number of joints that have an actuator, m: all but those that follow others."""
        return int(self._followers.driven.size)

    @property
    def followers(self) -> Followers:
        """The joints that follow others; it is false where there are none."""
        return self._followers

    @property
    def actuator_names(self) -> tuple[str, ...] | None:
        """Names of the joints that have an actuator, as in logs of controllers."""
        names = self._joint_names
        return None if names is None else tuple(names[i] for i in self._followers.driven)

    @property
    def axes(self) -> FloatArray:
        """Unit directions of the joints' axes at zero, (n, 3)."""
        axes: FloatArray = self._axes.copy()
        return axes

    @property
    def points(self) -> FloatArray:
        """The points the joints' errors act at, (n, 3), mm."""
        points: FloatArray = self._points.copy()
        return points

    @property
    def home(self) -> FloatArray:
        """The tool at zero, (4, 4), mm."""
        home: FloatArray = self._home.copy()
        return home

    @property
    def joint_errors(self) -> FloatArray:
        """Δx Δy Δz [mm], Δφ Δθ Δψ [rad] of each joint, (n, 6)."""
        errors: FloatArray = self._errors.copy()
        return errors

    @property
    def actuator_units(self) -> tuple[Unit, ...]:
        """Unit of each joint coordinate that is commanded, "rad" or "mm"."""
        kinds = [self.kinds[i] for i in self._followers.driven]
        return tuple("rad" if kind == "revolute" else "mm" for kind in kinds)

    @property
    def length(self) -> float:
        """Characteristic length, mm: at this radius a rotation counts as its arc.

        The root mean square distance of the joints' points from the tool at zero; 1 where that is
        0.
        """
        return self._distance or 1.0

    @property
    def without_lengths(self) -> bool:
        """True if all joints' points are the tool's at zero: no length says how large it is."""
        return self._distance == 0.0

    @property
    def screws(self) -> FloatArray:
        """Nominal unit screws (ω, v) at zero, (n, 6): (ω, r × ω), or (0, v) (eq. 1)."""
        none = self.core.links(np.zeros((self.n_joints, 6)))
        at_zero = self.core.jacobian(np.zeros((1, self.n_joints)), none, frame_number("space"))
        screws: FloatArray = at_zero[0].T.copy()
        return screws

    @property
    def arguments(self) -> ArmArguments:
        """Arguments of the arm: ``SerialArm(**arm.arguments)`` equals it."""
        return {
            "axes": self.axes,
            "points": self.points,
            "home": self.home,
            "kinds": self.kinds,
            "name": self.name,
            "joint_errors": self.joint_errors,
            "joint_names": self.joint_names,
            "source": self.source,
            "laws": self.laws,
            "follows": self._followers.table() or None,
            "uncertainty": self.uncertainty.table(),
        }

    # kinematics ---------------------------------------------------------------------------------

    def forward(
        self,
        theta: ArrayLike,
        joint_errors: ArrayLike | None = None,
        threads: int | None = None,
    ) -> FloatArray:
        """Compute the tool's frame (eq. 5; with errors eq. 19).

        Parameters
        ----------
        theta : array_like (..., n)
            Joint coordinates, rad and mm; of an arm with joints that follow others those of the
            other ones, (..., m).
        joint_errors : array_like (n, 6) or (..., n, 6), optional
            Δx Δy Δz [mm], Δφ Δθ Δψ [rad] of each joint, for all rows or of each row; in place of
            the arm's own.
        threads : int, optional
            As many as pay by default.

        Returns
        -------
        ndarray (..., 4, 4)
            From the tool to the base, mm. A row with a coordinate that is not finite, or beyond
            1e5 rad, is NaN.

        Raises
        ------
        ValueError, TypeError
            A wrong shape, no numbers, or errors that are not finite.
        """
        rows, shape, links = self._given(theta, joint_errors)
        return self.core.forward(self._moved(rows), links, threads).reshape(*shape, 4, 4)

    def jacobian(
        self, theta: ArrayLike, joint_errors: ArrayLike | None = None, frame: Frame = "space"
    ) -> FloatArray:
        """The tool's twist by each joint coordinate.

        Parameters
        ----------
        theta : array_like (..., n)
            Joint coordinates, rad and mm.
        joint_errors : array_like (n, 6) or (..., n, 6), optional
            As in `forward`.
        frame : {"space", "body", "tip"}
            Twists (ω, v) seen in the base, v that of the point at the base's origin; seen in the
            tool; or ω in base axes and v the velocity of the tool's origin.

        Returns
        -------
        ndarray (..., 6, n)
            ω first, rad and mm per rad or mm.

        Raises
        ------
        ValueError, TypeError
            A wrong shape, no numbers, or an unknown frame.
        """
        seen = frame_number(frame)
        rows, shape, links = self._given(theta, joint_errors)
        by_joints = self.core.jacobian(self._moved(rows), links, seen)
        if self._laws is not None:
            by_joints = by_joints @ self._laws.slope(rows)
        if self._followers:
            by_joints = by_joints @ self._followers.shares
        return by_joints.reshape(*shape, 6, self.n_actuators)

    def joint_jacobian(
        self, theta: ArrayLike, joint_errors: ArrayLike | None = None, frame: Frame = "space"
    ) -> FloatArray:
        """The tool's twist by each joint's own motion, also of joints that follow others.

        Parameters
        ----------
        theta : array_like (..., m)
            Joint coordinates as in `forward`.
        joint_errors : array_like (n, 6) or (..., n, 6), optional
            As in `forward`.
        frame : {"space", "body", "tip"}
            As in `jacobian`.

        Returns
        -------
        ndarray (..., 6, n)
            ω first, rad and mm per rad or mm.
        """
        seen = frame_number(frame)
        rows, shape, links = self._given(theta, joint_errors)
        return self.core.jacobian(self._moved(rows), links, seen).reshape(*shape, 6, self.n_joints)

    def joint_coordinates(self, theta: ArrayLike) -> FloatArray:
        """Return where all joints are commanded to, (..., n), also those that follow others.

        Parameters
        ----------
        theta : array_like (..., m)
            Coordinates of the joints that have an actuator, rad and mm.
        """
        rows, shape = as_rows("theta", theta, self.n_actuators)
        return self._followers.joints_at(rows).reshape(*shape, self.n_joints)

    def error_jacobian(
        self, theta: ArrayLike, joint_errors: ArrayLike | None = None, frame: Frame = "space"
    ) -> FloatArray:
        """The tool's twist by each joint error, the coordinates held.

        Parameters
        ----------
        theta : array_like (..., n)
            Joint coordinates, rad and mm.
        joint_errors : array_like (n, 6) or (..., n, 6), optional
            The errors at which the derivative is taken, as in `forward`.
        frame : {"space", "body", "tip"}
            As in `jacobian`.

        Returns
        -------
        ndarray (..., 6, 6 n)
            Columns Δx Δy Δz Δφ Δθ Δψ of joint 1, then of joint 2, ...

        Raises
        ------
        ValueError, TypeError
            A wrong shape, no numbers, or an unknown frame.
        """
        seen = frame_number(frame)
        rows, shape, links = self._given(theta, joint_errors)
        by_errors = self.core.error_jacobian(self._moved(rows), links, seen)
        return by_errors.reshape(*shape, 6, 6 * self.n_joints)

    def law_jacobian(self, theta: ArrayLike, frame: Frame = "space") -> FloatArray:
        """The tool's twist by each number of the joints' laws, the coordinates held.

        Parameters
        ----------
        theta : array_like (..., n)
            Joint coordinates, rad and mm.
        frame : {"space", "body", "tip"}
            As in `jacobian`.

        Returns
        -------
        ndarray (..., 6, k)
            In the order of ``arm.laws.names``; k = 0 without laws.
        """
        seen = frame_number(frame)
        rows, shape, links = self._given(theta, None)
        if self._laws is None:
            return np.empty((*shape, 6, 0))
        by_joints = self.core.jacobian(self._moved(rows), links, seen)
        of_terms = by_joints[:, :, [term.joint for term in self._laws.terms]]
        by_numbers: FloatArray = of_terms * self._laws.basis(rows)[:, None]
        return by_numbers.reshape(*shape, 6, -1)

    def inverse(
        self,
        target: ArrayLike,
        guess: ArrayLike | None = None,
        joint_errors: ArrayLike | None = None,
        *,
        parts: Part = "pose",
    ) -> ArmInverse:
        """Joint coordinates that bring the tool to a target, by damped least squares.

        Parameters
        ----------
        target : array_like (..., 4, 4)
            Where the tool shall be, mm.
        guess : array_like (n,) or (..., n), optional
            Where to start, which decides between several solutions; 0 by default.
        joint_errors : array_like (n, 6) or (..., n, 6), optional
            As in `forward`: coordinates that undo these errors.
        parts : {"pose", "position"}
            What shall be met: position and orientation, or the position alone.

        Returns
        -------
        ArmInverse
            Coordinates, status and residual of each row. A row that was not reached is NaN
            and does not raise.

        Raises
        ------
        ValueError, TypeError
            A wrong shape, no numbers, or no rigid motions.
        """
        return damped_least_squares(self, target, guess, joint_errors, parts)

    def of_rows(self, rows: IntArray) -> SerialChain:
        """The chain with joints in the state that they have in some rows of a call."""
        laws = None if self._laws is None else self._laws.of_rows(rows)
        if laws is self._laws:
            return self
        return self._like(_laws=laws)

    def require_loads_of(self, rows: int) -> None:
        """Refuse rows that are not as many as the loads at the tool, where these are several."""
        carried = None if self._laws is None else self._laws.pulls.carried
        if carried is not None and carried.weight.ndim > 1 and len(carried.weight) != rows:
            raise ArgumentError(f"load is of {len(carried.weight)} rows, but {rows} were asked for")

    # --------------------------------------------------------------------------------------------

    @property
    def _distance(self) -> float:
        """Root mean square distance of the joints' points from the tool at zero, mm."""
        reach = self._points - self._home[:3, 3]
        return float(np.hypot.reduce(reach, axis=None) / np.sqrt(self.n_joints))

    def _linked(self, joint_errors: ArrayLike | None) -> tuple[FloatArray, Links]:
        """Return joint errors as they are kept, and the links that they make."""
        errors = np.zeros((self.n_joints, 6))
        if joint_errors is not None:
            errors += checked_errors(joint_errors, self.n_joints, ())
        links = self.core.links(errors)
        if not np.isfinite(links.numbers).all():
            raise ArgumentError("points, home or joint_errors are too large to be computed with")
        return errors, links

    def _like(self: Chain, **changed: Any) -> Chain:
        """Copy the chain but for some attributes: all else is checked already."""
        found = object.__new__(type(self))
        vars(found).update(vars(self), **changed)
        return found

    def _moved(self, rows: FloatArray) -> FloatArray:
        """Return the true coordinates of all joints at these commands of theirs."""
        return rows if self._laws is None else self._laws.moved(rows)

    def _given(
        self, theta: ArrayLike, joint_errors: ArrayLike | None
    ) -> tuple[FloatArray, tuple[int, ...], Links]:
        rows, shape = as_rows("theta", theta, self.n_actuators)
        rows = self._followers.joints_at(rows)
        self.require_loads_of(len(rows))
        if joint_errors is None:
            return rows, shape, self._links
        errors = checked_errors(joint_errors, self.n_joints, shape)
        return rows, shape, self.core.links(errors)
