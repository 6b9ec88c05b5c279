"""`SerialArm`: an open chain of revolute and prismatic joints, by its screws and joint errors."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike

import numpy as np
from numpy.typing import ArrayLike

from pkmcal import screw
from pkmcal.arguments import instance
from pkmcal.arms import inputs as checked
from pkmcal.arms.inverse import ArmInverse, damped_least_squares
from pkmcal.arrays import FloatArray, as_rows
from pkmcal.core.screws import Arm, Links
from pkmcal.exceptions import ArgumentError

ERRORS = ("dx", "dy", "dz", "dphi", "dtheta", "dpsi")


class SerialArm:
    """A serial arm: immutable; `replace` gives one with other joint errors.

    The product of exponentials T = E₁ e^[θ₁S₁] … Eₙ e^[θₙSₙ] T₀ (eq. 5, with errors eq. 19 of the
    paper on joint structure errors, DOI 10.3969/j.issn.1673-9833.2020.05.005). A joint's error
    Δx Δy Δz [mm], Δφ Δθ Δψ [rad] is E = Trans(Δx, Δy, Δz) Rz(Δψ) Ry(Δθ) Rx(Δφ), at the joint's
    point, in axes parallel to the base's at zero, before the joint's own motion.

    Parameters
    ----------
    axes : array_like (n, 3)
        Directions of the joints' axes at zero, in the base; of any length but 0.
    points : array_like (n, 3)
        A point on each axis, mm: there the joint's errors act. For a prismatic joint any point.
    home : array_like (4, 4) or (6,)
        The tool at zero: a motion, or a pose x y z α β γ in mm and rad.
    kinds : str or sequence of str, optional
        "revolute" (the default) or "prismatic", one for all or one for each joint.
    name : str
        For messages and files.
    joint_errors : array_like (n, 6), optional
        Its errors Δx Δy Δz Δφ Δθ Δψ, mm and rad, wherever a call gives no others; 0 by default.

    Raises
    ------
    ValueError, TypeError
        A shape that does not fit, an axis that is 0, a home that is no rigid motion.

    Examples
    --------
    >>> import numpy as np
    >>> import pkmcal as pk
    >>> home = [0, 600, 520, 0, 0, 0]
    >>> axes, points = [[0, 0, 1], [1, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, 0, 520], [0, 350, 520]]
    >>> arm = pk.SerialArm(axes, points, home)
    >>> (arm.forward([np.pi / 2, 0, 0])[:3, 3].round(9) + 0.0).tolist()
    [-600.0, 0.0, 520.0]
    """

    def __init__(
        self,
        axes: ArrayLike,
        points: ArrayLike,
        home: ArrayLike,
        kinds: str | Sequence[str] | None = None,
        name: str = "serial arm",
        joint_errors: ArrayLike | None = None,
    ) -> None:
        self._name = instance("name", name, str)
        self._axes, self._points = checked.axes_and_points(axes, points)
        self._kinds = checked.kinds_of(kinds, len(self._axes))
        self._home = checked.motion("home", home)
        prismatic = np.array([kind == "prismatic" for kind in self._kinds], dtype=np.int32)
        self._arm = Arm(prismatic, checked.joint_frames(self._axes), self._points, self._home)
        self._errors = np.zeros((self.n_joints, 6))
        if joint_errors is not None:
            self._errors += checked.joint_errors(joint_errors, self.n_joints, ())
        self._links = self._arm.links(self._errors)
        if not np.isfinite(self._links.numbers).all():
            raise ArgumentError("points, home or joint_errors are too large to be computed with")

    @classmethod
    def from_dh(
        cls,
        a: ArrayLike,
        alpha: ArrayLike,
        d: ArrayLike,
        theta: ArrayLike = 0.0,
        convention: str = "standard",
        kinds: str | Sequence[str] | None = None,
        tool: ArrayLike | None = None,
        name: str = "serial arm",
    ) -> SerialArm:
        """An arm from its Denavit–Hartenberg numbers.

        Parameters
        ----------
        a, alpha, d, theta : array_like (n,) or scalar
            mm and rad; of the variable, `theta` or for a prismatic joint `d`, the offset.
        convention : {"standard", "modified"}
            Rz(θ) Tz(d) Tx(a) Rx(α) from frame i-1 to frame i, or Rx(α) Tx(a) Rz(θ) Tz(d).
        kinds : str or sequence of str, optional
            As for `SerialArm`.
        tool : array_like (4, 4) or (6,), optional
            In the last frame.
        name : str
            For messages and files.

        Raises
        ------
        ValueError, TypeError
            Numbers that do not fit together, or an unknown convention.

        Examples
        --------
        >>> import pkmcal as pk
        >>> arm = pk.SerialArm.from_dh(a=[300, 200], alpha=0, d=0)
        >>> arm.forward([0, 0])[:3, 3].tolist()
        [500.0, 0.0, 0.0]
        """
        from pkmcal.arms.denavit_hartenberg import screws_of

        axes, points, home = screws_of(a, alpha, d, theta, convention)
        if tool is not None:
            home = home @ checked.motion("tool", tool)
        return cls(axes, points, home, kinds, name)

    @classmethod
    def from_urdf(
        cls, path: str | PathLike[str], tip: str | None = None, base: str | None = None
    ) -> SerialArm:
        """An arm from a URDF file: the chain of moving joints between two links.

        Needs the extra ``pkmcal[urdf]``. Metres become mm.

        Parameters
        ----------
        path : str or path
            A URDF file (what xacro makes, not its source).
        tip : str, optional
            The tool's link; needed where the file has several ends.
        base : str, optional
            The base's link; by default the root.

        Raises
        ------
        ValueError
            No such links, no moving joint between them, or one that an arm has not (floating,
            planar, mimic).
        """
        from pkmcal.arms import urdf

        return urdf.read(path, tip, base)

    # what it is ---------------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """The arm's name."""
        return self._name

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kind of each joint, "revolute" or "prismatic"."""
        return self._kinds

    @property
    def n_joints(self) -> int:
        """Number of joints, n."""
        return len(self.kinds)

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
    def actuator_units(self) -> tuple[str, ...]:
        """Unit of each joint coordinate, "rad" or "mm"."""
        return tuple("rad" if kind == "revolute" else "mm" for kind in self.kinds)

    @property
    def length(self) -> float:
        """Characteristic length, mm: at this radius a rotation counts as its arc.

        The root mean square distance of the joints' points from the tool at zero.
        """
        reach = self._points - self._home[:3, 3]
        return float(np.hypot.reduce(reach, axis=None) / np.sqrt(self.n_joints)) or 1.0

    @property
    def screws(self) -> FloatArray:
        """Nominal unit screws (ω, v) at zero, (n, 6): (ω, r × ω), or (0, v) (eq. 1)."""
        none = np.zeros((self.n_joints, 6))
        screws: FloatArray = self.jacobian(np.zeros(self.n_joints), none).T.copy()
        return screws

    def __reduce__(self) -> tuple[type[SerialArm], tuple[object, ...]]:
        given = (self._axes, self._points, self._home, self.kinds, self.name, self._errors)
        return SerialArm, given

    def __repr__(self) -> str:
        return f"<SerialArm {self.name}: {' '.join(self.kinds)}>"

    # kinematics ---------------------------------------------------------------------------------

    def forward(
        self,
        theta: ArrayLike,
        joint_errors: ArrayLike | None = None,
        threads: int | None = None,
    ) -> FloatArray:
        """Where the tool is (eq. 5; with errors eq. 19).

        Parameters
        ----------
        theta : array_like (..., n)
            Joint coordinates, rad and mm.
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
        return self._arm.forward(rows, links, threads).reshape(*shape, 4, 4)

    def jacobian(
        self, theta: ArrayLike, joint_errors: ArrayLike | None = None, frame: str = "space"
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
        number = checked.frame_number(frame)
        rows, shape, links = self._given(theta, joint_errors)
        return self._arm.jacobian(rows, links, number).reshape(*shape, 6, self.n_joints)

    def error_jacobian(
        self, theta: ArrayLike, joint_errors: ArrayLike | None = None, frame: str = "space"
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
        number = checked.frame_number(frame)
        rows, shape, links = self._given(theta, joint_errors)
        return self._arm.error_jacobian(rows, links, number).reshape(*shape, 6, 6 * self.n_joints)

    def inverse(
        self,
        target: ArrayLike,
        guess: ArrayLike | None = None,
        joint_errors: ArrayLike | None = None,
        parts: str = "pose",
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
            Coordinates, status and what is left of each row. A row that was not reached is NaN
            and does not raise.

        Raises
        ------
        ValueError, TypeError
            A wrong shape, no numbers, or no rigid motions.
        """
        return damped_least_squares(self, target, guess, joint_errors, parts)

    # errors -------------------------------------------------------------------------------------

    def replace(self, joint_errors: ArrayLike) -> SerialArm:
        """The arm with these joint errors in place of its own.

        Parameters
        ----------
        joint_errors : array_like (n, 6)
            Δx Δy Δz [mm], Δφ Δθ Δψ [rad] of each joint.

        Raises
        ------
        ValueError, TypeError
            A wrong shape, no numbers, or errors that are not finite.
        """
        return SerialArm(self._axes, self._points, self._home, self.kinds, self.name, joint_errors)

    def corrected(self) -> SerialArm:
        """The same arm without joint errors: they are built into its axes, points and home.

        E₁…Eᵢ carries axis and point of joint i, and E₁…Eₙ the tool.
        """
        before = np.eye(4)
        axes, points = np.empty_like(self._axes), np.empty_like(self._points)
        for i, moved in enumerate(self.error_motions()):
            before = before @ moved
            axes[i] = before[:3, :3] @ self._axes[i]
            points[i] = before[:3, :3] @ self._points[i] + before[:3, 3]
        return SerialArm(axes, points, before @ self._home, self.kinds, self.name)

    def error_motions(self) -> FloatArray:
        """The motions E by its joint errors, in the base (eq. 10 and 18), (n, 4, 4)."""
        return screw.at_points(self._errors, self._points)

    def save(self, path: str | PathLike[str], comment: str = "") -> None:
        """Write the arm's file, `comment` at its head; `load` reads it back to the last bit."""
        from pkmcal.arms import arm_file

        arm_file.write(self, path, comment)

    def save_urdf(
        self,
        path: str | PathLike[str],
        source: str | PathLike[str],
        tip: str | None = None,
        base: str | None = None,
    ) -> None:
        """Write a URDF file again with the joint errors in the origins of its joints.

        All else in it stays: limits, meshes, inertias.

        Parameters
        ----------
        path : str or path
            Where to write; complete or untouched.
        source : str or path
            The URDF file this arm was read from.
        tip, base : str, optional
            As in `from_urdf`.

        Raises
        ------
        ValueError
            The source holds another arm.
        """
        from pkmcal.arms import urdf

        urdf.write(self, path, source, tip, base)

    def _given(
        self, theta: ArrayLike, joint_errors: ArrayLike | None
    ) -> tuple[FloatArray, tuple[int, ...], Links]:
        rows, shape = as_rows("theta", theta, self.n_joints)
        if joint_errors is None:
            return rows, shape, self._links
        errors = checked.joint_errors(joint_errors, self.n_joints, shape)
        return rows, shape, self._arm.links(errors)
