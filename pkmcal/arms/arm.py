"""`SerialArm`: an arm with its joint errors, and the files it comes from and goes to."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from pkmcal import screw
from pkmcal.arguments import instance, number
from pkmcal.arms import arm_file
from pkmcal.arms.denavit_hartenberg import (
    Convention,
    DHTable,
    Parallel,
    normals,
    screws_of,
    table_of,
)
from pkmcal.arms.inputs import motion
from pkmcal.arms.joint_laws import JointLaws, Term
from pkmcal.arms.joint_pulls import AtTool, JointPulls
from pkmcal.arms.serial_chain import SerialChain
from pkmcal.arrays import FloatArray, as_rows
from pkmcal.display import Table, fixed
from pkmcal.exceptions import ArgumentError, FileError
from pkmcal.files.reading import Input
from pkmcal.geometry.carried import Load
from pkmcal.geometry.elastic import require_compliance
from pkmcal.result import Result

_SAME = 1e-9  # mm, and mm per rad: by so much the arm of a source may differ


if TYPE_CHECKING:
    from matplotlib.axes import Axes


class SerialArm(SerialChain, Result):
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
    joint_names : sequence of str, optional
        What the joints are called, so that columns of measurements may be.
    source : (path, tip, base), optional
        The URDF file it was read from; `from_urdf` gives it.
    laws : JointLaws, optional
        What its joints add to their commands: sag, gears, coupled axes. Files and
        `identify(effects=…)` give them.
    follows : mapping of int to mapping of int to float, optional
        Joints without an actuator: ``{3: {2: 1.0}}`` is joint 3 that moves as far as joint 2, both
        counted from 1, in mm and rad; at zero it is where joint 2 is at zero. Calls then take the
        coordinates of the other joints alone.
    uncertainty : mapping of str to float, optional
        How wrong numbers may be that a calibration does not look for, as `identify` takes it.

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

    @classmethod
    def from_dh(
        cls,
        a: ArrayLike,
        alpha: ArrayLike,
        d: ArrayLike,
        theta: ArrayLike = 0.0,
        *,
        convention: Convention = "standard",
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
        axes, points, home = screws_of(a, alpha, d, theta, convention)
        if tool is not None:
            home = home @ motion("tool", tool)
        return cls(axes, points, home, kinds=kinds, name=name)

    @classmethod
    def from_urdf(
        cls, path: str | PathLike[str], tip: str | None = None, base: str | None = None
    ) -> SerialArm:
        """An arm from a URDF file: the chain of moving joints between two links.

        Metres become mm. Joints that follow others (mimic) have no coordinate of their own.

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
            No URDF file: cut short, with a document type or xacro, a joint without its links, an
            origin that is not three numbers. No such links, no moving joint between them, or one
            that an arm has not (floating, planar). A joint that follows (mimic) one that is not
            between them.
        """
        from pkmcal.arms import urdf  # brings a parser of XML

        return cls(**urdf.read(path, tip, base))

    def __reduce__(self) -> tuple[object, ...]:
        return partial(SerialArm, **self.arguments), ()

    def _parts(self) -> Iterator[str | Table]:
        yield f"{self.name}: {' '.join(self.kinds)}"
        heads = ["axis x", "y", "z", "point x [mm]", "y [mm]", "z [mm]"]
        rows = [
            [f"joint{i}", *(fixed(float(value), 3) for value in (*axis, *point))]
            for i, (axis, point) in enumerate(zip(self.axes, self.points, strict=True), 1)
        ]
        yield Table(["joint", *heads], rows, left=1)

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
        errors, links = self._linked(joint_errors)
        return self._like(_errors=errors, _links=links)

    def corrected(self) -> SerialArm:
        """Return the arm with its joint errors built into axes, points and home, none beside them.

        E₁…Eᵢ carries axis and point of joint i, and E₁…Eₙ the tool.
        """
        before = np.eye(4)
        axes, points = np.empty_like(self._axes), np.empty_like(self._points)
        for i, moved in enumerate(self.error_motions()):
            before = before @ moved
            axes[i] = before[:3, :3] @ self._axes[i]
            points[i] = before[:3, :3] @ self._points[i] + before[:3, 3]
        return SerialArm(
            axes,
            points,
            before @ self._home,
            kinds=self.kinds,
            name=self.name,
            joint_names=self.joint_names,
            laws=self.laws,
            follows=self.followers.table(),
            uncertainty=self.uncertainty.table(),
        )

    @property
    def rigid(self) -> SerialArm:
        """The arm whose joints are where they are commanded; itself where it is that."""
        return self if self.laws is None else self.with_laws(None)

    def with_laws(self, laws: JointLaws | None) -> SerialArm:
        """The arm with other laws of its joints, or without."""
        return self._like(_laws=laws)

    def with_terms(self, terms: Iterable[Term]) -> SerialArm:
        """The arm with these numbers among those of its joints, 0 where they are new."""
        return self.with_laws(self.joint_laws.with_terms(terms))

    @property
    def joint_laws(self) -> JointLaws:
        """Return the laws of the joints; without numbers where there are none."""
        return self.laws or JointLaws(JointPulls(self.axes, self.points, self.kinds))

    def approaching(self, approach: ArrayLike) -> SerialArm:
        """The arm with joints that come from below or above, which backlash depends on.

        Parameters
        ----------
        approach : array_like (n,) or (N, n)
            1 where a joint's reading had grown, -1 where it had fallen, 0 where that is not known:
            for all rows, or for each of those that are then computed.
        """
        rows, shape = as_rows("approach", approach, self.n_actuators)
        if not np.isin(rows, (-1, 0, 1)).all():
            raise ArgumentError("approach must be 1, -1 or 0 for each joint")
        if self.laws is None:
            return self
        if self.followers:
            rows = np.sign(self.followers.joints_at(rows))
        return self.with_laws(self.laws.approaching(rows[0] if shape == () else rows))

    def under(self, load: Load | None) -> SerialArm:
        """The arm with what its tool carries, which joints with a compliance follow.

        Parameters
        ----------
        load : Load or None
            One for all rows of the calls that follow, or one for each of as many rows: the centre
            of its mass in the frame of the tool, forces and moments in the axes of the base. None:
            nothing is carried.

        Examples
        --------
        >>> import pkmcal as pk
        >>> arm = pk.SerialArm([[0, 1, 0]], [[0, 0, 0]], [600, 0, 0, 0, 0, 0])
        >>> soft = arm.yielding({1: 1 / 50e6})  # 50 kN m/rad
        >>> soft.under(pk.Load(mass=10)).forward([0.0])[:3, 3].round(4).tolist()
        [599.9996, 0.0, -0.7061]
        """
        if self.laws is None:
            return self
        if load is None:
            return self.with_laws(self.laws.under(None))
        rows = load.rows(None)
        centre = rows[..., 1:4] @ self._home[:3, :3].T + self._home[:3, 3]
        tool = self._home[:3, 3]
        carried = AtTool(rows[..., :1], centre, tool, rows[..., 4:7], rows[..., 7:10])
        return self.with_laws(self.laws.under(carried))

    def yielding(self, compliance: Mapping[int, float]) -> SerialArm:
        """The arm with joints that yield to the weights of its links and to what it carries.

        Parameters
        ----------
        compliance : mapping of int to float
            rad/(N mm) by the joint, counted from 1: 1e-3 over a stiffness in N m/rad. Others stay.

        Returns
        -------
        SerialArm
            Masses and centres of the links are those of its file or URDF; without any they are 0,
            and joints yield to what the tool carries alone.

        Raises
        ------
        ValueError, TypeError
            A joint that it has not, an arm with slides, a compliance below 0, or a stiffness.
        """
        laws = self.weighed().joint_laws
        values = dict(laws.numbers)
        for joint, each in compliance.items():
            if not 1 <= instance("joint", joint, int) <= self.n_joints:
                raise ArgumentError(f"compliance: joints are 1 to {self.n_joints}; found {joint}")
            what = f"compliance of joint {joint}"
            values[Term(joint - 1, "compliance")] = number(what, each, least=0.0)
            require_compliance(what, each, "N m/rad", 1e-3)
        laws = laws.with_terms(values)
        return self.with_laws(laws.with_values(np.array([values[term] for term in laws.terms])))

    def weighed(self) -> SerialArm:
        """The arm with masses and centres of its links: its own, those of its URDF, or 0."""
        laws = self.joint_laws
        if laws.pulls.weighed:
            return self
        if self.source is None:
            masses, centres = np.zeros(self.n_joints), self.points
        else:
            from pkmcal.arms import urdf

            masses, centres = urdf.weights(*self.source)
        return self.with_laws(laws.weighing(masses, centres))

    def error_motions(self) -> FloatArray:
        """The motions E by its joint errors, in the base (eq. 10 and 18), (n, 4, 4)."""
        return screw.at_points(self._errors, self._points)

    def dh(self, convention: Convention = "standard", parallel: Parallel = "normal") -> DHTable:
        """Denavit–Hartenberg numbers of the arm, its joint errors built in.

        Any arm has them, between a base and a tool. Where neighbouring axes are nearly parallel,
        a and d are large, far-off numbers that cancel, and small errors change them much. Frames
        have their x on the side where the arm without joint errors has it.

        Parameters
        ----------
        convention : {"standard", "modified"}
            As in `from_dh`.
        parallel : {"normal", "hayati"}
            How axes are written that are nearly parallel: by their common normal, or as parallel
            ones with Hayati's parameter, a turn `beta` about y behind Tx(a) Rx(α).

        Returns
        -------
        DHTable
            .a .alpha .d .theta (n,), mm and rad, and .base and .tool (4, 4); .beta (n,) where it
            was asked for.

        Examples
        --------
        >>> import pkmcal as pk
        >>> arm = pk.SerialArm.from_dh(a=[300, 200], alpha=0, d=[0, 50])
        >>> arm.dh().a.tolist(), arm.dh().d.tolist()
        ([300.0, 200.0], [0.0, 50.0])
        """
        nominal = table_of(self._axes, self._points, self._home, "standard")
        real = self.corrected()
        sides = normals(nominal)
        return table_of(real.axes, real.points, real.home, convention, sides, parallel)

    def show(
        self, path: str | PathLike[str] | None = None, *, poses: ArrayLike | None = None
    ) -> Path:
        """Write the arm as a page that moves it, as `pkmcal.show` does.

        Parameters
        ----------
        path : str or path, optional
            Where to write; an existing file is replaced. By default a temporary file, which is
            opened in the browser.
        poses : array_like (N, n), optional
            Joint coordinates to be shown and gone to one by one, mm and rad.
        """
        from pkmcal.view.show import show

        return show(self, path, poses=poses)

    def plot(
        self,
        axes: Axes | None = None,
        theta: ArrayLike | None = None,
        *,
        color: str | None = None,
    ) -> Axes:
        """Draw the arm as lines with matplotlib, for papers.

        Parameters
        ----------
        axes : matplotlib.axes.Axes, optional
            Of three dimensions, or of two: then it is seen from above. By default new ones.
        theta : array_like (n,), optional
            Its joint coordinates, rad and mm; zero by default.
        color : str, optional
            Of all lines; by default the next of the axes.

        Returns
        -------
        matplotlib.axes.Axes
            The axes, in mm, with equal scales.
        """
        from pkmcal.view.plot import of_arm

        return of_arm(self, axes, theta, color)

    # files --------------------------------------------------------------------------------------

    def save(self, path: str | PathLike[str], comment: str = "") -> None:
        """Write the arm's file; `load` reads it back to the last bit.

        Parameters
        ----------
        path : str or path
            Where to write; an existing file is replaced, whole or not at all.
        comment : str, optional
            Lines for its head, each with its ``#``.
        """
        arm_file.write(self.arguments, path, comment)

    def save_urdf(
        self,
        path: str | PathLike[str],
        source: str | PathLike[str] | None = None,
        tip: str | None = None,
        *,
        base: str | None = None,
    ) -> None:
        """Write a URDF file again with the joint errors in the origins of its joints.

        All else in it stays: limits, meshes, inertias.

        Parameters
        ----------
        path : str or path
            Where to write; complete or untouched.
        source : str or path, optional
            The URDF file this arm was read from; by default the one it remembers, with its tip
            and base.
        tip, base : str, optional
            As in `from_urdf`.

        Raises
        ------
        ValueError
            The source holds another arm, or none is known; joints that have laws.
        """
        from pkmcal.arms import urdf

        if self.laws is not None:
            raise ArgumentError(
                f"robot: {self.name}: a URDF does not hold what joints add to their commands; save"
                " arm.rigid"
            )
        if source is None:
            if self.source is None:
                raise ArgumentError("source: this arm was not read from a URDF file; name one")
            source, tip, base = self.source
        read = Input(source)
        if not self._is_alike(SerialArm.from_urdf(read, tip, base)):
            raise FileError(f"source: {source} holds another arm than this one")
        urdf.write(path, read, self.error_motions(), tip, base)

    def limits(self) -> FloatArray:
        """Least and largest coordinate of each joint (n, 2), mm and rad, of its URDF file.

        Infinite where it states none, or where the arm is not from such a file. Joints that follow
        others have no row, and bound what they follow.
        """
        if self.source is None:
            return np.tile([-np.inf, np.inf], (self.n_actuators, 1))
        from pkmcal.arms import urdf

        return self.followers.limits(urdf.limits(*self.source))

    def _is_alike(self, other: SerialArm) -> bool:
        """Return whether another arm equals this one up to rounding, joint errors apart."""
        if self.kinds != other.kinds or self.followers.table() != other.followers.table():
            return False
        pairs = ((self.screws, other.screws), (self.points, other.points), (self.home, other.home))
        return all(np.allclose(one, two, rtol=0, atol=_SAME) for one, two in pairs)
