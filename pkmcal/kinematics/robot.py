"""`Robot`: a machine with its geometry, what an error in it does, its limits and its file."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from copy import copy
from dataclasses import fields, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from pkmcal import arguments
from pkmcal.arguments import instance, whole
from pkmcal.arrays import FloatArray, Unit, as_rows, wrapped
from pkmcal.core.library import COORDINATE_UNITS, POSE
from pkmcal.core.poses import rates_of_twists
from pkmcal.display import Table
from pkmcal.exceptions import ArgumentError
from pkmcal.files.atomic import write_whole
from pkmcal.files.toml_lines import Source
from pkmcal.geometry import box, robot_file
from pkmcal.geometry.carried import Load
from pkmcal.geometry.geometry import Geometry
from pkmcal.geometry.model import Model
from pkmcal.geometry.yielding import carrying, yielding
from pkmcal.kinematics import closed_form, joint_chains
from pkmcal.kinematics.complete import completed
from pkmcal.kinematics.kinematics import Kinematics, Match
from pkmcal.kinematics.limb_kinematics import LimbKinematics
from pkmcal.kinematics.limits import Feasibility
from pkmcal.kinematics.loaded import AnyCompiled
from pkmcal.modes.assemblies import Assemblies
from pkmcal.modes.find import assemblies, continue_path, find_modes, nearest_first, pose_distance
from pkmcal.result import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Robot(Kinematics, Result):
    """A parallel machine: immutable; `replace` gives a changed one.

    Made by `load`. Poses are x y z in mm and α β γ in rad with R = Rz(γ) Ry(β) Rx(α), platform to
    base, in the robot's base and tool frames where its file has them; actuator coordinates are mm
    or rad as the limbs say. All calls take any leading batch shape.

    Examples
    --------
    >>> import pkmcal as pk
    >>> robot = pk.load("2tpr2tps")
    >>> q = robot.inverse([0, 0, 400, 0, 0, 0])
    >>> robot.forward(q).pose.round(6) + 0.0
    array([  0.,   0., 400.,   0.,   0.,   0.])
    """

    # what it is -----------------------------------------------------------------------------------

    kind: Literal["parallel"] = "parallel"

    @property
    def name(self) -> str:
        """The robot's name."""
        return self.model.name

    @property
    def geometry(self) -> Geometry:
        """The named numbers: ``.names .values .units``, ``["base1.x"]``."""
        return self.model.geometry

    @property
    def actuator_units(self) -> tuple[str, ...]:
        """Unit of each actuator coordinate, "mm" or "rad"."""
        return self.model.actuator_units

    @property
    def commands(self) -> Mapping[str, Unit]:
        """Name and unit of what a user commands: the coordinates of the pose."""
        return COORDINATE_UNITS

    def as_commands(self, pose: FloatArray, actuators: FloatArray) -> FloatArray:
        """Return the poses: what a user commands to have these poses by these coordinates."""
        return pose

    def __copy__(self) -> Robot:
        """Copy the machine without what was computed of it: nothing is built anew."""
        other = object.__new__(type(self))
        other.__dict__.update((k, v) for k, v in vars(self).items() if k not in _COMPUTED)
        return other

    def __reduce__(self) -> tuple[type[Robot], tuple[Model]]:
        return Robot, (self.model,)

    def _parts(self) -> Iterator[str | Table]:
        yield f"{self.name}: {len(self.model.limbs)} limbs, {' '.join(self.coordinates)}"
        yield self.model.table()

    # poses the machine can take -------------------------------------------------------------------

    def complete(self, pose: ArrayLike, match: Match = True) -> FloatArray:
        """The pose the machine takes when some coordinates are to be kept.

        Parameters
        ----------
        pose : array_like (..., 6)
            x y z in mm, α β γ in rad; what is not matched is where the search starts; it
            starts once more from home where that leads nowhere.
        match : True or names of coordinates
            As many as the machine has degrees of freedom, in the user's frames; True takes those
            its file declares, or those that it moves (`moved`).

        Returns
        -------
        ndarray (..., 6)
            NaN where no such pose was found, nor with what is not matched begun at home.

        Examples
        --------
        >>> import pkmcal as pk
        >>> pose = pk.load("2tpr2tps").complete([0, 10, 400, 0.1, 0.2, 0])
        >>> bool(abs(pose[0] - 400 * np.tan(0.2)) < 1e-9)
        True
        """
        rows, shape = as_rows("pose", pose, 6)
        return self._completed(rows, match).pose.reshape(*shape, 6)

    def violation(self, pose: ArrayLike) -> FloatArray:
        """Return how far a pose is from one the machine can take.

        Parameters
        ----------
        pose : array_like (..., 6)
            x y z in mm, α β γ in rad.

        Returns
        -------
        ndarray (...)
            The largest closure error that is left with the limbs at their inverse, mm, or what its
            pose map does not move, an angle as its arc at the characteristic length. Near 0 where
            six numbers are free, or where they fit.
        """
        rows, shape = self.own_rows(pose)
        q = self.machine.inverse(self.slots, rows)
        closure = self.machine.closure(self.slots, rows, q)
        worst = np.abs(closure.residual).max(axis=1)
        fixed = [i for i, name in enumerate(POSE) if name not in self.coordinates]
        if fixed:
            with np.errstate(invalid="ignore"):  # rows that are no poses
                off = np.abs(rows - closure.pose)
                off[:, 3:] = self.length * np.abs(wrapped(off[:, 3:]))
            worst = np.maximum(worst, off[:, fixed].max(axis=1))
        return np.asarray(worst).reshape(shape)

    def feasible(self, pose: ArrayLike, actuators: ArrayLike | None = None) -> Feasibility:
        """Check the limits of each limb at poses.

        Parameters
        ----------
        pose : array_like (..., 6)
            x y z in mm, α β γ in rad.
        actuators : array_like (..., n), optional
            The coordinates that lead to these poses: strokes are compared with where they drive
            the limbs. By default with what the poses ask of the limbs on their branches, angles at
            the turn nearest to the middle of the stroke.

        Returns
        -------
        Feasibility
            ``.ok`` for each pose; reach, stroke and joint cones for each limb. What exceeds a
            limit by rounding, 1e-10 of the machine's size or rad, keeps it.
        """
        given, shape = as_rows("pose", pose, 6)
        own = self.frames.inward(given)
        q = None if actuators is None else self._batch(actuators, shape)
        limits = self.limb_kinematics.limits(self, own, q)
        found = replace(limits, workspace=box.in_box(self.model.workspace, given))
        arrays = {f.name: getattr(found, f.name) for f in fields(Feasibility) if f.name != "tail"}
        return replace(found, **{k: a.reshape((*shape, *a.shape[1:])) for k, a in arrays.items()})

    @property
    def limb_kinematics(self) -> LimbKinematics:
        """The kinematics of its limbs, as their kind answers for them."""
        return closed_form if self.model.chains is None else joint_chains

    def within(self, ends: box.Box) -> Robot:
        """The robot with a smaller workspace: coordinates with their ends, mm and rad.

        Parameters
        ----------
        ends : mapping of str to (float, float)
            Such as ``{"z": (0, 300)}``; where the robot states ends too, the nearer ones count.

        Raises
        ------
        ValueError
            No coordinate of a pose, or ends between which nothing is left.

        Examples
        --------
        >>> import pkmcal as pk
        >>> printer = pk.load("linear-delta").within({"z": (0, 300)})
        >>> poses = pk.sample_poses(printer, 20, share=1.0)
        >>> bool((poses[:, 2] >= 0).all() and (poses[:, 2] <= 300).all())
        True
        """
        return Robot(replace(self.model, workspace=box.both(self.model.workspace, ends)))

    def forward_all(self, q: ArrayLike, starts: int | None = None) -> Assemblies:
        """Every assembly mode at given actuator coordinates, with proof.

        Every complex solution of the closures is followed from a start system where all are known
        (parameter homotopy), each real one is certified by the theorem of Newton and Kantorovich.
        Machines without a start system, and doubts, are given random starts, which do not prove
        that no mode is missing. Those of chains of joints are; where it is known how many modes
        there can be, as many are all.

        Parameters
        ----------
        q : array_like (n,)
            Actuator coordinates, mm or rad.
        starts : int, optional
            Random starts of Newton's method. By default none where the paths prove that no mode is
            missing, otherwise 2000.

        Returns
        -------
        Assemblies
            ``.poses`` (k, 6), nearest to home first, ``.certified`` (k,), ``.complete``.

        Raises
        ------
        ValueError, TypeError
            A wrong shape, or no numbers.

        Examples
        --------
        >>> import pkmcal as pk
        >>> modes = pk.load("2tpr2tps").forward_all([450.0, 452.0, 400.0, 405.0])
        >>> len(modes), bool(modes.certified.all()), modes.complete
        (8, True, True)
        """
        rows, shape = as_rows("q", q, self.n_actuators)
        if shape != ():
            raise ArgumentError(f"q must have shape ({self.n_actuators},), found {np.shape(q)}")
        if starts is not None:
            whole("starts", starts, 0, note=" or None")
        problem = self.assembly_problem(rows[0])
        found = find_modes(problem, starts)
        order = nearest_first(found.poses, self.own_home[None], self.length)
        own = np.ascontiguousarray(found.poses[order])
        poses = self.frames.outward(own)

        def continued(pose: FloatArray, actuators: ArrayLike | None, steps: int) -> FloatArray:
            own = self.frames.inward(pose[None])
            if actuators is None:
                begin = self.short_way(rows[0], self.machine.inverse(self.slots, own)[0])[None]
            else:
                begin = as_rows("actuators", actuators, self.n_actuators)[0]
            part = np.arange(steps + 1)[:, None] / steps
            way = self.machine.bare(self.slots, begin + (rows - begin) * part)[2]
            end = continue_path(problem, own, way)
            outward: FloatArray = self.frames.outward(end)[0]
            return outward

        return assemblies(
            problem,
            found,
            order,
            poses=poses,
            distance=lambda pose: pose_distance(own, self.frames.inward(pose), self.length),
            feasible=lambda: self.feasible(poses, np.tile(rows, (len(poses), 1))).ok,
            continued=continued,
        )

    # errors of its geometry -----------------------------------------------------------------------

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
            NaN at a type-2 singularity, and where chains miss the pose by more than 1e-4 of the
            machine's size: `complete` gives one that it takes. With more closures than free
            coordinates it is that of the pose which misses them least.
        """
        given, own, q, shape = self._commanded(pose, actuators)
        columns = self.geometry.slot_index.astype(np.int32)
        if self.frames.trivial:  # without copies
            errors = self.machine.error_jacobian(self.slots, own, q, columns)
        else:  # rates of the machine's own angles may be infinite where the user's are not
            twists = self.machine.error_jacobian(self.slots, own, q, columns, twists=True)
            errors = rates_of_twists(given, self.frames.twists_outward(own, twists))
        errors = self._through_ties(errors)
        return errors.reshape(*shape, 6, len(self.geometry))

    def error_twists(self, pose: ArrayLike, actuators: ArrayLike | None = None) -> FloatArray:
        """`error_jacobian` with the motion as a twist, which is regular at every orientation.

        Parameters
        ----------
        pose, actuators : array_like
            As for `error_jacobian`.

        Returns
        -------
        ndarray (..., 6, p)
            The platform's turning, then the velocity of its origin, both in base axes, by each
            number: rad and mm per mm or rad. NaN at a type-2 singularity.

        Examples
        --------
        >>> import pkmcal as pk
        >>> robot = pk.load("hexapod")
        >>> upright = [0, 0, 850, 0, 0, 0]  # where α β γ turn about the axes
        >>> twists, rates = robot.error_twists(upright), robot.error_jacobian(upright)
        >>> bool(abs(twists[[3, 4, 5, 0, 1, 2]] - rates).max() < 1e-12)
        True
        """
        _, own, q, shape = self._commanded(pose, actuators)
        columns = self.geometry.slot_index.astype(np.int32)
        twists = self.machine.error_jacobian(self.slots, own, q, columns, twists=True)
        errors = self._through_ties(self.frames.twists_outward(own, twists))
        return errors.reshape(*shape, 6, len(self.geometry))

    def actuator_twists(self, pose: ArrayLike, actuators: ArrayLike) -> FloatArray:
        """Return the platform's twist by each actuator coordinate.

        Parameters
        ----------
        pose, actuators : array_like
            As for `error_jacobian`.

        Returns
        -------
        ndarray (..., 6, n)
            Twists as by `error_twists`, rad and mm per mm or rad.

        Examples
        --------
        >>> import pkmcal as pk
        >>> robot = pk.load("hexapod")
        >>> twists = robot.actuator_twists(robot.home, robot.inverse(robot.home))
        >>> bool(np.allclose(twists[5], twists[5, 0]))  # all legs lift it alike
        True
        """
        _, own, q, shape = self._commanded(pose, actuators)
        by_q = self.machine.forward_jacobian(self.slots, own, q, twists=True)
        return self.frames.twists_outward(own, by_q).reshape(*shape, 6, self.n_actuators)

    def commanded(self, places: ArrayLike) -> tuple[FloatArray, FloatArray, tuple[int, ...]]:
        """Pose, actuator coordinates and batch shape of poses (..., 6), completed if need be."""
        given, shape = as_rows("pose", places, 6)
        rows = completed(self, given)
        q = self.inverse(rows)
        return self.forward(q, guess=rows).pose, q, shape

    visited = commanded

    def _commanded(
        self, pose: ArrayLike, actuators: ArrayLike | None
    ) -> tuple[FloatArray, FloatArray, FloatArray, tuple[int, ...]]:
        """Poses as given and the machine's own, their actuators, and the batch's shape."""
        given, shape = as_rows("pose", pose, 6)
        own = self.frames.inward(given)
        if actuators is None:
            return given, own, self.machine.inverse(self.slots, own), shape
        return given, own, self._batch(actuators, shape), shape

    def _batch(self, actuators: ArrayLike, shape: tuple[int, ...]) -> FloatArray:
        """Coordinates as rows (N, n), which must be a batch of this shape."""
        q, q_shape = as_rows("actuators", actuators, self.n_actuators)
        if q_shape != shape:
            raise ArgumentError(f"actuators are a batch {q_shape}, poses a batch {shape}")
        return q

    def _through_ties(self, errors: FloatArray) -> FloatArray:
        """Append the columns of named parameters to those of the numbers, (N, 6, p)."""
        count = len(self.geometry) - errors.shape[2]
        if not count:
            return errors
        named = errors @ self.geometry.chain[:, -count:]
        return np.concatenate([errors, named], axis=-1)

    def show(
        self, path: str | PathLike[str] | None = None, *, poses: ArrayLike | None = None
    ) -> Path:
        """Write the machine as a page that moves it, as `pkmcal.show` does.

        Parameters
        ----------
        path : str or path, optional
            Where to write; an existing file is replaced. By default a temporary file, which is
            opened in the browser.
        poses : array_like (N, 6), optional
            To be shown and gone to one by one, mm and rad.
        """
        from pkmcal.view.show import show

        return show(self, path, poses=poses)

    def plot(
        self,
        axes: Axes | None = None,
        pose: ArrayLike | None = None,
        *,
        numbers: bool = True,
        color: str | None = None,
    ) -> Axes:
        """Draw the machine as lines with matplotlib, for papers.

        Parameters
        ----------
        axes : matplotlib.axes.Axes, optional
            Of three dimensions, or of two: then it is seen from above. By default new ones.
        pose : array_like (6,), optional
            Where it is drawn, mm and rad; home by default.
        numbers : bool
            Whether limbs have their numbers.
        color : str, optional
            Of all lines; by default the next of the axes.

        Returns
        -------
        matplotlib.axes.Axes
            The axes, in mm, with equal scales.

        Raises
        ------
        ValueError
            The machine does not get to the pose.

        Examples
        --------
        >>> import pkmcal as pk
        >>> from matplotlib.figure import Figure
        >>> axes = Figure().add_subplot(projection="3d")
        >>> pk.load("hexapod").plot(axes).get_xlabel()
        'x [mm]'
        """
        from pkmcal.view.plot import of_robot

        return of_robot(self, axes, pose, numbers, color)

    # changing and saving --------------------------------------------------------------------------

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
        return Robot(self.model.with_geometry(self.geometry.replace(changes)))

    def with_values(self, values: FloatArray) -> Robot:
        """`replace` for the steps of a search: three times as fast, for numbers near these.

        The order of elimination stays, and closures may miss by any length.

        Parameters
        ----------
        values : array (p,)
            All numbers of the geometry, mm and rad.

        Examples
        --------
        >>> import pkmcal as pk
        >>> robot = pk.load("hexapod")
        >>> step = robot.with_values(robot.geometry.values + 1e-3)
        >>> bool(step.forward(robot.inverse(robot.home)).ok)
        True
        """
        changed = copy(self)
        changed.machine = self._of_any_misfit
        changed.model = self.model.with_geometry(self.geometry.replace(values))
        changed.slots = np.ascontiguousarray(changed.model.geometry.slots)
        return changed

    @cached_property
    def rigid(self) -> Robot:
        """The machine without what yields and what pulls at it; itself where nothing yields."""
        return self if self.model.elastic is None else Robot(self.model.rigid)

    @property
    def yields(self) -> bool:
        """True if a number of the machine yields to weights and loads."""
        return self.model.elastic is not None

    def yielding(self, compliance: Mapping[str, float], *, per_length: bool = False) -> Robot:
        """The machine with numbers of its limbs that yield.

        Parameters
        ----------
        compliance : mapping of str to float
            By name or wildcard of numbers, mm/N and rad/(N mm), 0 or more. Numbers that yield
            already get the new compliance.
        per_length : bool
            Whether compliances, of legs and screws alone, also grow along the way of their drive,
            by ``compliance.offset1.per_length``, 0 as yet, from where they are at home.

        Returns
        -------
        Robot
            Masses, payload and gravity as before; without any, gravity points along -z.

        Raises
        ------
        ValueError, TypeError
            A name that matches no number of a limb, a ratio, which does not yield, a compliance
            below 0, or a stiffness in its place.

        Examples
        --------
        >>> import pkmcal as pk
        >>> robot = pk.load("hexapod").yielding({"offset*": 5e-5})
        >>> robot.geometry["compliance.offset1"]
        5e-05
        """
        ways = self.rigid.drives(self.rigid.home_actuators[None])[0] if per_length else None
        return Robot(yielding(self.model, compliance, ways))

    def carrying(self, load: Load) -> Robot:
        """The machine with another payload stated, which `replace` and `save` keep.

        Parameters
        ----------
        load : Load
            One for all rows.

        Raises
        ------
        ValueError, TypeError
            Nothing of the machine yields, so that no load moves it; a load of several rows; a
            stated payload that follows parameters.

        Examples
        --------
        >>> import pkmcal as pk
        >>> robot = pk.load("hexapod").yielding({"offset*": 5e-5})
        >>> robot.carrying(pk.Load(mass=5)).geometry["payload.mass"]
        5.0
        """
        self.under(load)  # refuses
        return Robot(carrying(self.model, load))

    def approaching(self, approach: ArrayLike) -> Robot:
        """The robot with actuators that come from a known direction, for laws with backlash.

        Parameters
        ----------
        approach : array_like (n,) or (..., n)
            Of each actuator +1 where its reading grew before it stopped, -1 where it fell, 0 where
            that is not known, which is half way between. A batch goes with calls of as many rows.

        Returns
        -------
        Robot
            What `replace` and `load` make of it knows no directions.

        Examples
        --------
        >>> import pkmcal as pk
        >>> robot = pk.load("hexapod")  # without backlash
        >>> bool(robot.approaching([1] * 6).forward(robot.inverse(robot.home)).ok)
        True
        """
        rows, shape = as_rows("approach", approach, self.n_actuators)
        if not np.isin(rows, (-1.0, 0.0, 1.0)).all():
            raise ArgumentError("approach must be 1, -1 or 0 for each actuator")
        return self._with_drives(self.machine.approaching, rows[0] if shape == () else rows)

    def tensioned(self, tension: ArrayLike) -> Robot:
        """The robot with cables, belts or screws under tension, for laws with `stretch`.

        Parameters
        ----------
        tension : array_like (n,) or (..., n)
            Of what each actuator drives, N, as load cells or `pkmcal.tensions` say; negative where
            it is pushed. A batch goes with calls of as many rows.

        Returns
        -------
        Robot
            What `replace` and `load` make of it knows no tensions.

        Raises
        ------
        ValueError, TypeError
            Another shape, or numbers that are not finite.

        Examples
        --------
        >>> import pkmcal as pk
        >>> robot = pk.load("hexapod")  # whose legs do not stretch
        >>> bool(robot.tensioned([50.0] * 6).forward(robot.inverse(robot.home)).ok)
        True
        """
        rows, shape = as_rows("tension", tension, self.n_actuators)
        if not np.isfinite(rows).all():
            raise ArgumentError("tension must be finite")
        return self._with_drives(self.machine.tensioned, rows[0] if shape == () else rows)

    def _with_drives(
        self, changed: Callable[[FloatArray], AnyCompiled], state: FloatArray
    ) -> Robot:
        """The robot with its drives, where they have laws, in another state."""
        if not self.model.driven:
            return self
        other = copy(self)
        other.machine = changed(state)
        return other

    @cached_property
    def _of_any_misfit(self) -> AnyCompiled:
        return self.machine.with_tolerance(np.inf)

    @property
    def closure_tolerance(self) -> float:
        """Largest miss of surplus closures, mm; beyond it no pose is stated."""
        return float(self.machine.struct.closure_tolerance)

    def closing(self, q: ArrayLike, guess: ArrayLike) -> Robot:
        """The robot with a `closure_tolerance` of at least twice what it misses at coordinates.

        Parameters
        ----------
        q : array_like (..., n)
            Actuator coordinates that it has been at.
        guess : array_like (6,) or (..., 6)
            Poses near those there.
        """
        if self.machine.rows <= self.machine.m:
            return self
        found = self.with_values(self.geometry.values).forward(q, guess)
        missed = float(np.nanmax(found.residual, initial=0.0))
        if 2.0 * missed <= self.closure_tolerance:
            return self
        return Robot(replace(self.model, closure_tolerance=2.0 * missed))

    def save(
        self,
        path: str | PathLike[str],
        comment: str = "",
        *,
        like: str | PathLike[str] | None = None,
        deviations: Mapping[str, float] | None = None,
    ) -> None:
        """Write the robot file; `load` reads it back to the last bit.

        Parameters
        ----------
        path : str or path
            Where to write; an existing file is replaced, whole or not at all.
        comment : str, optional
            Lines for its head, each with its ``#``.
        like : str or path, optional
            The file that the robot came from: its units, order, names and comments are kept, and
            only the values that changed are others. Numbers are then read back to 1e-13 of the
            machine's size, for its units are not mm and rad. A file of chains, or with stiffness,
            is written anew.
        deviations : mapping of str to float, optional
            With `like`: standard deviations by name, mm and rad, as comments.

        Raises
        ------
        ValueError
            `like` describes another robot; a drive law has no inverse over its stroke, so that
            the file could not be read.
        """
        for limb, why in self.model.doubts():
            raise ArgumentError(f"robot: limb {limb + 1} of {self.name}: its drive law: {why}")
        if like is None or not self.model.closed_form or self.model.elastic is not None:
            robot_file.write(self.model, path, comment)
            return
        from pkmcal.geometry.robot_file_kept import text_like

        content, place, _ = robot_file.located(like)
        source = Source(content, place)
        head = arguments.comment(comment)
        write_whole(path, text_like(source, self.model, deviations, head))


_COMPUTED = frozenset(
    name
    for each in Robot.__mro__
    for name, value in vars(each).items()
    if isinstance(value, cached_property)
)


def determines_others(robot: Robot) -> bool:
    """True if the limbs determine further coordinates that are not constant."""
    constant = robot.model.match is None and robot.model.map in ("translation", "planar", "xy")
    return len(robot.moved) < len(POSE) and not constant


def require_parallel(robot: object, name: str = "robot") -> None:
    """Refuse what is no parallel machine with a TypeError that names the argument."""
    instance(name, robot, Robot, ", a parallel machine")
