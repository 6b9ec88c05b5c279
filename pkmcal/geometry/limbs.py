"""Limbs in closed form: a driver, the sphere row and rows beside it, apart from their numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.display import Table, fixed
from pkmcal.geometry.drivers import Driver
from pkmcal.geometry.laws import Law
from pkmcal.geometry.limb_kinds import KINDS
from pkmcal.geometry.mechanism import StatedDrive

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
    def driver(self) -> Driver | None:
        """Driver of its kind; None of a chain, whose joints say how it is moved."""
        return None if self.kind == CHAIN else KINDS[self.kind].driver

    @property
    def cable(self) -> bool:
        """True if it pulls and cannot push."""
        return self.kind != CHAIN and KINDS[self.kind].cable

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
            "driver": kind.driver.name,
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
class Limbs:
    """The limbs of a machine as `pkmcal.geometry.mechanism.Mechanism`: none of them a chain.

    Attributes
    ----------
    limbs : tuple of Limb
        Limb 1 first.
    """

    limbs: tuple[Limb, ...]

    closed_form: Literal[True] = field(default=True, init=False)
    apart: Literal[True] = field(default=True, init=False)
    loose: Literal[False] = field(default=False, init=False)
    tail: Literal[0] = field(default=0, init=False)
    key_of_drives: Literal["drive"] = field(default="drive", init=False)

    @cached_property
    def stated_drives(self) -> tuple[StatedDrive, ...]:
        """The drive of each limb."""
        return tuple(
            StatedDrive(limb.actuator, limb.law, KINDS[limb.kind].actuator_unit, limb.stroke, i)
            for i, limb in enumerate(self.limbs)
        )

    @property
    def first_drives(self) -> range:
        """The drive of each limb, counted from 0."""
        return range(len(self.limbs))

    @property
    def passive_names(self) -> tuple[str, ...]:
        """Swivels of pulleys."""
        swivels = (limb.driver is not None and limb.driver.swivels for limb in self.limbs)
        return tuple(f"swivel{i}" for i, swivel in enumerate(swivels, 1) if swivel)

    @property
    def read_at_home(self) -> None:
        """None: what actuators read at home follows from the inverse."""

    def row_actuators(self, rows: int) -> list[int]:
        """Return the actuator of each closure; -1 of rows beside a limb's own."""
        found: list[int] = []
        for limb in self.limbs:
            beside = KINDS[limb.kind].all_rows(limb.couple > 0)
            found += [limb.actuator] + [-1] * len(beside)
        return found

    def characteristic_length(self, slots: FloatArray) -> float:
        """Return the root mean square distance of the platform joints from their centre, mm.

        Of the base points where the platform joints coincide.
        """
        for joints in (slots[:, 3:6], slots[:, 0:3]):
            spread = joints - joints.mean(axis=0)
            radius = float(np.sqrt((spread**2).sum(axis=1).mean()))
            if radius > 1e-9 * (1.0 + float(np.abs(slots[:, :6]).max())):
                return radius
        return 1.0

    def extent(self, slots: FloatArray, home: FloatArray) -> float:
        """Return a distance from the origin that the machine cannot reach beyond, mm."""
        joints = np.abs(slots[:, :6]).sum(axis=1)
        return float(joints.max() + np.abs(home[:3]).sum())

    def base_points(self, slots: FloatArray) -> FloatArray:
        """Return the base joint of each limb, (limbs, 3), mm."""
        return slots[:, :3]

    def table(self, slots: FloatArray) -> Table:
        """Return kind, actuator and joints of each limb, in the frames of base and platform."""
        rows = [
            [
                *(str(i), limb.kind, f"q{limb.actuator + 1}"),
                *(fixed(float(place), 3) for place in numbers[:6]),
            ]
            for i, (limb, numbers) in enumerate(zip(self.limbs, slots, strict=True), 1)
        ]
        heads = [f"{x} [mm]" for x in ("base x", "y", "z", "platform x", "y", "z")]
        return Table(["limb", "kind", "actuator", *heads], rows, left=3)
