"""Inverse and forward kinematics of a machine with their derivatives, in the user's frames."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arguments import instance
from pkmcal.arrays import BoolArray, FloatArray, as_numbers, as_rows, mm_per_unit
from pkmcal.core.chains import AnyMachine, ChainMachine
from pkmcal.core.core_machine import written
from pkmcal.core.driven import DrivenMachine
from pkmcal.core.library import MAPS, POSE
from pkmcal.core.machine import Machine
from pkmcal.core.pulleys import PulleyMachine
from pkmcal.exceptions import ArgumentError
from pkmcal.geometry.carried import Load
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.geometry.limbs import CHAIN
from pkmcal.geometry.model import Model
from pkmcal.kinematics.complete import (
    Completed,
    complete,
    in_working_mode,
    matched_coordinates,
)
from pkmcal.kinematics.forward import Forward
from pkmcal.kinematics.frames import Frames
from pkmcal.kinematics.limits import kept, margin_of
from pkmcal.kinematics.loaded import LoadedMachine
from pkmcal.kinematics.machines import machine_of
from pkmcal.kinematics.reused import reused_forward, reused_rows
from pkmcal.modes.find import AssemblyProblem
from pkmcal.screw import to_pose

K = TypeVar("K", bound="Kinematics")
Match = bool | str | Sequence[str] | None

_NONE = 1e-6  # of the largest: a singular value that is none
_FOLLOWS = 0.3  # of what follows the free coordinates most: a coordinate that determines a pose


class Kinematics:
    """The kinematics of a `Robot` at its present geometry: poses, actuators and their rates.

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
        self.machine = machine_of(model, self.slots, self.length)
        self.own_home = self.on_map(np.array(model.home, dtype=np.float64)[None])[0].copy()
        for kept_array in (self.slots, self.own_home):
            kept_array.setflags(write=False)

    @property
    def limb_machine(self) -> Machine | DrivenMachine | LoadedMachine:
        """The compiled machine of limbs in closed form.

        Raises
        ------
        ValueError
            The limbs are chains of joints.
        """
        if isinstance(self.machine, ChainMachine) or not self.model.closed_form:
            raise ArgumentError(f"robot: {self.model.name} has limbs that are chains of joints")
        return self.machine

    @property
    def cable_machine(self) -> Machine | DrivenMachine:
        """The compiled machine of limbs in closed form, of which cables do not yield."""
        machine = self.limb_machine
        assert not isinstance(machine, LoadedMachine)
        return machine

    @property
    def home(self) -> FloatArray:
        """Home pose (6,), mm and rad: in the middle of the workspace."""
        home: FloatArray = self.frames.outward(self.own_home[None])[0].copy()
        return home

    @property
    def home_actuators(self) -> FloatArray:
        """Actuator coordinates (n,) at home; NaN where a limb does not reach it.

        The inverse of home, or, where chains are singular there and it finds nothing, what the file
        says that the actuators read.
        """
        q = self.machine.inverse(self.slots, self.own_home[None])
        stated = self.model.mechanism.read_at_home
        if stated is not None and not np.isfinite(q).all():
            q = self.machine.at_drives(self.slots, stated[None])
        return np.asarray(q[0])

    @property
    def coordinates(self) -> tuple[str, ...]:
        """The m free coordinates of its pose, in the machine's own frame."""
        return MAPS[self.model.map]

    @cached_property
    def moved(self) -> tuple[str, ...]:
        """The coordinates that determine a pose, in the user's frames.

        Those that the robot file declares to match, or else the free ones. Where base and tool
        frames turn a machine so that these do not determine its pose (a planar machine that stands
        upright moves along x and z), others take the place of those that hardly follow. Where
        limbs leave fewer ways to move, as many that follow the actuators at home.
        """
        names = tuple(self.model.match or self.coordinates)
        held = self.n_actuators < len(names)
        if self.model.match or (not held and (self.frames.trivial or len(names) == len(POSE))):
            return names
        own = self.own_home[None]
        q = self.machine.inverse(self.slots, own)
        scale = np.where(np.arange(len(POSE)) < 3, 1.0, self.length)  # angles as arcs
        if held:
            rates = self.machine.forward_jacobian(self.slots, own, q)
            columns = mm_per_unit(self.model.actuator_units, self.length)
        else:
            rates = self.machine.closure(self.slots, own, q).pose_by_free
            columns = scale[[POSE.index(name) for name in names]]
        rates = self.frames.rates_outward(own, self.home[None], rates)[0]
        rates *= scale[:, None] / columns
        if not np.isfinite(rates).all():
            return names
        sizes = np.linalg.svd(rates, compute_uv=False)
        freedom = int((sizes > _NONE * sizes[0]).sum()) if held else len(names)
        order = [*names, *(name for name in POSE if name not in names)]
        found: list[str] = []
        for _ in range(freedom):
            left = np.linalg.norm(rates, axis=1)
            name = next(n for n in order if left[POSE.index(n)] >= _FOLLOWS * left.max())
            found.append(name)
            along = rates[POSE.index(name)] / left[POSE.index(name)]
            rates -= np.outer(rates @ along, along)
        return tuple(sorted(found, key=POSE.index))

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
        return self.model.mechanism.characteristic_length(self.slots)

    def inverse(
        self,
        pose: ArrayLike,
        match: Match = None,
        *,
        near: ArrayLike | None = None,
        out: FloatArray | None = None,
        load: Load | None = None,
    ) -> FloatArray:
        """Actuator coordinates of a pose, limb by limb in closed form.

        Limb by limb means: a machine of fewer than six degrees of freedom gets coordinates for a
        pose that it cannot take, and then goes elsewhere. `violation` says what its closures miss
        there; with `match` the pose is completed first to one that it takes.

        Parameters
        ----------
        pose : array_like (..., 6)
            x y z in mm, α β γ in rad.
        match : bool or names of coordinates, optional
            By default the six numbers are taken as given. Where limbs constrain the pose, `match`
            names the coordinates to keep, in the user's frames, and the machine determines the
            others (`complete`); True takes those the robot file declares.
        near : array_like (n,) or (..., n), optional
            Coordinates: an actuator that turns is given at the turn nearest to them. By default
            it is the turn nearest to the middle of its stroke, or, where the file states none, to
            the home pose.
        out : ndarray (..., n), optional
            float64, contiguous: written to and returned, in place of a new array. A result of
            `forward` refers to its coordinates: ask it for conditioning and certificate before.
        load : Load, optional
            What a machine that yields carries in place of the payload that its file states.

        Returns
        -------
        ndarray (..., n)
            mm or rad. A row that a limb cannot reach, or without a pose that keeps what is matched,
            is NaN. Limbs that share an actuator are averaged, angles on their circle.

        Raises
        ------
        ValueError, TypeError
            A wrong shape, no numbers, unknown coordinates to match, `out` that does not fit.

        Notes
        -----
        Length limbs: eq. 3 of the 2TPR&2TPS paper, ‖p + R b - base‖.
        """
        if load is not None:
            return self.under(load).inverse(pose, match, near=near, out=out)
        rows, shape = as_rows("pose", pose, 6)
        about = None if near is None else self._near(near, shape)
        into = None
        if out is not None:
            into = reused_rows(out, (*shape, self.n_actuators), rows, about)
        if match is None:
            q = self.machine.inverse(self.slots, self.frames.inward(rows), about, into)
        else:
            q = written(self._completed(rows, match, about).q, into)
        q = q if into is not None else np.ascontiguousarray(q)  # rows may be handed to C
        return q.reshape(*shape, self.n_actuators)

    def under(self: K, load: Load) -> K:
        """The machine with what it carries in place of the payload that its file states.

        Parameters
        ----------
        load : Load
            One for all rows, or a batch, which goes with calls of as many rows.

        Returns
        -------
        Robot
            What `replace` and `load` make of it knows no such load.

        Raises
        ------
        ValueError, TypeError
            The machine does not yield, so that no load moves it; or no load.

        Examples
        --------
        >>> import pkmcal as pk
        >>> robot = pk.load("hexapod").yielding({"offset*": 1e-4})
        >>> carrying = robot.under(pk.Load(mass=100))
        >>> sag = carrying.forward(robot.rigid.inverse(robot.home)).pose - robot.home
        >>> sag[:3].round(4) + 0.0
        array([ 0.    ,  0.    , -0.0175])
        """
        instance("load", load, Load)
        if not isinstance(self.machine, LoadedMachine):
            raise ArgumentError(
                f"load: nothing of {self.model.name} yields: state stiffness or [compliance] in its"
                " file, or take robot.yielding({'offset*': 5e-5})"
            )
        other = copy(self)
        other.machine = self.machine.carrying(load.rows(None))
        return other

    @property
    def turns(self) -> FloatArray:
        """Way of each actuator in a whole turn, (n,): rad, infinite where it is no angle.

        A coordinate and the same with whole turns added are one position of the machine.
        """
        return self.machine.turns(self.slots)

    def nearest_turns(self, q: ArrayLike, near: ArrayLike | None = None) -> FloatArray:
        """Actuator coordinates with whole turns added, so that they are near others.

        The difference of two positions is ``robot.nearest_turns(a, near=b) - b``.

        Parameters
        ----------
        q : array_like (..., n)
            mm or rad.
        near : array_like (n,) or (..., n), optional
            As for `inverse`.

        Returns
        -------
        ndarray (..., n)
            Lengths as they are.

        Examples
        --------
        >>> import pkmcal as pk
        >>> robot = pk.load("rotary-delta")
        >>> np.degrees(robot.nearest_turns(np.radians([-179, 0, 0]), near=np.radians([179, 0, 0])))
        array([181.,   0.,   0.])
        """
        rows, shape = as_rows("q", q, self.n_actuators)
        about = None if near is None else self._near(near, shape)
        found = self.machine.nearest_turns(self.slots, rows, about)
        return found.reshape(*shape, self.n_actuators)

    def _near(self, near: ArrayLike, shape: tuple[int, ...]) -> FloatArray:
        """Coordinates (n,), or (N, n) for N rows of a batch of this shape."""
        rows, near_shape = as_rows("near", near, self.n_actuators)
        return rows[0] if near_shape == () else _for_each("near", rows, near_shape, shape)

    def forward(
        self,
        q: ArrayLike,
        guess: ArrayLike | None = None,
        threads: int | None = None,
        out: Forward | None = None,
        *,
        load: Load | None = None,
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
        out : Forward, optional
            An earlier result of as many rows. Its arrays are written to, those of what is returned
            are the same; what it said is lost. A result refers to `q` and `guess`, for what is
            computed when asked for.
        load : Load, optional
            What a machine that yields carries in place of the payload that its file states.

        Returns
        -------
        Forward
            Pose, status, iterations and residual of each row; conditioning when asked for. A row
            that cannot be solved is NaN and says why; it does not raise.

        Raises
        ------
        ValueError, TypeError
            A wrong shape, no numbers, or `out` that does not fit.

        Examples
        --------
        Batch after batch in the same memory:

        >>> import pkmcal as pk
        >>> robot = pk.load("linear-delta")
        >>> batches = robot.inverse(pk.sample_poses(robot, 30, seed=1)).reshape(3, 10, 3)
        >>> found = None
        >>> for q in batches:
        ...     found = robot.forward(q, out=found)
        >>> found.pose.shape
        (10, 6)
        """
        if load is not None:
            return self.under(load).forward(q, guess, threads, out)
        rows, shape = as_rows("q", q, self.n_actuators)
        if guess is None:
            start = self.own_home
        else:
            start, guess_shape = self.own_rows(guess, "guess")
            start = start[0] if guess_shape == () else _for_each("guess", start, guess_shape, shape)
        into = None
        if out is not None:
            into = reused_forward(out, shape, not self.frames.trivial, rows, start)
        own, status, iterations, residual = self.machine.forward(
            self.slots, rows, start, threads, shape, into
        )
        pose = self.frames.outward(own)
        if out is not None and not self.frames.trivial:
            pose = written(pose, out.pose)
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

    def rates(
        self, motion: ArrayLike, *, near: ArrayLike | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Velocity and acceleration of the actuators as the platform moves, limb by limb.

        The closed-form inverse differentiated twice by time: exact, with dJ/dt in it.

        Parameters
        ----------
        motion : array_like (..., 3, 4, 4)
            The platform's homogeneous matrix and its first and second derivative by time; mm, s.
        near : array_like (n,) or (..., n), optional
            Which turn of an angle is meant, as for `inverse`: a drive law has a slope at each.

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
        shape = (*given.shape[:-3], self.n_actuators)
        about = None if near is None else self._near(near, shape[:-1])
        own = np.ascontiguousarray(self.frames.motion_inward(rows.reshape(-1, 3, 4, 4)))
        q = self.machine.inverse(self.slots, to_pose(own[:, 0]), about)
        velocity, acceleration = self.machine.rates(self.slots, own, q)
        return velocity.reshape(shape), acceleration.reshape(shape)

    # ----------------------------------------------------------------------------------------------

    def own_rows(self, pose: ArrayLike, name: str = "pose") -> tuple[FloatArray, tuple[int, ...]]:
        """Poses in the user's frames (..., 6) as rows (N, 6) in the machine's own, and the shape.

        What the compiled `machine` takes.
        """
        rows, shape = as_rows(name, pose, 6)
        return self.frames.inward(rows), shape

    def _completed(
        self, rows: FloatArray, match: Match, near: FloatArray | None = None
    ) -> Completed:
        if match is None:
            raise ArgumentError("match must be True or names of coordinates, found None")
        places = matched_coordinates(match, self.moved)
        parts = self.machine, self.model.map, self.slots, self.frames
        found = complete(*parts, rows, places, near)
        # what is not matched may have started on the other side of a singularity
        lost = np.flatnonzero(np.isnan(found.q).any(axis=1) & np.isfinite(rows).all(axis=1))
        if lost.size:
            start = np.tile(self.home, (len(lost), 1))
            start[:, places] = rows[lost][:, places]
            about = near if near is None or near.ndim == 1 else near[lost]
            parts = self.machine.of_rows(lost), *parts[1:]
            for each, again in zip(found, complete(*parts, start, places, about), strict=True):
                each[lost] = again
        return found

    def assembly_problem(self, q: FloatArray) -> AssemblyProblem:
        """The closures at coordinates (n,) or (N, n), for certificates and searches for modes."""
        if isinstance(self.machine, LoadedMachine):
            raise ArgumentError(
                f"robot: {self.model.name} yields, and modes and certificates are those of a rigid"
                " machine: ask its `rigid`"
            )
        limbs = self.model.limbs
        machine, slots, at = self.machine.bare(self.slots, np.atleast_2d(q))
        return AssemblyProblem(
            machine,
            self.model.map,
            [
                () if limb.kind == CHAIN else KINDS[limb.kind].all_rows(limb.couple > 0)
                for limb in limbs
            ],
            [limb.couple for limb in limbs],
            self.length,
            slots,
            at if q.ndim == 2 else at[0],
        )

    @property
    def passive_names(self) -> tuple[str, ...]:
        """Passive joints, in the order of `Forward.passive`: of chains, and swivels of pulleys."""
        return self.model.mechanism.passive_names

    def passive_joints(self, own: FloatArray, q: FloatArray) -> FloatArray:
        """Return passive joints' ways from home at own poses (N, 6), (N, passive).

        Each chain closed for itself, in the posture that is reached from home. Swivels of pulleys
        turn from the direction `zero` of their limb.
        """
        machine, slots, at = self.bare_at(own, q)
        if isinstance(machine, PulleyMachine):
            return machine.swivels(slots, np.ascontiguousarray(own))[0]
        if not isinstance(machine, ChainMachine):
            raise ArgumentError(f"{self.model.name}: its limbs are no chains of joints")
        return machine.frames(slots, np.ascontiguousarray(own), at)[0]

    def bare_at(self, own: FloatArray, q: FloatArray) -> tuple[AnyMachine, FloatArray, FloatArray]:
        """The machine without drive laws and load, its geometry and coordinates at own poses."""
        machine, slots = self.machine, self.slots
        if isinstance(machine, LoadedMachine):
            slots, machine = machine.under_load(slots, np.ascontiguousarray(own), q), machine.inner
        return machine.bare(slots, q)

    def closure_by_twist(self, own: FloatArray, q: FloatArray | None = None) -> FloatArray:
        """Closure rows by a scaled twist, (N, rows, m), at own poses (N, 6) and q (N, n).

        By default q is the inverse of the poses as the pose map has them.
        """
        if q is None:
            q = self.machine.inverse(self.slots, self.on_map(own))
        return self.machine.closure(self.slots, own, q).by_step

    def in_working_mode(self, own: FloatArray, q: FloatArray) -> BoolArray:
        """Return whether limbs are on the branches of the file at own poses (N, 6) and q (N, n).

        Chains, which the inverse has in the posture that is reached from home, count as such.
        """
        if not self.model.closed_form:
            return np.ones(len(q), dtype=bool)
        return in_working_mode(self.machine, self.slots, own, q)

    def on_map(self, own: FloatArray) -> FloatArray:
        """Own poses (N, 6) as the pose map has them: what it does not move is not looked at."""
        if self.model.map == "2tpr2tps":  # has x follow z and β
            q = np.zeros((len(own), self.n_actuators))
            return np.asarray(self.machine.closure(self.slots, own, q).pose)
        found: FloatArray = own.copy()
        found[:, [i for i, name in enumerate(POSE) if name not in self.coordinates]] = 0.0
        return found

    def drives(self, q: FloatArray) -> FloatArray:
        """q̃ of each limb (N, limbs) at actuator coordinates (N, n).

        Of a chain that of its first actuator, 0 where it has none.
        """
        found = self.machine.drives(self.slots, q)
        each = np.hstack([found, np.zeros((len(q), 1))])
        return np.asarray(each[:, list(self.model.mechanism.first_drives)])

    def short_way(self, start: FloatArray, end: FloatArray) -> FloatArray:
        """Coordinates (n,) of `end` at the turn nearest to `start`, unless a stroke forbids it."""
        near = self.nearest_turns(end, near=start)
        allowed = self._in_strokes(near) | ~self._in_strokes(end)
        return np.where(allowed, near, end)

    def _in_strokes(self, q: FloatArray) -> BoolArray:
        """Mark actuators (n,) that keep the strokes of all their limbs at coordinates (n,)."""
        inside = np.ones(self.n_actuators, dtype=bool)
        drives = self.machine.drives(self.slots, q[None])[0]
        for each, drive in zip(self.model.mechanism.stated_drives, drives, strict=True):
            margin = margin_of(each.stroke, drive)
            inside[each.actuator] &= bool(kept(margin, each.unit, self.machine.struct.size))
        return inside


def _for_each(
    name: str, rows: FloatArray, given: tuple[int, ...], shape: tuple[int, ...]
) -> FloatArray:
    """Rows of a batch `given` as (N, width), one for each row of a batch of this shape."""
    if given == shape:
        return rows
    width = rows.shape[1]
    try:
        each = np.broadcast_to(rows.reshape(*given, width), (*shape, width))
    except ValueError:
        wanted, found = (*shape, width), (*given, width)
        raise ArgumentError(
            f"{name} must be ({width},) or broadcast to {wanted}, found {found}"
        ) from None
    return np.ascontiguousarray(each).reshape(-1, width)
