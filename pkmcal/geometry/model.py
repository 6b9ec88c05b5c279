"""A robot file as data: limbs, pose map, home, geometry. No kinematics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray, Unit
from pkmcal.core.laws import Drive, Laws
from pkmcal.core.library import SLOTS
from pkmcal.core.pulleys import BENT
from pkmcal.display import Table, fixed
from pkmcal.geometry.box import Box
from pkmcal.geometry.chains import Chains
from pkmcal.geometry.controller import Controller
from pkmcal.geometry.elastic import Elastic, is_elastic
from pkmcal.geometry.geometry import Geometry
from pkmcal.geometry.laws import Law, drive
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.geometry.load import CableLoad
from pkmcal.geometry.stated_uncertainty import NOTHING, StatedUncertainty

CHAIN = "chain"  # the kind of a limb that is a chain of joints: see `pkmcal.geometry.chains`


@dataclass(frozen=True, eq=False)
class Cone:
    """Limit of a joint: the limb stays within `angle` of `axis`.

    The direction that is limited runs from the base joint (the carriage, the crank's end) to the
    platform joint, seen in base axes for a base cone and in platform axes for a platform cone.

    Attributes
    ----------
    axis : ndarray (3,)
        Unit vector.
    angle : float
        Half the cone's opening, rad.
    """

    axis: FloatArray
    angle: float


@dataclass(frozen=True, eq=False)
class Limb:
    """One limb, apart from its numbers, which are in the geometry.

    Attributes
    ----------
    kind : str
        A name of `pkmcal.geometry.limb_kinds.KINDS`, or `CHAIN`.
    actuator : int
        Which actuator drives it, counted from 0; limbs may share one. Of a chain the first of its
        actuators, or -1 where it has none.
    branch : int
        +1 or -1, the sign of u·∂c/∂q̃ with u from carriage to platform joint; 0 where the kind
        has no branches.
    frames : mapping of str to ndarray (3, 3)
        Of each axis of the core (`pkmcal.core.AXES`) that the kind has: orthonormal and
        right-handed, columns e1 e2 e3. e3 is the stated reference of the slider, the crank's axis,
        the normal, the universal or the revolute joint's axis; e1 is the crank's direction at
        q̃ = 0 and otherwise chosen from e3.
    couple : float
        Length λ of the couple row in mm; 0 without that row.
    weights : tuple of float
        Of the rows beside the sphere row, in the order of ``LimbKind.all_rows``.
    stroke : tuple of float or None
        Limits of q̃; mm or rad.
    base_cone, platform_cone : Cone or None
        Limits of the joints.
    parts : tuple of int
        How many parts of a cable run from each of its points to the platform; of a tackle.
    law : Law or None
        What lies between the actuator's reading and q̃ beside gain and offset; of chains their
        joints have it.
    """

    kind: str
    actuator: int
    branch: int
    frames: Mapping[str, FloatArray]
    couple: float = 0.0
    weights: tuple[float, ...] = ()
    stroke: tuple[float, float] | None = None
    base_cone: Cone | None = None
    platform_cone: Cone | None = None
    law: Law | None = None
    parts: tuple[int, ...] = ()

    @property
    def frame(self) -> FloatArray:
        """Frame of the base axis; the identity where unused."""
        return self.frames.get("base", np.eye(3))

    @property
    def platform_frame(self) -> FloatArray:
        """Frame of the platform axis; the identity where unused."""
        return self.frames.get("platform", np.eye(3))

    def for_core(self) -> dict[str, Any]:
        """The limb as `pkmcal.core.machine.Machine` takes it."""
        kind = KINDS[self.kind]
        rows = kind.all_rows(self.couple > 0)
        return {
            "driver": kind.driver,
            "rows": rows,
            "actuator": self.actuator,
            "branch": self.branch,
            "angle": kind.actuator_unit == "rad",
            "near": np.nan if self.stroke is None else sum(self.stroke) / 2,
            "frames": self.frames,
            "lever": self.couple,
            "parts": self.parts,
            "weights": [1.0, *(self.weights or [1.0] * len(rows))],
        }


@dataclass(frozen=True, eq=False)
class Model:
    """A robot as its file describes it; mm and rad.

    Attributes
    ----------
    name : str
        The robot's name.
    map : str
        Pose map: "spatial", "translation", "planar", "2tpr2tps", "spherical" or "xy".
    home : ndarray (6,)
        x y z α β γ; what the map does not leave free is 0.
    match : tuple of str or None
        The coordinates that determine a pose where limbs constrain it.
    limbs : tuple of Limb
        Limb 1 first.
    geometry : Geometry
        The numbers of the limbs and the named parameters.
    free : tuple of str
        Names that a calibration frees by default; empty when the file has none.
    stated : mapping of str to float
        What a data sheet claims, by name of a number, of a slot ("rod": every rod), or of
        `pkmcal.geometry.robot_file.STATED_SIZES`.
    base_frame : ndarray (6,) or None
        Pose of the machine's own frame in the frame poses are given in.
    tool_frame : ndarray (6,) or None
        Pose of the tool in the platform's own frame.
    closure_tolerance : float or None
        What more closures than free coordinates may miss, mm; None means 2e-3 of the size.
    file : str or None
        Where the model was read; a built-in machine has none.
    chains : Chains or None
        The joints, of a machine whose limbs are chains.
    workspace : mapping of str to (float, float)
        Least and largest value of coordinates of the pose, mm and rad: where the machine may go,
        a bed or a frame being in the way. Empty where the file states none.
    load : CableLoad or None
        What acts on the platform, of a machine on cables whose file states it.
    probe : ndarray (3,) or None
        Offset of the bed probe of a printer's firmware, mm: it touches at the nozzle's x and y
        plus the first two, and the nozzle is then the third above the bed. None: not stated.
    controller : Controller or None
        The firmware from which the numbers were imported.
    elastic : Elastic or None
        What yields and what pulls at it; None of a rigid machine.
    uncertainty : StatedUncertainty
        How wrong numbers may be that a calibration does not look for.
    """

    name: str
    map: str
    home: FloatArray
    match: tuple[str, ...] | None
    limbs: tuple[Limb, ...]
    geometry: Geometry
    free: tuple[str, ...]
    stated: Mapping[str, float]
    base_frame: FloatArray | None = None
    tool_frame: FloatArray | None = None
    closure_tolerance: float | None = None
    file: str | None = None
    chains: Chains | None = None
    workspace: Box = field(default_factory=dict)
    load: CableLoad | None = None
    probe: FloatArray | None = None
    controller: Controller | None = None
    elastic: Elastic | None = None
    uncertainty: StatedUncertainty = NOTHING

    def __post_init__(self) -> None:
        if self.load is not None:  # some of its numbers may be those of the geometry
            object.__setattr__(self, "load", self.load.with_numbers(dict(self.geometry.items())))

    def with_geometry(self, geometry: Geometry) -> Model:
        """Return the model with other numbers: `replace` for a search, ten times as fast."""
        other = object.__new__(Model)
        other.__dict__.update(vars(self), geometry=geometry)
        other.__post_init__()
        return other

    @property
    def rigid(self) -> Model:
        """Return the model without elastic numbers and loads."""
        if self.elastic is None:
            return self
        free = tuple(name for name in self.free if not is_elastic(name))
        geometry = self.geometry.without(is_elastic)
        return replace(self, geometry=geometry, free=free, elastic=None)

    @property
    def balanced_load(self) -> CableLoad | None:
        """The load that tensions of a calibration's rows balance; None: they need not."""
        return self.load if self.load is not None and self.load.balance else None

    @property
    def n_actuators(self) -> int:
        """Number of actuators."""
        if self.chains is not None:
            return self.chains.n_actuators
        return 1 + max(limb.actuator for limb in self.limbs)

    @property
    def actuator_units(self) -> tuple[Unit, ...]:
        """Unit of each actuator coordinate, "mm" or "rad"."""
        if self.chains is not None:
            return tuple(joint.unit for _, joint in self.chains.actuated)
        units = {limb.actuator: KINDS[limb.kind].actuator_unit for limb in self.limbs}
        return tuple(units[i] for i in range(self.n_actuators))

    @property
    def laws(self) -> tuple[Law | None, ...]:
        """The law of each drive: of each limb, or of each actuator of chains."""
        if self.chains is not None:
            return tuple(joint.law for _, joint in self.chains.actuated)
        return tuple(limb.law for limb in self.limbs)

    @property
    def driven(self) -> bool:
        """True if any drive has a law beside its gain and offset."""
        return any(law is not None for law in self.laws)

    @property
    def drives(self) -> tuple[Drive, ...]:
        """The drives as the core takes them."""
        if self.chains is not None:
            return tuple(
                drive(joint.law, a + 1, joint.unit, a, self.geometry, joint.stroke)
                for a, (_, joint) in enumerate(self.chains.actuated)
            )
        return tuple(
            drive(
                limb.law, i, KINDS[limb.kind].actuator_unit, limb.actuator, self.geometry,
                limb.stroke,
            )
            for i, limb in enumerate(self.limbs, 1)
        )  # fmt: skip

    @property
    def own_width(self) -> int:
        """Number of a limb's slots in the geometry, apart from those of drive laws."""
        return len(SLOTS) + 3 * max(
            (len(limb.parts) - 1 for limb in self.limbs if limb.parts), default=0
        )

    @property
    def pulleys(self) -> tuple[int, ...]:
        """Limbs, counted from 0, that run over a pulley."""
        return tuple(i for i, limb in enumerate(self.limbs) if limb.kind == "pulley")

    @property
    def bent(self) -> tuple[int, ...]:
        """Limbs, counted from 0, that run over a pulley or over several points."""
        kinds = [KINDS.get(limb.kind) for limb in self.limbs]  # a chain of joints has none
        return tuple(i for i, kind in enumerate(kinds) if kind is not None and kind.driver in BENT)

    def doubts(self) -> list[tuple[int, str]]:
        """Drive laws without an inverse over their stroke: limbs, counted from 0, and why."""
        if not self.driven:
            return []
        slots = self.geometry.slots
        found = Laws(self.drives, slots.size).doubts(slots)
        return [(self.limb_of_drive(d), why) for d, why in found.items()]

    def limb_of_drive(self, d: int) -> int:
        """The limb, counted from 0, that a drive is in."""
        return d if self.chains is None else self.chains.actuated[d][0]

    def table(self) -> Table:
        """Kind, actuator and joints of each limb; the joints in the frames of base and platform.

        Of chains every joint, the machine at home.
        """
        if self.chains is not None:
            return self.chains.table()
        rows = [
            [
                *(str(i), limb.kind, f"q{limb.actuator + 1}"),
                *(fixed(float(place), 3) for place in numbers[:6]),
            ]
            for i, (limb, numbers) in enumerate(
                zip(self.limbs, self.geometry.slots.reshape(len(self.limbs), -1), strict=True), 1
            )
        ]
        heads = [f"{x} [mm]" for x in ("base x", "y", "z", "platform x", "y", "z")]
        return Table(["limb", "kind", "actuator", *heads], rows, left=3)
